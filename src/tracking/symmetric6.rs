//! Symmetric 6×6 matrices, factored as `L D Lᵀ` with loops that the compiler can unroll.

use nalgebra::{ArrayStorage, Matrix6};

use super::matrix6::times;

type Vector = [f64; 6];

/// A pivot below this share of its diagonal entry means that the points leave a direction undetermined.
const MIN_PIVOT_SHARE: f64 = 1e-13;

/// Returns a symmetric matrix in the form that [`Factor::new`] takes.
#[inline]
pub(super) fn rows(m: &Matrix6<f64>) -> [[f64; 6]; 6] {
    // Columns instead of rows: the same numbers, without a transposition.
    m.data.0
}

/// `A = L D Lᵀ`, `L` with ones on its diagonal.
#[derive(Debug, Clone, Copy)]
pub(super) struct Factor {
    l: [[f64; 6]; 6],
    inverse_d: Vector,
}

impl Factor {
    /// Returns the factors of a symmetric matrix, of which the lower triangle is read; `None` unless it is positive
    /// definite and well enough conditioned for its inverse to be meaningful.
    #[inline(always)]
    pub(super) fn new(a: &[[f64; 6]; 6]) -> Option<Self> {
        let mut l = [[0.0; 6]; 6];
        let mut inverse_d = [0.0; 6];
        for j in 0..6 {
            // Row j of L D, kept in addition to L.
            let mut ld = [0.0; 6];
            let mut pivot = a[j][j];
            for k in 0..j {
                ld[k] = l[j][k];
                l[j][k] *= inverse_d[k];
                pivot -= ld[k] * l[j][k];
            }
            let is_free = pivot <= MIN_PIVOT_SHARE * a[j][j] || pivot.is_nan();
            if is_free {
                return None;
            }
            inverse_d[j] = 1.0 / pivot;
            for i in j + 1..6 {
                // `l[i][..j]` already holds `L D`; it is divided by `D` later.
                let mut value = a[i][j];
                for k in 0..j {
                    value -= l[i][k] * l[j][k];
                }
                l[i][j] = value;
            }
        }
        inverse_d
            .iter()
            .all(|value| value.is_finite())
            .then_some(Self { l, inverse_d })
    }

    /// Returns `D^(−½) L⁻¹ b`: white and of unit variance if `A` is the covariance of `b`.
    #[inline]
    pub(super) fn whiten(&self, b: &Vector) -> Vector {
        let mut x = *b;
        for i in 0..6 {
            for k in 0..i {
                x[i] -= self.l[i][k] * x[k];
            }
        }
        std::array::from_fn(|i| x[i] * self.inverse_d[i].sqrt())
    }

    /// Returns `bᵀ A⁻¹ b`.
    #[inline(always)]
    pub(super) fn explained(&self, b: &Matrix6<f64>) -> Matrix6<f64> {
        // Rows of L⁻¹ b, as columns.
        let mut x = b.transpose().data.0;
        for i in 0..6 {
            for k in 0..i {
                let known = x[k];
                for (x, known) in x[i].iter_mut().zip(known) {
                    *x -= self.l[i][k] * known;
                }
            }
        }
        let x = Matrix6::from_data(ArrayStorage(x));
        let mut weighted = x;
        for (column, inverse_d) in weighted.data.0.iter_mut().zip(self.inverse_d) {
            for value in column {
                *value *= inverse_d;
            }
        }
        times(&x, &weighted.transpose())
    }

    /// Returns `A⁻¹`, exactly symmetric.
    #[inline(always)]
    pub(super) fn inverse(&self) -> Matrix6<f64> {
        // Columns of L⁻¹, below the ones of its diagonal.
        let mut m = [[0.0; 6]; 6];
        for j in 0..6 {
            m[j][j] = 1.0;
            for i in j + 1..6 {
                let mut value = 0.0;
                for k in j..i {
                    value -= self.l[i][k] * m[k][j];
                }
                m[i][j] = value;
            }
        }
        let mut inverse = Matrix6::zeros();
        for a in 0..6 {
            for b in a..6 {
                let mut value = 0.0;
                for k in b..6 {
                    value += m[k][a] * self.inverse_d[k] * m[k][b];
                }
                inverse[(a, b)] = value;
                inverse[(b, a)] = value;
            }
        }
        inverse
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix6, Vector6};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Relative; condition numbers of a few thousand.
    const ROUNDING: f64 = 1e-10;

    #[test]
    fn inverse_and_whitened_vectors_agree_with_a_library() {
        let mut random = ChaCha8Rng::seed_from_u64(6);
        for _ in 0..1000 {
            let half = Matrix6::from_fn(|_, _| random.random_range(-1.0..1.0_f64));
            let a = half * half.transpose() + Matrix6::identity() * 0.01;
            let b = Vector6::from_fn(|_, _| random.random_range(-1.0..1.0));
            let factor = Factor::new(&rows(&a)).expect("positive definite");
            let expected = a.cholesky().expect("positive definite");
            let squared = Vector6::from(factor.whiten(&b.into())).norm_squared();
            assert!((squared - b.dot(&expected.solve(&b))).abs() < ROUNDING * squared);
            let inverse = expected.inverse();
            assert!((factor.inverse() - inverse).norm() < ROUNDING * inverse.norm());
            assert_eq!(factor.inverse(), factor.inverse().transpose());
            let explained = half.transpose() * inverse * half;
            assert!((factor.explained(&half) - explained).norm() < ROUNDING * explained.norm());
        }
    }

    #[test]
    fn singular_indefinite_and_meaningless_matrices_have_no_factor() {
        let mut a = rows(&Matrix6::identity());
        a[5] = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
        assert!(Factor::new(&a).is_none(), "two equal rows");
        assert!(Factor::new(&rows(&-Matrix6::identity())).is_none());
        assert!(Factor::new(&rows(&Matrix6::from_element(f64::NAN))).is_none());
        assert!(Factor::new(&[[0.0; 6]; 6]).is_none());
    }
}
