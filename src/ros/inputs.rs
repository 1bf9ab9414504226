//! All topics that the node listens to, with the most samples of each that may wait.

use super::attitude::AttitudeSubscription;
use super::input::InputSubscription;
use super::messages::CameraInfo;
use super::output::endpoint;
use super::participant::{EndpointError, RosNode, Subscription};
use super::topics::{self, Topic};
use crate::config::Configuration;

/// The topics that the node listens to.
pub(super) struct Inputs {
    pub(super) detections: InputSubscription,
    pub(super) camera_info: Subscription<CameraInfo>,
    pub(super) attitude: AttitudeSubscription,
    pub(super) tanker_attitude: AttitudeSubscription,
    /// That of the detections.
    pub(super) topic: &'static str,
    pub(super) depths: Depths,
}

/// Most samples that may wait, by topic.
pub(super) struct Depths {
    pub(super) detections: usize,
    pub(super) camera_info: usize,
    pub(super) attitude: usize,
    pub(super) tanker_attitude: usize,
}

impl Inputs {
    /// Returns the topics of a configuration, opened.
    pub(super) fn open(
        ros: &mut RosNode,
        configuration: &Configuration,
    ) -> Result<Self, EndpointError> {
        let camera_info = topics::CAMERA_INFO;
        let detections = configuration.input.topic();
        let attitude = configuration.consumers.attitude;
        let tanker_attitude = topics::TANKER_ATTITUDE;
        let depth = |topic: &Topic| {
            let (name, qos) = endpoint(topic);
            ros.subscription_depth(name, &qos)
        };
        let depths = Depths {
            detections: depth(&detections)?,
            camera_info: depth(&camera_info)?,
            attitude: attitude.map_or(Ok(1), |source| depth(&source.topic()))?,
            tanker_attitude: depth(&tanker_attitude)?,
        };
        Ok(Self {
            camera_info: {
                let (name, qos) = endpoint(&camera_info);
                ros.subscription(name, &qos)?
            },
            attitude: AttitudeSubscription::open(ros, attitude)?,
            tanker_attitude: AttitudeSubscription::open_tanker(
                ros,
                tanker_attitude.is_open(configuration),
            )?,
            detections: InputSubscription::open(ros, configuration.input)?,
            topic: detections.name,
            depths,
        })
    }
}
