//! One MCAP file: first its layout without its content, then its blocks as they come due.
//!
//! A block is a chunk, or a run of messages that stand in no chunk. The layout comes from the records themselves, not
//! from the index at the end: a file that was cut off has none.

mod block;
mod layout;
mod records;

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap, VecDeque};
use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use super::damage::Damage;
use super::message::{Definition, RecordedMessage, RecordedTopic};
use block::{Block, Reader};
use layout::Layout;
use records::fits;

/// Most bytes of blocks that are held at a time, which are those that overlap in time.
const MOST_HELD: usize = 1 << 30;

/// Whether a file begins as MCAP files do.
pub(super) fn is_mcap(start: &[u8]) -> bool {
    start.starts_with(mcap::MAGIC)
}

/// The messages of a file by their log times.
pub(super) struct McapFile {
    name: String,
    file: File,
    size: u64,
    /// By their first log time; the next one to be read is at the front.
    blocks: VecDeque<layout::Block>,
    reader: Reader,
    descriptions: Descriptions,
    /// Blocks that are read, and the place of each one's next message.
    loaded: Vec<Option<Block>>,
    /// The next message of each loaded block: log time, place of the block in the file, its place in `loaded`.
    next: BinaryHeap<Reverse<(u64, u64, usize)>>,
    damages: VecDeque<Damage>,
    passed: u64,
    /// Bytes of the blocks in `loaded`.
    held: usize,
}

/// Schemas and channels by their numbers.
#[derive(Default)]
struct Descriptions {
    schemas: HashMap<u16, (String, Definition)>,
    channels: HashMap<u16, mcap::records::Channel>,
    topics: HashMap<u16, Arc<RecordedTopic>>,
}

impl Descriptions {
    /// Takes a record, if it describes something; the first one of a number counts.
    fn take(&mut self, opcode: u8, body: &[u8]) {
        use mcap::records::Record;
        if !fits(opcode, body) {
            return;
        }
        match mcap::parse_record(opcode, body) {
            Ok(Record::Schema { header, data }) => {
                self.schemas.entry(header.id).or_insert_with(|| {
                    let definition = Definition {
                        encoding: header.encoding,
                        text: data.into_owned(),
                    };
                    (header.name, definition)
                });
            }
            Ok(Record::Channel(channel)) => {
                self.channels.entry(channel.id).or_insert(channel);
            }
            _ => {}
        }
    }

    /// Returns the topic of a channel, if it is described.
    fn topic(&mut self, channel: u16) -> Option<Arc<RecordedTopic>> {
        if let Some(topic) = self.topics.get(&channel) {
            return Some(Arc::clone(topic));
        }
        let described = self.channels.get(&channel)?;
        let schema = self.schemas.get(&described.schema_id);
        let offered_qos = described.metadata.get("offered_qos_profiles");
        let topic = Arc::new(RecordedTopic {
            name: described.topic.clone(),
            type_name: schema.map(|(name, _)| name.clone()).unwrap_or_default(),
            encoding: described.message_encoding.clone(),
            definition: schema
                .map(|(_, definition)| definition.clone())
                .filter(|definition| !definition.text.is_empty()),
            offered_qos: offered_qos.cloned().unwrap_or_default(),
        });
        self.topics.insert(channel, Arc::clone(&topic));
        Some(topic)
    }
}

impl McapFile {
    /// Opens a file; `name` is for messages about it.
    pub(super) fn open(path: &Path, name: &str) -> std::io::Result<Self> {
        let mut file = File::open(path)?;
        let size = file.metadata()?.len();
        let mut descriptions = Descriptions::default();
        let layout = Layout::read(&mut file, size, name, &mut |opcode, body| {
            descriptions.take(opcode, body);
        })?;
        let mut found = Self {
            name: name.to_owned(),
            file,
            size,
            blocks: layout.blocks.into(),
            reader: Reader::default(),
            descriptions,
            loaded: Vec::new(),
            next: BinaryHeap::new(),
            damages: layout.damages.into(),
            passed: 0,
            held: 0,
        };
        // A complete file mostly describes them again at its end.
        if !layout.is_complete || found.descriptions.channels.is_empty() {
            found.describe()?;
        }
        let key = |block: &layout::Block| (block.first_ns, block.start);
        found.blocks.make_contiguous().sort_by_key(key);
        Ok(found)
    }

