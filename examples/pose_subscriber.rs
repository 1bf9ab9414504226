//! Prints every trusted pose, and the reason when there is none: a subscriber without a ROS installation.
//!
//! ```sh
//! cargo run --example pose_subscriber               # until Ctrl-C
//! cargo run --example pose_subscriber -- 10         # ten poses
//! ```
//!
//! ROS arguments (`--ros-args -r __ns:=/receiver -r pose:=other`) and `ROS_DOMAIN_ID` count as for every node.
//! The same in Python is `examples/pose_subscriber.py`; `tanker_pose watch` shows more, and needs no program.

use std::error::Error;
use std::io::{self, Write};
use std::pin::pin;
use std::time::{Duration, Instant};

use async_signal::{Signal, Signals};
use futures::{StreamExt, select};
use tanker_pose::pipeline::OutcomeCode;
use tanker_pose::ros::arguments::Arguments;
use tanker_pose::ros::environment::Environment;
use tanker_pose::ros::messages::{EstimatorStatus, PoseWithCovarianceStamped};
use tanker_pose::ros::participant::{NodeOptions, RosNode, Subscription, reliable};
use tanker_pose::ros::topics::{POSE, STATUS};

/// Your own limit of the standard deviation of the position, m.
const LARGEST_SIGMA_M: f64 = 0.5;
/// When detections stop, neither pose nor status comes: only the age of the last pose tells.
const SILENCE: Duration = Duration::from_secs(2);

/// Comes for trusted frames only.
fn pose_line(message: &PoseWithCovarianceStamped) -> String {
    // Of the tanker in the camera: right, down, ahead.
    let position = message.pose.pose.position;
    // The diagonal of the 6×6 covariance; its first three are of the position.
    let sigma_m = [0, 7, 14].map(|k| message.pose.covariance[k].sqrt());
    if sigma_m.iter().any(|sigma| *sigma > LARGEST_SIGMA_M) {
        return format!("too uncertain: {sigma_m:.2?} m");
    }
    format!("{:.2} m ahead, sigma {:.2} m", position.z, sigma_m[2])
}

/// Comes for every frame; most of the time there is nothing to say.
fn status_line(message: &EstimatorStatus) -> Option<String> {
    if message.outcome != OutcomeCode::Ok.number() {
        Some(format!(
            "no pose ({}): {}",
            message.outcome, message.message
        ))
    } else if !message.rejected_ids.is_empty() {
        Some(format!("left out as wrong: {:?}", message.rejected_ids))
    } else {
        None
    }
}

fn say(line: &str) -> io::Result<()> {
    let mut out = io::stdout().lock();
    writeln!(out, "{line}")?;
    out.flush()
}

/// Prints until `limit` poses have come, or a signal.
async fn follow(
    poses: &Subscription<PoseWithCovarianceStamped>,
    statuses: &Subscription<EstimatorStatus>,
    signals: &mut Signals,
    limit: usize,
) -> io::Result<()> {
    let (mut poses, mut statuses) = (pin!(poses.async_stream()), pin!(statuses.async_stream()));
    let mut signals = signals.fuse();
    let mut seconds = StreamExt::fuse(smol::Timer::interval(Duration::from_secs(1)));
    let (mut count, mut latest) = (0, Instant::now());
    while count < limit {
        select! {
            _ = signals.next() => break,
            sample = poses.select_next_some() => match sample {
                Ok((message, _)) => {
                    say(&pose_line(&message))?;
                    latest = Instant::now();
                    count += 1;
                }
                Err(error) => say(&format!("not a PoseWithCovarianceStamped: {error}"))?,
            },
            sample = statuses.select_next_some() => match sample {
                Ok((message, _)) => if let Some(line) = status_line(&message) {
                    say(&line)?;
                },
                Err(error) => say(&format!("not an EstimatorStatus: {error}"))?,
            },
            _ = seconds.select_next_some() => if latest.elapsed() > SILENCE {
                say(&format!("no pose for {:.0} s", latest.elapsed().as_secs_f64()))?;
            },
        }
    }
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let (arguments, own) = Arguments::split(&words)?;
    let limit: usize = match own.first() {
        Some(number) => number.parse()?,
        None => usize::MAX,
    };
    let environment = Environment::from_process()?;
    let mut signals = Signals::new([Signal::Int, Signal::Term])?;
    let options = NodeOptions::new().start_parameter_services(false);
    let mut node = RosNode::open("pose_subscriber", &arguments, &environment, options)?;
    let poses = node.subscription::<PoseWithCovarianceStamped>(POSE.name, &reliable(10))?;
    let statuses = node.subscription::<EstimatorStatus>(STATUS.name, &reliable(10))?;
    let followed = smol::block_on(follow(&poses, &statuses, &mut signals, limit));
    // Endpoints go before their node, and the node says goodbye.
    drop((poses, statuses));
    node.close();
    Ok(followed?)
}
