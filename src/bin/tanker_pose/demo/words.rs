//! Outcomes in words.

use tanker_pose::pipeline::OutcomeCode;

/// `UNKNOWN_ID` in words that need no manual.
pub fn plainly(code: OutcomeCode) -> String {
    code.name().to_ascii_lowercase().replace('_', " ")
}
