//! The content of one block: unpacked, its checksum compared, its messages by log time.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::ops::Range;

use mcap::records::{ChunkHeader, Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};

use super::layout::{self, Kind};
use super::records::{MESSAGE_HEADER, fits, records};

/// Longest chunk that is read, packed or not: recorders write some MiB, and a damaged length must not fill the memory.
const LONGEST_CHUNK: usize = 1 << 28;

/// One message in a block.
#[derive(Debug, Clone)]
pub(super) struct Entry {
    pub(super) channel: u16,
    pub(super) log_time_ns: u64,
    pub(super) publish_time_ns: u64,
    range: Range<usize>,
}

/// A block that is read.
#[derive(Debug, Default)]
pub(super) struct Block {
    bytes: Vec<u8>,
    entries: Vec<Entry>,
    descriptions: Vec<(u8, Range<usize>)>,
    next: usize,
}

impl Block {
    /// Returns the records that describe schemas and channels.
    pub(super) fn descriptions(&self) -> impl Iterator<Item = (u8, &[u8])> {
        let record = |(opcode, range): &(u8, Range<usize>)| (*opcode, &self.bytes[range.clone()]);
        self.descriptions.iter().map(record)
    }

    /// Leaves out messages of channels that are not known; returns how many of which.
    pub(super) fn keep(&mut self, mut is_known: impl FnMut(u16) -> bool) -> Vec<(u16, u64)> {
        let mut unknown: Vec<(u16, u64)> = Vec::new();
        self.entries.retain(|entry| {
            let known = is_known(entry.channel);
            if !known {
                match unknown.iter_mut().find(|(c, _)| *c == entry.channel) {
                    Some((_, count)) => *count += 1,
                    None => unknown.push((entry.channel, 1)),
                }
            }
            known
        });
        unknown
    }

    /// Returns how many bytes it takes; the same until it is cleared.
    pub(super) const fn size(&self) -> usize {
        self.bytes.len() + self.entries.len() * size_of::<Entry>()
    }

    /// Returns the log time of the next message.
    pub(super) fn next_time(&self) -> Option<u64> {
        self.entries.get(self.next).map(|entry| entry.log_time_ns)
    }

    /// Returns the next message.
    pub(super) fn take_next(&mut self) -> Option<Entry> {
        let entry = self.entries.get(self.next)?.clone();
        self.next += 1;
        Some(entry)
    }

    /// Returns the bytes of a message of this block.
    pub(super) fn bytes_of(&self, entry: &Entry) -> &[u8] {
        &self.bytes[entry.range.clone()]
    }

    fn clear(&mut self) {
        self.bytes.clear();
        self.entries.clear();
        self.descriptions.clear();
        self.next = 0;
    }

    /// Takes one record.
    fn take(&mut self, opcode: u8, body: &[u8]) -> Result<(), String> {
        let start = self.bytes.len();
        match opcode {
            op::SCHEMA | op::CHANNEL => {
                self.bytes.extend_from_slice(body);
                self.descriptions.push((opcode, start..self.bytes.len()));
            }
            op::MESSAGE => {
                let message = mcap::parse_record(opcode, body).map_err(|error| in_words(&error))?;
                let Record::Message { header, data } = message else {
                    return Ok(());
                };
                self.bytes.extend_from_slice(&data);
                self.entries.push(Entry {
                    channel: header.channel_id,
                    log_time_ns: header.log_time,
                    publish_time_ns: header.publish_time,
                    range: start..self.bytes.len(),
                });
            }
            _ => {}
        }
        Ok(())
    }
}

/// Reads blocks; keeps its buffers for the next one.
#[derive(Default)]
pub(super) struct Reader {
    packed: Vec<u8>,
    spare: Option<Block>,
}

impl Reader {
    /// Takes back a block that is no longer needed.
    pub(super) fn reuse(&mut self, block: Block) {
        self.spare = Some(block);
    }

