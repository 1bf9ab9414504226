//! What a well-behaved ROS 2 node needs beside [`ros2_client`], the client library in Rust that needs no ROS installation.
//!
//! `ros2-client` provides topics, services and discovery. What makes a node one that ROS's tools and launch files can work
//! with is here: the command line, remaps and parameter files as rcl reads them, environment variables, parameters with
//! descriptions and ranges behind their services, `qos_overrides`, a managed node's lifecycle, `/clock`, `/rosout`, and
//! leaving so that others notice.
//!
//! [`node::Node`] puts these parts together; its module shows how.
//!
//! ```text
//! node                               all of it together
//! arguments, rules, tokens           the command line, and the grammar of one value in it
//! environment, distribution          environment variables; the ROS 2 distribution of the build
//! names                              the node's and its topics' names after remaps
//! scalar, parameter_file             types of scalars; the sections of a parameter file
//! overrides, start_values            which value counts for a node; all its parameters at the start
//! parameters, qos_overrides          their declaration; parameters while the node runs, behind their services
//! clock, sim_time                    the node's time, the system's or a simulation's
//! jump, system_clock                 jumps of it
//! participant, leave                 into the graph, and out of it
//! lifecycle                          a managed node's states, behind their services
//! service, rtps                      services, and RTPS messages that are written here
//! messages                           the messages of all this, and the trait of all messages
//! newest                             skipping samples beyond a topic's depth
//! graph, discovered, running_nodes   the other endpoints of topics; nodes found by what they publish
//! supervisor                         what systemd is told
//! logging, flood, once               log lines as ROS has them, not too many; lasting conditions are logged once
//! text, text_file                    foreign text in messages; files from outside
//! ```
//!
//! Without the feature `client`, which each feature of a distribution brings, there are only modules that join no graph;
//! of these the ones of the command line and of values at the start need the feature `arguments`.

pub mod clock;
pub mod graph;
pub mod jump;
pub mod messages;
pub mod once;
pub mod parameters;
pub mod system_clock;
pub mod text;
pub mod text_file;

#[cfg(feature = "client")]
pub use ros2_client;

#[cfg(feature = "arguments")]
pub mod arguments;
#[cfg(feature = "client")]
pub mod discovered;
#[cfg(feature = "client")]
pub mod distribution;
#[cfg(feature = "client")]
pub mod environment;
#[cfg(feature = "client")]
mod flood;
#[cfg(feature = "client")]
pub mod leave;
#[cfg(feature = "client")]
pub mod lifecycle;
#[cfg(feature = "client")]
pub mod logging;
#[cfg(feature = "arguments")]
pub mod names;
#[cfg(feature = "client")]
pub mod newest;
#[cfg(feature = "client")]
pub mod node;
#[cfg(feature = "arguments")]
pub mod overrides;
#[cfg(feature = "arguments")]
pub mod parameter_file;
#[cfg(feature = "client")]
pub mod participant;
#[cfg(feature = "arguments")]
pub mod qos_overrides;
#[cfg(feature = "client")]
pub mod rtps;
#[cfg(feature = "arguments")]
pub mod rules;
#[cfg(feature = "client")]
pub mod running_nodes;
#[cfg(feature = "arguments")]
mod scalar;
#[cfg(feature = "client")]
pub mod service;
#[cfg(feature = "client")]
pub mod sim_time;
#[cfg(feature = "arguments")]
pub mod start_values;
#[cfg(feature = "client")]
pub mod supervisor;
#[cfg(feature = "arguments")]
mod tokens;
