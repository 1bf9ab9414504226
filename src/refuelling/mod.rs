//! The receptacle relative to the probe: from the tanker's motion in the camera to the quantities that guidance and a
//! boom operator use.
//!
//! Depends on `geometry`, `frames` and `yaml`, and not on clocks or the filter. From the motion of the tanker in the
//! camera, the camera's mount, the probe tip and the receptacle:
//!
//! ```text
//! camera_from_tanker -> receptacle in the receiver's axes about the probe tip, with velocity
//!                    -> closing speed -> outside, pre-contact or contact window, each with its probability
//! ```
//!
//! Axes are those of the `receiver`, FLU (x forward, y left, z up). The receptacle is assumed rigid relative to the
//! tanker's markers, within [`RefuellingGeometry::receptacle_covariance`]. This does not hold for a drogue on a hose,
//! which needs its own beacons.

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
