//! The normal equations of a pose by their blocks: attitude, position, and their coupling.
//!
//! With `T`, `M`, `P` the blocks for rotation, rotation and position, and position, the information of the attitude
//! with free position is `S = T − M P⁻¹ Mᵀ`. `S⁻¹` is its covariance, and everything else follows from `K = M P⁻¹` by
//! products. Two closed inverses of 3×3 take half the time of a 6×6 factorisation, whose six divisions depend on each
//! other.

use nalgebra::{Matrix6, Vector3};

use super::symmetric3::{Symmetric3, positive_inverse, times};
use crate::geometry::PoseCovariance;

/// Rotation before position.
pub(crate) type Vector = [f64; 6];

/// A determinant below this share of the product of the diagonal means that the points leave a direction undetermined.
const MIN_SHARE: f64 = 1e-13;

/// `JᵀJ` of whitened residuals.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Information {
    pub(crate) turn: Symmetric3,
    /// Rows: rotation; columns: position.
    pub(crate) mixed: [[f64; 3]; 3],
    pub(crate) position: Symmetric3,
}

/// The factors needed to solve with an [`Information`].
#[derive(Debug, Clone, Copy)]
pub(crate) struct Solver {
    /// `S⁻¹`.
    turn_covariance: Symmetric3,
    /// `K = M P⁻¹`.
    lever: [[f64; 3]; 3],
    /// `P⁻¹`.
    position_inverse: Symmetric3,
}

impl Information {
    /// Returns the whole matrix.
    #[cfg(test)]
    pub(crate) fn matrix(&self) -> Matrix6<f64> {
        let (t, m, p) = (&self.turn, &self.mixed, &self.position);
        Matrix6::new(
            t[0], t[1], t[2], m[0][0], m[0][1], m[0][2], //
            t[1], t[3], t[4], m[1][0], m[1][1], m[1][2], //
            t[2], t[4], t[5], m[2][0], m[2][1], m[2][2], //
            m[0][0], m[1][0], m[2][0], p[0], p[1], p[2], //
            m[0][1], m[1][1], m[2][1], p[1], p[3], p[4], //
            m[0][2], m[1][2], m[2][2], p[2], p[4], p[5],
        )
    }

    /// Returns the matrix with its diagonal raised by a share.
    #[inline(always)]
    pub(crate) fn damped(&self, share: f64) -> Self {
        let raised = |block: Symmetric3| {
            let [a11, a12, a13, a22, a23, a33] = block;
            let raise = 1.0 + share;
            [a11 * raise, a12, a13, a22 * raise, a23, a33 * raise]
        };
        Self {
            turn: raised(self.turn),
            mixed: self.mixed,
            position: raised(self.position),
        }
    }

    /// Returns the factors; `None` unless the matrix is positive definite and well enough conditioned for its inverse
    /// to be meaningful.
    #[inline(always)]
    pub(crate) fn solver(&self) -> Option<Solver> {
        let (t, p) = (&self.turn, &self.position);
        let position_inverse = positive_inverse(p, [p[0], p[3], p[5]], MIN_SHARE)?;
        let m = &self.mixed;
        let lever = [
            times(&position_inverse, m[0]),
            times(&position_inverse, m[1]),
            times(&position_inverse, m[2]),
        ];
        let free = [
            t[0] - dot(lever[0], m[0]),
            t[1] - dot(lever[0], m[1]),
            t[2] - dot(lever[0], m[2]),
            t[3] - dot(lever[1], m[1]),
            t[4] - dot(lever[1], m[2]),
            t[5] - dot(lever[2], m[2]),
        ];
        let turn_covariance = positive_inverse(&free, [t[0], t[3], t[5]], MIN_SHARE)?;
        Some(Solver {
            turn_covariance,
            lever,
            position_inverse,
        })
    }
}

