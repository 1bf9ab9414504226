//! What one frame did to the track, and its code on the wire.

use super::TrackCode;
use crate::geometry::Motion;
use crate::tracking::TrackOutcome;

/// What one frame did to the track.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FrameTrack {
    /// What became of the frame in the filter; `None` without a filter, or when the frame is not of this camera or
    /// has no time.
    pub outcome: Option<TrackOutcome>,
    /// The motion of the tanker in the camera at the frame's stamp, corrected by the frame or predicted; `None`
    /// without a confirmed track, or when the frame came late.
    pub motion: Option<Motion>,
}

impl FrameTrack {
    /// Returns the code of the status message.
    #[must_use]
    pub fn code(&self) -> TrackCode {
        match self.outcome {
            Some(TrackOutcome::Inserted { was_used: true, .. }) => TrackCode::Inserted,
            Some(
                TrackOutcome::Duplicate { .. }
                | TrackOutcome::Inserted { .. }
                | TrackOutcome::Late { .. },
            ) => TrackCode::OutOfOrder,
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
