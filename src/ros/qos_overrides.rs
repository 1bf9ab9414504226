//! Quality of service by parameters, under the names that all of ROS has for it:
//! `qos_overrides./pose.publisher.reliability`.

use std::time::Duration;

use ros2_client::qos::{Durability, History, Reliability, WhenFull};

use super::participant::QosProfile;
use crate::config::{Kind, ParameterValue};
use crate::text::clip;

/// What the names of all these parameters begin with.
pub const PREFIX: &str = "qos_overrides.";
/// Most samples that a topic may keep.
const DEEPEST: i64 = 10_000;
/// Longest deadline that the wire holds, ns.
const LONGEST_NS: i64 = i32::MAX as i64 * 1_000_000_000;

/// Which end of a topic the node is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// It listens.
    Subscription,
    /// It speaks.
    Publisher,
}

impl Role {
    const fn name(self) -> &'static str {
        match self {
            Self::Subscription => "subscription",
            Self::Publisher => "publisher",
        }
    }
}

/// One policy that can be overridden.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Policy {
    Reliability,
    Durability,
    History,
    Depth,
    Deadline,
}

impl Policy {
    const ALL: [Self; 5] = [
        Self::Reliability,
        Self::Durability,
        Self::History,
        Self::Depth,
        Self::Deadline,
    ];

    const fn name(self) -> &'static str {
        match self {
            Self::Reliability => "reliability",
            Self::Durability => "durability",
            Self::History => "history",
            Self::Depth => "depth",
            Self::Deadline => "deadline",
        }
    }

    /// What the policy may be. The defaults do not count: they are each topic's own.
    const fn kind(self) -> Kind {
        const fn choice(allowed: &'static [&'static str]) -> Kind {
            Kind::Choice {
                default: "",
                allowed,
            }
        }
        const fn integer(min: i64, max: i64) -> Kind {
            Kind::Integer {
                default: min,
                min,
                max,
            }
        }
        match self {
            Self::Reliability => choice(&["reliable", "best_effort"]),
            Self::Durability => choice(&["volatile", "transient_local"]),
            Self::History => choice(&["keep_last", "keep_all"]),
            Self::Depth => integer(1, DEEPEST),
            Self::Deadline => integer(0, LONGEST_NS),
        }
    }

    const fn description(self) -> &'static str {
        match self {
            Self::Reliability => "whether lost samples are repeated",
            Self::Durability => "whether late subscribers get earlier samples",
            Self::History => "how many samples are kept",
            Self::Depth => "samples that keep_last keeps",
            Self::Deadline => "ns, longest time between samples; 0: none",
        }
    }
}

/// One end of one topic, with the quality of service that it opens with.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Endpoint {
    topic: String,
    role: Role,
    qos: QosProfile,
    // Survives a history that does not need it.
    depth: i64,
}

impl Endpoint {
    /// Returns the end of the topic with this absolute name, and what holds unless it is overridden.
    #[must_use]
    pub fn new(topic: String, role: Role, qos: &QosProfile) -> Self {
        let depth = match qos.history {
            History::KeepLast { depth } => i64::try_from(depth).unwrap_or(DEEPEST),
            History::KeepAll => 1,
        };
        Self {
            topic,
            role,
            qos: qos.clone(),
            depth,
        }
    }

    fn name_of(&self, policy: Policy) -> String {
        format!(
            "{PREFIX}{}.{}.{}",
            self.topic,
            self.role.name(),
            policy.name()
        )
    }

    fn get(&self, policy: Policy) -> ParameterValue {
        let text = |text: &str| ParameterValue::String(text.to_owned());
        match policy {
            Policy::Reliability => text(match self.qos.reliability {
                Reliability::BestEffort => "best_effort",
                Reliability::Reliable { .. } => "reliable",
            }),
            Policy::Durability => text(match self.qos.durability {
                Durability::Volatile => "volatile",
                Durability::TransientLocal => "transient_local",
            }),
            Policy::History => text(match self.qos.history {
                History::KeepLast { .. } => "keep_last",
                History::KeepAll => "keep_all",
            }),
            Policy::Depth => ParameterValue::Integer(self.depth),
            Policy::Deadline => ParameterValue::Integer(self.qos.deadline.map_or(0, |deadline| {
                i64::try_from(deadline.as_nanos()).unwrap_or(LONGEST_NS)
            })),
        }
    }

