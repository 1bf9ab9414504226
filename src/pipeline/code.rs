//! The constants of `tanker_pose/msg/EstimatorStatus`, for everybody who counts or prints outcomes.

use super::{FrameOutcome, Refusal};

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

    /// Returns the constant's name in lower case, as tools print it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::NoCameraInfo => "no_camera_info",
            Self::InvalidCameraInfo => "invalid_camera_info",
            Self::FrameMismatch => "frame_mismatch",
            Self::ZeroStamp => "zero_stamp",
            Self::UnknownId => "unknown_id",
            Self::DuplicateId => "duplicate_id",
            Self::NotFinite => "not_finite",
            Self::InvalidSigma => "invalid_sigma",
            Self::OutsideImage => "outside_image",
            Self::TooFewPoints => "too_few_points",
            Self::DegenerateGeometry => "degenerate_geometry",
            Self::NoConvergence => "no_convergence",
            Self::BehindCamera => "behind_camera",
            Self::NotTrusted => "not_trusted",
            Self::Ambiguous => "ambiguous",
        }
    }
}

impl Refusal {
    /// Returns the refusal's code.
    #[must_use]
    pub fn code(&self) -> OutcomeCode {
        match self {
            Self::NoCameraInfo => OutcomeCode::NoCameraInfo,
            Self::InvalidCameraInfo(_) => OutcomeCode::InvalidCameraInfo,
            Self::FrameMismatch { .. } => OutcomeCode::FrameMismatch,
            Self::InvalidStamp(_) => OutcomeCode::ZeroStamp,
            Self::UnknownId { .. } => OutcomeCode::UnknownId,
            Self::DuplicateId { .. } => OutcomeCode::DuplicateId,
            Self::NotFinite { .. } => OutcomeCode::NotFinite,
            Self::InvalidSigma { .. } => OutcomeCode::InvalidSigma,
            Self::OutsideImage { .. } => OutcomeCode::OutsideImage,
            Self::TooFewPoints { .. } => OutcomeCode::TooFewPoints,
            Self::DegenerateGeometry { .. } => OutcomeCode::DegenerateGeometry,
            Self::NoConvergence { .. } => OutcomeCode::NoConvergence,
            Self::BehindCamera { .. } => OutcomeCode::BehindCamera,
            Self::NotTrusted { .. } => OutcomeCode::NotTrusted,
            Self::Ambiguous { .. } => OutcomeCode::Ambiguous,
        }
    }
}

impl FrameOutcome {
    /// Returns the outcome's code.
    #[must_use]
    pub fn code(&self) -> OutcomeCode {
        self.result
            .as_ref()
            .err()
            .map_or(OutcomeCode::Ok, Refusal::code)
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
                Some((name.trim().to_lowercase(), value.trim().parse().ok()?))
            })
            .filter(|(name, _)| !name.starts_with("initialisation"))
            .collect();
        let codes: Vec<(String, u8)> = OutcomeCode::ALL
            .iter()
            .map(|&code| (code.name().to_owned(), code as u8))
            .collect();
        assert_eq!(constants, codes);
    }
}
