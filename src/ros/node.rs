//! The node: parameters and marker map in, topics open, messages to the estimator until it has to stop.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use async_signal::{Signal, Signals};
use futures::StreamExt;
use ros2_client::NodeOptions;

use super::LOG_TARGET;
use super::arguments::Arguments;
use super::attitude::{self, AttitudeSubscription};
use super::clock::NodeClock;
use super::consumers::{self, Consumers, ConsumersError};
use super::environment::Environment;
use super::estimator::{Estimator, Output, Outputs};
use super::health::Watch;
pub use super::input::{DETECTIONS, FEATURE_POINTS};
use super::input::{InputReader, InputSubscription};
use super::logging;
use super::messages::{CameraInfo, Message};
use super::names::{NamesError, NodeNames};
use super::parameters::{ParameterServices, SharedParameters};
use super::participant::{
    EndpointError, OpenError, QosProfile, RosNode, Subscription, reliable, sensor_data,
};
use super::predicted_points::PredictedPoints;
use super::qos_overrides::{Endpoint, QosOverrides, Role};
use super::reset::ResetService;
use super::serve::Server;
use super::start_values::{StartParameterError, StartValues, start_values};
use crate::config::{self, AttitudeSource, Configuration, Parameters, TABLE};
use crate::pipeline::{Pipeline, budget_in_words};
use crate::refuelling::RefuellingSetup;
use crate::target::{MarkerMap, MarkerMapError};
use crate::text;

/// What the node is called unless it is remapped.
pub const NODE_NAME: &str = "tanker_pose";

/// Input: the camera that took the images.
pub const CAMERA_INFO: &str = "camera_info";
/// Input: the receiver's attitude, whatever its topic is called.
pub(super) const ATTITUDE: &str = "attitude";
/// Output: trusted poses.
pub const POSE: &str = "pose";
/// Output: the track, pose and twist.
pub const ODOMETRY: &str = "odometry";
/// Output: what became of every image.
pub const STATUS: &str = "status";
/// Output: where markers will be, for detectors.
pub const PREDICTED_POINTS: &str = "predicted_points";
/// Output: what can be drawn of it.
pub const MARKERS: &str = "markers";

/// Samples that wait for the node: enough for a hiccup, too few to lag behind.
const INPUT: QosProfile = sensor_data(10);
/// Half a second of a flight controller: samples before and after an image's stamp serve it too.
const ATTITUDE_INPUT: QosProfile = sensor_data(100);
/// One second of a 50 Hz camera, for subscribers that acknowledge late.
const OUTPUT: QosProfile = reliable(50);
/// As tf2 has it.
const TRANSFORMS: QosProfile = reliable(100);
const DIAGNOSTICS: QosProfile = reliable(10);

/// Why the node could not start.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NodeError {
    /// The node's name or a remap.
    #[error(transparent)]
    Names(#[from] NamesError),
    /// A parameter or a parameter file.
    #[error(transparent)]
    Parameters(#[from] StartParameterError),
    /// The marker map's file is missing, or not readable, or not text.
    #[error(
        "parameter \"marker_map\": cannot read {}: {source} (a path, or one of the shipped maps: paper, fin6)",
        text::path(path)
    )]
    MapUnreadable {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The marker map cannot be used.
    #[error("parameter \"marker_map\": {0}")]
    Map(#[from] MarkerMapError),
    /// An output for refuelling or a flight stack lacks what it needs.
    #[error(transparent)]
    Consumers(#[from] ConsumersError),
    /// Signals cannot be caught.
    #[error("cannot listen for SIGINT and SIGTERM: {0}")]
    Signals(std::io::Error),
    /// The graph cannot be joined.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// A topic cannot be opened.
    #[error(transparent)]
    Endpoint(#[from] EndpointError),
    /// Nothing can be heard or said any more.
    #[error(
        "the middleware has stopped: its threads do not survive suspending and resuming the process \
         (SIGSTOP, Ctrl-Z, a debugger); restart the node"
    )]
    MiddlewareGone,
}

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
/// Signals and logging are the caller's: without [`logging::start`] before, nothing is said anywhere.
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
    // What is wrong with fixed parameters, no transition can mend.
    configuration
        .consumers
        .check()
        .map_err(ConsumersError::from)?;
    start.leave_topics(&opened(&names, &configuration)?);
    // A managed node reads its files when it is configured.
    let files = if configuration.lifecycle {
        None
    } else {
        Some((
            marker_map(&configuration.marker_map)?,
            consumers::refuelling_setup(&configuration.consumers)?,
        ))
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
            Some((map, setup)) => server.start(&configuration, map, setup),
            None => server.start_managed(),
        })
        // Parameters last: who finds the services finds the topics too.
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
    let names = NodeNames::new(NODE_NAME, &arguments.remaps)?;
    let qos = QosOverrides::new(endpoints(&names)?);
    let start = start_values(
        arguments,
        &names.fully_qualified(),
        Parameters::new(TABLE),
        qos,
    )?;
    Ok((names, start))
}

