//! The node and its graph: the only floor that knows ros2-client, files, clocks and signals.
//!
//! ```text
//! messages, convert, input           the wire <-> plain types
//! health                             faults around the node, said and shown
//! consumers, attitude                what refuelling and flight stacks are told, by the receiver's attitude
//! predicted_points, reset            where detectors may look in the next image; `~/reset`
//! estimator, diagnostics             one message's work, and the node's health once a second
//! node, serve                        all of it together, until a signal or a tool ends it
//! ```
//!
//! What any node needs comes from the crate [`ros2_node`], whose modules stand here beside ours: arguments, names,
//! parameters behind their services, lifecycle, time, log, and the way into the graph and out of it. Tools that talk ROS
//! start from [`participant::RosNode::open`].

pub mod attitude;
pub mod consumers;
pub mod convert;
pub mod diagnostics;
pub mod estimator;
pub mod health;
pub mod input;
pub mod messages;
pub mod node;
pub mod predicted_points;
pub mod reset;
mod serve;
#[cfg(test)]
mod tests;
mod understood;

pub use ros2_node::{
    arguments, clock, distribution, environment, graph, jump, leave, lifecycle, logging, names,
    newest, once, overrides, parameter_file, parameters, participant, qos_overrides, rtps, rules,
    running_nodes, service, start_values, system_clock,
};

/// What the targets of this package's log lines begin with: those of its library and of its programs.
pub const LOG_TARGET: &str = "tanker_pose";
