//! Prints how far the receptacle is before the probe tip, and how fast it comes nearer.
//!
//! ```sh
//! cargo run --example closing_speed                 # until Ctrl-C
//! cargo run --example closing_speed -- 10           # ten messages
//! ```
//!
//! The node needs `-p publish_receptacle:=true -p refuelling:=config/refuelling/example.yaml`: while nothing comes,
//! what is missing is printed on standard error. ROS arguments (`--ros-args -r receptacle:=/uav1/receptacle`) and
//! `ROS_DOMAIN_ID` count as for every node.

use std::error::Error;
use std::io::{self, Write};
use std::pin::pin;
use std::time::{Duration, Instant};

use async_signal::{Signal, Signals};
use futures::{StreamExt, select};
use tanker_pose::ros::arguments::Arguments;
use tanker_pose::ros::environment::Environment;
use tanker_pose::ros::messages::{EstimatorStatus, ReceptacleState};
use tanker_pose::ros::names::NamesError;
use tanker_pose::ros::participant::{NodeOptions, RosNode, Subscription, reliable};
use tanker_pose::ros::topics::RECEPTACLE;

/// So long without a message something is missing.
const PATIENCE: Duration = Duration::from_secs(5);

fn line(message: &ReceptacleState) -> String {
    let envelope = match message.envelope {
        ReceptacleState::ENVELOPE_CONTACT => "contact window",
        ReceptacleState::ENVELOPE_PRE_CONTACT => "pre-contact",
        _ => "outside",
    };
    format!(
        "distance {:7.3} m  closing {:+7.3} m/s ±{:.3}  {envelope} (contact {:.1} %)",
        message.distance,
        message.closing_speed,
        message.closing_speed_sigma,
        100.0 * message.probability_contact,
    )
}

/// Returns why nothing comes, as far as the graph shows it.
fn missing(node: &RosNode, domain_id: u16) -> Result<String, NamesError> {
    let topic = node.names().topic(RECEPTACLE.name)?;
    let why = if node.publisher_count(RECEPTACLE.name)? > 0 {
        "it has a publisher, so the node has no confirmed track: `tanker_pose watch` says why"
            .to_owned()
    } else if node.domain::<EstimatorStatus>().nodes.is_empty() {
        format!("no tanker_pose node is in domain {domain_id}")
    } else {
        "a tanker_pose node is there, but does not publish it. Start the node with \
         -p publish_receptacle:=true -p refuelling:=config/refuelling/example.yaml, or remap the topic"
            .to_owned()
    };
    Ok(format!("nothing on {topic}: {why}"))
}

/// Prints until `limit` messages have come, or a signal.
async fn print(
    subscription: &Subscription<ReceptacleState>,
    signals: &mut Signals,
    limit: usize,
    missing: impl Fn() -> Result<String, NamesError>,
) -> Result<(), Box<dyn Error>> {
    let mut out = io::stdout().lock();
    let mut messages = pin!(subscription.async_stream());
    let mut signals = signals.fuse();
    let mut seconds = StreamExt::fuse(smol::Timer::interval(Duration::from_secs(1)));
    let (mut count, mut said_or_heard) = (0, Instant::now());
    while count < limit {
        select! {
            _ = signals.next() => break,
            sample = messages.select_next_some() => {
                match sample {
                    Ok((message, _)) => writeln!(out, "{}", line(&message))?,
                    Err(error) => writeln!(out, "not a ReceptacleState: {error}")?,
                }
                out.flush()?;
                count += 1;
                said_or_heard = Instant::now();
            }
            _ = seconds.select_next_some() => if said_or_heard.elapsed() > PATIENCE {
                writeln!(io::stderr(), "{}", missing()?)?;
                said_or_heard = Instant::now();
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
    let mut node = RosNode::open(
        "closing_speed",
        &arguments,
        &environment,
        NodeOptions::new().start_parameter_services(false),
    )?;
    let subscription = node.subscription::<ReceptacleState>(RECEPTACLE.name, &reliable(10))?;
    let printed = smol::block_on(print(&subscription, &mut signals, limit, || {
        missing(&node, environment.domain_id)
    }));
    drop(subscription);
    node.close();
    printed
}
