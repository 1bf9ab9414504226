//! Frames that nothing explained make an exclusion soon after them doubtful.
//!
//! With a wrong calibration or map no detection fits. Most frames are refused then, but in some of them the noise makes
//! the rest agree once a marker is left out: of frames with a focal length 30 % too long one in eight, five metres off.
//! A frame with wrong detections, by contrast, stands among frames that fit.

use super::{FrameOutcome, Refusal};

/// Frames with a fit after one that nothing explained, or after a change of the camera, in which no exclusion is believed.
const DOUBTED: u32 = 3;

/// Whether an exclusion is believed now.
#[derive(Debug, Default)]
pub(super) struct Unexplained {
    /// Frames left in which it is not, unless one fits as it is.
    left: u32,
}

impl Unexplained {
    /// Doubts the next frames: the camera is another one.
    pub(super) const fn doubt(&mut self) {
        self.left = DOUBTED;
    }

    /// Forgets what was.
    pub(super) const fn forget(&mut self) {
        self.left = 0;
    }

    /// Refuses the pose of a frame that fits only without some of its markers while that is doubtful.
    pub(super) fn judge(&mut self, outcome: FrameOutcome) -> FrameOutcome {
        if self.believes(Fit::of(&outcome)) {
            outcome
        } else {
            outcome.refused_for(Refusal::AmongUnexplained)
        }
    }

    /// Takes a fit; returns whether it is believed as far as the frames before it tell.
    const fn believes(&mut self, fit: Fit) -> bool {
        match fit {
            Fit::Whole => self.left = 0,
            Fit::None => self.left = DOUBTED,
            Fit::InPart if self.left > 0 => {
                self.left -= 1;
                return false;
            }
            Fit::InPart | Fit::NotTold => {}
        }
        true
    }
}

/// How a frame fits.
#[derive(Debug, Clone, Copy)]
enum Fit {
    /// With all of its markers.
    Whole,
    /// Without some of them.
    InPart,
    /// In no way.
    None,
    /// It was refused for something else.
    NotTold,
}

impl Fit {
    fn of(outcome: &FrameOutcome) -> Self {
        match &outcome.result {
            Ok(solution) if solution.excluded.ids().next().is_some() => Self::InPart,
            Ok(_) => Self::Whole,
            Err(Refusal::NotTrusted { .. }) => Self::None,
            Err(_) => Self::NotTold,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn believed<const N: usize>(mut state: Unexplained, fits: [Fit; N]) -> [bool; N] {
        fits.map(|fit| state.believes(fit))
    }

    #[test]
    fn exclusion_among_frames_that_fit_is_believed() {
        let fits = [Fit::InPart, Fit::Whole, Fit::InPart, Fit::InPart];
        assert_eq!(believed(Unexplained::default(), fits), [true; 4]);
    }

    #[test]
    fn exclusion_is_not_believed_for_three_frames_after_one_that_fits_in_no_way() {
        let part = Fit::InPart;
        let fits = [Fit::None, part, Fit::NotTold, part, part, part];
        let expected = [true, false, true, false, false, true];
        assert_eq!(believed(Unexplained::default(), fits), expected);
    }

    #[test]
    fn frame_that_fits_as_it_is_ends_the_doubt() {
        let fits = [Fit::None, Fit::Whole, Fit::InPart];
        assert_eq!(believed(Unexplained::default(), fits), [true; 3]);
    }

    #[test]
    fn exclusion_after_a_change_of_the_camera_is_not_believed() {
        let mut changed = Unexplained::default();
        changed.doubt();
        assert_eq!(believed(changed, [Fit::InPart, Fit::Whole]), [false, true]);
    }
}
