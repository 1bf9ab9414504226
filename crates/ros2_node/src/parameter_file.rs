//! Parameter files as ROS writes them, each value with its line.
//!
//! Only what is meant for a node is checked, when that node asks for it: sections of other nodes may hold anything that
//! is YAML.
//!
//! ```yaml
//! /**:                     # a pattern of node names, or one name
//!   ros__parameters:
//!     a: 1
//!     b: {c: 2}            # means b.c
//! ```

mod tree;

use std::path::{Path, PathBuf};

use self::tree::{Reader, Tree, Value};
use super::tokens;
use crate::parameters::ParameterValue;
use crate::text::clip;

/// The parameters under one node name or pattern.
#[derive(Debug, Clone, PartialEq)]
pub struct Section {
    /// Absolute node name, or a pattern of them.
    pub pattern: String,
    /// The same as it is written: rcl keeps `/node` and `node` apart.
    pub written: String,
    /// In their order.
    pub parameters: Vec<FileParameter>,
}

/// One assignment of a file.
#[derive(Debug, Clone, PartialEq)]
pub struct FileParameter {
    /// Name, nested keys joined by dots.
    pub name: String,
    /// Value; `None` where the file has a list, an empty map, an alias or nothing.
    pub value: Option<ParameterValue>,
    /// Line in the file, from 1.
    pub line: u64,
}

/// Why a parameter file cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ParameterFileError {
    /// Missing, or not readable, or not text.
    #[error("cannot read parameter file {path:?}: {source}")]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// Not YAML.
    #[error("parameter file {path:?} is not valid YAML: {reason}")]
    Yaml {
        /// The file.
        path: PathBuf,
        /// The parser's error, with line and column.
        reason: String,
    },
    /// A node's name that no node can have.
    #[error(
        "parameter file {path:?}, line {line}: {name:?} is no node's name or pattern: expected names between slashes, or * and ** in place of whole names"
    )]
    BadNode {
        /// The file.
        path: PathBuf,
        /// The place of its parameters.
        line: u64,
        /// As it is written.
        name: String,
    },
    /// Parameters without a node's name over them.
    #[error(
        "parameter file {path:?}, line {line}: ros__parameters stands at the top: expected a node's name or a pattern such as /** above it"
    )]
    NoNode {
        /// The file.
        path: PathBuf,
        /// Where.
        line: u64,
    },
    /// A list or a word where names with values belong.
    #[error(
        "parameter file {path:?}, line {line}: expected names with values under ros__parameters of {pattern:?}"
    )]
    NoNames {
        /// The file.
        path: PathBuf,
        /// Where.
        line: u64,
        /// The node name or pattern.
        pattern: String,
    },
    /// YAML, but not a parameter file.
    #[error(
        "parameter file {path:?}, line {line}: {key:?} must hold ros__parameters, or names under which they stand"
    )]
    NoParameters {
        /// The file.
        path: PathBuf,
        /// Where.
        line: u64,
        /// The node name that holds something else.
        key: String,
    },
}

/// Returns all sections of the file at `path`, in their order.
///
/// # Errors
/// [`ParameterFileError`] names the file, and the line where there is one.
pub fn read(path: &Path) -> Result<Vec<Section>, ParameterFileError> {
    let text = crate::text_file::read(path).map_err(|source| ParameterFileError::Unreadable {
        path: path.to_owned(),
        source,
    })?;
    parse(&text, path)
}

impl Section {
    /// Returns whether it is for one node alone, and not for several by a pattern.
    #[must_use]
    pub fn names_one_node(&self) -> bool {
        !self.pattern.contains('*')
    }

    /// Checks that every value has a name.
    ///
    /// # Errors
    /// [`ParameterFileError::NoNames`].
    pub fn check(&self, path: &Path) -> Result<(), ParameterFileError> {
        let nameless = self.parameters.iter().find(|given| given.name.is_empty());
        nameless.map_or(Ok(()), |given| {
            Err(ParameterFileError::NoNames {
                path: path.to_owned(),
                line: given.line,
                pattern: clip(&self.pattern),
            })
        })
    }
}

/// Returns the value of one YAML scalar, as after `-p`; `None` for a list or nothing.
///
/// # Errors
/// The reason why it is no YAML, or that it is a map.
pub(super) fn value(word: &str) -> Result<Option<ParameterValue>, String> {
    let tree = Reader::new(word).document().map_err(|fault| fault.reason)?;
    Ok(match tree.map(|tree| tree.value) {
        Some(Value::Scalar(value)) => value,
        Some(Value::Map(_)) => return Err("expected one value, got a map".to_owned()),
        Some(Value::List) | None => None,
    })
}

fn parse(text: &str, path: &Path) -> Result<Vec<Section>, ParameterFileError> {
    let document = Reader::new(text)
        .document()
        .map_err(|fault| ParameterFileError::Yaml {
            path: path.to_owned(),
            reason: format!("line {}: {}", fault.line, fault.reason),
        })?;
    let mut found = Vec::new();
    if let Some(document) = &document {
        sections(document, "", path, &mut found)?;
    }
    Ok(found)
}

/// Appends every section; names nest as namespaces.
///
/// A name that ROS does not know may be meant for this node, so it is not skipped.
fn sections(
    tree: &Tree,
    written: &str,
    path: &Path,
    found: &mut Vec<Section>,
) -> Result<(), ParameterFileError> {
    match &tree.value {
        Value::Map(entries) => {
            for (key, value) in entries {
                if key == "ros__parameters" {
                    found.push(section(value, written, path)?);
                } else if written.is_empty() {
                    sections(value, key, path, found)?;
                } else {
                    sections(value, &format!("{written}/{key}"), path, found)?;
                }
            }
            Ok(())
        }
        // An empty file, or a node without anything, sets no parameter.
        Value::Scalar(None) => Ok(()),
        Value::Scalar(Some(_)) | Value::List => Err(ParameterFileError::NoParameters {
            path: path.to_owned(),
            line: tree.line,
            key: clip(written),
        }),
    }
}

fn section(values: &Tree, written: &str, path: &Path) -> Result<Section, ParameterFileError> {
    let (path, line) = (path.to_owned(), values.line);
    if written.is_empty() {
        return Err(ParameterFileError::NoNode { path, line });
    }
    if !tokens::is_node_pattern(written) {
        let name = clip(written);
        return Err(ParameterFileError::BadNode { path, line, name });
    }
    let mut parameters = Vec::new();
    flatten("", values, &mut parameters);
    Ok(Section {
        pattern: format!("/{}", written.strip_prefix('/').unwrap_or(written)),
        written: written.to_owned(),
        parameters,
    })
}

fn flatten(prefix: &str, tree: &Tree, into: &mut Vec<FileParameter>) {
    let leaf = |value| FileParameter {
        name: prefix.to_owned(),
        value,
        line: tree.line,
    };
    match &tree.value {
        Value::Map(entries) if entries.is_empty() && !prefix.is_empty() => into.push(leaf(None)),
        Value::Map(entries) => {
            for (key, value) in entries {
                let name = if prefix.is_empty() {
                    key.clone()
                } else {
                    format!("{prefix}.{key}")
                };
                flatten(&name, value, into);
            }
        }
        // `ros__parameters:` with nothing under it sets nothing.
        Value::Scalar(None) if prefix.is_empty() => {}
        Value::List => into.push(leaf(None)),
        Value::Scalar(value) => into.push(leaf(value.clone())),
    }
}

#[cfg(test)]
mod tests;
