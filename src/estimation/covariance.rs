//! Covariance of a pose that is not the maximum likelihood estimate.

use nalgebra::{Matrix3, Matrix3x2, Matrix6, Point3, SMatrix, Vector3, Vector6};
use smallvec::SmallVec;

use super::Observation;
use super::budget::FrameBudget;
use super::centred_pose::CentredPose;
use super::collinearity::object_space_weight;
use super::lanes::symmetric3::Symmetric3;
use crate::camera::{Camera, Ray};
use crate::geometry::skew;

/// Returns the covariance of a converged orthogonal iteration, rotation before position of the markers' mean; `None` if
/// the points do not determine the pose.
///
/// The weights of the iteration's error are not those of the noise, so its covariance is the sandwich `H⁻¹ B H⁻¹` and
/// not the inverse of its curvature: `J = [−[R p]×, I]`, `H = Σ JᵀWJ`, `B = Σ z² JᵀW C WJ`, with `C` the covariance of
/// the measured ray `(x, y, 1)`. Survey errors add to `C`. A mode, which moves many points together, adds the outer
/// product of its total effect on the gradient.
pub(crate) fn sandwich(
    camera: &Camera,
    observations: &[Observation],
    markers_mean: &Point3<f64>,
    pose: &CentredPose,
    doubts: Option<&FrameBudget>,
) -> Option<Matrix6<f64>> {
    let mut curvature = Matrix6::zeros();
    let mut scatter = Matrix6::zeros();
    // The effect of each mode on the gradient at one sigma, over all points.
    let mut pulls = SmallVec::<[Vector6<f64>; 16]>::new();
    for (index, observation) in observations.iter().enumerate() {
        let ray = camera.ray_from_pixel(observation.pixel).ok()?;
        let arm = pose.rotation * (observation.marker_in_tanker - markers_mean);
        let depth = arm.z + pose.centre_in_camera.z;
        let mut j = SMatrix::<f64, 3, 6>::zeros();
        j.fixed_view_mut::<3, 3>(0, 0).copy_from(&-skew(arm));
        j.fixed_view_mut::<3, 3>(0, 3).fill_with_identity();
        let wj = full(&object_space_weight(ray)) * j;
        curvature += j.transpose() * wj;
        let noise = ray_noise(camera, ray, observation.sigma_px)? * depth;
        let half = noise.transpose() * wj;
        scatter += half.transpose() * half;
        let Some(doubts) = doubts else { continue };
        let point = doubts.point(index);
        // The derivative of the ray by the marker is [1 0 -x; 0 1 -y] / z; here it is multiplied by the depth.
        let ray_by_point = Matrix3::new(1.0, 0.0, -ray.x, 0.0, 1.0, -ray.y, 0.0, 0.0, 0.0);
        let half = ray_by_point.transpose() * wj;
        scatter += half.transpose() * half * point.survey_variance_m2;
        let flex = point
            .flex
            .iter()
            .map(|shift| ray_by_point * (pose.rotation * shift));
        let (_, pixel_by_ray) = camera.project(ray)?;
        let ray_by_pixel = pixel_by_ray.try_inverse()? * depth;
        let image = point.image.iter().map(|shift| {
            let moved = ray_by_pixel * shift;
            Vector3::new(moved.x, moved.y, 0.0)
        });
        for (mode, shift) in flex.chain(image).enumerate() {
            let pull = wj.transpose() * shift;
            match pulls.get_mut(mode) {
                Some(sum) => *sum += pull,
                None => pulls.push(pull),
            }
        }
    }
    for pull in &pulls {
        scatter += pull * pull.transpose();
    }
    let inverse = curvature.cholesky()?.inverse();
    let covariance = inverse * scatter * inverse;
    covariance
        .iter()
        .all(|value| value.is_finite())
        .then_some(covariance)
}

/// A square root of the measured ray's covariance, no unit.
fn ray_noise(camera: &Camera, ray: Ray, sigma_px: f64) -> Option<Matrix3x2<f64>> {
    let (_, pixel_by_ray) = camera.project(ray)?;
    let ray_by_pixel = pixel_by_ray.try_inverse()? * sigma_px;
    let mut noise = Matrix3x2::zeros();
    noise.fixed_view_mut::<2, 2>(0, 0).copy_from(&ray_by_pixel);
    Some(noise)
}

fn full(s: &Symmetric3) -> Matrix3<f64> {
    Matrix3::new(s[0], s[1], s[2], s[1], s[3], s[4], s[2], s[4], s[5])
}
