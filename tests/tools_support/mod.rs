//! Shared by the tests of the tools.

#![allow(dead_code)] // each test binary uses its part

use std::process::{Child, Command};

use serde_json::Value;
use tanker_pose::ros::arguments::Arguments;
use tanker_pose::ros::environment::{DiscoveryRange, Environment};
use tanker_pose::ros::participant::{NodeOptions, RosNode};

/// A domain that nothing else of this test run uses, below those that a demo picks by itself.
fn domain(offset: u32) -> u16 {
    let domain = 10 + 5 * offset + std::process::id() % 5;
    u16::try_from(domain).expect("offsets are small")
}

/// The tool on loopback, in the domain of the test with this offset.
pub fn tool(offset: u32) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_tanker_pose"));
    command
        .env("ROS_DOMAIN_ID", domain(offset).to_string())
        .env("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        .env_remove("ROS_LOCALHOST_ONLY")
        .env_remove("RUST_LOG");
    command
}

/// A node of the test's own in the same domain.
pub fn listener(offset: u32) -> RosNode {
    let environment = Environment {
        domain_id: domain(offset),
        discovery_range: DiscoveryRange::Localhost,
        ..Environment::default()
    };
    RosNode::open(
        "listener",
        &Arguments::default(),
        &environment,
        NodeOptions::new(),
    )
    .expect("loopback exists")
}

/// What a tool printed, a JSON object a line.
pub fn json_lines(stdout: &[u8]) -> Vec<Value> {
    String::from_utf8_lossy(stdout)
        .lines()
        .map(|line| serde_json::from_str(line).expect("each line is a JSON object"))
        .collect()
}

/// Sends SIGINT.
pub fn interrupt(child: &Child) {
    let sent = Command::new("kill")
        .args(["-s", "INT", &child.id().to_string()])
        .status();
    assert!(sent.expect("kill is part of the system").success());
}
