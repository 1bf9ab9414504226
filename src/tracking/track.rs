//! The motion at the time of an image, and differences of times.

use crate::geometry::Motion;

/// The motion of the tanker in the camera at the time of one image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Track {
    /// Time of the image, ns.
    pub stamp_ns: i64,
    /// `camera_from_tanker` with velocity, rate and covariance: `b` is the camera, `a` the tanker.
    pub motion: Motion,
}

/// Returns `later − earlier`. Whole nanoseconds, so that the epoch of the clock does not cost precision.
pub(super) fn seconds(later_ns: i64, earlier_ns: i64) -> f64 {
    // In 128 bits, where the difference of any two stamps is representable.
    let nanoseconds = i128::from(later_ns) - i128::from(earlier_ns);
    // Divided rather than multiplied: ten seconds are then exactly ten.
    nanoseconds as f64 / 1e9
}
