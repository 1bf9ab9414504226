//! A log gate: a fault that lasts is logged once, not at every frame.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// A fault that comes and goes faster than this is logged at this interval.
const QUIET: Duration = Duration::from_secs(5);

/// Decides which of many good or faulty results are worth a log line.
///
/// Time is an argument, so that tests need no clock.
#[derive(Debug)]
pub struct SaidOnce<Fault> {
    /// The fault that was said last, and not yet said to be over.
    open: Option<Fault>,
    last_said: BTreeMap<Fault, Instant>,
    faulty: u64,
}

impl<Fault> Default for SaidOnce<Fault> {
    fn default() -> Self {
        Self {
            open: None,
            last_said: BTreeMap::new(),
            faulty: 0,
        }
    }
}

impl<Fault: Copy + Ord> SaidOnce<Fault> {
    /// Counts a faulty thing; returns whether its fault is to be said now.
    pub fn fault(&mut self, fault: Fault, now: Instant) -> bool {
        self.faulty += 1;
        let recent = |said: &Instant| now.saturating_duration_since(*said) < QUIET;
        if self.open == Some(fault) || self.last_said.get(&fault).is_some_and(recent) {
            return false;
        }
        self.open = Some(fault);
        self.last_said.insert(fault, now);
        true
    }

    /// Records a good one; returns how many were faulty before it if the end of a fault is to
    /// be said now.
    pub fn good(&mut self) -> Option<u64> {
        self.open.take().map(|_| std::mem::take(&mut self.faulty))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One frame of a 50 Hz lidar.
    const FRAME: Duration = Duration::from_millis(20);

    #[test]
    fn lasting_fault_is_said_once_and_its_end_once_with_the_count() {
        let (mut said, start) = (SaidOnce::default(), Instant::now());
        assert_eq!(said.good(), None);
        let lines = (0..1000)
            .filter(|i| said.fault('a', start + FRAME * *i))
            .count();
        assert_eq!(lines, 1);
        assert_eq!(said.good(), Some(1000));
        assert_eq!(said.good(), None);
    }

    #[test]
    fn another_fault_is_said_at_once() {
        let (mut said, start) = (SaidOnce::default(), Instant::now());
        assert!(said.fault('a', start));
        assert!(said.fault('b', start + FRAME));
        assert!(!said.fault('b', start + 2 * FRAME));
    }

    #[test]
    fn flickering_fault_is_said_every_few_seconds_and_all_are_counted() {
        let (mut said, start) = (SaidOnce::default(), Instant::now());
        let (mut begins, mut ends, mut counted) = (0, 0, 0);
        for i in 0..=500 {
            begins += u32::from(said.fault('a', start + 2 * i * FRAME));
            if let Some(faulty) = said.good() {
                ends += 1;
                counted += faulty;
            }
        }
        // 20 s of every second frame faulty: said at 0, 5, 10, 15 and 20 s.
        assert_eq!((begins, ends, counted), (5, 5, 501));
    }
}
