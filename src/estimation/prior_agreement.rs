//! Whether the image contradicts a prior of the attitude.
//!
//! The prior is in chi-squared like any other measurement, but there its three numbers stand beside those of all points,
//! and a contradiction of several sigmas passes among them. Tested alone it does not.

use nalgebra::{Matrix3, Vector3};

use super::PriorAgreement;
use super::problem::Problem;
use super::refine::Fit;
use super::trust::TrustLimits;

/// Part of the prior's variance that has to be left for a direction to count: where the image knows hardly more than the
/// prior, the estimate cannot contradict it.
const LEAST_SEEN: f64 = 1e-3;

/// Returns how a fit agrees with the prior; `None` without one, and for an estimate that does not weigh it.
#[inline(never)]
pub(crate) fn prior_agreement(
    problem: &Problem,
    fit: &Fit,
    limits: &TrustLimits,
) -> Option<PriorAgreement> {
    let prior = problem.attitude_prior()?;
    fit.solver.as_ref()?;
    let covariance = problem.covariance(fit).ok()?;
    let turn = prior.turn_to(&fit.pose.rotation);
    let (chi_squared, seen) = squared(
        &turn,
        &covariance.fixed_view::<3, 3>(0, 0).into_owned(),
        prior.information.recip(),
    );
    Some(PriorAgreement {
        information: prior.information,
        turn_rad: turn.norm(),
        chi_squared,
        limit: limits.limit(seen),
    })
}

/// Returns the squared turn over its covariance, and in how many directions the image sees it.
///
/// The estimate has the prior in it, so what is between them varies by the prior's variance less the estimate's.
fn squared(turn: &Vector3<f64>, estimate: &Matrix3<f64>, prior_variance: f64) -> (f64, usize) {
    let eigen = estimate.symmetric_eigen();
    let mut sum = 0.0;
    let mut seen = 0;
    for (variance, axis) in eigen
        .eigenvalues
        .iter()
        .zip(eigen.eigenvectors.column_iter())
    {
        let left = prior_variance - variance;
        if left > LEAST_SEEN * prior_variance {
            sum += axis.dot(turn).powi(2) / left;
            seen += 1;
        }
    }
    (sum, seen)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_turn_is_that_between_prior_and_image_over_the_variances_of_both() {
        // Of one direction: prior 4, image 12 off it with variance 5; the estimate is the weighted mean.
        let (prior, image, off) = (4.0, 5.0, 12.0);
        let estimate = 1.0 / (1.0 / prior + 1.0 / image);
        let turn = Vector3::x() * (off * estimate / image);
        let unseen = Matrix3::from_diagonal(&Vector3::new(estimate, prior, prior));
        let (found, seen) = squared(&turn, &unseen, prior);
        assert_eq!(seen, 1);
        assert!(
            (found - off * off / (prior + image)).abs() < 1e-12,
            "{found}"
        );
    }
}
