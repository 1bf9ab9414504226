//! The subscriptions to one node's topics, which may be renamed and may come later than the node.

use std::collections::BTreeSet;
use std::time::Instant;

use tanker_pose::ros::messages::{
    DiagnosticArray, EstimatorStatus, Message, Odometry, PoseWithCovarianceStamped,
};
use tanker_pose::ros::names::NamesError;
use tanker_pose::ros::participant::{
    EndpointError, QosProfile, RosNode, Subscription, sensor_data,
};
use tanker_pose::ros::running_nodes::{ParticipantId, RunningNode, id};
use tanker_pose::ros::topics::{ODOMETRY, POSE, STATUS};

use super::heard::Heard;

/// Best effort: a reliable subscriber that is blocked would in the end cost the other ones messages.
const OUTPUTS: QosProfile = sensor_data(100);
const DIAGNOSTICS: &str = "/diagnostics";

/// One topic of the node.
struct Ear<M: Message> {
    wanted: String,
    open: Option<(String, Subscription<M>)>,
}

impl<M: Message> Ear<M> {
    fn new(ros: &RosNode, topic: &str) -> Result<Self, NamesError> {
        Ok(Self {
            wanted: ros.names().topic(topic)?,
            open: None,
        })
    }

    fn attend(&mut self, ros: &mut RosNode, topic: Option<&str>) -> Result<(), EndpointError> {
        let current = self.open.as_ref().map(|(topic, _)| topic.as_str());
        // A topic that is gone may return: subscriptions stay open.
        if let Some(topic) = topic
            && current != Some(topic)
        {
            self.open = None;
            self.open = Some((topic.to_owned(), ros.subscription(topic, &OUTPUTS)?));
        }
        Ok(())
    }

    /// Delivers all messages from these processes.
    fn drain(&self, from: &BTreeSet<ParticipantId>, mut hear: impl FnMut(M)) {
        let Some((topic, subscription)) = &self.open else {
            return;
        };
        loop {
            match subscription.take() {
                Ok(Some((message, info))) => {
                    if from.contains(&id(info.publisher_gid().as_bytes())) {
                        hear(message);
                    }
                }
                Ok(None) => return,
                Err(error) => {
                    log::warn!("cannot decode a message of {topic}: {error}");
                    return;
                }
            }
        }
    }

    fn topic(&self) -> Option<&str> {
        self.open.as_ref().map(|(topic, _)| topic.as_str())
    }
}

/// The node's topics that are watched.
pub struct Ears {
    pose: Ear<PoseWithCovarianceStamped>,
    status: Ear<EstimatorStatus>,
    odometry: Ear<Odometry>,
    diagnostics: Ear<DiagnosticArray>,
}

impl Ears {
    /// Returns a set without subscriptions.
    pub fn new(ros: &RosNode) -> Result<Self, NamesError> {
        Ok(Self {
            pose: Ear::new(ros, POSE.name)?,
            status: Ear::new(ros, STATUS.name)?,
            odometry: Ear::new(ros, ODOMETRY.name)?,
            diagnostics: Ear::new(ros, DIAGNOSTICS)?,
        })
    }

    /// Subscribes to what the node publishes by now.
    pub fn attend(&mut self, ros: &mut RosNode, node: &RunningNode) -> Result<(), EndpointError> {
        let topic = node.topic::<PoseWithCovarianceStamped>(&self.pose.wanted);
        self.pose.attend(ros, topic)?;
        self.status.attend(ros, Some(&node.known_by))?;
        let topic = node.topic::<Odometry>(&self.odometry.wanted);
        self.odometry.attend(ros, topic)?;
        let topic = node.topic::<DiagnosticArray>(&self.diagnostics.wanted);
        self.diagnostics.attend(ros, topic)
    }

    /// Enters the messages of these processes.
    pub fn drain(&self, from: &BTreeSet<ParticipantId>, heard: &mut Heard, now: Instant) {
        // A pose is published before its status: in this order both are there when the outcome is looked at.
        self.pose
            .drain(from, |message| heard.on_pose(&message, now));
        self.status
            .drain(from, |message| heard.on_status(message, now));
        self.odometry
            .drain(from, |message| heard.on_odometry(&message, now));
        self.diagnostics
            .drain(from, |message| heard.on_diagnostics(message, now));
    }

    /// Returns the topics that are listened to.
    pub fn topics(&self) -> Vec<&str> {
        let all = [
            self.pose.topic(),
            self.status.topic(),
            self.odometry.topic(),
            self.diagnostics.topic(),
        ];
        all.into_iter().flatten().collect()
    }
}
