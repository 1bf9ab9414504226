//! Which node is watched: the one that was asked for, or the only one there is.

use std::collections::BTreeSet;
use std::time::{Duration, Instant};

use tanker_pose::ros::environment::{DiscoveryRange, Environment};
use tanker_pose::ros::running_nodes::{Domain, ParticipantId, RunningNode};

/// After the first node was found: others that are there are found by then, too.
const SETTLE: Duration = Duration::from_secs(1);

/// What tells one node from another: its name and the topic of its status.
type Identity = (Option<String>, String);

/// What is watched; the node may come, go and come again.
#[derive(Debug)]
pub struct Search {
    /// Name that was asked for, absolute or its last part.
    node: Option<String>,
    /// Topic of the status that was asked for.
    status: Option<String>,
    domain_id: u16,
    this_host_only: bool,
    began: Instant,
    first_seen: Option<Instant>,
    processes: usize,
    /// Nodes that are not the one that was asked for.
    others: Vec<String>,
    /// Nodes that may be it.
    seen: Vec<String>,
    found: Option<Found>,
    left: Option<(String, Instant)>,
}

/// The node that is watched now.
#[derive(Debug, Clone)]
pub struct Found {
    identity: Identity,
    /// The latest of the processes that say they are it.
    pub node: RunningNode,
    /// All of these processes.
    pub participants: BTreeSet<ParticipantId>,
}

/// Several nodes, and none asked for.
#[derive(Debug, thiserror::Error)]
#[error("{count} nodes are in domain {domain_id}: {names}; choose one with --node NAME")]
pub struct SeveralNodes {
    count: usize,
    domain_id: u16,
    names: String,
}

impl Search {
    /// Returns a search for the node of this name, or for the one whose status has this topic, or for any.
    pub fn new(
        node: Option<&str>,
        status: Option<&str>,
        environment: &Environment,
        now: Instant,
    ) -> Self {
        Self {
            node: node.map(str::to_owned),
            status: status.map(str::to_owned),
            domain_id: environment.domain_id,
            this_host_only: environment.discovery_range == DiscoveryRange::Localhost,
            began: now,
            first_seen: None,
            processes: 0,
            others: Vec::new(),
            seen: Vec::new(),
            found: None,
            left: None,
        }
    }

    /// Records what the domain holds.
    ///
    /// # Errors
    /// [`SeveralNodes`] when it is not clear which one is meant.
    pub fn look(&mut self, domain: &Domain, now: Instant) -> Result<(), SeveralNodes> {
        self.processes = domain.processes;
        let (wanted, others): (Vec<_>, Vec<_>) =
            domain.nodes.iter().partition(|node| self.is_wanted(node));
        self.others = others.into_iter().map(name).collect();
        let identities: BTreeSet<Identity> = wanted.iter().map(|node| identity(node)).collect();
        self.seen = identities
            .iter()
            .map(|(node, topic)| words(node.as_deref(), topic))
            .collect();
        if let Some(found) = self.found.take() {
            // A name may be discovered later than its topics.
            let same = |node: &&&RunningNode| {
                found.participants.contains(&node.participant) || identity(node) == found.identity
            };
            let theirs: Vec<_> = wanted.iter().filter(same).copied().collect();
            if theirs.is_empty() {
                self.left = Some((name(&found.node), now));
                self.first_seen = None;
            }
            self.found = Found::of(&theirs);
            return Ok(());
        }
        if identities.is_empty() {
            self.first_seen = None;
            return Ok(());
        }
        if now - *self.first_seen.get_or_insert(now) < SETTLE {
            return Ok(());
        }
        if identities.len() > 1 {
            return Err(SeveralNodes {
                count: identities.len(),
                domain_id: self.domain_id,
                names: self.seen.join(", "),
            });
        }
        self.found = Found::of(&wanted);
        self.left = None;
        Ok(())
    }

    /// Returns the node that is watched.
    pub const fn found(&self) -> Option<&Found> {
        self.found.as_ref()
    }

    /// Returns why no node is watched, in words.
    pub fn missing(&self, now: Instant) -> String {
        let domain = self.domain_id;
        if !self.seen.is_empty() {
            let seen = self.seen.join(", ");
            return format!("{seen} found in domain {domain}, looking whether there are others");
        }
        if let Some((node, at)) = &self.left {
            let ago = now.saturating_duration_since(*at).as_secs();
            return format!("{node} has left domain {domain}, {ago} s ago: waiting for it");
        }
        let sought = match (&self.node, &self.status) {
            (Some(node), _) => format!("no node {node}"),
            (None, Some(topic)) => format!("no node with its status on {topic}"),
            (None, None) => "no tanker_pose node".to_owned(),
        };
        let company = match self.processes {
            0 => "no other process publishes in it".to_owned(),
            1 => "one other process publishes in it".to_owned(),
            n => format!("{n} other processes publish in it"),
        };
        let others = match self.others.as_slice() {
            [] => String::new(),
            some => format!(", among them {}", some.join(", ")),
        };
        let range = if self.this_host_only {
            " Only this host is searched (ROS_AUTOMATIC_DISCOVERY_RANGE or ROS_LOCALHOST_ONLY)."
        } else {
            ""
        };
        let for_s = now.saturating_duration_since(self.began).as_secs();
        format!(
            "{sought} in domain {domain} after {for_s} s: {company}{others}. \
             Is the node running, with ROS_DOMAIN_ID={domain}?{range}"
        )
    }

