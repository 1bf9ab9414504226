//! The command line: ROS arguments in, everything else refused.

use std::path::PathBuf;

use log::LevelFilter;
use ros2args::{LogLevel, ParamAssignment, RemapRule, Ros2Args, Ros2ArgsError};

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
    /// `-p` assignments, in the order given; they override the files.
    pub parameters: Vec<ParamAssignment>,
    /// Parameter files, in the order given; a later file overrides an earlier one.
    pub parameter_files: Vec<PathBuf>,
    /// Log levels as (logger, level), in the order given; no logger: all of them.
    pub log_levels: Vec<(Option<String>, LevelFilter)>,
    /// Whether log messages go to /rosout.
    pub rosout_logs: bool,
    /// Whether log messages are printed.
    pub console_logs: bool,
}

impl Default for Arguments {
    /// Returns what an empty command line says.
    fn default() -> Self {
        Self {
            remaps: Vec::new(),
            parameters: Vec::new(),
            parameter_files: Vec::new(),
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
        let (ros, others) = ros2args::parse_ros2_args(arguments)?;
        Ok((Self::from_ros(ros)?, others))
    }

    fn from_ros(ros: Ros2Args) -> Result<Self, ArgumentError> {
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
            parameters: ros.param_assignments,
            parameter_files: ros.param_files,
            log_levels,
            rosout_logs: ros.logging_output.rosout.unwrap_or(true),
            console_logs: ros.logging_output.stdout.unwrap_or(true),
        })
    }
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
        assert_eq!(arguments.parameters[0].as_i64(), Some(1));
        assert_eq!(
            arguments.parameter_files,
            [PathBuf::from("a.yaml"), PathBuf::from("b.yaml")]
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
            &["--ros-args", "-r", "a"],
            &["--ros-args", "--log-level", "loud"],
            &["--ros-args", "--bogus"],
            &["--ros-args", "--log-config-file", "x"],
        ] {
            assert!(parse(wrong).is_err(), "{wrong:?}");
        }
    }
}
