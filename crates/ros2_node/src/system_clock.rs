//! Detects backward steps of the system clock, which silence best-effort inputs.
//!
//! `RustDDS` orders samples by their time of arrival, and gives a best-effort input those up to now. Those that arrived
//! before the clock was set back lies in its future, and so does all that comes until the clock has caught up.

use std::time::{Duration, Instant, SystemTime};

/// Less than this is a clock that is led gently, or a second in which the node could not run.
const STEP: Duration = Duration::from_millis(100);

/// Compares the system's clock with a steady one.
#[derive(Debug, Default)]
pub struct SystemClock {
    previous: Option<(SystemTime, Instant)>,
    /// By how much it was set back, and when it has caught up.
    set_back: Option<(Duration, SystemTime)>,
}

impl SystemClock {
    /// Takes both times, read at once; returns the words while the clock is behind what it was.
    pub fn take(&mut self, system: SystemTime, steady: Instant) -> Option<String> {
        if let Some((before, then)) = self.previous.replace((system, steady)) {
            let expected = before + steady.saturating_duration_since(then);
            let step = expected.duration_since(system).unwrap_or_default();
            if step > STEP {
                // Set back twice, it has to catch up with the first time.
                let (earlier, until) = self.set_back.unwrap_or((Duration::ZERO, expected));
                self.set_back = Some((earlier + step, until.max(expected)));
            }
        }
        let (step, until) = self.set_back?;
        match until.duration_since(system) {
            Ok(left) if !left.is_zero() => Some(format!(
                "the system's clock was set back by {:.3} s: best-effort inputs (the default) receive nothing for another {:.0} s; \
                 restart the node to receive at once",
                step.as_secs_f64(),
                left.as_secs_f64().ceil()
            )),
            _ => {
                self.set_back = None;
                None
            }
        }
    }
}

/// Returns the system's time and a steady one, read at once; `None` if something came between.
#[must_use]
pub fn both_clocks() -> Option<(SystemTime, Instant)> {
    let before = Instant::now();
    let system = SystemTime::now();
    let steady = Instant::now();
    (steady.saturating_duration_since(before) < STEP / 10).then_some((system, steady))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: Duration = Duration::from_secs(1);

    #[test]
    fn clock_set_back_is_told_until_it_has_caught_up() {
        let (mut clock, system, steady) = (
            SystemClock::default(),
            SystemTime::UNIX_EPOCH + 1_000_000 * SECOND,
            Instant::now(),
        );
        let mut at = |system_s: f64, steady_s: f64| {
            clock.take(
                system + Duration::from_secs_f64(system_s),
                steady + Duration::from_secs_f64(steady_s),
            )
        };
        assert_eq!(at(100.0, 0.0), None, "the first follows nothing");
        assert_eq!(at(101.0, 1.0), None);
        assert_eq!(at(160.0, 60.0), None, "a minute in which nothing ran");
        assert_eq!(at(160.95, 61.0), None, "led gently");
        assert_eq!(at(4000.0, 62.0), None, "ahead: nothing is withheld");
        let words = at(3991.0, 63.0).expect("back by ten seconds");
        assert!(words.contains("by 10.000 s"), "{words}");
        assert!(words.contains("another 10 s"), "{words}");
        let words = at(3995.0, 67.0).expect("not yet there");
        assert!(words.contains("another 6 s"), "{words}");
        let words = at(3991.0, 68.0).expect("back again");
        assert!(words.contains("by 15.000 s"), "{words}");
        assert!(at(4000.5, 77.5).is_some());
        assert_eq!(at(4001.5, 78.5), None, "it has caught up");
        assert_eq!(at(4002.5, 79.5), None);
    }

    #[test]
    fn clock_set_right_again_is_told_no_longer() {
        let (mut clock, system, steady) = (
            SystemClock::default(),
            SystemTime::UNIX_EPOCH + 1_000_000 * SECOND,
            Instant::now(),
        );
        assert_eq!(clock.take(system, steady), None);
        assert!(
            clock
                .take(system - 3600 * SECOND, steady + SECOND)
                .is_some()
        );
        assert_eq!(clock.take(system + 2 * SECOND, steady + 2 * SECOND), None);
    }

    #[test]
    fn clocks_of_this_machine_agree() {
        let mut clock = SystemClock::default();
        let read = || std::iter::repeat_with(both_clocks).flatten().next();
        let (system, steady) = read().expect("it repeats until both are read");
        assert_eq!(clock.take(system, steady), None);
        let (system, steady) = read().expect("it repeats until both are read");
        assert_eq!(clock.take(system, steady), None);
    }
}
