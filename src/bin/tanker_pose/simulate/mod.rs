//! `tanker_pose simulate`: a seeded approach, published as a camera and a detector would.

mod approach_options;
#[cfg(feature = "bags")]
mod bag;
pub mod fault;
mod pace;
mod report;
pub mod source;

use std::time::{Duration, Instant};

use async_signal::Signals;
use futures::StreamExt;
use futures::future::{Either, select};
use tanker_pose::ros::environment::Environment;
use tanker_pose::ros::names::NamesError;
use tanker_pose::ros::participant::{EndpointError, NodeOptions, RosNode, within};
use tanker_pose::ros::topics::{CAMERA_INFO, FEATURE_POINTS};
use tanker_pose::simulation::{Approach, SimulatedFrame};

use crate::ros_options::{RosOptions, between};
use crate::tool_node::{JoinError, ToolNode};
pub use approach_options::{ApproachError, ApproachOptions};
use fault::gross_error;
pub use pace::Pace;
use report::Report;
use source::{Source, SourceError};

/// What the node is called unless it is remapped.
const NODE_NAME: &str = "tanker_simulation";
/// For the last messages to leave, and to be asked for again.
const LINGER: Duration = Duration::from_millis(200);

/// Publish a simulated approach for a node to estimate.
///
/// Topics: `feature_points`, `camera_info` just before each, and the true pose as `geometry_msgs/PoseStamped` on
/// `truth`. They are stamped with the time of publication. The same options give the same pixels every time.
#[derive(Debug, clap::Args)]
#[command(allow_negative_numbers = true)]
pub struct Arguments {
    /// Start again at the first frame after the last, until a signal
    #[arg(long = "loop")]
    repeat: bool,
    /// Frame of the camera, x right, y down, z ahead
    #[arg(long, value_name = "NAME", default_value = "camera")]
    frame_id: String,
    /// Wait at most this long for subscribers of `feature_points` and `camera_info`, s; then continue
    #[arg(long, value_name = "S", default_value_t = 10.0, value_parser = between(0.0, 86400.0))]
    wait_s: f64,
    /// Print one JSON object for every frame, and nothing else
    #[arg(long)]
    json: bool,
    /// Write the approach into this MCAP file at once, instead of publishing it; no ROS is needed
    #[cfg(feature = "bags")]
    #[arg(long, value_name = "FILE", conflicts_with_all = ["repeat", "json", "ros_args"])]
    bag: Option<std::path::PathBuf>,
    #[command(flatten)]
    ros: RosOptions,
    // Headings hold for all that comes after them: from here on in this order.
    /// Move one detection by --gross-error-px in every Nth frame; 0: never
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = "Faults")]
    gross_error_every: u32,
    /// How far, px
    #[arg(long, value_name = "PX", default_value_t = 40.0, help_heading = "Faults", value_parser = between(0.0, 10000.0))]
    gross_error_px: f64,
    #[command(flatten)]
    approach: ApproachOptions,
}