impl Solver {
    /// Returns `A⁻¹ b`.
    #[inline(always)]
    pub(crate) fn solve(&self, b: &Vector) -> Vector {
        let (turn, position) = ([b[0], b[1], b[2]], [b[3], b[4], b[5]]);
        let k = &self.lever;
        let free = [
            turn[0] - dot(k[0], position),
            turn[1] - dot(k[1], position),
            turn[2] - dot(k[2], position),
        ];
        let turn = times(&self.turn_covariance, free);
        let alone = times(&self.position_inverse, position);
        let pulled =
            |i: usize| alone[i] - (k[0][i] * turn[0] + k[1][i] * turn[1] + k[2][i] * turn[2]);
        [turn[0], turn[1], turn[2], pulled(0), pulled(1), pulled(2)]
    }

    /// Returns whether all numbers are finite; a NaN or infinity makes their sum so.
    #[inline(always)]
    pub(crate) fn is_finite(&self) -> bool {
        let [c, p] = [&self.turn_covariance, &self.position_inverse]
            .map(|m| (m[0] + m[1]) + (m[2] + m[3]) + (m[4] + m[5]));
        let lever = self.lever.as_flattened().iter().sum::<f64>();
        (c + p + lever).is_finite()
    }

    /// Returns the trace of the attitude's covariance, rad².
    #[inline(always)]
    pub(crate) fn turn_variance(&self) -> f64 {
        let c = &self.turn_covariance;
        c[0] + c[3] + c[5]
    }

    /// Returns `A⁻¹`, exactly symmetric, rotation before position.
    pub(crate) fn covariance(&self) -> Matrix6<f64> {
        let (c, mixed, p) = self.covariance_blocks(&self.lever);
        let ([m1, m2, m3], [c1, c2, c3]) = (mixed, c);
        let [p11, p12, p13, p22, p23, p33] = p;
        Matrix6::new(
            c1[0], c1[1], c1[2], m1[0], m1[1], m1[2], //
            c2[0], c2[1], c2[2], m2[0], m2[1], m2[2], //
            c3[0], c3[1], c3[2], m3[0], m3[1], m3[2], //
            m1[0], m2[0], m3[0], p11, p12, p13, //
            m1[1], m2[1], m3[1], p12, p22, p23, //
            m1[2], m2[2], m3[2], p13, p23, p33,
        )
    }

    /// Returns the covariance of the attitude and of another point of the same body, with `arm` from that point to the
    /// point of the normal equations; exactly symmetric.
    ///
    /// A rotation moves that point by `arm × δθ` more, so `K + [arm]×` replaces `K`.
    #[inline(always)]
    pub(crate) fn covariance_of_point(&self, arm: &Vector3<f64>) -> PoseCovariance {
        let k = &self.lever;
        let k = [
            [k[0][0], k[0][1] - arm.z, k[0][2] + arm.y],
            [k[1][0] + arm.z, k[1][1], k[1][2] - arm.x],
            [k[2][0] - arm.y, k[2][1] + arm.x, k[2][2]],
        ];
        let (c, mixed, p) = self.covariance_blocks(&k);
        let ([m1, m2, m3], [c1, c2, c3]) = (mixed, c);
        let [p11, p12, p13, p22, p23, p33] = p;
        PoseCovariance(Matrix6::new(
            p11, p12, p13, m1[0], m2[0], m3[0], //
            p12, p22, p23, m1[1], m2[1], m3[1], //
            p13, p23, p33, m1[2], m2[2], m3[2], //
            m1[0], m1[1], m1[2], c1[0], c1[1], c1[2], //
            m2[0], m2[1], m2[2], c2[0], c2[1], c2[2], //
            m3[0], m3[1], m3[2], c3[0], c3[1], c3[2],
        ))
    }

