//! The reasons for refusing a frame.

use super::{OutcomeCode, Stamp, SuspectMarker};
use crate::camera::CameraError;
use crate::estimation::{EstimateError, Excluded};
use crate::text::{clip, digits, list, quoted};

/// px; a smaller sigma means that the wrong field was filled in.
pub(super) const MIN_SIGMA_PX: f64 = 1e-3;
/// px; beyond this a detection carries no information.
pub(super) const MAX_SIGMA_PX: f64 = 1e3;

/// Why a frame has no pose. The messages state the expected and the received value.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Refusal {
    /// No camera info has been received.
    #[error("expected a camera_info before the first detections, none has been received yet")]
    NoCameraInfo,
    /// The latest camera info cannot be used.
    #[error("the latest camera_info cannot be used: {0}")]
    InvalidCameraInfo(CameraError),
    /// The detections belong to another camera frame, or do not name one.
    #[error("expected detections in the frame of camera_info, '{}', got frame_id '{}'{}", clip(expected), clip(got), if .expected.is_empty() || .got.is_empty() { " (an empty frame_id names no frame)" } else { "" })]
    FrameMismatch {
        /// `frame_id` of the camera info.
        expected: String,
        /// `frame_id` of the detections.
        got: String,
    },
    /// The `frame_id`, which is echoed unchanged, is too long.
    #[error("expected a frame_id of {limit} bytes at most, got '{}'", clip(got), limit = crate::text::MAX_NAME_BYTES)]
    FrameIdTooLong {
        /// `frame_id` of the detections.
        got: String,
    },
    /// The time of the image is missing or malformed.
    #[error("expected the time of the image as a stamp above zero with nanosec below 1e9, got {} s {} ns", .0.sec, .0.nanosec)]
    InvalidStamp(Stamp),
    /// Other detections with the stamp of the last image.
    #[error("expected one image for each stamp, got other detections with the stamp of the last ones, {} s {} ns: the source of the stamps is stuck, or two detectors send at once", .0.sec, .0.nanosec)]
    StampRepeated(Stamp),
    /// Pixels that do not change.
    #[error(
        "expected pixels that change from image to image, got the same ones to the last bit in {images} images over {lasted_s:.1} s: camera or detector is stuck (max_frozen_s)"
    )]
    Frozen {
        /// How many images.
        images: u32,
        /// From the first to the last of them, s.
        lasted_s: f64,
    },
    /// An id that is not on the marker map.
    #[error("expected ids of the marker map, got unknown id {}", list(ids))]
    UnknownId {
        /// All unknown ids of the frame.
        ids: Vec<u32>,
    },
    /// A detection of another message type that does not identify one marker.
    #[error("expected {expected}, got {got}")]
    InvalidId {
        /// The expected value.
        expected: &'static str,
        /// The received value.
        got: String,
    },
    /// Tags that are not on the marker map.
    #[error("expected tags of the marker map, got unknown tag {}", list(ids))]
    UnknownTag {
        /// All unknown ids of the frame.
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
    /// A detection whose header differs from that of its array.
    #[error("expected detections of one image, got id {id} from frame_id '{}' at {} s {} ns", clip(frame_id), .stamp.sec, .stamp.nanosec)]
    OtherImage {
        /// Marker id.
        id: u32,
        /// Stamp of the detection.
        stamp: Stamp,
        /// `frame_id` of the detection.
        frame_id: String,
    },
    /// A marker that is detected more than once.
    #[error("expected each id once, got id {id} {count} times")]
    DuplicateId {
        /// The first such id.
        id: u32,
        /// Number of its detections.
        count: usize,
    },
    /// A pixel that is NaN or infinite.
    #[error("expected finite pixels, got ({u_px:?}, {v_px:?}) for id {id}")]
    NotFinite {
        /// Marker id.
        id: u32,
        /// Column.
        u_px: f64,
        /// Row.
        v_px: f64,
    },
    /// A sigma out of range.
    #[error("expected sigma between {least} and {most} px, or 0 for unknown, got {sigma_px:?} for id {id}", least = MIN_SIGMA_PX, most = MAX_SIGMA_PX)]
    InvalidSigma {
        /// Marker id.
        id: u32,
        /// The sigma, px.
        sigma_px: f64,
    },
    /// A pixel far outside the image.
    #[error("id {id}: {reason}")]
    OutsideImage {
        /// Marker id.
        id: u32,
        /// The expected and the received value.
        reason: String,
    },
    /// The estimate failed.
    #[error("{0}{hint}", hint = hint(.0))]
    Estimate(#[from] EstimateError),
    /// The attitude is so uncertain that no covariance describes it.
    #[error(
        "expected an attitude known to {limit_deg}° or better (1 sigma), got {sigma_deg:.1}°: beyond that no covariance describes the error"
    )]
    TooUncertain {
        /// Largest standard deviation of the attitude, degrees.
        sigma_deg: f64,
        /// The largest to publish, degrees.
        limit_deg: f64,
    },
    /// The residuals are larger than the sigmas promise.
    #[error(
        "expected chi-squared below {limit:.2} for {degrees_of_freedom} degrees of freedom, got {chi_squared:.2} (rms {} px): {}",
        digits(*rms_px),
        what_is_wrong(*unclear)
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
        unclear: Excluded,
    },
    /// The frame fits only without some of its markers, shortly after frames that no such choice explained.
    #[error(
        "the frame fits only without some of its markers, and a frame just before fitted in no way, or the camera has just \
         changed: expected a frame that fits with all of its markers first; a wrong calibration or marker map?"
    )]
    AmongUnexplained,
    /// Image and prior of the attitude contradict each other.
    #[error(
        "expected the attitude near its prior ({prior}), but the image shows it {turn_deg:.1}° off: chi-squared {chi_squared:.2}, limit {limit:.2}; \
         a wrong prior, a wrong camera_mount, or a wrong detection?"
    )]
    ContradictsPrior {
        /// What the prior is about.
        prior: &'static str,
        /// From the prior to the best fit, degrees; of the image alone it is more.
        turn_deg: f64,
        /// Of that turn.
        chi_squared: f64,
        /// The largest to trust.
        limit: f64,
    },
    /// The frame shows a marker that is excluded too often for occasional wrong detections.
    #[error("expected markers to be left out only occasionally, but {0}")]
    SuspectMarker(SuspectMarker),
    /// A second pose fits nearly as well.
    #[error(
        "expected one pose to stand out, but another is {ambiguity:.3} times as likely (max_ambiguity {limit})"
    )]
    Ambiguous {
        /// Likelihood of the rival relative to the best.
        ambiguity: f64,
        /// The largest that is accepted.
        limit: f64,
    },
    /// Another pose may fit better.
    #[error(
        "expected proof that no other pose in front of the camera fits better, but found none (require_certificate)"
    )]
    NotCertified,
}

