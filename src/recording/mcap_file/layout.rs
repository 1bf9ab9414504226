//! Where the blocks of a file are, by the lengths of its records.

use std::io::{self, BufReader, Read, Seek, SeekFrom};

use mcap::records::{Record, op};

use super::super::damage::Damage;
use super::records::{MESSAGE_HEADER, RECORD_HEADER, fits, records};

/// Longest record other than chunk, message and attachment that is read: definitions are text.
const LONGEST_DESCRIPTION: u64 = 1 << 24;
/// Messages in no chunk are read in runs of about this length.
const RUN: u64 = 1 << 20;

/// Messages that are read at once.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Block {
    /// Place of its first record's header.
    pub(super) start: u64,
    /// With the headers of its records.
    pub(super) length: u64,
    /// Log time of its first message.
    pub(super) first_ns: u64,
    /// Log time of its last message.
    pub(super) last_ns: u64,
    /// Messages, as far as the file says it.
    pub(super) messages: Option<u64>,
    pub(super) kind: Kind,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// A chunk record.
    Chunk,
    /// A chunk record that the file does not hold completely.
    CutChunk,
    /// Message records beside each other.
    Run,
}

impl Block {
    pub(super) const fn is_chunk(&self) -> bool {
        matches!(self.kind, Kind::Chunk | Kind::CutChunk)
    }
}

/// The blocks of a file, and what is wrong with it.
#[derive(Debug, Default)]
pub(super) struct Layout {
    pub(super) blocks: Vec<Block>,
    pub(super) damages: Vec<Damage>,
    /// Whether the records lead to the end of the file.
    pub(super) is_complete: bool,
}

/// A record's place.
struct Place {
    opcode: u8,
    /// Of its header.
    start: u64,
    /// Of its body.
    length: u64,
}

/// A file that is walked through record by record.
struct Walk<'a> {
    file: BufReader<&'a mut std::fs::File>,
    at: u64,
    size: u64,
    name: &'a str,
    layout: Layout,
}

impl Layout {
    /// Reads the layout of a file of `size` bytes; `describe` takes schemas and channels outside of chunks.
    pub(super) fn read(
        file: &mut std::fs::File,
        size: u64,
        name: &str,
        describe: &mut dyn FnMut(u8, &[u8]),
    ) -> io::Result<Self> {
        let mut walk = Walk {
            file: BufReader::with_capacity(1 << 12, file),
            at: 0,
            size,
            name,
            layout: Self::default(),
        };
        walk.go_to(mcap::MAGIC.len() as u64)?;
        walk.records(describe)?;
        Ok(walk.layout)
    }

    fn add_message(&mut self, record: &Place, log_time_ns: u64) {
        let end = record.start + RECORD_HEADER + record.length;
        if let Some(run) = self.blocks.last_mut()
            && run.kind == Kind::Run
            && run.start + run.length == record.start
            && run.length < RUN
        {
            run.length = end - run.start;
            run.first_ns = run.first_ns.min(log_time_ns);
            run.last_ns = run.last_ns.max(log_time_ns);
            run.messages = run.messages.map(|count| count + 1);
            return;
        }
        self.blocks.push(Block {
            start: record.start,
            length: end - record.start,
            first_ns: log_time_ns,
            last_ns: log_time_ns,
            messages: Some(1),
            kind: Kind::Run,
        });
    }
}

