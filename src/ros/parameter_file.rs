//! Parameter files as ROS writes them, each value with its line.
//!
//! Only what is meant for a node is checked, by who asks for it: sections of other nodes may hold anything that is
//! YAML.
//!
//! ```yaml
//! /**:                     # a pattern of node names, or one name
//!   ros__parameters:
//!     a: 1
//!     b: {c: 2}            # means b.c
//! ```

use std::path::{Path, PathBuf};

use granit_parser::{Event, Parser, ScalarStyle, ScanError, Tag};

use super::scalar;
use crate::config::ParameterValue;
use crate::text::clip;

/// The parameters that stand under one node name or pattern.
#[derive(Debug, Clone, PartialEq)]
pub struct Section {
    /// Absolute node name, or a pattern of such.
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
    /// Value; none where the file has a list, an alias or nothing.
    pub value: Option<ParameterValue>,
    /// Line in the file, from 1.
    pub line: u64,
}

/// Deepest nesting of keys: far beyond any file, and short of the end of the stack.
const MAX_DEPTH: usize = 64;

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
    /// A value that is set twice under one node name.
    #[error(
        "parameter file {path:?}, line {line}: {name:?} is set twice under {pattern:?}, first in line {first}"
    )]
    Repeated {
        /// The file.
        path: PathBuf,
        /// Of the second one.
        line: u64,
        /// Of the first one.
        first: u64,
        /// The parameter.
        name: String,
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

    /// Checks that no parameter is set twice.
    ///
    /// # Errors
    /// [`ParameterFileError::Repeated`]. DIFFERENCE: ROS takes the last one.
    pub fn check(&self, path: &Path) -> Result<(), ParameterFileError> {
        for (index, parameter) in self.parameters.iter().enumerate() {
            let earlier = self.parameters[..index]
                .iter()
                .find(|earlier| earlier.name == parameter.name);
            if let Some(earlier) = earlier {
                return Err(ParameterFileError::Repeated {
                    path: path.to_owned(),
                    line: parameter.line,
                    first: earlier.line,
                    name: clip(&parameter.name),
                    pattern: clip(&self.pattern),
                });
            }
        }
        Ok(())
    }
}

