//! Newton's method on the rotation group: the fixed point of orthogonal iteration in two to four steps.

use nalgebra::{Matrix3, Rotation3, Vector3};

use super::collinearity::CollinearityCost;
use crate::geometry::{axial, cayley};

/// Where a descent ended.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Minimum {
    pub(crate) rotation: Rotation3<f64>,
    pub(crate) cost: f64,
    pub(crate) iterations: u16,
    pub(crate) converged: bool,
}

/// Steps after which a descent is given up; from a prior four are usual, from anywhere about ten.
const MAX_ITERATIONS: u16 = 60;
/// rad; a longer step leaves the region in which the quadratic model says anything.
const MAX_STEP: f64 = 0.8;
/// Halvings that bring the longest step under [`TRUSTED_STEP`]; more would mean a cost that is not a number.
const MAX_HALVINGS: usize = 14;
/// rad; a shorter step is in the quadratic regime, where the cost is too flat to tell its descent from rounding.
const TRUSTED_STEP: f64 = 1e-4;

/// Returns the local minimum of `E(R)` in whose basin `seed` lies.
///
/// It stops after a step shorter than `step_tolerance` (rad); convergence is quadratic, so the
/// error that remains is about the square of that.
///
/// # Source
/// Steps `R ← R cay(w)`; with `Y = mat(Ω r)`, `A = Rᵀ Y` half the gradient is the axial vector of
/// `A − Aᵀ` and half the Hessian `Jᵀ Ω J + sym(A) − tr(A) I`, `J = vec(R [e_k]×)`.
pub(crate) fn minimise(
    cost: &CollinearityCost,
    seed: &Rotation3<f64>,
    step_tolerance: f64,
) -> Minimum {
    let mut rotation = *seed;
    let mut y = cost.half_gradient(&rotation);
    let mut value = rotation.matrix().dot(&y);
    for iteration in 1..=MAX_ITERATIONS {
        let mut step = newton_step(cost, &rotation, &y);
        let mut halvings = 0;
        loop {
            let trial = rotation * cayley(step);
            let trial_y = cost.half_gradient(&trial);
            let trial_value = trial.matrix().dot(&trial_y);
            if trial_value <= value || step.norm() < TRUSTED_STEP {
                (rotation, y, value) = (trial, trial_y, trial_value);
                break;
            }
            halvings += 1;
            if halvings > MAX_HALVINGS {
                return Minimum {
                    rotation,
                    cost: value,
                    iterations: iteration,
                    converged: false,
                };
            }
            step *= 0.5;
        }
        if step.norm() < step_tolerance {
            return Minimum {
                rotation,
                cost: value,
                iterations: iteration,
                converged: true,
            };
        }
    }
    Minimum {
        rotation,
        cost: value,
        iterations: MAX_ITERATIONS,
        converged: false,
    }
}

#[inline]
fn newton_step(
    cost: &CollinearityCost,
    rotation: &Rotation3<f64>,
    y: &Matrix3<f64>,
) -> Vector3<f64> {
    let r = rotation.matrix();
    let a = r.tr_mul(y);
    let gradient = axial(&a);
    let hessian =
        cost.curvature(rotation) + (a + a.transpose()) * 0.5 - Matrix3::identity() * a.trace();
    let step = -solve_damped(&hessian, &gradient);
    let length = step.norm();
    if length > MAX_STEP {
        step * (MAX_STEP / length)
    } else {
        step
    }
}

/// Solves with the Hessian, lifted until it is positive definite so that the step descends.
fn solve_damped(hessian: &Matrix3<f64>, gradient: &Vector3<f64>) -> Vector3<f64> {
    let mut lifted = *hessian;
    let scale = hessian.norm().max(f64::MIN_POSITIVE);
    let mut lift = 0.0;
    loop {
        if let Some(factor) = lifted.cholesky() {
            return factor.solve(gradient);
        }
        // Doubling ends at the latest when the lift exceeds the matrix norm.
        lift = if lift == 0.0 {
            0.01 * scale
        } else {
            2.0 * lift
        };
        if lift > 8.0 * scale || !lift.is_finite() {
            return gradient / scale;
        }
        lifted = hessian + Matrix3::identity() * lift;
    }
}
