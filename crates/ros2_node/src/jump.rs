//! Times that should follow each other, and do not.

use std::time::Instant;

use crate::messages::Time;

/// s; a gap by which stamps may run ahead of the node's own seconds. Fast replay and late starts stay below it.
const AHEAD_S: f64 = 10.0;

/// Judges times one after the other.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Jumps {
    previous: Option<(Time, Instant)>,
}

impl Jumps {
    /// Takes a time that arrived at `now`; returns a description of the jump if it does not follow the one before.
    pub fn take(&mut self, time: Time, now: Instant) -> Option<String> {
        let (before, then) = self.previous.replace((time, now))?;
        let passed_s = now.saturating_duration_since(then).as_secs_f64();
        let step_s = seconds_between(before, time);
        if step_s < 0.0 {
            Some(format!("back by {:.3} s", -step_s))
        } else if step_s > passed_s + AHEAD_S {
            Some(format!("ahead by {step_s:.3} s within {passed_s:.3} s"))
        } else {
            None
        }
    }
}

/// Returns the seconds from one time to another; differences of the parts, which no double rounds away.
#[must_use]
pub fn seconds_between(from: Time, to: Time) -> f64 {
    let seconds = f64::from(to.sec) - f64::from(from.sec);
    seconds + 1e-9 * (f64::from(to.nanosec) - f64::from(from.nanosec))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    fn time(sec: i32, nanosec: u32) -> Time {
        Time { sec, nanosec }
    }

    #[test]
    fn steps_back_and_far_ahead_are_told_and_others_are_not() {
        let (mut jumps, start) = (Jumps::default(), Instant::now());
        let mut take = |sec, nanosec, after_s| {
            jumps.take(time(sec, nanosec), start + Duration::from_secs(after_s))
        };
        assert_eq!(take(1000, 0, 0), None, "the first follows nothing");
        assert_eq!(take(1000, 0, 0), None, "two detectors of one image");
        assert_eq!(take(1009, 999_999_999, 0), None, "a fast replay");
        assert_eq!(take(1100, 0, 85), None, "a pause as long as the clock's");
        assert_eq!(
            take(1099, 999_000_000, 85).as_deref(),
            Some("back by 0.001 s")
        );
        assert_eq!(
            take(2000, 0, 86).as_deref(),
            Some("ahead by 900.001 s within 1.000 s")
        );
        assert_eq!(take(2000, 1, 86), None, "from there on it goes well");
    }
}
