//! `tanker_pose parameters`: what the node would start with under given ROS arguments, without starting it, and what
//! its parameters are.

use std::io::Write;

use tanker_pose::config::{ParameterValue, parameter_file, parameter_tables};
use tanker_pose::ros::arguments::ArgumentError;
use tanker_pose::ros::node::{NodeError, effective_parameters};

use crate::ros_options::RosOptions;

/// Print the parameters that the node would start with under the same ROS arguments, as a parameter file
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Print every parameter at its default, with range, unit and meaning, as the shipped parameter file does
    #[arg(long, conflicts_with_all = ["markdown", "ros_args"])]
    yaml: bool,
    /// Print the same as the tables of docs/parameters.md
    #[arg(long, conflicts_with = "ros_args")]
    markdown: bool,
    #[command(flatten)]
    ros: RosOptions,
}

/// Why no parameters can be printed.
#[derive(Debug, thiserror::Error)]
pub enum ParametersError {
    #[error(transparent)]
    Arguments(#[from] ArgumentError),
    #[error(transparent)]
    Node(#[from] Box<NodeError>),
    #[error("cannot write the output: {0}")]
    Write(#[from] std::io::Error),
}

/// Prints the parameters on standard output, and warnings on standard error.
pub fn run(arguments: &Arguments) -> Result<(), ParametersError> {
    let mut output = std::io::stdout().lock();
    if arguments.yaml {
        return Ok(output.write_all(parameter_file().as_bytes())?);
    }
    if arguments.markdown {
        return Ok(output.write_all(parameter_tables().as_bytes())?);
    }
    let (names, start) = effective_parameters(&arguments.ros.read()?).map_err(Box::new)?;
    for warning in &start.warnings {
        eprintln!("tanker_pose: warning: {warning}");
    }
    writeln!(output, "{}:\n  ros__parameters:", names.fully_qualified())?;
    for (name, value) in start.parameters.iter() {
        match value {
            ParameterValue::Bool(value) => writeln!(output, "    {name}: {value}")?,
            ParameterValue::Integer(value) => writeln!(output, "    {name}: {value}")?,
            ParameterValue::Double(value) => writeln!(output, "    {name}: {value:?}")?,
            // JSON's strings are YAML's, too.
            ParameterValue::String(value) => {
                writeln!(output, "    {name}: {}", serde_json::json!(value))?;
            }
        }
    }
    Ok(())
}
