//! Parameters from files and arguments, put together for one node as rcl does.
//!
//! rcl keeps one list of values for each node name or pattern, in the order in which the names first appear on the
//! command line, files included; `-p name:=value` stands under `/**`. Within a list the last value of a parameter
//! counts, and of the lists that are for a node the later one. So a file's section with the node's name beats `/**` of
//! the same file, of later files, and of `-p` where `/**` had been seen before.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use super::arguments::ParameterSource;
use super::parameter_file::{self, FileParameter, ParameterFileError, Section};
use crate::parameters::ParameterValue;

/// The pattern that matches all nodes.
const EVERY_NODE: &str = "/**";

/// A value given at the start for a node.
#[derive(Debug, Clone, PartialEq)]
pub struct Override {
    /// The parameter.
    pub name: String,
    /// None for a value that no parameter can hold: a list, a map, nothing.
    pub value: Option<ParameterValue>,
    /// Its place.
    pub place: Place,
    /// Whether it stands under a file's pattern for several nodes, which may mean others.
    pub is_shared: bool,
}

/// A parameter that a file sets again under the same node name or pattern.
#[derive(Debug, Clone, PartialEq)]
pub struct Repetition {
    /// The parameter.
    pub name: String,
    /// The second place.
    pub place: Place,
    /// Line of the first place, from 1.
    pub first: u64,
    /// As [`Override::is_shared`].
    pub is_shared: bool,
}

/// The place of a value.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Place {
    /// In a file.
    File {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: u64,
    },
    /// On the command line.
    Argument,
}

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::File { path, line } => {
                write!(f, "parameter file {}, line {line}", path.display())
            }
            Self::Argument => f.write_str("argument -p"),
        }
    }
}

/// All values given at the start for one node.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Overrides {
    /// The effective one for each parameter.
    pub values: Vec<Override>,
    /// A value that ROS ignores silently.
    pub repetitions: Vec<Repetition>,
    /// Files without a section for this node.
    pub files_without_section: Vec<PathBuf>,
}

impl Overrides {
    /// Returns the values that files and arguments give to the node with this absolute name.
    ///
    /// # Errors
    /// [`ParameterFileError`] of a file that cannot be read, or has values without names for this node.
    pub fn gather(sources: &[ParameterSource], node: &str) -> Result<Self, ParameterFileError> {
        let mut lists: Vec<(String, Vec<Override>)> = Vec::new();
        let (mut repetitions, mut files_without_section) = (Vec::new(), Vec::new());
        for source in sources {
            match source {
                ParameterSource::File(path) => {
                    let mut sections = parameter_file::read(path)?;
                    sections.retain(|section| is_for(&section.pattern, node));
                    if sections.is_empty() {
                        files_without_section.push(path.clone());
                    }
                    let mut seen = HashMap::new();
                    for section in sections {
                        section.check(path)?;
                        let written = section.written.clone();
                        let list = from_section(section, path);
                        repetitions.extend(repeated(&written, &list, &mut seen));
                        append(&mut lists, (written, list));
                    }
                }
                ParameterSource::Assignment(given) => {
                    let (pattern, written) = match &given.node {
                        Some(name) => (format!("/{name}"), name.clone()),
                        None => (EVERY_NODE.to_owned(), EVERY_NODE.to_owned()),
                    };
                    if is_for(&pattern, node) {
                        let value = Override {
                            name: given.name.clone(),
                            value: given.value.clone(),
                            place: Place::Argument,
                            is_shared: false,
                        };
                        append(&mut lists, (written, vec![value]));
                    }
                }
            }
        }
        Ok(Self {
            values: last_of_each(lists.into_iter().flat_map(|(_, list)| list)),
            repetitions,
            files_without_section,
        })
    }
}

/// Returns the last value of each parameter, in their order.
fn last_of_each(given: impl Iterator<Item = Override>) -> Vec<Override> {
    let mut values: Vec<Option<Override>> = Vec::new();
    let mut place_of = HashMap::new();
    for value in given {
        if let Some(earlier) = place_of.insert(value.name.clone(), values.len()) {
            values[earlier] = None;
        }
        values.push(Some(value));
    }
    values.into_iter().flatten().collect()
}

fn is_for(pattern: &str, node: &str) -> bool {
    ros2args::match_wildcard_pattern(pattern, node)
}

fn from_section(section: Section, path: &Path) -> Vec<Override> {
    let is_shared = !section.names_one_node();
    let value = |given: FileParameter| Override {
        name: given.name,
        value: given.value,
        place: Place::File {
            path: path.to_owned(),
            line: given.line,
        },
        is_shared,
    };
    section.parameters.into_iter().map(value).collect()
}

/// `seen`: the line of each parameter under each name or pattern of this file so far.
fn repeated(
    written: &str,
    list: &[Override],
    seen: &mut HashMap<(String, String), u64>,
) -> Vec<Repetition> {
    let repetition = |given: &Override| {
        let Place::File { line, .. } = given.place else {
            return None;
        };
        let first = seen.insert((written.to_owned(), given.name.clone()), line)?;
        Some(Repetition {
            name: given.name.clone(),
            place: given.place.clone(),
            first,
            is_shared: given.is_shared,
        })
    };
    list.iter().filter_map(repetition).collect()
}

fn append(lists: &mut Vec<(String, Vec<Override>)>, (written, values): (String, Vec<Override>)) {
    match lists.iter_mut().find(|(known, _)| *known == written) {
        Some((_, list)) => list.extend(values),
        None => lists.push((written, values)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_parameter_keeps_its_last_value_whatever_their_number() {
        let given = |number: i64| Override {
            name: format!("p{}", number % 50_000),
            value: Some(ParameterValue::Integer(number)),
            place: Place::Argument,
            is_shared: false,
        };
        let found = last_of_each((0..150_000).map(given));
        assert_eq!(found.len(), 50_000);
        assert_eq!(found[7], given(100_007));
    }
}
