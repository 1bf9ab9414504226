//! The Cramér–Rao bound of a scene's pose.

use nalgebra::{Matrix2x3, Matrix6, Vector3};

use super::Scene;
use crate::camera::Ray;
use crate::geometry::{PoseCovariance, skew};

/// Returns the smallest covariance that an unbiased estimate of a scene's pose can have with `sigma_px` of noise, in
/// the coordinates of [`PoseCovariance`]; `None` if the markers do not determine the pose.
///
/// Computed independently of the estimator, from the projection at the truth, so that the two can be compared.
#[must_use]
pub fn cramer_rao_bound(scene: &Scene, sigma_px: f64) -> Option<PoseCovariance> {
    let pose = scene.truth_camera_from_tanker();
    let mut information = Matrix6::zeros();
    for marker in scene.markers() {
        let arm = pose.rotation * marker.marker_in_tanker.coords;
        let q: Vector3<f64> = arm + pose.translation.vector;
        if q.z <= 0.0 {
            continue;
        }
        let ray = Ray::through(&q);
        let (_, pixel_by_ray) = scene.camera().project(ray)?;
        let by_point = pixel_by_ray * Matrix2x3::new(1.0, 0.0, -ray.x, 0.0, 1.0, -ray.y) / q.z;
        let by_turn = -by_point * skew(arm);
        let mut j = nalgebra::Matrix2x6::zeros();
        j.fixed_view_mut::<2, 3>(0, 0).copy_from(&by_point);
        j.fixed_view_mut::<2, 3>(0, 3).copy_from(&by_turn);
        information += j.transpose() * j / (sigma_px * sigma_px);
    }
    let covariance = information.cholesky()?.inverse();
    Some(PoseCovariance((covariance + covariance.transpose()) * 0.5))
}
