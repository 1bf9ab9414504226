//! The demo's own node: the simulated sensor, and ears for the answers.

use std::time::{Duration, Instant};

use async_signal::Signals;
use futures::{FutureExt, StreamExt, pin_mut, select_biased};
use tanker_pose::camera::CameraInfo;
use tanker_pose::ros::arguments::Arguments;
use tanker_pose::ros::environment::Environment;
use tanker_pose::ros::messages::{EstimatorStatus, PoseWithCovarianceStamped};
use tanker_pose::ros::participant::{
    NodeOptions, QosProfile, RosNode, Subscription, asked_anew, reliable, within,
};
use tanker_pose::ros::topics::{CAMERA_INFO, FEATURE_POINTS, POSE, STATUS};

use super::error::DemoError;
use super::flight::{End, Flight};
use super::live::Live;
use super::node_thread::NodeThread;
use crate::simulate::source::Source;

const NODE_NAME: &str = "tanker_demo";
const FRAME_ID: &str = "camera";
/// Reliable, so that an answer that is missing is one that the node did not give.
const ANSWERS: QosProfile = reliable(100);
/// How often the graph is checked for other endpoints.
const LOOK_AROUND: Duration = Duration::from_millis(200);

/// The demo in the graph. The fields stand in the order in which they have to be dropped.
pub struct Graph {
    source: Source,
    pose: Subscription<PoseWithCovarianceStamped>,
    status: Subscription<EstimatorStatus>,
    ros: RosNode,
    domain_id: u16,
}

impl Graph {
    /// Joins the graph.
    pub fn open(environment: &Environment, camera: &CameraInfo) -> Result<Self, DemoError> {
        let arguments = Arguments::default();
        let mut ros = RosNode::open(NODE_NAME, &arguments, environment, NodeOptions::new())?;
        Ok(Self {
            source: Source::open(&mut ros, camera, FRAME_ID)?,
            pose: ros.subscription(POSE.name, &ANSWERS)?,
            status: ros.subscription(STATUS.name, &ANSWERS)?,
            ros,
            domain_id: environment.domain_id,
        })
    }

    /// Runs the flight until it ends, or a signal ends it.
    pub async fn run(
        &mut self,
        flight: &mut Flight,
        live: &mut Live,
        signals: &mut Signals,
        node: &NodeThread,
    ) -> Result<End, DemoError> {
        let mut signals = StreamExt::fuse(signals);
        let ended = node.ended().fuse();
        pin_mut!(ended);
        {
            let connected = self.connect(flight.patience()).fuse();
            pin_mut!(connected);
            select_biased! {
                _ = signals.next() => return Ok(End::Interrupted),
                () = ended => return Err(DemoError::NodeGone),
                result = connected => result?,
            }
        }
        let poses = self.pose.async_stream();
        let statuses = self.status.async_stream();
        let looks_around = StreamExt::fuse(smol::Timer::interval(LOOK_AROUND));
        pin_mut!(poses, statuses, looks_around);
        loop {
            if let Some(end) = flight.end() {
                return Ok(end);
            }
            let mut due = FutureExt::fuse(smol::Timer::at(flight.due()));
            select_biased! {
                _ = signals.next() => flight.interrupt(),
                () = ended => return Err(DemoError::NodeGone),
                sample = poses.select_next_some() => match sample {
                    Ok((message, _)) => flight.on_pose(&message, Instant::now(), live),
                    Err(error) => log::warn!("cannot decode a pose: {error}"),
                },
                sample = statuses.select_next_some() => match sample {
                    Ok((message, _)) => flight.on_status(message, live),
                    Err(error) => log::warn!("cannot decode a status: {error}"),
                },
                _ = looks_around.select_next_some() => check_alone(&self.ros, self.domain_id)?,
                _ = due => if let Some(end) = flight.act(&mut self.source, live)? {
                    return Ok(end);
                },
            }
        }
    }

    /// Waits until the graph shows this node's topics matched, without other endpoints on them.
    async fn connect(&self, patience: Duration) -> Result<(), DemoError> {
        let node = self.ros.node();
        let lacking = |what: &str| DemoError::Discovery {
            wait_s: patience.as_secs_f64(),
            reason: what.to_owned(),
        };
        within(patience, self.source.wait_for_subscribers(&self.ros))
            .await
            .ok_or_else(|| lacking("no subscriber of feature_points and camera_info"))?;
        let answers = async {
            asked_anew(|| self.pose.wait_for_publisher(node)).await;
            asked_anew(|| self.status.wait_for_publisher(node)).await;
        };
        within(patience, answers)
            .await
            .ok_or_else(|| lacking("no publisher of pose and status"))?;
        check_alone(&self.ros, self.domain_id)
    }

    /// Leaves the graph.
    pub fn close(self) {
        let Self {
            source,
            pose,
            status,
            ros,
            ..
        } = self;
        drop((source, pose, status));
        ros.close();
    }
}

/// The demo and another camera or estimator would disturb each other.
fn check_alone(ros: &RosNode, domain_id: u16) -> Result<(), DemoError> {
    // The graph does not list the asking node's own publishers.
    for (topic, expected) in [
        (FEATURE_POINTS.name, 0),
        (CAMERA_INFO.name, 0),
        (POSE.name, 1),
        (STATUS.name, 1),
    ] {
        if ros.publisher_count(topic)? > expected {
            return Err(DemoError::DomainInUse { domain_id, topic });
        }
    }
    Ok(())
}
