//! A limit for the log lines of other crates: whoever can send packets could else fill the disk with them.

use std::time::{Duration, Instant};

/// Lines at once, after which they come one by one.
const BURST: u32 = 20;
/// One line more every so often.
const PERIOD: Duration = Duration::from_secs(1);

/// Decides which lines are shown, and counts the others.
///
/// Time is an argument, so that tests need no clock.
#[derive(Debug)]
pub(super) struct Flood {
    left: u32,
    since: Option<Instant>,
    withheld: u64,
}

impl Flood {
    pub(super) const fn new() -> Self {
        Self {
            left: BURST,
            since: None,
            withheld: 0,
        }
    }

    /// Returns whether a line is shown; if so, with how many were withheld before it.
    pub(super) fn take(&mut self, now: Instant) -> Option<u64> {
        let since = *self.since.get_or_insert(now);
        let periods = now.saturating_duration_since(since).as_nanos() / PERIOD.as_nanos();
        if periods > 0 {
            let more = u32::try_from(periods).unwrap_or(u32::MAX);
            self.left = self.left.saturating_add(more).min(BURST);
            self.since = Some(now);
        }
        if self.left == 0 {
            self.withheld += 1;
            return None;
        }
        self.left -= 1;
        Some(std::mem::take(&mut self.withheld))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_a_flood_are_counted_and_one_a_second_is_shown() {
        let (mut flood, start) = (Flood::new(), Instant::now());
        // 1000 lines a second for ten seconds.
        let shown: Vec<_> = (0..10_000)
            .filter_map(|at| flood.take(start + Duration::from_millis(at)))
            .collect();
        assert_eq!(shown.len(), 20 + 9);
        let withheld: u64 = shown.iter().sum();
        assert_eq!(withheld, 10_000 - 29 - flood.withheld);
        assert!(flood.withheld > 0);
    }

    #[test]
    fn rare_lines_are_all_shown() {
        let (mut flood, start) = (Flood::new(), Instant::now());
        for at in 0..100 {
            let now = start + Duration::from_secs(at);
            assert_eq!(flood.take(now), Some(0), "{at} s");
        }
    }

    #[test]
    fn after_a_quiet_time_a_burst_is_shown_again_with_the_count() {
        let (mut flood, start) = (Flood::new(), Instant::now());
        for _ in 0..30 {
            flood.take(start);
        }
        let later = start + Duration::from_secs(100);
        let shown: Vec<_> = (0..30).map_while(|_| flood.take(later)).collect();
        assert_eq!(shown.len(), 20);
        assert_eq!(shown[0], 10);
    }
}
