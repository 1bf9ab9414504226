//! Why an output is held back.

use crate::answering::attitudes::NoLocalAttitude;
use crate::answering::health::Unexpected;
use crate::convert::FlightStackError;

/// Why an output is held back for a frame.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub(crate) enum Silence {
    #[error("the receiver's attitude: {0}")]
    Attitude(#[from] NoLocalAttitude),
    #[error(transparent)]
    FlightStack(#[from] FlightStackError),
    #[error(
        "the track is not confirmed yet, or this frame contradicted it: it needs a few consistent frames"
    )]
    NoTrack,
    #[error("no probability follows from the covariance of the position")]
    NoProbability,
    #[error("{0}: see unexpected_attitude")]
    UnexpectedAttitude(Unexpected),
    #[error("protection levels are not available, or exceed an alert limit: see integrity")]
    NotProtected,
    #[error(
        "the track has no protection levels, or they exceed an alert limit: see track_message of integrity"
    )]
    TrackNotProtected,
}

impl From<Unexpected> for Silence {
    fn from(unexpected: Unexpected) -> Self {
        Self::UnexpectedAttitude(unexpected)
    }
}
