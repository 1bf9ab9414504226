//! Quantiles of how long frames take.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use statrs::statistics::{Data, OrderStatistics};

/// s; frames older than this no longer count.
pub const WINDOW_S: u64 = 10;
/// More frames than this in the window count no longer either: 1 kHz.
const MOST: usize = 10_000;

/// How long the frames of the last [`WINDOW_S`] took.
#[derive(Debug, Default)]
pub struct Latency {
    frames: VecDeque<(Instant, f64)>,
}

impl Latency {
    /// Takes the seconds that a frame took which was done at `now`.
    pub fn take(&mut self, seconds: f64, now: Instant) {
        if self.frames.len() == MOST {
            self.frames.pop_front();
        }
        self.frames.push_back((now, seconds));
    }

    /// Returns the median and the 99th percentile, s; `None` without a frame in the window.
    pub fn p50_and_p99_s(&mut self, now: Instant) -> Option<(f64, f64)> {
        let window = Duration::from_secs(WINDOW_S);
        let old = |(at, _): &(Instant, f64)| now.saturating_duration_since(*at) > window;
        while self.frames.front().is_some_and(old) {
            self.frames.pop_front();
        }
        if self.frames.is_empty() {
            return None;
        }
        let seconds: Vec<f64> = self.frames.iter().map(|(_, seconds)| *seconds).collect();
        let mut data = Data::new(seconds);
        Some((data.quantile(0.5), data.quantile(0.99)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_the_window() {
        let (mut latency, start) = (Latency::default(), Instant::now());
        assert_eq!(latency.p50_and_p99_s(start), None);
        latency.take(1000.0, start);
        let later = start + Duration::from_secs(5);
        for i in 0..=1000 {
            latency.take(f64::from(i), later);
        }
        let window = Duration::from_secs(WINDOW_S);
        let (p50, p99) = latency.p50_and_p99_s(later + window).expect("frames");
        // Of 0, 1 … 1000; the first frame is too old by then.
        assert!((p50 - 500.0).abs() < 0.5, "{p50}");
        assert!((p99 - 990.0).abs() < 1.0, "{p99}");
        assert_eq!(latency.p50_and_p99_s(later + 2 * window), None);
    }
}
