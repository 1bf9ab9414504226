//! Maximum likelihood: the pose with the least sum of squared pixel residuals over their variances.
//!
//! Gauss-Newton on a left rotation increment and the position of the markers' mean. The lens model is evaluated at the
//! prediction, so that the residuals are in the pixels of the distorted image, in which the noise is stated. Steps that
//! do not descend are damped (Levenberg-Marquardt).

use super::centred_pose::CentredPose;
use super::lanes::information::{Solver, Vector};
use super::residuals::{Residuals, Slope};

/// Limit of steps; two or three are usual.
pub(crate) const MAX_ITERATIONS: u16 = 50;
/// Predicted decrease of chi-squared at which the fit has converged: a thousandth of a sigma, squared.
const GAIN_TOLERANCE: f64 = 1e-6;
/// Share of chi-squared below which a decrease is rounding; matters only with residuals of thousands of sigmas.
const ROUNDING: f64 = 1e-12;
/// Damping above which no step helps.
const MAX_DAMPING: f64 = 1e9;

/// Result of a fit.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Fit {
    pub(crate) pose: CentredPose,
    pub(crate) chi_squared: f64,
    /// px², over columns and rows.
    pub(crate) squared_residuals_px: f64,
    /// The factored information `JᵀΣ⁻¹J`, rotation before position of the mean; `None` for the paper's estimate, whose
    /// covariance is not the inverse of a curvature.
    pub(crate) solver: Option<Solver>,
    pub(crate) iterations: u16,
}

/// Why a fit failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum FitFailure {
    /// A point has no pixel at the start: behind the camera, or outside the lens model.
    StartNotVisible,
    /// The information matrix is singular.
    Singular,
    NotConverged,
}

/// Returns the maximum likelihood pose that descent from `start` reaches, with its factored information.
///
/// # Inputs
/// * `explain`: converts a failure into an error.
///
/// # Source
/// `D = (1/z) [fx 0 −fx x; 0 fy −fy y]` for a pinhole, the lens model's derivative times
/// `(1/z) [1 0 −x; 0 1 −y]` in general; `J = [−D [R p]×, D]`, weighted by each point's sigma.
#[inline(always)]
pub(crate) fn maximum_likelihood<E, R: Residuals>(
    residuals: &R,
    start: CentredPose,
    explain: impl Fn(FitFailure) -> E,
) -> Result<Fit, E> {
    let singular = || explain(FitFailure::Singular);
    let allowed = 1.0 + R::RISE;
    let mut pose = start;
    let mut here = residuals
        .linearise(&pose)
        .ok_or_else(|| explain(FitFailure::StartNotVisible))?;
    let mut damping = 0.0;
    for iteration in 1..=MAX_ITERATIONS {
        let Some(solver) = here.information.damped(damping).solver() else {
            if damping == 0.0 && iteration > 1 {
                // The start was not singular, so a bad step led here: damp it.
                damping = 1e-3;
                continue;
            }
            return Err(singular());
        };
        let step = solver.solve(&here.slope.gradient).map(|value| -value);
        let gain = -dot(&step, &here.slope.gradient);
        if damping == 0.0 && gain < GAIN_TOLERANCE.max(ROUNDING * here.slope.chi_squared) {
            return finish(&pose.moved(&step), &here.slope, gain, &solver, iteration)
                .ok_or_else(singular);
        }
        if damping > 0.0
            && let Some(undamped) = here.information.solver()
        {
            // In a strongly curved valley full steps would overshoot indefinitely.
            let gradient = &here.slope.gradient;
            let gain = dot(&undamped.solve(gradient), gradient);
            if gain < GAIN_TOLERANCE.max(ROUNDING * here.slope.chi_squared) {
                return finish(&pose, &here.slope, 0.0, &undamped, iteration).ok_or_else(singular);
            }
        }
        let trial = pose.moved(&step);
        if damping == 0.0
            && pose.is_near(&step)
            && let Some(there) = residuals.slope(&trial, &here.kept)
            && there.chi_squared <= here.slope.chi_squared * allowed
        {
            let last = solver.solve(&there.gradient).map(|value| -value);
            let gain = -dot(&last, &there.gradient);
            if gain < GAIN_TOLERANCE.max(ROUNDING * there.chi_squared) {
                return finish(&trial.moved(&last), &there, gain, &solver, iteration + 1)
                    .ok_or_else(singular);
            }
        }
        match residuals.linearise(&trial) {
            Some(there) if there.slope.chi_squared <= here.slope.chi_squared * allowed => {
                (pose, here) = (trial, there);
                damping = if damping < 1e-6 { 0.0 } else { damping * 0.1 };
            }
            _ => {
                damping = if damping == 0.0 { 1e-3 } else { damping * 10.0 };
                if damping > MAX_DAMPING {
                    return Err(explain(FitFailure::NotConverged));
                }
            }
        }
    }
    Err(explain(FitFailure::NotConverged))
}

#[inline(always)]
fn finish(
    pose: &CentredPose,
    here: &Slope,
    gain: f64,
    solver: &Solver,
    iterations: u16,
) -> Option<Fit> {
    let chi_squared = (here.chi_squared - gain).max(0.0);
    // The last step changes both sums by the same factor; it is too short to justify another pass over the points.
    let share = if here.chi_squared > 0.0 {
        chi_squared / here.chi_squared
    } else {
        1.0
    };
    if !(chi_squared.is_finite() && solver.is_finite()) {
        return None;
    }
    Some(Fit {
        pose: *pose,
        chi_squared,
        squared_residuals_px: here.squared_residuals_px * share,
        solver: Some(*solver),
        iterations,
    })
}

#[inline(always)]
fn dot(a: &Vector, b: &Vector) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Returns chi-squared and the squared residuals in px² at a pose; `None` if a point has no pixel there.
pub(crate) fn squared_residuals(
    residuals: &impl Residuals,
    pose: &CentredPose,
) -> Option<(f64, f64)> {
    let here = residuals.linearise(pose)?;
    Some((here.slope.chi_squared, here.slope.squared_residuals_px))
}
