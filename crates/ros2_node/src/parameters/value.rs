//! A raw value, and why a parameter cannot have it.

use std::fmt;

use crate::text::quoted;

/// A value from a file, an argument or a service, before any check.
#[derive(Debug, Clone, PartialEq)]
pub enum ParameterValue {
    /// True or false.
    Bool(bool),
    /// A whole number.
    Integer(i64),
    /// Any other number.
    Double(f64),
    /// Text.
    String(String),
}

impl ParameterValue {
    /// Returns the name of the value's type, for people.
    #[must_use]
    pub const fn type_name(&self) -> &'static str {
        match self {
            Self::Bool(_) => "bool",
            Self::Integer(_) => "integer",
            Self::Double(_) => "double",
            Self::String(_) => "string",
        }
    }
}

impl fmt::Display for ParameterValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bool(value) => write!(f, "{value}"),
            Self::Integer(value) => write!(f, "{value}"),
            Self::Double(value) => write!(f, "{value:?}"),
            Self::String(value) => f.write_str(&quoted(value)),
        }
    }
}

/// Why a parameter cannot have a value.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ParameterError {
    /// No such parameter.
    #[error("unknown parameter {}{}", quoted(name), suggest(*suggestion))]
    Unknown {
        /// As it was written.
        name: String,
        /// The name that was perhaps meant.
        suggestion: Option<&'static str>,
    },
    /// A value of another type.
    #[error("parameter {name:?} takes {expected}, got {value} ({})", value.type_name())]
    WrongType {
        /// The parameter.
        name: &'static str,
        /// Type that it takes.
        expected: &'static str,
        /// The value.
        value: ParameterValue,
    },
    /// A number outside its bounds.
    #[error("parameter {name:?} must be from {min} to {max}, got {value}")]
    OutOfRange {
        /// The parameter.
        name: &'static str,
        /// The value.
        value: ParameterValue,
        /// Least value.
        min: ParameterValue,
        /// Greatest value.
        max: ParameterValue,
    },
    /// NaN or infinite.
    #[error("parameter {name:?} must be a finite number, got {value}")]
    NotFinite {
        /// The parameter.
        name: &'static str,
        /// The value.
        value: f64,
    },
    /// A text that is not among those allowed.
    #[error("parameter {name:?} must be one of {}, got {}", allowed.join(", "), quoted(value))]
    NotAllowed {
        /// The parameter.
        name: &'static str,
        /// The value.
        value: String,
        /// The allowed texts.
        allowed: &'static [&'static str],
    },
    /// Text that cannot be used.
    #[error("parameter {name:?} must {requirement}, got {}", quoted(value))]
    BadText {
        /// The parameter.
        name: &'static str,
        /// The value.
        value: String,
        /// The requirement.
        requirement: &'static str,
    },
    /// A change of a parameter that is fixed while the node runs.
    #[error("parameter {name:?} is read-only: restart the node to change it")]
    ReadOnly {
        /// The parameter.
        name: &'static str,
    },
}

fn suggest(suggestion: Option<&str>) -> String {
    suggestion
        .map(|name| format!(", did you mean {name:?}?"))
        .unwrap_or_default()
}
