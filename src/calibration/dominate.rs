//! Sigmas and modes of a marker map that claim no more than a covariance of its errors.
//!
//! A map states one sigma for each marker and a few modes, displacements that go together. Errors that remain after an
//! adjustment are correlated between markers. Sigmas of their own variances alone would let a pose look better than it
//! is: a common shift would average out. So the statement is `D + L Lᵀ ≥ C` in the order of positive semidefinite
//! matrices: no linear combination of coordinates, hence no pose, has a smaller variance by the statement than by `C`.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// Rounds of splitting a covariance into modes and what markers have of their own.
const ROUNDS: usize = 60;
/// The same of large maps, of which each round takes seconds.
const FEW_ROUNDS: usize = 5;
const LARGE: usize = 240;
/// Ratio of the barrier's weights from one stage to the next, and stages: the sum of variances ends within 1e-5 of the
/// least.
const BARRIER_RATIO: f64 = 0.2;
const STAGES: usize = 12;
const NEWTON_STEPS: usize = 30;
/// m²; ten micrometres, the last digit of a written map.
const LEAST_VARIANCE_M2: f64 = 1e-10;
/// Steps of 1 m in which a mode's sigma is written, and of 1 in which its shape is.
const SIGMA_STEPS: f64 = 1e5;
const SHAPE_STEPS: f64 = 1e4;

/// A statement that a map can make.
#[derive(Debug, Clone)]
pub(super) struct Statement {
    /// Variance of each coordinate, by body.
    pub(super) variances: Vec<f64>,
    pub(super) modes: Vec<Mode>,
}

/// A displacement of all coordinates together, with the digits that are written.
#[derive(Debug, Clone)]
pub(super) struct Mode {
    /// m, of the body that moves most.
    pub(super) sigma_m: f64,
    /// Displacements, the largest of which is 1.
    pub(super) shape: DVector<f64>,
}

impl Mode {
    /// Returns a displacement at one sigma as it is written.
    fn rounded(shift: &DVector<f64>) -> Self {
        let bodies = 0..shift.len() / 3;
        let largest = bodies.map(|body| shift.fixed_rows::<3>(3 * body).norm());
        let sigma_m = (largest.fold(0.0, f64::max) * SIGMA_STEPS).ceil() / SIGMA_STEPS;
        // Adding zero, because a negative one would be written with its sign.
        let shape = shift.map(|part| (part / sigma_m * SHAPE_STEPS).round() / SHAPE_STEPS + 0.0);
        Self { sigma_m, shape }
    }

    /// Returns the displacement at one sigma, m.
    fn shift(&self) -> DVector<f64> {
        &self.shape * self.sigma_m
    }
}

impl Statement {
    /// Returns the covariance that it claims.
    pub(super) fn covariance(&self) -> DMatrix<f64> {
        let size = 3 * self.variances.len();
        let own = DVector::from_fn(size, |i, _| self.variances[i / 3]);
        let mut sum = DMatrix::from_diagonal(&own);
        for mode in &self.modes {
            let shift = mode.shift();
            sum += &shift * shift.transpose();
        }
        sum
    }
}

/// Returns the statement with at most `most_modes` modes that dominates a covariance with little excess.
pub(super) fn dominate(covariance: &DMatrix<f64>, most_modes: usize) -> Statement {
    let bodies = covariance.nrows() / 3;
    let count = most_modes.min(3 * bodies);
    let modes = common_modes(covariance, count);
    // A mode of nothing has no shape.
    let shifts = modes.iter().filter(|shift| shift.amax() > 0.0);
    let modes: Vec<Mode> = shifts.map(Mode::rounded).collect();
    let mut rest = covariance.clone();
    for mode in &modes {
        let shift = mode.shift();
        rest -= &shift * shift.transpose();
    }
    let variances = least_diagonal(&rest);
    Statement { variances, modes }
}

