//! Exit codes of the tools that read recordings.

/// All was read and used.
pub const WHOLE: u8 = 0;
/// Some of it could not be read or used.
pub const IN_PART: u8 = 1;
/// Nothing of it could.
pub const NOTHING: u8 = 2;