    /// Sets a policy; false when the value is not among those that it can have.
    fn set(&mut self, policy: Policy, value: &ParameterValue) -> bool {
        let allowed = match (policy.kind(), value) {
            (Kind::Choice { allowed, .. }, ParameterValue::String(word)) => {
                allowed.contains(&word.as_str())
            }
            (Kind::Integer { min, max, .. }, ParameterValue::Integer(number)) => {
                (min..=max).contains(number)
            }
            _ => false,
        };
        if !allowed {
            return false;
        }
        match (policy, value) {
            (Policy::Reliability, ParameterValue::String(word)) => {
                // A full window never makes the node wait.
                let when_full = WhenFull::Fail;
                self.qos.reliability = if word == "reliable" {
                    Reliability::Reliable { when_full }
                } else {
                    Reliability::BestEffort
                };
            }
            (Policy::Durability, ParameterValue::String(word)) => {
                self.qos.durability = if word == "transient_local" {
                    Durability::TransientLocal
                } else {
                    Durability::Volatile
                };
            }
            (Policy::History, ParameterValue::String(word)) => {
                self.qos.history = if word == "keep_all" {
                    History::KeepAll
                } else {
                    self.keep_last()
                };
            }
            (Policy::Depth, ParameterValue::Integer(depth)) => {
                self.depth = *depth;
                if self.qos.history != History::KeepAll {
                    self.qos.history = self.keep_last();
                }
            }
            (_, ParameterValue::Integer(deadline)) => {
                let deadline = u64::try_from(*deadline).ok().filter(|ns| *ns > 0);
                self.qos.deadline = deadline.map(Duration::from_nanos);
            }
            _ => return false,
        }
        true
    }

    fn keep_last(&self) -> History {
        History::KeepLast {
            depth: usize::try_from(self.depth).unwrap_or(1),
        }
    }
}

/// Why an override cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum QosOverrideError {
    /// A name that no parameter of the topic has.
    #[error(
        "unknown parameter {:?}: the node can override {prefix} reliability, durability, history, depth, deadline",
        clip(name)
    )]
    Policy {
        /// As it was written.
        name: String,
        /// What the names of this topic begin with.
        prefix: String,
    },
    /// A value that the policy cannot have.
    #[error("parameter {name:?} must be {expected}, got {value} ({})", value.type_name())]
    Value {
        /// The parameter.
        name: String,
        /// What it can be.
        expected: String,
        /// The value.
        value: ParameterValue,
    },
}

/// One parameter as it is, for lists and descriptions.
#[derive(Debug, Clone, PartialEq)]
pub struct QosParameter {
    /// Its name.
    pub name: String,
    /// Its value.
    pub value: ParameterValue,
    /// What it may be.
    pub kind: Kind,
    /// What it does.
    pub description: &'static str,
}

/// The quality of service of all the node's topics.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct QosOverrides {
    endpoints: Vec<Endpoint>,
}

impl QosOverrides {
    /// Returns the topics' own quality of service, nothing overridden yet.
    #[must_use]
    pub const fn new(endpoints: Vec<Endpoint>) -> Self {
        Self { endpoints }
    }

    /// Overrides one policy of one topic; false when the node has no such topic, so that nothing is.
    ///
    /// # Errors
    /// [`QosOverrideError`] when the topic has no such policy, or the policy cannot have the value.
    pub fn set(&mut self, name: &str, value: &ParameterValue) -> Result<bool, QosOverrideError> {
        for endpoint in &mut self.endpoints {
            if let Some(policy) = Policy::ALL
                .into_iter()
                .find(|p| endpoint.name_of(*p) == name)
            {
                if endpoint.set(policy, value) {
                    return Ok(true);
                }
                return Err(QosOverrideError::Value {
                    name: name.to_owned(),
                    expected: policy.kind().allowed(),
                    value: value.clone(),
                });
            }
        }
        let of_topic =
            |endpoint: &&Endpoint| name.starts_with(&format!("{PREFIX}{}.", endpoint.topic));
        match self.endpoints.iter().find(of_topic) {
            None => Ok(false),
            Some(Endpoint { topic, role, .. }) => Err(QosOverrideError::Policy {
                name: name.to_owned(),
                prefix: format!("{PREFIX}{topic}.{}.", role.name()),
            }),
        }
    }

    /// Returns the quality of service of a topic, `default` where it cannot be overridden.
    #[must_use]
    pub fn profile(&self, topic: &str, role: Role, default: &QosProfile) -> QosProfile {
        self.endpoints
            .iter()
            .find(|endpoint| endpoint.topic == topic && endpoint.role == role)
            .map_or_else(|| default.clone(), |endpoint| endpoint.qos.clone())
    }

