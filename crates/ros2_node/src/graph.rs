//! The other endpoints of the node's topics.

use std::collections::{BTreeMap, BTreeSet};

/// Why an endpoint of this node and one of another do not match; the text is for display.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Misfit {
    /// They do not mean the same kind of message.
    Type(String),
    /// One asks for more than the other gives.
    Qos(String),
}

/// The graph apart from the node.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Graph {
    /// Endpoints of others that do not match; equal ones once.
    pub misfits: BTreeSet<Misfit>,
    /// Matching publishers, by the absolute name of the topic.
    pub heard: BTreeMap<String, usize>,
}

impl Graph {
    /// Returns how many publishers match on the topic with this absolute name.
    #[must_use]
    pub fn heard(&self, topic: &str) -> usize {
        self.heard.get(topic).copied().unwrap_or(0)
    }
}
