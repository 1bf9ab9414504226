//! The command line: ROS arguments in, everything else refused.

use std::path::PathBuf;

use log::LevelFilter;
use ros2args::{LogLevel, RemapRule, Ros2Args, Ros2ArgsError};

use super::parameter_file;
use crate::config::ParameterValue;
use crate::text::clip;

/// What `--help` prints.
pub const HELP: &str = "\
Estimates a tanker's pose from detected beacons, and publishes it with its covariance.

Usage: tanker_pose_node [--ros-args [ROS ARGUMENT]... [--]]

ROS arguments:
  -p, --param name:=value        set a parameter (node:name:=value: for that node only)
      --params-file FILE         set parameters from a YAML file
  -r, --remap from:=to           rename a topic; __node:=name and __ns:=/namespace rename the node
      --log-level LEVEL          debug, info, warn, error or fatal (logger:=LEVEL: for that logger only)
      --disable-rosout-logs      do not publish log messages to /rosout
      --disable-stdout-logs      do not print log messages
  -e, --enclave PATH             accepted; this build has no DDS security

Options:
  -h, --help                     print this help
  -V, --version                  print the version

Topics in: camera_info; feature_points, or detections with parameter input; the receiver's attitude, with the outputs
  for flight stacks that need it. Out: pose, odometry, status, /diagnostics; by parameters /tf, markers, receptacle and
  those of PX4 and MAVROS. Services: ~/reset, those of parameters, and with lifecycle those of a managed node.
Environment: ROS_DOMAIN_ID, ROS_AUTOMATIC_DISCOVERY_RANGE, ROS_LOCALHOST_ONLY, RUST_LOG.
All parameters stand with their defaults and comments in config/tanker_pose.yaml.
";

/// ROS arguments, read but not yet applied to a node.
#[derive(Debug, Clone, PartialEq)]
pub struct Arguments {
    /// Renames of the node and of its topics, in the order given.
    pub remaps: Vec<RemapRule>,
    /// `-p` and parameter files, in the order given; what counts of them, [`super::overrides`] says.
    pub parameters: Vec<ParameterSource>,
    /// Log levels as (logger, level), in the order given; no logger: all of them.
    pub log_levels: Vec<(Option<String>, LevelFilter)>,
    /// Whether log messages go to /rosout.
    pub rosout_logs: bool,
    /// Whether log messages are printed.
    pub console_logs: bool,
}

/// What gives values to parameters.
#[derive(Debug, Clone, PartialEq)]
pub enum ParameterSource {
    /// `--params-file`.
    File(PathBuf),
    /// `-p`.
    Assignment(Assignment),
}

/// `-p node:name:=value`.
#[derive(Debug, Clone, PartialEq)]
pub struct Assignment {
    /// Base name of the node; none: every node.
    pub node: Option<String>,
    /// The parameter.
    pub name: String,
    /// None where something stands that no parameter can hold.
    pub value: Option<ParameterValue>,
}

impl Default for Arguments {
    /// Returns what an empty command line says.
    fn default() -> Self {
        Self {
            remaps: Vec::new(),
            parameters: Vec::new(),
            log_levels: Vec::new(),
            rosout_logs: true,
            console_logs: true,
        }
    }
}

/// What the node's command line asks for.
#[derive(Debug, Clone, PartialEq)]
pub enum Command {
    /// Start.
    Run(Arguments),
    /// Print [`HELP`] and end.
    Help,
    /// Print the version and end.
    Version,
}

/// Why a command line cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ArgumentError {
    /// A malformed ROS argument.
    #[error("{0}")]
    Ros(#[from] Ros2ArgsError),
    /// A `-p` that is no assignment.
    #[error(
        "argument -p {}: {reason}; expected name:=value or node:name:=value",
        clip(argument)
    )]
    Assignment {
        /// What came.
        argument: String,
        /// What is wrong with it.
        reason: String,
    },
    /// An argument that stands last and needs another one behind it.
    #[error("argument {argument} needs a value behind it")]
    NoValue {
        /// The argument.
        argument: String,
    },
    /// Not a ROS argument at all.
    #[error(
        "unexpected argument {argument:?}: this node takes ROS arguments only, after --ros-args"
    )]
    NotRos {
        /// The argument.
        argument: String,
    },
    /// Known to ROS, but not done here.
    #[error("{argument} is not supported: {instead}")]
    Unsupported {
        /// The argument.
        argument: &'static str,
        /// What to do instead.
        instead: &'static str,
    },
}

