//! Newton's method on the rotation group: the fixed point of orthogonal iteration in two to four steps.

use nalgebra::{Matrix3, Rotation3, Vector3};

use super::collinearity::CollinearityCost;
use super::lanes::columns::{Columns, Splats};
use super::lanes::four::{Arithmetic, Kernel, vectorised};
use super::lanes::symmetric3::{positive_inverse, times};
use crate::geometry::{axial, cayley};

/// End point of a descent.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Minimum {
    pub(crate) rotation: Rotation3<f64>,
    pub(crate) cost: f64,
    pub(crate) iterations: u16,
    pub(crate) converged: bool,
}

/// Limit of steps; from a prior four are usual, from arbitrary starts about ten.
const MAX_ITERATIONS: u16 = 60;
/// rad; longest step, since the quadratic model is not valid beyond it.
const MAX_STEP: f64 = 0.8;
/// Halvings that reduce the longest step below [`TRUSTED_STEP`]; more are only needed for a cost that is NaN.
const MAX_HALVINGS: usize = 14;
/// rad; shorter steps are taken without a check: so close to the minimum, the decrease of the cost is below rounding.
const TRUSTED_STEP: f64 = 1e-4;

/// rad; above this length the decrease that the quadratic model predicts is not used.
const PROMISING_STEP: f64 = 0.3;
/// Largest predicted decrease that is used, relative to the cost: the error of the model is proportional to the cost.
/// With this value no relevant minimum was abandoned in a million frames; with 0.25 a few were.
const CREDIBLE_GAIN: f64 = 0.1;
/// A descent is abandoned if the predicted minimum exceeds the limit by this factor.
const HOPELESS: f64 = 5.0;

/// Returns the local minimum of `E(R)` in whose basin `seed` lies.
///
/// Stops after a step shorter than `step_tolerance` (rad). Convergence is quadratic, so the remaining error is about
/// the square of that.
///
/// # Source
/// Steps `R ← R cay(w)`; with `Y = mat(Ω r)`, `A = Rᵀ Y` half the gradient is the axial vector of
/// `A − Aᵀ` and half the Hessian `Jᵀ Ω J + sym(A) − tr(A) I`, `J = vec(R [e_k]×)`.
pub(crate) fn minimise(
    cost: &CollinearityCost,
    seed: &Rotation3<f64>,
    step_tolerance: f64,
) -> Minimum {
    minimise_below(cost, seed, step_tolerance, f64::INFINITY).unwrap_or(Minimum {
        rotation: *seed,
        cost: f64::INFINITY,
        iterations: 0,
        converged: false,
    })
}

/// As [`minimise`], but returns `None` as soon as the minimum will clearly be above `limit`: if the predicted end of a
/// full Newton step is [`HOPELESS`] times higher.
pub(crate) fn minimise_below(
    cost: &CollinearityCost,
    seed: &Rotation3<f64>,
    step_tolerance: f64,
    limit: f64,
) -> Option<Minimum> {
    vectorised(Descent {
        cost,
        seed,
        step_tolerance,
        limit,
    })
}

struct Descent<'a> {
    cost: &'a CollinearityCost,
    seed: &'a Rotation3<f64>,
    step_tolerance: f64,
    limit: f64,
}

impl Kernel for Descent<'_> {
    type Output = Option<Minimum>;

    #[inline(always)]
    fn run<A: Arithmetic>(self, arithmetic: A) -> Option<Minimum> {
        descend(arithmetic, &self)
    }
}

