//! The second pose that might fit: the target mirrored in depth.
//!
//! Far away, or with all markers near one plane, a camera cannot tell a target from its mirror image
//! across the plane through its centre, perpendicular to the line of sight. That mirror image of a
//! plane is a rotation of it, and a second minimum of the error lies close by.

use nalgebra::{Matrix3, Rotation3, Vector3};

use super::Observation;
use super::collinearity::CollinearityCost;
use super::problem::{Problem, flattest_axis};
use super::refine::{CentredPose, Fit};

/// Chord (about rad) under which two poses are the same minimum.
pub(crate) const SAME_MINIMUM: f64 = 0.02;

/// Returns the likelihood of a rival pose over that of the chosen one, at most 1.
pub(crate) fn likelihood_ratio(rival_chi_squared: f64, chosen_chi_squared: f64) -> f64 {
    (0.5 * (chosen_chi_squared - rival_chi_squared))
        .exp()
        .min(1.0)
}

/// Returns the minimum in front of the camera that the mirrored target leads to; none when there is
/// none, or it is the chosen pose itself.
pub(crate) fn rival(
    problem: &Problem,
    observations: &[Observation],
    cost: &CollinearityCost,
    chosen: &CentredPose,
) -> Option<Fit> {
    let start = mirrored(
        &chosen.rotation,
        &chosen.centre_in_camera,
        &flattest_axis(observations)?,
    );
    let minimum = problem.descend(cost, &start).ok()?;
    if is_same(&minimum.rotation, &chosen.rotation) {
        return None;
    }
    let fit = problem.fit(observations, cost, &minimum.rotation).ok()?;
    (!is_same(&fit.pose.rotation, &chosen.rotation)).then_some(fit)
}

pub(crate) fn is_same(a: &Rotation3<f64>, b: &Rotation3<f64>) -> bool {
    (a.matrix() - b.matrix()).norm() < SAME_MINIMUM
}

/// `(I − 2 l lᵀ) R (I − 2 n nᵀ)`: two reflections make a rotation.
fn mirrored(
    rotation: &Rotation3<f64>,
    centre_in_camera: &Vector3<f64>,
    plane_normal: &Vector3<f64>,
) -> Rotation3<f64> {
    let reflection =
        |v: &Vector3<f64>| Matrix3::identity() - v * v.transpose() * (2.0 / v.norm_squared());
    Rotation3::from_matrix_unchecked(
        reflection(centre_in_camera) * rotation.matrix() * reflection(plane_normal),
    )
}
