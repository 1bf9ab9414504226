//! Why the tool ends without its results.

use std::path::PathBuf;

/// Why the tool ends without its results.
#[derive(Debug, thiserror::Error)]
pub enum ReproduceError {
    #[error("cannot make the directory {}: {source}", path.display())]
    Directory {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error("cannot write {}: {source}", path.display())]
    File {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error("cannot draw {}: {reason}", path.display())]
    Plot { path: PathBuf, reason: String },
    #[error("cannot print the results: {0}")]
    Print(std::io::Error),
    #[error("setting {abscissa} of {experiment}: its markers do not determine the pose")]
    NoBound {
        experiment: &'static str,
        abscissa: f64,
    },
}
