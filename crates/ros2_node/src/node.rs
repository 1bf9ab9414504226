//! A node with all that its peers expect of it: parameters behind their services, a lifecycle if it is managed, time,
//! log, and a shutdown that peers notice.
//!
//! The parts are in the other modules, for programs that put them together in another way.
//!
//! ```no_run
//! use ros2_node::arguments::Arguments;
//! use ros2_node::environment::Environment;
//! use ros2_node::messages::Header;
//! use ros2_node::node::{Event, Node};
//! use ros2_node::parameters::USE_SIM_TIME;
//! use ros2_node::participant::reliable;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let environment = Environment::from_process()?;
//! let mut node = Node::builder("listener", &[USE_SIM_TIME]).open(&Arguments::default(), &environment)?;
//! let publisher = node.ros().publisher::<Header>("header", &reliable(10))?;
//! node.announce()?;
//! smol::block_on(async {
//!     while !matches!(node.next().await, Ok(Event::Stop) | Err(_)) {}
//! });
//! drop(publisher); // endpoints go before their node
//! node.close();
//! # Ok(())
//! # }
//! ```

use std::time::Duration;

use async_signal::{Signal, Signals};
use futures::{FutureExt, StreamExt, select_biased};
use ros2_client::{NodeOptions, QosProfile};
use smol::channel::Receiver;

use crate::arguments::Arguments;
use crate::clock::NodeClock;
use crate::environment::Environment;
use crate::lifecycle::{Lifecycle, Request, State, WorkResult};
use crate::logging;
use crate::names::{NamesError, NodeNames};
use crate::parameters::{
    ParameterServices, ParameterSpec, Parameters, SharedParameters, USE_SIM_TIME,
};
pub use crate::participant::MiddlewareGone;
use crate::participant::{EndpointError, OpenError, RosNode};
use crate::qos_overrides::{Endpoint, QosOverrides, Role};
use crate::sim_time::SimTime;
use crate::start_values::{StartParameterError, start_values};

/// How often a node looks whether its middleware still runs.
const LOOK: Duration = Duration::from_secs(1);

/// The next task of a node.
#[derive(Debug)]
#[non_exhaustive]
pub enum Event {
    /// SIGINT or SIGTERM has arrived: drop the endpoints, and [`Node::close`].
    Stop,
    /// These are the parameters after a change.
    Parameters(Parameters),
    /// A managed node is to change its state: hand it to [`Node::carry_out`].
    Transition(Request),
}

