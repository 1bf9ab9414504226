//! A whole recording: its files together, their messages by log time.

use std::collections::VecDeque;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::damage::{Damage, OpenError};
use super::folder;
use super::mcap_file::{McapFile, is_mcap};
use super::message::{RecordedMessage, RecordedTopic};
use super::sqlite_file::{SqliteFile, is_sqlite};
use crate::text;

/// A file of either format.
enum Source {
    Mcap(Box<McapFile>),
    Sqlite(Box<SqliteFile>),
}

impl Source {
    fn open(path: &Path) -> Result<Self, OpenError> {
        let name = text::path(path);
        let unreadable = |source| OpenError::Unreadable {
            path: path.to_owned(),
            source,
        };
        // Before it is opened: to open a named pipe waits until somebody writes to it.
        if !std::fs::metadata(path).map_err(unreadable)?.is_file() {
            return Err(OpenError::NoFile(path.to_owned()));
        }
        let mut start = Vec::new();
        let file = std::fs::File::open(path).map_err(unreadable)?;
        file.take(16).read_to_end(&mut start).map_err(unreadable)?;
        if is_mcap(&start) {
            let file = McapFile::open(path, &name).map_err(unreadable)?;
            return Ok(Self::Mcap(Box::new(file)));
        }
        if is_sqlite(&start) {
            return Ok(Self::Sqlite(Box::new(SqliteFile::open(path, &name)?)));
        }
        Err(OpenError::Unknown(path.to_owned()))
    }

    fn topics(&mut self) -> Vec<Arc<RecordedTopic>> {
        match self {
            Self::Mcap(file) => file.topics(),
            Self::Sqlite(file) => file.topics(),
        }
    }

    fn bound(&self) -> Option<u64> {
        match self {
            Self::Mcap(file) => file.bound(),
            Self::Sqlite(file) => file.bound(),
        }
    }

    fn step(&mut self) -> Option<Result<RecordedMessage, Damage>> {
        match self {
            Self::Mcap(file) => file.step(),
            Self::Sqlite(file) => file.step(),
        }
    }

    fn size_and_passed(&self) -> (u64, u64) {
        match self {
            Self::Mcap(file) => (file.size(), file.passed()),
            Self::Sqlite(file) => (file.size(), file.passed()),
        }
    }
}

/// A recording that is read from its first message to its last.
///
/// The iterator gives messages by log time, those of the same time in the order in which they were written, and damage
/// where it meets it; it goes on after damage.
pub struct Recording {
    sources: Vec<Source>,
    topics: Vec<Arc<RecordedTopic>>,
    damages: VecDeque<Damage>,
}

impl Recording {
    /// Opens an MCAP file, an `SQLite` file of rosbag2, or a folder of either.
    ///
    /// # Errors
    /// [`OpenError`] when nothing of it can be read. Of a folder whose files can be read only in part, the others are
    /// [`Damage`].
    pub fn open(path: &Path) -> Result<Self, OpenError> {
        Self::of_files(&folder::files(path)?)
    }

    fn of_files(files: &[PathBuf]) -> Result<Self, OpenError> {
        let mut found = Self {
            sources: Vec::new(),
            topics: Vec::new(),
            damages: VecDeque::new(),
        };
        let mut first_error = None;
        for file in files {
            match Source::open(file) {
                Ok(source) => found.sources.push(source),
                Err(error) => {
                    found.damages.push_back(Damage::File(error.to_string()));
                    first_error.get_or_insert(error);
                }
            }
        }
        if let (true, Some(error)) = (found.sources.is_empty(), first_error) {
            return Err(error);
        }
        for topic in found.sources.iter_mut().flat_map(Source::topics) {
            if !found.topics.contains(&topic) {
                found.topics.push(topic);
            }
        }
        Ok(found)
    }

    /// Returns the topics; a name with two types is there twice.
    #[must_use]
    pub fn topics(&self) -> &[Arc<RecordedTopic>] {
        &self.topics
    }

    /// Returns the length of all files, and how much of it was read, in bytes: for a progress bar.
    #[must_use]
    pub fn size_and_passed(&self) -> (u64, u64) {
        let each = self.sources.iter().map(Source::size_and_passed);
        each.fold((0, 0), |(size, passed), (s, p)| (size + s, passed + p))
    }
}

impl Iterator for Recording {
    type Item = Result<RecordedMessage, Damage>;

    fn next(&mut self) -> Option<Self::Item> {
        if let Some(damage) = self.damages.pop_front() {
            return Some(Err(damage));
        }
        loop {
            let bounds = self.sources.iter().enumerate();
            let (_, first) = bounds
                .filter_map(|(index, source)| source.bound().map(|bound| (bound, index)))
                .min()?;
            // None: a block was read, which may begin later than was announced.
            if let Some(item) = self.sources[first].step() {
                return Some(item);
            }
        }
    }
}
