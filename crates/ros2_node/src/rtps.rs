//! The few RTPS messages that this package writes itself, where `RustDDS` cannot: bytes only, no sockets.
//!
//! # Source
//! OMG DDSI-RTPS 2.5, 8.3 and 9.4; DDS-RPC 1.0, 7.8.2 for the identity of the request.

/// A GUID's bytes: the participant's prefix, then the entity.
pub type GuidBytes = [u8; 16];

const INFO_TIMESTAMP: u8 = 0x09;
const INFO_DESTINATION: u8 = 0x0e;
const DATA: u8 = 0x15;

const LITTLE_ENDIAN: u8 = 0x01;
const INLINE_QOS: u8 = 0x02;
const PAYLOAD: u8 = 0x04;

/// What a DATA submessage tells beside its payload, as parameter ids and values.
pub const STATUS_INFO: u16 = 0x0071;
/// Hash of the key of what is disposed of.
pub const KEY_HASH: u16 = 0x0070;
/// Identity of the request that a reply answers.
pub const RELATED_SAMPLE_IDENTITY: u16 = 0x0083;
/// The same under the number that Fast DDS had for it before.
pub const RELATED_SAMPLE_IDENTITY_OF_OLD: u16 = 0x800f;
const SENTINEL: [u8; 4] = [1, 0, 0, 0];

/// One sample to one reader.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Data<'a> {
    /// The entity that reads it.
    pub reader: [u8; 4],
    /// The entity that wrote it.
    pub writer: [u8; 4],
    /// Its place among the writer's samples.
    pub sequence_number: i64,
    /// Parameter ids and values; lengths are multiples of four.
    pub inline_qos: &'a [(u16, &'a [u8])],
    /// Serialized, with its encapsulation header; `None` for a dispose.
    pub payload: Option<&'a [u8]>,
}

/// One RTPS message, growing by submessages.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Packet(Vec<u8>);

impl Packet {
    /// Returns an empty message from the participant of this GUID.
    #[must_use]
    pub fn from_participant(guid: &GuidBytes) -> Self {
        let mut bytes = b"RTPS".to_vec();
        bytes.extend([2, 4, 1, 0x12]); // protocol 2.4, RustDDS's vendor id
        bytes.extend(&guid[..12]);
        Self(bytes)
    }

    /// Returns the message with what follows meant for the participant of this GUID.
    #[must_use]
    pub fn to_participant(self, guid: &GuidBytes) -> Self {
        self.submessage(INFO_DESTINATION, LITTLE_ENDIAN, &guid[..12])
    }

    /// Returns the message with what follows written at this time.
    #[must_use]
    pub fn written_at(self, sec: u32, nanosec: u32) -> Self {
        // Fractions are of 2^-32 s; below one second the quotient fits.
        let fraction = (u64::from(nanosec) << 32) / 1_000_000_000;
        let mut time = sec.to_le_bytes().to_vec();
        time.extend(u32::try_from(fraction).unwrap_or(u32::MAX).to_le_bytes());
        self.submessage(INFO_TIMESTAMP, LITTLE_ENDIAN, &time)
    }

    /// Returns the message with a sample more.
    #[must_use]
    pub fn data(self, data: &Data) -> Self {
        let mut body = vec![0, 0, 16, 0]; // extra flags; octets to inline QoS
        body.extend(data.reader);
        body.extend(data.writer);
        body.extend(sequence_number(data.sequence_number));
        for (id, value) in data.inline_qos {
            body.extend(id.to_le_bytes());
            body.extend(length(value).to_le_bytes());
            body.extend(*value);
        }
        let mut flags = LITTLE_ENDIAN;
        if !data.inline_qos.is_empty() {
            body.extend(SENTINEL);
            flags |= INLINE_QOS;
        }
        if let Some(payload) = data.payload {
            body.extend(payload);
            flags |= PAYLOAD;
        }
        self.submessage(DATA, flags, &body)
    }

    /// Returns the bytes to send.
    #[must_use]
    pub fn into_bytes(self) -> Vec<u8> {
        self.0
    }

    fn submessage(mut self, kind: u8, flags: u8, body: &[u8]) -> Self {
        self.0.extend([kind, flags]);
        self.0.extend(length(body).to_le_bytes());
        self.0.extend(body);
        self
    }
}

/// Returns a sequence number as the wire has it: the high half first, each half little endian.
#[must_use]
pub fn sequence_number(number: i64) -> [u8; 8] {
    let [low @ .., e, f, g, h] = number.to_le_bytes();
    let mut bytes = [e, f, g, h, 0, 0, 0, 0];
    bytes[4..].copy_from_slice(&low);
    bytes
}

/// The caller keeps a message below what UDP carries.
fn length(bytes: &[u8]) -> u16 {
    u16::try_from(bytes.len()).unwrap_or(u16::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_of_a_sequence_number_are_exchanged() {
        assert_eq!(
            sequence_number(0x0102_0304_0506_0708),
            [4, 3, 2, 1, 8, 7, 6, 5]
        );
        assert_eq!(sequence_number(7), [0, 0, 0, 0, 7, 0, 0, 0]);
    }

    #[test]
    fn every_submessage_ends_where_its_length_says() {
        let payload = [0, 1, 0, 0, 42];
        let packet = Packet::from_participant(&[9; 16])
            .to_participant(&[8; 16])
            .written_at(1, 500_000_000)
            .data(&Data {
                reader: [1; 4],
                writer: [2; 4],
                sequence_number: 3,
                inline_qos: &[(RELATED_SAMPLE_IDENTITY, &[5; 24])],
                payload: Some(&payload),
            })
            .into_bytes();

        let mut kinds = Vec::new();
        let mut rest = &packet[20..];
        while let [kind, flags, low, high, body @ ..] = rest {
            kinds.push((*kind, *flags));
            rest = &body[usize::from(u16::from_le_bytes([*low, *high]))..];
        }
        assert_eq!(kinds, [(0x0e, 1), (0x09, 1), (0x15, 7)]);
        assert!(rest.is_empty());
        assert!(packet.ends_with(&payload));
        let half_a_second = 0x8000_0000_u32.to_le_bytes();
        assert!(packet.windows(4).any(|window| window == half_a_second));
    }
}
