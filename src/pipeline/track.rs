//! What a frame does to the track, and what the track does for a frame.
//!
//! The track never touches a single frame's pose. With `initialisation: previous` the iteration starts from
//! its prediction, and where wrong detections have to be found the same prediction says what is plausible.

use nalgebra::Rotation3;

use super::{FrameOutcome, OutcomeCode, Stamp};
use crate::geometry::Motion;
use crate::tracking::{Filter, FilterSettings, LastMotion, TrackOutcome};

/// What one frame did to the track.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FrameTrack {
    /// What became of the frame in the filter; none without a filter, or when the frame is not of this camera or
    /// has no time.
    pub outcome: Option<TrackOutcome>,
    /// The motion of the tanker in the camera at the frame's stamp, corrected by the frame or predicted; none
    /// without a confirmed track, or when the frame came late.
    pub motion: Option<Motion>,
}

impl FrameTrack {
    /// Returns the code of the status message.
    #[must_use]
    pub fn code(&self) -> TrackCode {
        match self.outcome {
            Some(TrackOutcome::Duplicate { .. } | TrackOutcome::Late { .. }) => {
                TrackCode::OutOfOrder
            }
            Some(TrackOutcome::Gated { .. }) => TrackCode::Gated,
            Some(TrackOutcome::Updated { .. } | TrackOutcome::Acquired) => TrackCode::Updated,
            Some(_) if self.motion.is_some() => TrackCode::Predicted,
            Some(
                TrackOutcome::Started(_)
                | TrackOutcome::Confirming { .. }
                | TrackOutcome::Coasting { .. },
            ) => TrackCode::Candidate,
            Some(_) | None => TrackCode::None,
        }
    }
}

/// The constants `TRACK_…` of `tanker_pose/msg/EstimatorStatus`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
#[allow(missing_docs)] // each is documented in msg/EstimatorStatus.msg
pub enum TrackCode {
    None = 0,
    Candidate = 1,
    Updated = 2,
    Predicted = 3,
    Gated = 4,
    OutOfOrder = 5,
}

impl TrackCode {
    /// Every code, in the order of its number.
    pub const ALL: [Self; 6] = [
        Self::None,
        Self::Candidate,
        Self::Updated,
        Self::Predicted,
        Self::Gated,
        Self::OutOfOrder,
    ];

    /// Returns the number on the wire.
    #[must_use]
    pub const fn number(self) -> u8 {
        self as u8
    }

    /// Returns the constant's name without its prefix.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::None => "NONE",
            Self::Candidate => "CANDIDATE",
            Self::Updated => "UPDATED",
            Self::Predicted => "PREDICTED",
            Self::Gated => "GATED",
            Self::OutOfOrder => "OUT_OF_ORDER",
        }
    }
}

/// The filter between the frames, or none.
#[derive(Debug)]
pub(super) struct Tracker(Option<Filter>);

impl Tracker {
    pub(super) fn new(settings: Option<FilterSettings>) -> Self {
        Self(settings.and_then(|settings| Filter::new(settings).ok()))
    }

    /// Takes settings for the next frame on; the track stays.
    pub(super) fn set_settings(&mut self, settings: Option<FilterSettings>) {
        match (&mut self.0, settings) {
            (Some(filter), Some(settings)) => {
                if *filter.settings() != settings && filter.set_settings(settings).is_err() {
                    self.0 = None;
                }
            }
            _ => *self = Self::new(settings),
        }
    }

    pub(super) fn reset(&mut self) {
        if let Some(filter) = &mut self.0 {
            filter.reset();
        }
    }

    /// Returns the attitude that the track expects; none without a confirmed one that reaches so far.
    pub(super) fn expected_rotation(&self, stamp: Stamp) -> Option<Rotation3<f64>> {
        let motion = self.0.as_ref()?.predict(stamp.nanoseconds()).ok()?;
        Some(motion.b_from_a.rotation.to_rotation_matrix())
    }

    /// Returns the last motion of track or candidate; none without either.
    pub(super) fn last_motion(&self) -> Option<LastMotion> {
        self.0.as_ref()?.last_motion()
    }

    /// Tells the filter of a frame, and enters what came of it in the outcome.
    pub(super) fn follow(&mut self, stamp: Stamp, frame: &mut FrameOutcome) {
        let Some(filter) = &mut self.0 else {
            return;
        };
        // The header of such a frame says nothing that could be believed.
        if matches!(
            frame.code(),
            OutcomeCode::ZeroStamp
                | OutcomeCode::NoCameraInfo
                | OutcomeCode::InvalidCameraInfo
                | OutcomeCode::FrameMismatch
        ) {
            return;
        }
        let stamp_ns = stamp.nanoseconds();
        let outcome = match &frame.result {
            Ok(solution) => {
                filter.update(stamp_ns, &solution.camera_from_tanker, &solution.covariance)
            }
            _ => filter.miss(stamp_ns),
        };
        frame.track.outcome = Some(outcome);
        frame.track.motion = match outcome {
            TrackOutcome::Duplicate { .. } | TrackOutcome::Late { .. } => None,
            _ => filter.predict(stamp_ns).ok(),
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_those_of_the_message_definition() {
        let definition = include_str!("../../msg/EstimatorStatus.msg");
        let constants: Vec<(&str, u8)> = definition
            .lines()
            .filter_map(|line| {
                let (name, value) = line
                    .split('#')
                    .next()?
                    .strip_prefix("uint8 TRACK_")?
                    .split_once('=')?;
                Some((name.trim(), value.trim().parse().ok()?))
            })
            .collect();
        let codes: Vec<_> = TrackCode::ALL
            .iter()
            .map(|code| (code.name(), code.number()))
            .collect();
        assert_eq!(constants, codes);
    }
}
