//! A managed node that publishes the time in a frame, as often as its parameter says:
//! `cargo run --example talker -- --ros-args -p rate_hz:=2 -r header:=time`.
use std::time::Duration;

use ros2_node::arguments::Arguments;
use ros2_node::environment::Environment;
use ros2_node::lifecycle::WorkResult;
use ros2_node::messages::Header;
use ros2_node::node::{Event, MiddlewareGone, Node};
use ros2_node::parameters::{ParameterSpec, USE_SIM_TIME};
use ros2_node::participant::{Publisher, QosProfile, reliable, within};
use ros2_node::qos_overrides::Role;

const PARAMETERS: &[ParameterSpec] = &[
    ParameterSpec::double("rate_hz", 10.0, [0.1, 100.0], "Hz, of all headers"),
    ParameterSpec::frame_id("frame_id", "sensor", "of all headers").read_only(),
    USE_SIM_TIME,
];
const QOS: QosProfile = reliable(10);

fn main() {
    if let Err(error) = talk() {
        eprintln!("talker: {error}");
        std::process::exit(1);
    }
}

fn talk() -> Result<(), Box<dyn std::error::Error>> {
    let (arguments, _) = Arguments::split(&std::env::args().skip(1).collect::<Vec<_>>())?;
    let mut node = Node::builder("talker", PARAMETERS)
        .topic("header", Role::Publisher, &QOS)
        .managed()
        .logging("talker")
        .open(&arguments, &Environment::from_process()?)?;
    let publisher = node.ros().publisher("header", &QOS)?;
    node.announce()?;
    let ran = smol::block_on(run(&mut node, &publisher));
    drop(publisher); // endpoints go before their node
    node.close();
    Ok(ran?)
}

async fn run(node: &mut Node, publisher: &Publisher<Header>) -> Result<(), MiddlewareGone> {
    loop {
        let parameters = node.parameters();
        let period = Duration::from_secs_f64(1.0 / parameters.double("rate_hz"));
        match within(period, node.next()).await.transpose()? {
            Some(Event::Stop) => return Ok(()),
            Some(Event::Transition(request)) => node.carry_out(&request, |_| WorkResult::Success),
            None if node.is_active() => {
                let (stamp, frame_id) = (node.clock().now(), parameters.text("frame_id").into());
                if let Err(error) = publisher.publish(Header { stamp, frame_id }) {
                    log::warn!("a header is not published: {error}");
                }
            }
            Some(_) | None => {} // the parameters are read above
        }
    }
}
