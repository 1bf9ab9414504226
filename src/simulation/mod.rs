//! Seeded scenes and approaches, for tools, Monte Carlo and tests.
//!
//! Knows the floors below; the truth it makes is exact, and all randomness comes from a generator
//! that the caller seeds, so the same seed gives the same bits on every machine.

mod approach;
mod bound;
mod scene;

pub use approach::{Approach, ApproachSettings, SimulatedFrame};
pub use bound::cramer_rao_bound;
pub use scene::{Scene, paper_camera, paper_scene, pose_in_camera};
