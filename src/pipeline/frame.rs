//! The detections of one image.

use nalgebra::Rotation3;

use super::{Refusal, Stamp};

/// A detected beacon in an image, unchecked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Detection {
    /// Marker id on the tanker's marker map.
    pub id: u32,
    /// Column of the centre, px; the centre of the top-left pixel is (0, 0).
    pub u_px: f64,
    /// Row of the centre, px.
    pub v_px: f64,
    /// Standard deviation of column and of row, px; 0 if the detector does not state it.
    pub sigma_px: f64,
}

/// All detections of one image, unchecked.
#[derive(Debug, Clone, PartialEq)]
pub struct DetectionFrame {
    /// When the image was taken.
    pub stamp: Stamp,
    /// The camera optical frame that the pixels belong to.
    pub frame_id: String,
    /// The detections, in any order; or why they cannot be read.
    pub detections: Result<Vec<Detection>, Refusal>,
    /// The tanker's attitude in the receiver as both report it for the stamp, axes x forward, y left, z up; used where
    /// [`Settings::reported_attitude`](crate::config::Settings::reported_attitude) says how well it is known.
    pub receiver_from_tanker: Option<Rotation3<f64>>,
}
