//! A node in the ROS graph: opened from arguments and environment, closed so that peers notice.
//!
//! ```no_run
//! use ros2_node::{arguments::Arguments, environment::Environment, messages::Header};
//! use ros2_node::participant::{NodeOptions, RosNode, reliable};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let environment = Environment::from_process()?;
//! let mut node = RosNode::open("example", &Arguments::default(), &environment, NodeOptions::new())?;
//! let publisher = node.publisher::<Header>("header", &reliable(10))?;
//! publisher.publish(Header::default())?;
//! drop(publisher); // endpoints go before their node
//! node.close();
//! # Ok(())
//! # }
//! ```

use std::time::Duration;

use futures::future::{Either, select};
use futures::pin_mut;
use ros2_client::dds::rustdds::{DomainParticipant, DomainParticipantBuilder, RTPSEntity};
use ros2_client::qos::{Durability, History, WhenFull};
use ros2_client::{Context, CreateError, CreateResult, MessageTypeName, Node, NodeCreateError};
pub use ros2_client::{NodeOptions, Publisher, QosProfile, Subscription};

use super::arguments::Arguments;
use super::discovered::{OwnEnd, graph_of, type_on_the_wire};
use super::environment::{Environment, ServiceMapping};
use super::graph::Graph;
use super::leave::Farewell;
use super::messages::Message;
use super::names::{NamesError, NodeNames};
use super::qos_overrides::{QosOverrides, Role};
use super::running_nodes::Domain;

/// How long the participants of a host get to find each other before the first endpoint is announced.
///
/// `RustDDS` announces endpoints without a source timestamp. Fast DDS orders what it cannot deliver yet by that
/// stamp, and loses announcements for good when two such participants have some that it must ask for again. It
/// asks for none that come after it has found their participant, or all at once from one that was there before.
const ACQUAINTANCE: Duration = Duration::from_millis(150);
/// How long the background task may take to end before it is left behind.
const SPIN_GRACE: Duration = Duration::from_millis(300);

/// Returns the quality of service of inputs: best effort, volatile, the last `depth` samples. It hears best-effort
/// and reliable publishers alike.
#[must_use]
pub const fn sensor_data(depth: usize) -> QosProfile {
    QosProfile::subscription_default()
        .reliability_best_effort()
        .durability(Durability::Volatile)
        .history(History::KeepLast { depth })
}

/// Returns the quality of service of outputs: reliable, volatile, the last `depth` samples. A full window is an
/// error of `publish` at once: the library's own default would stop the caller for up to 100 ms.
#[must_use]
pub const fn reliable(depth: usize) -> QosProfile {
    QosProfile::publisher_default()
        .reliability_reliable(WhenFull::Fail)
        .durability(Durability::Volatile)
        .history(History::KeepLast { depth })
}

/// Returns what the future gives, or `None` if that takes longer than `patience`.
pub async fn within<T>(patience: Duration, future: impl Future<Output = T>) -> Option<T> {
    pin_mut!(future);
    match select(future, smol::Timer::after(patience)).await {
        Either::Left((value, _)) => Some(value),
        Either::Right(_) => None,
    }
}

/// How often the graph is asked anew by [`asked_anew`].
const ASK_AGAIN: Duration = Duration::from_millis(20);

/// Waits for a peer, possibly forever: `wait` makes one of ros2-client's waits for a publisher or a subscription.
///
/// Such a wait listens to a short queue of events and can miss the one it waits for. A new wait looks at what has
/// matched already, so it is asked anew.
pub async fn asked_anew<F: Future<Output = ()>>(wait: impl Fn() -> F) {
    while within(ASK_AGAIN, wait()).await.is_none() {}
}

/// Why a node could not be opened.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OpenError {
    /// The node's name or a remap.
    #[error(transparent)]
    Names(#[from] NamesError),
    /// No sockets, no threads, or no interfaces.
    #[error("cannot join DDS domain {domain_id}: {source}")]
    Participant {
        /// The domain.
        domain_id: u16,
        /// What the middleware says.
        source: CreateError,
    },
    /// The middleware refused the node's built-in topics.
    #[error("cannot join the ROS graph: {0}")]
    Graph(#[from] CreateError),
    /// The middleware refused the node.
    #[error("cannot create the node: {0}")]
    Node(CreateError),
    /// The middleware refused a parameter's first value.
    #[error("cannot declare the parameters: {0}")]
    Parameter(String),
}

impl From<NodeCreateError> for OpenError {
    fn from(error: NodeCreateError) -> Self {
        match error {
            NodeCreateError::DDS(error) => Self::Node(error),
            NodeCreateError::BadParameter(reason) => Self::Parameter(reason),
        }
    }
}

/// Why an endpoint could not be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EndpointError {
    /// The topic's name.
    #[error(transparent)]
    Names(#[from] NamesError),
    /// The middleware refused.
    #[error("cannot open topic {topic}: {source}")]
    Create {
        /// Absolute name of the topic.
        topic: String,
        /// What the middleware says.
        source: CreateError,
    },
}

/// The middleware's threads have ended: the node neither receives nor sends any more.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "the middleware has stopped: its threads do not survive suspending and resuming the process \
     (SIGSTOP, Ctrl-Z, a debugger); restart it"
)]
pub struct MiddlewareGone;

