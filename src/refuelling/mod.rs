//! Where the receptacle is before the probe: the tanker's motion in the camera becomes what guidance
//! flies to and what a boom operator would judge.
//!
//! Knows `geometry`, `frames` and `yaml`; never a clock or the filter. From the motion of the tanker in the
//! camera, the camera's mount, the probe tip and the receptacle:
//!
//! ```text
//! camera_from_tanker -> receptacle in the receiver's axes about the probe tip, with velocity
//!                    -> closing speed -> outside, pre-contact or contact window, each with its probability
//! ```
//!
//! Axes are those of the `receiver`, FLU (x forward, y left, z up). The receptacle is taken to be rigid to
//! the tanker's markers, up to [`RefuellingGeometry::receptacle_covariance`]: a drogue on a hose is not,
//! and needs beacons of its own.

mod attitude;
mod envelope;
mod in_words;
mod probability;
mod receptacle;
mod setup;

pub use attitude::{Angles, ExpectedAttitude};
pub use envelope::{Assessment, Envelope, EnvelopeError, EnvelopeState, Region};
pub use in_words::Understood;
pub use receptacle::{ReceptacleEstimate, RefuellingGeometry, RefuellingGeometryError, Uncertain};
pub use setup::{RefuellingSetup, RefuellingSetupError};

#[cfg(test)]
mod tests;
