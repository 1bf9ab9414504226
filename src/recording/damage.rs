//! What of a recording cannot be read, and why.

use std::path::PathBuf;

use crate::text;

/// Why nothing of a recording can be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OpenError {
    /// The system refuses.
    #[error("cannot read {}: {source}", text::path(path))]
    Unreadable {
        /// The file or folder.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// A pipe, a device, a folder in a bag.
    #[error("{} is not a file: a recording is read at several places, which a pipe or a device does not allow", text::path(.0))]
    NoFile(PathBuf),
    /// Neither format.
    #[error("{} is neither an MCAP file nor an SQLite file of rosbag2", text::path(.0))]
    Unknown(PathBuf),
    /// A folder without recordings.
    #[error("{} has no metadata.yaml and no file that ends in .mcap or .db3", text::path(.0))]
    Empty(PathBuf),
    /// A bag's description.
    #[error("{0}")]
    Metadata(#[from] crate::yaml::YamlError),
    /// Files or messages are packed by rosbag2 itself.
    #[error(
        "{} was compressed by rosbag2 (mode {mode}), which is not read here: unpack it with `ros2 bag convert`, or record with \
         the compression of MCAP",
        text::path(path)
    )]
    Compressed {
        /// The bag.
        path: PathBuf,
        /// FILE or MESSAGE.
        mode: String,
    },
    /// An `SQLite` file that is no bag.
    #[error(
        "{} is an SQLite file, but no bag of rosbag2: {source}",
        text::path(path)
    )]
    Database {
        /// The file.
        path: PathBuf,
        /// What `SQLite` says.
        source: rusqlite::Error,
    },
}

/// A part of a recording that cannot be read; what lies around it is.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Damage {
    /// The file ends before it is complete.
    #[error("{file} is cut off: it ends at byte {at} {within}, without its index")]
    Cut {
        /// The file.
        file: String,
        /// Its length.
        at: u64,
        /// In the middle of what.
        within: &'static str,
    },
    /// One chunk.
    #[error("{file}: the chunk at byte {at} ({}{from_s:.3} s to {to_s:.3} s) cannot be read: {reason}", count(*.messages))]
    Chunk {
        /// The file.
        file: String,
        /// Its place in the file.
        at: u64,
        /// Log time of its first message, s.
        from_s: f64,
        /// Log time of its last message, s.
        to_s: f64,
        /// How many messages it has, if the file says it.
        messages: Option<u64>,
        /// What is wrong.
        reason: String,
    },
    /// A chunk whose messages begin before the time that it is announced with.
    #[error(
        "{file}: messages of the chunk at byte {at} are up to {early_s:.3} s older than it says, and may come late"
    )]
    Late {
        /// The file.
        file: String,
        /// Its place in the file.
        at: u64,
        /// By how much its first message is older, s.
        early_s: f64,
    },
    /// Bytes that are no records.
    #[error("{file}: from byte {at} on there are no records ({reason}), {found}")]
    NoRecords {
        /// The file.
        file: String,
        /// Where they begin.
        at: u64,
        /// What is there.
        reason: String,
        /// What is read nevertheless.
        found: String,
    },
    /// Messages of a channel that the file does not describe.
    #[error("{file}: {count} message(s) of a channel {channel} that the file does not describe")]
    UnknownChannel {
        /// The file.
        file: String,
        /// The channel's number.
        channel: u16,
        /// How many messages of it were skipped in a block.
        count: u64,
    },
    /// A file of a bag that is missing or cannot be opened.
    #[error("{0}")]
    File(String),
    /// Rows of an `SQLite` file.
    #[error("{file}: {reason}")]
    Rows {
        /// The file.
        file: String,
        /// What is wrong, and what is read nevertheless.
        reason: String,
    },
}

fn count(messages: Option<u64>) -> String {
    messages.map_or_else(String::new, |count| format!("{count} messages, "))
}
