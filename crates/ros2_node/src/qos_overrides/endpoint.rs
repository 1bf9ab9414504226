//! One end of one topic, and the policies that can be overridden on it.

use std::time::Duration;

use super::policies::Policies;
use crate::parameters::{Kind, ParameterValue};

/// What the names of all these parameters begin with.
pub const PREFIX: &str = "qos_overrides.";
/// What ROS's files say for "as it is".
const SYSTEM_DEFAULT: &str = "system_default";
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
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Subscription => "subscription",
            Self::Publisher => "publisher",
        }
    }
}

/// One policy that can be overridden.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Policy {
    Reliability,
    Durability,
    History,
    Depth,
    Deadline,
}

impl Policy {
    pub(super) const ALL: [Self; 5] = [
        Self::Reliability,
        Self::Durability,
        Self::History,
        Self::Depth,
        Self::Deadline,
    ];

    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Reliability => "reliability",
            Self::Durability => "durability",
            Self::History => "history",
            Self::Depth => "depth",
            Self::Deadline => "deadline",
        }
    }

    /// What the policy may be. The defaults do not count: they are each topic's own.
    pub(super) const fn kind(self) -> Kind {
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
            Self::Reliability => choice(&["reliable", "best_effort", SYSTEM_DEFAULT]),
            Self::Durability => choice(&["volatile", "transient_local", SYSTEM_DEFAULT]),
            Self::History => choice(&["keep_last", "keep_all", SYSTEM_DEFAULT]),
            Self::Depth => integer(1, DEEPEST),
            Self::Deadline => integer(0, LONGEST_NS),
        }
    }

    pub(super) const fn description(self) -> &'static str {
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
    pub(super) topic: String,
    pub(super) role: Role,
    pub(super) policies: Policies,
}

impl Endpoint {
    /// Returns the end of the topic with this absolute name, and what holds unless it is overridden.
    #[must_use]
    pub fn new(topic: String, role: Role, policies: impl Into<Policies>) -> Self {
        Self {
            topic,
            role,
            policies: policies.into(),
        }
    }

    pub(super) fn name_of(&self, policy: Policy) -> String {
        format!(
            "{PREFIX}{}.{}.{}",
            self.topic,
            self.role.name(),
            policy.name()
        )
    }

    pub(super) fn get(&self, policy: Policy) -> ParameterValue {
        let text = |text: &str| ParameterValue::String(text.to_owned());
        let either = |on: bool, yes: &str, no: &str| text(if on { yes } else { no });
        let of = &self.policies;
        match policy {
            Policy::Reliability => either(of.reliable, "reliable", "best_effort"),
            Policy::Durability => either(of.transient_local, "transient_local", "volatile"),
            Policy::History => either(of.keep_all, "keep_all", "keep_last"),
            Policy::Depth => ParameterValue::Integer(i64::try_from(of.depth).unwrap_or(DEEPEST)),
            Policy::Deadline => ParameterValue::Integer(of.deadline.map_or(0, |deadline| {
                i64::try_from(deadline.as_nanos()).unwrap_or(LONGEST_NS)
            })),
        }
    }

    /// Sets a policy; false when the value is not among those that it can have.
    pub(super) fn set(&mut self, policy: Policy, value: &ParameterValue) -> bool {
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
        let of = &mut self.policies;
        match (policy, value) {
            (_, ParameterValue::String(word)) if word == SYSTEM_DEFAULT => {}
            (Policy::Reliability, ParameterValue::String(word)) => of.reliable = word == "reliable",
            (Policy::Durability, ParameterValue::String(word)) => {
                of.transient_local = word == "transient_local";
            }
            (Policy::History, ParameterValue::String(word)) => of.keep_all = word == "keep_all",
            (Policy::Depth, ParameterValue::Integer(depth)) => {
                of.depth = usize::try_from(*depth).unwrap_or(1);
            }
            (_, ParameterValue::Integer(deadline)) => {
                let deadline = u64::try_from(*deadline).ok().filter(|ns| *ns > 0);
                of.deadline = deadline.map(Duration::from_nanos);
            }
            _ => return false,
        }
        true
    }
}