/// Why a node could not be opened.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NodeError {
    /// The node's name, that of a topic, or a remap.
    #[error(transparent)]
    Names(#[from] NamesError),
    /// A parameter or a parameter file.
    #[error(transparent)]
    Parameters(#[from] StartParameterError),
    /// Values of parameters that do not go together.
    #[error("{0}")]
    Check(String),
    /// Signals cannot be caught.
    #[error("cannot listen for SIGINT and SIGTERM: {0}")]
    Signals(std::io::Error),
    /// The graph cannot be joined.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// A topic or a service cannot be opened.
    #[error(transparent)]
    Endpoint(#[from] EndpointError),
}

type Check = Box<dyn Fn(&Parameters) -> Result<(), String> + Send + Sync>;

/// A node that is not open yet.
pub struct Builder {
    name: &'static str,
    parameters: &'static [ParameterSpec],
    topics: Vec<(&'static str, Role, QosProfile)>,
    check: Check,
    managed: bool,
    log_target: Option<&'static str>,
}

impl Builder {
    /// Lets users override the quality of service of a topic, by the parameters `qos_overrides.*`; `qos` holds unless
    /// they do, as that which the topic is opened with.
    #[must_use]
    pub fn topic(mut self, name: &'static str, role: Role, qos: &QosProfile) -> Self {
        self.topics.push((name, role, qos.clone()));
        self
    }

    /// Refuses values of parameters that do not go together, for the reason that `check` gives.
    #[must_use]
    pub fn check(
        mut self,
        check: impl Fn(&Parameters) -> Result<(), String> + Send + Sync + 'static,
    ) -> Self {
        self.check = Box::new(check);
        self
    }

    /// Makes it a managed node: unconfigured until a transition is requested.
    #[must_use]
    pub const fn managed(mut self) -> Self {
        self.managed = true;
        self
    }

    /// Starts logging, with `own` as [`logging::start`] takes it. Without this, logging is the caller's.
    #[must_use]
    pub const fn logging(mut self, own: &'static str) -> Self {
        self.log_target = Some(own);
        self
    }

    /// Returns the node, in the graph. Its services are closed until [`Node::announce`].
    ///
    /// # Errors
    /// [`NodeError`] names what is wrong with a name, a parameter or the network.
    pub fn open(self, arguments: &Arguments, environment: &Environment) -> Result<Node, NodeError> {
        let names = NodeNames::new(self.name, &arguments.remaps)?;
        if let Some(own) = self.log_target {
            logging::start(arguments, &names, own);
        }
        // From here on a signal is kept until it is read.
        let signals = Signals::new([Signal::Int, Signal::Term]).map_err(NodeError::Signals)?;
        let qos: Result<_, NamesError> = self
            .topics
            .iter()
            .map(|(topic, role, qos)| Ok(Endpoint::new(names.topic(topic)?, *role, qos)))
            .collect();
        let start = start_values(
            arguments,
            &names.fully_qualified(),
            Parameters::new(self.parameters),
            QosOverrides::new(qos?),
        )?;
        (self.check)(&start.parameters).map_err(NodeError::Check)?;
        let options = NodeOptions::new().start_parameter_services(false);
        let mut ros = RosNode::open(self.name, arguments, environment, options)?;
        logging::start_rosout(ros.node().logging_handle());
        for warning in environment.warnings.iter().chain(&start.warnings) {
            log::warn!("{warning}");
        }
        ros.override_qos(start.qos.clone());
        let (parameters, changes) = SharedParameters::new(start.parameters, &start.qos, self.check);
        let clock = NodeClock::default();
        Ok(Node {
            services: None,
            lifecycle: None,
            requests: smol::channel::bounded(1).1,
            sim_time: SimTime::new(clock.clone()),
            ros,
            clock,
            parameters,
            changes,
            signals,
            looks: smol::Timer::interval(LOOK),
            managed: self.managed,
        })
    }
}

/// A node in the graph, with what its peers expect of it.
///
/// It lives between [`Builder::open`] and [`Node::close`]; dropped without it, peers notice only after a while.
pub struct Node {
    services: Option<ParameterServices>,
    lifecycle: Option<Lifecycle>,
    requests: Receiver<Request>,
    sim_time: SimTime,
    ros: RosNode,
    clock: NodeClock,
    parameters: SharedParameters,
    changes: Receiver<()>,
    signals: Signals,
    looks: smol::Timer,
    managed: bool,
}

impl Node {
    /// Returns a node to open, called `name` in `/` unless the arguments remap it, with these parameters.
    #[must_use]
    pub fn builder(name: &'static str, parameters: &'static [ParameterSpec]) -> Builder {
        Builder {
            name,
            parameters,
            topics: Vec::new(),
            check: Box::new(|_| Ok(())),
            managed: false,
            log_target: None,
        }
    }

    /// The node in the graph, to open topics on.
    pub const fn ros(&mut self) -> &mut RosNode {
        &mut self.ros
    }

    /// The node's time: the system's, or a simulation's where [`USE_SIM_TIME`] is declared and set.
    #[must_use]
    pub const fn clock(&self) -> &NodeClock {
        &self.clock
    }

    /// Returns the parameters as they are now.
    #[must_use]
    pub fn parameters(&self) -> Parameters {
        self.parameters.snapshot()
    }

    /// Returns whether the node is to do its work: always, or in the state "active" if it is managed.
    #[must_use]
    pub fn is_active(&self) -> bool {
        if self.managed {
            let state = self.lifecycle.as_ref().map(Lifecycle::state);
            state == Some(State::Active)
        } else {
            true
        }
    }

    /// Opens the services of parameters and lifecycle. Call it after opening the topics: a client that finds the
    /// services then finds the topics too.
    ///
    /// # Errors
    /// [`EndpointError`] when the middleware refuses.
    pub fn announce(&mut self) -> Result<(), EndpointError> {
        self.follow_clock(&self.parameters())?;
        if self.managed && self.lifecycle.is_none() {
            let (lifecycle, requests) = Lifecycle::open(&mut self.ros, &self.clock)?;
            self.lifecycle = Some(lifecycle);
            self.requests = requests;
        }
        if self.services.is_none() {
            let services = ParameterServices::open(&mut self.ros, &self.parameters, &self.clock)?;
            self.services = Some(services);
        }
        Ok(())
    }

    /// Waits for the next event. Nothing is lost when this future is dropped before it is ready.
    ///
    /// # Errors
    /// [`MiddlewareGone`]: the node can only be closed.
    pub async fn next(&mut self) -> Result<Event, MiddlewareGone> {
        loop {
            // A closed channel is pending rather than always ready.
            select_biased! {
                _ = self.signals.next().fuse() => return Ok(Event::Stop),
                () = received(&self.changes).fuse() => {
                    let parameters = self.parameters();
                    if let Err(error) = self.follow_clock(&parameters) {
                        log::error!("{} has no effect: {error}", USE_SIM_TIME.name);
                    }
                    return Ok(Event::Parameters(parameters));
                }
                request = received(&self.requests).fuse() => return Ok(Event::Transition(request)),
                _ = self.looks.next().fuse() => self.ros.check_alive()?,
            }
        }
    }

    /// Makes a transition and answers the request. `work` does what the state that it is given is there for.
    pub fn carry_out(&mut self, request: &Request, work: impl FnMut(State) -> WorkResult) {
        if let Some(lifecycle) = &self.lifecycle {
            lifecycle.carry_out(request, work);
        }
    }

    /// Leaves the graph and announces it. Publishers and subscriptions must be dropped before.
    pub fn close(self) {
        if let Some(lifecycle) = self.lifecycle {
            lifecycle.close();
        }
        self.sim_time.close();
        if let Some(services) = self.services {
            services.close();
        }
        log::info!("leaving");
        logging::stop_rosout();
        self.ros.close();
    }

    fn follow_clock(&mut self, parameters: &Parameters) -> Result<(), EndpointError> {
        match parameters.spec(USE_SIM_TIME.name) {
            Some(_) => {
                let on = parameters.bool(USE_SIM_TIME.name);
                self.sim_time.follow(&mut self.ros, on)
            }
            None => Ok(()),
        }
    }
}

async fn received<T>(channel: &Receiver<T>) -> T {
    match channel.recv().await {
        Ok(message) => message,
        Err(_) => std::future::pending().await,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::environment::DiscoveryRange;
    use crate::messages::WireParameter;
    use crate::parameters::ParameterValue;
    use crate::parameters::sample::SAMPLE;
    use crate::participant::within;

    /// Events of the same process come in milliseconds; a loaded machine may take seconds.
    const PATIENCE: Duration = Duration::from_secs(10);

    /// A domain of this test run's own, among those whose ports are not handed out to clients.
    fn environment() -> Environment {
        Environment {
            domain_id: 20 + u16::try_from(std::process::id() % 40).expect("below 40"),
            discovery_range: DiscoveryRange::Localhost,
            ..Environment::default()
        }
    }

    fn rate(value: f64) -> WireParameter {
        let mut parameter = WireParameter {
            name: "rate_hz".to_owned(),
            ..WireParameter::default()
        };
        parameter.value.kind = crate::messages::parameter_type::DOUBLE;
        parameter.value.double_value = value;
        parameter
    }

    #[test]
    fn values_that_do_not_go_together_end_the_start() {
        let refused = Node::builder("sensor", SAMPLE)
            .check(|parameters| Err(format!("{} is too slow", parameters.double("rate_hz"))))
            .open(&Arguments::default(), &environment());
        let error = refused.err().expect("the check refuses everything");
        assert_eq!(error.to_string(), "10 is too slow");
    }

    #[test]
    fn changes_of_parameters_are_events_and_waiting_for_none_loses_none() {
        let mut node = Node::builder("sensor", SAMPLE)
            .open(&Arguments::default(), &environment())
            .expect("loopback exists");
        node.announce().expect("the names are valid");
        assert!(node.is_active(), "it is not managed");
        let (nothing, event) = smol::block_on(async {
            let nothing = within(Duration::from_millis(10), node.next()).await;
            node.parameters.set(&[rate(20.0)]).expect("it is allowed");
            (nothing, within(PATIENCE, node.next()).await)
        });
        assert!(nothing.is_none(), "nothing has happened: {nothing:?}");
        let Some(Ok(Event::Parameters(parameters))) = event else {
            unreachable!("expected parameters, got {event:?}");
        };
        let expected = ParameterValue::Double(20.0);
        assert_eq!(parameters.get("rate_hz"), Some(&expected));
        node.close();
    }
}
