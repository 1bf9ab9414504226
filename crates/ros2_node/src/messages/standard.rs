//! `builtin_interfaces`, `std_msgs` and `std_srvs`.

use serde::{Deserialize, Serialize};

/// `builtin_interfaces/Time`: kept as its two fields, so that a stamp passes through bit for bit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Time {
    /// Whole seconds.
    pub sec: i32,
    /// Nanoseconds on top, below 1e9 in a well-formed stamp.
    pub nanosec: u32,
}

/// `builtin_interfaces/Duration`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Duration {
    /// Whole seconds.
    pub sec: i32,
    /// Nanoseconds on top, below 1e9.
    pub nanosec: u32,
}

/// `std_msgs/Header`.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Header {
    /// The time of the data.
    pub stamp: Time,
    /// The frame that the data is expressed in.
    pub frame_id: String,
}

/// Request of `std_srvs/Trigger`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct TriggerRequest {
    /// Nothing: ROS has no empty messages.
    pub structure_needs_at_least_one_member: u8,
}

/// Response of `std_srvs/Trigger`.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct TriggerResponse {
    /// Whether it succeeded.
    pub success: bool,
    /// For display.
    pub message: String,
}
