//! The node's topics in the graph: publishers for its outputs, quality of service for both ends.

use ros2_client::{Publisher, WriteError};

use super::messages::Message;
use super::participant::{EndpointError, QosProfile, RosNode, reliable, sensor_data};
use super::qos_overrides::Role;
use crate::answering::output::{Output, Sink, Sinks};
use crate::answering::topics::Topic;

/// Returns a topic's name before remaps, and the quality of service of the node's end unless it is overridden.
pub(super) fn endpoint(topic: &Topic) -> (&'static str, QosProfile) {
    let qos = match topic.role {
        Role::Subscription => sensor_data(topic.depth),
        Role::Publisher => reliable(topic.depth),
    };
    (topic.name, qos)
}

struct Published<M: Message>(Publisher<M>);

impl<M: Message> Sink<M> for Published<M> {
    fn put(&mut self, message: M) -> Result<(), String> {
        self.0.publish(message).map_err(|error| match error {
            WriteError::WouldBlock { .. } => "a subscriber does not keep up".to_owned(),
            other => other.to_string(),
        })
    }
}

impl Sinks for RosNode {
    type Error = EndpointError;

    fn open<M: Message>(&mut self, topic: &Topic) -> Result<Output<M>, EndpointError> {
        let (name, qos) = endpoint(topic);
        let publisher = Published(self.publisher(name, &qos)?);
        Ok(Output::new(self.names().topic(name)?, Box::new(publisher)))
    }
}
