//! What becomes of a frame: a trusted pose, or the one reason for none.

use crate::camera::CameraError;
use crate::estimation::{
    EstimateError, EstimatorSettings, FrameCauses, Initialisation, Observation, Solution,
};

use super::{FrameTrack, LeftOut, Stamp};
use crate::text::{clip, digits, list, quoted};

/// Why a frame gives no pose. Each says what was expected and what came.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Refusal {
    /// No camera info yet.
    #[error("expected a camera_info before the first detections, none has arrived yet")]
    NoCameraInfo,
    /// The latest camera info cannot be used.
    #[error("the latest camera_info cannot be used: {0}")]
    InvalidCameraInfo(CameraError),
    /// The detections belong to another camera frame, or do not say to which.
    #[error("expected detections in the frame of camera_info, '{}', got frame_id '{}'{}", clip(expected), clip(got), if .expected.is_empty() || .got.is_empty() { " (an empty frame_id names no frame)" } else { "" })]
    FrameMismatch {
        /// `frame_id` of the camera info.
        expected: String,
        /// `frame_id` of the detections.
        got: String,
    },
    /// A `frame_id` that would have to be echoed bit for bit, and is too long for that.
    #[error("expected a frame_id of {limit} bytes at most, got '{}'", clip(got), limit = crate::text::MAX_NAME_BYTES)]
    FrameIdTooLong {
        /// `frame_id` of the detections.
        got: String,
    },
    /// The time of the image is missing or malformed.
    #[error("expected the time of the image as a stamp above zero with nanosec below 1e9, got {} s {} ns", .0.sec, .0.nanosec)]
    InvalidStamp(Stamp),
    /// An id that is not on the tanker.
    #[error("expected ids of the marker map, got unknown id {}", list(ids))]
    UnknownId {
        /// All such ids of the frame.
        ids: Vec<u32>,
    },
    /// A detection of another message type that does not name one marker.
    #[error("expected {expected}, got {got}")]
    InvalidId {
        /// What would do.
        expected: &'static str,
        /// What came.
        got: String,
    },
    /// Tags that are not on the tanker.
    #[error("expected tags of the marker map, got unknown tag {}", list(ids))]
    UnknownTag {
        /// All such ids of the frame.
        ids: Vec<i32>,
    },
    /// A tag of another family.
    #[error(
        "expected tag {id} of family {}, got family {}",
        quoted(expected),
        quoted(got)
    )]
    WrongFamily {
        /// The tag's id.
        id: u32,
        /// Its family in the marker map.
        expected: String,
        /// Its family in the detection.
        got: String,
    },
    /// A detection whose own header is not that of its array.
    #[error("expected detections of one image, got id {id} from frame_id '{}' at {} s {} ns", clip(frame_id), .stamp.sec, .stamp.nanosec)]
    OtherImage {
        /// Marker id.
        id: u32,
        /// Stamp of the detection.
        stamp: Stamp,
        /// `frame_id` of the detection.
        frame_id: String,
    },
    /// One marker seen twice.
    #[error("expected each id once, got id {id} {count} times")]
    DuplicateId {
        /// The first such id.
        id: u32,
        /// How often.
        count: usize,
    },
    /// A pixel that is not a number.
    #[error("expected finite pixels, got ({u_px:?}, {v_px:?}) for id {id}")]
    NotFinite {
        /// Marker id.
        id: u32,
        /// Column.
        u_px: f64,
        /// Row.
        v_px: f64,
    },
    /// A sigma that cannot be one.
    #[error("expected sigma between {least} and {most} px, or 0 for not known, got {sigma_px:?} for id {id}", least = super::checks::MIN_SIGMA_PX, most = super::checks::MAX_SIGMA_PX)]
    InvalidSigma {
        /// Marker id.
        id: u32,
        /// The sigma, px.
        sigma_px: f64,
    },
    /// A pixel where the image or the lens model does not reach.
    #[error("id {id}: {reason}")]
    OutsideImage {
        /// Marker id.
        id: u32,
        /// What was expected and what came.
        reason: String,
    },
    /// Fewer points than a pose needs.
    #[error("expected at least {need} points, got {got}")]
    TooFewPoints {
        /// Points at hand.
        got: usize,
        /// Points needed.
        need: usize,
    },
    /// Enough points, but too few that are precise enough to check each other.
    #[error(
        "expected at least {need} points of similar sigma, got {precise} of {got}: sigmas above five times the third best check nothing"
    )]
    TooFewPrecisePoints {
        /// Points whose sigma is near that of the best.
        precise: usize,
        /// Points at hand.
        got: usize,
        /// Points needed.
        need: usize,
    },
    /// The attitude is so uncertain that no covariance describes it.
    #[error(
        "expected an attitude known to {limit_deg}° or better (1 sigma), got {sigma_deg:.1}°: beyond that a covariance is not honest"
    )]
    TooUncertain {
        /// Largest standard deviation of the attitude, degrees.
        sigma_deg: f64,
        /// The largest to publish, degrees.
        limit_deg: f64,
    },
    /// The points cannot fix a pose.
    #[error("expected points that fix a pose, but {reason}")]
    DegenerateGeometry {
        /// What is wrong with them.
        reason: &'static str,
    },
    /// The solver found no minimum.
    #[error("expected the solver to settle, but it did not within {iterations} iterations")]
    NoConvergence {
        /// Iterations of the stage that gave up.
        iterations: u16,
    },
    /// The best fit is a mirror image.
    #[error(
        "expected every marker in front of the camera, but the best fit puts id {id} at depth {} m: ids exchanged, a wrong detection, or a wrong camera_mount?",
        digits(*depth_m)
    )]
    BehindCamera {
        /// Marker id.
        id: u32,
        /// Depth, m.
        depth_m: f64,
    },
    /// The residuals are larger than the sigmas promise.
    #[error(
        "expected chi-squared below {limit:.2} for {degrees_of_freedom} degrees of freedom, got {chi_squared:.2} (rms {} px): {}",
        digits(*rms_px),
        what_is_wrong(unclear)
    )]
    NotTrusted {
        /// Of the best fit.
        chi_squared: f64,
        /// The largest to trust.
        limit: f64,
        /// Of the test.
        degrees_of_freedom: u16,
        /// Of the best fit, px.
        rms_px: f64,
        /// Marker ids of which either may be the wrong one; empty if no choice explains the frame.
        unclear: Vec<u32>,
    },
    /// A second pose fits nearly as well.
    #[error(
        "expected one pose to stand out, but another is {ambiguity:.3} times as likely (max_ambiguity {limit})"
    )]
    Ambiguous {
        /// Likelihood of the rival over that of the best.
        ambiguity: f64,
        /// The largest to accept.
        limit: f64,
    },
}

