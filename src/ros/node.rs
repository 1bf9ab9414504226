//! The node: parameters and marker map in, topics open, messages to the estimator until it has to stop.
//!
//! It puts the parts of `ros2_node` together itself, rather than by `ros2_node::node::Node`: parameters decide which
//! topics there are, files are read before the graph is joined, it may run in a thread whose signals are the caller's,
//! and one loop keeps events and samples in order.

use async_signal::{Signal, Signals};
use futures::StreamExt;
use ros2_client::NodeOptions;

use super::LOG_TARGET;
use super::arguments::Arguments;
use super::clock::NodeClock;
use super::environment::Environment;
pub use super::error::NodeError;
use super::logging;
use super::names::NodeNames;
use super::parameters::{ParameterServices, SharedParameters};
use super::participant::RosNode;
use super::reset::ResetService;
use super::serve::Server;
use super::start_values::StartValues;
use super::topics;
use crate::answering::files::Files;
use crate::answering::start;
pub use crate::answering::start::NODE_NAME;
use crate::config::{self, Configuration};

/// Runs the node until SIGINT or SIGTERM, and leaves the graph; starts logging.
///
/// # Errors
/// [`NodeError`] when it cannot start; once it runs, nothing stops it but a signal and the end of the middleware.
pub fn run(arguments: &Arguments, environment: &Environment) -> Result<(), NodeError> {
    let names = NodeNames::new(NODE_NAME, &arguments.remaps)?;
    logging::start(arguments, &names, LOG_TARGET);
    // From here on a signal is kept until the node reads it, and ends it in good order.
    let mut signals = Signals::new([Signal::Int, Signal::Term]).map_err(NodeError::Signals)?;
    run_until(arguments, environment, async move {
        let _ = signals.next().await;
    })
}

/// Runs the node until `stop` ends, and leaves the graph: for programs that have a node in a thread of theirs.
///
/// Signals and logging are the caller's: without [`logging::start`] before, nothing is logged.
///
/// # Errors
/// [`NodeError`] when it cannot start; once it runs, nothing ends it but `stop` and the end of the middleware.
pub fn run_until(
    arguments: &Arguments,
    environment: &Environment,
    stop: impl Future<Output = ()>,
) -> Result<(), NodeError> {
    let (names, mut start) = effective_parameters(arguments)?;
    let configuration = Configuration::from(&start.parameters);
    // No transition can correct fixed parameters.
    config::check_together(&start.parameters)?;
    start.leave_topics(&topics::opened(&names, &configuration)?);
    // A managed node reads its files when it is configured.
    let files = if configuration.lifecycle {
        None
    } else {
        Some(Files::read(&configuration)?)
    };

    let options = NodeOptions::new().start_parameter_services(false);
    let mut ros = RosNode::open(NODE_NAME, arguments, environment, options)?;
    logging::start_rosout(ros.node().logging_handle());
    for warning in environment.warnings.iter().chain(&start.warnings) {
        log::warn!("{warning}");
    }
    ros.override_qos(start.qos.clone());
    let (parameters, changes) = SharedParameters::new(start.parameters, &start.qos, |changed| {
        config::check_together(changed).map_err(|error| error.to_string())
    });
    let clock = NodeClock::default();
    let mut server = Server::new(&mut ros, environment, &parameters, &clock);
    let served = server
        .follow_clock(configuration.use_sim_time)
        .and_then(|()| match files {
            Some(files) => server.start(&configuration, files),
            None => server.start_managed(),
        })
        // Parameters last: a client that finds the services finds the topics too.
        .and_then(|()| {
            let reset = ResetService::open(server.ros())?;
            let services = ParameterServices::open(server.ros(), &parameters, &clock)?;
            Ok((reset, services))
        })
        .map(|((reset, resets), parameter_services)| {
            let served = smol::block_on(server.serve(stop, changes, resets));
            reset.close();
            parameter_services.close();
            served
        });
    server.close();
    let served = served.map_err(NodeError::from).flatten();
    if served.is_ok() {
        log::info!("leaving");
    }
    logging::stop_rosout();
    ros.close();
    served
}

/// Returns the node's names, and the parameters that it starts with under these arguments.
///
/// # Errors
/// [`NodeError`] of a name, a file or a value.
pub fn effective_parameters(arguments: &Arguments) -> Result<(NodeNames, StartValues), NodeError> {
    Ok(start::effective_parameters(arguments)?)
}