    fn is_wanted(&self, node: &RunningNode) -> bool {
        let named = self.node.as_deref().is_none_or(|wanted| {
            node.name.as_deref().is_some_and(|name| {
                name == wanted
                    || name
                        .rsplit_once('/')
                        .is_some_and(|(_, last)| last == wanted)
            })
        });
        named
            && self
                .status
                .as_deref()
                .is_none_or(|wanted| node.known_by == wanted)
    }
}

impl Found {
    fn of(nodes: &[&RunningNode]) -> Option<Self> {
        let latest = *nodes.last()?;
        Some(Self {
            identity: identity(latest),
            node: latest.clone(),
            participants: nodes.iter().map(|node| node.participant).collect(),
        })
    }

    /// Returns the node's name in words.
    pub fn name(&self) -> String {
        name(&self.node)
    }
}

fn identity(node: &RunningNode) -> Identity {
    (node.name.clone(), node.known_by.clone())
}

fn name(node: &RunningNode) -> String {
    words(node.name.as_deref(), &node.known_by)
}

fn words(name: Option<&str>, status: &str) -> String {
    name.map_or_else(|| format!("the publisher of {status}"), str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn node(process: u8, name: &str, status: &str) -> RunningNode {
        RunningNode {
            participant: [process; 12],
            name: Some(name.to_owned()),
            known_by: status.to_owned(),
            topics: BTreeSet::new(),
        }
    }

    fn domain(nodes: &[RunningNode]) -> Domain {
        Domain {
            nodes: nodes.to_vec(),
            processes: nodes.len(),
        }
    }

    fn search(node: Option<&str>) -> (Search, Instant) {
        let now = Instant::now();
        let environment = Environment {
            domain_id: 7,
            ..Environment::default()
        };
        (Search::new(node, None, &environment, now), now)
    }

    #[test]
    fn only_node_is_taken_once_others_had_their_time_to_be_found() {
        let (mut search, now) = search(None);
        let one = node(1, "/a/tanker_pose", "/a/status");
        let look = |search: &mut Search, at| search.look(&domain(std::slice::from_ref(&one)), at);
        look(&mut search, now).expect("one is not several");
        assert!(search.found().is_none());
        assert!(
            search
                .missing(now)
                .starts_with("/a/tanker_pose found in domain 7")
        );
        look(&mut search, now + SETTLE).expect("one is not several");
        assert_eq!(
            search.found().map(Found::name).as_deref(),
            Some("/a/tanker_pose")
        );
    }

    #[test]
    fn several_nodes_are_named_and_the_one_that_was_asked_for_is_taken() {
        let both = domain(&[
            node(1, "/a/tanker_pose", "/a/status"),
            node(2, "/b/tanker_pose", "/b/status"),
        ]);
        let (mut any, now) = search(None);
        any.look(&both, now).expect("not judged yet");
        let error = any.look(&both, now + SETTLE).expect_err("two");
        assert_eq!(
            error.to_string(),
            "2 nodes are in domain 7: /a/tanker_pose, /b/tanker_pose; choose one with --node NAME"
        );
        let (mut one, now) = search(Some("/b/tanker_pose"));
        one.look(&both, now).expect("one was asked for");
        one.look(&both, now + SETTLE).expect("one was asked for");
        assert_eq!(
            one.found().map(|found| found.node.known_by.as_str()),
            Some("/b/status")
        );
    }

    #[test]
    fn node_that_leaves_is_waited_for_and_its_successor_is_taken() {
        let (mut search, now) = search(None);
        let first = domain(&[node(1, "/tanker_pose", "/status")]);
        search.look(&first, now).expect("one");
        search.look(&first, now + SETTLE).expect("one");
        let gone = now + 2 * SETTLE;
        search.look(&domain(&[]), gone).expect("none");
        assert!(search.found().is_none());
        let words = search.missing(gone + 5 * SETTLE);
        assert_eq!(
            words,
            "/tanker_pose has left domain 7, 5 s ago: waiting for it"
        );
        let next = domain(&[node(2, "/tanker_pose", "/status")]);
        search.look(&next, gone + 6 * SETTLE).expect("one");
        search.look(&next, gone + 7 * SETTLE).expect("one");
        let found = search.found().expect("it came again");
        assert_eq!(found.participants, BTreeSet::from([[2; 12]]));
    }

    #[test]
    fn processes_with_one_name_are_all_listened_to() {
        let (mut search, now) = search(None);
        let one = node(1, "/tanker_pose", "/status");
        let twins = domain(&[one.clone(), node(2, "/tanker_pose", "/status")]);
        search.look(&domain(&[one]), now).expect("one");
        search.look(&twins, now + SETTLE).expect("one name");
        assert_eq!(
            search.found().map(|found| found.participants.len()),
            Some(2)
        );
    }
}
