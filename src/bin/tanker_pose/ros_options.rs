//! Options of tools that are nodes: ROS arguments, and numbers within bounds.

use clap::Args;
use ros2_node::arguments::{ArgumentError, Arguments};
#[cfg(feature = "ros")]
use ros2_node::names::NodeNames;
#[cfg(feature = "ros")]
use ros2_node::overrides::{Overrides, Place};
#[cfg(feature = "ros")]
use ros2_node::parameter_file::ParameterFileError;

/// Launch files set it for every node; a tool that takes no time from `/clock` need not mind.
#[cfg(feature = "ros")]
const SIM_TIME: &str = "use_sim_time";

/// `--ros-args`, as every ROS program takes them.
#[derive(Debug, Clone, Args)]
pub struct RosOptions {
    /// ROS arguments up to `--` or the end: -r from:=to, -r __node:=name, -r __ns:=/ns, --log-level x
    #[arg(
        long,
        value_name = "ARGUMENTS",
        num_args = 0..,
        allow_hyphen_values = true,
        value_terminator = "--"
    )]
    ros_args: Vec<String>,
}

impl RosOptions {
    /// Returns the ROS arguments.
    ///
    /// # Errors
    /// [`ArgumentError`] when one is malformed or not supported.
    pub fn read(&self) -> Result<Arguments, ArgumentError> {
        self.read_with(&[])
    }

    /// Returns the ROS arguments with more of them, which win.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn read_with(&self, more: &[String]) -> Result<Arguments, ArgumentError> {
        let mut all = vec!["--ros-args".to_owned()];
        all.extend(self.ros_args.iter().cloned());
        all.extend(more.iter().cloned());
        Ok(Arguments::split(&all)?.0)
    }
}

/// Why parameters given to a tool without any are refused.
#[cfg(feature = "ros")]
#[derive(Debug, thiserror::Error)]
pub enum NoParametersError {
    #[error(
        "argument -p: {node} has no parameter {name:?}; what it does is set by its options, see --help"
    )]
    InArgument { node: String, name: String },
    #[error(transparent)]
    File(#[from] ParameterFileError),
}

/// Checks parameters given to a tool that has none; returns warnings.
///
/// Files often serve several nodes, by patterns that hold for all of them, so what stands in one is only warned of.
///
/// # Errors
/// [`NoParametersError`] when `-p` sets one, or a file cannot be read.
#[cfg(feature = "ros")]
pub fn check_no_parameters(
    arguments: &Arguments,
    names: &NodeNames,
) -> Result<Vec<String>, NoParametersError> {
    let node = names.fully_qualified();
    let mut warnings = Vec::new();
    for given in Overrides::gather(&arguments.parameters, &node)?.values {
        if given.name == SIM_TIME {
            continue;
        }
        if given.place == Place::Argument {
            let name = given.name;
            return Err(NoParametersError::InArgument { node, name });
        }
        // One is enough: a file for several nodes has many.
        if warnings.is_empty() {
            warnings.push(format!(
                "{}: {node} has no parameters, {:?} has no effect here",
                given.place, given.name
            ));
        }
    }
    Ok(warnings)
}

/// Returns a parser of numbers within bounds.
#[cfg(feature = "ros")]
pub fn between(min: f64, max: f64) -> impl Fn(&str) -> Result<f64, String> + Clone {
    move |text: &str| number(text, min, max)
}

#[cfg(feature = "ros")]
fn number(text: &str, min: f64, max: f64) -> Result<f64, String> {
    let value: f64 = text
        .parse()
        .map_err(|_| format!("expected a number, got {text:?}"))?;
    if (min..=max).contains(&value) {
        Ok(value)
    } else {
        Err(format!(
            "expected a number from {min} to {max}, got {value}"
        ))
    }
}
