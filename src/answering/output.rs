//! One topic that the node publishes on, wherever its messages go.

use super::diagnostics::Tally;
use super::topics::Topic;
use crate::config::Configuration;
use crate::messages::Message;

/// Where the messages of one topic go.
pub trait Sink<M: Message> {
    /// Takes a message; never waits.
    ///
    /// # Errors
    /// Why the message is dropped.
    fn put(&mut self, message: M) -> Result<(), String>;
}

/// What opens topics: a middleware, or a recording.
pub trait Sinks {
    /// Why a topic cannot be opened.
    type Error;

    /// Returns the output to a topic, opened.
    ///
    /// # Errors
    /// When it cannot be opened.
    fn open<M: Message>(&mut self, topic: &Topic) -> Result<Output<M>, Self::Error>;

    /// Returns the output to a topic if the configuration opens that.
    ///
    /// # Errors
    /// As [`Self::open`].
    fn open_if_wanted<M: Message>(
        &mut self,
        topic: &Topic,
        configuration: &Configuration,
    ) -> Result<Option<Output<M>>, Self::Error> {
        let is_open = topic.is_open(configuration);
        is_open.then(|| self.open(topic)).transpose()
    }
}

/// A topic that never makes the node wait: what a slow subscriber has no room for is dropped and
/// counted.
pub struct Output<M: Message> {
    sink: Box<dyn Sink<M>>,
    topic: String,
}

impl<M: Message> Output<M> {
    /// Returns the output to the topic with this absolute name.
    #[must_use]
    pub fn new(topic: String, sink: Box<dyn Sink<M>>) -> Self {
        Self { sink, topic }
    }

    pub(super) fn publish(&mut self, message: M, tally: &mut Tally) {
        if let Err(reason) = self.sink.put(message) {
            tally.drop_one(&self.topic, reason);
        }
    }
}
