//! Marker map, mount and camera refined from a recording: what all its frames together tell beyond a survey.
//!
//! ```text
//! unknowns     what is estimated once for all frames: markers, flex, camera, mount; their prior
//! select       frames and detections that are used: the estimator's own exclusion
//! model        residuals of a frame and their derivatives
//! adjust       the most probable poses and unknowns; the poses are eliminated
//! leverage     what of each residual the fit has taken away
//! noise        the detector: sigma and its growth with the range
//! correlation  what of its noise lasts from frame to frame, or is common to the corners of a tag
//! decide       which unknowns the data support moving, and the covariance of what is then wrong
//! gauge        how far the data tell a common shift, rotation and scale of the tanker's frame
//! dominate     sigmas and modes that a marker map can state and that claim no more than that covariance
//! result       map, camera and mount as they are written
//! outcome      what of all this is told
//! ```
//!
//! Knows `estimation`, `camera`, `target`, `geometry`; never a file, a topic or a clock (times are arguments).

mod adjust;
mod correlation;
mod decide;
mod dominate;
mod gauge;
mod leverage;
mod model;
mod noise;
mod outcome;
mod result;
mod run;
mod select;
mod unknowns;

use nalgebra::Rotation3;

use crate::estimation::Observation;

pub use correlation::{CornerCorrelation, TimeCorrelation};
pub use gauge::GaugeMode;
pub use noise::{DetectorNoise, MarkerNoise, RangeBin};
pub use outcome::{Calibration, CameraOutcome, MapOutcome, MountOutcome, Movement, Parameter};
pub use run::calibrate;

/// One frame of a recording, checked as the node checks it.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordedFrame {
    /// Time of the image, s, from any start.
    pub time_s: f64,
    /// The detections, each marker once.
    pub observations: Vec<Observation>,
    /// The tanker's attitude in the receiver as both aircraft report it, axes x forward, y left, z up.
    pub receiver_from_tanker: Option<Rotation3<f64>>,
}

/// What is to be refined besides the marker map, and by which limits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CalibrationSettings {
    /// Whether the camera's parameters are moved; they are estimated in any case if the budget gives them a sigma.
    pub intrinsics: bool,
    /// What is known of the mount; `None`: it is not asked for.
    pub mount: Option<MountPrior>,
    /// An unknown whose posterior sigma is more than this share of its prior's is not moved.
    pub least_gain: f64,
    /// Detections with a residual that a correct one exceeds with this probability are left out.
    pub reject_probability: f64,
}

impl Default for CalibrationSettings {
    fn default() -> Self {
        Self {
            intrinsics: false,
            mount: None,
            least_gain: 0.9,
            reject_probability: 1e-5,
        }
    }
}

/// What is known of the mount and of the attitudes that it is compared by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MountPrior {
    /// The mount as it is configured: the receiver's axes to the optical ones.
    pub camera_from_receiver: Rotation3<f64>,
    /// Standard deviation of the mount about each axis, rad.
    pub sigma_rad: f64,
    /// Standard deviation of the error of both reported attitudes together that is the same in all frames, rad.
    pub attitude_bias_rad: f64,
    /// Standard deviation of the rest of that error, rad.
    pub attitude_noise_rad: f64,
}

/// Why a recording calibrates nothing.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrateError {
    /// Map and budget are exact.
    #[error(
        "nothing to estimate: the map has no `sigma`, no sigma of the calibration is stated and the mount is not asked for; state what may be wrong"
    )]
    NothingUnknown,
    /// Hardly any frame can be used.
    #[error(
        "expected at least {need} frames with a trusted pose, got {used} of {got}{}",
        if reason.is_empty() { String::new() } else { format!("; the first refused: {reason}") }
    )]
    TooFewFrames {
        /// Frames that can be used.
        used: usize,
        /// Frames of the recording.
        got: usize,
        /// Frames needed.
        need: usize,
        /// Why the first one was refused; may be empty.
        reason: String,
    },
    /// The residuals have hardly any degrees of freedom.
    #[error(
        "the residuals of {frames} frames do not tell the detector's noise: more frames or more markers are needed"
    )]
    TooLittle {
        /// Frames that can be used.
        frames: usize,
    },
    /// Leaving out wrong detections does not end.
    #[error("after {rounds} rounds of leaving out wrong detections there are still more")]
    TooManyWrong {
        /// Rounds.
        rounds: usize,
    },
    /// A flex mode changes too fast for the length of the recording.
    #[error(
        "flex mode `{name}` with a time constant of {time_constant_s} s over {length_s:.0} s needs {need} amplitudes, at most {most} can be estimated: use a shorter part of the recording"
    )]
    TooManyAmplitudes {
        /// The mode.
        name: String,
        /// s.
        time_constant_s: f64,
        /// Length of the recording, s.
        length_s: f64,
        /// Amplitudes needed.
        need: usize,
        /// The limit.
        most: usize,
    },
    /// The adjustment does not settle.
    #[error("the adjustment did not converge within {iterations} steps")]
    NoConvergence {
        /// Steps.
        iterations: usize,
    },
    /// The information matrix is singular.
    #[error("the unknowns are not determined: {of} has no positive definite information")]
    Singular {
        /// What.
        of: &'static str,
    },
    /// The result does not make a valid map.
    #[error("the adjusted markers are no valid map: {0}")]
    Map(#[from] crate::target::MarkerMapError),
}
