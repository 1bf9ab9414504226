//! The endpoints that the middleware has discovered, and why some of them do not match the node's.

use ros2_client::dds::rustdds::policy::{Deadline, Durability, Reliability};
use ros2_client::dds::rustdds::qos::QosPolicyId;
use ros2_client::dds::rustdds::{DomainParticipant, QosPolicies};

use super::graph::{Graph, Misfit};
use super::messages::Message;
use super::qos_overrides::Role;
use crate::text::clip;

/// One of the node's own ends of topics.
#[derive(Debug, Clone)]
pub struct OwnEnd {
    /// Absolute name of the topic.
    pub topic: String,
    /// Which end.
    pub role: Role,
    /// Type on the wire.
    pub type_name: String,
    /// Quality of service.
    pub qos: QosPolicies,
}

/// Somebody else's end of a topic.
struct OtherEnd {
    topic: String,
    type_name: String,
    qos: QosPolicies,
}

/// Returns how the ends that the participant has discovered fit these.
#[must_use]
pub fn graph_of(participant: &DomainParticipant, own_ends: &[OwnEnd]) -> Graph {
    let writers = participant.discovered_writers().into_iter().map(|writer| {
        let data = writer.publication_topic_data;
        (
            Role::Publisher,
            OtherEnd {
                qos: data.qos(),
                topic: data.topic_name,
                type_name: data.type_name,
            },
        )
    });
    let readers = participant.discovered_readers().into_iter().map(|reader| {
        let data = reader.subscription_topic_data;
        (
            Role::Subscription,
            OtherEnd {
                qos: data.qos(),
                topic: data.topic_name().clone(),
                type_name: data.type_name().clone(),
            },
        )
    });
    let mut graph = Graph::default();
    for (role, other) in writers.chain(readers) {
        for own in own_ends {
            if own.role != role && other.topic.strip_prefix("rt") == Some(&own.topic) {
                add(&mut graph, own, &other);
            }
        }
    }
    graph
}

fn add(graph: &mut Graph, own: &OwnEnd, other: &OtherEnd) {
    if let Some(misfit) = misfit(own, other) {
        graph.misfits.insert(misfit);
    } else if own.role == Role::Subscription {
        *graph.heard.entry(own.topic.clone()).or_default() += 1;
    }
}

fn misfit(own: &OwnEnd, other: &OtherEnd) -> Option<Misfit> {
    let topic = &own.topic;
    let listens = own.role == Role::Subscription;
    if own.type_name != other.type_name {
        let (expected, got) = (ros_type(&own.type_name), ros_type(&other.type_name));
        let got = clip(&got);
        return Some(Misfit::Type(if listens {
            format!(
                "a publisher of {topic} sends {got}, expected {expected}: its messages are not received"
            )
        } else {
            format!(
                "a subscriber of {topic} expects {got}, sent is {expected}: it receives nothing"
            )
        }));
    }
    let (offered, requested) = if listens {
        (&other.qos, &own.qos)
    } else {
        (&own.qos, &other.qos)
    };
    let policy = offered.compliance_failure_wrt(requested)?;
    let (offered, requested) = (offer(offered, policy), request(requested, policy));
    let name = format!("{policy:?}").to_lowercase();
    Some(Misfit::Qos(if listens {
        format!(
            "a publisher of {topic} offers {name} {offered}, requested is {requested}: its messages are not received \
             (see qos_overrides)"
        )
    } else {
        format!(
            "a subscriber of {topic} requests {name} {requested}, offered is {offered}: it receives nothing \
             (see qos_overrides)"
        )
    }))
}

/// A missing policy is the default, which differs for the two sides.
fn offer(qos: &QosPolicies, policy: QosPolicyId) -> String {
    shown(qos, policy, "reliable")
}

fn request(qos: &QosPolicies, policy: QosPolicyId) -> String {
    shown(qos, policy, "best_effort")
}

fn shown(qos: &QosPolicies, policy: QosPolicyId, default_reliability: &str) -> String {
    match policy {
        QosPolicyId::Reliability => match qos.reliability() {
            Some(Reliability::BestEffort) => "best_effort",
            Some(Reliability::Reliable { .. }) => "reliable",
            None => default_reliability,
        }
        .to_owned(),
        QosPolicyId::Durability => match qos.durability() {
            Some(Durability::Volatile) | None => "volatile",
            Some(Durability::TransientLocal) => "transient_local",
            Some(Durability::Transient) => "transient",
            Some(Durability::Persistent) => "persistent",
        }
        .to_owned(),
        QosPolicyId::Deadline => match qos.deadline() {
            Some(Deadline(duration)) => format!("{:.3} s", duration.to_std().as_secs_f64()),
            None => "none".to_owned(),
        },
        _ => "another".to_owned(),
    }
}

/// Returns the name of a message type on the wire, `package::msg::dds_::Name_`.
#[must_use]
pub fn type_on_the_wire<M: Message>() -> String {
    format!("{}::msg::dds_::{}_", M::PACKAGE, M::NAME)
}

/// Returns `package/msg/Name` of the name on the wire, `package::msg::dds_::Name_`.
fn ros_type(on_the_wire: &str) -> String {
    let name = on_the_wire.replace("::dds_::", "::").replace("::", "/");
    name.strip_suffix('_').unwrap_or(&name).to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::participant::{QosProfile, reliable, sensor_data};

    const TYPE: &str = "sensor_msgs::msg::dds_::LaserScan_";

    fn own(role: Role, qos: &QosProfile) -> OwnEnd {
        OwnEnd {
            topic: "/lidar_info".into(),
            role,
            type_name: TYPE.into(),
            qos: qos.into(),
        }
    }

    fn other(type_name: &str, qos: &QosProfile) -> OtherEnd {
        OtherEnd {
            topic: "rt/lidar_info".into(),
            type_name: type_name.into(),
            qos: qos.into(),
        }
    }

    fn words(own: &OwnEnd, other: &OtherEnd) -> String {
        match misfit(own, other) {
            Some(Misfit::Type(words) | Misfit::Qos(words)) => words,
            None => String::new(),
        }
    }

    #[test]
    fn either_side_that_asks_for_more_than_the_other_gives_is_named_with_both() {
        let (more, less) = (reliable(1), sensor_data(1));
        let listens = own(Role::Subscription, &more);
        let said = words(&listens, &other(TYPE, &less));
        assert!(
            said.contains("offers reliability best_effort, requested is reliable"),
            "{said}"
        );
        let speaks = own(Role::Publisher, &less);
        let said = words(&speaks, &other(TYPE, &more));
        assert!(
            said.contains("requests reliability reliable, offered is best_effort"),
            "{said}"
        );
        assert_eq!(words(&own(Role::Publisher, &more), &other(TYPE, &less)), "");
        assert_eq!(
            words(&own(Role::Subscription, &less), &other(TYPE, &more)),
            ""
        );
    }

    #[test]
    fn another_type_is_named_as_ros_writes_it_without_control_characters() {
        let listens = own(Role::Subscription, &sensor_data(1));
        let said = words(
            &listens,
            &other("std_msgs::msg::dds_::String_", &reliable(1)),
        );
        assert!(
            said.contains("sends std_msgs/msg/String, expected sensor_msgs/msg/LaserScan"),
            "{said}"
        );
        let said = words(&listens, &other("a\u{1b}[31m", &reliable(1)));
        assert!(!said.contains('\u{1b}'), "{said}");
    }
}