#[inline(always)]
fn descend<A: Arithmetic>(arithmetic: A, descent: &Descent) -> Option<Minimum> {
    let &Descent {
        cost,
        seed,
        step_tolerance,
        limit,
    } = descent;
    let mut here = Place::new(arithmetic, cost, Columns::new(arithmetic, seed.matrix()));
    let ended = |place: &Place<A>, iterations, converged| Minimum {
        rotation: Rotation3::from_matrix_unchecked(place.rotation.matrix()),
        cost: place.value,
        iterations,
        converged,
    };
    for iteration in 1..=MAX_ITERATIONS {
        let NewtonStep { mut step, promise } = newton_step(arithmetic, cost, &here);
        if let Some(gain) = promise
            && gain < CREDIBLE_GAIN * here.value
            && here.value - gain > HOPELESS * limit
        {
            return None;
        }
        let mut halvings = 0;
        loop {
            let turned = here.rotation.times(arithmetic, cayley(step).matrix());
            let trial = Place::new(arithmetic, cost, turned);
            if trial.value <= here.value || step.norm() < TRUSTED_STEP {
                here = trial;
                break;
            }
            halvings += 1;
            if halvings > MAX_HALVINGS {
                return Some(ended(&here, iteration, false));
            }
            step *= 0.5;
        }
        if step.norm_squared() < step_tolerance * step_tolerance {
            return Some(ended(&here, iteration, true));
        }
    }
    Some(ended(&here, MAX_ITERATIONS, false))
}

/// A rotation with its cost and gradient.
#[derive(Clone, Copy)]
struct Place<A: Arithmetic> {
    rotation: Columns<A>,
    splats: Splats<A>,
    /// `Y = mat(Ω r)`.
    half_gradient: Columns<A>,
    value: f64,
}

impl<A: Arithmetic> Place<A> {
    #[inline(always)]
    fn new(arithmetic: A, cost: &CollinearityCost, rotation: Columns<A>) -> Self {
        let splats = rotation.splats(arithmetic);
        let half_gradient = cost.half_gradient(arithmetic, &splats);
        Self {
            rotation,
            splats,
            half_gradient,
            value: rotation.dot(half_gradient),
        }
    }
}

/// A step, and the decrease of the cost that the quadratic model predicts; no prediction if that model has no minimum
/// nearby.
struct NewtonStep {
    step: Vector3<f64>,
    promise: Option<f64>,
}

#[inline(always)]
fn newton_step<A: Arithmetic>(
    arithmetic: A,
    cost: &CollinearityCost,
    here: &Place<A>,
) -> NewtonStep {
    let a = here.rotation.transpose_times(here.half_gradient);
    let gradient = axial(&a);
    let hessian = cost.curvature(arithmetic, here.rotation, &here.splats)
        + (a + a.transpose()) * 0.5
        - Matrix3::identity() * a.trace();
    let (step, is_convex) = match solve_positive(&hessian, &gradient) {
        Some(solution) => (-solution, true),
        None => (-solve_lifted(&hessian, &gradient), false),
    };
    let squared_length = step.norm_squared();
    let is_promising = is_convex && squared_length < PROMISING_STEP * PROMISING_STEP;
    let promise = is_promising.then(|| -step.dot(&gradient));
    let step = if squared_length > MAX_STEP * MAX_STEP {
        step * (MAX_STEP / squared_length.sqrt())
    } else {
        step
    };
    NewtonStep { step, promise }
}

/// Returns `H⁻¹ g`; `None` unless the matrix is positive definite.
#[inline(always)]
fn solve_positive(h: &Matrix3<f64>, g: &Vector3<f64>) -> Option<Vector3<f64>> {
    let upper = [h.m11, h.m12, h.m13, h.m22, h.m23, h.m33];
    let inverse = positive_inverse(&upper, [1.0; 3], 0.0)?;
    Some(Vector3::from(times(&inverse, [g.x, g.y, g.z])))
}

/// Solves with the Hessian, with its diagonal raised until it is positive definite, so that the step descends.
#[cold]
fn solve_lifted(hessian: &Matrix3<f64>, gradient: &Vector3<f64>) -> Vector3<f64> {
    let scale = hessian.norm().max(f64::MIN_POSITIVE);
    let mut lift = 0.01 * scale;
    // Doubling ends at the latest when the shift exceeds the matrix norm. It would not end for an infinite matrix.
    while scale.is_finite() && lift <= 8.0 * scale {
        if let Some(solution) = solve_positive(&(hessian + Matrix3::identity() * lift), gradient) {
            return solution;
        }
        lift *= 2.0;
    }
    gradient / scale
}
