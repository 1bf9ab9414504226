//! What detectors of others publish: `vision_msgs` 4 and `apriltag_msgs` 2, as ROS 2 Jazzy and Kilted have them.

use serde::{Deserialize, Serialize};

use super::{Header, PoseWithCovariance};

// ---- vision_msgs -------------------------------------------------------------------------------

/// `vision_msgs/Point2D` and `apriltag_msgs/Point`, px.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Point2D {
    /// Column.
    pub x: f64,
    /// Row.
    pub y: f64,
}

/// `vision_msgs/Pose2D`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Pose2D {
    /// Place in the image, px.
    pub position: Point2D,
    /// Rotation in the image, rad.
    pub theta: f64,
}

/// `vision_msgs/BoundingBox2D`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct BoundingBox2D {
    /// Its centre.
    pub center: Pose2D,
    /// Width, px.
    pub size_x: f64,
    /// Height, px.
    pub size_y: f64,
}

/// `vision_msgs/ObjectHypothesis`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct ObjectHypothesis {
    /// Its allowed values.
    pub class_id: String,
    /// How sure the detector is.
    pub score: f64,
}

/// `vision_msgs/ObjectHypothesisWithPose`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ObjectHypothesisWithPose {
    /// Its allowed values.
    pub hypothesis: ObjectHypothesis,
    /// Where it would be.
    pub pose: PoseWithCovariance,
}

/// `vision_msgs/Detection2D`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Detection2D {
    /// Of the image; often left empty.
    pub header: Header,
    /// Its allowed values.
    pub results: Vec<ObjectHypothesisWithPose>,
    /// Where it is in the image.
    pub bbox: BoundingBox2D,
    /// Which one it is.
    pub id: String,
}

/// `vision_msgs/Detection2DArray`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Detection2DArray {
    /// Time of the image and the camera's optical frame.
    pub header: Header,
    /// The detections of one image.
    pub detections: Vec<Detection2D>,
}

// ---- apriltag_msgs -----------------------------------------------------------------------------

/// `apriltag_msgs/AprilTagDetection`; (0, 0) is the **corner** of the top-left pixel.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct AprilTagDetection {
    /// Name of the family, such as `tag36h11`.
    pub family: String,
    /// Id in that family.
    pub id: i32,
    /// Bits of the code that had to be corrected.
    pub hamming: i32,
    /// Not used any more.
    pub goodness: f32,
    /// Contrast of the code's bits; small: perhaps no tag.
    pub decision_margin: f32,
    /// Where its diagonals meet, px.
    pub centre: Point2D,
    /// Bottom left, bottom right, top right, top left of the upright tag, px.
    pub corners: [Point2D; 4],
    /// From the tag's square (-1 to 1) to pixels, row-major.
    pub homography: [f64; 9],
}

/// `apriltag_msgs/AprilTagDetectionArray`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct AprilTagDetectionArray {
    /// Time of the image and the camera's optical frame.
    pub header: Header,
    /// The tags of one image.
    pub detections: Vec<AprilTagDetection>,
}
