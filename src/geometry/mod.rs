//! Rotations, poses and covariances: the ground floor.
//!
//! Knows `nalgebra` only. A transform is `b_from_a`: it takes coordinates in `a` to coordinates in
//! `b`, and neighbours cancel, `c_from_b * b_from_a`. What a pose error is, and in which order its
//! covariance belongs, is defined once, in [`PoseCovariance`].

mod covariance;
mod motion;
mod rotation;

pub(crate) use covariance::principal_root;
pub use covariance::{PoseCovariance, congruent, pose_error};
pub(crate) use motion::set;
pub use motion::{Matrix12, Motion, Twist, Vector12, motion_error};
pub use rotation::{
    axial, cayley, chord, left_jacobian, left_jacobian_inverse, nearest_rotation,
    nearest_rotation_by_svd, optical_from_body, rotation_from_roll_pitch_yaw, skew,
};
