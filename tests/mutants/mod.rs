//! Mutants of real inputs: what transmission, editors and wrong programs do to bytes, and what an attacker would.

use std::ops::Range;

use rand::RngExt as _;
use rand_chacha::ChaCha8Rng;

/// Numbers at the ends of ranges and types, and some that are none.
const NUMBERS: [&str; 22] = [
    "0",
    "-0.0",
    "-1",
    "1e308",
    "-1e308",
    "1e400",
    "5e-324",
    "1e-400",
    ".nan",
    "NaN",
    ".inf",
    "-.inf",
    "9223372036854775807",
    "-9223372036854775808",
    "9223372036854775808",
    "4294967295",
    "4294967296",
    "99999999999999999999999",
    "0x7fffffffffffffff",
    "1e16",
    "1e-16",
    "null",
];
/// The same in bytes: counts, lengths and times of 32 and 64 bits.
const WORDS: [u64; 12] = [
    0,
    1,
    0x7f,
    0xffff,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_ffff,
    0x7fff_ffff_ffff_ffff,
    0x8000_0000_0000_0000,
    0xffff_ffff_ffff_ffff,
    // NaN and the largest number, as doubles.
    0x7ff8_0000_0000_0000,
    0x7fef_ffff_ffff_ffff,
];
/// What means something to one of the formats.
const TOKENS: [&[u8]; 18] = [
    b"\n", b":", b"- ", b"{", b"}", b"[", b"]", b"\"", b"'", b"#", b"---\n", b"&a ", b"*a",
    b"<<: ", b"!!str ", b"\0", b":=", b"\xff",
];
/// Longest repetition, bytes.
const LONGEST: usize = 1 << 14;

/// Draws mutants.
pub struct Mutator<'a> {
    /// For splices.
    others: &'a [Vec<u8>],
}

impl<'a> Mutator<'a> {
    pub const fn new(others: &'a [Vec<u8>]) -> Self {
        Self { others }
    }

    /// Returns a mutant by one to four changes.
    pub fn mutant(&self, seed: &[u8], rng: &mut ChaCha8Rng) -> Vec<u8> {
        let mut bytes = seed.to_vec();
        for _ in 0..rng.random_range(1..=4) {
            self.change(&mut bytes, rng);
        }
        bytes
    }

    fn change(&self, bytes: &mut Vec<u8>, rng: &mut ChaCha8Rng) {
        if bytes.is_empty() {
            bytes.push(rng.random());
            return;
        }
        let at = rng.random_range(0..bytes.len());
        match rng.random_range(0..12) {
            0 => bytes[at] ^= 1 << rng.random_range(0..8),
            1 => bytes[at] = rng.random(),
            2 => bytes.truncate(at),
            3 => drop(bytes.drain(part(bytes.len(), at, rng))),
            4 => {
                let copy = bytes[part(bytes.len(), at, rng)].to_vec();
                let to = rng.random_range(0..=bytes.len());
                bytes.splice(to..to, copy);
            }
            5 => {
                // The beginning of this one, the end of another.
                let other = &self.others[rng.random_range(0..self.others.len())];
                bytes.truncate(at);
                bytes.extend_from_slice(&other[rng.random_range(0..=other.len())..]);
            }
            6 => {
                let part = part(bytes.len(), at, rng);
                let copy = bytes[part.clone()].to_vec();
                let most = (LONGEST / copy.len().max(1)).max(1);
                bytes.splice(part, copy.repeat(rng.random_range(1..=most)));
            }
            7 | 8 => number(bytes, at, rng),
            9 | 10 => word(bytes, at, rng),
            _ => {
                let token = TOKENS[rng.random_range(0..TOKENS.len())];
                bytes.splice(at..at, token.iter().copied());
            }
        }
    }
}

/// Returns a part that begins at a place, mostly a short one.
fn part(length: usize, at: usize, rng: &mut ChaCha8Rng) -> Range<usize> {
    let most = if rng.random_bool(0.8) { 32 } else { length };
    at..length.min(at + rng.random_range(1..=most))
}

/// Replaces the number in digits that comes next.
fn number(bytes: &mut Vec<u8>, at: usize, rng: &mut ChaCha8Rng) {
    let is_digit = |byte: &u8| byte.is_ascii_digit();
    let Some(start) = bytes[at..].iter().position(is_digit).map(|from| at + from) else {
        return;
    };
    let is_part = |byte: &u8| byte.is_ascii_digit() || matches!(byte, b'.' | b'e' | b'E');
    let length = bytes[start..]
        .iter()
        .take_while(|byte| is_part(byte))
        .count();
    let other = NUMBERS[rng.random_range(0..NUMBERS.len())];
    bytes.splice(start..start + length, other.bytes());
}

/// Replaces a number of four or eight bytes, in either order.
fn word(bytes: &mut [u8], at: usize, rng: &mut ChaCha8Rng) {
    let size = if rng.random_bool(0.5) { 4 } else { 8 };
    // Most are aligned, behind a header of four bytes or not.
    let at = if rng.random_bool(0.7) { at & !3 } else { at };
    let word = WORDS[rng.random_range(0..WORDS.len())];
    let mut written = word.to_le_bytes();
    if rng.random_bool(0.2) {
        written.reverse();
    }
    for (byte, new) in bytes[at..].iter_mut().zip(&written[..size]) {
        *byte = *new;
    }
}