impl Walk<'_> {
    fn go_to(&mut self, to: u64) -> io::Result<()> {
        let by = i64::try_from(to).unwrap_or(i64::MAX) - i64::try_from(self.at).unwrap_or(0);
        self.file.seek_relative(by)?;
        self.at = to;
        Ok(())
    }

    fn bytes<const N: usize>(&mut self) -> io::Result<[u8; N]> {
        let mut bytes = [0; N];
        self.file.read_exact(&mut bytes)?;
        self.at += N as u64;
        Ok(bytes)
    }

    fn cut(&mut self, within: &'static str) {
        self.layout.damages.push(Damage::Cut {
            file: self.name.to_owned(),
            at: self.size,
            within,
        });
    }

    /// Walks through the file as far as there are records.
    fn records(&mut self, describe: &mut dyn FnMut(u8, &[u8])) -> io::Result<()> {
        loop {
            let start = self.at;
            if start + RECORD_HEADER > self.size {
                let within = match self.size - start.min(self.size) {
                    0 => "between two records",
                    _ => "in the middle of a record",
                };
                self.cut(within);
                return Ok(());
            }
            let [opcode, length @ ..] = self.bytes::<9>()?;
            let record = Place {
                opcode,
                start,
                length: u64::from_le_bytes(length),
            };
            let is_known = matches!(opcode, op::HEADER..=op::DATA_END | 0x80..);
            let end = start
                .checked_add(RECORD_HEADER)
                .and_then(|body| body.checked_add(record.length));
            let Some(end) = end.filter(|_| is_known) else {
                return self.lost(start, &format!("record type 0x{opcode:02x}"));
            };
            if end > self.size {
                return self.beyond(&record);
            }
            if opcode == op::FOOTER {
                self.layout.is_complete = true;
                return Ok(());
            }
            self.record(&record, describe)?;
            self.go_to(end)?;
        }
    }

    fn record(&mut self, record: &Place, describe: &mut dyn FnMut(u8, &[u8])) -> io::Result<()> {
        match record.opcode {
            op::SCHEMA | op::CHANNEL if record.length <= LONGEST_DESCRIPTION => {
                let mut body = vec![0; usize::try_from(record.length).unwrap_or(0)];
                self.file.read_exact(&mut body)?;
                self.at += record.length;
                describe(record.opcode, &body);
            }
            op::MESSAGE if record.length >= MESSAGE_HEADER => {
                let [_, _, _, _, _, _, log_time_ns @ ..] = self.bytes::<14>()?;
                self.layout
                    .add_message(record, u64::from_le_bytes(log_time_ns));
            }
            op::CHUNK if record.length >= 16 => {
                let block = self.chunk(record, Kind::Chunk)?;
                self.layout.blocks.push(block);
            }
            // Channel, then the length of the entries, which have 16 bytes each.
            op::MESSAGE_INDEX if record.length >= 6 => {
                if let Some(chunk) = self.layout.blocks.last_mut().filter(|b| b.is_chunk()) {
                    *chunk.messages.get_or_insert(0) += (record.length - 6) / 16;
                }
            }
            _ => {}
        }
        Ok(())
    }

    /// Reads the times of a chunk.
    fn chunk(&mut self, record: &Place, kind: Kind) -> io::Result<Block> {
        let first_ns = u64::from_le_bytes(self.bytes()?);
        let last_ns = u64::from_le_bytes(self.bytes()?);
        Ok(Block {
            start: record.start,
            length: RECORD_HEADER + record.length,
            first_ns,
            last_ns,
            messages: None,
            kind,
        })
    }

    /// A record that goes on after the end of the file: the file was cut off, or its length is damaged.
    fn beyond(&mut self, record: &Place) -> io::Result<()> {
        if self.has_footer()? {
            let reason = format!("a record of {} bytes", record.length);
            return self.lost(record.start, &reason);
        }
        let has_times = record.start + RECORD_HEADER + 16 <= self.size;
        if record.opcode == op::CHUNK && has_times {
            self.go_to(record.start + RECORD_HEADER)?;
            let mut block = self.chunk(record, Kind::CutChunk)?;
            block.length = self.size - record.start;
            self.layout.blocks.push(block);
            self.cut("in the middle of a chunk");
        } else {
            self.cut("in the middle of a record");
        }
        Ok(())
    }

    /// Whether the file ends as a complete one does.
    fn has_footer(&mut self) -> io::Result<bool> {
        let magic = mcap::MAGIC.len() as u64;
        if self.size < 2 * magic {
            return Ok(false);
        }
        self.go_to(self.size - magic)?;
        Ok(self.bytes::<8>()? == *mcap::MAGIC)
    }

    /// Bytes that are no records: the index at the end, if there is one, says where the next chunks are.
    fn lost(&mut self, at: u64, reason: &str) -> io::Result<()> {
        let before = self.layout.blocks.len();
        let indexed = if self.has_footer()? {
            self.indexed()?
        } else {
            Vec::new()
        };
        let is_further = |block: &Block| block.start >= at;
        self.layout
            .blocks
            .extend(indexed.into_iter().filter(is_further));
        let found = match self.layout.blocks.len() - before {
            0 => "nothing behind them is read".to_owned(),
            count => format!("the index at the end leads to {count} chunk(s) behind them"),
        };
        self.layout.damages.push(Damage::NoRecords {
            file: self.name.to_owned(),
            at,
            reason: reason.to_owned(),
            found,
        });
        Ok(())
    }

    /// Returns the chunks that the index at the file's end lists; none where that is damaged too.
    fn indexed(&mut self) -> io::Result<Vec<Block>> {
        // Footer: two places and a checksum.
        const FOOTER: u64 = RECORD_HEADER + 20;
        let mut blocks = Vec::new();
        let magic = mcap::MAGIC.len() as u64;
        let Some(footer) = self.size.checked_sub(FOOTER + magic) else {
            return Ok(blocks);
        };
        self.go_to(footer + RECORD_HEADER)?;
        let summary = u64::from_le_bytes(self.bytes()?);
        let length = footer.saturating_sub(summary);
        if summary == 0 || length == 0 || length > LONGEST_DESCRIPTION {
            return Ok(blocks);
        }
        self.file.seek(SeekFrom::Start(summary))?;
        let mut bytes = vec![0; usize::try_from(length).unwrap_or(0)];
        self.file.read_exact(&mut bytes)?;
        self.at = footer;
        for (opcode, body) in records(&bytes).flatten() {
            if !fits(opcode, body) {
                continue;
            }
            let Ok(Record::ChunkIndex(index)) = mcap::parse_record(opcode, body) else {
                continue;
            };
            let end = index.chunk_start_offset.checked_add(index.chunk_length);
            if end.is_some_and(|end| end <= self.size) && index.chunk_length > RECORD_HEADER {
                blocks.push(Block {
                    start: index.chunk_start_offset,
                    length: index.chunk_length,
                    first_ns: index.message_start_time,
                    last_ns: index.message_end_time,
                    messages: None,
                    kind: Kind::Chunk,
                });
            }
        }
        Ok(blocks)
    }
}
