//! The node and its graph: the only floor that knows ros2-client, files, clocks and signals.
//!
//! ```text
//! topics                             the one table of the node's topics
//! messages, convert, input           the wire <-> plain types
//! output, outputs, inputs            what the node publishes on and listens to, opened from the table
//! files, error                       the files that parameters name; why the node cannot start
//! health, understood, diagnostics    faults around the node, said and shown
//! attitude, attitudes                what receiver and tanker report of their attitudes
//! consumers                          messages for refuelling and flight stacks, by the receiver's attitude
//! predicted_points, reset            where detectors may look in the next image; `~/reset`
//! monitor, handler                   the node's health once a second; one message's work
//! node, serve                        all of it together, until a signal or a tool ends it
//! ```
//!
//! What any node needs comes from the crate [`ros2_node`], whose modules stand here beside ours: arguments, names,
//! parameters behind their services, lifecycle, time, log, and the way into the graph and out of it. Tools that talk ROS
//! start from [`participant::RosNode::open`].

pub mod attitude;
mod attitudes;
pub mod consumers;
pub mod convert;
pub mod diagnostics;
mod error;
mod files;
mod handler;
pub mod health;
pub mod input;
mod inputs;
mod integrity;
pub mod messages;
mod monitor;
pub mod node;
pub mod output;
mod outputs;
pub mod predicted_points;
pub mod reset;
mod serve;
#[cfg(test)]
mod tests;
pub mod topics;
mod understood;

pub use ros2_node::{
    arguments, clock, distribution, environment, graph, jump, leave, lifecycle, logging, names,
    newest, once, overrides, parameter_file, parameters, participant, qos_overrides, rtps, rules,
    running_nodes, service, start_values, system_clock,
};

/// What the targets of this package's log lines begin with: those of its library and of its programs.
pub const LOG_TARGET: &str = "tanker_pose";
