//! One beacon.

use nalgebra::Point3;

/// One beacon of the tanker.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Marker {
    /// Its id in detections.
    pub id: u32,
    /// Its position, tanker frame, m.
    pub marker_in_tanker: Point3<f64>,
}

impl From<(u32, Point3<f64>)> for Marker {
    fn from((id, marker_in_tanker): (u32, Point3<f64>)) -> Self {
        Self {
            id,
            marker_in_tanker,
        }
    }
}
