//! Writes MCAP files as ROS 2 has them: profile `ros2`, CDR, definitions as `ros2msg`.
//!
//! The same messages give the same bytes: nothing of the clock, of threads or of the order of a hash map is written.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use mcap::records::MessageHeader;
use mcap::{Compression, WriteOptions};

use super::definitions;
use super::message::RecordedTopic;
use crate::text;

/// A chunk is closed after this many bytes.
const CHUNK: u64 = 1 << 20;

/// Why a recording cannot be written.
#[derive(Debug, Clone, thiserror::Error)]
#[error("cannot write {}: {reason}", text::path(path))]
pub struct WriteError {
    path: PathBuf,
    reason: String,
}

/// A topic of a recording that is being written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Channel {
    id: u16,
}

/// A recording that is being written.
pub struct Writer {
    path: PathBuf,
    file: mcap::Writer<BufWriter<File>>,
    sequences: BTreeMap<u16, u32>,
}

impl Writer {
    /// Creates a file; one that exists is overwritten.
    ///
    /// # Errors
    /// [`WriteError`] when the system refuses.
    pub fn create(path: &Path) -> Result<Self, WriteError> {
        let failed = |reason: String| WriteError {
            path: path.to_owned(),
            reason,
        };
        let file = File::create(path).map_err(|error| failed(error.to_string()))?;
        let file = WriteOptions::new()
            .profile("ros2")
            .library(concat!("tanker_pose ", env!("CARGO_PKG_VERSION")))
            .compression(Some(Compression::Zstd))
            .compression_level(1)
            // With threads the bytes could depend on their turns.
            .compression_threads(0)
            .chunk_size(Some(CHUNK))
            .create(BufWriter::new(file))
            .map_err(|error| failed(error.to_string()))?;
        Ok(Self {
            path: path.to_owned(),
            file,
            sequences: BTreeMap::new(),
        })
    }

    /// Returns the channel of a topic, described as it is here, or else by its type's definition in this package.
    ///
    /// # Errors
    /// [`WriteError`] when the system refuses.
    pub fn channel(&mut self, topic: &RecordedTopic) -> Result<Channel, WriteError> {
        let own = definitions::definition(&topic.type_name);
        let definition = topic.definition.clone().or(own);
        let (encoding, text) = definition.map_or((String::new(), Vec::new()), |definition| {
            (definition.encoding, definition.text)
        });
        let mut metadata = BTreeMap::new();
        if !topic.offered_qos.is_empty() {
            let qos = topic.offered_qos.clone();
            metadata.insert("offered_qos_profiles".to_owned(), qos);
        }
        let file = &mut self.file;
        let id = file
            .add_schema(&topic.type_name, &encoding, &text)
            .and_then(|schema| file.add_channel(schema, &topic.name, &topic.encoding, &metadata))
            .map_err(|error| self.failed(&error))?;
        Ok(Channel { id })
    }

    /// Writes a message.
    ///
    /// # Errors
    /// [`WriteError`] when the system refuses.
    pub fn write(
        &mut self,
        channel: Channel,
        log_time_ns: u64,
        publish_time_ns: u64,
        bytes: &[u8],
    ) -> Result<(), WriteError> {
        let next = self.sequences.entry(channel.id).or_default();
        let header = MessageHeader {
            channel_id: channel.id,
            sequence: *next,
            log_time: log_time_ns,
            publish_time: publish_time_ns,
        };
        *next = next.wrapping_add(1);
        self.file
            .write_to_known_channel(&header, bytes)
            .map_err(|error| self.failed(&error))
    }

    /// Completes the file.
    ///
    /// # Errors
    /// [`WriteError`] when the system refuses.
    pub fn finish(mut self) -> Result<(), WriteError> {
        let finished = self.file.finish();
        finished.map_err(|error| self.failed(&error))?;
        let Self { path, file, .. } = self;
        // The last bytes may still be in the buffer.
        let buffer = file.into_inner().into_inner();
        match buffer.map_err(std::io::IntoInnerError::into_error) {
            Ok(_) => Ok(()),
            Err(error) => Err(WriteError {
                path,
                reason: error.to_string(),
            }),
        }
    }

    /// Returns an error about this file.
    pub(super) fn error(&self, reason: &str) -> WriteError {
        WriteError {
            path: self.path.clone(),
            reason: reason.to_owned(),
        }
    }

    fn failed(&self, error: &mcap::McapError) -> WriteError {
        let cause = std::error::Error::source(error).map(ToString::to_string);
        self.error(&cause.unwrap_or_else(|| error.to_string()))
    }
}
