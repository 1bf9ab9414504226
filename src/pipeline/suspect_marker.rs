//! The message about a marker that is excluded in many frames.

use std::fmt;

/// A marker that is excluded too often for occasional wrong detections. Its `Display` explains the causes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SuspectMarker {
    /// Marker id.
    pub id: u32,
    /// Share of the last frames showing it in which it was excluded, 0 to 1; a frame in which it is unclear which of
    /// two is wrong counts half.
    pub share: f64,
    /// Duration, s.
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
