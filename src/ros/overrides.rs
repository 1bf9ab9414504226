//! Parameters from files and arguments, put together for one node as rcl does.
//!
//! rcl keeps one list of values for each node name or pattern, in the order in which the names first appear on the
//! command line, files included; `-p name:=value` stands under `/**`. Within a list the last value of a parameter
//! counts, and of the lists that are for a node the later one. So a file's section with the node's name beats `/**` of
//! the same file, of later files, and of `-p` where `/**` had been seen before.

use std::path::{Path, PathBuf};

use super::arguments::ParameterSource;
use super::parameter_file::{self, FileParameter, ParameterFileError, Section};
use crate::config::ParameterValue;

/// The pattern that stands for all nodes.
const EVERY_NODE: &str = "/**";

/// A value given at the start for a node.
#[derive(Debug, Clone, PartialEq)]
pub struct Override {
    /// The parameter.
    pub name: String,
    /// None where something stands that no parameter can hold: a list, a map, nothing.
    pub value: Option<ParameterValue>,
    /// Where it stands.
    pub place: Place,
    /// Whether it stands under a file's pattern for several nodes, which may mean others.
    pub is_shared: bool,
}

/// Where a value stands.
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
    /// One for each parameter, the one that counts.
    pub values: Vec<Override>,
    /// Files without a section for this node.
    pub files_without_section: Vec<PathBuf>,
}

impl Overrides {
    /// Returns the values that files and arguments give to the node with this absolute name.
    ///
    /// # Errors
    /// [`ParameterFileError`] of a file that cannot be read, or sets a parameter of this node twice.
    pub fn gather(sources: &[ParameterSource], node: &str) -> Result<Self, ParameterFileError> {
        let mut lists: Vec<(String, Vec<Override>)> = Vec::new();
        let mut files_without_section = Vec::new();
        for source in sources {
            match source {
                ParameterSource::File(path) => {
                    let mut sections = parameter_file::read(path)?;
                    sections.retain(|section| is_for(&section.pattern, node));
                    if sections.is_empty() {
                        files_without_section.push(path.clone());
                    }
                    for section in sections {
                        section.check(path)?;
                        append(&mut lists, from_section(section, path));
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
        let mut values: Vec<Override> = Vec::new();
        for given in lists.into_iter().flat_map(|(_, list)| list) {
            values.retain(|earlier| earlier.name != given.name);
            values.push(given);
        }
        Ok(Self {
            values,
            files_without_section,
        })
    }
}

fn is_for(pattern: &str, node: &str) -> bool {
    ros2args::match_wildcard_pattern(pattern, node)
}

fn from_section(section: Section, path: &Path) -> (String, Vec<Override>) {
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
    let values = section.parameters.into_iter().map(value).collect();
    (section.written, values)
}

fn append(lists: &mut Vec<(String, Vec<Override>)>, (written, values): (String, Vec<Override>)) {
    match lists.iter_mut().find(|(known, _)| *known == written) {
        Some((_, list)) => list.extend(values),
        None => lists.push((written, values)),
    }
}
