//! The effect of one frame on the track, and its code on the wire.

use super::TrackCode;
use crate::geometry::Motion;
use crate::tracking::TrackOutcome;

/// The effect of one frame on the track.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FrameTrack {
    /// The filter's outcome for the frame; `None` without a filter, or if the frame is not of this camera or has no
    /// valid stamp.
    pub outcome: Option<TrackOutcome>,
    /// The motion of the tanker in the camera at the frame's stamp, corrected by the frame or predicted; `None` without
    /// a confirmed track, or if the frame came late.
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
