//! `tanker_pose demo`: the whole way over real DDS, measured against the truth.

mod domain;
mod error;
mod flight;
mod graph;
mod ledger;
mod live;
mod node_thread;
mod plan;
mod statistics;
mod summary;
mod words;

use std::time::Duration;

use async_signal::{Signal, Signals};
use tanker_pose::config::{Configuration, Parameters, TABLE};
use tanker_pose::ros::arguments::{ArgumentError, Arguments as RosArguments};
use tanker_pose::ros::names::NodeNames;
use tanker_pose::ros::node::NODE_NAME;
use tanker_pose::ros::{LOG_TARGET, logging};
use tanker_pose::target::MarkerMap;

use crate::ros_options::between;
use crate::simulate::ApproachOptions;
pub use error::DemoError;
use flight::{End, Flight};
use graph::Graph;
use ledger::Ledger;
use live::Live;
use node_thread::NodeThread;
use summary::Summary;

/// See it work: a simulated approach, the node, and its error against the truth.
///
/// The node is the real one, in a thread of this process; all messages go over real DDS on this host's loopback.
/// In the middle, faults are injected on purpose. Positions and errors stand along the camera's axes: right, down,
/// ahead. The exit code is 0 when every frame got an outcome: an estimate, or a refusal with its reason.
#[derive(Debug, clap::Args)]
#[command(allow_negative_numbers = true)]
pub struct Arguments {
    /// DDS domain; when missing, that of `ROS_DOMAIN_ID`, or one from 50 to 99 that is free on this host
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(0..=232))]
    domain_id: Option<u16>,
    /// Inject no faults
    #[arg(long)]
    no_faults: bool,
    /// Wait at most this long for node and simulation to find each other, s
    #[arg(long, value_name = "S", default_value_t = 10.0, value_parser = between(0.1, 3600.0))]
    wait_s: f64,
    /// Print the summary as one JSON object, and nothing else
    #[arg(long)]
    json: bool,
    /// Print the node's log too
    #[arg(short, long)]
    verbose: bool,
    #[command(flatten)]
    approach: ApproachOptions,
}

/// Runs the demo to its end, or until SIGINT or SIGTERM.
pub fn run(arguments: &Arguments) -> Result<(), DemoError> {
    let (approach, camera_info) = arguments.approach.read()?;
    let map = arguments.approach.map()?;
    check_marker_count(&map)?;
    let environment = domain::environment(arguments.domain_id)?;
    let ros_arguments = node_arguments(&arguments.approach)?;
    // From here on a signal is kept until it is read, and ends both nodes in good order.
    let mut signals = Signals::new([Signal::Int, Signal::Term]).map_err(DemoError::Signals)?;
    if arguments.verbose {
        let names = NodeNames::new(NODE_NAME, &[])?;
        logging::start(&ros_arguments, &names, LOG_TARGET);
    }
    let mut live = Live::new(
        arguments.json,
        arguments.verbose,
        &arguments.approach,
        &approach,
    );
    live.introduce(&environment, arguments.approach.world_in_words(&map));

    let faults_on = (!arguments.no_faults).then_some(&map);
    let patience = Duration::from_secs_f64(arguments.wait_s);
    let node = NodeThread::start(ros_arguments, environment.clone())?;
    let mut flight = Flight::new(approach, &arguments.approach, faults_on, patience);
    let flown = Graph::open(&environment, &camera_info).and_then(|mut graph| {
        let flown = smol::block_on(graph.run(&mut flight, &mut live, &mut signals, &node));
        graph.close();
        flown
    });
    let node_ended = node.stop();
    live.finish();
    // The node's error is more useful than that it ended.
    let end = match flown {
        Err(DemoError::NodeGone) => node_ended.and(Err(DemoError::NodeGone)),
        flown => flown,
    }?;
    let is_one_draw = arguments.approach.has_lasting_errors();
    report(flight.ledger(), end, is_one_draw, arguments.json)
}

/// The node runs with its defaults.
fn check_marker_count(map: &MarkerMap) -> Result<(), DemoError> {
    let need = Configuration::from(&Parameters::new(TABLE))
        .settings
        .estimator
        .min_points;
    let got = map.markers().len();
    if got < need {
        let map = map.name().to_owned();
        return Err(DemoError::TooFewMarkers { map, got, need });
    }
    Ok(())
}

fn report(ledger: &Ledger, end: End, is_one_draw: bool, json: bool) -> Result<(), DemoError> {
    let interrupted = end == End::Interrupted;
    if interrupted && ledger.sent() == 0 {
        return Ok(());
    }
    let summary = Summary::new(ledger, interrupted, is_one_draw);
    summary.print(json);
    match summary.missing() {
        0 => Ok(()),
        missing => Err(DemoError::Missing {
            missing,
            sent: ledger.sent(),
        }),
    }
}

/// The node's arguments: its defaults, except for the marker map and the errors of a drawn camera.
fn node_arguments(approach: &ApproachOptions) -> Result<RosArguments, ArgumentError> {
    let mut words = vec!["--ros-args".to_owned(), "-p".to_owned()];
    // Quoted, so that a path that looks like a number stays text.
    let path = approach.marker_map.replace('\'', "''");
    words.push(format!("marker_map:='{path}'"));
    for (name, value) in approach.parameters() {
        words.extend(["-p".to_owned(), format!("{name}:={value:?}")]);
    }
    Ok(RosArguments::split(&words)?.0)
}
