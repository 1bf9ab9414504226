//! Rotations, poses and covariances.
//!
//! Depends on `nalgebra` only. A transform is `b_from_a`: it converts coordinates in `a` to coordinates in `b`, and
//! neighbours cancel, `c_from_b * b_from_a`. The pose error and the order of its covariance are defined in
//! [`PoseCovariance`].

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
