//! Recordings written by the libraries of their formats, whole and damaged.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use mcap::records::MessageHeader;
use mcap::{Compression, WriteOptions};
use rusqlite::Connection;

use tanker_pose::recording::Recording;

/// Log times, ns: in neither of the formats they need be in order.
const TIMES: [u64; 12] = [10, 30, 20, 20, 60, 50, 40, 70, 80, 90, 110, 100];

/// A folder of its own, removed at the end.
struct Scratch(PathBuf);

impl Scratch {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("recording_{name}_{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&path);
        std::fs::create_dir_all(&path).expect("the directory for temporary files is writable");
        Self(path)
    }

    fn file(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.0.join(name);
        std::fs::write(&path, bytes).expect("the folder is writable");
        path
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// The bytes of the message with this number.
fn bytes(number: usize) -> Vec<u8> {
    let mut bytes = vec![u8::try_from(number).expect("few"); 40];
    bytes[..4].copy_from_slice(&[0, 1, 0, 0]);
    bytes
}

fn options(compression: Option<Compression>) -> WriteOptions {
    // Three messages a chunk.
    WriteOptions::new()
        .compression(compression)
        .chunk_size(Some(150))
        .compression_threads(0)
}

/// An MCAP file of two topics in turns.
fn mcap_file(options: WriteOptions) -> Vec<u8> {
    let mut file = Cursor::new(Vec::new());
    let mut writer = options.create(&mut file).expect("options are valid");
    let schema = writer
        .add_schema("std_msgs/msg/Header", "ros2msg", b"string frame_id")
        .expect("few schemas");
    let channels = ["/a", "/b"].map(|topic| {
        writer
            .add_channel(schema, topic, "cdr", &BTreeMap::new())
            .expect("few channels")
    });
    for (number, log_time) in TIMES.into_iter().enumerate() {
        let header = MessageHeader {
            channel_id: channels[number % 2],
            sequence: 0,
            log_time,
            publish_time: log_time,
        };
        writer
            .write_to_known_channel(&header, &bytes(number))
            .expect("in memory");
    }
    writer.finish().expect("in memory");
    drop(writer);
    file.into_inner()
}

fn sqlite_file(path: &Path) {
    let database = Connection::open(path).expect("the folder is writable");
    database
        .execute_batch(
            "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,
               serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL);
             CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL,
               timestamp INTEGER NOT NULL, data BLOB NOT NULL);
             CREATE INDEX timestamp_idx ON messages (timestamp ASC);
             INSERT INTO topics VALUES (1, '/a', 'std_msgs/msg/Header', 'cdr', ''),
               (2, '/b', 'std_msgs/msg/Header', 'cdr', '');",
        )
        .expect("valid SQL");
    for (number, time) in TIMES.into_iter().enumerate() {
        let topic = i64::from(number % 2 == 1) + 1;
        let time = i64::try_from(time).expect("small");
        database
            .execute(
                "INSERT INTO messages(topic_id, timestamp, data) VALUES (?1, ?2, ?3)",
                (topic, time, bytes(number)),
            )
            .expect("valid SQL");
    }
}

/// Messages as (log time, topic, number), and damage in words.
fn read(path: &Path) -> (Vec<(u64, String, usize)>, Vec<String>) {
    let (mut messages, mut damages) = (Vec::new(), Vec::new());
    for item in Recording::open(path).expect("it can be opened") {
        match item {
            Ok(message) => {
                let number = usize::from(message.bytes[39]);
                assert_eq!(message.bytes, bytes(number));
                messages.push((message.log_time_ns, message.topic.name.clone(), number));
            }
            Err(damage) => damages.push(damage.to_string()),
        }
    }
    (messages, damages)
}

/// What [`read`] gives of whole files: by time, and those of the same time as they were written.
fn whole() -> Vec<(u64, String, usize)> {
    let mut all: Vec<_> = (0..TIMES.len())
        .map(|number| (TIMES[number], ["/a", "/b"][number % 2].to_owned(), number))
        .collect();
    all.sort_by_key(|(time, ..)| *time);
    all
}

