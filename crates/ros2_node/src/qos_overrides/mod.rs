//! Quality of service by parameters, under the names that all of ROS has for it:
//! `qos_overrides./scan.publisher.reliability`.

mod endpoint;
mod policies;

pub use endpoint::{Endpoint, PREFIX, Role};
pub use policies::Policies;

#[cfg(feature = "client")]
use ros2_client::QosProfile;

use crate::parameters::{Kind, ParameterValue};
use crate::text::quoted;
use endpoint::Policy;

/// Why an override cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum QosOverrideError {
    /// A name that no parameter of the topic has.
    #[error(
        "unknown parameter {}: the node can override {prefix} reliability, durability, history, depth, deadline",
        quoted(name)
    )]
    Policy {
        /// As it was written.
        name: String,
        /// What the names of this topic begin with.
        prefix: String,
    },
    /// A value that the policy cannot have.
    #[error("parameter {} must be {expected}, got {value} ({})", quoted(name), value.type_name())]
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
    /// Its allowed values.
    pub kind: Kind,
    /// Its description.
    pub description: &'static str,
}

/// The quality of service of all the node's topics.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct QosOverrides {
    endpoints: Vec<Endpoint>,
    /// Names of the parameters that were set.
    given: Vec<String>,
}

impl QosOverrides {
    /// Returns the topics' own quality of service, nothing overridden yet.
    #[must_use]
    pub const fn new(endpoints: Vec<Endpoint>) -> Self {
        Self {
            endpoints,
            given: Vec::new(),
        }
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
                    self.given.push(name.to_owned());
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

    /// Leaves out all topics but these; returns the names of parameters that were set for the others.
    pub fn leave(&mut self, opened: &[String]) -> Vec<String> {
        let is_open = |endpoint: &Endpoint| opened.contains(&endpoint.topic);
        self.endpoints.retain(is_open);
        let is_left = |name: &String| {
            let of =
                |endpoint: &Endpoint| name.starts_with(&format!("{PREFIX}{}.", endpoint.topic));
            self.endpoints.iter().any(of)
        };
        let (left, without_effect) = self.given.drain(..).partition(is_left);
        self.given = left;
        without_effect
    }

    /// Returns the quality of service of a topic, `default` where it cannot be overridden.
    #[cfg(feature = "client")]
    #[must_use]
    pub fn profile(&self, topic: &str, role: Role, default: &QosProfile) -> QosProfile {
        self.endpoints
            .iter()
            .find(|endpoint| endpoint.topic == topic && endpoint.role == role)
            .map_or_else(|| default.clone(), |end| end.policies.over(default))
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
#[cfg(feature = "client")]
mod tests {
    use std::time::Duration;

    use ros2_client::qos::{Durability, History};

    use super::super::participant::{reliable, sensor_data};
    use super::*;

    fn overrides() -> QosOverrides {
        QosOverrides::new(vec![
            Endpoint::new("/points".into(), Role::Subscription, &sensor_data(10)),
            Endpoint::new("/scan".into(), Role::Publisher, &reliable(50)),
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
            let name = format!("qos_overrides./scan.publisher.{policy}");
            assert_eq!(overrides.set(&name, &value), Ok(true));
        }
        let expected = reliable(3)
            .reliability_best_effort()
            .durability(Durability::TransientLocal)
            .deadline(Some(Duration::from_millis(20)));
        let default = reliable(50);
        assert_eq!(
            overrides.profile("/scan", Role::Publisher, &default),
            expected
        );
        assert_eq!(
            overrides.profile("/scan", Role::Subscription, &default),
            default
        );
        let points = sensor_data(10);
        assert_eq!(
            overrides.profile("/points", Role::Subscription, &default),
            points
        );
    }

    #[test]
    fn system_default_leaves_a_policy_as_it_is() {
        let mut overrides = overrides();
        for policy in ["reliability", "durability", "history"] {
            let name = format!("qos_overrides./scan.publisher.{policy}");
            assert_eq!(overrides.set(&name, &text("system_default")), Ok(true));
        }
        let default = reliable(50);
        let other = sensor_data(1);
        assert_eq!(overrides.profile("/scan", Role::Publisher, &other), default);
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
                let name = format!("qos_overrides./scan.publisher.{policy}");
                assert_eq!(overrides.set(&name, &value), Ok(true));
            }
            let profile = overrides.profile("/scan", Role::Publisher, &reliable(1));
            assert_eq!(profile.history, History::KeepAll);
            assert!(overrides.iter().any(|parameter| {
                parameter.name.ends_with("/scan.publisher.depth")
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
                "qos_overrides./scan.publisher.reliability",
                &text("sometimes")
            ),
            "parameter \"qos_overrides./scan.publisher.reliability\" must be \
             one of reliable, best_effort, system_default, got \"sometimes\" (string)"
        );
        assert_eq!(
            refusal(
                "qos_overrides./scan.publisher.depth",
                &ParameterValue::Integer(0)
            ),
            "parameter \"qos_overrides./scan.publisher.depth\" must be \
             an integer from 1 to 10000, got 0 (integer)"
        );
        refusal("qos_overrides./scan.publisher.depth", &text("3"));
        refusal(
            "qos_overrides./scan.publisher.deadline",
            &ParameterValue::Integer(-1),
        );
        refusal(
            "qos_overrides./scan.subscription.depth",
            &ParameterValue::Integer(1),
        );
        refusal(
            "qos_overrides./scan.publisher.lifespan",
            &ParameterValue::Integer(1),
        );
        let foreign = "qos_overrides./image.publisher.depth";
        assert_eq!(
            overrides.set(foreign, &ParameterValue::Integer(0)),
            Ok(false)
        );
    }
}
