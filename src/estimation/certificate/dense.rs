//! Symmetric matrices of a few rows: factored, inverted, solved, always into a place of the same size.

/// Rows of a matrix; of a symmetric one both triangles are filled.
pub(super) type Square<const N: usize> = [[f64; N]; N];

/// A lower triangle `L` with `A = L Lᵀ`.
#[derive(Clone, Copy)]
pub(super) struct Cholesky<const N: usize> {
    lower: Square<N>,
    /// One over each number of the diagonal.
    shares: [f64; N],
}

impl<const N: usize> Cholesky<N> {
    /// Returns the factor of a matrix; `None` unless it is positive definite. What is not a number is not.
    #[inline(always)]
    pub(super) fn new(a: &Square<N>) -> Option<Self> {
        let mut lower = [[0.0; N]; N];
        let mut shares = [0.0; N];
        // Column by column of what is left, so that neighbours in memory are computed side by side: row j of
        // `upper` is column j of the factor.
        let mut left = *a;
        for j in 0..N {
            let pivot = left[j][j];
            if !(pivot > 0.0 && pivot.is_finite()) {
                return None;
            }
            let root = pivot.sqrt();
            let share = 1.0 / root;
            shares[j] = share;
            let row = left[j].map(|entry| entry * share);
            for i in j + 1..N {
                let factor = row[i];
                for k in 0..N {
                    left[i][k] -= factor * row[k];
                }
            }
            for i in j..N {
                lower[i][j] = row[i];
            }
        }
        Some(Self { lower, shares })
    }

    /// Returns `A⁻¹`.
    #[inline(always)]
    pub(super) fn inverse(&self) -> Square<N> {
        // Rows of L⁻¹.
        let mut inverse_lower = [[0.0; N]; N];
        for i in 0..N {
            let mut row = [0.0; N];
            row[i] = 1.0;
            for k in 0..i {
                let factor = self.lower[i][k];
                for j in 0..N {
                    row[j] -= factor * inverse_lower[k][j];
                }
            }
            inverse_lower[i] = row.map(|entry| entry * self.shares[i]);
        }
        let mut inverse = [[0.0; N]; N];
        for row in &inverse_lower {
            for i in 0..N {
                let factor = row[i];
                for j in 0..N {
                    inverse[i][j] += factor * row[j];
                }
            }
        }
        inverse
    }

    /// Returns `A⁻¹ b`.
    #[inline(always)]
    pub(super) fn solve(&self, b: &[f64; N]) -> [f64; N] {
        let mut x = *b;
        for i in 0..N {
            let mut sum = x[i];
            for k in 0..i {
                sum -= self.lower[i][k] * x[k];
            }
            x[i] = sum * self.shares[i];
        }
        for i in (0..N).rev() {
            x[i] *= self.shares[i];
            let known = x[i];
            for k in 0..i {
                x[k] -= self.lower[i][k] * known;
            }
        }
        x
    }
}

/// Returns whether a matrix is positive definite.
#[inline(always)]
pub(super) fn is_positive<const N: usize>(a: &Square<N>) -> bool {
    Cholesky::new(a).is_some()
}

/// Returns `A B`.
#[inline(always)]
pub(super) fn product<const N: usize>(a: &Square<N>, b: &Square<N>) -> Square<N> {
    let mut product = [[0.0; N]; N];
    for (row, of_a) in product.iter_mut().zip(a) {
        for (factor, of_b) in of_a.iter().zip(b) {
            for k in 0..N {
                row[k] += factor * of_b[k];
            }
        }
    }
    product
}

/// Returns `A v`.
#[inline(always)]
pub(super) fn times<const N: usize>(a: &Square<N>, v: &[f64; N]) -> [f64; N] {
    let mut sum = [0.0; N];
    for (row, factor) in a.iter().zip(v) {
        for k in 0..N {
            sum[k] += factor * row[k];
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::SMatrix;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Relative; condition numbers of a few thousand.
    const ROUNDING: f64 = 1e-9;

    fn square(m: &SMatrix<f64, 9, 9>) -> Square<9> {
        std::array::from_fn(|i| std::array::from_fn(|j| m[(i, j)]))
    }

    #[test]
    fn factors_inverses_and_solutions_agree_with_a_library() {
        let mut random = ChaCha8Rng::seed_from_u64(4);
        for _ in 0..200 {
            let half = SMatrix::<f64, 9, 9>::from_fn(|_, _| random.random_range(-1.0..1.0));
            let a = half * half.transpose() + SMatrix::identity() * 0.01;
            let expected = a.try_inverse().expect("positive definite");
            let factor = Cholesky::new(&square(&a)).expect("positive definite");
            let scale = expected.norm();
            let inverse = factor.inverse();
            let b: [f64; 9] = std::array::from_fn(|i| (i as f64).sin());
            let x = factor.solve(&b);
            let back = times(&square(&a), &x);
            let identity = product(&square(&a), &inverse);
            for i in 0..9 {
                assert!((back[i] - b[i]).abs() < ROUNDING * scale);
                for j in 0..9 {
                    assert!((inverse[i][j] - expected[(i, j)]).abs() < ROUNDING * scale);
                    let one = if i == j { 1.0 } else { 0.0 };
                    assert!((identity[i][j] - one).abs() < ROUNDING * scale);
                }
            }
        }
    }

    #[test]
    fn what_is_not_positive_definite_has_no_factor() {
        let diagonal = |entry: f64| {
            let mut m = [[0.0; 3]; 3];
            (m[0][0], m[1][1], m[2][2]) = (1.0, entry, 1.0);
            m
        };
        assert!(is_positive(&diagonal(1e-300)));
        for entry in [0.0, -1e-300, -1.0, f64::NAN, f64::INFINITY] {
            assert!(!is_positive(&diagonal(entry)), "{entry}");
        }
    }
}
