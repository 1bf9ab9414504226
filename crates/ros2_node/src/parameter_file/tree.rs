//! The YAML of a parameter file as a tree, each value with its line.

use granit_parser::{Event, Parser, ScalarStyle, ScanError, Tag};

use crate::parameters::ParameterValue;
use crate::scalar;

/// Deepest nesting of keys: far beyond any file, and short of the end of the stack.
const MAX_DEPTH: usize = 64;

/// Any YAML, as far as parameters can hold it.
pub(super) struct Tree {
    pub(super) value: Value,
    pub(super) line: u64,
}

pub(super) enum Value {
    Scalar(Option<ParameterValue>),
    List,
    Map(Vec<(String, Tree)>),
}

/// Why a text is not read, for display.
pub(super) struct Fault {
    pub(super) line: u64,
    pub(super) reason: String,
}

/// Events of the parser -> a tree. With serde the spelling of a scalar would be lost.
pub(super) struct Reader<'text> {
    events: Parser<'text, granit_parser::StrInput<'text>>,
}

impl<'text> Reader<'text> {
    pub(super) fn new(text: &'text str) -> Self {
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
    pub(super) fn document(&mut self) -> Result<Option<Tree>, Fault> {
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
