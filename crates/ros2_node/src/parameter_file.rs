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

mod section;
mod tree;
mod walk;

use std::path::Path;

pub use self::section::{FileParameter, ParameterFileError, Section};
use self::tree::{Reader, Value};
use self::walk::Walk;
use crate::parameters::ParameterValue;

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

/// Returns all sections of a text, in their order; `path` is its name in errors.
///
/// # Errors
/// As [`read`].
pub fn parse(text: &str, path: &Path) -> Result<Vec<Section>, ParameterFileError> {
    let document = Reader::new(text)
        .document()
        .map_err(|fault| ParameterFileError::Yaml {
            path: path.to_owned(),
            reason: format!("line {}: {}", fault.line, fault.reason),
        })?;
    document.map_or_else(|| Ok(Vec::new()), |tree| Walk::sections_of(&tree, path))
}

#[cfg(test)]
mod tests;
