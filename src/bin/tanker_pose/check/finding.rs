//! What a check found, how bad it is, and what to do about it.

use std::fmt;

/// How bad a finding is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// Worth knowing; nothing is wrong.
    Note,
    /// The flight will not go as wished.
    Warning,
    /// Something is wrong, or nearly certainly so.
    Error,
}

/// One finding.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Finding {
    pub severity: Severity,
    /// What kind of finding it is, for programs.
    pub code: &'static str,
    /// What was found.
    pub found: String,
    /// What to do.
    pub advice: String,
}

impl Finding {
    pub fn error(code: &'static str, found: String, advice: impl Into<String>) -> Self {
        Self::new(Severity::Error, code, found, advice)
    }

    pub fn warning(code: &'static str, found: String, advice: impl Into<String>) -> Self {
        Self::new(Severity::Warning, code, found, advice)
    }

    pub fn note(code: &'static str, found: String, advice: impl Into<String>) -> Self {
        Self::new(Severity::Note, code, found, advice)
    }

    fn new(
        severity: Severity,
        code: &'static str,
        found: String,
        advice: impl Into<String>,
    ) -> Self {
        Self {
            severity,
            code,
            found,
            advice: advice.into(),
        }
    }
}

impl Severity {
    pub fn word(self) -> &'static str {
        match self {
            Self::Note => "note",
            Self::Warning => "warning",
            Self::Error => "error",
        }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}: {}", self.severity.word(), self.code, self.found)?;
        if self.advice.is_empty() {
            Ok(())
        } else {
            write!(f, "; {}", self.advice)
        }
    }
}
