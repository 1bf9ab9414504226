//! What is declared: the points that levels are for, and how the camera sits in the receiver.

use nalgebra::{Isometry3, Matrix3, Matrix3x6, Point3, Vector3};

use crate::geometry::{PoseCovariance, skew};

/// A point of the tanker whose position is to be protected.
#[derive(Debug, Clone, PartialEq)]
pub struct IntegrityPoint {
    /// Its name, for reports.
    pub name: String,
    /// Where it is, tanker frame, m.
    pub point_in_tanker: Point3<f64>,
    /// How it deviates from there, covariance in the tanker's axes, m².
    pub covariance: Matrix3<f64>,
    /// Largest levels allowed: ahead, lateral, vertical in the receiver, m; `None`: not stated.
    pub alert_limit_m: Option<[f64; 3]>,
}

/// How the camera sits in the receiver, whose axes the levels have.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mount {
    /// From the camera's optical axes to x ahead, y left, z up, m.
    pub receiver_from_camera: Isometry3<f64>,
    /// Of it, receiver axes, about the camera.
    pub covariance: PoseCovariance,
}

/// The three axes of the receiver at one point.
pub(super) struct PointAxes {
    /// Derivative of its position by the pose.
    pub(super) by_pose: Matrix3x6<f64>,
    /// Variances of what the pose is not to blame for: mount and point, m².
    pub(super) fixed_m2: [f64; 3],
}

impl PointAxes {
    /// Returns them at a pose.
    pub(super) fn new(point: &IntegrityPoint, mount: &Mount, pose: &Isometry3<f64>) -> Self {
        let receiver = mount.receiver_from_camera.rotation.to_rotation_matrix();
        let arm = pose.rotation * point.point_in_tanker.coords;
        let from_mount = receiver * (arm + pose.translation.vector);
        let by_mount = at_point(&Matrix3::identity(), &from_mount);
        let turned = receiver.matrix() * pose.rotation.to_rotation_matrix().matrix();
        let of_point = turned * point.covariance * turned.transpose();
        let fixed_m2 = std::array::from_fn(|axis| {
            let row = by_mount.row(axis);
            let of_mount = (row * mount.covariance.0).dot(&row);
            of_mount.max(0.0) + of_point[(axis, axis)].max(0.0)
        });
        Self {
            by_pose: at_point(receiver.matrix(), &arm),
            fixed_m2,
        }
    }
}

/// Returns the derivative of a point's position by a pose, in turned axes.
///
/// # Inputs
/// * `arm`: from the pose's origin to the point, m.
fn at_point(axes: &Matrix3<f64>, arm: &Vector3<f64>) -> Matrix3x6<f64> {
    let mut by_pose = Matrix3x6::zeros();
    by_pose.fixed_view_mut::<3, 3>(0, 0).copy_from(axes);
    by_pose
        .fixed_view_mut::<3, 3>(0, 3)
        .copy_from(&(axes * -skew(*arm)));
    by_pose
}
