//! Orthogonal iteration: literally as in the paper, and accelerated with the quadratic form `Ω`.
//!
//! Both take the same steps. The literal form is the reference; the accelerated one has the same cost for six points as
//! for a thousand. The estimator itself finds the same fixed point by Newton's method ([`super::newton`]), in fewer
//! steps.

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};

use super::EstimateError;
use super::collinearity::{CollinearityCost, CollinearityMoments, Weighting};
use super::lanes::columns::Columns;
use super::lanes::four::Plain;
use super::lanes::points::{Blocks, Points, mean};
use super::newton::{self, Minimum};
use crate::camera::Ray;
use crate::geometry::{chord, nearest_rotation, nearest_rotation_by_svd};

/// End point of an orthogonal iteration.
#[derive(Debug, Clone, Copy)]
pub struct Iterated {
    /// The pose after the last step.
    pub camera_from_tanker: Isometry3<f64>,
    /// Steps taken.
    pub iterations: u32,
    /// Whether the last step turned by less than the tolerance.
    pub converged: bool,
}

/// Returns the pose after orthogonal iteration with the steps of the paper.
///
/// Each step computes the translation in closed form (Eq. 13), projects every point onto its ray, and computes the
/// rotation by absolute orientation (Lemma 1). It stops when a step turns by less than `tolerance_rad`, or after
/// `max_iterations`.
///
/// DIFFERENCE: the paper stops when `E < ε`; `E` depends on the noise, so the size of the step is used here.
///
/// # Inputs
/// * `rays`: `n ≥ 3` undistorted points on the `z = 1` plane.
/// * `markers_in_tanker`: the same `n` markers in the same order, m.
/// * `seed`: the rotation part of a first `camera_from_tanker`.
///
/// # Errors
/// [`EstimateError::TooFewPoints`], or [`EstimateError::Degenerate`] if the rays do not determine a position.
///
/// # Source
/// Ding, Wei, Wang 2011, Eqs. (5)–(8), (11)–(13); Lu, Hager, Mjolsness, *PAMI* 22(6), 2000.
pub fn iterate_literally(
    rays: &[Ray],
    markers_in_tanker: &[Point3<f64>],
    seed: &Rotation3<f64>,
    tolerance_rad: f64,
    max_iterations: u32,
) -> Result<Iterated, EstimateError> {
    let n = check(rays, markers_in_tanker)?;
    let identity = Matrix3::identity();
    let projectors: Vec<Matrix3<f64>> = rays
        .iter()
        .map(|ray| {
            let v = Vector3::new(ray.x, ray.y, 1.0);
            v * v.transpose() / v.norm_squared() // V, Eq. (11)
        })
        .collect();
    let mean_projector = projectors.iter().sum::<Matrix3<f64>>() / n;
    let inverse = (identity - mean_projector)
        .try_inverse()
        .ok_or(EstimateError::SAME_RAYS)?;
    let translation = |rotation: &Rotation3<f64>| -> Vector3<f64> {
        let sum: Vector3<f64> = projectors
            .iter()
            .zip(markers_in_tanker)
            .map(|(v, p)| (v - identity) * (rotation * p.coords))
            .sum();
        inverse * sum / n // Eq. (13)
    };
    let p_mean = mean(markers_in_tanker, |marker| marker);
    let mut rotation = *seed;
    let mut iterations = 0;
    let mut converged = false;
    while iterations < max_iterations && !converged {
        let t = translation(&rotation);
        let q: Vec<Vector3<f64>> = projectors
            .iter()
            .zip(markers_in_tanker)
            .map(|(v, p)| v * (rotation * p.coords + t))
            .collect();
        let q_mean = q.iter().sum::<Vector3<f64>>() / n;
        let covariance: Matrix3<f64> = q
            .iter()
            .zip(markers_in_tanker)
            .map(|(q, p)| (q - q_mean) * (p - p_mean).transpose())
            .sum::<Matrix3<f64>>()
            / n;
        let next = nearest_rotation_by_svd(&covariance); // Eqs. (7)–(8)
        iterations += 1;
        converged = chord(&rotation, &next) < tolerance_rad;
        rotation = next;
    }
    Ok(finish(
        &rotation,
        translation(&rotation),
        iterations,
        converged,
    ))
}

