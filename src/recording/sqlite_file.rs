//! One `SQLite` file of rosbag2: topics in one table, messages in another.

mod bounds;

use std::collections::{HashMap, VecDeque};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use rusqlite::{Connection, ErrorCode, OpenFlags, params};

use self::bounds::{Cursor, ReadError, bound};
use super::damage::{Damage, OpenError};
use super::message::{Definition, RecordedMessage, RecordedTopic};

/// Rows are taken in batches of this many at most,
const MOST_ROWS: i64 = 1024;
/// and of about this many bytes.
const MOST_BYTES: usize = 1 << 22;
const BY_TIME: &str = "SELECT id, topic_id, timestamp, data FROM messages WHERE (timestamp, id) > (?2, ?3) \
    ORDER BY timestamp, id LIMIT ?1";
const BY_NUMBER: &str = "SELECT id, topic_id, timestamp, data FROM messages NOT INDEXED WHERE id > ?2 ORDER BY id LIMIT ?1";

/// Whether a file begins as those of `SQLite` do.
pub(super) fn is_sqlite(start: &[u8]) -> bool {
    start.starts_with(b"SQLite format 3\0")
}

/// The messages of a file by their times.
pub(super) struct SqliteFile {
    name: String,
    database: Connection,
    size: u64,
    passed: u64,
    topics: HashMap<i64, Arc<RecordedTopic>>,
    cursor: Cursor,
    batch: VecDeque<RecordedMessage>,
    damages: VecDeque<Damage>,
    unknown: HashMap<i64, u64>,
    /// Of `SQLite`, since the batch began.
    steps: Arc<AtomicU64>,
}

impl SqliteFile {
    /// Opens a file; `name` is for messages about it.
    pub(super) fn open(path: &Path, name: &str) -> Result<Self, OpenError> {
        let refused = |source| OpenError::Database {
            path: path.to_owned(),
            source,
        };
        let mut database =
            Connection::open_with_flags(path, OpenFlags::SQLITE_OPEN_READ_ONLY).map_err(refused)?;
        let size = std::fs::metadata(path).map_or(0, |found| found.len());
        // What a recorder wrote last may stand in the file beside it.
        let mut beside = path.as_os_str().to_owned();
        beside.push("-wal");
        let more = std::fs::metadata(beside).map_or(0, |found| found.len());
        let steps = bound(&mut database, size.saturating_add(more)).map_err(refused)?;
        let mut damages = VecDeque::new();
        let mut cursor = Cursor::ByTime(i64::MIN, i64::MIN);
        let topics = match topics(&database) {
            Err(error) if error.sqlite_error_code() == Some(ErrorCode::DatabaseCorrupt) => {
                // It is shorter than it says. Only so does SQLite read it nevertheless; it is open for reading only.
                database
                    .execute_batch("PRAGMA writable_schema = ON")
                    .map_err(refused)?;
                damages.push_back(Damage::Rows {
                    file: name.to_owned(),
                    reason: format!("{error}: it is read in the order in which it was written, as far as that goes"),
                });
                cursor = Cursor::ByNumber(i64::MIN);
                topics(&database)
            }
            found => found,
        };
        let topics = topics.map_err(refused)?;
        Ok(Self {
            name: name.to_owned(),
            size,
            passed: 0,
            database,
            topics,
            cursor,
            batch: VecDeque::new(),
            damages,
            unknown: HashMap::new(),
            steps,
        })
    }

    /// Returns the topics.
    pub(super) fn topics(&self) -> Vec<Arc<RecordedTopic>> {
        let mut topics: Vec<(&i64, &Arc<RecordedTopic>)> = self.topics.iter().collect();
        topics.sort_by_key(|(id, _)| **id);
        topics.into_iter().map(|(_, t)| Arc::clone(t)).collect()
    }

    pub(super) const fn size(&self) -> u64 {
        self.size
    }

    /// Returns about how many bytes of the file have been read.
    pub(super) fn passed(&self) -> u64 {
        self.passed.min(self.size)
    }

    /// Returns a time that no further message is before; `None` at the end.
    pub(super) fn bound(&self) -> Option<u64> {
        if !self.damages.is_empty() {
            return Some(0);
        }
        if let Some(message) = self.batch.front() {
            return Some(message.log_time_ns);
        }
        match self.cursor {
            Cursor::ByTime(after, _) => Some(u64::try_from(after).unwrap_or(0)),
            Cursor::ByNumber(_) => Some(0),
            Cursor::End => None,
        }
    }

    /// Returns the next message or damage; `None` when rows were read instead, or at the end.
    pub(super) fn step(&mut self) -> Option<Result<RecordedMessage, Damage>> {
        if let Some(damage) = self.damages.pop_front() {
            return Some(Err(damage));
        }
        if let Some(message) = self.batch.pop_front() {
            return Some(Ok(message));
        }
        match self.read() {
            Ok(()) => None,
            Err(error) => Some(Err(self.broken(&error))),
        }
    }

