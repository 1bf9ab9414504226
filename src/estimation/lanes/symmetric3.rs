//! Symmetric 3×3 matrices in closed form: one division per inverse, and entries that do not depend on each other.

/// A symmetric 3×3 matrix by its upper triangle: 11, 12, 13, 22, 23, 33.
pub(crate) type Symmetric3<T = f64> = [T; 6];

/// Returns `A⁻¹`; `None` unless the matrix is positive definite and its determinant is at least this share of the
/// product of `scale`, the diagonal before any subtraction.
#[inline(always)]
pub(crate) fn positive_inverse(
    a: &Symmetric3,
    scale: [f64; 3],
    least_share: f64,
) -> Option<Symmetric3> {
    let [a11, _, _, a22, _, _] = *a;
    let cofactors = cofactors(a);
    let determinant = determinant(a, &cofactors);
    // The leading minors. A comparison with NaN is false.
    let is_definite = a11 > 0.0
        && a22 > 0.0
        && cofactors[5] > 0.0
        && determinant > least_share * scale[0] * scale[1] * scale[2];
    let share = 1.0 / determinant;
    (is_definite && determinant.is_finite() && share.is_finite())
        .then(|| cofactors.map(|cofactor| cofactor * share))
}

/// Returns `A⁻¹`; `None` for a singular matrix.
#[inline(always)]
pub(crate) fn inverse(a: &Symmetric3) -> Option<Symmetric3> {
    let cofactors = cofactors(a);
    let determinant = determinant(a, &cofactors);
    let share = 1.0 / determinant;
    (determinant != 0.0).then(|| cofactors.map(|cofactor| cofactor * share))
}

/// Returns `A v`.
#[inline(always)]
pub(crate) fn times(a: &Symmetric3, v: [f64; 3]) -> [f64; 3] {
    let [a11, a12, a13, a22, a23, a33] = *a;
    [
        a11 * v[0] + a12 * v[1] + a13 * v[2],
        a12 * v[0] + a22 * v[1] + a23 * v[2],
        a13 * v[0] + a23 * v[1] + a33 * v[2],
    ]
}

#[inline(always)]
fn cofactors(a: &Symmetric3) -> Symmetric3 {
    let [a11, a12, a13, a22, a23, a33] = *a;
    [
        a22 * a33 - a23 * a23,
        a13 * a23 - a12 * a33,
        a12 * a23 - a13 * a22,
        a11 * a33 - a13 * a13,
        a12 * a13 - a11 * a23,
        a11 * a22 - a12 * a12,
    ]
}

#[inline(always)]
fn determinant(a: &Symmetric3, cofactors: &Symmetric3) -> f64 {
    a[0] * cofactors[0] + a[1] * cofactors[1] + a[2] * cofactors[2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Relative; condition numbers of a few thousand.
    const ROUNDING: f64 = 1e-9;

    fn upper(m: &Matrix3<f64>) -> Symmetric3 {
        [m.m11, m.m12, m.m13, m.m22, m.m23, m.m33]
    }

    #[test]
    fn inverses_agree_with_a_library() {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        for _ in 0..1000 {
            let half = Matrix3::from_fn(|_, _| random.random_range(-1.0..1.0_f64));
            let a = half * half.transpose() + Matrix3::identity() * 0.01;
            let expected = a.try_inverse().expect("positive definite");
            let b = [0.3, -0.2, 0.7];
            let scale = [a.m11, a.m22, a.m33];
            for found in [
                positive_inverse(&upper(&a), scale, 1e-13),
                inverse(&upper(&a)),
            ] {
                let found = found.expect("positive definite");
                for (found, expected) in found.iter().zip(upper(&expected)) {
                    assert!((found - expected).abs() < ROUNDING * expected.abs().max(1.0));
                }
                let x = times(&found, b);
                let back = times(&upper(&a), x);
                assert!(back.iter().zip(b).all(|(x, y)| (x - y).abs() < ROUNDING));
            }
        }
    }

    #[test]
    fn indefinite_nearly_singular_and_meaningless_matrices_have_no_positive_inverse() {
        let of = |diagonal: [f64; 3]| {
            let [a, b, c] = diagonal;
            positive_inverse(&[a, 0.0, 0.0, b, 0.0, c], [1.0; 3], 1e-13)
        };
        assert!(of([1.0, 1.0, 1.0]).is_some());
        assert!(of([1.0, 1.0, 1e-14]).is_none(), "nearly singular");
        assert!(of([1.0, -1.0, -1.0]).is_none(), "two negative eigenvalues");
        assert!(of([-1.0, -1.0, 1.0]).is_none(), "two negative eigenvalues");
        assert!(of([-1.0, 1.0, -1.0]).is_none(), "two negative eigenvalues");
        assert!(of([f64::NAN, 1.0, 1.0]).is_none());
        assert!(of([f64::INFINITY, 1.0, 1.0]).is_none());
        assert!(inverse(&[0.0; 6]).is_none());
    }
}