impl Command {
    /// Returns what the node is asked to do by its arguments, the program's own name left out.
    ///
    /// # Errors
    /// [`ArgumentError`] when an argument is malformed, not a ROS argument, or not supported.
    pub fn parse(arguments: &[String]) -> Result<Self, ArgumentError> {
        let (ros, others) = Arguments::split(arguments)?;
        // `--` after the ROS arguments may close the list without anything behind it.
        let mut others = others.iter().filter(|argument| *argument != "--");
        match others.next().map(String::as_str) {
            None => Ok(Self::Run(ros)),
            Some("-h" | "--help") => Ok(Self::Help),
            Some("-V" | "--version") => Ok(Self::Version),
            Some(other) => Err(ArgumentError::NotRos {
                argument: other.to_owned(),
            }),
        }
    }
}

impl Arguments {
    /// Returns the ROS arguments among `arguments`, and the others in their order: for programs with
    /// arguments of their own.
    ///
    /// # Errors
    /// [`ArgumentError`] when a ROS argument is malformed or not supported.
    pub fn split(arguments: &[String]) -> Result<(Self, Vec<String>), ArgumentError> {
        let (rest, parameters) = take_parameters(arguments)?;
        let (ros, others) = ros2args::parse_ros2_args(&rest)?;
        Ok((Self::from_ros(ros, parameters)?, others))
    }

    fn from_ros(ros: Ros2Args, parameters: Vec<ParameterSource>) -> Result<Self, ArgumentError> {
        if ros.log_config_file.is_some() {
            return Err(ArgumentError::Unsupported {
                argument: "--log-config-file",
                instead: "use --log-level, or RUST_LOG for finer filters",
            });
        }
        let log_levels = ros
            .log_levels
            .into_iter()
            .map(|assignment| (assignment.logger_name, filter(assignment.level)))
            .collect();
        Ok(Self {
            remaps: ros.remap_rules,
            parameters,
            log_levels,
            rosout_logs: ros.logging_output.rosout.unwrap_or(true),
            console_logs: ros.logging_output.stdout.unwrap_or(true),
        })
    }
}

/// Returns the arguments without those that give values to parameters, and these in their order: the parser would part
/// files from assignments, and read values by other rules than rcl.
///
/// Also takes away what ROS accepts and the parser does not: `--log-file-name` (the node writes no log file) and the
/// level `UNSET`, which leaves levels as they are.
fn take_parameters(
    arguments: &[String],
) -> Result<(Vec<String>, Vec<ParameterSource>), ArgumentError> {
    let (mut rest, mut sources) = (Vec::new(), Vec::new());
    let mut in_ros_arguments = false;
    let mut arguments = arguments.iter();
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--ros-args" => in_ros_arguments = true,
            "--" => in_ros_arguments = false,
            _ => {}
        }
        let takes_value = matches!(
            argument.as_str(),
            "-p" | "--param" | "--params-file" | "--log-file-name" | "--log-level"
        );
        if !in_ros_arguments || !takes_value {
            rest.push(argument.clone());
            continue;
        }
        let value = arguments.next().ok_or_else(|| ArgumentError::NoValue {
            argument: argument.clone(),
        })?;
        match argument.as_str() {
            "-p" | "--param" => sources.push(ParameterSource::Assignment(assignment(value)?)),
            "--params-file" => sources.push(ParameterSource::File(PathBuf::from(value))),
            "--log-level" if !is_unset(value) => rest.extend([argument.clone(), value.clone()]),
            _ => {}
        }
    }
    Ok((rest, sources))
}

fn is_unset(level: &str) -> bool {
    let level = level.rsplit_once(":=").map_or(level, |(_, level)| level);
    level.eq_ignore_ascii_case("unset")
}

fn assignment(argument: &str) -> Result<Assignment, ArgumentError> {
    let fault = |reason: String| ArgumentError::Assignment {
        argument: argument.to_owned(),
        reason,
    };
    let Some((target, word)) = argument.split_once(":=") else {
        return Err(fault("it has no :=".to_owned()));
    };
    let (node, name) = match target.split_once(':') {
        Some((node, name)) => (Some(node), name),
        None => (None, target),
    };
    if let Some(node) = node.filter(|node| !is_base_name(node)) {
        return Err(fault(format!(
            "{:?} is not a node's name without its namespace",
            clip(node)
        )));
    }
    if name.is_empty() || name.contains(':') {
        return Err(fault(format!("{:?} is no parameter", clip(name))));
    }
    if word.is_empty() {
        return Err(fault("the value is missing".to_owned()));
    }
    let value = parameter_file::value(word).map_err(fault)?;
    Ok(Assignment {
        node: node.map(str::to_owned),
        name: name.to_owned(),
        value,
    })
}

