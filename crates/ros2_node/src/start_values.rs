//! Parameters at the start: defaults, overridden by files and arguments.

use super::arguments::Arguments;
use super::overrides::{Override, Overrides, Place};
use super::parameter_file::ParameterFileError;
use super::qos_overrides::{self, QosOverrideError, QosOverrides};
use crate::parameters::{ParameterError, ParameterValue, Parameters};
use crate::text::clip;

/// Why the parameters given at the start cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StartParameterError {
    /// A file.
    #[error(transparent)]
    File(#[from] ParameterFileError),
    /// A value.
    #[error("{place}: {source}")]
    Value {
        /// Its place.
        place: Place,
        /// What is wrong.
        source: StartValueError,
    },
    /// A parameter that a file sets twice under one node name or pattern.
    ///
    /// DIFFERENCE: ROS takes the last one.
    #[error("{place}: parameter {name:?} is set twice under the same name, first in line {first}")]
    Repeated {
        /// Of the second one.
        place: Place,
        /// The parameter.
        name: String,
        /// Line of the first one.
        first: u64,
    },
    /// A list, a map, or nothing where a value belongs.
    #[error("{place}: parameter {name:?} needs a bool, a number or text")]
    NoScalar {
        /// Its place.
        place: Place,
        /// The parameter.
        name: String,
    },
}

/// What is wrong with a value.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum StartValueError {
    /// One of the table.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// One of a topic's quality of service.
    #[error(transparent)]
    Qos(#[from] QosOverrideError),
}

/// What [`start_values`] found.
#[derive(Debug, Clone, PartialEq)]
pub struct StartValues {
    /// A value for every parameter.
    pub parameters: Parameters,
    /// The topics' quality of service.
    pub qos: QosOverrides,
    /// What is allowed, but perhaps not meant.
    pub warnings: Vec<String>,
}

/// Returns the parameters of the node with this absolute name: `parameters`, overridden by files and `-p` in the order
/// that [`Overrides`] says; and so with `qos`.
///
/// # Errors
/// [`StartParameterError`] names the parameter, and the file and line that it stands in.
pub fn start_values(
    arguments: &Arguments,
    node: &str,
    parameters: Parameters,
    qos: QosOverrides,
) -> Result<StartValues, StartParameterError> {
    let mut found = StartValues {
        parameters,
        qos,
        warnings: Vec::new(),
    };
    let overrides = Overrides::gather(&arguments.parameters, node)?;
    for path in &overrides.files_without_section {
        found.warnings.push(format!(
            "parameter file {} has no section for {node}",
            path.display()
        ));
    }
    for given in overrides.repetitions {
        if !given.is_shared || found.is_known(&given.name) {
            return Err(StartParameterError::Repeated {
                place: given.place,
                name: clip(&given.name),
                first: given.first,
            });
        }
    }
    let mut of_others = Vec::new();
    for given in overrides.values {
        // Below a pattern stand the parameters of many nodes.
        if given.is_shared && !found.is_known(&given.name) {
            of_others.push(given);
        } else {
            found.take(given)?;
        }
    }
    let warnings = found.warnings_of_unknown(&of_others);
    found.warnings.extend(warnings);
    Ok(found)
}

impl StartValues {
    /// Leaves out the quality of service of all topics but these, and warns of what was asked of the others.
    pub fn leave_topics(&mut self, opened: &[String]) {
        for name in self.qos.leave(opened) {
            self.warnings.push(format!(
                "parameter {:?} has no effect: as configured the node does not open that topic",
                clip(&name)
            ));
        }
    }

    fn is_known(&self, name: &str) -> bool {
        name.starts_with(qos_overrides::PREFIX) || self.parameters.spec(name).is_some()
    }

    /// Returns one warning for each name that is close to one of the node's, and one for all the others.
    fn warnings_of_unknown(&self, given: &[Override]) -> Vec<String> {
        let mut warnings = Vec::new();
        let mut far = Vec::new();
        for given in given {
            match self.parameters.nearest_name(&given.name) {
                Some(close) => warnings.push(format!(
                    "{}: this node has no parameter {:?}, is {close} meant?",
                    given.place,
                    clip(&given.name)
                )),
                None => far.push(given),
            }
        }
        if let Some((first, others)) = far.split_first() {
            let others = match others.len() {
                0 => String::new(),
                count => format!(", nor {count} others that files set for several nodes"),
            };
            warnings.push(format!(
                "{}: this node has no parameter {:?}{others}",
                first.place,
                clip(&first.name)
            ));
        }
        warnings
    }

    fn take(&mut self, given: Override) -> Result<(), StartParameterError> {
        let Some(value) = given.value else {
            return Err(StartParameterError::NoScalar {
                place: given.place,
                name: clip(&given.name),
            });
        };
        self.set(&given.name, value)
            .map_err(|source| StartParameterError::Value {
                place: given.place,
                source,
            })
    }

