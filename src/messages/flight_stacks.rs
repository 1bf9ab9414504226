//! What flight stacks send and take: `px4_msgs` of PX4 1.17, `mavros_msgs` 2, and `sensor_msgs/Imu`.
//!
//! PX4 1.14 to 1.16 have no `rel_vel_ekf2_valid` in `LandingTargetPose`. It stands where theirs has padding, so
//! the bytes of all other fields are the same (`tests/harness/test_types.py`).

use serde::{Deserialize, Serialize};

use super::{Header, Pose, Quaternion, Vector3};

/// `px4_msgs/LandingTargetPose`; NED about the vehicle.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[expect(clippy::struct_excessive_bools, reason = "PX4's message has them")]
pub struct LandingTargetPose {
    /// Of the measurement, PX4's clock, µs.
    pub timestamp: u64,
    /// Whether the target stands still: EKF2 then takes the velocity for the vehicle's own.
    pub is_static: bool,
    /// Whether the position holds.
    pub rel_pos_valid: bool,
    /// Whether the velocity holds.
    pub rel_vel_valid: bool,
    /// Whether EKF2 may take the velocity for the vehicle's own.
    pub rel_vel_ekf2_valid: bool,
    /// North, m.
    pub x_rel: f32,
    /// East, m.
    pub y_rel: f32,
    /// Down, m.
    pub z_rel: f32,
    /// Of the target against the vehicle, north, m/s.
    pub vx_rel: f32,
    /// East, m/s.
    pub vy_rel: f32,
    /// Down, m/s.
    pub vz_rel: f32,
    /// Variance of the position, north, m².
    pub cov_x_rel: f32,
    /// East, m².
    pub cov_y_rel: f32,
    /// Down, m².
    pub cov_z_rel: f32,
    /// Variance of the velocity, north, (m/s)².
    pub cov_vx_rel: f32,
    /// East, (m/s)².
    pub cov_vy_rel: f32,
    /// Down, (m/s)².
    pub cov_vz_rel: f32,
    /// Whether the position against the local origin holds: never here.
    pub abs_pos_valid: bool,
    /// Not used here.
    pub x_abs: f32,
    /// Not used here.
    pub y_abs: f32,
    /// Not used here.
    pub z_abs: f32,
}

/// `px4_msgs/FiducialMarkerPosReport`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct FiducialMarkerPosReport {
    /// PX4's clock, µs.
    pub timestamp: u64,
    /// Of the image, PX4's clock, µs.
    pub timestamp_sample: u64,
    /// The target against the vehicle, in the frame that `q` turns to NED, m.
    pub rel_pos: [f32; 3],
    /// Its variances in the same frame, m².
    pub cov_rel_pos: [f32; 3],
    /// From that frame to NED: w, x, y, z.
    pub q: [f32; 4],
}

/// `px4_msgs/VehicleAttitude`, version 0.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct VehicleAttitude {
    /// PX4's clock, µs.
    pub timestamp: u64,
    /// Of the measurement, PX4's clock, µs.
    pub timestamp_sample: u64,
    /// From FRD to NED: w, x, y, z.
    pub q: [f32; 4],
    /// Of the last reset.
    pub delta_q_reset: [f32; 4],
    /// Counts resets.
    pub quat_reset_counter: u8,
}

/// `mavros_msgs/LandingTarget`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct LandingTarget {
    /// Of the measurement.
    pub header: Header,
    /// Which target.
    pub target_num: u8,
    /// `MAV_FRAME`, as `MAVLink` numbers them; the constants in `LandingTarget.msg` are off by one and more.
    pub frame: u8,
    /// Offsets from straight ahead, to the right and downwards, rad.
    pub angle: [f32; 2],
    /// m.
    pub distance: f32,
    /// Angles that the target covers, rad; 0: not known.
    pub size: [f32; 2],
    /// Pose, which MAVROS takes for ENU whatever `frame` says.
    pub pose: Pose,
    /// `LANDING_TARGET_TYPE`.
    pub r#type: u8,
}

impl LandingTarget {
    /// `MAV_FRAME_BODY_FRD`.
    pub const BODY_FRD: u8 = 12;
    /// `LANDING_TARGET_TYPE_VISION_OTHER`.
    pub const VISION_OTHER: u8 = 3;
}

/// `sensor_msgs/Imu`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Imu {
    /// Of the measurement.
    pub header: Header,
    /// From the body (FLU) to local axes (ENU).
    pub orientation: Quaternion,
    /// rad²; the first is −1 when there is no orientation.
    pub orientation_covariance: [f64; 9],
    /// rad/s.
    pub angular_velocity: Vector3,
    /// (rad/s)².
    pub angular_velocity_covariance: [f64; 9],
    /// m/s².
    pub linear_acceleration: Vector3,
    /// (m/s²)².
    pub linear_acceleration_covariance: [f64; 9],
}
