//! One output, how often it was published, and why it was not.

use std::time::Instant;

use super::frame::Frame;
use super::silence::Silence;
use crate::answering::diagnostics::Tally;
use crate::answering::output::{Output, Sinks};
use crate::answering::topics::Topic;
use crate::config::Configuration;
use crate::messages::{KeyValue, Message};
use ros2_node::once::SaidOnce;

/// An output of whatever message.
pub(super) trait GatedOutput {
    /// Publishes the message for a frame, or records why there is none.
    fn publish(&mut self, frame: &Result<Frame, Silence>, tally: &mut Tally, now: Instant);

    /// Forgets counts and reasons.
    fn reset(&mut self);

    /// Returns counts, and why the output was last held back since the last report.
    fn report(&mut self, values: &mut Vec<KeyValue>) -> Option<String>;
}

/// Returns the output to a topic, opened, if the configuration opens that; `message` makes its message of a frame.
pub(super) fn open<M: Message, S: Sinks>(
    sinks: &mut S,
    topic: &Topic,
    configuration: &Configuration,
    message: fn(&Frame) -> Result<M, Silence>,
) -> Result<Option<Box<dyn GatedOutput>>, S::Error> {
    let output = sinks.open_if_wanted(topic, configuration)?;
    Ok(output.map(|output| -> Box<dyn GatedOutput> {
        Box::new(Gated {
            output,
            message,
            name: topic.name,
            published: 0,
            silent: 0,
            reason: None,
            log_gate: SaidOnce::default(),
        })
    }))
}

/// An output with the counts of its frames.
struct Gated<M: Message> {
    output: Output<M>,
    message: fn(&Frame) -> Result<M, Silence>,
    name: &'static str,
    published: u64,
    silent: u64,
    reason: Option<String>,
    log_gate: SaidOnce<()>,
}

impl<M: Message> GatedOutput for Gated<M> {
    fn publish(&mut self, frame: &Result<Frame, Silence>, tally: &mut Tally, now: Instant) {
        let message = match frame {
            Ok(frame) => (self.message)(frame),
            Err(silence) => Err(*silence),
        };
        match message {
            Ok(message) => {
                self.published += 1;
                self.output.publish(message, tally);
                if let Some(count) = self.log_gate.good() {
                    log::info!(
                        "{} published again after {count} frames without it",
                        self.name
                    );
                }
            }
            Err(silence) => {
                self.silent += 1;
                let reason = silence.to_string();
                if self.log_gate.fault((), now) {
                    log::warn!("no {}: {reason}", self.name);
                }
                self.reason = Some(reason);
            }
        }
    }

    fn reset(&mut self) {
        self.published = 0;
        self.silent = 0;
        self.reason = None;
        self.log_gate = SaidOnce::default();
    }

    fn report(&mut self, values: &mut Vec<KeyValue>) -> Option<String> {
        for (what, count) in [("published", self.published), ("silent", self.silent)] {
            values.push(KeyValue {
                key: format!("{}.{what}", self.name),
                value: count.to_string(),
            });
        }
        let name = self.name;
        self.reason
            .take()
            .map(|reason| format!("no {name}: {reason}"))
    }
}
