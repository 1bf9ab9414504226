//! Newton's method on the rotation group: the fixed point of orthogonal iteration in two to four steps.

use nalgebra::{Matrix3, Rotation3, Vector3};

use super::collinearity::CollinearityCost;
use super::lanes::columns::{Columns, Splats};
use super::lanes::four::{Arithmetic, Kernel, vectorised};
use super::lanes::symmetric3::{positive_inverse, times};
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

/// rad; the quadratic model is asked how far down a longer step would lead, but not believed.
const PROMISING_STEP: f64 = 0.3;
/// Share of the cost that a promise may be: the model is off by a share of the cost, whatever the limit. In a million
/// frames no minimum that counts was given up; with 0.25 a few were.
const CREDIBLE_GAIN: f64 = 0.1;
/// How often the promised minimum must exceed a limit to give a descent up.
const HOPELESS: f64 = 5.0;

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
    minimise_below(cost, seed, step_tolerance, f64::INFINITY).unwrap_or(Minimum {
        rotation: *seed,
        cost: f64::INFINITY,
        iterations: 0,
        converged: false,
    })
}

/// Returns the same as [`minimise`], or none as soon as the minimum will clearly lie above `limit`:
/// where a full Newton step promises to end [`HOPELESS`] times higher.
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

/// A rotation with the cost there.
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

/// A step, and by how much the quadratic model says it lowers the cost; no promise where that model
/// has no minimum near.
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

/// Solves with the Hessian, lifted until it is positive definite so that the step descends.
#[cold]
fn solve_lifted(hessian: &Matrix3<f64>, gradient: &Vector3<f64>) -> Vector3<f64> {
    let scale = hessian.norm().max(f64::MIN_POSITIVE);
    let mut lift = 0.01 * scale;
    // Doubling ends at the latest when the lift exceeds the matrix norm; of one that is infinite it would not.
    while scale.is_finite() && lift <= 8.0 * scale {
        if let Some(solution) = solve_positive(&(hessian + Matrix3::identity() * lift), gradient) {
            return solution;
        }
        lift *= 2.0;
    }
    gradient / scale
}
