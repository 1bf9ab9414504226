//! What the node does with a message, wherever it comes from and wherever the answers go: the node and `replay` share it.
//!
//! ```text
//! topics                             the one table of the node's topics
//! start, files                       the command line's names and parameters; the files that parameters name
//! clock                              the times that all of this reads, of a process or of a recording
//! output, outputs                    what the node publishes on, opened from the table wherever messages can go
//! input                              the detections of an image, of one of three types
//! repetition                         detections that are not those of their image
//! health, understood, diagnostics    faults around the node, said and shown
//! attitudes                          what receiver and tanker report of their attitudes
//! contradiction                      whether these agree with what the camera sees
//! consumers, integrity               messages for refuelling and flight stacks; protection levels
//! predicted_points                   where detectors may look in the next image
//! monitor, handler                   the node's health once a second; one message's work
//! ```
//!
//! Knows `convert` and `pipeline`, and of `ros2_node` what joins no graph; never a middleware, a thread, or a clock other
//! than the one that it is given.

pub mod attitudes;
pub mod clock;
pub mod consumers;
mod contradiction;
pub mod diagnostics;
pub mod files;
pub mod handler;
pub mod health;
pub mod input;
pub mod integrity;
mod monitor;
pub mod output;
pub mod outputs;
pub mod predicted_points;
mod repetition;
pub mod start;
pub mod topics;
mod understood;
