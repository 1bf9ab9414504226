//! A raw value against its parameter's line in the table.

use super::spec::{FRAME_ID, Kind, ParameterSpec, TEXT};
use super::{ParameterError, ParameterValue};
use crate::text::MAX_NAME_BYTES;

/// Returns the value in the type that the parameter has.
pub(super) fn check(
    spec: &ParameterSpec,
    value: ParameterValue,
) -> Result<ParameterValue, ParameterError> {
    use ParameterValue::{Bool, Double, Integer, String};
    let name = spec.name;
    match (spec.kind, value) {
        (Kind::Bool { .. }, Bool(value)) => Ok(Bool(value)),
        (Kind::Integer { min, max, .. }, Integer(value)) if (min..=max).contains(&value) => {
            Ok(Integer(value))
        }
        (Kind::Integer { min, max, .. }, value @ Integer(_)) => Err(ParameterError::OutOfRange {
            name,
            value,
            min: Integer(min),
            max: Integer(max),
        }),
        // People write `1` where `1.0` is meant.
        (Kind::Double { min, max, .. }, Integer(value)) => {
            check_double(name, value as f64, min, max)
        }
        (Kind::Double { min, max, .. }, Double(value)) => check_double(name, value, min, max),
        (Kind::Choice { allowed, .. }, String(value)) => {
            if allowed.contains(&value.as_str()) {
                Ok(String(value))
            } else {
                Err(ParameterError::NotAllowed {
                    name,
                    value,
                    allowed,
                })
            }
        }
        (Kind::Text { .. }, String(value)) => {
            require(name, value, TEXT, |text| !text.trim().is_empty())
        }
        (Kind::FrameId { .. }, String(value)) => require(name, value, FRAME_ID, |text| {
            !text.is_empty()
                && !text.starts_with('/')
                && !text.contains(|letter: char| letter.is_whitespace() || letter.is_control())
                && text.len() <= MAX_NAME_BYTES
        }),
        (kind, value) => Err(ParameterError::WrongType {
            name,
            expected: type_name(kind),
            value,
        }),
    }
}

fn check_double(
    name: &'static str,
    value: f64,
    min: f64,
    max: f64,
) -> Result<ParameterValue, ParameterError> {
    if !value.is_finite() {
        return Err(ParameterError::NotFinite { name, value });
    }
    let value_or_bound = ParameterValue::Double;
    if (min..=max).contains(&value) {
        Ok(value_or_bound(value))
    } else {
        let (value, min, max) = (
            value_or_bound(value),
            value_or_bound(min),
            value_or_bound(max),
        );
        Err(ParameterError::OutOfRange {
            name,
            value,
            min,
            max,
        })
    }
}

fn require(
    name: &'static str,
    value: String,
    requirement: &'static str,
    holds: impl Fn(&str) -> bool,
) -> Result<ParameterValue, ParameterError> {
    if holds(&value) {
        Ok(ParameterValue::String(value))
    } else {
        Err(ParameterError::BadText {
            name,
            value,
            requirement,
        })
    }
}

const fn type_name(kind: Kind) -> &'static str {
    match kind {
        Kind::Bool { .. } => "a bool",
        Kind::Integer { .. } => "an integer",
        Kind::Double { .. } => "a double",
        Kind::Choice { .. } | Kind::Text { .. } | Kind::FrameId { .. } => "a string",
    }
}

/// Returns the parameter that was perhaps meant: the nearest, if a third of its letters at most differ.
pub(super) fn nearest_name(table: &'static [ParameterSpec], name: &str) -> Option<&'static str> {
    table
        .iter()
        .map(|spec| (edit_distance(name, spec.name), spec.name))
        .filter(|(distance, known)| *distance * 3 <= known.len())
        .min()
        .map(|(_, known)| known)
}

/// Returns how many letters must be inserted, removed or replaced to make one word of the other.
fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, letter) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, other) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(letter != *other);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}