fn is_base_name(name: &str) -> bool {
    let is_word = |letter: char| letter.is_ascii_alphanumeric() || letter == '_';
    !name.is_empty()
        && name.chars().all(is_word)
        && !name.starts_with(|first: char| first.is_ascii_digit())
}

/// The `log` crate knows nothing above error.
const fn filter(level: LogLevel) -> LevelFilter {
    match level {
        LogLevel::Debug => LevelFilter::Debug,
        LogLevel::Info => LevelFilter::Info,
        LogLevel::Warn => LevelFilter::Warn,
        LogLevel::Error | LogLevel::Fatal => LevelFilter::Error,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(arguments: &[&str]) -> Result<Command, ArgumentError> {
        let arguments: Vec<_> = arguments
            .iter()
            .map(|&argument| argument.to_owned())
            .collect();
        Command::parse(&arguments)
    }

    #[test]
    fn no_arguments_start_the_node_with_its_defaults() {
        assert_eq!(
            parse(&[]).expect("empty is fine"),
            Command::Run(Arguments::default())
        );
        let closed = parse(&["--ros-args", "--", "--ros-args"]).expect("empty sections are fine");
        assert_eq!(closed, Command::Run(Arguments::default()));
    }

    #[test]
    fn ros_arguments_are_read_in_their_order() {
        let command = parse(&[
            "--ros-args",
            "-r",
            "__ns:=/uav1",
            "-r",
            "pose:=a",
            "-p",
            "max_outliers:=1",
            "--params-file",
            "a.yaml",
            "--params-file",
            "b.yaml",
            "--log-level",
            "warn",
            "--log-level",
            "rustdds:=debug",
            "-e",
            "/enclave",
        ]);
        let Ok(Command::Run(arguments)) = command else {
            unreachable!("expected a run, got {command:?}");
        };
        assert_eq!(arguments.remaps.len(), 2);
        assert_eq!(
            arguments.parameters,
            [
                ParameterSource::Assignment(Assignment {
                    node: None,
                    name: "max_outliers".to_owned(),
                    value: Some(ParameterValue::Integer(1)),
                }),
                ParameterSource::File(PathBuf::from("a.yaml")),
                ParameterSource::File(PathBuf::from("b.yaml")),
            ]
        );
        assert_eq!(
            arguments.log_levels,
            [
                (None, LevelFilter::Warn),
                (Some("rustdds".to_owned()), LevelFilter::Debug)
            ]
        );
    }

    #[test]
    fn what_only_ros_has_a_use_for_is_accepted() {
        let command = parse(&[
            "--ros-args",
            "--log-file-name",
            "tanker",
            "--log-level",
            "UNSET",
            "--log-level",
            "rcl:=unset",
        ]);
        assert_eq!(
            command.expect("ROS takes them"),
            Command::Run(Arguments::default())
        );
    }

    #[test]
    fn help_and_version_are_answered() {
        assert_eq!(parse(&["--help"]).expect("known"), Command::Help);
        assert_eq!(parse(&["-V"]).expect("known"), Command::Version);
    }

    #[test]
    fn what_is_not_a_ros_argument_is_refused_by_name() {
        let refused = parse(&["config.yaml"]).expect_err("not a ROS argument");
        assert!(refused.to_string().contains("config.yaml"), "{refused}");
        for wrong in [
            &["--ros-args", "--params-file"][..],
            &["--ros-args", "-p", "a"],
            &["--ros-args", "-p", "a:="],
            &["--ros-args", "-p", ":=1"],
            &["--ros-args", "-p", "/**:a:=1"],
            &["--ros-args", "-p", "/tanker_pose:a:=1"],
            &["--ros-args", "-p", "a:=@x"],
            &["--ros-args", "--log-file-name"],
            &["--ros-args", "-r", "a"],
            &["--ros-args", "--log-level", "loud"],
            &["--ros-args", "--bogus"],
            &["--ros-args", "--log-config-file", "x"],
        ] {
            assert!(parse(wrong).is_err(), "{wrong:?}");
        }
    }
}
