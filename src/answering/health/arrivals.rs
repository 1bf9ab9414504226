//! Arrivals of messages on a topic: recent, steady or silent.

use std::time::{Duration, Instant};

/// Longer than a reliable publisher on Fast DDS may take for its first sample: 3 s, its heartbeat's period.
pub(super) const SILENCE: Duration = Duration::from_secs(5);
/// Camera info counts as steady after this many consecutive seconds with one in each; a latched one never does.
const STEADY_S: u32 = 3;

/// What arrives on a topic.
#[derive(Debug, Default)]
pub(super) struct Arrivals {
    last: Option<Instant>,
    this_second: bool,
    steady_s: u32,
    pub(super) was_steady: bool,
    /// Since when the topic has had a matching publisher.
    heard_since: Option<Instant>,
}

impl Arrivals {
    pub(super) fn take(&mut self, now: Instant) {
        self.last = Some(now);
        self.this_second = true;
    }

    pub(super) fn on_second(&mut self, publishers: usize, now: Instant) {
        if publishers > 0 && self.heard_since.is_none() {
            // A restarted publisher may send camera info only once.
            self.steady_s = 0;
            self.was_steady = false;
        }
        self.steady_s = if self.this_second {
            self.steady_s.saturating_add(1)
        } else {
            0
        };
        self.was_steady |= self.steady_s >= STEADY_S;
        self.this_second = false;
        self.heard_since = if publishers == 0 {
            None
        } else {
            self.heard_since.or(Some(now))
        };
    }

    pub(super) fn ever(&self) -> bool {
        self.last.is_some()
    }

    /// Whether the last one arrived recently.
    pub(super) fn recent(&self, now: Instant) -> bool {
        self.last.is_some_and(|last| !is_long(last, now))
    }

    /// Whether the topic has had a publisher for a while, but no message arrives.
    pub(super) fn silent(&self, now: Instant) -> bool {
        self.heard_since.is_some_and(|since| is_long(since, now)) && !self.recent(now)
    }
}

pub(super) fn is_long(since: Instant, now: Instant) -> bool {
    now.saturating_duration_since(since) >= SILENCE
}
