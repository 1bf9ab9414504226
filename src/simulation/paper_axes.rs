//! Poses, errors and bounds in the paper's coordinates: angles of aligned airframes, position forward, left, up.

use nalgebra::{Isometry3, Matrix3, Rotation3, Vector3, Vector6};

use super::{Scene, cramer_rao_bound};
use crate::geometry::optical_from_body;

/// Names of the paper's coordinates, in the order of every vector of this module.
pub const PAPER_COORDINATES: [&str; 6] = ["yaw", "pitch", "roll", "x", "y", "z"];

/// Units of [`PAPER_COORDINATES`].
pub const PAPER_UNITS: [&str; 6] = ["deg", "deg", "deg", "m", "m", "m"];

/// Returns (yaw, pitch, roll) in degrees and (x, y, z) in metres of the tanker in the receiver, for a
/// camera that looks straight ahead: the inverse of [`pose_in_camera`](super::pose_in_camera).
#[must_use]
pub fn paper_coordinates(camera_from_tanker: &Isometry3<f64>) -> Vector6<f64> {
    let receiver_from_camera = optical_from_body().inverse();
    let attitude = receiver_from_camera * camera_from_tanker.rotation.to_rotation_matrix();
    let (roll, pitch, yaw) = attitude.euler_angles();
    let position = receiver_from_camera * camera_from_tanker.translation.vector;
    Vector6::new(
        yaw.to_degrees(),
        pitch.to_degrees(),
        roll.to_degrees(),
        position.x,
        position.y,
        position.z,
    )
}

/// Returns `found` minus `truth` in the paper's coordinates, angles within ±180°.
#[must_use]
pub fn paper_error(truth: &Isometry3<f64>, found: &Isometry3<f64>) -> Vector6<f64> {
    let mut error = paper_coordinates(found) - paper_coordinates(truth);
    for angle in error.iter_mut().take(3) {
        *angle = (*angle + 180.0).rem_euclid(360.0) - 180.0;
    }
    error
}

/// The Cramér–Rao bound as root mean squares.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PaperBound {
    /// Of each paper coordinate, degrees and metres.
    pub coordinates: Vector6<f64>,
    /// Of the angle of the error's rotation, degrees.
    pub rotation_deg: f64,
    /// Of the length of the position error, m.
    pub position_m: f64,
}

/// Returns the smallest errors that an unbiased estimate can have, to first order in the noise; `None` if the markers
/// do not determine the pose.
#[must_use]
pub fn paper_bound(scene: &Scene, sigma_px: f64) -> Option<PaperBound> {
    let receiver_from_camera = optical_from_body().inverse();
    let covariance = cramer_rao_bound(scene, sigma_px)?
        .rotated(&receiver_from_camera)
        .0;
    let position = covariance.fixed_view::<3, 3>(0, 0).into_owned();
    let rotation = covariance.fixed_view::<3, 3>(3, 3).into_owned();
    let angles_by_turn = angles_by_turn(&(receiver_from_camera * scene.truth_rotation()))?;
    let angles = (angles_by_turn * rotation * angles_by_turn.transpose()).diagonal();
    let deg = |variance: f64| variance.sqrt().to_degrees();
    Some(PaperBound {
        coordinates: Vector6::new(
            deg(angles.x),
            deg(angles.y),
            deg(angles.z),
            position.m11.sqrt(),
            position.m22.sqrt(),
            position.m33.sqrt(),
        ),
        rotation_deg: deg(rotation.trace()),
        position_m: position.trace().sqrt(),
    })
}

/// Derivative of (yaw, pitch, roll) by a small rotation of the tanker about the receiver's axes; `None` at ±90° pitch.
fn angles_by_turn(attitude: &Rotation3<f64>) -> Option<Matrix3<f64>> {
    let (_, pitch, yaw) = attitude.euler_angles();
    let (after_yaw, after_pitch) = (
        Rotation3::from_axis_angle(&Vector3::z_axis(), yaw),
        Rotation3::from_axis_angle(&Vector3::y_axis(), pitch),
    );
    // Each angle rotates about its own axis, which the angles applied after it have rotated.
    Matrix3::from_columns(&[
        Vector3::z(),
        after_yaw * Vector3::y(),
        after_yaw * (after_pitch * Vector3::x()),
    ])
    .try_inverse()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulation::{paper_scene, pose_in_camera};

    #[test]
    fn coordinates_invert_pose_in_camera() {
        let pose = pose_in_camera(Vector3::new(15.0, -2.0, 4.5), 3.0, -2.0, 50.0);
        let expected = Vector6::new(50.0, -2.0, 3.0, 15.0, -2.0, 4.5);
        assert!((paper_coordinates(&pose) - expected).norm() < 1e-12);
    }

    #[test]
    fn angle_errors_wrap() {
        let at = |yaw_deg| pose_in_camera(Vector3::x(), 0.0, 0.0, yaw_deg);
        assert!((paper_error(&at(179.0), &at(-179.0))[0] - 2.0).abs() < 1e-9);
    }

    #[test]
    fn angles_by_turn_matches_central_differences() {
        const STEP: f64 = 1e-6;
        let attitude = Rotation3::from_euler_angles(0.3, -0.4, 0.7);
        let derivative = angles_by_turn(&attitude).expect("far from 90° pitch");
        for axis in 0..3 {
            let turned = |h: f64| {
                let (roll, pitch, yaw) =
                    (Rotation3::new(Vector3::ith(axis, h)) * attitude).euler_angles();
                Vector3::new(yaw, pitch, roll)
            };
            let numeric = (turned(STEP) - turned(-STEP)) / (2.0 * STEP);
            assert!((derivative.column(axis) - numeric).norm() < 1e-8);
        }
    }

    /// Computed apart from this code, from numerical derivatives of the paper's projection in numpy,
    /// to the digits shown.
    #[test]
    fn bound_at_the_papers_pose_for_one_pixel() {
        let golden = [0.2296, 0.2401, 0.1801, 0.0583, 0.0257, 0.0283];
        let bound = paper_bound(&paper_scene(), 1.0).expect("six points fix the pose");
        for (found, golden) in bound.coordinates.iter().zip(golden) {
            assert!((found - golden).abs() < 6e-5, "{found} against {golden}");
        }
    }
}