/// Returns all topics that the node may have, for `qos_overrides`.
fn endpoints(names: &NodeNames) -> Result<Vec<Endpoint>, NamesError> {
    let endpoint = |topic, role, qos| Ok(Endpoint::new(names.topic(topic)?, role, qos));
    [
        (FEATURE_POINTS, Role::Subscription, &INPUT),
        (DETECTIONS, Role::Subscription, &INPUT),
        (CAMERA_INFO, Role::Subscription, &INPUT),
        (POSE, Role::Publisher, &OUTPUT),
        (ODOMETRY, Role::Publisher, &OUTPUT),
        (STATUS, Role::Publisher, &OUTPUT),
        (MARKERS, Role::Publisher, &OUTPUT),
        (PREDICTED_POINTS, Role::Publisher, &OUTPUT),
        ("/tf", Role::Publisher, &TRANSFORMS),
        ("/diagnostics", Role::Publisher, &DIAGNOSTICS),
        (
            attitude::VEHICLE_ATTITUDE,
            Role::Subscription,
            &ATTITUDE_INPUT,
        ),
        (attitude::IMU, Role::Subscription, &ATTITUDE_INPUT),
        (consumers::RECEPTACLE, Role::Publisher, &consumers::QOS),
        (
            consumers::PX4_LANDING_TARGET,
            Role::Publisher,
            &consumers::QOS,
        ),
        (
            consumers::PX4_FIDUCIAL_MARKER,
            Role::Publisher,
            &consumers::QOS,
        ),
        (
            consumers::MAVROS_LANDING_TARGET,
            Role::Publisher,
            &consumers::QOS,
        ),
        (consumers::MAVROS_POSE, Role::Publisher, &consumers::QOS),
    ]
    .into_iter()
    .map(|(topic, role, qos)| endpoint(topic, role, qos))
    .collect()
}

/// Returns the absolute names of the topics that this configuration opens.
fn opened(names: &NodeNames, configuration: &Configuration) -> Result<Vec<String>, NamesError> {
    let consumers = &configuration.consumers;
    let optional = [
        (configuration.publish_tf, "/tf"),
        (configuration.publish_markers, MARKERS),
        (configuration.publish_predicted_points, PREDICTED_POINTS),
        (consumers.receptacle, consumers::RECEPTACLE),
        (consumers.px4_landing_target, consumers::PX4_LANDING_TARGET),
        (
            consumers.px4_fiducial_marker,
            consumers::PX4_FIDUCIAL_MARKER,
        ),
        (
            consumers.mavros_landing_target,
            consumers::MAVROS_LANDING_TARGET,
        ),
        (consumers.mavros_pose, consumers::MAVROS_POSE),
    ];
    [
        configuration.input.topic(),
        CAMERA_INFO,
        POSE,
        ODOMETRY,
        STATUS,
        "/diagnostics",
    ]
    .into_iter()
    .chain(consumers.attitude.map(AttitudeSource::topic))
    .chain(
        optional
            .iter()
            .filter(|(on, _)| *on)
            .map(|(_, topic)| *topic),
    )
    .map(|topic| names.topic(topic))
    .collect()
}

/// Returns the shipped map of this name, or the one in the file at this path.
pub(super) fn marker_map(name: &str) -> Result<MarkerMap, NodeError> {
    if let Some(map) = MarkerMap::shipped(name) {
        return Ok(map);
    }
    let path = PathBuf::from(name);
    let text = crate::text_file::read(&path)
        .map_err(|source| NodeError::MapUnreadable { path, source })?;
    Ok(MarkerMap::from_yaml(&text, name)?)
}

