//! The last motion of a filter, which outlives its track; it is used to predict where to look.

use super::Filter;
use super::follower::Follower;
use super::model::{Noise, predict};
use super::track::{Track, seconds};
use crate::geometry::Motion;

/// A motion with growing uncertainty. It is not meant for guidance: a track ends
/// [`max_gap_s`](super::FilterSettings::max_gap_s) after its last frame, while this continues.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LastMotion {
    pub(super) track: Track,
    pub(super) noise: Noise,
    pub(super) is_confirmed: bool,
}

impl LastMotion {
    /// Returns the motion at the last accepted frame.
    #[must_use]
    pub fn motion(&self) -> &Motion {
        &self.track.motion
    }

    /// Returns whether it is from a confirmed track rather than from a candidate.
    #[must_use]
    pub fn is_confirmed(&self) -> bool {
        self.is_confirmed
    }

    /// Returns the motion at a stamp, with its increased covariance; `None` before the last accepted frame.
    #[must_use]
    pub fn at(&self, stamp_ns: i64) -> Option<Motion> {
        let gap_s = seconds(stamp_ns, self.track.stamp_ns);
        (gap_s >= 0.0).then(|| predict(&self.track.motion, gap_s, &self.noise))
    }
}

impl<F: Follower> Filter<F> {
    /// Returns the last motion of track or candidate; `None` without either.
    #[must_use]
    pub fn last_motion(&self) -> Option<LastMotion> {
        let (track, noise, is_confirmed) = self.believed()?;
        Some(LastMotion {
            track,
            noise,
            is_confirmed,
        })
    }
}