/// Returns the modes that explain most of what coordinates have in common: a factor analysis by principal factors.
fn common_modes(covariance: &DMatrix<f64>, count: usize) -> Vec<DVector<f64>> {
    let bodies = covariance.nrows() / 3;
    let mut own: Vec<f64> = vec![0.0; bodies];
    if let Some(inverse) = covariance.clone().cholesky() {
        // What no other coordinate explains.
        let inverse = inverse.inverse();
        for (body, variance) in own.iter_mut().enumerate() {
            let parts = (0..3).map(|axis| inverse[(3 * body + axis, 3 * body + axis)].recip());
            *variance = parts.sum::<f64>() / 3.0;
        }
    }
    let mut modes = Vec::new();
    let is_large = covariance.nrows() > LARGE;
    for _ in 0..if is_large { FEW_ROUNDS } else { ROUNDS } {
        let diagonal = DVector::from_fn(covariance.nrows(), |i, _| own[i / 3]);
        let eigen = SymmetricEigen::new(covariance - DMatrix::from_diagonal(&diagonal));
        let mut order: Vec<usize> = (0..covariance.nrows()).collect();
        order.sort_unstable_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
        modes = order
            .into_iter()
            .take(count)
            .filter(|&i| eigen.eigenvalues[i] > LEAST_VARIANCE_M2)
            .map(|i| eigen.eigenvectors.column(i) * eigen.eigenvalues[i].sqrt())
            .collect();
        for (body, variance) in own.iter_mut().enumerate() {
            let left = (3 * body..3 * body + 3).map(|i| {
                let common: f64 = modes
                    .iter()
                    .map(|mode: &DVector<f64>| mode[i].powi(2))
                    .sum();
                covariance[(i, i)] - common
            });
            *variance = (left.sum::<f64>() / 3.0).max(0.0);
        }
    }
    modes
}

/// Returns the variances of bodies with the least sum whose diagonal matrix dominates a symmetric one: Newton's method on
/// the sum with a logarithmic barrier.
fn least_diagonal(rest: &DMatrix<f64>) -> Vec<f64> {
    let (size, bodies) = (rest.nrows(), rest.nrows() / 3);
    let scale = rest.amax().max(LEAST_VARIANCE_M2);
    let top = rest.clone().symmetric_eigenvalues().max().max(0.0) / scale;
    let scaled = rest / scale;
    let mut variances = DVector::from_element(bodies, 1.1 * top + 1e-3);
    let slack = |variances: &DVector<f64>| {
        let own = DVector::from_fn(size, |i, _| variances[i / 3]);
        (DMatrix::from_diagonal(&own) - &scaled).cholesky()
    };
    let merit = |variances: &DVector<f64>, barrier: f64| {
        let logarithm: f64 = slack(variances)?.l().diagonal().map(f64::ln).sum();
        Some(variances.sum() - 2.0 * barrier * logarithm)
    };
    let mut barrier = 0.1 * (top + 1e-3);
    for _ in 0..STAGES {
        for _ in 0..NEWTON_STEPS {
            let Some(inverse) = slack(&variances).map(|factor| factor.inverse()) else {
                break;
            };
            let block = |a: usize, b: usize| inverse.view((3 * a, 3 * b), (3, 3));
            let gradient = DVector::from_fn(bodies, |a, _| 1.0 - barrier * block(a, a).trace());
            let curvature =
                DMatrix::from_fn(bodies, bodies, |a, b| barrier * block(a, b).norm_squared());
            let Some(factor) = curvature.cholesky() else {
                break;
            };
            let step = -factor.solve(&gradient);
            let decrease = -step.dot(&gradient);
            if decrease < 1e-10 {
                break;
            }
            let Some(here) = merit(&variances, barrier) else {
                break;
            };
            let mut length = 1.0;
            while length > 1e-9 {
                let trial = &variances + &step * length;
                if merit(&trial, barrier).is_some_and(|there| there < here) {
                    variances = trial;
                    break;
                }
                length *= 0.5;
            }
            if length <= 1e-9 {
                break;
            }
        }
        barrier *= BARRIER_RATIO;
    }
    // Sums of rounded numbers may miss it by an ulp.
    let margin = 1e-9 * scale + LEAST_VARIANCE_M2;
    variances
        .iter()
        .map(|variance| (variance * scale + margin).max(LEAST_VARIANCE_M2))
        .collect()
}

/// Returns two matrices that dominate a joint covariance as its diagonal blocks: `[[A, B], [Bᵀ, C]] ≤ diag(A', C')`.
///
/// With `K = A^(−1/2) B C^(−1/2) = U r Vᵀ` the excess is `A^(1/2) U r Uᵀ A^(1/2)` and likewise for `C`: each pair of
/// canonical variables is widened by its own correlation.
pub(super) fn separate(joint: &DMatrix<f64>, first: usize) -> (DMatrix<f64>, DMatrix<f64>) {
    let second = joint.nrows() - first;
    let a = joint.view((0, 0), (first, first)).into_owned();
    let c = joint.view((first, first), (second, second)).into_owned();
    if first == 0 || second == 0 {
        return (a, c);
    }
    let b = joint.view((0, first), (first, second)).into_owned();
    let (root_a, inverse_a) = roots(&a);
    let (root_c, inverse_c) = roots(&c);
    let svd = (inverse_a * b * inverse_c).svd(true, true);
    let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else {
        // Asked for above, so always there; twice each block dominates in any case.
        return (a * 2.0, c * 2.0);
    };
    let r = DMatrix::from_diagonal(&svd.singular_values);
    let (left, right) = (root_a * u, root_c * v_t.transpose());
    (
        a + &left * &r * left.transpose(),
        c + &right * &r * right.transpose(),
    )
}

