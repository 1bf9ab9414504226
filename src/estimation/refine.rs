//! Maximum likelihood: the pose with the least sum of squared pixel residuals over their variances.
//!
//! Gauss-Newton on a left rotation increment and the position of the markers' mean, with the lens
//! model evaluated at the prediction, so that a distorted image is fitted where its noise lives.
//! Steps that do not descend are damped (Levenberg-Marquardt).

use nalgebra::{Matrix2x3, Matrix6, Point3, Rotation3, Vector2, Vector3, Vector6};

use super::Observation;
use crate::camera::{Camera, Ray};
use crate::geometry::cayley;

/// Steps after which a fit is given up; two or three are usual.
pub(crate) const MAX_ITERATIONS: u16 = 50;
/// Predicted gain in chi-squared at which the fit has converged: a thousandth of a sigma, squared.
const GAIN_TOLERANCE: f64 = 1e-6;
/// Share of chi-squared below which a gain is rounding; decides only where residuals are thousands of sigmas.
const ROUNDING: f64 = 1e-12;
/// Damping at which no step in any direction helps any more.
const MAX_DAMPING: f64 = 1e9;

/// A pose as the fit moves it: rotation, and the camera coordinates of the markers' mean.
#[derive(Debug, Clone, Copy)]
pub(crate) struct CentredPose {
    pub(crate) rotation: Rotation3<f64>,
    pub(crate) centre_in_camera: Vector3<f64>,
}

/// What a fit found.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Fit {
    pub(crate) pose: CentredPose,
    pub(crate) chi_squared: f64,
    /// `(JᵀΣ⁻¹J)⁻¹`, rotation before position of the mean.
    pub(crate) covariance: Matrix6<f64>,
    pub(crate) iterations: u16,
}

/// Why a fit failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum FitFailure {
    /// The start leaves a point without a pixel: behind the camera, or outside the lens model.
    StartNotVisible,
    /// The information matrix is singular.
    Singular,
    NotConverged,
}

/// Residuals, and the normal equations of one Gauss-Newton step.
struct Linearised {
    information: Matrix6<f64>,
    gradient: Vector6<f64>,
    chi_squared: f64,
}

/// Returns the maximum likelihood pose that descent from `start` reaches, and its covariance.
///
/// # Source
/// `D = (1/z) [fx 0 −fx x; 0 fy −fy y]` for a pinhole, the lens model's derivative times
/// `(1/z) [1 0 −x; 0 1 −y]` in general; `J = [−D [R p]×, D]`, weighted by each point's sigma.
pub(crate) fn maximum_likelihood(
    camera: &Camera,
    observations: &[Observation],
    markers_mean: &Point3<f64>,
    start: CentredPose,
) -> Result<Fit, FitFailure> {
    let mut pose = start;
    let mut here =
        linearise(camera, observations, markers_mean, &pose).ok_or(FitFailure::StartNotVisible)?;
    let mut damping = 0.0;
    for iteration in 1..=MAX_ITERATIONS {
        let mut damped = here.information;
        for i in 0..6 {
            damped[(i, i)] *= 1.0 + damping;
        }
        let Some(factor) = damped.cholesky() else {
            if damping == 0.0 && iteration > 1 {
                // Not singular at the start: a bad step led here. Damp it.
                damping = 1e-3;
                continue;
            }
            return Err(FitFailure::Singular);
        };
        let step = -factor.solve(&here.gradient);
        let gain = -step.dot(&here.gradient);
        if damping == 0.0 && gain < GAIN_TOLERANCE.max(ROUNDING * here.chi_squared) {
            return finish(&pose, &step, &here, gain, &factor.inverse(), iteration);
        }
        let trial = pose.moved(&step);
        match linearise(camera, observations, markers_mean, &trial) {
            Some(there) if there.chi_squared <= here.chi_squared => {
                (pose, here) = (trial, there);
                damping = if damping < 1e-6 { 0.0 } else { damping * 0.1 };
            }
            _ => {
                damping = if damping == 0.0 { 1e-3 } else { damping * 10.0 };
                if damping > MAX_DAMPING {
                    return Err(FitFailure::NotConverged);
                }
            }
        }
    }
    Err(FitFailure::NotConverged)
}

fn finish(
    pose: &CentredPose,
    step: &Vector6<f64>,
    here: &Linearised,
    gain: f64,
    covariance: &Matrix6<f64>,
    iterations: u16,
) -> Result<Fit, FitFailure> {
    let chi_squared = (here.chi_squared - gain).max(0.0);
    if !covariance.iter().all(|value| value.is_finite()) || !chi_squared.is_finite() {
        return Err(FitFailure::Singular);
    }
    Ok(Fit {
        pose: pose.moved(step),
        chi_squared,
        covariance: *covariance,
        iterations,
    })
}

impl CentredPose {
    fn moved(&self, step: &Vector6<f64>) -> Self {
        Self {
            rotation: cayley(Vector3::new(step[0], step[1], step[2])) * self.rotation,
            centre_in_camera: self.centre_in_camera + Vector3::new(step[3], step[4], step[5]),
        }
    }
}

