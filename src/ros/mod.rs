//! The node and its graph: the only floor that knows ros2-client, files, clocks and signals.
//!
//! ```text
//! output, inputs, input, attitude    what the node publishes on and listens to, opened from the table of topics
//! reset, error                       `~/reset`; why the node cannot start
//! node, serve                        all of it together, until a signal or a tool ends it
//! ```
//!
//! What becomes of a message is `answering`'s.
//!
//! What any node needs comes from the crate [`ros2_node`], whose modules stand here beside ours: arguments, names,
//! parameters behind their services, lifecycle, time, log, and the way into the graph and out of it. Tools that talk ROS
//! start from [`participant::RosNode::open`].

pub mod attitude;
mod error;
pub mod input;
mod inputs;
pub mod node;
pub mod output;
pub mod reset;
mod serve;
#[cfg(test)]
mod tests;

pub use crate::answering::{diagnostics, health, topics};
pub use crate::{convert, messages};
pub use ros2_node::{
    arguments, clock, distribution, environment, graph, jump, leave, lifecycle, logging, names,
    newest, once, overrides, parameter_file, parameters, participant, qos_overrides, rtps, rules,
    running_nodes, service, sim_time, start_values, supervisor, system_clock,
};

/// What the targets of this package's log lines begin with: those of its library and of its programs.
pub const LOG_TARGET: &str = "tanker_pose";
