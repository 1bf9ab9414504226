//! The constants of `tanker_pose/msg/EstimatorStatus` and `Integrity`, for counters and output.

use crate::integrity::{FrameIntegrity, Unavailable};

/// Declares an enum of constants: variant, number on the wire and name.
macro_rules! status_codes {
    (
        $(#[$of_enum:meta])*
        $code:ident
        $( $(#[$of_variant:meta])* $variant:ident = $number:literal $name:literal, )+
    ) => {
        $(#[$of_enum])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[repr(u8)]
        pub enum $code {
            $( $(#[$of_variant])* $variant = $number, )+
        }

        impl $code {
            /// Every code, in numerical order.
            pub const ALL: [Self; [$($number),+].len()] = [$(Self::$variant),+];

            /// Returns the number on the wire.
            #[must_use]
            pub const fn number(self) -> u8 {
                self as u8
            }

            /// Returns the constant's name, without the prefix that the constants of this enum share.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self {
                    $( Self::$variant => $name, )+
                }
            }
        }
    };
}

status_codes! {
    /// The outcome of a frame; the number is that of the message's constant.
    OutcomeCode
    /// A pose was published.
    Ok = 0 "OK",
    /// No `CameraInfo` has been received yet.
    NoCameraInfo = 1 "NO_CAMERA_INFO",
    /// The latest `CameraInfo` cannot be used.
    InvalidCameraInfo = 2 "INVALID_CAMERA_INFO",
    /// `frame_id` is empty or differs from that of the `CameraInfo`.
    FrameMismatch = 3 "FRAME_MISMATCH",
    /// The stamp is zero or malformed.
    ZeroStamp = 4 "ZERO_STAMP",
    /// An id that is not on the marker map.
    UnknownId = 5 "UNKNOWN_ID",
    /// Two detections with the same id.
    DuplicateId = 6 "DUPLICATE_ID",
    /// A pixel is NaN or infinite.
    NotFinite = 7 "NOT_FINITE",
    /// A sigma is negative, not finite, or too large to use.
    InvalidSigma = 8 "INVALID_SIGMA",
    /// A pixel is far outside the image, or where the lens model is not valid.
    OutsideImage = 9 "OUTSIDE_IMAGE",
    /// Fewer points than `min_points`, or than the initialisation needs.
    TooFewPoints = 10 "TOO_FEW_POINTS",
    /// The points do not determine a pose.
    DegenerateGeometry = 11 "DEGENERATE_GEOMETRY",
    /// The solver found no minimum.
    NoConvergence = 12 "NO_CONVERGENCE",
    /// The best fit has a marker behind the camera.
    BehindCamera = 13 "BEHIND_CAMERA",
    /// The residuals are too large for the stated sigmas.
    NotTrusted = 14 "NOT_TRUSTED",
    /// A second pose fits almost as well, or a required certificate is missing.
    Ambiguous = 15 "AMBIGUOUS",
}

status_codes! {
    /// The state of a frame's protection levels: the constants of `tanker_pose/msg/Integrity`.
    IntegrityState
    /// There are levels, and no alert limit is exceeded.
    Available = 0 "AVAILABLE",
    /// There is no trusted pose.
    NoPose = 1 "NO_POSE",
    /// The beacons contradict each other.
    Fault = 2 "FAULT",
    /// Faults that nothing would show are too likely.
    Unmonitored = 3 "UNMONITORED",
    /// A level exceeds its alert limit.
    AboveLimit = 4 "ABOVE_LIMIT",
    /// The points do not determine the pose well enough for levels.
    NotComputed = 5 "NOT_COMPUTED",
    /// There is no track; frames do not have this state.
    None = 6 "NONE",
}

impl From<&Result<FrameIntegrity, Unavailable>> for IntegrityState {
    fn from(levels: &Result<FrameIntegrity, Unavailable>) -> Self {
        match levels {
            Ok(found) if found.above_limit.is_some() => Self::AboveLimit,
            Ok(_) => Self::Available,
            Err(Unavailable::NoPose) => Self::NoPose,
            Err(Unavailable::NoTrack) => Self::None,
            Err(Unavailable::Fault { .. }) => Self::Fault,
            Err(Unavailable::Unmonitored { .. }) => Self::Unmonitored,
            Err(_) => Self::NotComputed,
        }
    }
}

status_codes! {
    /// The effect of a frame on the track: the constants `TRACK_…`.
    TrackCode
    /// There is no track, or the frame does not apply to it.
    None = 0 "NONE",
    /// Too few poses so far to confirm a track.
    Candidate = 1 "CANDIDATE",
    /// The pose agrees with the track and corrected it.
    Updated = 2 "UPDATED",
    /// The frame has no pose; the track was predicted to its stamp.
    Predicted = 3 "PREDICTED",
    /// The pose contradicts the track and was not used.
    Gated = 4 "GATED",
    /// The stamp is that of an earlier frame or too old, or a late frame had no usable pose.
    OutOfOrder = 5 "OUT_OF_ORDER",
    /// The frame came late and was used at its own time.
    Inserted = 6 "INSERTED",
}

#[cfg(test)]
mod tests {
    use super::*;

    const STATUS: &str = include_str!("../../msg/EstimatorStatus.msg");
    const INTEGRITY: &str = include_str!("../../msg/Integrity.msg");

    fn constants(definition: &'static str) -> impl Iterator<Item = (&'static str, u8)> {
        definition.lines().filter_map(|line| {
            let (name, value) = line
                .split('#')
                .next()?
                .strip_prefix("uint8 ")?
                .split_once('=')?;
            Some((name.trim(), value.trim().parse().ok()?))
        })
    }

    #[test]
    fn codes_are_those_of_the_message_definition() {
        let outcomes = constants(STATUS).filter(|(name, _)| {
            !["INITIALISATION_", "TRACK_", "CERTIFICATE_"]
                .iter()
                .any(|prefix| name.starts_with(prefix))
        });
        assert!(outcomes.eq(OutcomeCode::ALL.map(|code| (code.name(), code.number()))));
        let tracks = constants(STATUS)
            .filter_map(|(name, value)| Some((name.strip_prefix("TRACK_")?, value)));
        assert!(tracks.eq(TrackCode::ALL.map(|code| (code.name(), code.number()))));
        let states = IntegrityState::ALL.map(|code| (code.name(), code.number()));
        assert!(constants(INTEGRITY).eq(states));
    }
}
