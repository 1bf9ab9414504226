//! Warnings of the node's code, above the progress bar: what it finds wrong is the same as in flight.

use std::sync::atomic::{AtomicU64, Ordering};

use indicatif::ProgressBar;
use log::{LevelFilter, Log, Metadata, Record};

/// Warnings that are printed: a long recording may have one for each minute, which nobody reads.
const PRINTED: u64 = 20;

/// How many there were.
static COUNT: AtomicU64 = AtomicU64::new(0);

struct Warnings(ProgressBar);

impl Log for Warnings {
    fn enabled(&self, metadata: &Metadata) -> bool {
        metadata.target().starts_with("tanker_pose")
    }

    fn log(&self, record: &Record) {
        if self.enabled(record.metadata()) && COUNT.fetch_add(1, Ordering::Relaxed) < PRINTED {
            self.0
                .suspend(|| eprintln!("tanker_pose: warning: {}", record.args()));
        }
    }

    fn flush(&self) {}
}

/// Prints the first warnings from now on.
pub fn start(bar: &ProgressBar) {
    if log::set_boxed_logger(Box::new(Warnings(bar.clone()))).is_ok() {
        log::set_max_level(LevelFilter::Warn);
    }
}

/// Returns how many warnings were not printed.
pub fn unprinted() -> u64 {
    COUNT.load(Ordering::Relaxed).saturating_sub(PRINTED)
}
