//! `tanker_pose/ReceptacleState` and its constants.

use serde::{Deserialize, Serialize};
use serde_big_array::BigArray;

use super::{Header, Vector3};

/// `tanker_pose/ReceptacleState`; vectors in the receiver's axes (FLU), about the probe tip.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ReceptacleState {
    /// Time of the image and the receiver's frame.
    pub header: Header,
    /// From the probe tip to the receptacle, m.
    pub position: Vector3,
    /// Its derivative as the receiver sees it, m/s.
    pub velocity: Vector3,
    /// Row-major 6×6 of (position, velocity).
    #[serde(with = "BigArray")]
    pub covariance: [f64; 36],
    /// Length of `position`, m.
    pub distance: f64,
    /// Along x, m.
    pub distance_ahead: f64,
    /// Its standard deviation, m.
    pub distance_ahead_sigma: f64,
    /// Along x, m/s; positive: the gap closes.
    pub closing_speed: f64,
    /// Its standard deviation, m/s.
    pub closing_speed_sigma: f64,
    /// One of the `ENVELOPE` constants of this type.
    pub envelope: u8,
    /// That the receptacle is in neither region.
    pub probability_outside: f64,
    /// In the pre-contact region, not in the contact window.
    pub probability_pre_contact: f64,
    /// In the contact window.
    pub probability_contact: f64,
}

impl ReceptacleState {
    /// In neither region.
    pub const ENVELOPE_OUTSIDE: u8 = 0;
    /// In the pre-contact region.
    pub const ENVELOPE_PRE_CONTACT: u8 = 1;
    /// In the contact window.
    pub const ENVELOPE_CONTACT: u8 = 2;
}
