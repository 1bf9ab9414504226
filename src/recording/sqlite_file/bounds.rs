//! An end for every file: rows only forwards, and steps and lengths by the file's size.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use rusqlite::limits::Limit;
use rusqlite::{Connection, ErrorCode};

/// `SQLite`'s own steps for one batch: so many for any file,
const STEPS: u64 = 1_000_000;
/// and so many for each byte of it. A batch that sorts a whole file without an index takes about one; the pages of a
/// damaged file can lead to each other, so that it would never end.
const STEPS_PER_BYTE: u64 = 8;
/// Steps between two looks at their count.
const STEPS_AT_ONCE: i32 = 1000;
/// A row is as long as the file at most, but `SQLite` needs some text of its own.
const LEAST_LENGTH: u64 = 1 << 20;

/// In which order rows are taken, after which row.
#[derive(Debug, Clone, Copy)]
pub(super) enum Cursor {
    /// By their times: time and number of the last row.
    ByTime(i64, i64),
    /// By their numbers, where the order by time cannot be read.
    ByNumber(i64),
    End,
}

impl Cursor {
    /// Returns the cursor behind a row; an error where that is no step forward, which would never end.
    pub(super) fn after(self, time: i64, number: i64) -> Result<Self, ReadError> {
        let (next, is_ahead) = match self {
            Self::ByTime(..) => (
                Self::ByTime(time, number),
                matches!(self, Self::ByTime(t, n) if (t, n) < (time, number)),
            ),
            Self::ByNumber(last) => (Self::ByNumber(number), last < number),
            Self::End => (Self::End, false),
        };
        is_ahead.then_some(next).ok_or(ReadError::Order)
    }
}

/// Why rows cannot be read.
#[derive(Debug, thiserror::Error)]
pub(super) enum ReadError {
    /// What `SQLite` says.
    #[error("{0}")]
    Sqlite(rusqlite::Error),
    /// Pages lead to each other.
    #[error("it takes more steps than a file of this size can need")]
    Endless,
    /// The index contradicts the table.
    #[error("its rows are not in the order that they are asked for")]
    Order,
}

impl From<rusqlite::Error> for ReadError {
    fn from(error: rusqlite::Error) -> Self {
        match error.sqlite_error_code() {
            Some(ErrorCode::OperationInterrupted) => Self::Endless,
            _ => Self::Sqlite(error),
        }
    }
}

/// Bounds what `SQLite` does for a file of this size; returns the count of its steps, which each batch sets to zero.
pub(super) fn bound(database: &mut Connection, size: u64) -> rusqlite::Result<Arc<AtomicU64>> {
    let length = i32::try_from(size.max(LEAST_LENGTH)).unwrap_or(i32::MAX);
    database.set_limit(Limit::SQLITE_LIMIT_LENGTH, length)?;
    let steps = Arc::new(AtomicU64::new(0));
    let count = Arc::clone(&steps);
    let most = STEPS.saturating_add(STEPS_PER_BYTE.saturating_mul(size));
    let by = u64::from(STEPS_AT_ONCE.unsigned_abs());
    let is_endless = move || count.fetch_add(by, Ordering::Relaxed) > most;
    database.progress_handler(STEPS_AT_ONCE, Some(is_endless))?;
    Ok(steps)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_without_end_are_an_error_and_not_waited_for() {
        let mut database = Connection::open_in_memory().expect("memory");
        let steps = bound(&mut database, 4096).expect("limits are known");
        let endless =
            "WITH RECURSIVE c(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM c) SELECT max(i) FROM c";
        let found: rusqlite::Result<i64> = database.query_row(endless, [], |row| row.get(0));
        let error = ReadError::from(found.expect_err("it never ends"));
        assert!(matches!(error, ReadError::Endless), "{error}");
        // The next batch has all its steps again.
        steps.store(0, Ordering::Relaxed);
        let found: rusqlite::Result<i64> = database.query_row("SELECT 7", [], |row| row.get(0));
        assert_eq!(found, Ok(7));
    }

    #[test]
    fn rows_longer_than_the_file_are_refused() {
        let mut database = Connection::open_in_memory().expect("memory");
        bound(&mut database, 2 << 20).expect("limits are known");
        let length = |bytes: i64| -> rusqlite::Result<i64> {
            database.query_row("SELECT length(randomblob(?1))", [bytes], |row| row.get(0))
        };
        assert_eq!(length(2 << 20), Ok(2 << 20));
        assert!(length((2 << 20) + 1).is_err());
    }

    #[test]
    fn rows_go_forwards_or_end() {
        let at = Cursor::ByTime(7, 3);
        assert!(matches!(at.after(7, 4), Ok(Cursor::ByTime(7, 4))));
        assert!(matches!(at.after(8, 1), Ok(Cursor::ByTime(8, 1))));
        for (time, number) in [(7, 3), (6, 9)] {
            assert!(matches!(at.after(time, number), Err(ReadError::Order)));
        }
        let at = Cursor::ByNumber(3);
        assert!(matches!(at.after(0, 4), Ok(Cursor::ByNumber(4))));
        assert!(matches!(at.after(9, 3), Err(ReadError::Order)));
        assert!(Cursor::End.after(9, 9).is_err());
    }
}