    /// Returns `C = S⁻¹`, `−C K` and `P⁻¹ + Kᵀ C K`.
    #[inline(always)]
    fn covariance_blocks(&self, k: &[[f64; 3]; 3]) -> ([[f64; 3]; 3], [[f64; 3]; 3], Symmetric3) {
        let (c, p) = (&self.turn_covariance, &self.position_inverse);
        let c = [[c[0], c[1], c[2]], [c[1], c[3], c[4]], [c[2], c[4], c[5]]];
        let mut mixed = [[0.0; 3]; 3];
        for i in 0..3 {
            for j in 0..3 {
                mixed[i][j] = -(c[i][0] * k[0][j] + c[i][1] * k[1][j] + c[i][2] * k[2][j]);
            }
        }
        let position = |i: usize, j: usize, alone: f64| {
            alone - (k[0][i] * mixed[0][j] + k[1][i] * mixed[1][j] + k[2][i] * mixed[2][j])
        };
        let position = [
            position(0, 0, p[0]),
            position(0, 1, p[1]),
            position(0, 2, p[2]),
            position(1, 1, p[3]),
            position(1, 2, p[4]),
            position(2, 2, p[5]),
        ];
        (c, mixed, position)
    }
}

#[inline(always)]
fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector6;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Relative; condition numbers of a few thousand.
    const ROUNDING: f64 = 1e-9;

    fn information(m: &Matrix6<f64>) -> Information {
        let block = |at: usize| {
            let entry = |i: usize, j: usize| m[(at + i, at + j)];
            [
                entry(0, 0),
                entry(0, 1),
                entry(0, 2),
                entry(1, 1),
                entry(1, 2),
                entry(2, 2),
            ]
        };
        Information {
            turn: block(0),
            mixed: std::array::from_fn(|i| std::array::from_fn(|j| m[(i, 3 + j)])),
            position: block(3),
        }
    }

    #[test]
    fn solution_and_covariance_agree_with_a_library() {
        let mut random = ChaCha8Rng::seed_from_u64(6);
        for _ in 0..1000 {
            let half = Matrix6::from_fn(|_, _| random.random_range(-1.0..1.0_f64));
            let a = half * half.transpose() + Matrix6::identity() * 0.01;
            assert_eq!(information(&a).matrix(), a);
            let b = Vector6::from_fn(|_, _| random.random_range(-1.0..1.0));
            let solver = information(&a).solver().expect("positive definite");
            let expected = a.cholesky().expect("positive definite");
            let x = Vector6::from(solver.solve(&b.into()));
            assert!((x - expected.solve(&b)).norm() < ROUNDING * x.norm());
            let covariance = solver.covariance();
            let inverse = expected.inverse();
            assert!((covariance - inverse).norm() < ROUNDING * inverse.norm());
            assert_eq!(covariance, covariance.transpose());

            let arm = Vector3::new(3.0, -0.5, 1.0);
            let of_point = solver.covariance_of_point(&arm).0;
            let expected = PoseCovariance::from_point(&inverse, &arm).0;
            assert!((of_point - expected).norm() < ROUNDING * expected.norm());
            assert_eq!(of_point, of_point.transpose());

            let raised = a + Matrix6::from_diagonal(&(a.diagonal() * 0.1));
            let solver = information(&a).damped(0.1).solver().expect("more definite");
            let x = Vector6::from(solver.solve(&b.into()));
            assert!((raised * x - b).norm() < ROUNDING * b.norm());
        }
    }

    #[test]
    fn singular_indefinite_and_meaningless_matrices_have_no_solver() {
        let identity = Matrix6::<f64>::identity();
        for (row, column) in [(0, 1), (3, 4), (0, 5)] {
            let mut equal_rows = identity;
            equal_rows[(row, column)] = 1.0;
            equal_rows[(column, row)] = 1.0;
            assert!(
                information(&equal_rows).solver().is_none(),
                "{row}, {column}"
            );
        }
        for matrix in [-identity, Matrix6::zeros(), Matrix6::from_element(f64::NAN)] {
            assert!(information(&matrix).solver().is_none());
        }
    }
}