impl From<EstimateError> for Refusal {
    fn from(error: EstimateError) -> Self {
        match error {
            EstimateError::TooFewPoints { got, need } => Self::TooFewPoints { got, need },
            EstimateError::TooFewPrecisePoints { precise, got, need } => {
                Self::TooFewPrecisePoints { precise, got, need }
            }
            EstimateError::NoRay { id, cause } => Self::OutsideImage {
                id,
                reason: cause.to_string(),
            },
            EstimateError::Degenerate { reason } => Self::DegenerateGeometry { reason },
            EstimateError::NoConvergence { iterations } => Self::NoConvergence { iterations },
            EstimateError::BehindCamera { id, depth_m } => Self::BehindCamera { id, depth_m },
        }
    }
}

/// What became of one frame.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameOutcome {
    /// The trusted pose, or the one reason for none.
    pub result: Result<Solution, Refusal>,
    /// The solution behind a refusal that was judged on its numbers: for the status, never to be flown.
    pub doubtful: Option<Solution>,
    /// Marker ids that the solution rests on.
    pub used_ids: Vec<u32>,
    /// Marker ids left out, as wrong or at the edge of the image.
    pub rejected_ids: Vec<u32>,
    /// Those at the edge of the image, of which the solver knew nothing.
    pub left_out: LeftOut,
    /// Where the iteration started; none when no solve was attempted.
    pub initialisation: Option<Initialisation>,
    /// What the frame did to the track, if there is one.
    pub track: FrameTrack,
    /// What each cause of the error budget did in this frame; none without a budget or a solution.
    pub causes: Option<FrameCauses>,
}

