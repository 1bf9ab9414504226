//! CDR: the bytes of a message, as DDS sends and bags keep them.
//!
//! Four bytes say how the others are encoded: plain CDR (XCDR1), with the low or the high byte first. Lengths are checked
//! against the bytes that are there before anything is allocated for them.

use byteorder::{BigEndian, LittleEndian};
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Plain CDR, the high byte first.
const BIG_ENDIAN: [u8; 2] = [0, 0];
/// Plain CDR, the low byte first.
const LITTLE_ENDIAN: [u8; 2] = [0, 1];
/// The encoding in two bytes, and two of options.
const HEADER: usize = 4;

/// Why bytes are no message.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CdrError {
    /// Too few bytes to say how they are encoded.
    #[error("expected a CDR header of {HEADER} bytes, got {got} bytes")]
    NoHeader {
        /// How many there are.
        got: usize,
    },
    /// Parameter lists, XCDR2 and others, which no ROS 2 distribution uses for topics.
    #[error("expected plain CDR (0x0000 or 0x0001), got encoding 0x{:02x}{:02x}", .0[0], .0[1])]
    Encoding([u8; 2]),
    /// The bytes do not fit the fields.
    #[error("the bytes do not fit the fields of the type: {0}")]
    Fields(#[from] cdr_encoding::Error),
}

/// Returns the message in these bytes; bytes after its last field are ignored, as DDS does.
///
/// # Errors
/// [`CdrError`] when the header names another encoding, or the bytes do not fit the type's fields.
pub fn decode<M: DeserializeOwned>(bytes: &[u8]) -> Result<M, CdrError> {
    let Some((&[high, low, _, _], body)) = bytes.split_first_chunk::<HEADER>() else {
        return Err(CdrError::NoHeader { got: bytes.len() });
    };
    let (message, _) = match [high, low] {
        LITTLE_ENDIAN => cdr_encoding::from_bytes::<M, LittleEndian>(body)?,
        BIG_ENDIAN => cdr_encoding::from_bytes::<M, BigEndian>(body)?,
        other => return Err(CdrError::Encoding(other)),
    };
    Ok(message)
}

/// Returns the bytes of a message, the low byte first, as ROS writes them.
///
/// # Errors
/// [`CdrError::Fields`] of a type that CDR cannot hold; messages of ROS are not such types.
pub fn encode<M: Serialize>(message: &M) -> Result<Vec<u8>, CdrError> {
    let mut bytes = Vec::with_capacity(512);
    bytes.extend_from_slice(&LITTLE_ENDIAN);
    bytes.extend_from_slice(&[0, 0]);
    cdr_encoding::to_writer::<M, LittleEndian, _>(&mut bytes, message)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::messages::{FeaturePoint, FeaturePointArray, Header, Time};

    fn message() -> FeaturePointArray {
        FeaturePointArray {
            header: Header {
                stamp: Time { sec: 7, nanosec: 8 },
                frame_id: "cam".to_owned(),
            },
            points: vec![
                FeaturePoint {
                    id: 3,
                    u: 1.5,
                    v: -2.5,
                    sigma: 0.5,
                };
                2
            ],
        }
    }

    #[test]
    fn message_survives_its_bytes_and_is_aligned_after_the_header() {
        let bytes = encode(&message()).expect("a message of ROS");
        // Stamp 8, frame 4 + 4, count 4, id 4, three numbers 24, id 4, padding 4, three numbers 24.
        assert_eq!(bytes.len(), HEADER + 80);
        assert_eq!(bytes[..4], [0, 1, 0, 0]);
        let found: FeaturePointArray = decode(&bytes).expect("its own bytes");
        assert_eq!(found, message());
    }

    #[test]
    fn both_orders_of_bytes_are_read() {
        let body = cdr_encoding::to_vec::<_, BigEndian>(&message()).expect("a message of ROS");
        let bytes = [&[0, 0, 0, 0], body.as_slice()].concat();
        let found: FeaturePointArray = decode(&bytes).expect("big endian");
        assert_eq!(found, message());
    }

    #[test]
    fn bytes_that_claim_more_than_there_is_are_refused_without_allocating_it() {
        let mut bytes = encode(&message()).expect("a message of ROS");
        // The count of points.
        bytes[20..24].copy_from_slice(&u32::MAX.to_le_bytes());
        let allocated = allocation_counter::measure(|| {
            assert!(decode::<FeaturePointArray>(&bytes).is_err());
        });
        assert!(allocated.bytes_max < 1 << 21, "{}", allocated.bytes_max);
        // The length of the frame's name.
        bytes[12..16].copy_from_slice(&u32::MAX.to_le_bytes());
        assert!(decode::<FeaturePointArray>(&bytes).is_err());
    }

    #[test]
    fn every_cut_is_an_error_and_none_a_panic() {
        let bytes = encode(&message()).expect("a message of ROS");
        for length in 0..bytes.len() {
            assert!(
                decode::<FeaturePointArray>(&bytes[..length]).is_err(),
                "{length}"
            );
        }
    }

    #[test]
    fn other_encodings_are_refused_by_their_number() {
        let refused = decode::<Header>(&[0, 7, 0, 0, 1, 2, 3, 4]).expect_err("XCDR2");
        assert!(refused.to_string().contains("0x0007"), "{refused}");
    }
}
