//! The constants of `tanker_pose/msg/EstimatorStatus`, for everybody who counts or prints outcomes.

/// What became of a frame, in one word; the number is that of the message's constant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
#[allow(missing_docs)] // each is documented in msg/EstimatorStatus.msg
pub enum OutcomeCode {
    Ok = 0,
    NoCameraInfo = 1,
    InvalidCameraInfo = 2,
    FrameMismatch = 3,
    ZeroStamp = 4,
    UnknownId = 5,
    DuplicateId = 6,
    NotFinite = 7,
    InvalidSigma = 8,
    OutsideImage = 9,
    TooFewPoints = 10,
    DegenerateGeometry = 11,
    NoConvergence = 12,
    BehindCamera = 13,
    NotTrusted = 14,
    Ambiguous = 15,
}

impl OutcomeCode {
    /// Every code, in the order of its number.
    pub const ALL: [Self; 16] = [
        Self::Ok,
        Self::NoCameraInfo,
        Self::InvalidCameraInfo,
        Self::FrameMismatch,
        Self::ZeroStamp,
        Self::UnknownId,
        Self::DuplicateId,
        Self::NotFinite,
        Self::InvalidSigma,
        Self::OutsideImage,
        Self::TooFewPoints,
        Self::DegenerateGeometry,
        Self::NoConvergence,
        Self::BehindCamera,
        Self::NotTrusted,
        Self::Ambiguous,
    ];

    /// Returns the number on the wire.
    #[must_use]
    pub const fn number(self) -> u8 {
        self as u8
    }

    /// Returns the constant's name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Ok => "OK",
            Self::NoCameraInfo => "NO_CAMERA_INFO",
            Self::InvalidCameraInfo => "INVALID_CAMERA_INFO",
            Self::FrameMismatch => "FRAME_MISMATCH",
            Self::ZeroStamp => "ZERO_STAMP",
            Self::UnknownId => "UNKNOWN_ID",
            Self::DuplicateId => "DUPLICATE_ID",
            Self::NotFinite => "NOT_FINITE",
            Self::InvalidSigma => "INVALID_SIGMA",
            Self::OutsideImage => "OUTSIDE_IMAGE",
            Self::TooFewPoints => "TOO_FEW_POINTS",
            Self::DegenerateGeometry => "DEGENERATE_GEOMETRY",
            Self::NoConvergence => "NO_CONVERGENCE",
            Self::BehindCamera => "BEHIND_CAMERA",
            Self::NotTrusted => "NOT_TRUSTED",
            Self::Ambiguous => "AMBIGUOUS",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_those_of_the_message_definition() {
        let definition = include_str!("../../msg/EstimatorStatus.msg");
        let constants: Vec<(String, u8)> = definition
            .lines()
            .filter_map(|line| {
                let (name, value) = line
                    .split('#')
                    .next()?
                    .strip_prefix("uint8 ")?
                    .split_once('=')?;
                Some((name.trim().to_owned(), value.trim().parse().ok()?))
            })
            .filter(|(name, _)| !name.starts_with("INITIALISATION_") && !name.starts_with("TRACK_"))
            .collect();
        let codes: Vec<(String, u8)> = OutcomeCode::ALL
            .iter()
            .map(|&code| (code.name().to_owned(), code.number()))
            .collect();
        assert_eq!(constants, codes);
    }
}
