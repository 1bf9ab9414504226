//! Prints how far the receptacle is before the probe tip, and how fast it comes nearer.
//!
//! ```sh
//! cargo run --example closing_speed                 # until Ctrl-C
//! cargo run --example closing_speed -- 10           # ten messages
//! ```
//!
//! The node needs `-p publish_receptacle:=true -p refuelling:=config/refuelling/example.yaml`. ROS arguments
//! (`--ros-args -r receptacle:=/uav1/receptacle`) and `ROS_DOMAIN_ID` count as for every node.

use std::error::Error;
use std::io::Write;

use futures::StreamExt;
use tanker_pose::ros::arguments::Arguments;
use tanker_pose::ros::consumers::RECEPTACLE;
use tanker_pose::ros::environment::Environment;
use tanker_pose::ros::messages::ReceptacleState;
use tanker_pose::ros::participant::{NodeOptions, RosNode, reliable};

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

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let (arguments, own) = Arguments::split(&words)?;
    let limit: usize = match own.first() {
        Some(number) => number.parse()?,
        None => usize::MAX,
    };
    let environment = Environment::from_process()?;
    let mut node = RosNode::open(
        "closing_speed",
        &arguments,
        &environment,
        NodeOptions::new().start_parameter_services(false),
    )?;
    let subscription = node.subscription::<ReceptacleState>(RECEPTACLE, &reliable(10))?;
    let mut out = std::io::stdout().lock();
    let printed = smol::block_on(async {
        let messages = subscription.async_stream();
        futures::pin_mut!(messages);
        let mut count = 0;
        while count < limit
            && let Some(sample) = messages.next().await
        {
            match sample {
                Ok((message, _)) => writeln!(out, "{}", line(&message))?,
                Err(error) => writeln!(out, "not a ReceptacleState: {error}")?,
            }
            out.flush()?;
            count += 1;
        }
        Ok::<(), std::io::Error>(())
    });
    drop(subscription);
    node.close();
    Ok(printed?)
}
