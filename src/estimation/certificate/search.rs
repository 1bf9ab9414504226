//! The search for a proof: Newton's method with a logarithmic barrier.

use super::dense::{Cholesky, Square, is_positive, product, times};
use super::family::{DIRECTIONS, FREE, MULTIPLIER, Member, OF_DEPTH, gram, is_proof, multiplier};
use super::form::{Form, Gram, OF_VECTOR, PRODUCTS};

/// Largest number of steps. Right minima mostly need one to five, wrong ones about ten to be recognised.
const MAX_STEPS: usize = 40;
/// First multiplier, as a share of the curvature at the minimum.
const FIRST_MULTIPLIER: f64 = 0.1;
/// First margin that is tried, and the factor by which it is lowered until `X` has it.
const FIRST_MARGIN: f64 = -0.01;
const LOWER: f64 = 4.0;
const MAX_LOWERINGS: usize = 24;
/// Weight of the margin against the barrier, times the margin's magnitude: at first, and at most.
const FIRST_URGE: f64 = 30.0;
const MAX_URGE: f64 = 200.0;
/// Smallest magnitude of a margin in that product.
const LEAST_MARGIN: f64 = 1e-7;
/// Factor by which a step is shortened, and the shortest that is tried.
const SHORTENED: f64 = 0.6;
const SHORTEST: f64 = 1e-4;
/// Newton decrement below which the best margin is within [`BARRIER`] over the weight of the current one. On the central
/// path the distance is 12 over the weight, the number of eigenvalues in the barrier.
const CENTRED: f64 = 0.5;
const BARRIER: f64 = 20.0;

/// Unknowns of a Newton step: the free parameters, and the margin.
const UNKNOWNS: usize = FREE + 1;

/// Returns whether a proof was found: a member whose `X` and `S` are positive definite.
///
/// Newton's method increases the margin, the largest `s` with `X ⪰ s D` ([`yardstick`]), from below zero. A proof needs
/// `s > 0` only: the search ends with the first member that passes [`is_proof`], or when `s` cannot reach zero.
///
/// # Source
/// Boyd, Vandenberghe, *Convex Optimization*, 2004, section 11.4 (phase I) and 11.3 (barrier).
#[inline(always)]
pub(super) fn find(form: &Form) -> bool {
    let curvature: Square<3> = std::array::from_fn(|i| std::array::from_fn(|j| form.excess[i][j]));
    // Not a minimum, or behind the camera.
    if !(is_positive(&curvature) && form.depth > 0.0) {
        return false;
    }
    let yardstick = yardstick(&curvature);
    let mut member = [0.0; FREE];
    for (value, (i, j, _)) in member[MULTIPLIER..].iter_mut().zip(OF_VECTOR) {
        let count = if i == j { 1.0 } else { 2.0 };
        *value = FIRST_MULTIPLIER * count * curvature[i][j];
    }
    let Some((mut margin, mut factor)) = first_margin(&gram(form, &member), &yardstick) else {
        return false;
    };
    let mut urge = FIRST_URGE;
    for _ in 0..MAX_STEPS {
        let weight = urge / margin.abs().max(LEAST_MARGIN);
        let Some(step) = newton_step(form, &yardstick, &member, &factor, weight) else {
            return false;
        };
        // No member has a margin above zero.
        if step.decrement < CENTRED && margin + BARRIER / weight < 0.0 {
            return false;
        }
        let mut length = 1.0;
        loop {
            let mut there = member;
            for (value, change) in there.iter_mut().zip(&step.change) {
                *value += length * change;
            }
            if is_proof(form, &there) {
                return true;
            }
            let margin_there = margin + length * step.change[FREE];
            if is_positive(&multiplier(&there))
                && let Some(found) =
                    Cholesky::new(&less(&gram(form, &there), margin_there, &yardstick))
            {
                (member, margin, factor) = (there, margin_there, found);
                break;
            }
            length *= SHORTENED;
            if length < SHORTEST {
                return false;
            }
        }
        if length < 0.5 {
            urge *= 0.4;
        } else if length >= 1.0 && step.decrement < 1.5 {
            urge = (2.0 * urge).min(MAX_URGE);
        }
    }
    false
}

/// Returns a positive definite matrix `D` of `(uᵀ A u) |q|²`, with `A` the curvature. With a margin `s` the excess is at
/// least `s` times its quadratic approximation.
#[inline(always)]
fn yardstick(curvature: &Square<3>) -> Gram {
    const PLACE: [[usize; 3]; 3] = [[3, 8, 7], [8, 4, 6], [7, 6, 5]];
    let mut d = [[0.0; PRODUCTS]; PRODUCTS];
    for i in 0..3 {
        for j in 0..3 {
            d[i][j] = curvature[i][j];
            for k in 0..3 {
                d[PLACE[i][k]][PLACE[j][k]] += curvature[i][j];
            }
        }
    }
    d
}

