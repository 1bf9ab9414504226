//! The sections of a parameter file, and why it cannot be used.

use std::path::{Path, PathBuf};

use crate::parameters::ParameterValue;
use crate::text::clip;

/// Most bytes of all names of a file, each with those above it.
pub(super) const MOST_NAMES: usize = 1 << 24;

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
    /// Long names above many others, which each of those repeats.
    #[error(
        "parameter file {path:?}, line {line}: expected names of parameters and nodes of at most {MOST_NAMES} bytes together, \
         got more"
    )]
    LongNames {
        /// The file.
        path: PathBuf,
        /// Where they are more.
        line: u64,
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
