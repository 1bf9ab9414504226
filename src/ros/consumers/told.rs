//! One output, how often it spoke, and why it did not.

use std::time::Instant;

use super::QOS;
use crate::frames::AttitudeError;
use crate::ros::convert::FlightStackError;
use crate::ros::diagnostics::Tally;
use crate::ros::estimator::Output;
use crate::ros::health::Unexpected;
use crate::ros::messages::{KeyValue, Message};
use crate::ros::once::SaidOnce;
use crate::ros::participant::{EndpointError, RosNode};

/// Why an output said nothing to a frame.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub(super) enum Silence {
    #[error(transparent)]
    Attitude(#[from] AttitudeError),
    #[error(transparent)]
    FlightStack(#[from] FlightStackError),
    #[error(
        "the track is not confirmed yet, or this frame did not fit it: it needs a few consistent frames"
    )]
    NoTrack,
    #[error("the covariance of the position gives no probability")]
    NoProbability,
    #[error("{0}: see unexpected_attitude")]
    UnexpectedAttitude(Unexpected),
}

impl From<Unexpected> for Silence {
    fn from(unexpected: Unexpected) -> Self {
        Self::UnexpectedAttitude(unexpected)
    }
}

/// An output with what became of its frames.
pub(super) struct Told<M: Message> {
    output: Output<M>,
    name: &'static str,
    published: u64,
    silent: u64,
    reason: Option<String>,
    said: SaidOnce<()>,
}

impl<M: Message> Told<M> {
    pub(super) fn open(
        ros: &mut RosNode,
        on: bool,
        name: &'static str,
    ) -> Result<Option<Self>, EndpointError> {
        if !on {
            return Ok(None);
        }
        let output = Output::new(ros.publisher(name, &QOS)?, ros.names().topic(name)?);
        Ok(Some(Self {
            output,
            name,
            published: 0,
            silent: 0,
            reason: None,
            said: SaidOnce::default(),
        }))
    }

    /// Forgets counts and reasons.
    pub(super) fn begin_anew(&mut self) {
        self.published = 0;
        self.silent = 0;
        self.reason = None;
        self.said = SaidOnce::default();
    }

    pub(super) fn tell(&mut self, message: Result<M, Silence>, tally: &mut Tally) {
        match message {
            Ok(message) => {
                self.published += 1;
                self.output.publish(message, tally);
                if let Some(count) = self.said.good() {
                    log::info!("{} again after {count} frames without it", self.name);
                }
            }
            Err(silence) => {
                self.silent += 1;
                let reason = silence.to_string();
                if self.said.fault((), Instant::now()) {
                    log::warn!("no {}: {reason}", self.name);
                }
                self.reason = Some(reason);
            }
        }
    }

    /// Returns counts, and the reason of the last silence since the last report.
    pub(super) fn report(&mut self, values: &mut Vec<KeyValue>) -> Option<String> {
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
