//! Covariance where the error is not the parabola that its curvature suggests.
//!
//! A flat target seen nearly face on has two minima, mirror images of each other, that merge: between them the image
//! rules out hardly any attitude, yet at each minimum the curvature suggests a precise one. Poses on the way to the
//! mirror image reveal this. If the image makes one of them plausible and the covariance does not, the covariance is
//! widened in that direction until it does.

use nalgebra::{Matrix3, Matrix6, Rotation3, Vector3, Vector6};

use super::EstimateError;
use super::ambiguity::mirror_image;
use super::problem::Problem;
use super::refine::Fit;
use crate::geometry::PoseCovariance;

/// rad², trace of the attitude's covariance; below it the mirror image is too far away to matter.
const SURE: f64 = 3.05e-4; // 1°
/// Increase of chi-squared above which a pose is implausible.
const IMPLAUSIBLE: f64 = 30.0;
/// Fractions of the way to the mirror image.
const WAY: [f64; 4] = [0.25, 0.5, 0.75, 1.0];
/// The squared Mahalanobis distance may be at most this multiple of the increase of chi-squared, plus [`SLACK`].
const STEEPNESS: f64 = 2.0;
const SLACK: f64 = 6.0;

/// Returns the covariance of `camera_from_tanker`, widened where the error is flatter than its curvature suggests.
///
/// # Inputs
/// * `lever`: from the tanker's origin to the markers' mean, camera axes, m.
///
/// # Errors
/// [`EstimateError::Degenerate`] if the points do not determine the pose.
#[inline(always)]
pub(crate) fn honest_covariance(
    problem: &Problem,
    fit: &Fit,
    lever: &Vector3<f64>,
) -> Result<PoseCovariance, EstimateError> {
    match &fit.solver {
        Some(solver) if solver.turn_variance() < SURE => Ok(solver.covariance_of_point(lever)),
        _ => looked_at_closely(problem, fit, lever),
    }
}

#[inline(never)]
fn looked_at_closely(
    problem: &Problem,
    fit: &Fit,
    lever: &Vector3<f64>,
) -> Result<PoseCovariance, EstimateError> {
    let covariance = problem.covariance(fit)?;
    let wide = (covariance.m11 + covariance.m22 + covariance.m33 >= SURE)
        .then(|| flattest(problem, fit, &covariance))
        .flatten();
    let about_mean = wide.unwrap_or(covariance);
    Ok(PoseCovariance::from_point(&about_mean, lever))
}

/// Returns a wider covariance, rotation before position of the markers' mean; `None` if the fit's own is adequate.
fn flattest(problem: &Problem, fit: &Fit, covariance: &Matrix6<f64>) -> Option<Matrix6<f64>> {
    let pose = &fit.pose;
    let information = upper_left(covariance).try_inverse()?;
    let turn = (mirror_image(problem, pose)? * pose.rotation.inverse()).scaled_axis();
    let mut worst: Option<(f64, Vector3<f64>)> = None;
    for share in WAY {
        let step = turn * share;
        let there = Rotation3::new(step) * pose.rotation;
        let Some(rise) = problem.rise(fit, &there) else {
            continue;
        };
        let promised = step.dot(&(information * step));
        if rise < IMPLAUSIBLE && promised > STEEPNESS * rise + SLACK {
            let factor = promised / (rise + 1.0);
            if worst.is_none_or(|(known, _)| factor > known) {
                worst = Some((factor, step));
            }
        }
    }
    let (factor, step) = worst?;
    // One sigma in the direction of the step, with everything correlated with it: C + (k − 1) w wᵀ.
    let pull = information * step;
    let sigma =
        covariance * Vector6::new(pull.x, pull.y, pull.z, 0.0, 0.0, 0.0) / pull.dot(&step).sqrt();
    let wide = covariance + sigma * sigma.transpose() * (factor - 1.0);
    wide.iter().all(|value| value.is_finite()).then_some(wide)
}

fn upper_left(m: &Matrix6<f64>) -> Matrix3<f64> {
    m.fixed_view::<3, 3>(0, 0).into_owned()
}
