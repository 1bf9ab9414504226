//! Why the demo cannot run.

use tanker_pose::ros::arguments::ArgumentError;
use tanker_pose::ros::environment::EnvironmentError;
use tanker_pose::ros::names::NamesError;
use tanker_pose::ros::node::NodeError;
use tanker_pose::ros::participant::{EndpointError, OpenError};

use crate::simulate::ApproachError;
use crate::simulate::source::SourceError;

/// Why the demo cannot run, or did not go well.
#[derive(Debug, thiserror::Error)]
pub enum DemoError {
    #[error(transparent)]
    Approach(#[from] ApproachError),
    #[error(
        "marker map {map:?} has {got} markers, and the node needs {need} for a pose: \
         a demo with fewer would show refusals only (see min_points in config/tanker_pose.yaml)"
    )]
    TooFewMarkers {
        map: String,
        got: usize,
        need: usize,
    },
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    #[error(transparent)]
    Environment(#[from] EnvironmentError),
    #[error(transparent)]
    Names(#[from] NamesError),
    #[error(
        "every domain from {first} to {last} is in use on this host: choose one with --domain-id"
    )]
    NoFreeDomain { first: u16, last: u16 },
    #[error("cannot listen for SIGINT and SIGTERM: {0}")]
    Signals(std::io::Error),
    #[error("cannot start the node's thread: {0}")]
    Thread(std::io::Error),
    #[error("the node exited: {0}")]
    Node(Box<NodeError>),
    #[error("the node's thread ended unexpectedly")]
    NodeGone,
    #[error(transparent)]
    Open(#[from] OpenError),
    #[error(transparent)]
    Endpoint(#[from] EndpointError),
    #[error(transparent)]
    Source(#[from] SourceError),
    #[error(
        "domain {domain_id} already has a publisher of {topic}: choose another with --domain-id"
    )]
    DomainInUse { domain_id: u16, topic: &'static str },
    #[error("node and simulation did not find each other within {wait_s} s: {reason}")]
    Discovery { wait_s: f64, reason: String },
    #[error("{missing} of {sent} frames got no outcome: is this machine overloaded?")]
    Missing { missing: usize, sent: usize },
}
