//! Messages of the ROS packages that every installation has.

use serde::{Deserialize, Serialize};
use serde_big_array::BigArray;

use super::Header;

// ---- geometry_msgs, tf2_msgs -------------------------------------------------------------------

/// `geometry_msgs/Point`, m.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Point {
    /// Along x, m.
    pub x: f64,
    /// Along y, m.
    pub y: f64,
    /// Along z, m.
    pub z: f64,
}

/// `geometry_msgs/Vector3`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Vector3 {
    /// Along x.
    pub x: f64,
    /// Along y.
    pub y: f64,
    /// Along z.
    pub z: f64,
}

/// `geometry_msgs/Quaternion`, the scalar part last.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Quaternion {
    /// Vector part, x.
    pub x: f64,
    /// Vector part, y.
    pub y: f64,
    /// Vector part, z.
    pub z: f64,
    /// Scalar part.
    pub w: f64,
}

impl Default for Quaternion {
    /// Returns the identity, as ROS does.
    fn default() -> Self {
        Self {
            x: 0.0,
            y: 0.0,
            z: 0.0,
            w: 1.0,
        }
    }
}

/// `geometry_msgs/Pose`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Pose {
    /// Position, m.
    pub position: Point,
    /// Attitude.
    pub orientation: Quaternion,
}

/// `geometry_msgs/PoseStamped`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct PoseStamped {
    /// Time and parent frame.
    pub header: Header,
    /// The pose in that frame.
    pub pose: Pose,
}

/// `geometry_msgs/PoseWithCovariance`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PoseWithCovariance {
    /// The pose.
    pub pose: Pose,
    /// Row-major 6×6: x, y, z, and rotations about the fixed x, y, z axes; m and rad.
    #[serde(with = "BigArray")]
    pub covariance: [f64; 36],
}

/// `geometry_msgs/PoseWithCovarianceStamped`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PoseWithCovarianceStamped {
    /// Time and parent frame.
    pub header: Header,
    /// The pose in that frame.
    pub pose: PoseWithCovariance,
}

/// `geometry_msgs/Twist`, in the axes that its message says.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Twist {
    /// m/s.
    pub linear: Vector3,
    /// rad/s.
    pub angular: Vector3,
}

/// `geometry_msgs/TwistWithCovariance`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TwistWithCovariance {
    /// The twist.
    pub twist: Twist,
    /// Row-major 6×6: linear, then angular; m/s and rad/s.
    #[serde(with = "BigArray")]
    pub covariance: [f64; 36],
}

/// `geometry_msgs/Transform`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Transform {
    /// The child's origin in the parent frame, m.
    pub translation: Vector3,
    /// The child's attitude in the parent frame.
    pub rotation: Quaternion,
}

/// `geometry_msgs/TransformStamped`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct TransformStamped {
    /// Time and parent frame.
    pub header: Header,
    /// The frame that the transform places in its parent.
    pub child_frame_id: String,
    /// Where and how.
    pub transform: Transform,
}

/// `tf2_msgs/TFMessage`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct TFMessage {
    /// Any number of transforms.
    pub transforms: Vec<TransformStamped>,
}

// ---- nav_msgs ----------------------------------------------------------------------------------

/// `nav_msgs/Odometry`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Odometry {
    /// Time, and the frame of the pose.
    pub header: Header,
    /// What moves, and the frame of the twist.
    pub child_frame_id: String,
    /// The child's pose in the frame of the header.
    pub pose: PoseWithCovariance,
    /// The child's twist against the frame of the header, in the axes of the child.
    pub twist: TwistWithCovariance,
}

// ---- sensor_msgs -------------------------------------------------------------------------------

/// `sensor_msgs/RegionOfInterest`, unbinned pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct RegionOfInterest {
    /// Leftmost column.
    pub x_offset: u32,
    /// Topmost row.
    pub y_offset: u32,
    /// Height, px.
    pub height: u32,
    /// Width, px.
    pub width: u32,
    /// Whether a separate rectified region is meant.
    pub do_rectify: bool,
}

/// `sensor_msgs/CameraInfo`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct CameraInfo {
    /// Time of the image and the camera's optical frame.
    pub header: Header,
    /// Image height at full resolution, px.
    pub height: u32,
    /// Image width at full resolution, px.
    pub width: u32,
    /// Name of the distortion model.
    pub distortion_model: String,
    /// Distortion coefficients in the model's order.
    pub d: Vec<f64>,
    /// Intrinsics of the raw image, row-major 3×3.
    pub k: [f64; 9],
    /// Rectification rotation, row-major 3×3.
    pub r: [f64; 9],
    /// Projection of the rectified image, row-major 3×4.
    pub p: [f64; 12],
    /// Columns combined into one; 0 means 1.
    pub binning_x: u32,
    /// Rows combined into one; 0 means 1.
    pub binning_y: u32,
    /// Part of the sensor that was read out; all zero: the whole.
    pub roi: RegionOfInterest,
}

// ---- diagnostic_msgs ---------------------------------------------------------------------------

/// `diagnostic_msgs/KeyValue`.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct KeyValue {
    /// What.
    pub key: String,
    /// Its value, as text.
    pub value: String,
}

/// `diagnostic_msgs/DiagnosticStatus`.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct DiagnosticStatus {
    /// One of the constants of this type.
    pub level: u8,
    /// `node: subtask`.
    pub name: String,
    /// Summary for people.
    pub message: String,
    /// Which device.
    pub hardware_id: String,
    /// Details.
    pub values: Vec<KeyValue>,
}

impl DiagnosticStatus {
    /// All is well.
    pub const OK: u8 = 0;
    /// Something is not as it should be.
    pub const WARN: u8 = 1;
    /// The work cannot be done.
    pub const ERROR: u8 = 2;
    /// Nothing arrives.
    pub const STALE: u8 = 3;
}

/// `diagnostic_msgs/DiagnosticArray`.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct DiagnosticArray {
    /// When the diagnostics were taken.
    pub header: Header,
    /// One for each subtask.
    pub status: Vec<DiagnosticStatus>,
}