/// A node in the graph, with its background task running.
///
/// The fields stand in the order in which they have to be dropped.
pub struct RosNode {
    node: Node,
    spin: smol::Task<CreateResult<()>>,
    context: Context,
    names: NodeNames,
    qos_overrides: QosOverrides,
    own_ends: Vec<OwnEnd>,
    farewell: Farewell,
    service_mapping: ServiceMapping,
}

impl RosNode {
    /// Returns a node in the graph, called `default_name` in `/` unless the arguments remap it.
    ///
    /// # Errors
    /// [`OpenError`] when a name is malformed or the middleware cannot start.
    pub fn open(
        default_name: &str,
        arguments: &Arguments,
        environment: &Environment,
        options: NodeOptions,
    ) -> Result<Self, OpenError> {
        let names = NodeNames::new(default_name, &arguments.remaps)?;
        let domain_id = environment.domain_id;
        let mut builder = DomainParticipantBuilder::new(domain_id);
        if let Some(address) = environment.discovery_range.only_address() {
            builder = builder.with_only_networks([address]);
        }
        let participant = builder.build().map_err(|error| OpenError::Participant {
            domain_id,
            source: error.into(),
        })?;
        let farewell = Farewell::new(participant.guid().to_bytes(), environment);
        std::thread::sleep(ACQUAINTANCE);
        let context = Context::from_domain_participant(participant)?;
        let options = options.enable_rosout(arguments.rosout_logs);
        let mut node = context.new_node(names.client_node()?, options)?;
        // From here on the graph is watched: waiting for peers without it panics.
        let spin = smol::spawn(node.spinner()?.spin());
        Ok(Self {
            node,
            spin,
            context,
            names,
            qos_overrides: QosOverrides::default(),
            own_ends: Vec::new(),
            farewell,
            service_mapping: environment.service_mapping,
        })
    }

    /// Opens publishers and subscriptions from now on with this quality of service, where it knows their topic.
    pub fn override_qos(&mut self, overrides: QosOverrides) {
        self.qos_overrides = overrides;
    }

    /// Returns a publisher on `topic`, its name expanded and remapped.
    ///
    /// # Errors
    /// [`EndpointError`] when the name is malformed or the middleware refuses.
    pub fn publisher<M: Message>(
        &mut self,
        topic: &str,
        qos: &QosProfile,
    ) -> Result<Publisher<M>, EndpointError> {
        let name = self.names.client_topic(topic)?;
        let qos = self.qos::<M>(topic, Role::Publisher, qos)?;
        self.node
            .create_topic(&name, MessageTypeName::new(M::PACKAGE, M::NAME), &qos)
            .and_then(|topic| self.node.create_publisher(&topic, None))
            .map_err(|source| EndpointError::Create {
                topic: name.to_string(),
                source,
            })
    }

    /// Returns a subscription to `topic`, its name expanded and remapped.
    ///
    /// # Errors
    /// [`EndpointError`] when the name is malformed or the middleware refuses.
    pub fn subscription<M: Message>(
        &mut self,
        topic: &str,
        qos: &QosProfile,
    ) -> Result<Subscription<M>, EndpointError> {
        let name = self.names.client_topic(topic)?;
        let qos = self.qos::<M>(topic, Role::Subscription, qos)?;
        self.node
            .create_topic(&name, MessageTypeName::new(M::PACKAGE, M::NAME), &qos)
            .and_then(|topic| self.node.create_subscription(&topic, None))
            .map_err(|source| EndpointError::Create {
                topic: name.to_string(),
                source,
            })
    }

    /// Returns how many samples of `topic` may wait, overrides counted; `default` as for [`Self::subscription`].
    ///
    /// # Errors
    /// [`NamesError`] when the name is malformed.
    pub fn subscription_depth(
        &self,
        topic: &str,
        default: &QosProfile,
    ) -> Result<usize, NamesError> {
        let topic = self.names.topic(topic)?;
        let qos = self
            .qos_overrides
            .profile(&topic, Role::Subscription, default);
        Ok(match qos.history {
            History::KeepLast { depth } => depth,
            History::KeepAll => usize::MAX,
        })
    }

