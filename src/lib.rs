//! Vision-based relative navigation for autonomous aerial refuelling: from pixels of known beacons on a tanker to the
//! tanker's pose in the camera, with a realistic covariance.
//!
//! The layers depend downwards only. Node, tools, Monte Carlo and tests process a frame with the same call:
//!
//! ```text
//! bin, ros            the only layers with files, clocks, threads and ros2-client
//! replay              a recording answered as the node answers its topics
//! evaluation          a recording judged: errors, consistency, protection levels, residuals, time
//! answering           what the node does with a message, wherever it comes from
//! recording           messages in files: MCAP and bags of rosbag2, and CDR, their bytes
//! convert, messages   plain types <-> the messages of ROS
//! calibration         marker map, mount and camera refined from all frames of a recording
//! simulation          seeded approaches and synthetic detections, for tools and tests
//! picture             the geometry of a frame in space, for display
//! pipeline, config    the processing of one frame; raw parameters -> checked settings
//! refuelling          the receptacle relative to the probe, with probabilities
//! integrity           bounds of a pose's error, undetected faults included
//! tracking, frames    a motion from poses over time; poses for flight stacks
//! estimation          a pose from known markers and pixels: initialise, iterate, refine, judge, covariance
//! camera, target      pixel <-> ray; marker id -> point on the tanker
//! geometry            rotations, poses, covariances
//! ```
//!
//! Frames are `tanker` (x forward, y left, z up), `receiver` (the same axes on the receiving
//! aircraft) and `camera` (always the optical frame: x right, y down, z ahead). SI units and radians
//! throughout; a suffix names anything else (`_px`, `_deg`).

#[cfg(any(feature = "ros", feature = "bags"))]
pub mod answering;
pub mod calibration;
pub mod camera;
pub mod config;
pub mod convert;
pub mod estimation;
#[cfg(feature = "bags")]
pub mod evaluation;
pub mod frames;
pub mod geometry;
pub mod integrity;
pub mod messages;
pub mod picture;
pub mod pipeline;
#[cfg(feature = "bags")]
pub mod recording;
pub mod refuelling;
#[cfg(feature = "bags")]
pub mod replay;
#[cfg(feature = "ros")]
pub mod ros;
pub mod simulation;
pub mod target;
mod text;
pub mod tracking;
pub mod yaml;

pub use ros2_node::text_file;
