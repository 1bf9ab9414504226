//! Refusals caused by the surroundings rather than by the frame.

use super::Fault;
use crate::pipeline::Refusal;

/// Returns the lasting fault that a refusal of a frame with this `frame_id` shows.
///
/// A detection of another time names no other camera's frame, though its outcome has the same code.
#[must_use]
pub fn fault_of(refusal: &Refusal, frame_id: &str) -> Option<Fault> {
    match refusal {
        Refusal::NoCameraInfo => Some(Fault::NoCameraInfo),
        Refusal::FrameMismatch { .. } | Refusal::FrameIdTooLong { .. } => {
            Some(Fault::FrameMismatch)
        }
        Refusal::OtherImage { frame_id: own, .. } if !own.is_empty() && own != frame_id => {
            Some(Fault::FrameMismatch)
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::Stamp;

    #[test]
    fn detection_of_another_time_names_no_other_frame() {
        let other = |frame_id: &str| Refusal::OtherImage {
            id: 1,
            stamp: Stamp { sec: 1, nanosec: 2 },
            frame_id: frame_id.to_owned(),
        };
        for (refusal, expected) in [
            (other("camera"), None),
            (other(""), None),
            (other("another"), Some(Fault::FrameMismatch)),
            (Refusal::NoCameraInfo, Some(Fault::NoCameraInfo)),
            (Refusal::InvalidStamp(Stamp::default()), None),
        ] {
            assert_eq!(fault_of(&refusal, "camera"), expected, "{refusal:?}");
        }
    }
}
