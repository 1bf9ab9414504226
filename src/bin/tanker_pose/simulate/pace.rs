//! When the next frame is due.

use std::time::{Duration, Instant};

/// Later than this, frames are not made up for: a burst would only overflow queues.
const PATIENCE: Duration = Duration::from_millis(500);

/// A schedule counted from its start, so that delays do not add up.
#[derive(Debug, Clone, Copy)]
pub struct Pace {
    start: Instant,
    rate_hz: f64,
}

impl Pace {
    /// Returns a schedule whose frame 0 is due at `start`.
    pub const fn new(rate_hz: f64, start: Instant) -> Self {
        Self { start, rate_hz }
    }

    /// Returns when a frame is due.
    pub fn due(&self, number: u64) -> Instant {
        self.start + Duration::from_secs_f64(number as f64 / self.rate_hz)
    }

    /// Moves the schedule when the program was blocked, as by a closed lid; returns by how much.
    pub fn make_up(&mut self, number: u64, now: Instant) -> Option<Duration> {
        let late = now.checked_duration_since(self.due(number))?;
        (late > PATIENCE).then(|| {
            self.start += late;
            late
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_due_on_the_schedule_until_a_long_delay_moves_it() {
        let start = Instant::now();
        let mut pace = Pace::new(10.0, start);
        assert_eq!(pace.due(1000), start + Duration::from_secs(100));

        let slightly_late = pace.due(3) + Duration::from_millis(400);
        assert_eq!(pace.make_up(3, slightly_late), None);

        let held_up = pace.due(3) + Duration::from_secs(7);
        assert_eq!(pace.make_up(3, held_up), Some(Duration::from_secs(7)));
        assert_eq!(pace.due(3), held_up);
    }
}
