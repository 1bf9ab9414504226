//! Where the answers go: topics of a recording, each message at the time of the one that it answers.

use std::cell::{Cell, RefCell};
use std::rc::Rc;

use ros2_node::names::{NamesError, NodeNames};

use super::ReplayError;
use crate::answering::output::{Output, Sink, Sinks};
use crate::answering::topics::Topic;
use crate::messages::Message;
use crate::recording::{Channel, RecordedTopic, WriteBehind, WriteError, cdr, type_name};

/// A recording that several topics write to.
#[derive(Clone)]
pub(super) struct Shared {
    writer: Rc<RefCell<WriteBehind>>,
    /// Log time of what is written now.
    pub(super) time_ns: Rc<Cell<u64>>,
    /// Why nothing more could be written.
    failure: Rc<RefCell<Option<WriteError>>>,
}

impl Shared {
    pub(super) fn new(writer: WriteBehind) -> Self {
        Self {
            writer: Rc::new(RefCell::new(writer)),
            time_ns: Rc::default(),
            failure: Rc::default(),
        }
    }

    pub(super) fn channel(&self, topic: &RecordedTopic) -> Result<Channel, WriteError> {
        self.writer.borrow_mut().channel(topic)
    }

    pub(super) fn write(
        &self,
        channel: Channel,
        publish_time_ns: u64,
        bytes: &[u8],
    ) -> Result<(), WriteError> {
        let time_ns = self.time_ns.get();
        self.writer
            .borrow_mut()
            .write(channel, time_ns, publish_time_ns, bytes)
    }

    /// Returns why an answer could not be written, if one could not.
    pub(super) fn check(&self) -> Result<(), WriteError> {
        self.failure.borrow_mut().take().map_or(Ok(()), Err)
    }

    /// Completes the recording; the outputs that write to it have to be gone.
    pub(super) fn finish(self) -> Result<(), WriteError> {
        self.check()?;
        let writer = Rc::into_inner(self.writer);
        writer.map_or(Ok(()), |writer| writer.into_inner().finish())
    }
}

/// Opens topics of a recording under the node's names.
pub(super) struct RecordingSinks<'a> {
    pub(super) shared: Shared,
    pub(super) names: &'a NodeNames,
    /// Absolute names of the topics that are open.
    pub(super) opened: Vec<String>,
}

impl Sinks for RecordingSinks<'_> {
    type Error = ReplayError;

    fn open<M: Message>(&mut self, topic: &Topic) -> Result<Output<M>, ReplayError> {
        let name: Result<String, NamesError> = self.names.topic(topic.name);
        let name = name?;
        let channel = self.shared.channel(&RecordedTopic {
            name: name.clone(),
            type_name: type_name::<M>(),
            encoding: "cdr".to_owned(),
            ..RecordedTopic::default()
        })?;
        self.opened.push(name.clone());
        let shared = self.shared.clone();
        Ok(Output::new(name, Box::new(Written { shared, channel })))
    }
}

struct Written {
    shared: Shared,
    channel: Channel,
}

impl<M: Message> Sink<M> for Written {
    fn put(&mut self, message: M) -> Result<(), String> {
        let bytes = cdr::encode(&message).map_err(|error| error.to_string())?;
        let time_ns = self.shared.time_ns.get();
        let written = self.shared.write(self.channel, time_ns, &bytes);
        written.map_err(|error| {
            let words = error.to_string();
            self.shared.failure.borrow_mut().get_or_insert(error);
            words
        })
    }
}