impl FrameOutcome {
    /// Returns the outcome of a frame that gave no solution.
    #[must_use]
    pub fn refused(refusal: Refusal) -> Self {
        Self {
            result: Err(refusal),
            doubtful: None,
            used_ids: Vec::new(),
            rejected_ids: Vec::new(),
            left_out: LeftOut::default(),
            initialisation: None,
            track: FrameTrack::default(),
            causes: None,
        }
    }

    pub(super) fn judged(
        solution: Solution,
        observations: &[Observation],
        settings: &EstimatorSettings,
    ) -> Self {
        let (rejected_ids, used_ids) = observations
            .iter()
            .map(|o| o.id)
            .partition(|&id| solution.excluded.contains(id));
        let initialisation = Some(solution.initialisation);
        let (result, doubtful) = match doubt(&solution, settings) {
            Some(refusal) => (Err(refusal), Some(solution)),
            None => (Ok(solution), None),
        };
        Self {
            result,
            doubtful,
            used_ids,
            rejected_ids,
            left_out: LeftOut::default(),
            initialisation,
            track: FrameTrack::default(),
            causes: None,
        }
    }

    /// Returns the outcome with the detections that were left out before it.
    #[must_use]
    pub fn without(mut self, left_out: LeftOut) -> Self {
        self.rejected_ids.extend(&left_out.ids);
        self.left_out = left_out;
        self
    }

    /// Returns what there is to say of the frame: the refusal, and what was left out at the edge of the image; often
    /// nothing.
    #[must_use]
    pub fn message(&self) -> String {
        let refusal = self.result.as_ref().err().map(ToString::to_string);
        let left_out = (!self.left_out.ids.is_empty()).then(|| self.left_out.to_string());
        let parts: Vec<String> = refusal.into_iter().chain(left_out).collect();
        parts.join("; ")
    }

    /// Returns the numbers of the best fit, trusted or not.
    #[must_use]
    pub fn solution(&self) -> Option<&Solution> {
        self.result.as_ref().ok().or(self.doubtful.as_ref())
    }
}

fn what_is_wrong(unclear: &[u32]) -> String {
    match unclear {
        [a, b] => format!(
            "a wrong detection, and it is not clear which: without id {a} or without id {b} the rest agrees"
        ),
        _ => "a wrong detection or id, or a sigma too small?".to_owned(),
    }
}

/// degrees; within it the true error follows the covariance, beyond it the projection bends too much.
const MAX_ATTITUDE_SIGMA_DEG: f64 = 10.0;

fn doubt(solution: &Solution, settings: &EstimatorSettings) -> Option<Refusal> {
    if !solution.is_trusted() {
        return Some(Refusal::NotTrusted {
            chi_squared: solution.chi_squared,
            limit: solution.chi_squared_limit,
            degrees_of_freedom: solution.degrees_of_freedom,
            rms_px: solution.rms_px,
            unclear: solution.unclear.ids().collect(),
        });
    }
    if !solution.covariance.is_valid() {
        return Some(Refusal::DegenerateGeometry {
            reason: "from this view they leave a direction of the pose free",
        });
    }
    // Before the uncertainty, which is what a second pose next to the first makes of the covariance.
    let limit = settings.max_ambiguity;
    let has_rival = solution.ambiguity > 0.0 && solution.ambiguity >= limit;
    if has_rival && limit < 1.0 {
        return Some(Refusal::Ambiguous {
            ambiguity: solution.ambiguity,
            limit: settings.max_ambiguity,
        });
    }
    let sigma_deg = solution.covariance.largest_attitude_sigma().to_degrees();
    (sigma_deg > MAX_ATTITUDE_SIGMA_DEG).then_some(Refusal::TooUncertain {
        sigma_deg,
        limit_deg: MAX_ATTITUDE_SIGMA_DEG,
    })
}
