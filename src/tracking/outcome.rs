//! What became of one frame in the track, and why a track gives no prediction.

use std::fmt;

/// What one frame did to the track.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum TrackOutcome {
    /// It is the first of a candidate; there is no track.
    Started(StartReason),
    /// It agrees with the candidate, which needs more such frames; there is no track.
    Confirming {
        /// Consistent frames so far, this one included.
        consistent_frames: u32,
        /// Frames needed.
        needed: u32,
    },
    /// It was the last one that the candidate needed: from here on there is a track. If there was one before,
    /// the last frames have contradicted it and agreed with each other.
    Acquired,
    /// It agrees with the track and has corrected it.
    Updated {
        /// Squared innovation over its covariance, chi-squared with 6 degrees of freedom.
        innovation_squared: f64,
    },
    /// It contradicts the track and has not touched it.
    Gated {
        /// The same number.
        innovation_squared: f64,
        /// The largest to accept.
        limit: f64,
    },
    /// A frame of this stamp has been seen: not used again.
    Duplicate {
        /// Its stamp, ns.
        stamp_ns: i64,
    },
    /// Its image was taken before that of a frame that has come already, and it was taken at its own time: the track is
    /// as if it had come in order.
    Inserted {
        /// Behind the newest frame, s.
        late_by_s: f64,
        /// Whether it has corrected the track: it has a pose, which does not contradict the track of that time.
        was_used: bool,
    },
    /// Its image was taken so long before that of the last accepted frame that it cannot be used any more.
    Late {
        /// By this much, s.
        late_by_s: f64,
    },
    /// Its pose or covariance is not one.
    Invalid(MeasurementError),
    /// A frame without a pose: the track goes on by prediction.
    Coasting {
        /// Since the last accepted frame, s.
        gap_s: f64,
    },
    /// A frame without a pose, longer than `max_gap_s` after the last accepted one, or as long before it: the
    /// track is dropped.
    Dropped {
        /// Since the last accepted frame, s; negative when stamps went back.
        gap_s: f64,
    },
    /// A frame without a pose, and no track or candidate to go on.
    Idle,
}

/// Why a candidate begins with this frame. Whatever there was before is dropped.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum StartReason {
    /// There was neither a track nor a candidate.
    First,
    /// The last accepted frame is longer ago than `max_gap_s`.
    Gap {
        /// s.
        gap_s: f64,
    },
    /// Its stamp is older than the last accepted one by more than `max_gap_s`: the source of the stamps
    /// has begun anew.
    StampsWentBack {
        /// s.
        by_s: f64,
    },
    /// It contradicts the candidate so far.
    Inconsistent {
        /// Squared innovation over its covariance.
        innovation_squared: f64,
        /// The largest to accept.
        limit: f64,
    },
    /// The covariance of the track was no longer positive definite; seen only with points a kilometre from the
    /// tanker's origin and sigmas of nanometres beside such of kilometres.
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
            Self::Duplicate { .. } => write!(f, "a stamp that has been seen: not used"),
            Self::Inserted {
                late_by_s,
                was_used: true,
            } => write!(f, "late by {late_by_s:.3} s: used at its own time"),
            Self::Inserted { late_by_s, .. } => {
                write!(
                    f,
                    "late by {late_by_s:.3} s: nothing to use at its own time"
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
            Self::First => write!(f, "there was none"),
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

/// Why a pose is no measurement.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MeasurementError {
    /// The pose is not finite.
    #[error("expected a finite pose, got one with NaN or infinity")]
    PoseNotFinite,
    /// The covariance is not one.
    #[error("expected a finite, symmetric, positive definite covariance, got none")]
    InvalidCovariance,
    /// A lasting error is not one.
    #[error("expected finite shifts and positive time constants of lasting errors, got others")]
    InvalidLastingError,
}

/// Why there is no prediction for a stamp.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PredictError {
    /// Nothing to predict from.
    #[error("expected a track, there is none yet or it was dropped")]
    NoTrack,
    /// Before the track's own stamp.
    #[error("expected a stamp at or after that of the track, got one {by_s:.3} s before it")]
    BeforeTrack {
        /// s.
        by_s: f64,
    },
    /// So far ahead that the track is to be dropped.
    #[error("expected a stamp at most {limit_s} s after the last accepted frame, got {gap_s:.3} s")]
    BeyondGap {
        /// s.
        gap_s: f64,
        /// s.
        limit_s: f64,
    },
}
