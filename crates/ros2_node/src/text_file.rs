//! Text files from outside, read with a limit on their size.
//!
//! Used by `bin` and `ros`, the floors that know files. A device or an endless pipe in place of a file ends with an
//! error instead of filling the memory, and a named pipe is refused: to open one waits until somebody writes to it.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// Largest file that is read, bytes: a thousand times the largest configuration file that anybody writes by hand.
pub const MAX_BYTES: u64 = 4 << 20;

/// Returns the text of a file of at most [`MAX_BYTES`].
///
/// # Errors
/// Those of opening and reading it, and [`io::ErrorKind::InvalidInput`], [`io::ErrorKind::FileTooLarge`] or
/// [`io::ErrorKind::InvalidData`] in words for people: a named pipe, larger than the limit, or not UTF-8.
pub fn read(path: &Path) -> io::Result<String> {
    if is_named_pipe(path) {
        let reason = "expected a file, got a named pipe, which would wait until somebody writes to it (/dev/stdin can be \
                      read)";
        return Err(io::Error::new(io::ErrorKind::InvalidInput, reason));
    }
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

/// Whether a path leads to a pipe with a name. What a shell makes for `/dev/stdin` or `<(command)` has none, and is open
/// already.
#[cfg(unix)]
fn is_named_pipe(path: &Path) -> bool {
    use std::os::unix::fs::FileTypeExt;
    let is_pipe = std::fs::metadata(path).is_ok_and(|found| found.file_type().is_fifo());
    let is_open = ["/dev", "/proc"].iter().any(|at| path.starts_with(at));
    is_pipe && !is_open
}

#[cfg(not(unix))]
fn is_named_pipe(_: &Path) -> bool {
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(target_os = "linux")]
    fn a_named_pipe_is_refused_before_it_is_waited_for_and_an_open_one_is_read() {
        use std::process::{Command, Stdio};
        let path = std::env::temp_dir().join(format!("text_file_pipe_{}", std::process::id()));
        let made = Command::new("mkfifo").arg(&path).status().expect("mkfifo");
        assert!(made.success());
        let link = path.with_extension("link");
        std::os::unix::fs::symlink(&path, &link).expect("a link");
        for path in [&path, &link] {
            let error = read(path).expect_err("nobody writes");
            assert_eq!(error.kind(), io::ErrorKind::InvalidInput);
            assert!(error.to_string().contains("named pipe"), "{error}");
        }
        std::fs::remove_file(&link).expect("it is there");
        std::fs::remove_file(&path).expect("it is there");

        let mut echo = Command::new("echo")
            .arg("a: 1")
            .stdout(Stdio::piped())
            .spawn()
            .expect("echo");
        let pipe = echo.stdout.take().expect("piped");
        let number = std::os::fd::AsRawFd::as_raw_fd(&pipe);
        let open = Path::new("/proc/self/fd").join(number.to_string());
        // The end that was read from before must not keep it open for writing: it does not.
        assert_eq!(read(&open).expect("an open pipe"), "a: 1\n");
        assert!(echo.wait().expect("it ends").success());
    }

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
