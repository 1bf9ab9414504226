//! Arithmetic on four numbers at once; plain loops of fixed length, which compilers turn into vectors.

use super::points::{LANES, Lane};

/// Returns `f` of each pair.
#[inline(always)]
fn zip(a: Lane, b: Lane, f: impl Fn(f64, f64) -> f64) -> Lane {
    let mut out = [0.0; LANES];
    for i in 0..LANES {
        out[i] = f(a[i], b[i]);
    }
    out
}

#[inline(always)]
pub(crate) fn add(a: Lane, b: Lane) -> Lane {
    zip(a, b, |a, b| a + b)
}

#[inline(always)]
pub(crate) fn sub(a: Lane, b: Lane) -> Lane {
    zip(a, b, |a, b| a - b)
}

#[inline(always)]
pub(crate) fn mul(a: Lane, b: Lane) -> Lane {
    zip(a, b, |a, b| a * b)
}

#[inline(always)]
pub(crate) fn div(a: Lane, b: Lane) -> Lane {
    zip(a, b, |a, b| a / b)
}

#[inline(always)]
pub(crate) fn splat(value: f64) -> Lane {
    [value; LANES]
}

/// Adds `a b` to a sum.
#[inline(always)]
pub(crate) fn accumulate(sum: &mut Lane, a: Lane, b: Lane) {
    for i in 0..LANES {
        sum[i] += a[i] * b[i];
    }
}

/// Returns the sum over the four.
#[inline(always)]
pub(crate) fn total(a: Lane) -> f64 {
    (a[0] + a[1]) + (a[2] + a[3])
}
