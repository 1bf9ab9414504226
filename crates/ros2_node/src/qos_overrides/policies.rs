//! The policies of a topic's quality of service that can be overridden, as plain values.

use std::time::Duration;

/// How the samples of a topic are sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Policies {
    /// Lost samples are repeated; else best effort.
    pub reliable: bool,
    /// Late subscribers get earlier samples; else volatile.
    pub transient_local: bool,
    /// All samples are kept; else the last `depth`.
    pub keep_all: bool,
    /// Samples that are kept unless all are.
    pub depth: usize,
    /// Longest time between samples, if there is a limit.
    pub deadline: Option<Duration>,
}

impl Policies {
    /// Returns those of inputs: best effort, volatile, the last `depth` samples.
    #[must_use]
    pub const fn sensor_data(depth: usize) -> Self {
        Self {
            reliable: false,
            transient_local: false,
            keep_all: false,
            depth,
            deadline: None,
        }
    }

    /// Returns those of outputs: reliable, volatile, the last `depth` samples.
    #[must_use]
    pub const fn reliable(depth: usize) -> Self {
        Self {
            reliable: true,
            ..Self::sensor_data(depth)
        }
    }
}

#[cfg(feature = "client")]
mod client {
    use ros2_client::QosProfile;
    use ros2_client::qos::{Durability, History, Reliability, WhenFull};

    use super::Policies;

    impl From<&QosProfile> for Policies {
        fn from(qos: &QosProfile) -> Self {
            let depth = match qos.history {
                History::KeepLast { depth } => Some(depth),
                History::KeepAll => None,
            };
            Self {
                reliable: matches!(qos.reliability, Reliability::Reliable { .. }),
                transient_local: matches!(qos.durability, Durability::TransientLocal),
                keep_all: depth.is_none(),
                depth: depth.unwrap_or(1),
                deadline: qos.deadline,
            }
        }
    }

    impl Policies {
        /// Returns a profile with these policies, and the others of `default`.
        #[must_use]
        pub fn over(&self, default: &QosProfile) -> QosProfile {
            let mut qos = default.clone();
            if self.reliable != matches!(qos.reliability, Reliability::Reliable { .. }) {
                // A full window never makes the node wait.
                let when_full = WhenFull::Fail;
                qos.reliability = if self.reliable {
                    Reliability::Reliable { when_full }
                } else {
                    Reliability::BestEffort
                };
            }
            qos.durability = if self.transient_local {
                Durability::TransientLocal
            } else {
                Durability::Volatile
            };
            qos.history = if self.keep_all {
                History::KeepAll
            } else {
                History::KeepLast { depth: self.depth }
            };
            qos.deadline = self.deadline;
            qos
        }
    }
}
