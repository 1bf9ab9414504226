//! The node and its graph: the only floor that knows ros2-client, files, clocks and signals.
//!
//! ```text
//! distribution                       which ROS 2 it talks with
//! arguments, rules                   the command line, and the grammar of one value in it
//! environment, names                 what variables ask for; the node's and its topics' names after remaps
//! scalar, parameter_file             what words mean; the sections of a parameter file
//! overrides, start_values            which value counts for this node; all its parameters at the start
//! parameters, qos_overrides          parameters while the node runs, behind its services
//! clock, jump, system_clock          the node's time, the system's or a simulation's, and where it does not go on
//! participant, leave                 into the graph, and out of it
//! lifecycle                          a managed node's states, behind their services
//! service, reset, rtps               services, and what of the wire protocol is written here
//! messages, convert, input           the wire <-> plain types
//! newest                             what is left out when more samples wait than a topic's depth
//! running_nodes                      nodes of this package in the domain, for tools that listen to them
//! graph, health                      the other ends of the topics; faults around the node, said and shown
//! consumers, attitude                what refuelling and flight stacks are told, by the receiver's attitude
//! predicted_points                   where detectors may look in the next image
//! estimator, diagnostics             one message's work, and the node's health once a second
//! logging, once                      what is said about it, and how often
//! node, serve                        all of it together, until a signal or a tool ends it
//! ```
//!
//! Tools that talk ROS start from [`participant::RosNode::open`].

pub mod arguments;
pub mod attitude;
pub mod clock;
pub mod consumers;
pub mod convert;
pub mod diagnostics;
pub mod distribution;
pub mod environment;
pub mod estimator;
pub mod graph;
pub mod health;
pub mod input;
pub mod jump;
pub mod leave;
pub mod lifecycle;
pub mod logging;
pub mod messages;
pub mod names;
pub mod newest;
pub mod node;
pub mod once;
pub mod overrides;
pub mod parameter_file;
pub mod parameters;
pub mod participant;
pub mod predicted_points;
pub mod qos_overrides;
pub mod reset;
pub mod rtps;
pub mod rules;
pub mod running_nodes;
mod scalar;
mod serve;
pub mod service;
pub mod start_values;
pub mod system_clock;
#[cfg(test)]
mod tests;
mod understood;

/// What the targets of this package's log lines begin with: those of its library and of its programs.
pub const LOG_TARGET: &str = "tanker_pose";
