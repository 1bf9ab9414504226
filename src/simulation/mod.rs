//! Seeded scenes and approaches, for tools, Monte Carlo and tests.
//!
//! Depends on the layers below. The simulated truth is exact, and all randomness comes from a generator that the caller
//! seeds, so the same seed gives the same bits on every machine.

mod approach;
mod bound;
mod experiments;
mod paper_axes;
mod scene;
mod statistics;
mod trial;
mod world;

pub use approach::{Approach, ApproachSettings, SimulatedFrame};
pub use bound::cramer_rao_bound;
pub use experiments::{Experiment, Setting};
pub use paper_axes::{
    PAPER_COORDINATES, PAPER_UNITS, PaperBound, paper_bound, paper_coordinates, paper_error,
};
pub use scene::{Scene, paper_camera, paper_scene, pose_in_camera};
pub use statistics::{FAILURE_DEG, Summary};
pub use trial::{Method, Solver, Stop, TrialError, trial_generator};
pub use world::World;
