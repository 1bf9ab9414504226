//! Records, one after the other.

use mcap::records::op;

/// Opcode and length before every record.
pub(super) const RECORD_HEADER: u64 = 9;
/// Channel, sequence and two times before a message's bytes.
pub(super) const MESSAGE_HEADER: u64 = 22;

/// Returns whether the texts of a record end within it. The library allocates the length that a text states before it
/// looks for its bytes: a record of some bytes could ask for 4 GiB.
pub(super) fn fits(opcode: u8, body: &[u8]) -> bool {
    fn skip(bytes: &[u8], count: usize) -> Option<&[u8]> {
        bytes.get(count..)
    }
    fn text(bytes: &[u8]) -> Option<&[u8]> {
        let (length, after) = bytes.split_first_chunk::<4>()?;
        skip(after, usize::try_from(u32::from_le_bytes(*length)).ok()?)
    }
    let ends_within = || match opcode {
        op::SCHEMA => text(text(skip(body, 2)?)?),
        op::CHANNEL => {
            let (length, mut pairs) = text(text(skip(body, 4)?)?)?.split_first_chunk::<4>()?;
            let length = usize::try_from(u32::from_le_bytes(*length)).ok()?;
            pairs = pairs.get(..length)?;
            while !pairs.is_empty() {
                pairs = text(pairs)?;
            }
            Some(pairs)
        }
        op::CHUNK => text(skip(body, 28)?),
        // Times and place of the chunk, places of its indices, their length, compression.
        op::CHUNK_INDEX => text(skip(text(skip(body, 32)?)?, 8)?),
        _ => Some(body),
    };
    ends_within().is_some()
}

/// Returns the records in these bytes; an error where one does not fit, and nothing after it.
pub(super) fn records(bytes: &[u8]) -> impl Iterator<Item = Result<(u8, &[u8]), String>> {
    let mut rest = bytes;
    std::iter::from_fn(move || {
        if rest.is_empty() {
            return None;
        }
        let record = rest.split_first_chunk::<9>().and_then(|(header, after)| {
            let [opcode, length @ ..] = *header;
            let length = usize::try_from(u64::from_le_bytes(length)).ok()?;
            let (body, after) = after.split_at_checked(length)?;
            Some((opcode, body, after))
        });
        let Some((opcode, body, after)) = record else {
            rest = &[];
            return Some(Err("it ends in the middle of a record".to_owned()));
        };
        rest = after;
        Some(Ok((opcode, body)))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_that_end_outside_of_their_record_are_refused_before_they_are_allocated() {
        let text = |length: u32| [&length.to_le_bytes()[..], b"abcd"].concat();
        let huge = u32::from_le_bytes(*b"game");
        let schema = |second: u32| [&[0_u8; 2][..], &text(4), &text(second)].concat();
        let pair = |second: u32| [text(4), text(second)].concat();
        let channel = |second: u32| {
            [
                &[0_u8; 4][..],
                &text(4),
                &text(4),
                &16_u32.to_le_bytes(),
                &pair(second),
            ]
            .concat()
        };
        let chunk = |length: u32| [&[0_u8; 28][..], &text(length)].concat();
        let index = |length: u32| [&[0_u8; 32][..], &text(4), &[0; 8], &text(length)].concat();
        for (opcode, good, bad) in [
            (op::SCHEMA, schema(4), schema(huge)),
            (op::CHANNEL, channel(4), channel(huge)),
            (op::CHUNK, chunk(4), chunk(huge)),
            (op::CHUNK_INDEX, index(4), index(huge)),
        ] {
            assert!(fits(opcode, &good), "{opcode}");
            for bytes in [&bad[..], &good[..3], &[]] {
                assert!(!fits(opcode, bytes), "{opcode} {bytes:?}");
            }
        }
    }
}