/// Why the simulation cannot run.
#[derive(Debug, thiserror::Error)]
pub enum SimulateError {
    #[error(transparent)]
    Approach(#[from] ApproachError),
    #[error(transparent)]
    Join(#[from] JoinError),
    #[error(transparent)]
    Names(#[from] NamesError),
    #[error(transparent)]
    Endpoint(#[from] EndpointError),
    #[error(transparent)]
    Source(#[from] SourceError),
    #[cfg(feature = "bags")]
    #[error(transparent)]
    Bag(#[from] bag::BagError),
}

/// Publishes the approach until it ends, or until SIGINT or SIGTERM.
pub fn run(arguments: &Arguments) -> Result<(), SimulateError> {
    let (approach, camera_info) = arguments.approach.read()?;
    #[cfg(feature = "bags")]
    if let Some(path) = &arguments.bag {
        let mut bag = bag::Bag::create(path, &camera_info, &arguments.frame_id)?;
        for index in 0..approach.frame_count() {
            bag.write(&arguments.frame(&approach, index).0)?;
        }
        return Ok(bag.finish()?);
    }
    let mut node = ToolNode::join(NODE_NAME, &arguments.ros, None, NodeOptions::new())?;
    let length = (!arguments.repeat).then(|| approach.frame_count());
    let report = Report::new(arguments.json, length, arguments.approach.rate_hz);
    let result = introduce(&report, arguments, &node.ros, &node.environment)
        .map_err(SimulateError::from)
        .and_then(|()| {
            let source = Source::open(&mut node.ros, &camera_info, &arguments.frame_id)?;
            let mut simulation = Simulation {
                arguments,
                approach,
                source,
                report,
            };
            smol::block_on(simulation.run(&node.ros, &mut node.signals))
        });
    node.leave();
    result
}

fn introduce(
    report: &Report,
    arguments: &Arguments,
    ros: &RosNode,
    environment: &Environment,
) -> Result<(), NamesError> {
    let names = ros.names();
    report.say(&format!(
        "{} in domain {}: {}{}\npublishing {}, {}, {}",
        names.fully_qualified(),
        environment.domain_id,
        arguments.approach,
        if arguments.repeat {
            ", again and again"
        } else {
            ""
        },
        names.topic(FEATURE_POINTS.name)?,
        names.topic(CAMERA_INFO.name)?,
        names.topic(source::TRUTH)?,
    ));
    Ok(())
}

impl Arguments {
    /// Returns a frame, and the id of the detection that was moved.
    fn frame(&self, approach: &Approach, index: u32) -> (SimulatedFrame, Option<u32>) {
        let mut frame = approach.frame(index);
        let every = self.gross_error_every;
        let fault = if every > 0 && (index + 1).is_multiple_of(every) {
            gross_error(
                &mut frame.detections,
                self.gross_error_px,
                self.approach.seed,
                index,
            )
        } else {
            None
        };
        (frame, fault)
    }
}

struct Simulation<'a> {
    arguments: &'a Arguments,
    approach: Approach,
    source: Source,
    report: Report,
}

impl Simulation<'_> {
    async fn run(&mut self, ros: &RosNode, signals: &mut Signals) -> Result<(), SimulateError> {
        if self.wait(ros, signals).await {
            self.publish(signals).await?;
            smol::Timer::after(LINGER).await;
        }
        self.report.finish();
        Ok(())
    }

    /// Waits for subscribers; returns whether to continue.
    async fn wait(&mut self, ros: &RosNode, signals: &mut Signals) -> bool {
        let patience = Duration::from_secs_f64(self.arguments.wait_s);
        if patience.is_zero() {
            return true;
        }
        self.report
            .say("waiting for subscribers of feature_points and camera_info");
        let heard = within(patience, self.source.wait_for_subscribers(ros));
        match select(Box::pin(heard), signals.next()).await {
            Either::Left((Some(()), _)) => {}
            Either::Left((None, _)) => self.report.say(&format!(
                "no subscriber of both feature_points and camera_info after {} s: continuing without",
                self.arguments.wait_s
            )),
            Either::Right(_) => return false,
        }
        true
    }

    async fn publish(&mut self, signals: &mut Signals) -> Result<(), SimulateError> {
        let count = self.approach.frame_count();
        let mut pace = Pace::new(self.arguments.approach.rate_hz, Instant::now());
        for number in 0_u64.. {
            if number >= u64::from(count) && !self.arguments.repeat {
                break;
            }
            if let Some(late) = pace.make_up(number, Instant::now()) {
                let late_s = late.as_secs_f64();
                self.report
                    .say(&format!("delayed by {late_s:.1} s: continuing from here"));
            }
            let due = smol::Timer::at(pace.due(number));
            if let Either::Right(_) = select(due, signals.next()).await {
                break;
            }
            // Below count, which is an u32.
            let index = u32::try_from(number % u64::from(count)).unwrap_or(0);
            self.publish_frame(number, index)?;
        }
        Ok(())
    }

    fn publish_frame(&mut self, number: u64, index: u32) -> Result<(), SimulateError> {
        let (frame, fault) = self.arguments.frame(&self.approach, index);
        let sent = self
            .source
            .publish(&frame.truth_camera_from_tanker, &frame.detections)?;
        self.report.frame(number, &frame, fault, &sent);
        Ok(())
    }
}
