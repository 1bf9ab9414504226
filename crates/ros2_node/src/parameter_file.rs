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

use std::path::{Path, PathBuf};

use granit_parser::{Event, Parser, ScalarStyle, ScanError, Tag};

use super::{scalar, tokens};
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

/// Why a text is not read, for display.
struct Fault {
    line: u64,
    reason: String,
}

/// Events of the parser -> a tree. With serde the spelling of a scalar would be lost.
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

    /// Returns the only document; `None` for an empty text.
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

/// Returns the value of a scalar; `None` for an empty one.
fn meaning(word: &str, style: ScalarStyle, tag: Option<&Tag>) -> Option<ParameterValue> {
    // rcl minds quotes and the full tag, and not whether a word stands in a block.
    let is_quoted = matches!(style, ScalarStyle::SingleQuoted | ScalarStyle::DoubleQuoted);
    if word.is_empty() && style == ScalarStyle::Plain {
        None
    } else if is_quoted || tag.and_then(Tag::core_suffix) == Some("str") {
        Some(ParameterValue::String(word.to_owned()))
    } else {
        Some(scalar::plain(word))
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
sensor_driver:
  ros__parameters:
    root_only: 2
/uav1/sensor_driver:
  ros__parameters:
    absolute: 3
uav1:
  sensor_driver:
    ros__parameters:
      nested: 4
/*/sensor_driver:
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
                "/sensor_driver",
                "/uav1/sensor_driver",
                "/uav1/sensor_driver",
                "/*/sensor_driver"
            ]
        );
        assert!(!found[0].names_one_node() && found[1].names_one_node());
    }

    #[test]
    fn empty_files_and_sections_say_nothing() {
        assert_eq!(parsed("").expect("valid"), []);
        assert_eq!(parsed("sensor_driver:\n").expect("valid"), []);
        let found = parsed("sensor_driver:\n  ros__parameters:\n").expect("valid");
        assert_eq!(found[0].parameters, []);
    }

    #[test]
    fn values_without_names_are_found_when_their_section_is_checked() {
        for values in ["[a, 1]", "3", "{'': 1}"] {
            let found = parsed(&format!("n:\n  ros__parameters: {values}\n")).expect("YAML");
            let error = found[0].check(Path::new("p.yaml")).expect_err(values);
            assert_eq!(
                error.to_string(),
                "parameter file \"p.yaml\", line 2: expected names with values under ros__parameters of \"/n\""
            );
        }
    }

    #[test]
    fn a_section_that_no_node_can_have_is_refused_and_not_passed_over() {
        let text = |name| format!("{name}:\n  ros__parameters:\n    a: 1\n");
        for name in ["sensor_*", "/n/", "//n", "n m", "1n", "n.m"] {
            let error = parsed(&text(name)).expect_err(name);
            assert!(error.to_string().contains("is no node's name"), "{error}");
        }
        assert!(parsed("/a: {/n: {ros__parameters: {a: 1}}}").is_err());
        let error = parsed("ros__parameters: {a: 1}\n").expect_err("no name");
        assert!(error.to_string().contains("above it"), "{error}");
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
    fn quotes_and_the_tag_of_text_make_text_and_blocks_do_not() {
        for (word, value) in [
            ("|-\n    3", Some(ParameterValue::Integer(3))),
            (">-\n    yes", Some(ParameterValue::Bool(true))),
            ("|\n    3", Some(ParameterValue::String("3\n".into()))),
            ("!!str 3", Some(ParameterValue::String("3".into()))),
            (
                "!<tag:yaml.org,2002:str> 3",
                Some(ParameterValue::String("3".into())),
            ),
            ("!str 3", Some(ParameterValue::Integer(3))),
            ("!!int 3.5", Some(ParameterValue::Double(3.5))),
            ("!!str", None),
            ("{}", None),
            ("[]", None),
        ] {
            let found = parsed(&format!(
                "n: {{ros__parameters: }}\nm:\n ros__parameters:\n  a: {word}\n"
            ));
            let found = found.expect(word).remove(1).parameters;
            assert_eq!(found[0].value, value, "{word}");
        }
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
