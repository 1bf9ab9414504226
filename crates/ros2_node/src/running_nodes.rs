//! The nodes of a domain that publish messages of one type, under whatever names.
//!
//! A remapped topic cannot be found by its name. Its type can: a participant that publishes a type which only one kind
//! of node has is such a node, and its other topics are recognised by their types.

use std::collections::{BTreeMap, BTreeSet};

use ros2_client::dds::rustdds::DomainParticipant;

use super::discovered::type_on_the_wire;
use super::messages::Message;

/// Every ROS node that has parameters answers this service, whose name begins with the node's.
const NAMING_SERVICE: &str = "/get_parametersRequest";

/// Identifies a participant, which is one process: the beginning of the identifiers of its publishers.
pub type ParticipantId = [u8; 12];

/// A process that publishes the type that was looked for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RunningNode {
    /// The process.
    pub participant: ParticipantId,
    /// Absolute name of the node; `None` until its services are known, or when several nodes share the process.
    pub name: Option<String>,
    /// Absolute name of the topic of that type.
    pub known_by: String,
    /// What it publishes: absolute name, and type on the wire.
    pub topics: BTreeSet<(String, String)>,
}

impl RunningNode {
    /// Returns the topic on which the node publishes `M`: `wanted` if it is among them, else the only one that
    /// carries this type, or the one beside [`Self::known_by`] with the same last part of its name as `wanted`.
    #[must_use]
    pub fn topic<M: Message>(&self, wanted: &str) -> Option<&str> {
        let of_type = type_on_the_wire::<M>();
        let carriers: Vec<&str> = self
            .topics
            .iter()
            .filter(|(_, type_name)| *type_name == of_type)
            .map(|(topic, _)| topic.as_str())
            .collect();
        let beside = |topic: &str| {
            let (namespace, _) = self.known_by.rsplit_once('/').unwrap_or_default();
            let (_, last) = wanted.rsplit_once('/').unwrap_or(("", wanted));
            topic
                .strip_prefix(namespace)
                .and_then(|rest| rest.strip_prefix('/'))
                == Some(last)
        };
        match carriers.as_slice() {
            [only] => Some(*only),
            many => many
                .iter()
                .find(|topic| **topic == wanted)
                .or_else(|| many.iter().find(|topic| beside(topic)))
                .copied(),
        }
    }
}

/// What a domain holds beside the node that looks around in it.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Domain {
    /// Those that publish the type that was looked for, one for each topic of it.
    pub nodes: Vec<RunningNode>,
    /// How many processes publish anything.
    pub processes: usize,
}

/// What is known of a process.
#[derive(Debug, Default)]
struct Process {
    topics: BTreeSet<(String, String)>,
    names: BTreeSet<String>,
}

impl Domain {
    /// Returns what the participant has discovered, and the nodes that publish `M`.
    #[must_use]
    pub fn of<M: Message>(participant: &DomainParticipant) -> Self {
        let mut processes: BTreeMap<ParticipantId, Process> = BTreeMap::new();
        for writer in participant.discovered_writers() {
            let data = writer.publication_topic_data;
            let process = processes.entry(id(&data.key.to_bytes())).or_default();
            if let Some(topic) = data.topic_name.strip_prefix("rt/") {
                process.topics.insert((format!("/{topic}"), data.type_name));
            }
        }
        for reader in participant.discovered_readers() {
            let data = reader.subscription_topic_data;
            let node = data
                .topic_name()
                .strip_prefix("rq")
                .and_then(|service| service.strip_suffix(NAMING_SERVICE));
            // Known by what it publishes: a participant that only subscribes is not a node of ours.
            if let Some(node) = node
                && let Some(process) = processes.get_mut(&id(&data.key().to_bytes()))
            {
                process.names.insert(node.to_owned());
            }
        }
        Self::from_processes(processes, &type_on_the_wire::<M>())
    }

    fn from_processes(processes: BTreeMap<ParticipantId, Process>, wanted: &str) -> Self {
        let mut domain = Self {
            nodes: Vec::new(),
            processes: processes.len(),
        };
        for (participant, process) in processes {
            let mut names = process.names.iter();
            let name = match (names.next(), names.next()) {
                (Some(only), None) => Some(only.clone()),
                _ => None,
            };
            let carriers = process.topics.iter().filter(|(_, t)| t == wanted);
            domain.nodes.extend(carriers.map(|(topic, _)| RunningNode {
                participant,
                name: name.clone(),
                known_by: topic.clone(),
                topics: process.topics.clone(),
            }));
        }
        domain
    }
}

/// Returns the participant's part of an identifier of an endpoint; of one that is too short, zeros.
#[must_use]
pub fn id(of_endpoint: &[u8]) -> ParticipantId {
    of_endpoint.first_chunk().copied().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::messages::{Clock, Header, ParameterEvent, TransitionEvent};

    fn event() -> String {
        type_on_the_wire::<TransitionEvent>()
    }

    fn publishing(topics: &[(&str, String)], names: &[&str]) -> Process {
        Process {
            topics: topics
                .iter()
                .map(|(topic, type_name)| ((*topic).to_owned(), type_name.clone()))
                .collect(),
            names: names.iter().map(|name| (*name).to_owned()).collect(),
        }
    }

    fn domain(processes: Vec<Process>) -> Domain {
        let numbered = (0_u8..).map(|n| [n; 12]);
        Domain::from_processes(numbered.zip(processes).collect(), &event())
    }

    #[test]
    fn node_is_found_by_its_types_under_whatever_names() {
        let clock = type_on_the_wire::<Clock>();
        let found = domain(vec![
            publishing(
                &[("/chatter", "std_msgs::msg::dds_::String_".into())],
                &["/talker"],
            ),
            publishing(
                &[
                    ("/a/changes", event()),
                    ("/b/time", clock),
                    ("/settings", type_on_the_wire::<ParameterEvent>()),
                ],
                &["/a/player"],
            ),
        ]);
        assert_eq!(found.processes, 2);
        assert_eq!(found.nodes.len(), 1);
        let node = &found.nodes[0];
        assert_eq!(node.name.as_deref(), Some("/a/player"));
        assert_eq!(node.participant, [1; 12]);
        assert_eq!(node.known_by, "/a/changes");
        assert_eq!(node.topic::<Clock>("/clock"), Some("/b/time"));
        assert_eq!(
            node.topic::<ParameterEvent>("/parameter_events"),
            Some("/settings")
        );
        assert_eq!(node.topic::<Header>("/header"), None);
    }

    #[test]
    fn of_several_topics_with_one_type_the_one_beside_is_taken_unless_another_is_wanted() {
        let clock = type_on_the_wire::<Clock>();
        let found = domain(vec![publishing(
            &[
                ("/left/changes", event()),
                ("/right/inner/clock", clock.clone()),
                ("/left/clock", clock),
            ],
            &[],
        )]);
        let node = &found.nodes[0];
        assert_eq!(node.name, None);
        assert_eq!(node.topic::<Clock>("/clock"), Some("/left/clock"));
        let wanted = "/right/inner/clock";
        assert_eq!(node.topic::<Clock>(wanted), Some(wanted));
    }

    #[test]
    fn process_of_several_nodes_has_no_name_and_every_topic_counts() {
        let changes = event();
        let found = domain(vec![publishing(
            &[("/a/changes", changes.clone()), ("/b/changes", changes)],
            &["/player", "/recorder"],
        )]);
        let named: Vec<_> = found
            .nodes
            .iter()
            .map(|node| (&node.name, node.known_by.as_str()))
            .collect();
        assert_eq!(named, [(&None, "/a/changes"), (&None, "/b/changes")]);
    }
}