fn every_kind() -> Vec<(&'static str, Vec<u8>)> {
    vec![
        ("zstd", mcap_file(options(Some(Compression::Zstd)))),
        ("lz4", mcap_file(options(Some(Compression::Lz4)))),
        ("plain", mcap_file(options(None))),
        ("unchunked", mcap_file(options(None).use_chunks(false))),
        (
            "unindexed",
            mcap_file(options(None).emit_summary_records(false)),
        ),
    ]
}

#[test]
fn every_kind_of_mcap_file_gives_all_messages_by_their_times() {
    let scratch = Scratch::new("kinds");
    for (kind, content) in every_kind() {
        let path = scratch.file(kind, &content);
        assert_eq!(read(&path), (whole(), vec![]), "{kind}");
        let topics = Recording::open(&path).expect("it can be opened");
        let names: Vec<&str> = topics.topics().iter().map(|t| t.name.as_str()).collect();
        assert_eq!(names, ["/a", "/b"], "{kind}");
        let first = &topics.topics()[0];
        assert_eq!(first.type_name, "std_msgs/msg/Header");
        assert!(first.definition.is_some());
    }
}

#[test]
fn sqlite_file_gives_all_messages_by_their_times() {
    let scratch = Scratch::new("sqlite");
    let path = scratch.0.join("bag_0.db3");
    sqlite_file(&path);
    assert_eq!(read(&path), (whole(), vec![]));
}

#[test]
fn folder_of_several_files_is_one_recording() {
    let scratch = Scratch::new("folder");
    scratch.file("bag_0.mcap", &mcap_file(options(None)));
    sqlite_file(&scratch.0.join("bag_1.db3"));
    let mut twice = [whole(), whole()].concat();
    twice.sort_by_key(|(time, ..)| *time);
    let (messages, damages) = read(&scratch.0);
    let times = |all: &[(u64, String, usize)]| all.iter().map(|m| m.0).collect::<Vec<_>>();
    assert_eq!(times(&messages), times(&twice));
    assert_eq!(damages, [""; 0]);

    let text = "rosbag2_bagfile_information:\n  version: 5\n  relative_file_paths:\n    - bag_1.db3\n    - gone.db3\n  \
                compression_mode: \"\"\n";
    scratch.file("metadata.yaml", text.as_bytes());
    let (messages, damages) = read(&scratch.0);
    assert_eq!(messages, whole());
    assert!(damages[0].contains("gone.db3"), "{damages:?}");

    let packed = text.replace("\"\"", "MESSAGE");
    scratch.file("metadata.yaml", packed.as_bytes());
    let refused = Recording::open(&scratch.0).err().expect("it is packed");
    assert!(refused.to_string().contains("MESSAGE"), "{refused}");
}

#[test]
fn cut_files_give_the_messages_before_the_cut_and_say_so() {
    let scratch = Scratch::new("cut");
    for (kind, content) in every_kind() {
        let mut most = 0;
        let complete = content.len() - mcap::MAGIC.len() - 29;
        for length in (mcap::MAGIC.len()..complete).step_by(7) {
            let path = scratch.file("cut.mcap", &content[..length]);
            let (messages, damages) = read(&path);
            assert!(
                damages.iter().any(|words| words.contains("cut off")),
                "{kind} {length}: {damages:?}"
            );
            assert!(messages.is_sorted_by_key(|(time, ..)| *time));
            // Nothing that was read once is lost by a later cut.
            assert!(messages.len() >= most, "{kind} {length}");
            most = messages.len();
        }
        assert_eq!(most, TIMES.len(), "{kind}");
    }
}

#[test]
fn damaged_chunk_is_named_and_the_others_are_read() {
    let scratch = Scratch::new("chunk");
    for (kind, mut content) in every_kind().into_iter().take(3) {
        // The bytes of the chunk's first message, or of what they were packed into.
        let chunk = mcap::MAGIC.len() + content[9..].iter().take_while(|b| **b != 6).count();
        let middle = chunk + 120;
        content[middle] ^= 0x55;
        let (messages, damages) = read(&scratch.file(kind, &content));
        assert_eq!(damages.len(), 1, "{kind}: {damages:?}");
        assert!(damages[0].contains("the chunk at byte"), "{damages:?}");
        assert!(damages[0].contains("messages"), "{damages:?}");
        assert!(
            (6..12).contains(&messages.len()),
            "{kind}: {}",
            messages.len()
        );
    }
}

