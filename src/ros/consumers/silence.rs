//! Why an output says nothing.

use crate::frames::AttitudeError;
use crate::ros::convert::FlightStackError;
use crate::ros::health::Unexpected;

/// Why an output said nothing to a frame.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub(super) enum Silence {
    #[error(transparent)]
    Attitude(#[from] AttitudeError),
    #[error(transparent)]
    FlightStack(#[from] FlightStackError),
    #[error(
        "the track is not confirmed yet, or this frame did not fit it: it needs a few consistent frames"
    )]
    NoTrack,
    #[error("the covariance of the position gives no probability")]
    NoProbability,
    #[error("{0}: see unexpected_attitude")]
    UnexpectedAttitude(Unexpected),
}

impl From<Unexpected> for Silence {
    fn from(unexpected: Unexpected) -> Self {
        Self::UnexpectedAttitude(unexpected)
    }
}