#[inline(always)]
fn less(x: &Gram, margin: f64, yardstick: &Gram) -> Gram {
    let mut less = *x;
    for (row, of_yardstick) in less.iter_mut().zip(yardstick) {
        for k in 0..PRODUCTS {
            row[k] -= margin * of_yardstick[k];
        }
    }
    less
}

/// Returns a margin that a matrix has, below the largest one, and the factor of `X − s D`.
#[inline(always)]
fn first_margin(x: &Gram, yardstick: &Gram) -> Option<(f64, Cholesky<PRODUCTS>)> {
    let mut margin = FIRST_MARGIN;
    for _ in 0..MAX_LOWERINGS {
        if is_positive(&less(x, margin, yardstick)) {
            // Away from the boundary, where Newton's model is good.
            margin *= 1.5;
            return Some((margin, Cholesky::new(&less(x, margin, yardstick))?));
        }
        margin *= LOWER;
    }
    None
}

struct Step {
    /// Of the member, then of the margin.
    change: [f64; UNKNOWNS],
    decrement: f64,
}

/// Returns the Newton step of `weight · s + ln det (X − s D) + ln det S`; `None` where it cannot be computed.
#[inline(always)]
fn newton_step(
    form: &Form,
    yardstick: &Gram,
    member: &Member,
    factor: &Cholesky<PRODUCTS>,
    weight: f64,
) -> Option<Step> {
    let inverse = factor.inverse();
    let of_yardstick = product(&inverse, yardstick);
    let both = with_depth(&product(&of_yardstick, &inverse), form);
    let p = with_depth(&inverse, form);
    let mut hessian = [[0.0; UNKNOWNS]; UNKNOWNS];
    let mut slope = [0.0; UNKNOWNS];
    for (k, of_k) in DIRECTIONS.iter().enumerate() {
        let [a, b] = of_k.first;
        let [c, d] = of_k.second;
        slope[k] = of_k.sign * p[a][b] - p[c][d];
        hessian[FREE][k] = both[c][d] - of_k.sign * both[a][b];
        for (m, of_m) in DIRECTIONS.iter().enumerate().take(k + 1) {
            // Twice the trace of P⟨a, b⟩P⟨e, f⟩.
            let trace =
                |[a, b]: [usize; 2], [e, f]: [usize; 2]| p[a][e] * p[b][f] + p[a][f] * p[b][e];
            let first = of_m.sign * trace(of_k.first, of_m.first) - trace(of_k.first, of_m.second);
            let second =
                of_m.sign * trace(of_k.second, of_m.first) - trace(of_k.second, of_m.second);
            hessian[k][m] = 0.5 * (of_k.sign * first - second);
        }
    }
    let s = Cholesky::new(&multiplier(member))?.inverse();
    for (k, (i, j, _)) in OF_VECTOR.into_iter().enumerate() {
        slope[MULTIPLIER + k] += s[i][j];
        for (m, (e, f, _)) in OF_VECTOR.into_iter().enumerate().take(k + 1) {
            hessian[MULTIPLIER + k][MULTIPLIER + m] +=
                0.5 * (s[i][e] * s[j][f] + s[i][f] * s[j][e]);
        }
    }
    for i in 0..PRODUCTS {
        slope[FREE] -= of_yardstick[i][i];
        for j in 0..PRODUCTS {
            hessian[FREE][FREE] += of_yardstick[i][j] * of_yardstick[j][i];
        }
    }
    slope[FREE] += weight;
    for k in 0..UNKNOWNS {
        for m in 0..k {
            hessian[m][k] = hessian[k][m];
        }
    }
    let change = Cholesky::new(&hessian)?.solve(&slope);
    let gain: f64 = change.iter().zip(&slope).map(|(x, y)| x * y).sum();
    gain.is_finite().then(|| Step {
        change,
        decrement: gain.max(0.0).sqrt(),
    })
}

/// Returns a matrix with one more row and column: its products with the coefficients of the depth.
#[inline(always)]
fn with_depth(matrix: &Gram, form: &Form) -> Square<{ PRODUCTS + 1 }> {
    let of_depth = times(matrix, &form.depth_shares);
    let mut extended = [[0.0; PRODUCTS + 1]; PRODUCTS + 1];
    for i in 0..PRODUCTS {
        extended[i][..PRODUCTS].copy_from_slice(&matrix[i]);
        extended[i][OF_DEPTH] = of_depth[i];
        extended[OF_DEPTH][i] = of_depth[i];
        extended[OF_DEPTH][OF_DEPTH] += of_depth[i] * form.depth_shares[i];
    }
    extended
}