    /// Reads what the chunks say of channels.
    fn describe(&mut self) -> std::io::Result<()> {
        let Self {
            blocks,
            reader,
            file,
            descriptions,
            ..
        } = self;
        for block in blocks.iter().filter(|block| block.is_chunk()) {
            // What is wrong with it is told when its turn comes.
            if let Ok(found) = reader.read(file, block)? {
                for (opcode, body) in found.descriptions() {
                    descriptions.take(opcode, body);
                }
            }
        }
        Ok(())
    }

    /// Returns the topics.
    pub(super) fn topics(&mut self) -> Vec<Arc<RecordedTopic>> {
        let mut channels: Vec<u16> = self.descriptions.channels.keys().copied().collect();
        channels.sort_unstable();
        channels
            .into_iter()
            .filter_map(|channel| self.descriptions.topic(channel))
            .collect()
    }

    pub(super) const fn size(&self) -> u64 {
        self.size
    }

    /// Returns how many bytes of the file have been read.
    pub(super) const fn passed(&self) -> u64 {
        self.passed
    }

    /// Returns a time that no further message is before; `None` at the end.
    pub(super) fn bound(&self) -> Option<u64> {
        if !self.damages.is_empty() {
            return Some(0);
        }
        let loaded = self.next.peek().map(|Reverse((time, _, _))| *time);
        let unread = self.blocks.front().map(|block| block.first_ns);
        match (loaded, unread) {
            (Some(loaded), Some(unread)) => Some(loaded.min(unread)),
            (loaded, unread) => loaded.or(unread),
        }
    }

    /// Returns the next message or damage; `None` when a block was read instead, or at the end.
    pub(super) fn step(&mut self) -> Option<Result<RecordedMessage, Damage>> {
        if let Some(damage) = self.damages.pop_front() {
            return Some(Err(damage));
        }
        let due = self.next.peek().map(|Reverse((time, _, _))| *time);
        let unread = self.blocks.front().map(|block| block.first_ns);
        if let Some(first_ns) = unread
            && due.is_none_or(|due| first_ns <= due)
        {
            self.load();
            return None;
        }
        self.message().map(Ok)
    }

    /// Reads the next block.
    fn load(&mut self) {
        let Some(block) = self.blocks.pop_front() else {
            return;
        };
        self.passed += block.length;
        let read = self.reader.read(&mut self.file, &block);
        let read = read.unwrap_or_else(|error| Err(error.to_string()));
        let mut found = match read {
            Ok(found) => found,
            Err(reason) => {
                self.damages.push_back(self.damage(&block, reason));
                return;
            }
        };
        for (opcode, body) in found.descriptions() {
            self.descriptions.take(opcode, body);
        }
        for (channel, count) in found.keep(|channel| self.descriptions.topic(channel).is_some()) {
            self.damages.push_back(Damage::UnknownChannel {
                file: self.name.clone(),
                channel,
                count,
            });
        }
        let Some(first_ns) = found.next_time() else {
            return;
        };
        if first_ns < block.first_ns {
            self.damages.push_back(Damage::Late {
                file: self.name.clone(),
                at: block.start,
                early_s: (block.first_ns - first_ns) as f64 * 1e-9,
            });
        }
        let size = found.size();
        if size > MOST_HELD - self.held {
            let reason = format!(
                "the chunks that overlap in time would need more than {MOST_HELD} bytes together"
            );
            self.damages.push_back(self.damage(&block, reason));
            return;
        }
        self.held += size;
        let slot = self.loaded.iter().position(Option::is_none);
        let slot = slot.unwrap_or_else(|| {
            self.loaded.push(None);
            self.loaded.len() - 1
        });
        self.loaded[slot] = Some(found);
        self.next.push(Reverse((first_ns, block.start, slot)));
    }

    fn message(&mut self) -> Option<RecordedMessage> {
        let Reverse((_, start, slot)) = self.next.pop()?;
        let block = self.loaded.get_mut(slot)?.as_mut()?;
        let found = block.take_next()?;
        let message = RecordedMessage {
            topic: self.descriptions.topic(found.channel)?,
            log_time_ns: found.log_time_ns,
            publish_time_ns: found.publish_time_ns,
            bytes: block.bytes_of(&found).to_vec(),
        };
        if let Some(time) = block.next_time() {
            self.next.push(Reverse((time, start, slot)));
        } else if let Some(read) = self.loaded[slot].take() {
            self.held -= read.size();
            self.reader.reuse(read);
        }
        Some(message)
    }

    fn damage(&self, block: &layout::Block, reason: String) -> Damage {
        Damage::Chunk {
            file: self.name.clone(),
            at: block.start,
            from_s: block.first_ns as f64 * 1e-9,
            to_s: block.last_ns as f64 * 1e-9,
            messages: block.messages,
            reason,
        }
    }
}