impl Refusal {
    /// Returns the refusal's code.
    #[must_use]
    pub fn code(&self) -> OutcomeCode {
        match self {
            Self::NoCameraInfo => OutcomeCode::NoCameraInfo,
            Self::InvalidCameraInfo(_) => OutcomeCode::InvalidCameraInfo,
            Self::FrameMismatch { .. } | Self::FrameIdTooLong { .. } | Self::OtherImage { .. } => {
                OutcomeCode::FrameMismatch
            }
            Self::InvalidStamp(_) | Self::StampRepeated(_) => OutcomeCode::ZeroStamp,
            Self::UnknownId { .. }
            | Self::InvalidId { .. }
            | Self::UnknownTag { .. }
            | Self::WrongFamily { .. } => OutcomeCode::UnknownId,
            Self::DuplicateId { .. } => OutcomeCode::DuplicateId,
            Self::NotFinite { .. } => OutcomeCode::NotFinite,
            Self::InvalidSigma { .. } => OutcomeCode::InvalidSigma,
            Self::OutsideImage { .. } => OutcomeCode::OutsideImage,
            Self::Estimate(error) => code_of(error),
            Self::TooUncertain { .. } => OutcomeCode::DegenerateGeometry,
            Self::NotTrusted { .. }
            | Self::AmongUnexplained
            | Self::ContradictsPrior { .. }
            | Self::SuspectMarker(_)
            | Self::Frozen { .. } => OutcomeCode::NotTrusted,
            Self::Ambiguous { .. } | Self::NotCertified => OutcomeCode::Ambiguous,
        }
    }
    /// Returns whether it concerns the header, or a missing camera.
    #[must_use]
    pub fn is_of_header(&self) -> bool {
        matches!(
            self,
            Self::NoCameraInfo
                | Self::InvalidCameraInfo(_)
                | Self::FrameMismatch { .. }
                | Self::FrameIdTooLong { .. }
                | Self::InvalidStamp(_)
        )
    }
}

/// Returns the code of an estimator error.
const fn code_of(error: &EstimateError) -> OutcomeCode {
    match error {
        EstimateError::TooFewPoints { .. } | EstimateError::TooFewPrecisePoints { .. } => {
            OutcomeCode::TooFewPoints
        }
        EstimateError::NoRay { .. } => OutcomeCode::OutsideImage,
        EstimateError::Degenerate { .. } => OutcomeCode::DegenerateGeometry,
        EstimateError::NoConvergence { .. } => OutcomeCode::NoConvergence,
        EstimateError::BehindCamera { .. } => OutcomeCode::BehindCamera,
    }
}

/// Returns possible reasons for an estimator error.
const fn hint(error: &EstimateError) -> &'static str {
    match error {
        EstimateError::BehindCamera { .. } => {
            ": ids exchanged, a wrong detection, or a wrong camera_mount?"
        }
        _ => "",
    }
}

fn what_is_wrong(unclear: Excluded) -> String {
    let mut ids = unclear.ids();
    match (ids.next(), ids.next()) {
        (Some(a), Some(b)) => format!(
            "a wrong detection, and it is not clear which: without id {a} or without id {b} the rest agrees"
        ),
        _ => "a wrong detection or id, or a sigma too small?".to_owned(),
    }
}
