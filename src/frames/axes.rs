//! The fixed rotations between conventions of axes. Each is exact: zeros and ones.

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion};

use crate::geometry::optical_from_body;

/// Returns the rotation from optical axes (x right, y down, z ahead) to those of a body that looks along
/// its x axis (x forward, y left, z up).
#[must_use]
pub fn flu_from_optical() -> Rotation3<f64> {
    optical_from_body().inverse()
}

/// Returns the rotation from FLU (ROS: x forward, y left, z up) to FRD (PX4, `ArduPilot`: x forward, y right,
/// z down). It is its own inverse.
#[must_use]
pub fn frd_from_flu() -> Rotation3<f64> {
    Rotation3::from_matrix_unchecked(Matrix3::new(
        1.0, 0.0, 0.0, //
        0.0, -1.0, 0.0, //
        0.0, 0.0, -1.0,
    ))
}

/// Returns the rotation from ENU (ROS: x east, y north, z up) to NED (PX4: x north, y east, z down). It is
/// its own inverse.
#[must_use]
pub fn ned_from_enu() -> Rotation3<f64> {
    Rotation3::from_matrix_unchecked(Matrix3::new(
        0.0, 1.0, 0.0, //
        1.0, 0.0, 0.0, //
        0.0, 0.0, -1.0,
    ))
}

/// Returns a transform that rotates the axes and keeps the origin.
#[must_use]
pub fn rotation_only(b_from_a: &Rotation3<f64>) -> Isometry3<f64> {
    Isometry3::from_parts(
        Translation3::identity(),
        UnitQuaternion::from_rotation_matrix(b_from_a),
    )
}