pub(super) fn introduce(
    ros: &RosNode,
    environment: &Environment,
    map: &MarkerMap,
    configuration: &Configuration,
) {
    let names = ros.names();
    let topic = |name: &str| names.topic(name).unwrap_or_default();
    log::info!(
        "{} in domain {}, marker map {} with {} markers",
        names.fully_qualified(),
        environment.domain_id,
        text::quoted(map.name()),
        map.markers().len(),
    );
    let optional = [
        (configuration.publish_tf, "/tf"),
        (configuration.publish_markers, MARKERS),
        (configuration.publish_predicted_points, PREDICTED_POINTS),
    ];
    let published: Vec<String> = [POSE, ODOMETRY, STATUS, "/diagnostics"]
        .into_iter()
        .chain(optional.iter().filter(|(on, _)| *on).map(|(_, name)| *name))
        .map(topic)
        .collect();
    log::info!(
        "listening to {} and {}, publishing {}",
        topic(configuration.input.topic()),
        topic(CAMERA_INFO),
        published.join(", "),
    );
    let calibration = &configuration.settings.calibration;
    log::info!("{}", budget_in_words(map.budget(), calibration));
}

/// The topics that the node listens to.
pub(super) struct Inputs {
    pub(super) detections: InputSubscription,
    pub(super) camera_info: Subscription<CameraInfo>,
    pub(super) attitude: AttitudeSubscription,
    /// That of the detections.
    pub(super) topic: &'static str,
    pub(super) depths: Depths,
}

/// Most samples that may wait, by topic.
pub(super) struct Depths {
    pub(super) detections: usize,
    pub(super) camera_info: usize,
    pub(super) attitude: usize,
}

/// Opens the node's topics.
pub(super) fn open_topics(
    ros: &mut RosNode,
    configuration: &Configuration,
    setup: Option<RefuellingSetup>,
) -> Result<(Inputs, Outputs), EndpointError> {
    let transform = if configuration.publish_tf {
        Some(output(ros, "/tf", &TRANSFORMS)?)
    } else {
        None
    };
    let markers = if configuration.publish_markers {
        Some(output(ros, MARKERS, &OUTPUT)?)
    } else {
        None
    };
    let predicted_points = if configuration.publish_predicted_points {
        Some(PredictedPoints::new(output(
            ros,
            PREDICTED_POINTS,
            &OUTPUT,
        )?))
    } else {
        None
    };
    let outputs = Outputs {
        pose: output(ros, POSE, &OUTPUT)?,
        odometry: output(ros, ODOMETRY, &OUTPUT)?,
        tanker_frame_id: configuration.tanker_frame_id.clone(),
        status: output(ros, STATUS, &OUTPUT)?,
        transform,
        markers,
        predicted_points,
        diagnostics: output(ros, "/diagnostics", &DIAGNOSTICS)?,
        consumers: Consumers::open(ros, &configuration.consumers, setup)?,
    };
    // Inputs last: what arrives can be answered.
    let attitude = configuration.consumers.attitude;
    let depths = Depths {
        detections: ros.subscription_depth(configuration.input.topic(), &INPUT)?,
        camera_info: ros.subscription_depth(CAMERA_INFO, &INPUT)?,
        attitude: attitude.map_or(Ok(1), |source| {
            ros.subscription_depth(source.topic(), &ATTITUDE_INPUT)
        })?,
    };
    let inputs = Inputs {
        camera_info: ros.subscription(CAMERA_INFO, &INPUT)?,
        attitude: AttitudeSubscription::open(ros, attitude, &ATTITUDE_INPUT)?,
        detections: InputSubscription::open(ros, configuration.input, &INPUT)?,
        topic: configuration.input.topic(),
        depths,
    };
    Ok((inputs, outputs))
}

/// Returns what processes the messages, for this configuration and map.
pub(super) fn estimator(
    ros: &RosNode,
    configuration: &Configuration,
    map: &Arc<MarkerMap>,
    outputs: Outputs,
    clock: &NodeClock,
) -> Result<Estimator, NamesError> {
    let reader = InputReader {
        input: configuration.input,
        map: Arc::clone(map),
        max_hamming: configuration.max_hamming,
    };
    let pipeline = Pipeline::new(configuration.settings.clone(), Arc::clone(map));
    let names = ros.names();
    let watch = Watch::new(
        names.topic(configuration.input.topic())?,
        names.topic(CAMERA_INFO)?,
        Instant::now(),
    );
    let name = names.base_name();
    Ok(Estimator::new(
        pipeline,
        reader,
        outputs,
        clock.clone(),
        name,
        watch,
    ))
}

fn output<M: Message>(
    ros: &mut RosNode,
    topic: &str,
    qos: &QosProfile,
) -> Result<Output<M>, EndpointError> {
    let publisher = ros.publisher(topic, qos)?;
    Ok(Output::new(publisher, ros.names().topic(topic)?))
}
