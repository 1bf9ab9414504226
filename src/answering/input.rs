//! The input: one topic, of one of three types, and how its messages are read.

use std::sync::Arc;

use crate::config::Input;
use crate::convert;
use crate::messages::{AprilTagDetectionArray, Detection2DArray, FeaturePointArray, Header};
use crate::pipeline::{Detection, Refusal};
use crate::target::MarkerMap;

/// The detections of an image, as one of the detectors publishes them.
#[derive(Debug)]
pub enum InputMessage {
    /// `tanker_pose/FeaturePointArray`.
    FeaturePoints(FeaturePointArray),
    /// `vision_msgs/Detection2DArray`.
    Detections(Detection2DArray),
    /// `apriltag_msgs/AprilTagDetectionArray`.
    AprilTags(AprilTagDetectionArray),
}

impl InputMessage {
    /// Returns the time of the image and the camera's optical frame.
    #[must_use]
    pub const fn header(&self) -> &Header {
        match self {
            Self::FeaturePoints(message) => &message.header,
            Self::Detections(message) => &message.header,
            Self::AprilTags(message) => &message.header,
        }
    }
}

/// The content of one message.
#[derive(Debug, Clone, PartialEq)]
pub struct Sighting {
    /// Time of the image and the camera's optical frame.
    pub header: Header,
    /// The detections, unchecked, or why they cannot be read.
    pub detections: Result<Vec<Detection>, Refusal>,
    /// Ids of points that were left out before any estimate.
    pub ignored_ids: Vec<u32>,
}

/// Reads the messages of an input.
pub struct InputReader {
    /// Which input.
    pub input: Input,
    /// The map that tells which tags have corners.
    pub map: Arc<MarkerMap>,
    /// Tags with more corrected bits than this are left out.
    pub max_hamming: i32,
}

impl InputReader {
    /// Returns the content of a message.
    #[must_use]
    pub fn read(&self, message: InputMessage) -> Sighting {
        let (header, detections, ignored_ids) = match message {
            InputMessage::FeaturePoints(message) => {
                let detections = convert::detections(&message);
                (message.header, Ok(detections), Vec::new())
            }
            InputMessage::Detections(message) => {
                let detections = convert::vision_detections(&message);
                (message.header, detections, Vec::new())
            }
            InputMessage::AprilTags(message) => {
                match convert::tag_detections(&message, &self.map, self.max_hamming) {
                    Ok(tags) => (message.header, Ok(tags.detections), tags.ignored_ids),
                    Err(refusal) => (message.header, Err(refusal), Vec::new()),
                }
            }
        };
        Sighting {
            header,
            detections,
            ignored_ids,
        }
    }
}
