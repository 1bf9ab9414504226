//! The command line: ROS arguments in, everything else refused.

use std::path::PathBuf;

use log::LevelFilter;
use ros2args::{RemapRule, Ros2Args, Ros2ArgsError};

use super::rules::{self, Assignment};
use crate::text::clip;

/// The ROS arguments that [`Arguments::split`] takes, for a program's `--help`.
pub const HELP: &str = "\
ROS arguments:
  -p, --param name:=value        set a parameter (node:name:=value: for that node only)
      --params-file FILE         set parameters from a YAML file
  -r, --remap from:=to           rename a topic; __node:=name and __ns:=/namespace rename the node
      --log-level LEVEL          debug, info, warn, error, fatal or unset (logger:=LEVEL: for that logger only)
      --disable-rosout-logs      do not publish log messages to /rosout
      --disable-stdout-logs      do not print log messages
  -e, --enclave PATH             accepted; this build has no DDS security
";

/// ROS arguments, read but not yet applied to a node.
#[derive(Debug, Clone, PartialEq)]
pub struct Arguments {
    /// Renames of the node and of its topics, in the order given.
    pub remaps: Vec<RemapRule>,
    /// `-p` and parameter files, in the order given; [`super::overrides`] defines their precedence.
    pub parameters: Vec<ParameterSource>,
    /// Log levels as (logger, level), in the order given; no logger: all of them.
    pub log_levels: Vec<(Option<String>, LevelFilter)>,
    /// Whether log messages go to /rosout.
    pub rosout_logs: bool,
    /// Whether log messages are printed.
    pub console_logs: bool,
}

/// A source of values for parameters.
#[derive(Debug, Clone, PartialEq)]
pub enum ParameterSource {
    /// `--params-file`.
    File(PathBuf),
    /// `-p`.
    Assignment(Assignment),
}

impl Default for Arguments {
    /// Returns the arguments of an empty command line.
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

/// The node's command line.
#[derive(Debug, Clone, PartialEq)]
pub enum Command {
    /// Start.
    Run(Arguments),
    /// Print the help and end.
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
    /// A value that ROS does not know.
    #[error("argument {argument} {}: {reason}", clip(value))]
    Value {
        /// The argument.
        argument: &'static str,
        /// The text after it.
        value: String,
        /// What is wrong with it.
        reason: String,
    },
    /// The last argument lacks its value.
    #[error("argument {argument} needs a value after it")]
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
        /// The alternative.
        instead: &'static str,
    },
}

impl Command {
    /// Returns the command in the node's arguments, without the program's own name.
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
        let mut found = Self::default();
        let rest = found.take(arguments)?;
        let (ros, others) = ros2args::parse_ros2_args(&rest)?;
        found.take_switches(ros)?;
        Ok((found, others))
    }

    /// Returns the arguments without those that have a value with a grammar of its own, which it keeps: the parser would
    /// part files from assignments, read values by other rules than rcl, and ignore rules that match no node.
    ///
    /// Also drops `--log-file-name`, which ROS accepts and the parser does not: the node writes no log file.
    fn take(&mut self, arguments: &[String]) -> Result<Vec<String>, ArgumentError> {
        let mut rest = Vec::new();
        let mut in_ros_arguments = false;
        let mut arguments = arguments.iter();
        while let Some(argument) = arguments.next() {
            match argument.as_str() {
                "--ros-args" => in_ros_arguments = true,
                "--" => in_ros_arguments = false,
                _ => {}
            }
            let kind = ValueKind::of(argument).filter(|_| in_ros_arguments);
            let Some(kind) = kind else {
                rest.push(argument.clone());
                continue;
            };
            let value = arguments.next().ok_or_else(|| ArgumentError::NoValue {
                argument: argument.clone(),
            })?;
            self.keep(kind, value)
                .map_err(|(argument, reason)| ArgumentError::Value {
                    argument,
                    value: value.clone(),
                    reason,
                })?;
        }
        Ok(rest)
    }

    fn keep(&mut self, kind: ValueKind, value: &str) -> Result<(), (&'static str, String)> {
        match kind {
            ValueKind::Parameter => {
                let expected = "; expected name:=value or node:name:=value";
                let given = rules::assignment(value).map_err(|fault| ("-p", fault + expected))?;
                self.parameters.push(ParameterSource::Assignment(given));
            }
            ValueKind::ParameterFile => {
                self.parameters
                    .push(ParameterSource::File(PathBuf::from(value)));
            }
            ValueKind::Remap => {
                let expected = "; expected from:=to or node:from:=to";
                let rule = rules::remap(value).map_err(|fault| ("-r", fault + expected))?;
                self.remaps.push(rule);
            }
            ValueKind::LogLevel => {
                let (logger, level) =
                    rules::log_level(value).map_err(|fault| ("--log-level", fault))?;
                self.log_levels
                    .retain(|(known, _)| known.as_deref() != logger);
                let logger = logger.map(str::to_owned);
                self.log_levels.extend(level.map(|level| (logger, level)));
            }
            ValueKind::LogFileName => {}
        }
        Ok(())
    }

    fn take_switches(&mut self, ros: Ros2Args) -> Result<(), ArgumentError> {
        if ros.log_config_file.is_some() {
            return Err(ArgumentError::Unsupported {
                argument: "--log-config-file",
                instead: "use --log-level, or RUST_LOG for finer filters",
            });
        }
        if let Some(value) = ros.enclave.filter(|path| !rules::is_enclave(path)) {
            return Err(ArgumentError::Value {
                argument: "--enclave",
                value,
                reason: "expected names with slashes before them, as in /left/lidar".to_owned(),
            });
        }
        self.rosout_logs = ros.logging_output.rosout.unwrap_or(true);
        self.console_logs = ros.logging_output.stdout.unwrap_or(true);
        Ok(())
    }
}

/// Arguments with a value that is read here.
#[derive(Debug, Clone, Copy)]
enum ValueKind {
    Parameter,
    ParameterFile,
    Remap,
    LogLevel,
    LogFileName,
}

impl ValueKind {
    fn of(argument: &str) -> Option<Self> {
        Some(match argument {
            "-p" | "--param" => Self::Parameter,
            "--params-file" => Self::ParameterFile,
            "-r" | "--remap" => Self::Remap,
            "--log-level" => Self::LogLevel,
            "--log-file-name" => Self::LogFileName,
            _ => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::ParameterValue;

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
            "scan:=a",
            "-p",
            "retries:=1",
            "--params-file",
            "a.yaml",
            "--params-file",
            "b.yaml",
            "--log-level",
            "warn",
            "--log-level",
            "rustdds:=debug",
            "--log-level",
            "rclrs:=debug",
            "--log-level",
            "rclrs:=unset",
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
                    name: "retries".to_owned(),
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
            "driver",
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
            &["--ros-args", "-p", "/sensor_driver:a:=1"],
            &["--ros-args", "-p", "a:=@x"],
            &["--ros-args", "--log-file-name"],
            &["--ros-args", "-r", "a"],
            &["--ros-args", "-r", "/**:scan:=a"],
            &["--ros-args", "-e", "left"],
            &["--ros-args", "--log-level", "loud"],
            &["--ros-args", "--bogus"],
            &["--ros-args", "--log-config-file", "x"],
        ] {
            assert!(parse(wrong).is_err(), "{wrong:?}");
        }
    }
}