    fn set(&mut self, name: &str, value: ParameterValue) -> Result<(), StartValueError> {
        if !name.starts_with(qos_overrides::PREFIX) {
            return Ok(self.parameters.set(name, value)?);
        }
        // Files that serve several nodes carry topics of others.
        if !self.qos.set(name, &value)? {
            let topics: Vec<&str> = self.qos.topics().collect();
            self.warnings.push(format!(
                "parameter {:?} is of no topic of this node: they are {}",
                clip(name),
                topics.join(", ")
            ));
        }
        Ok(())
    }
}

#[cfg(test)]
#[cfg(feature = "client")]
mod tests {
    use super::super::participant::reliable;
    use super::super::qos_overrides::{Endpoint, Role};
    use super::*;
    use crate::parameters::sample::SAMPLE;

    fn arguments(arguments: &[&str]) -> Arguments {
        let all: Vec<String> = ["--ros-args"]
            .iter()
            .chain(arguments)
            .map(|&text| text.to_owned())
            .collect();
        Arguments::split(&all)
            .expect("the test's arguments are well formed")
            .0
    }

    fn started(arguments: &Arguments, node: &str) -> Result<StartValues, StartParameterError> {
        let parameters = Parameters::new(SAMPLE);
        start_values(arguments, node, parameters, QosOverrides::default())
    }

    #[test]
    fn arguments_override_files_and_files_override_defaults() {
        let path = std::env::temp_dir().join(format!("start_values_{}.yaml", std::process::id()));
        let text = "/**:\n  ros__parameters:\n    retries: 2\n    rate_hz: 20\n";
        std::fs::write(&path, text).expect("the directory for temporary files is writable");
        let name = path.to_str().expect("the path is text");
        let given = arguments(&["--params-file", name, "-p", "rate_hz:=1"]);
        let found = started(&given, "/left/sensor");
        std::fs::remove_file(&path).expect("it was just written");
        let found = found.expect("valid").parameters;
        assert_eq!(found.get("retries"), Some(&ParameterValue::Integer(2)));
        assert_eq!(found.get("rate_hz"), Some(&ParameterValue::Double(1.0)));
        assert_eq!(found.get("min_samples"), Some(&ParameterValue::Integer(5)));
    }

    #[test]
    fn argument_for_another_node_is_passed_over() {
        let given = arguments(&["-p", "other:retries:=2", "-p", "sensor:min_samples:=6"]);
        let found = started(&given, "/sensor").expect("valid").parameters;
        assert_eq!(found.get("retries"), Some(&ParameterValue::Integer(1)));
        assert_eq!(found.get("min_samples"), Some(&ParameterValue::Integer(6)));
    }

    #[test]
    fn wrong_arguments_are_refused_by_name() {
        for (argument, name) in [
            ("retrie:=1", "retries"),
            ("retries:=3", "retries"),
            ("retries:=[1]", "retries"),
            ("rate_hz:=.nan", "rate_hz"),
            ("filtered:=~", "filtered"),
        ] {
            let given = arguments(&["-p", argument]);
            let refused = started(&given, "/n").expect_err(argument);
            assert!(refused.to_string().contains(name), "{argument}: {refused}");
        }
    }

    #[test]
    fn qos_of_own_topics_is_overridden_and_that_of_others_is_warned_of() {
        let scan = Endpoint::new("/scan".into(), Role::Publisher, &reliable(50));
        let qos = QosOverrides::new(vec![scan]);
        let given = arguments(&[
            "-p",
            "qos_overrides./scan.publisher.depth:=1",
            "-p",
            "qos_overrides./image.publisher.depth:=2",
        ]);
        let found =
            start_values(&given, "/n", Parameters::new(SAMPLE), qos.clone()).expect("valid");
        let default = reliable(50);
        assert_eq!(
            found.qos.profile("/scan", Role::Publisher, &default),
            reliable(1)
        );
        assert_eq!(found.warnings.len(), 1);
        assert!(
            found.warnings[0].contains("/image"),
            "{}",
            found.warnings[0]
        );

        let mut found = found;
        found.leave_topics(&["/scan".to_owned()]);
        assert_eq!(found.warnings.len(), 1, "it is open");
        found.leave_topics(&[]);
        assert_eq!(found.qos.iter().count(), 0);
        assert!(
            found.warnings[1].contains("/scan.publisher.depth"),
            "{}",
            found.warnings[1]
        );

        let given = arguments(&["-p", "qos_overrides./scan.publisher.depth:=none"]);
        let refused = start_values(&given, "/n", Parameters::new(SAMPLE), qos)
            .expect_err("a word is no depth");
        assert!(
            refused.to_string().contains("an integer from 1"),
            "{refused}"
        );
    }
}
