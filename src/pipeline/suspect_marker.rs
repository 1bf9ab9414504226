//! What is said of a marker that is left out in frame after frame.

use std::fmt;

/// A marker that is left out too often to be a wrong detection. It displays as what that means.
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
            "marker {} was left out of {:.0}% of the frames that show it, for {:.0} s: its place in the marker map or the \
             calibration (camera_info) is wrong, the airframe bends there, or the detector takes something else for it",
            self.id,
            100.0 * self.share,
            self.lasted_s
        )
    }
}