#[test]
fn no_damaged_byte_makes_a_message_that_was_never_written() {
    let scratch = Scratch::new("flip");
    for (_, content) in every_kind().into_iter().take(3) {
        for place in (8..content.len()).step_by(11) {
            let mut damaged = content.clone();
            damaged[place] ^= 0xff;
            let path = scratch.file("flip.mcap", &damaged);
            // `read` compares the bytes of each.
            let (messages, _) = read(&path);
            assert!(messages.len() <= TIMES.len());
        }
    }
}

#[test]
fn messages_behind_bytes_that_are_no_records_are_found_by_the_index() {
    let scratch = Scratch::new("lost");
    let mut content = mcap_file(options(None));
    let second = content
        .windows(9)
        .enumerate()
        .filter(|(_, window)| window[0] == 6 && window[2..9].iter().all(|b| *b == 0 || *b == 1))
        .map(|(at, _)| at)
        .find(|at| *at > 400)
        .expect("there are several chunks");
    content[second] = 0x55;
    let (messages, damages) = read(&scratch.file("lost.mcap", &content));
    assert!(damages[0].contains("the index at the end"), "{damages:?}");
    assert!(messages.len() >= 6, "{}", messages.len());
}

#[test]
fn cut_sqlite_file_gives_what_can_be_read_and_says_so() {
    let scratch = Scratch::new("cut_sqlite");
    let path = scratch.0.join("bag_0.db3");
    sqlite_file(&path);
    let database = Connection::open(&path).expect("it is there");
    for _ in 0..9 {
        database
            .execute_batch("INSERT INTO messages(topic_id, timestamp, data) SELECT topic_id, timestamp, data FROM messages")
            .expect("valid SQL");
    }
    drop(database);
    let content = std::fs::read(&path).expect("it was written");
    let all = TIMES.len() << 9;
    let path = scratch.file("cut.db3", &content[..content.len() / 2]);
    let (messages, damages) = read(&path);
    assert!(!damages.is_empty());
    assert!(
        (all / 10..all).contains(&messages.len()),
        "{} of {all}: {damages:?}",
        messages.len()
    );
}

#[test]
fn what_is_no_recording_is_refused_by_name() {
    let scratch = Scratch::new("none");
    for (path, words) in [
        (scratch.file("text.mcap", b"hello"), "neither an MCAP"),
        (scratch.0.join("missing"), "missing"),
        (
            scratch.file("empty.db3", b"SQLite format 3\0"),
            "SQLite file",
        ),
    ] {
        let refused = Recording::open(&path).err().expect(words);
        assert!(refused.to_string().contains(words), "{refused}");
    }
    std::fs::create_dir(scratch.0.join("folder")).expect("the folder is writable");
    let refused = Recording::open(&scratch.0.join("folder"))
        .err()
        .expect("empty");
    assert!(refused.to_string().contains("metadata.yaml"), "{refused}");
}

#[test]
fn chunk_that_begins_before_its_announced_time_is_read_and_named() {
    let scratch = Scratch::new("late");
    let mut file = mcap_file(options(None));
    let chunks = |file: &[u8]| -> usize {
        let (mut at, chunk) = (8, mcap::records::op::CHUNK);
        while file[at] != chunk {
            let length: [u8; 8] = file[at + 1..at + 9].try_into().expect("eight bytes");
            at += 9 + usize::try_from(u64::from_le_bytes(length)).expect("small");
        }
        at
    };
    let first_time = chunks(&file) + 9;
    file[first_time..first_time + 8].copy_from_slice(&15_u64.to_le_bytes());
    let (messages, damages) = read(&scratch.file("late.mcap", &file));
    assert_eq!(messages, whole());
    assert!(
        damages.len() == 1 && damages[0].contains("older than it says"),
        "{damages:?}"
    );
}

#[test]
#[cfg(unix)]
fn a_pipe_is_refused_before_it_is_waited_for() {
    let scratch = Scratch::new("pipe");
    let path = scratch.0.join("pipe.mcap");
    let made = std::process::Command::new("mkfifo").arg(&path).status();
    assert!(made.expect("mkfifo").success());
    let error = Recording::open(&path).err().expect("nobody writes");
    assert!(error.to_string().contains("is not a file"), "{error}");
}