    /// Returns the quality of service that the end of a topic opens with, and records that end.
    fn qos<M: Message>(
        &mut self,
        topic: &str,
        role: Role,
        default: &QosProfile,
    ) -> Result<QosProfile, NamesError> {
        let topic = self.names.topic(topic)?;
        let qos = self.qos_overrides.profile(&topic, role, default);
        self.own_ends.push(OwnEnd {
            topic,
            role,
            type_name: type_on_the_wire::<M>(),
            qos: (&qos).into(),
        });
        Ok(qos)
    }

    /// Returns how the other ends of the topics opened so far fit.
    #[must_use]
    pub fn graph(&self) -> Graph {
        graph_of(&self.context.domain_participant(), &self.own_ends)
    }

    /// Returns what the domain holds beside this node, and the nodes in it that publish `M`.
    #[must_use]
    pub fn domain<M: Message>(&self) -> Domain {
        Domain::of::<M>(&self.context.domain_participant())
    }

    /// Checks that the middleware's threads still run. They end, for good, when the process is stopped and continued:
    /// the system then interrupts their waits, which `RustDDS` takes for a failure.
    ///
    /// # Errors
    /// [`MiddlewareGone`] when they have ended.
    pub fn check_alive(&self) -> Result<(), MiddlewareGone> {
        // Any request to the thread would do; no endpoint of this node has a liveliness that this could assert.
        let participant = self.context.domain_participant();
        participant.assert_liveliness().map_err(|_| MiddlewareGone)
    }

    /// How replies of services name their request.
    pub(super) const fn service_mapping(&self) -> ServiceMapping {
        self.service_mapping
    }

    /// The client library's node, and the participant that it is part of, for endpoints of other kinds.
    pub(super) fn parts(&mut self) -> (&mut Node, DomainParticipant) {
        let participant = self.context.domain_participant();
        (&mut self.node, participant)
    }

    /// The client library's node, for waits, counts and logging.
    #[must_use]
    pub const fn node(&self) -> &Node {
        &self.node
    }

    /// The node's names.
    #[must_use]
    pub const fn names(&self) -> &NodeNames {
        &self.names
    }

    /// Returns how many publishers the graph has on `topic`, its name expanded and remapped.
    ///
    /// # Errors
    /// [`NamesError`] when the name is malformed.
    pub fn publisher_count(&self, topic: &str) -> Result<usize, NamesError> {
        Ok(self.node.publisher_count(&self.names.topic(topic)?))
    }

    /// Leaves the graph and announces it. Publishers and subscriptions must be dropped before.
    pub fn close(self) {
        let Self {
            node,
            spin,
            context,
            farewell,
            ..
        } = self;
        drop(node); // ends the background task, which holds a handle to the context
        match smol::block_on(within(SPIN_GRACE, spin)) {
            Some(Ok(())) => {}
            Some(Err(error)) => log::debug!("the background task failed: {error}"),
            None => log::debug!("the background task did not end in time"),
        }
        drop(context);
        farewell.send();
    }
}

#[cfg(test)]
mod tests {
    use super::super::environment::DiscoveryRange;
    use super::super::messages::{Header, Time};
    use super::*;

    /// Discovery on one host takes a fraction of a second; a loaded machine may take several.
    const PATIENCE: Duration = Duration::from_secs(20);

    /// A domain of this test run's own, among those whose ports are not handed out to clients.
    fn environment() -> Environment {
        Environment {
            domain_id: 60 + u16::try_from(std::process::id() % 40).expect("below 40"),
            discovery_range: DiscoveryRange::Localhost,
            ..Environment::default()
        }
    }

    fn open(name: &str) -> RosNode {
        let options = NodeOptions::new();
        RosNode::open(name, &Arguments::default(), &environment(), options)
            .expect("loopback exists")
    }

    #[test]
    fn message_passes_between_two_nodes_of_this_host_bit_for_bit() {
        let (mut sender, mut receiver) = (open("sender"), open("receiver"));
        let subscription = receiver
            .subscription::<Header>("~/header", &sensor_data(10))
            .expect("the name is valid");
        let publisher = sender
            .publisher::<Header>("/receiver/header", &reliable(10))
            .expect("the name is valid");
        let sent = Header {
            stamp: Time {
                sec: -1,
                nanosec: 999_999_999,
            },
            frame_id: "sensor".to_owned(),
        };

        let received = smol::block_on(async {
            within(PATIENCE, publisher.wait_for_subscription(sender.node())).await?;
            // Matched on this side may be a little before matched on the other, and best effort
            // does not repeat.
            for _ in 0..200 {
                publisher
                    .publish(sent.clone())
                    .expect("a window of ten has room");
                let pace = Duration::from_millis(100);
                if let Some(sample) = within(pace, subscription.async_take()).await {
                    return Some(sample.expect("the sample is well formed").0);
                }
            }
            None
        });

        assert_eq!(received, Some(sent));
        drop((publisher, subscription));
        sender.close();
        receiver.close();
    }
}
