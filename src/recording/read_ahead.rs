//! A recording read by a thread of its own, so that unpacking it goes on beside the work on its messages.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, sync_channel};
use std::thread::JoinHandle;

use super::damage::Damage;
use super::message::{RecordedMessage, RecordedTopic};
use super::reader::Recording;

/// What the thread hands over at a time.
const BATCH: usize = 256;
/// Batches that may wait: memory does not grow with the length of the recording.
const WAITING: usize = 8;

type Item = Result<RecordedMessage, Damage>;

/// The items of a [`Recording`], in the same order, read by a thread of its own.
pub struct ReadAhead {
    batches: Receiver<Vec<Item>>,
    current: std::vec::IntoIter<Item>,
    /// `None` after the end.
    thread: Option<JoinHandle<()>>,
    topics: Vec<Arc<RecordedTopic>>,
    size: u64,
    passed: Arc<AtomicU64>,
}

impl ReadAhead {
    /// Begins to read.
    ///
    /// # Errors
    /// The system's, when it has no thread left.
    pub fn start(mut recording: Recording) -> std::io::Result<Self> {
        let topics = recording.topics().to_vec();
        let (size, _) = recording.size_and_passed();
        let passed = Arc::new(AtomicU64::new(0));
        let progress = Arc::clone(&passed);
        let (sender, batches) = sync_channel(WAITING);
        let thread = std::thread::Builder::new()
            .name("reading".to_owned())
            .spawn(move || {
                loop {
                    let batch: Vec<Item> = recording.by_ref().take(BATCH).collect();
                    let is_last = batch.len() < BATCH;
                    progress.store(recording.size_and_passed().1, Ordering::Relaxed);
                    // Nobody listens when the work on the messages has failed.
                    if sender.send(batch).is_err() || is_last {
                        return;
                    }
                }
            })?;
        Ok(Self {
            batches,
            current: Vec::new().into_iter(),
            thread: Some(thread),
            topics,
            size,
            passed,
        })
    }

    /// Returns the topics, as [`Recording::topics`].
    #[must_use]
    pub fn topics(&self) -> &[Arc<RecordedTopic>] {
        &self.topics
    }

    /// Returns the length of all files, and how much of it was read, in bytes: for a progress bar.
    #[must_use]
    pub fn size_and_passed(&self) -> (u64, u64) {
        (self.size, self.passed.load(Ordering::Relaxed))
    }

    /// Returns the damage of a thread that did not reach the end.
    fn end(&mut self) -> Option<Item> {
        let ended = self.thread.take()?.join();
        let words = "the recording was not read to its end: the reading thread failed";
        ended.err().map(|_| Err(Damage::File(words.to_owned())))
    }
}

impl Iterator for ReadAhead {
    type Item = Item;

    fn next(&mut self) -> Option<Item> {
        loop {
            if let Some(item) = self.current.next() {
                return Some(item);
            }
            match self.batches.recv() {
                Ok(batch) => self.current = batch.into_iter(),
                Err(_) => return self.end(),
            }
        }
    }
}