    /// Returns the absolute names of the topics.
    pub fn topics(&self) -> impl Iterator<Item = &str> {
        self.endpoints
            .iter()
            .map(|endpoint| endpoint.topic.as_str())
    }

    /// All parameters.
    pub fn iter(&self) -> impl Iterator<Item = QosParameter> {
        self.endpoints.iter().flat_map(|endpoint| {
            Policy::ALL.map(|policy| QosParameter {
                name: endpoint.name_of(policy),
                value: endpoint.get(policy),
                kind: policy.kind(),
                description: policy.description(),
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::participant::{reliable, sensor_data};
    use super::*;

    fn overrides() -> QosOverrides {
        QosOverrides::new(vec![
            Endpoint::new("/points".into(), Role::Subscription, &sensor_data(10)),
            Endpoint::new("/pose".into(), Role::Publisher, &reliable(50)),
        ])
    }

    fn text(text: &str) -> ParameterValue {
        ParameterValue::String(text.to_owned())
    }

    #[test]
    fn override_reaches_its_topic_and_no_other() {
        let mut overrides = overrides();
        for (policy, value) in [
            ("reliability", text("best_effort")),
            ("durability", text("transient_local")),
            ("depth", ParameterValue::Integer(3)),
            ("deadline", ParameterValue::Integer(20_000_000)),
        ] {
            let name = format!("qos_overrides./pose.publisher.{policy}");
            assert_eq!(overrides.set(&name, &value), Ok(true));
        }
        let expected = reliable(3)
            .reliability_best_effort()
            .durability(Durability::TransientLocal)
            .deadline(Some(Duration::from_millis(20)));
        let default = reliable(50);
        assert_eq!(
            overrides.profile("/pose", Role::Publisher, &default),
            expected
        );
        assert_eq!(
            overrides.profile("/pose", Role::Subscription, &default),
            default
        );
        let points = sensor_data(10);
        assert_eq!(
            overrides.profile("/points", Role::Subscription, &default),
            points
        );
    }

    #[test]
    fn depth_survives_a_change_of_history_in_any_order() {
        for order in [["depth", "history"], ["history", "depth"]] {
            let mut overrides = overrides();
            for policy in order {
                let value = match policy {
                    "depth" => ParameterValue::Integer(7),
                    _ => text("keep_all"),
                };
                let name = format!("qos_overrides./pose.publisher.{policy}");
                assert_eq!(overrides.set(&name, &value), Ok(true));
            }
            let profile = overrides.profile("/pose", Role::Publisher, &reliable(1));
            assert_eq!(profile.history, History::KeepAll);
            assert!(overrides.iter().any(|parameter| {
                parameter.name.ends_with("/pose.publisher.depth")
                    && parameter.value == ParameterValue::Integer(7)
            }));
        }
    }

    #[test]
    fn wrong_values_and_policies_are_refused_and_foreign_topics_are_not_ours() {
        let mut overrides = overrides();
        let mut refusal = |name: &str, value: &ParameterValue| {
            let refused = overrides.set(name, value).expect_err(name);
            refused.to_string()
        };
        assert_eq!(
            refusal(
                "qos_overrides./pose.publisher.reliability",
                &text("sometimes")
            ),
            "parameter \"qos_overrides./pose.publisher.reliability\" must be \
             one of reliable, best_effort, got \"sometimes\" (string)"
        );
        assert_eq!(
            refusal(
                "qos_overrides./pose.publisher.depth",
                &ParameterValue::Integer(0)
            ),
            "parameter \"qos_overrides./pose.publisher.depth\" must be \
             an integer from 1 to 10000, got 0 (integer)"
        );
        refusal("qos_overrides./pose.publisher.depth", &text("3"));
        refusal(
            "qos_overrides./pose.publisher.deadline",
            &ParameterValue::Integer(-1),
        );
        refusal(
            "qos_overrides./pose.subscription.depth",
            &ParameterValue::Integer(1),
        );
        refusal(
            "qos_overrides./pose.publisher.lifespan",
            &ParameterValue::Integer(1),
        );
        let foreign = "qos_overrides./image.publisher.depth";
        assert_eq!(
            overrides.set(foreign, &ParameterValue::Integer(0)),
            Ok(false)
        );
    }
}
