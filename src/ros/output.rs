//! One topic that the node publishes on.

use ros2_client::{Publisher, WriteError};

use super::diagnostics::Tally;
use super::messages::Message;
use super::participant::{EndpointError, RosNode};
use super::topics::Topic;
use crate::config::Configuration;

/// A topic that never makes the node wait: what a slow subscriber has no room for is dropped and
/// counted.
pub struct Output<M: Message> {
    publisher: Publisher<M>,
    topic: String,
}

impl<M: Message> Output<M> {
    /// Returns the output to a topic, opened.
    ///
    /// # Errors
    /// [`EndpointError`] when the name is malformed or the middleware refuses.
    pub fn open(ros: &mut RosNode, topic: &Topic) -> Result<Self, EndpointError> {
        Ok(Self {
            publisher: ros.publisher(topic.name, &topic.qos)?,
            topic: ros.names().topic(topic.name)?,
        })
    }

    /// Returns the output to a topic if the configuration opens that.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub fn open_if_wanted(
        ros: &mut RosNode,
        topic: &Topic,
        configuration: &Configuration,
    ) -> Result<Option<Self>, EndpointError> {
        let is_open = topic.is_open(configuration);
        is_open.then(|| Self::open(ros, topic)).transpose()
    }

    pub(super) fn publish(&mut self, message: M, tally: &mut Tally) {
        if let Err(error) = self.publisher.publish(message) {
            let reason = match error {
                WriteError::WouldBlock { .. } => "a subscriber does not keep up".to_owned(),
                other => other.to_string(),
            };
            tally.drop_one(&self.topic, reason);
        }
    }
}
