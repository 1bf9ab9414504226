//! The ROS messages this package speaks beside those of every node, as serde structs in the order of their `.msg` files.
//!
//! CDR carries no field names: the order of the fields here **is** the wire format, so a field is
//! never moved without its `.msg` file. Nothing is checked here: a decoded message may hold anything
//! that its bytes can say. `convert` turns messages into plain types, and the floors below check them.

use serde::{Deserialize, Serialize};

mod detectors;
mod estimator_status;
mod flight_stacks;
mod integrity;
mod receptacle_state;
mod standard;
mod visualization;

pub use detectors::*;
pub use estimator_status::EstimatorStatus;
pub use flight_stacks::*;
pub use integrity::{Integrity, IntegrityPoint};
pub use receptacle_state::ReceptacleState;
pub use ros2_node::messages::*;
pub use standard::*;
pub use visualization::*;

/// `tanker_pose/FeaturePoint`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct FeaturePoint {
    /// Marker id in the tanker's marker map.
    pub id: u32,
    /// Column of the detected centre, px; the centre of the top-left pixel is (0, 0).
    pub u: f64,
    /// Row of the detected centre, px.
    pub v: f64,
    /// Standard deviation of column and of row, px; 0: not known.
    pub sigma: f64,
}

/// `tanker_pose/FeaturePointArray`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct FeaturePointArray {
    /// Time of the image and the camera's optical frame.
    pub header: Header,
    /// The detections of one image.
    pub points: Vec<FeaturePoint>,
}

ros2_node::ros_message!(
    "geometry_msgs" / PoseStamped,
    "geometry_msgs" / PoseWithCovarianceStamped,
    "nav_msgs" / Odometry,
    "sensor_msgs" / CameraInfo,
    "tf2_msgs" / TFMessage,
    "diagnostic_msgs" / DiagnosticArray,
    "visualization_msgs" / MarkerArray,
    "vision_msgs" / Detection2DArray,
    "apriltag_msgs" / AprilTagDetectionArray,
    "tanker_pose" / FeaturePointArray,
    "tanker_pose" / EstimatorStatus,
    "tanker_pose" / Integrity,
    "tanker_pose" / ReceptacleState,
    "sensor_msgs" / Imu,
    "px4_msgs" / LandingTargetPose,
    "px4_msgs" / FiducialMarkerPosReport,
    "px4_msgs" / VehicleAttitude,
    "mavros_msgs" / LandingTarget,
);