/// As [`iterate_literally`], at a cost per step that does not grow with `n`.
///
/// One step is `R ← nearest rotation to (R S − mat(Ω vec R))`, `S = Σ p pᵀ` over centred points.
///
/// # Errors
/// As [`iterate_literally`].
pub fn iterate_accelerated(
    rays: &[Ray],
    markers_in_tanker: &[Point3<f64>],
    seed: &Rotation3<f64>,
    tolerance_rad: f64,
    max_iterations: u32,
) -> Result<Iterated, EstimateError> {
    check(rays, markers_in_tanker)?;
    let (cost, p_mean) = cost(rays, markers_in_tanker)?;
    let scatter: Matrix3<f64> = markers_in_tanker
        .iter()
        .map(|p| (p - p_mean) * (p - p_mean).transpose())
        .sum();
    let mut rotation = *seed;
    let mut iterations = 0;
    let mut converged = false;
    while iterations < max_iterations && !converged {
        let splats = Columns::new(Plain, rotation.matrix()).splats(Plain);
        let half_gradient = cost.half_gradient(Plain, &splats).matrix();
        let next = nearest_rotation(&(rotation.matrix() * scatter - half_gradient));
        iterations += 1;
        converged = chord(&rotation, &next) < tolerance_rad;
        rotation = next;
    }
    let t = cost.centre_in_camera(&rotation) - rotation * p_mean.coords;
    Ok(finish(&rotation, t, iterations, converged))
}

/// Returns the fixed point of orthogonal iteration by Newton's method, to rounding.
///
/// # Errors
/// As [`iterate_literally`].
pub fn fixed_point(
    rays: &[Ray],
    markers_in_tanker: &[Point3<f64>],
    seed: &Rotation3<f64>,
) -> Result<Iterated, EstimateError> {
    /// rad; the error is about its square.
    const STEP_TOLERANCE: f64 = 1e-7;
    check(rays, markers_in_tanker)?;
    let (cost, p_mean) = cost(rays, markers_in_tanker)?;
    let Minimum {
        rotation,
        iterations,
        converged,
        ..
    } = newton::minimise(&cost, seed, STEP_TOLERANCE);
    let t = cost.centre_in_camera(&rotation) - rotation * p_mean.coords;
    Ok(finish(&rotation, t, iterations.into(), converged))
}

fn cost(
    rays: &[Ray],
    markers_in_tanker: &[Point3<f64>],
) -> Result<(CollinearityCost, Point3<f64>), EstimateError> {
    let mut room = Blocks::new();
    let points = Points::from_rays(rays, markers_in_tanker, &mut room);
    let moments = CollinearityMoments::new(Plain, &points, Weighting::ObjectSpace);
    let mut cost = CollinearityCost::EMPTY;
    cost.fill(Plain, &moments).ok_or(EstimateError::SAME_RAYS)?;
    Ok((cost, points.mean))
}

fn check(rays: &[Ray], markers_in_tanker: &[Point3<f64>]) -> Result<f64, EstimateError> {
    let got = rays.len().min(markers_in_tanker.len());
    if got < 3 || rays.len() != markers_in_tanker.len() {
        return Err(EstimateError::TooFewPoints { got, need: 3 });
    }
    Ok(got as f64)
}

fn finish(
    rotation: &Rotation3<f64>,
    t: Vector3<f64>,
    iterations: u32,
    converged: bool,
) -> Iterated {
    Iterated {
        camera_from_tanker: Isometry3::from_parts(
            Translation3::from(t),
            UnitQuaternion::from_rotation_matrix(rotation),
        ),
        iterations,
        converged,
    }
}