/// Returns predicted minus seen pixel, px; none when the point has no pixel at this pose.
#[inline]
pub(crate) fn residual_px(
    camera: &Camera,
    observation: &Observation,
    markers_mean: &Point3<f64>,
    pose: &CentredPose,
) -> Option<Vector2<f64>> {
    let q = pose.rotation * (observation.marker_in_tanker - markers_mean) + pose.centre_in_camera;
    if q.z <= 0.0 {
        return None;
    }
    let (pixel, _) = camera.project(Ray {
        x: q.x / q.z,
        y: q.y / q.z,
    })?;
    Some(Vector2::new(
        pixel.u - observation.pixel.u,
        pixel.v - observation.pixel.v,
    ))
}

/// Returns the squared residuals over their variances at a pose; none when a point has no pixel there.
pub(crate) fn chi_squared(
    camera: &Camera,
    observations: &[Observation],
    markers_mean: &Point3<f64>,
    pose: &CentredPose,
) -> Option<f64> {
    observations.iter().try_fold(0.0, |sum, observation| {
        let residual = residual_px(camera, observation, markers_mean, pose)?;
        Some(sum + residual.norm_squared() / (observation.sigma_px * observation.sigma_px))
    })
}

fn linearise(
    camera: &Camera,
    observations: &[Observation],
    markers_mean: &Point3<f64>,
    pose: &CentredPose,
) -> Option<Linearised> {
    let mut information = Matrix6::zeros();
    let mut gradient = Vector6::zeros();
    let mut chi_squared = 0.0;
    for observation in observations {
        let arm = pose.rotation * (observation.marker_in_tanker - markers_mean);
        let q = arm + pose.centre_in_camera;
        if q.z <= 0.0 {
            return None;
        }
        let depth_inverse = 1.0 / q.z;
        let ray = Ray {
            x: q.x * depth_inverse,
            y: q.y * depth_inverse,
        };
        let (pixel, pixel_by_ray) = camera.project(ray)?;
        let whitening = 1.0 / observation.sigma_px;
        let ray_by_point = Matrix2x3::new(1.0, 0.0, -ray.x, 0.0, 1.0, -ray.y) * depth_inverse;
        let d = pixel_by_ray * ray_by_point * whitening;
        let residuals = [
            (pixel.u - observation.pixel.u) * whitening,
            (pixel.v - observation.pixel.v) * whitening,
        ];
        for (row, residual) in residuals.into_iter().enumerate() {
            let point = Vector3::new(d[(row, 0)], d[(row, 1)], d[(row, 2)]);
            let turn = arm.cross(&point);
            let j = [turn.x, turn.y, turn.z, point.x, point.y, point.z];
            for a in 0..6 {
                gradient[a] += j[a] * residual;
                for b in a..6 {
                    information[(b, a)] += j[a] * j[b];
                }
            }
            chi_squared += residual * residual;
        }
    }
    for a in 0..6 {
        for b in a + 1..6 {
            information[(a, b)] = information[(b, a)];
        }
    }
    chi_squared.is_finite().then_some(Linearised {
        information,
        gradient,
        chi_squared,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulation::{Scene, paper_scene};

    fn at_truth(scene: &Scene) -> (Vec<Observation>, Point3<f64>, CentredPose) {
        let observations = scene.exact_observations();
        let mean =
            super::super::collinearity::mean(observations.iter().map(|o| &o.marker_in_tanker));
        let pose = CentredPose {
            rotation: scene.truth_rotation(),
            centre_in_camera: (scene.truth_camera_from_tanker() * mean).coords,
        };
        (observations, mean, pose)
    }

    #[test]
    fn gradient_is_zero_at_the_truth_without_noise() {
        let scene = paper_scene();
        let (observations, mean, pose) = at_truth(&scene);
        let here = linearise(scene.camera(), &observations, &mean, &pose)
            .expect("every marker is in view");
        assert!(here.gradient.norm() < 1e-6, "gradient {}", here.gradient);
        assert!(here.chi_squared < 1e-18);
    }

    #[test]
    fn gradient_agrees_with_central_differences() {
        let scene = paper_scene();
        let (mut observations, mean, pose) = at_truth(&scene);
        for (i, observation) in observations.iter_mut().enumerate() {
            observation.pixel.u += 0.3 * i as f64 - 1.0;
            observation.pixel.v -= 0.2 * i as f64;
            observation.sigma_px = 0.5 + 0.1 * i as f64;
        }
        let cost = |pose: &CentredPose| {
            0.5 * chi_squared(scene.camera(), &observations, &mean, pose).expect("in view")
        };
        let here = linearise(scene.camera(), &observations, &mean, &pose).expect("in view");
        let h = 1e-6;
        for axis in 0..6 {
            let mut step = Vector6::zeros();
            step[axis] = h;
            let difference = (cost(&pose.moved(&step)) - cost(&pose.moved(&-step))) / (2.0 * h);
            let relative = (difference - here.gradient[axis]).abs() / here.gradient.norm();
            assert!(
                relative < 1e-6,
                "axis {axis}: {difference} against {}",
                here.gradient[axis]
            );
        }
    }
}