/// Returns the symmetric root of a positive semidefinite matrix and the pseudo-inverse of that root.
fn roots(matrix: &DMatrix<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
    let eigen = SymmetricEigen::new(matrix.clone());
    let floor = 1e-12 * eigen.eigenvalues.amax();
    let of = |power: fn(f64) -> f64| {
        let values = eigen.eigenvalues.map(|value| {
            if value > floor {
                power(value.sqrt())
            } else {
                0.0
            }
        });
        &eigen.eigenvectors * DMatrix::from_diagonal(&values) * eigen.eigenvectors.transpose()
    };
    (of(|root| root), of(f64::recip))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    fn least_eigenvalue(matrix: &DMatrix<f64>) -> f64 {
        matrix.symmetric_eigenvalues().min()
    }

    /// Errors of 5 cm that all bodies share along each axis, and of 5 mm that each has of its own.
    fn shifted(bodies: usize) -> DMatrix<f64> {
        DMatrix::from_fn(3 * bodies, 3 * bodies, |i, j| {
            let common = if i % 3 == j % 3 {
                0.05_f64.powi(2)
            } else {
                0.0
            };
            let own = if i == j { 0.005_f64.powi(2) } else { 0.0 };
            common + own
        })
    }

    fn drawn(size: usize, rank: usize, seed: u64) -> DMatrix<f64> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let factor = DMatrix::from_fn(size, rank, |_, _| {
            let normal: f64 = StandardNormal.sample(&mut random);
            0.01 * normal
        });
        &factor * factor.transpose()
    }

    #[test]
    fn a_statement_never_claims_less_than_the_covariance() {
        for seed in 0..20 {
            let covariance = drawn(24, 30, seed);
            for modes in [0, 1, 4, 12] {
                let statement = dominate(&covariance, modes);
                let excess = statement.covariance() - &covariance;
                let least = least_eigenvalue(&excess);
                assert!(least > -1e-12, "seed {seed}, {modes} modes: {least}");
                assert!(statement.modes.len() <= modes);
            }
        }
    }

    #[test]
    fn modes_state_what_is_common_and_sigmas_what_is_not() {
        let covariance = shifted(6);
        let statement = dominate(&covariance, 12);
        assert_eq!(statement.modes.len(), 3);
        for variance in &statement.variances {
            assert!((variance.sqrt() / 0.005 - 1.0).abs() < 0.05, "{variance}");
        }
    }

    /// The variance of a mean of six is not a sixth of it: each has to be six times as large.
    #[test]
    fn without_modes_every_marker_is_widened_until_their_mean_is_as_uncertain() {
        let statement = dominate(&shifted(6), 0);
        let least = 6.0 * 0.05_f64.powi(2) + 0.005_f64.powi(2);
        for variance in &statement.variances {
            assert!((variance / least - 1.0).abs() < 1e-3, "{variance} {least}");
        }
    }

    #[test]
    fn the_least_diagonal_of_one_common_error_is_the_known_one() {
        // Of g gᵀ, g = (1, 2, 3) along x: d = |g| Σ|g|.
        let mut g = DVector::zeros(9);
        (g[0], g[3], g[6]) = (0.01, 0.02, 0.03);
        let found = least_diagonal(&(&g * g.transpose()));
        for (found, expected) in found.iter().zip([0.6e-3, 1.2e-3, 1.8e-3]) {
            assert!((found / expected - 1.0).abs() < 1e-2, "{found} {expected}");
        }
    }

    #[test]
    fn separated_blocks_dominate_the_joint_covariance() {
        for seed in 0..20 {
            let joint = drawn(12, 12, seed);
            let (a, c) = separate(&joint, 9);
            let mut blocks = DMatrix::zeros(12, 12);
            blocks.view_mut((0, 0), (9, 9)).copy_from(&a);
            blocks.view_mut((9, 9), (3, 3)).copy_from(&c);
            let least = least_eigenvalue(&(blocks - &joint));
            assert!(least > -1e-10, "seed {seed}: {least}");
        }
    }
}
