//! Vision-based relative navigation for autonomous aerial refuelling: pixels of known beacons on a
//! tanker in, the tanker's pose in the camera out, with a covariance that means what it says.
//!
//! The house has floors; dependencies point downwards only, and one frame's way through it is one
//! straight line that node, tools, Monte Carlo and tests share:
//!
//! ```text
//! bin, ros            the only floors that know files, clocks, threads and ros2-client
//! simulation          seeded approaches and synthetic detections, for tools and tests
//! picture             what a frame looks like in space, for tools that draw
//! pipeline, config    one straight line a frame; raw parameters -> checked settings
//! refuelling          the receptacle before the probe, and how sure that is
//! tracking, frames    a motion from poses over time; poses for flight stacks
//! estimation          a pose from known markers and pixels: initialise, iterate, refine, judge, covariance
//! camera, target      pixel <-> ray; marker id -> point on the tanker
//! geometry            rotations, poses, covariances
//! ```
//!
//! Frames are `tanker` (x forward, y left, z up), `receiver` (the same axes on the receiving
//! aircraft) and `camera` (always the optical frame: x right, y down, z ahead). SI units and radians
//! throughout; a suffix names anything else (`_px`, `_deg`).

pub mod camera;
pub mod config;
pub mod estimation;
pub mod frames;
pub mod geometry;
pub mod picture;
pub mod pipeline;
pub mod refuelling;
#[cfg(feature = "ros")]
pub mod ros;
pub mod simulation;
pub mod target;
mod text;
pub mod tracking;
pub mod yaml;

pub use ros2_node::text_file;
