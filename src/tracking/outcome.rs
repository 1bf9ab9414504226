//! The effect of one frame on the track, and why there is no prediction.

use std::fmt;

/// The effect of one frame on the track.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum TrackOutcome {
    /// The frame is the first of a candidate; there is no track.
    Started(StartReason),
    /// The frame agrees with the candidate, which needs more such frames; there is no track.
    Confirming {
        /// Consistent frames so far, this one included.
        consistent_frames: u32,
        /// Frames needed.
        needed: u32,
    },
    /// The frame confirms the candidate: there is a track from here on. If there was one before, the last frames have
    /// contradicted it and agreed with each other.
    Acquired,
    /// The frame agrees with the track and has corrected it.
    Updated {
        /// Squared innovation over its covariance, chi-squared with 6 degrees of freedom.
        innovation_squared: f64,
    },
    /// The frame contradicts the track and was not used.
    Gated {
        /// Squared innovation over its covariance.
        innovation_squared: f64,
        /// The largest that is accepted.
        limit: f64,
    },
    /// A frame with this stamp was already processed: not used again.
    Duplicate {
        /// Its stamp, ns.
        stamp_ns: i64,
    },
    /// The frame is older than one that has already been processed, and was inserted at its own time: the track is the
    /// same as if the frames had come in order.
    Inserted {
        /// Behind the newest frame, s.
        late_by_s: f64,
        /// Whether it corrected the track: it has a pose that does not contradict the track at that time.
        was_used: bool,
    },
    /// The frame is so much older than the last accepted frame that it can no longer be used.
    Late {
        /// By this much, s.
        late_by_s: f64,
    },
    /// The pose or its covariance is invalid.
    Invalid(MeasurementError),
    /// A frame without a pose: the track is predicted.
    Coasting {
        /// Since the last accepted frame, s.
        gap_s: f64,
    },
    /// A frame without a pose, longer than `max_gap_s` after the last accepted one, or as long before it: the track is
    /// dropped.
    Dropped {
        /// Since the last accepted frame, s; negative if stamps went back.
        gap_s: f64,
    },
    /// A frame without a pose, while there is neither a track nor a candidate.
    Idle,
}

/// Why a candidate begins with this frame. Any previous one is dropped.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum StartReason {
    /// There was neither a track nor a candidate.
    First,
    /// The last accepted frame is more than `max_gap_s` ago.
    Gap {
        /// s.
        gap_s: f64,
    },
    /// Its stamp is more than `max_gap_s` before the last accepted one: the source of the stamps has restarted.
    StampsWentBack {
        /// s.
        by_s: f64,
    },
    /// It contradicts the candidate.
    Inconsistent {
        /// Squared innovation over its covariance.
        innovation_squared: f64,
        /// The largest that is accepted.
        limit: f64,
    },
    /// The covariance of the track was no longer positive definite. Seen only with points a kilometre from the tanker's
    /// origin and sigmas of nanometres together with sigmas of kilometres.
    LostPrecision,
}

impl fmt::Display for TrackOutcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Started(reason) => write!(f, "a candidate begins: {reason}"),
            Self::Confirming {
                consistent_frames,
                needed,
            } => write!(f, "confirming, {consistent_frames} of {needed} frames"),
            Self::Acquired => write!(f, "confirmed"),
            Self::Updated { innovation_squared } => {
                write!(f, "updated, squared innovation {innovation_squared:.1}")
            }
            Self::Gated {
                innovation_squared,
                limit,
            } => write!(
                f,
                "expected a squared innovation of at most {limit:.1}, got {innovation_squared:.1}: not used"
            ),
            Self::Duplicate { .. } => {
                write!(f, "a frame with this stamp was already processed: not used")
            }
            Self::Inserted {
                late_by_s,
                was_used: true,
            } => write!(f, "late by {late_by_s:.3} s: used at its own time"),
            Self::Inserted { late_by_s, .. } => {
                write!(
                    f,
                    "late by {late_by_s:.3} s: no usable pose at its own time"
                )
            }
            Self::Late { late_by_s } => write!(f, "late by {late_by_s:.3} s: not used"),
            Self::Invalid(error) => write!(f, "{error}"),
            Self::Coasting { gap_s } => write!(f, "no pose for {gap_s:.3} s"),
            Self::Dropped { gap_s } => write!(f, "dropped, no pose for {gap_s:.3} s"),
            Self::Idle => write!(f, "none"),
        }
    }
}

impl fmt::Display for StartReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::First => write!(f, "there was no track"),
            Self::Gap { gap_s } => write!(f, "the last one ended {gap_s:.3} s ago"),
            Self::StampsWentBack { by_s } => write!(f, "stamps went back by {by_s:.3} s"),
            Self::Inconsistent {
                innovation_squared,
                limit,
            } => write!(
                f,
                "expected a squared innovation of at most {limit:.1}, got {innovation_squared:.1}"
            ),
            Self::LostPrecision => {
                write!(f, "the track's covariance was no longer positive definite")
            }
        }
    }
}

/// Why a pose cannot be used as a measurement.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MeasurementError {
    /// The pose is not finite.
    #[error("expected a finite pose, got one with NaN or infinity")]
    PoseNotFinite,
    /// The covariance is invalid.
    #[error("expected a finite, symmetric, positive definite covariance, got another matrix")]
    InvalidCovariance,
    /// A lasting error is invalid.
    #[error(
        "expected finite shifts and positive time constants of lasting errors, got other values"
    )]
    InvalidLastingError,
}

/// Why there is no prediction for a stamp.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PredictError {
    /// There is no track to predict.
    #[error("expected a track, but none is confirmed yet or it was dropped")]
    NoTrack,
    /// Before the stamp of the track.
    #[error("expected a stamp at or after that of the track, got one {by_s:.3} s before it")]
    BeforeTrack {
        /// s.
        by_s: f64,
    },
    /// So far ahead that the track would be dropped.
    #[error("expected a stamp at most {limit_s} s after the last accepted frame, got {gap_s:.3} s")]
    BeyondGap {
        /// s.
        gap_s: f64,
        /// s.
        limit_s: f64,
    },
}
