//! Text files from outside, read with a limit on their size.
//!
//! Used by `bin` and `ros`, the floors that know files. A device or an endless pipe in place of a file ends with an
//! error instead of filling the memory.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// Largest file that is read, bytes: a thousand times the largest configuration file that anybody writes by hand.
pub const MAX_BYTES: u64 = 4 << 20;

/// Returns the text of a file of at most [`MAX_BYTES`].
///
/// # Errors
/// Those of opening and reading it, and [`io::ErrorKind::FileTooLarge`] or [`io::ErrorKind::InvalidData`] in words for
/// people: larger than the limit, or not UTF-8.
pub fn read(path: &Path) -> io::Result<String> {
    let mut bytes = Vec::new();
    File::open(path)?
        .take(MAX_BYTES + 1)
        .read_to_end(&mut bytes)?;
    if bytes.len() as u64 > MAX_BYTES {
        let reason = format!("expected a text file of at most {MAX_BYTES} bytes, got more");
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, reason));
    }
    String::from_utf8(bytes).map_err(|error| {
        let at = error.utf8_error().valid_up_to();
        let reason = format!("expected UTF-8 text, byte {at} is none");
        io::Error::new(io::ErrorKind::InvalidData, reason)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(target_os = "linux")]
    fn a_device_that_never_ends_is_refused() {
        let error = read(Path::new("/dev/zero")).expect_err("no file");
        assert_eq!(error.kind(), io::ErrorKind::FileTooLarge);
        assert_eq!(
            error.to_string(),
            "expected a text file of at most 4194304 bytes, got more"
        );
    }

    #[test]
    fn a_directory_is_refused() {
        assert!(read(Path::new(".")).is_err());
    }

    #[test]
    fn a_text_is_read_whole() {
        let manifest = Path::new(env!("CARGO_MANIFEST_DIR")).join("Cargo.toml");
        let text = read(&manifest).expect("it is there");
        assert!(text.starts_with("[package]"), "{text}");
    }
}
