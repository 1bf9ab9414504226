//! Reads configuration text into plain values with their positions.
//!
//! Depends on YAML only, and not on files (the caller supplies text and the name of its source) or the meaning of
//! values. Strict where a mistake would go unnoticed: unknown and repeated keys, merge keys and unknown tags are
//! errors; nothing is interpolated.

use std::fmt;

use serde::de::DeserializeOwned;
use serde_saphyr::{DefaultMessageFormatter, Error, Location, MessageFormatter as _, Options};
use serde_saphyr::{DuplicateKeyPolicy, MergeKeyPolicy};

use crate::text::quoted;

/// Letters of a long reason that are shown from its start and from its end.
const SHOWN: usize = 300;

/// The position of an error: `config/tankers/paper.yaml:7:9`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    /// Name of the text, usually a path.
    pub source: String,
    /// Line and column, from 1; `None` if the error has no position in the text.
    pub line_column: Option<(u64, u64)>,
}

impl Place {
    /// Returns the position of a whole source.
    #[must_use]
    pub fn whole(source: &str) -> Self {
        Self {
            source: source.to_owned(),
            line_column: None,
        }
    }

    /// Returns the position that the YAML reader reports for a value.
    #[must_use]
    pub fn at(source: &str, location: Location) -> Self {
        let known = location != Location::UNKNOWN;
        Self {
            source: source.to_owned(),
            line_column: known.then(|| (location.line(), location.column())),
        }
    }

    /// Returns the line, from 1, if known.
    #[must_use]
    pub fn line(&self) -> Option<u64> {
        self.line_column.map(|(line, _)| line)
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line_column {
            Some((line, column)) => write!(f, "{}:{line}:{column}", self.source),
            None => f.write_str(&self.source),
        }
    }
}

/// Text that is not YAML, or YAML of another structure than expected.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{place}: {reason}")]
pub struct YamlError {
    /// Where the reader stopped.
    pub place: Place,
    /// The expected and the received value.
    pub reason: String,
}

/// Returns the value in a YAML text.
///
/// Fields of type [`serde_saphyr::Spanned`] keep their line and column. `T` should
/// `deny_unknown_fields`.
///
/// # Errors
/// [`YamlError`] with the position in `source`: syntax, a wrong type, a missing, unknown or repeated key.
pub fn read<T: DeserializeOwned>(text: &str, source: &str) -> Result<T, YamlError> {
    serde_saphyr::from_str_with_options(text, strict()).map_err(|error| {
        let location = error.location().unwrap_or(Location::UNKNOWN);
        let message = plainly(&error, text, location);
        YamlError {
            place: Place::at(source, location),
            reason: shortened(message.replace(char::is_control, " ")),
        }
    })
}

/// Returns the error in terms of the file; the parser's own message names Rust types.
fn plainly(error: &Error, text: &str, location: Location) -> String {
    let got = || match word_at(text, location) {
        "" => "nothing".to_owned(),
        word => quoted(word),
    };
    match error.without_snippet() {
        Error::InvalidScalar { ty, .. } => format!("expected {}, got {}", in_words(ty), got()),
        Error::Unexpected { expected, .. } => {
            format!("expected {}, got {}", in_words(expected), got())
        }
        Error::NullIntoString { .. } => "expected text, got nothing".to_owned(),
        Error::SerdeMissingField { field, .. } => format!("{field} is missing here"),
        Error::SerdeUnknownField {
            field, expected, ..
        } => format!(
            "unknown key {}, expected {}",
            quoted(field),
            expected.join(", ")
        ),
        Error::DuplicateMappingKey { key, .. } => {
            format!(
                "duplicate key {}",
                quoted(key.as_deref().unwrap_or_default())
            )
        }
        Error::MultipleDocuments { .. } => {
            "expected one document, got a second one after `---`".to_owned()
        }
        other => DefaultMessageFormatter.format_message(other).into_owned(),
    }
}

/// Returns a reason without the middle of a long one, which can only be a long word of the file.
fn shortened(reason: String) -> String {
    let count = reason.chars().count();
    if count <= 2 * SHOWN {
        return reason;
    }
    let start: String = reason.chars().take(SHOWN).collect();
    let end: String = reason.chars().skip(count - SHOWN).collect();
    format!("{start}… …{end}")
}

/// Returns the common word for a type of YAML or Rust.
fn in_words(kind: &str) -> &str {
    match kind {
        "i8" | "i16" | "i32" | "i64" | "u8" | "u16" | "u32" | "u64" => "a whole number",
        "f32" | "f64" | "floating point" => "a number",
        "sequence start" => "a list",
        "mapping start" => "keys with values",
        "string scalar" => "a single value",
        other => other,
    }
}