    /// Reads a batch of rows.
    fn read(&mut self) -> Result<(), ReadError> {
        self.steps.store(0, Ordering::Relaxed);
        let sql = match self.cursor {
            Cursor::ByTime(..) => BY_TIME,
            Cursor::ByNumber(_) => BY_NUMBER,
            Cursor::End => return Ok(()),
        };
        let mut statement = self.database.prepare(sql)?;
        let mut rows = match self.cursor {
            Cursor::ByTime(time, number) => statement.query(params![MOST_ROWS, time, number])?,
            Cursor::ByNumber(number) => statement.query(params![MOST_ROWS, number])?,
            Cursor::End => return Ok(()),
        };
        let (mut count, mut bytes) = (0, 0);
        while let Some(row) = rows.next()? {
            let (number, topic, time): (i64, i64, i64) = (row.get(0)?, row.get(1)?, row.get(2)?);
            self.cursor = self.cursor.after(time, number)?;
            let data = row.get_ref(3)?.as_bytes_or_null().ok().flatten();
            let data = data.unwrap_or_default();
            count += 1;
            bytes += data.len();
            self.passed += data.len() as u64;
            let log_time_ns = u64::try_from(time).unwrap_or(0);
            match self.topics.get(&topic) {
                Some(topic) => self.batch.push_back(RecordedMessage {
                    topic: Arc::clone(topic),
                    log_time_ns,
                    publish_time_ns: log_time_ns,
                    bytes: data.to_vec(),
                }),
                None => *self.unknown.entry(topic).or_default() += 1,
            }
            if bytes > MOST_BYTES {
                return Ok(());
            }
        }
        drop(rows);
        drop(statement);
        if matches!(self.cursor, Cursor::ByNumber(_)) {
            let batch = self.batch.make_contiguous();
            batch.sort_by_key(|message| message.log_time_ns);
        }
        if count < MOST_ROWS {
            self.end();
        }
        Ok(())
    }

    fn end(&mut self) {
        self.cursor = Cursor::End;
        let mut unknown: Vec<(i64, u64)> = self.unknown.drain().collect();
        unknown.sort_unstable();
        for (topic, count) in unknown {
            self.damages.push_back(Damage::Rows {
                file: self.name.clone(),
                reason: format!(
                    "{count} message(s) of a topic {topic} that the file does not describe"
                ),
            });
        }
    }

    /// Goes on in the order of the rows where their order by time cannot be read, and ends where that cannot either.
    fn broken(&mut self, error: &ReadError) -> Damage {
        let reason = if let Cursor::ByTime(i64::MIN, _) = self.cursor {
            self.cursor = Cursor::ByNumber(i64::MIN);
            format!(
                "the messages cannot be read by their times ({error}): they are read as they were written, as far as that goes"
            )
        } else {
            self.end();
            format!(
                "the messages cannot be read any further ({error}): `sqlite3 FILE .recover` may find more"
            )
        };
        Damage::Rows {
            file: self.name.clone(),
            reason,
        }
    }
}

/// Reads the table of topics; the columns have become more over the versions.
fn topics(database: &Connection) -> rusqlite::Result<HashMap<i64, Arc<RecordedTopic>>> {
    let has = |table: &str, column: &str| -> rusqlite::Result<bool> {
        let sql = "SELECT count(*) FROM pragma_table_info(?1) WHERE name = ?2";
        let count: i64 = database.query_row(sql, params![table, column], |row| row.get(0))?;
        Ok(count > 0)
    };
    let qos = if has("topics", "offered_qos_profiles")? {
        "offered_qos_profiles"
    } else {
        "''"
    };
    let mut definitions = HashMap::new();
    if has("message_definitions", "encoded_message_definition")? {
        let mut statement = database.prepare(
            "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions",
        )?;
        let mut rows = statement.query([])?;
        while let Some(row) = rows.next()? {
            let (name, encoding, text): (String, String, String) =
                (row.get(0)?, row.get(1)?, row.get(2)?);
            let text = text.into_bytes();
            definitions.insert(name, Definition { encoding, text });
        }
    }
    let sql = format!("SELECT id, name, type, serialization_format, {qos} FROM topics");
    let mut statement = database.prepare(&sql)?;
    let mut rows = statement.query([])?;
    let mut topics = HashMap::new();
    while let Some(row) = rows.next()? {
        let type_name: String = row.get(2)?;
        let topic = RecordedTopic {
            name: row.get(1)?,
            encoding: row.get(3)?,
            definition: definitions
                .get(&type_name)
                .filter(|found| !found.text.is_empty())
                .cloned(),
            type_name,
            offered_qos: row.get::<_, Option<String>>(4)?.unwrap_or_default(),
        };
        topics.insert(row.get(0)?, Arc::new(topic));
    }
    Ok(topics)
}
