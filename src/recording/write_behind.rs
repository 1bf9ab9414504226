//! A recording written by a thread of its own, so that packing it goes on beside the work that gives its messages.

use std::sync::mpsc::{Receiver, SyncSender, channel, sync_channel};
use std::thread::JoinHandle;

use super::message::RecordedTopic;
use super::writer::{Channel, WriteError, Writer};

/// Bytes that the thread is handed at a time.
const BATCH: usize = 1 << 18;
/// Batches that may wait: memory does not grow with the length of the recording.
const WAITING: usize = 4;

/// A message whose bytes lie in its batch.
struct Entry {
    channel: Channel,
    log_time_ns: u64,
    publish_time_ns: u64,
    length: usize,
}

/// Messages in the order in which they are written.
#[derive(Default)]
struct Batch {
    entries: Vec<Entry>,
    bytes: Vec<u8>,
}

enum Order {
    Channel(Box<RecordedTopic>, SyncSender<Channel>),
    Messages(Batch),
}

/// A [`Writer`] in a thread of its own: the same calls give the same bytes. An error comes with a later call.
pub struct WriteBehind {
    /// `None` after a failure.
    orders: Option<SyncSender<Order>>,
    thread: Option<JoinHandle<Result<(), WriteError>>>,
    batch: Batch,
    /// Batches that were written, to be filled again.
    spare: Receiver<Batch>,
    /// What is said when the thread itself fails.
    gone: WriteError,
}

impl WriteBehind {
    /// Begins to write.
    ///
    /// # Errors
    /// [`WriteError`] when the system has no thread left.
    pub fn start(writer: Writer) -> Result<Self, WriteError> {
        let gone = writer.error("the writing thread failed");
        let refused = writer.error("the system has no thread left");
        let (orders, received) = sync_channel(WAITING);
        let (give_back, spare) = channel();
        let thread = std::thread::Builder::new()
            .name("writing".to_owned())
            .spawn(move || {
                let mut writer = writer;
                for order in received {
                    match order {
                        Order::Channel(topic, answer) => {
                            // Whoever asked waits for it.
                            let _ = answer.send(writer.channel(&topic)?);
                        }
                        Order::Messages(mut batch) => {
                            write(&mut writer, &batch)?;
                            batch.entries.clear();
                            batch.bytes.clear();
                            let _ = give_back.send(batch);
                        }
                    }
                }
                writer.finish()
            })
            .map_err(|_| refused)?;
        Ok(Self {
            orders: Some(orders),
            thread: Some(thread),
            batch: Batch::default(),
            spare,
            gone,
        })
    }

    /// As [`Writer::channel`].
    ///
    /// # Errors
    /// [`WriteError`] when the system refuses this or what was written before.
    pub fn channel(&mut self, topic: &RecordedTopic) -> Result<Channel, WriteError> {
        let (sender, answer) = sync_channel(1);
        self.hand_over()?;
        self.send(Order::Channel(Box::new(topic.clone()), sender))?;
        answer.recv().map_err(|_| self.failure())
    }

    /// As [`Writer::write`].
    ///
    /// # Errors
    /// [`WriteError`] when the system refuses what was written before.
    pub fn write(
        &mut self,
        channel: Channel,
        log_time_ns: u64,
        publish_time_ns: u64,
        bytes: &[u8],
    ) -> Result<(), WriteError> {
        self.batch.entries.push(Entry {
            channel,
            log_time_ns,
            publish_time_ns,
            length: bytes.len(),
        });
        self.batch.bytes.extend_from_slice(bytes);
        if self.batch.bytes.len() < BATCH {
            return Ok(());
        }
        self.hand_over()
    }

    /// Completes the file.
    ///
    /// # Errors
    /// [`WriteError`] when the system refuses this or what was written before.
    pub fn finish(mut self) -> Result<(), WriteError> {
        self.hand_over()?;
        self.orders = None;
        self.result()
    }

    fn hand_over(&mut self) -> Result<(), WriteError> {
        if self.batch.entries.is_empty() {
            return Ok(());
        }
        let next = self.spare.try_recv().unwrap_or_default();
        let full = std::mem::replace(&mut self.batch, next);
        self.send(Order::Messages(full))
    }

    fn send(&mut self, order: Order) -> Result<(), WriteError> {
        let sent = self.orders.as_ref().map(|orders| orders.send(order));
        match sent {
            Some(Ok(())) => Ok(()),
            Some(Err(_)) | None => Err(self.failure()),
        }
    }

    /// Returns why the thread has ended.
    fn failure(&mut self) -> WriteError {
        self.orders = None;
        self.result().err().unwrap_or_else(|| self.gone.clone())
    }

    fn result(&mut self) -> Result<(), WriteError> {
        let ended = self.thread.take().map(JoinHandle::join);
        match ended {
            Some(Ok(result)) => result,
            Some(Err(_)) | None => Err(self.gone.clone()),
        }
    }
}

fn write(writer: &mut Writer, batch: &Batch) -> Result<(), WriteError> {
    let mut rest = batch.bytes.as_slice();
    for entry in &batch.entries {
        let (bytes, after) = rest.split_at(entry.length);
        rest = after;
        writer.write(
            entry.channel,
            entry.log_time_ns,
            entry.publish_time_ns,
            bytes,
        )?;
    }
    Ok(())
}