    /// Returns the content of a block, or why it cannot be used.
    pub(super) fn read(
        &mut self,
        file: &mut File,
        block: &layout::Block,
    ) -> io::Result<Result<Block, String>> {
        let Some(length) = usize::try_from(block.length)
            .ok()
            .filter(|length| *length <= LONGEST_CHUNK)
        else {
            return Ok(Err(format!(
                "it has {} bytes, read are at most {LONGEST_CHUNK}",
                block.length
            )));
        };
        file.seek(SeekFrom::Start(block.start))?;
        self.packed.resize(length, 0);
        file.read_exact(&mut self.packed)?;
        let mut found = self.spare.take().unwrap_or_default();
        found.clear();
        let unpacked = match block.kind {
            Kind::Run => run(&self.packed, &mut found),
            Kind::Chunk => chunk(&self.packed, &mut found),
            Kind::CutChunk => {
                cut_chunk(&self.packed, &mut found);
                Ok(())
            }
        };
        Ok(unpacked.map(|()| {
            // Stable: messages of the same time stay in the order in which they were written.
            found.entries.sort_by_key(|entry| entry.log_time_ns);
            found
        }))
    }
}

fn run(bytes: &[u8], into: &mut Block) -> Result<(), String> {
    for record in records(bytes) {
        let (opcode, body) = record?;
        if (body.len() as u64) < MESSAGE_HEADER && opcode == op::MESSAGE {
            continue;
        }
        into.take(opcode, body)?;
    }
    Ok(())
}

/// Reads a chunk after its checksum, if it has one, was found right.
fn chunk(record: &[u8], into: &mut Block) -> Result<(), String> {
    let body = record.get(9..).unwrap_or_default();
    if !fits(op::CHUNK, body) {
        return Err("its header is damaged".to_owned());
    }
    let Ok(Record::Chunk { header, data }) = mcap::parse_record(op::CHUNK, body) else {
        return Err("its header is damaged".to_owned());
    };
    if header.compression.is_empty() {
        return uncompressed(&header, &data, into);
    }
    unpack(record, into, options().with_prevalidate_chunk_crcs(true)).map_err(|e| in_words(&e))?
}

fn uncompressed(header: &ChunkHeader, data: &[u8], into: &mut Block) -> Result<(), String> {
    let calculated = crc32fast::hash(data);
    if header.uncompressed_crc != 0 && header.uncompressed_crc != calculated {
        return Err(in_words(&mcap::McapError::BadChunkCrc {
            saved: header.uncompressed_crc,
            calculated,
        }));
    }
    for record in records(data) {
        let (opcode, body) = record?;
        into.take(opcode, body)?;
    }
    Ok(())
}

/// Reads what is there of a chunk whose end, and with it the checksum's other half, is missing.
fn cut_chunk(record: &[u8], into: &mut Block) {
    let is_compressed = record.get(37..41).is_some_and(|length| length != [0; 4]);
    if is_compressed {
        if fits(op::CHUNK, record.get(9..).unwrap_or_default()) {
            let _ = unpack(record, into, options());
        }
        return;
    }
    // Times, length and checksum 28, no compression 4, length 8.
    for (opcode, body) in records(record.get(9 + 40..).unwrap_or_default()).flatten() {
        let _ = into.take(opcode, body);
    }
}

fn options() -> LinearReaderOptions {
    LinearReaderOptions::default()
        .with_skip_start_magic(true)
        .with_skip_end_magic(true)
        .with_record_length_limit(LONGEST_CHUNK)
}

/// Takes the records of a compressed chunk, up to the first that cannot be read.
fn unpack(
    record: &[u8],
    into: &mut Block,
    options: LinearReaderOptions,
) -> mcap::McapResult<Result<(), String>> {
    let mut reader = LinearReader::new_with_options(options);
    reader.insert(record.len()).copy_from_slice(record);
    reader.notify_read(record.len());
    while let Some(event) = reader.next_event() {
        match event? {
            LinearReadEvent::Record { opcode, data } => {
                if let Err(reason) = into.take(opcode, data) {
                    return Ok(Err(reason));
                }
            }
            LinearReadEvent::ReadRequest(_) => {
                // After its last record the reader asks for the next one, and ends without.
                reader.insert(0);
                reader.notify_read(0);
            }
        }
    }
    Ok(Ok(()))
}

/// Returns what the library says, and what it says of the cause.
fn in_words(error: &mcap::McapError) -> String {
    match std::error::Error::source(error) {
        Some(cause) => format!("{error}: {cause}"),
        None => error.to_string(),
    }
}
