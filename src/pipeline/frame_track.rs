//! What one frame did to the track, and its code on the wire.

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
