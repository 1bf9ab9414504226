//! One message of a recording, and the topic that it was recorded from.

use std::sync::Arc;

use super::cdr::{self, CdrError};
use crate::messages::Message;
use crate::text::quoted;

/// A topic as a recording describes it.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct RecordedTopic {
    /// Absolute name.
    pub name: String,
    /// `package/msg/Name`.
    pub type_name: String,
    /// How its messages are encoded: `cdr` by ROS 2.
    pub encoding: String,
    /// The definition of the type, if the recording has one.
    pub definition: Option<Definition>,
    /// The publishers' quality of service as rosbag2 writes it, YAML; may be empty.
    pub offered_qos: String,
}

/// The definition of a message type.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Definition {
    /// `ros2msg` or `ros2idl`.
    pub encoding: String,
    /// Text of the definition, those of its dependencies after it.
    pub text: Vec<u8>,
}

/// One message.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RecordedMessage {
    /// Where it was recorded from.
    pub topic: Arc<RecordedTopic>,
    /// When it was recorded, ns since 1970.
    pub log_time_ns: u64,
    /// When it was published, ns since 1970; the log time where a recording does not say it.
    pub publish_time_ns: u64,
    /// The message, encoded.
    pub bytes: Vec<u8>,
}

/// Why a recorded message cannot be decoded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DecodeError {
    /// The topic has another type.
    #[error("expected a message of type {expected}, got {}", quoted(got))]
    Type {
        /// That was asked for.
        expected: String,
        /// That of the topic.
        got: String,
    },
    /// Not CDR.
    #[error("expected messages encoded as \"cdr\", got {}", quoted(.0))]
    Encoding(String),
    /// The bytes.
    #[error(transparent)]
    Cdr(#[from] CdrError),
}

/// Returns the full name of a message type: `package/msg/Name`.
#[must_use]
pub fn type_name<M: Message>() -> String {
    format!("{}/msg/{}", M::PACKAGE, M::NAME)
}

/// Returns whether a full name is that of a message type.
fn is_type<M: Message>(name: &str) -> bool {
    name.strip_prefix(M::PACKAGE)
        .and_then(|rest| rest.strip_prefix("/msg/"))
        == Some(M::NAME)
}

impl RecordedTopic {
    /// Returns whether its messages can be decoded as `M`.
    ///
    /// # Errors
    /// [`DecodeError`] says what they are instead.
    pub fn check<M: Message>(&self) -> Result<(), DecodeError> {
        if !is_type::<M>(&self.type_name) {
            return Err(DecodeError::Type {
                expected: type_name::<M>(),
                got: self.type_name.clone(),
            });
        }
        if self.encoding != "cdr" {
            return Err(DecodeError::Encoding(self.encoding.clone()));
        }
        Ok(())
    }
}

impl RecordedMessage {
    /// Returns whether it was recorded from the topic with this absolute name.
    #[must_use]
    pub fn is(&self, topic: &str) -> bool {
        self.topic.name == topic
    }

    /// Returns the message.
    ///
    /// # Errors
    /// [`DecodeError`] when the topic has another type, or the bytes are no such message.
    pub fn decode<M: Message>(&self) -> Result<M, DecodeError> {
        self.topic.check::<M>()?;
        Ok(cdr::decode(&self.bytes)?)
    }
}
