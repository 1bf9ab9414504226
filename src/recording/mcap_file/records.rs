//! Records, one after the other.

/// Opcode and length before every record.
pub(super) const RECORD_HEADER: u64 = 9;
/// Channel, sequence and two times before a message's bytes.
pub(super) const MESSAGE_HEADER: u64 = 22;

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
