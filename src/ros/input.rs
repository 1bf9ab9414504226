//! The subscription to the input: one topic, of one of three types.

use std::pin::Pin;

use futures::StreamExt;
use futures::stream::FusedStream;
use ros2_client::{ReadError, Subscription};

use super::messages::{AprilTagDetectionArray, Detection2DArray, FeaturePointArray};
use super::output::endpoint;
use super::participant::{EndpointError, RosNode};
pub use crate::answering::input::{InputMessage, InputReader, Sighting};
use crate::config::Input;

/// The topic that detections come from.
pub enum InputSubscription {
    /// `tanker_pose/FeaturePointArray`.
    FeaturePoints(Subscription<FeaturePointArray>),
    /// `vision_msgs/Detection2DArray`.
    Detections(Subscription<Detection2DArray>),
    /// `apriltag_msgs/AprilTagDetectionArray`.
    AprilTags(Subscription<AprilTagDetectionArray>),
}

/// The messages of an input, in order.
pub type InputStream<'a> = Pin<Box<dyn FusedStream<Item = Result<InputMessage, ReadError>> + 'a>>;

impl InputSubscription {
    /// Returns the subscription to the input's topic.
    ///
    /// # Errors
    /// [`EndpointError`] when the name is malformed or the middleware refuses.
    pub fn open(ros: &mut RosNode, input: Input) -> Result<Self, EndpointError> {
        let (name, qos) = endpoint(&input.topic());
        Ok(match input {
            Input::FeaturePoints => Self::FeaturePoints(ros.subscription(name, &qos)?),
            Input::Detections => Self::Detections(ros.subscription(name, &qos)?),
            Input::AprilTags => Self::AprilTags(ros.subscription(name, &qos)?),
        })
    }

    /// Returns its messages.
    #[must_use]
    pub fn stream(&self) -> InputStream<'_> {
        match self {
            Self::FeaturePoints(subscription) => {
                let samples = subscription.async_stream();
                Box::pin(samples.map(|sample| Ok(InputMessage::FeaturePoints(sample?.0))))
            }
            Self::Detections(subscription) => {
                let samples = subscription.async_stream();
                Box::pin(samples.map(|sample| Ok(InputMessage::Detections(sample?.0))))
            }
            Self::AprilTags(subscription) => {
                let samples = subscription.async_stream();
                Box::pin(samples.map(|sample| Ok(InputMessage::AprilTags(sample?.0))))
            }
        }
    }
}
