//! Parameter files as ROS writes them, each value with its line.
//!
//! ```yaml
//! /**:                     # a pattern of node names, or one name
//!   ros__parameters:
//!     a: 1
//!     b: {c: 2}            # means b.c
//! ```

use std::fmt;
use std::path::{Path, PathBuf};

use serde::de::{Deserialize, Deserializer, MapAccess, SeqAccess, Visitor};
use serde_saphyr::Spanned;

use crate::config::ParameterValue;

/// One assignment of a file.
#[derive(Debug, Clone, PartialEq)]
pub struct FileParameter {
    /// Name, nested keys joined by dots.
    pub name: String,
    /// Value; none where the file has a list or nothing.
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
        /// What the system says.
        source: std::io::Error,
    },
    /// Not YAML.
    #[error("parameter file {path:?} is not valid YAML: {reason}")]
    Yaml {
        /// The file.
        path: PathBuf,
        /// What the parser says, with line and column.
        reason: String,
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

/// Returns the parameters that the file at `path` has for the node with this absolute name, in their
/// order; none when no section of the file is for that node.
///
/// # Errors
/// [`ParameterFileError`] names the file, and the line where there is one.
pub fn read(path: &Path, node: &str) -> Result<Option<Vec<FileParameter>>, ParameterFileError> {
    let text = crate::text_file::read(path).map_err(|source| ParameterFileError::Unreadable {
        path: path.to_owned(),
        source,
    })?;
    parse(&text, path, node)
}

fn parse(
    text: &str,
    path: &Path,
    node: &str,
) -> Result<Option<Vec<FileParameter>>, ParameterFileError> {
    let document: Spanned<Tree> =
        serde_saphyr::from_str(text).map_err(|error| ParameterFileError::Yaml {
            path: path.to_owned(),
            reason: error.to_string(),
        })?;
    let mut found = None;
    sections(&document, "", path, &mut |section, parameters| {
        if ros2args::match_wildcard_pattern(section, node) {
            flatten("", parameters, found.get_or_insert_with(Vec::new));
        }
    })?;
    Ok(found)
}

/// Calls `visit` with the node name and the parameters of every section; names nest as namespaces.
fn sections(
    tree: &Spanned<Tree>,
    prefix: &str,
    path: &Path,
    visit: &mut impl FnMut(&str, &Spanned<Tree>),
) -> Result<(), ParameterFileError> {
    match &tree.value {
        Tree::Map(entries) => {
            for (key, value) in entries {
                if key == "ros__parameters" {
                    visit(prefix, value);
                } else {
                    let name = format!("{prefix}/{}", key.trim_matches('/'));
                    sections(value, &name, path, visit)?;
                }
            }
            Ok(())
        }
        // An empty file, or a node without anything, says nothing.
        Tree::Empty => Ok(()),
        Tree::Scalar(_) | Tree::List => Err(ParameterFileError::NoParameters {
            path: path.to_owned(),
            line: tree.referenced.line(),
            key: prefix.to_owned(),
        }),
    }
}

fn flatten(prefix: &str, tree: &Spanned<Tree>, into: &mut Vec<FileParameter>) {
    let leaf = |value| FileParameter {
        name: prefix.to_owned(),
        value,
        line: tree.referenced.line(),
    };
    match &tree.value {
        Tree::Map(entries) => {
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
        Tree::Empty if prefix.is_empty() => {}
        Tree::Empty | Tree::List => into.push(leaf(None)),
        Tree::Scalar(value) => into.push(leaf(Some(value.clone()))),
    }
}

/// Any YAML, as far as parameters can hold it.
enum Tree {
    Empty,
    Scalar(ParameterValue),
    List,
    Map(Vec<(String, Spanned<Tree>)>),
}

impl<'de> Deserialize<'de> for Tree {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(TreeVisitor)
    }
}

struct TreeVisitor;

impl<'de> Visitor<'de> for TreeVisitor {
    type Value = Tree;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("parameters")
    }

    fn visit_unit<E>(self) -> Result<Tree, E> {
        Ok(Tree::Empty)
    }

    fn visit_none<E>(self) -> Result<Tree, E> {
        Ok(Tree::Empty)
    }

    fn visit_some<D: Deserializer<'de>>(self, deserializer: D) -> Result<Tree, D::Error> {
        Tree::deserialize(deserializer)
    }

    fn visit_bool<E>(self, value: bool) -> Result<Tree, E> {
        Ok(Tree::Scalar(ParameterValue::Bool(value)))
    }

    fn visit_i64<E>(self, value: i64) -> Result<Tree, E> {
        Ok(Tree::Scalar(ParameterValue::Integer(value)))
    }

    fn visit_u64<E>(self, value: u64) -> Result<Tree, E> {
        // Beyond i64 no parameter has a use for it: as a double it is refused by every range.
        let fits = i64::try_from(value).map(ParameterValue::Integer);
        Ok(Tree::Scalar(
            fits.unwrap_or(ParameterValue::Double(value as f64)),
        ))
    }

    fn visit_f64<E>(self, value: f64) -> Result<Tree, E> {
        Ok(Tree::Scalar(ParameterValue::Double(value)))
    }

    fn visit_str<E>(self, value: &str) -> Result<Tree, E> {
        Ok(Tree::Scalar(ParameterValue::String(value.to_owned())))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Tree, A::Error> {
        while list.next_element::<serde::de::IgnoredAny>()?.is_some() {}
        Ok(Tree::List)
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Tree, A::Error> {
        let mut entries = Vec::new();
        while let Some(entry) = map.next_entry()? {
            entries.push(entry);
        }
        Ok(Tree::Map(entries))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse_for(node: &str, text: &str) -> Result<Option<Vec<FileParameter>>, ParameterFileError> {
        parse(text, Path::new("test.yaml"), node)
    }

    fn names(node: &str, text: &str) -> Vec<String> {
        let found = parse_for(node, text).expect("the text is a parameter file");
        found
            .unwrap_or_default()
            .into_iter()
            .map(|parameter| parameter.name)
            .collect()
    }

    const FILE: &str = "\
/**:
  ros__parameters: {everywhere: 1}
tanker_pose:
  ros__parameters:
    root_only: 2
/uav1/tanker_pose:
  ros__parameters:
    absolute: 3
uav1:
  tanker_pose:
    ros__parameters:
      nested: 4
/*/tanker_pose:
  ros__parameters:
    one_level: 5
";

    #[test]
    fn sections_apply_by_the_nodes_absolute_name() {
        assert_eq!(names("/tanker_pose", FILE), ["everywhere", "root_only"]);
        assert_eq!(
            names("/uav1/tanker_pose", FILE),
            ["everywhere", "absolute", "nested", "one_level"]
        );
        assert_eq!(names("/other", FILE), ["everywhere"]);
    }

    #[test]
    fn file_without_a_section_for_the_node_is_told_from_an_empty_section() {
        let other = "other:\n  ros__parameters: {a: 1}\n";
        assert_eq!(parse_for("/tanker_pose", other).expect("valid"), None);
        let empty = "tanker_pose:\n  ros__parameters:\n";
        assert_eq!(
            parse_for("/tanker_pose", empty).expect("valid"),
            Some(Vec::new())
        );
        assert_eq!(parse_for("/tanker_pose", "").expect("valid"), None);
    }

    #[test]
    fn values_keep_their_types_and_lines_and_nested_keys_are_joined() {
        let text = "\
/**:
  ros__parameters:
    a: 1
    b: 1.0
    c: true
    d: '1'
    e: paper
    f:
      g: 1.0e-3
    h: [1, 2]
";
        let found = parse_for("/n", text)
            .expect("valid")
            .expect("the section is for all");
        let expected = [
            ("a", Some(ParameterValue::Integer(1)), 3),
            ("b", Some(ParameterValue::Double(1.0)), 4),
            ("c", Some(ParameterValue::Bool(true)), 5),
            ("d", Some(ParameterValue::String("1".into())), 6),
            ("e", Some(ParameterValue::String("paper".into())), 7),
            ("f.g", Some(ParameterValue::Double(1e-3)), 9),
            ("h", None, 10),
        ]
        .map(|(name, value, line)| FileParameter {
            name: name.to_owned(),
            value,
            line,
        });
        assert_eq!(found, expected);
    }

    #[test]
    fn what_is_no_parameter_file_is_refused() {
        for text in [
            "a: 1",
            "- a",
            "just text",
            "/**:\n  ros__parameters: {a: 1",
            "a:\n b: 1\n  c: 2",
        ] {
            assert!(parse_for("/n", text).is_err(), "{text:?}");
        }
        let missing = read(Path::new("/nonexistent/p.yaml"), "/n").expect_err("there is none");
        assert!(
            missing.to_string().contains("/nonexistent/p.yaml"),
            "{missing}"
        );
    }
}
