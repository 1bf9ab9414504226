//! Products of 6×6 matrices, in loops that the compiler unrolls: nalgebra's own are calls of a general product.

use nalgebra::{ArrayStorage, Matrix3, Matrix6, Vector6};

/// Returns `a b`.
#[inline(always)]
pub(super) fn times(a: &Matrix6<f64>, b: &Matrix6<f64>) -> Matrix6<f64> {
    let (a, b) = (&a.data.0, &b.data.0);
    // A column stays in registers while it is summed.
    let column = |b: &[f64; 6]| {
        let mut sum = [0.0; 6];
        for k in 0..6 {
            for row in 0..6 {
                sum[row] += a[k][row] * b[k];
            }
        }
        sum
    };
    Matrix6::from_data(ArrayStorage([
        column(&b[0]),
        column(&b[1]),
        column(&b[2]),
        column(&b[3]),
        column(&b[4]),
        column(&b[5]),
    ]))
}

/// Returns `m v`.
#[inline(always)]
pub(super) fn times_vector(m: &Matrix6<f64>, v: &Vector6<f64>) -> Vector6<f64> {
    let mut sum = [0.0; 6];
    for (column, v) in m.data.0.iter().zip(v.iter()) {
        for row in 0..6 {
            sum[row] += column[row] * v;
        }
    }
    sum.into()
}

/// Returns `(m + mᵀ) / 2`.
#[inline(always)]
pub(super) fn symmetric(m: &Matrix6<f64>) -> Matrix6<f64> {
    (m + m.transpose()) * 0.5
}

/// Returns `diag(1, r) m`: only attitudes are rotated.
#[inline(always)]
pub(super) fn turn_rows(mut m: Matrix6<f64>, r: &Matrix3<f64>) -> Matrix6<f64> {
    let r = &r.data.0;
    for column in &mut m.data.0 {
        let [_, _, _, x, y, z] = *column;
        for row in 0..3 {
            column[3 + row] = r[0][row] * x + r[1][row] * y + r[2][row] * z;
        }
    }
    m
}

/// Returns `m diag(1, r)ᵀ`.
#[inline(always)]
pub(super) fn turn_columns(mut m: Matrix6<f64>, r: &Matrix3<f64>) -> Matrix6<f64> {
    let r = &r.data.0;
    let [_, _, _, x, y, z] = m.data.0;
    for column in 0..3 {
        for row in 0..6 {
            m.data.0[3 + column][row] =
                r[0][column] * x[row] + r[1][column] * y[row] + r[2][column] * z[row];
        }
    }
    m
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Of sums of six products of numbers up to one.
    const ROUNDING: f64 = 1e-14;

    #[test]
    fn products_are_those_of_a_library() {
        let mut random = ChaCha8Rng::seed_from_u64(66);
        for _ in 0..100 {
            let mut any = || Matrix6::from_fn(|_, _| random.random_range(-1.0..1.0_f64));
            let (a, b) = (any(), any());
            let r: Matrix3<f64> = any().fixed_view::<3, 3>(0, 0).into_owned();
            let v: Vector6<f64> = any().column(0).into_owned();
            let mut turn = Matrix6::identity();
            turn.fixed_view_mut::<3, 3>(3, 3).copy_from(&r);
            assert!((times(&a, &b) - a * b).amax() < ROUNDING);
            assert!((times_vector(&a, &v) - a * v).amax() < ROUNDING);
            assert!((turn_rows(a, &r) - turn * a).amax() < ROUNDING);
            assert!((turn_columns(a, &r) - a * turn.transpose()).amax() < ROUNDING);
        }
    }
}
