//! From the tree of a parameter file to its sections.

use std::path::Path;

use super::section::{FileParameter, MOST_NAMES, ParameterFileError, Section};
use super::tree::{Tree, Value};
use crate::text::clip;
use crate::tokens;

/// A way through the tree of a file.
pub(super) struct Walk<'a> {
    path: &'a Path,
    found: Vec<Section>,
    /// Bytes that names may still have: without a limit a file could fill the memory with the repetitions of one name.
    left: usize,
}

impl<'a> Walk<'a> {
    /// Returns all sections of a document, in their order.
    pub(super) fn sections_of(
        document: &Tree,
        path: &'a Path,
    ) -> Result<Vec<Section>, ParameterFileError> {
        let mut walk = Self {
            path,
            found: Vec::new(),
            left: MOST_NAMES,
        };
        walk.sections(document, "")?;
        Ok(walk.found)
    }

    /// Appends every section; names nest as namespaces.
    ///
    /// A name that ROS does not know may be meant for this node, so it is not skipped.
    fn sections(&mut self, tree: &Tree, written: &str) -> Result<(), ParameterFileError> {
        match &tree.value {
            Value::Map(entries) => {
                for (key, value) in entries {
                    if key == "ros__parameters" {
                        self.section(value, written)?;
                    } else if written.is_empty() {
                        self.sections(value, key)?;
                    } else {
                        let name = self.joined(written, '/', key, value.line)?;
                        self.sections(value, &name)?;
                    }
                }
                Ok(())
            }
            // An empty file, or a node without anything, sets no parameter.
            Value::Scalar(None) => Ok(()),
            Value::Scalar(Some(_)) | Value::List => Err(ParameterFileError::NoParameters {
                path: self.path.to_owned(),
                line: tree.line,
                key: clip(written),
            }),
        }
    }

    fn section(&mut self, values: &Tree, written: &str) -> Result<(), ParameterFileError> {
        let (path, line) = (self.path.to_owned(), values.line);
        if written.is_empty() {
            return Err(ParameterFileError::NoNode { path, line });
        }
        if !tokens::is_node_pattern(written) {
            let name = clip(written);
            return Err(ParameterFileError::BadNode { path, line, name });
        }
        let mut parameters = Vec::new();
        self.flatten("", values, &mut parameters)?;
        self.found.push(Section {
            pattern: format!("/{}", written.strip_prefix('/').unwrap_or(written)),
            written: written.to_owned(),
            parameters,
        });
        Ok(())
    }

    fn flatten(
        &mut self,
        prefix: &str,
        tree: &Tree,
        into: &mut Vec<FileParameter>,
    ) -> Result<(), ParameterFileError> {
        let leaf = |value| FileParameter {
            name: prefix.to_owned(),
            value,
            line: tree.line,
        };
        match &tree.value {
            Value::Map(entries) if entries.is_empty() && !prefix.is_empty() => {
                into.push(leaf(None));
            }
            Value::Map(entries) => {
                for (key, value) in entries {
                    if prefix.is_empty() {
                        self.flatten(key, value, into)?;
                    } else {
                        let name = self.joined(prefix, '.', key, value.line)?;
                        self.flatten(&name, value, into)?;
                    }
                }
            }
            // `ros__parameters:` with nothing under it sets nothing.
            Value::Scalar(None) if prefix.is_empty() => {}
            Value::List => into.push(leaf(None)),
            Value::Scalar(value) => into.push(leaf(value.clone())),
        }
        Ok(())
    }

    /// Returns a name below another one.
    fn joined(
        &mut self,
        above: &str,
        between: char,
        key: &str,
        line: u64,
    ) -> Result<String, ParameterFileError> {
        let length = above.len() + key.len() + 1;
        let Some(left) = self.left.checked_sub(length) else {
            let path = self.path.to_owned();
            return Err(ParameterFileError::LongNames { path, line });
        };
        self.left = left;
        Ok(format!("{above}{between}{key}"))
    }
}
