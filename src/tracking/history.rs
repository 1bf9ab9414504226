//! The frames of the last half second, each with what was believed before it: a late frame is taken at its own time.

use std::collections::VecDeque;

use super::belief::Belief;
use super::follower::Follower;
use super::frame::Frame;
use super::track::seconds;

/// ns behind the newest frame; older ones are refused.
const REACH_NS: i64 = 500_000_000;
/// Frames that are remembered at most: half a second at 120 Hz.
const MAX_FRAMES: usize = 60;

/// A frame, and what was believed before it.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Entry<F: Follower> {
    pub(super) frame: Frame<F::Input>,
    pub(super) before: Belief<F>,
}

/// Where the stamp of a frame stands to those of earlier ones.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Place {
    /// After all of them.
    Newest,
    /// Its stamp has been seen.
    Seen,
    /// Between those that are remembered, or before them.
    Before {
        /// The first one after it.
        at: usize,
        /// Behind the newest stamp, s.
        late_by_s: f64,
    },
    /// Older than what is remembered.
    TooOld {
        /// Behind the last accepted frame, s.
        late_by_s: f64,
    },
}

/// Frames in the order of their stamps.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct History<F: Follower> {
    // Boxes, because inserting moves what follows.
    entries: VecDeque<Box<Entry<F>>>,
    newest_ns: Option<i64>,
    /// Nothing older than this can be taken, nor of this stamp.
    forgotten_ns: Option<i64>,
}

impl<F: Follower> History<F> {
    /// Forgets all frames and stamps.
    pub(super) fn clear(&mut self) {
        *self = Self::default();
    }

    /// Forgets all frames but not that they were: one from before the last accepted frame cannot be taken any more.
    pub(super) fn close(&mut self, accepted_ns: Option<i64>) {
        self.entries.clear();
        self.forgotten_ns = accepted_ns.or(self.newest_ns);
    }

    /// Returns where a stamp stands.
    ///
    /// # Inputs
    /// * `accepted_ns`: stamp of the track or candidate. A single frame from the future must not make all others old.
    pub(super) fn place(&self, stamp_ns: i64, accepted_ns: Option<i64>) -> Place {
        let Some(newest_ns) = self.newest_ns else {
            return Place::Newest;
        };
        if stamp_ns > newest_ns {
            return Place::Newest;
        }
        if stamp_ns == newest_ns {
            return Place::Seen;
        }
        let reference_ns = accepted_ns.unwrap_or(newest_ns);
        let is_older = stamp_ns < reference_ns.saturating_sub(REACH_NS);
        let is_forgotten = self
            .forgotten_ns
            .is_some_and(|forgotten| stamp_ns <= forgotten);
        let too_old = Place::TooOld {
            late_by_s: seconds(reference_ns, stamp_ns),
        };
        if is_older || is_forgotten {
            return too_old;
        }
        let at = self
            .entries
            .partition_point(|entry| entry.frame.stamp_ns < stamp_ns);
        let next_ns = self.entries.get(at).map(|entry| entry.frame.stamp_ns);
        if next_ns == Some(stamp_ns) {
            return Place::Seen;
        }
        let has_room = at > 0 || self.entries.len() < MAX_FRAMES;
        if !has_room {
            return too_old;
        }
        Place::Before {
            at,
            late_by_s: seconds(newest_ns, stamp_ns),
        }
    }

    /// Puts an empty frame at a place, that of [`Self::place`], and returns its place then.
    pub(super) fn insert(&mut self, at: usize, stamp_ns: i64, accepted_ns: Option<i64>) -> usize {
        let newest_ns = self
            .newest_ns
            .map_or(stamp_ns, |newest| newest.max(stamp_ns));
        self.newest_ns = Some(newest_ns);
        let oldest_ns = accepted_ns.unwrap_or(newest_ns).saturating_sub(REACH_NS);
        let mut entry = None;
        let mut removed = 0;
        while let Some(first_ns) = self.entries.front().map(|first| first.frame.stamp_ns)
            && (first_ns < oldest_ns || self.entries.len() >= MAX_FRAMES)
        {
            self.forgotten_ns = Some(first_ns);
            entry = self.entries.pop_front();
            removed += 1;
        }
        // One that has left is used again, with its memory.
        let mut entry = entry.unwrap_or_default();
        entry.frame.stamp_ns = stamp_ns;
        entry.frame.measured = None;
        entry.frame.lasting.clear();
        entry.frame.input = F::Input::default();
        let at = at.saturating_sub(removed);
        self.entries.insert(at, entry);
        at
    }

    pub(super) fn len(&self) -> usize {
        self.entries.len()
    }

    pub(super) fn entry(&mut self, at: usize) -> Option<&mut Entry<F>> {
        self.entries.get_mut(at).map(Box::as_mut)
    }
}
