//! `tanker_pose/Integrity` and its points.

use serde::{Deserialize, Serialize};

use super::{Header, Vector3};

/// `tanker_pose/IntegrityPoint`; vectors are ahead, lateral, vertical in the receiver's axes, m.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct IntegrityPoint {
    /// Receptacle, a point of the marker map, or the mean of the markers.
    pub name: String,
    /// Protection levels; NaN where there are none.
    pub protection_level: Vector3,
    /// Standard deviations without a fault; NaN as above.
    pub sigma: Vector3,
    /// Largest levels allowed; NaN: not stated.
    pub alert_limit: Vector3,
    /// Fault with the largest part in each level; empty: noise and budget alone.
    pub weakest: [String; 3],
}

/// `tanker_pose/Integrity`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Integrity {
    /// That of the detections, bit for bit.
    pub header: Header,
    /// An [`IntegrityState`](crate::pipeline::IntegrityState) as its number.
    pub state: u8,
    /// The reason; empty when available.
    pub message: String,
    /// Allowed risk that an error exceeds a level without an alert.
    pub hmi_probability: f64,
    /// Of all faults that are not monitored; NaN without levels.
    pub unmonitored_probability: f64,
    /// Every declared point.
    pub points: Vec<IntegrityPoint>,
    /// An [`IntegrityState`](crate::pipeline::IntegrityState) of the track, as its number.
    pub track_state: u8,
    /// The reason; empty when available.
    pub track_message: String,
    /// Of all faults that are not monitored in the track; NaN without levels.
    pub track_unmonitored_probability: f64,
    /// Every declared point, for the track.
    pub track_points: Vec<IntegrityPoint>,
}
