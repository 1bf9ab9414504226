//! The message about a marker that is left out in many frames.

use std::fmt;

/// A marker that is left out too often to be a wrong detection. Its `Display` explains the causes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SuspectMarker {
    /// Marker id.
    pub id: u32,
    /// Of the last frames that show it, those that leave it out, 0 to 1; where it may be this or another, a half.
    pub share: f64,
    /// Since when, s.
    pub lasted_s: f64,
}

impl fmt::Display for SuspectMarker {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "marker {} was left out of {:.0}% of the frames that show it, for {:.0} s: its position in the marker map or the \
             calibration (camera_info) is wrong, the airframe bends there, or the detector mistakes something else for it",
            self.id,
            100.0 * self.share,
            self.lasted_s
        )
    }
}
