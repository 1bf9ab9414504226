//! Warnings of the node's code, above the progress bar: what it finds wrong is the same as in flight.

use indicatif::ProgressBar;
use log::{LevelFilter, Log, Metadata, Record};

struct Warnings(ProgressBar);

impl Log for Warnings {
    fn enabled(&self, metadata: &Metadata) -> bool {
        metadata.target().starts_with("tanker_pose")
    }

    fn log(&self, record: &Record) {
        if self.enabled(record.metadata()) {
            self.0
                .suspend(|| eprintln!("tanker_pose: warning: {}", record.args()));
        }
    }

    fn flush(&self) {}
}

/// Prints warnings from now on.
pub fn start(bar: &ProgressBar) {
    if log::set_boxed_logger(Box::new(Warnings(bar.clone()))).is_ok() {
        log::set_max_level(LevelFilter::Warn);
    }
}