/// Returns the value that begins at a position, at most up to the end of its line.
fn word_at(text: &str, location: Location) -> &str {
    let index = |number: u64| usize::try_from(number).unwrap_or(usize::MAX);
    let line = text
        .lines()
        .nth(index(location.line()).wrapping_sub(1))
        .unwrap_or_default();
    let begin = line
        .char_indices()
        .nth(index(location.column()).wrapping_sub(1));
    let rest = begin.map_or("", |(begin, _)| &line[begin..]);
    // For a key without a value, the position is that of its colon.
    let rest = rest.strip_prefix(':').unwrap_or(rest);
    let rest = rest.split(" #").next().unwrap_or_default().trim_start();
    // Lists and maps in brackets are returned whole, single values without the bracket that closes the list around
    // them.
    let end = if rest.starts_with(['[', '{']) {
        rest.len()
    } else {
        rest.find([',', ']', '}']).unwrap_or(rest.len())
    };
    rest[..end].trim()
}

/// Options that accept nothing a reader of the file would not expect.
fn strict() -> Options {
    serde_saphyr::options! {
        duplicate_keys: DuplicateKeyPolicy::Error,
        merge_keys: MergeKeyPolicy::Error,
        reject_unsupported_tags: true,
        with_snippet: false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, PartialEq, serde::Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Sample {
        a: f64,
        b: u32,
    }

    fn refusal(text: &str) -> YamlError {
        read::<Sample>(text, "s.yaml").expect_err("this text is wrong")
    }

    #[test]
    fn good_text_gives_its_values() {
        assert_eq!(
            read::<Sample>("a: 1\nb: 2 # two\n", "s.yaml"),
            Ok(Sample { a: 1.0, b: 2 })
        );
    }

    #[test]
    fn every_slip_is_told_with_its_line() {
        let slips = [
            ("a: 1\nb: 2\nc: 3\n", 3, "c"),
            ("a: 1\nb: 2\na: 3\n", 3, "duplicate"),
            ("a: 1\nb: -2\n", 2, ""),
            ("a: 1\nb: 4294967296\n", 2, ""),
            ("a: 1\nb: 2.5\n", 2, ""),
            ("a: one\nb: 2\n", 1, ""),
            ("a:\nb: 2\n", 1, ""),
            ("a: ~\nb: 2\n", 1, ""),
            ("a: 3.7m\nb: 2\n", 1, ""),
            ("a: 1\n", 1, "b"),
            ("a: 1\nb: {c: 2\n", 2, ""),
            ("a: !metre 1\nb: 2\n", 1, ""),
            ("a: 1\nb: 2\n---\na: 1\nb: 2\n", 4, "document"),
        ];
        for (text, line, word) in slips {
            let error = refusal(text);
            assert_eq!(error.place.line(), Some(line), "{text:?} gave {error}");
            assert!(error.reason.contains(word), "{text:?} gave {error}");
            assert!(
                error.to_string().starts_with(&format!("s.yaml:{line}:")),
                "{error}"
            );
            assert!(!error.to_string().contains('\n'), "{error}");
        }
    }

    #[test]
    fn slips_are_told_in_plain_words_with_what_came() {
        let slips = [
            (
                "a: 1\nb: 2.5 # two\n",
                "s.yaml:2:4: expected a whole number, got \"2.5\"",
            ),
            (
                "{a: one, b: 2}\n",
                "s.yaml:1:5: expected a number, got \"one\"",
            ),
            ("a:\nb: 2\n", "expected a number, got nothing"),
            (
                "a: [1, 2]\nb: 2\n",
                "expected a single value, got \"[1, 2]\"",
            ),
            ("a: 1\n", "b is missing here"),
            ("a: 1\nb: 2\nc: 3\n", "unknown key \"c\", expected a, b"),
            ("a: 1\nb: 2\na: 3\n", "duplicate key \"a\""),
            ("[1, 2]\n", "expected keys with values, got \"[1, 2]\""),
        ];
        for (text, words) in slips {
            let error = refusal(text).to_string();
            assert!(error.ends_with(words), "{text:?} gave {error}");
        }
    }

    #[test]
    fn long_words_of_a_file_do_not_make_long_errors() {
        #[derive(Debug, serde::Deserialize)]
        #[serde(rename_all = "snake_case")]
        enum Choice {
            #[serde(rename = "a")]
            A,
        }
        let text = "ü".repeat(10_000);
        let error = read::<Choice>(&text, "s.yaml").expect_err("no choice");
        assert!(error.reason.len() < 1400, "{} bytes", error.reason.len());
        assert!(read::<Choice>("a", "s.yaml").is_ok_and(|choice| matches!(choice, Choice::A)));
    }

    #[test]
    fn empty_text_is_an_error_and_never_a_default() {
        assert!(read::<Sample>("", "s.yaml").is_err());
        assert!(read::<Sample>("# nothing\n", "s.yaml").is_err());
    }
}