/// Returns the value of one word of YAML, as `-p` has it; none where it is a list, a map or nothing.
///
/// # Errors
/// The reason why it is no YAML.
pub(super) fn value(word: &str) -> Result<Option<ParameterValue>, String> {
    let tree = Reader::new(word).document().map_err(|fault| fault.reason)?;
    Ok(match tree.map(|tree| tree.value) {
        Some(Value::Scalar(value)) => value,
        _ => None,
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
        sections(document, "", "", path, &mut found)?;
    }
    Ok(found)
}

/// Appends every section; names nest as namespaces.
fn sections(
    tree: &Tree,
    prefix: &str,
    written: &str,
    path: &Path,
    found: &mut Vec<Section>,
) -> Result<(), ParameterFileError> {
    match &tree.value {
        Value::Map(entries) => {
            for (key, value) in entries {
                if key == "ros__parameters" {
                    let mut parameters = Vec::new();
                    flatten("", value, &mut parameters);
                    found.push(Section {
                        pattern: prefix.to_owned(),
                        written: written.to_owned(),
                        parameters,
                    });
                } else {
                    let name = format!("{prefix}/{}", key.trim_matches('/'));
                    let written = if written.is_empty() {
                        key.clone()
                    } else {
                        format!("{written}/{key}")
                    };
                    sections(value, &name, &written, path, found)?;
                }
            }
            Ok(())
        }
        // An empty file, or a node without anything, says nothing.
        Value::Scalar(None) => Ok(()),
        Value::Scalar(Some(_)) | Value::List => Err(ParameterFileError::NoParameters {
            path: path.to_owned(),
            line: tree.line,
            key: clip(prefix),
        }),
    }
}

fn flatten(prefix: &str, tree: &Tree, into: &mut Vec<FileParameter>) {
    let leaf = |value| FileParameter {
        name: prefix.to_owned(),
        value,
        line: tree.line,
    };
    match &tree.value {
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

/// Any YAML, as far as parameters can hold it.
struct Tree {
    value: Value,
    line: u64,
}

enum Value {
    Scalar(Option<ParameterValue>),
    List,
    Map(Vec<(String, Tree)>),
}

/// Why a text is not read, in words for people.
struct Fault {
    line: u64,
    reason: String,
}

/// Events of the parser -> a tree. Serde's way would lose what a word looked like before it became a value.
struct Reader<'text> {
    events: Parser<'text, granit_parser::StrInput<'text>>,
}

impl<'text> Reader<'text> {
    fn new(text: &'text str) -> Self {
        Self {
            events: Parser::new_from_str(text),
        }
    }

    fn next(&mut self) -> Result<(Event<'text>, u64), Fault> {
        loop {
            match self.events.next() {
                Some(Ok((Event::Comment(..), _))) => {}
                // What is left out comes as a word without a place, which says null.
                Some(Ok((Event::Scalar(_, ScalarStyle::Plain, anchor, tag), span)))
                    if span.start.index() == span.end.index() =>
                {
                    let nothing = Event::Scalar("".into(), ScalarStyle::Plain, anchor, tag);
                    return Ok((nothing, span.start.line() as u64));
                }
                Some(Ok((event, span))) => return Ok((event, span.start.line() as u64)),
                Some(Err(error)) => return Err(Fault::from(&error)),
                None => return Ok((Event::StreamEnd, 0)),
            }
        }
    }

    /// Returns the only document; none of an empty text.
    fn document(&mut self) -> Result<Option<Tree>, Fault> {
        let mut found = None;
        loop {
            match self.next()? {
                (Event::StreamEnd, _) => return Ok(found),
                (Event::DocumentStart(..), line) => {
                    if found.is_some() {
                        let reason = "expected one document, got a second one after `---`";
                        return Err(Fault {
                            line,
                            reason: reason.to_owned(),
                        });
                    }
                    let (event, line) = self.next()?;
                    found = Some(self.tree(event, line, 0)?);
                }
                _ => {}
            }
        }
    }

    fn tree(&mut self, event: Event<'text>, line: u64, depth: usize) -> Result<Tree, Fault> {
        if depth > MAX_DEPTH {
            let reason = format!("expected at most {MAX_DEPTH} levels, got more");
            return Err(Fault { line, reason });
        }
        let value = match event {
            Event::Scalar(word, style, _, tag) => {
                Value::Scalar(meaning(&word, style, tag.as_deref()))
            }
            Event::SequenceStart(..) => loop {
                match self.next()? {
                    (Event::SequenceEnd, _) => break Value::List,
                    (event, line) => drop(self.tree(event, line, depth + 1)?),
                }
            },
            Event::MappingStart(..) => {
                let mut entries = Vec::new();
                loop {
                    let (event, line) = self.next()?;
                    let key = match event {
                        Event::MappingEnd => break Value::Map(entries),
                        Event::Scalar(word, ..) => word.into_owned(),
                        // A list or map as a key names no parameter.
                        other => {
                            self.tree(other, line, depth + 1)?;
                            String::new()
                        }
                    };
                    let (event, line) = self.next()?;
                    entries.push((key, self.tree(event, line, depth + 1)?));
                }
            }
            // An alias: ROS does not follow it either.
            _ => Value::List,
        };
        Ok(Tree { value, line })
    }
}

impl From<&ScanError> for Fault {
    fn from(error: &ScanError) -> Self {
        Self {
            line: error.marker().line() as u64,
            reason: error.info(),
        }
    }
}

/// Returns what a word means; none for nothing at all.
fn meaning(word: &str, style: ScalarStyle, tag: Option<&Tag>) -> Option<ParameterValue> {
    let is_text = style != ScalarStyle::Plain || tag.is_some_and(|tag| tag.suffix() == "str");
    if is_text {
        Some(ParameterValue::String(word.to_owned()))
    } else {
        (!word.is_empty()).then(|| scalar::plain(word))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(text: &str) -> Result<Vec<Section>, ParameterFileError> {
        parse(text, Path::new("test.yaml"))
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
    fn sections_have_absolute_names_and_names_nest_as_namespaces() {
        let found = parsed(FILE).expect("the text is a parameter file");
        let patterns: Vec<&str> = found.iter().map(|section| &*section.pattern).collect();
        assert_eq!(
            patterns,
            [
                "/**",
                "/tanker_pose",
                "/uav1/tanker_pose",
                "/uav1/tanker_pose",
                "/*/tanker_pose"
            ]
        );
        assert!(!found[0].names_one_node() && found[1].names_one_node());
    }

    #[test]
    fn empty_files_and_sections_say_nothing() {
        assert_eq!(parsed("").expect("valid"), []);
        assert_eq!(parsed("tanker_pose:\n").expect("valid"), []);
        let found = parsed("tanker_pose:\n  ros__parameters:\n").expect("valid");
        assert_eq!(found[0].parameters, []);
    }

    #[test]
    fn a_parameter_that_is_set_twice_is_found_when_its_section_is_checked() {
        let found = parsed("n:\n  ros__parameters:\n    a: {b: 1}\n    a.b: 2\n").expect("YAML");
        let error = found[0].check(Path::new("p.yaml")).expect_err("twice");
        assert_eq!(
            error.to_string(),
            "parameter file \"p.yaml\", line 4: \"a.b\" is set twice under \"/n\", first in line 3"
        );
    }

    #[test]
    fn other_nodes_sections_may_hold_anything() {
        let text = "other:\n  ros__parameters:\n    a: !mine [1, x, {b: 2}]\n    a: 2\n    ? [k]\n    : &x 1\n    c: *x\n";
        assert_eq!(parsed(text).expect("it is YAML")[0].pattern, "/other");
    }

    #[test]
    fn a_second_document_is_refused_in_a_users_words() {
        let error = parsed(&format!("{FILE}---\n{FILE}")).expect_err("two");
        assert!(
            error
                .to_string()
                .ends_with("expected one document, got a second one after `---`"),
            "{error}"
        );
    }

    #[test]
    fn nesting_has_a_limit() {
        let deep = "{a: ".repeat(100_000);
        assert!(parsed(&deep).is_err());
        assert!(parsed(&"[".repeat(100_000)).is_err());
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
        let found = parsed(text).expect("valid").remove(0).parameters;
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
            assert!(parsed(text).is_err(), "{text:?}");
        }
        let missing = read(Path::new("/nonexistent/p.yaml")).expect_err("there is none");
        assert!(
            missing.to_string().contains("/nonexistent/p.yaml"),
            "{missing}"
        );
    }
}
