//! A 3×3 matrix in registers, for the descent on rotations.

use nalgebra::Matrix3;

use super::four::{Arithmetic, Four, Number};

/// One column per register, with its fourth number zero.
#[derive(Clone, Copy)]
pub(crate) struct Columns<A: Arithmetic>(pub(crate) [Four<A>; 3]);

/// Each entry of a 3×3 matrix repeated four times, column by column.
pub(crate) type Splats<A> = [[Four<A>; 3]; 3];

impl<A: Arithmetic> Columns<A> {
    #[inline(always)]
    pub(crate) fn new(arithmetic: A, m: &Matrix3<f64>) -> Self {
        Self([
            Four::new(arithmetic, [m.m11, m.m21, m.m31, 0.0]),
            Four::new(arithmetic, [m.m12, m.m22, m.m32, 0.0]),
            Four::new(arithmetic, [m.m13, m.m23, m.m33, 0.0]),
        ])
    }

    #[inline(always)]
    pub(crate) fn matrix(self) -> Matrix3<f64> {
        let [a, b, c] = [self.0[0].lane(), self.0[1].lane(), self.0[2].lane()];
        Matrix3::new(a[0], b[0], c[0], a[1], b[1], c[1], a[2], b[2], c[2])
    }

    /// Returns the product with a matrix on the right.
    #[inline(always)]
    pub(crate) fn times(self, arithmetic: A, right: &Matrix3<f64>) -> Self {
        let [a, b, c] = self.0;
        let mut product = self;
        for k in 0..3 {
            let [x, y, z] = [right[(0, k)], right[(1, k)], right[(2, k)]];
            product.0[k] = (a * Four::splat(arithmetic, x))
                .plus(b, Four::splat(arithmetic, y))
                .plus(c, Four::splat(arithmetic, z));
        }
        product
    }

    /// Returns `selfᵀ other`.
    #[inline(always)]
    pub(crate) fn transpose_times(self, other: Self) -> Matrix3<f64> {
        let ([a, b, c], [x, y, z]) = (self.0, other.0);
        let first = Four::totals([a * x, a * y, a * z, a]).lane();
        let second = Four::totals([b * x, b * y, b * z, b]).lane();
        let third = Four::totals([c * x, c * y, c * z, c]).lane();
        Matrix3::new(
            first[0], first[1], first[2], //
            second[0], second[1], second[2], //
            third[0], third[1], third[2],
        )
    }

    /// Returns the sum of products of all entries.
    #[inline(always)]
    pub(crate) fn dot(self, other: Self) -> f64 {
        let ([a, b, c], [x, y, z]) = (self.0, other.0);
        (a * x).plus(b, y).plus(c, z).total()
    }

    /// Returns each entry repeated four times.
    #[inline(always)]
    pub(crate) fn splats(self, arithmetic: A) -> Splats<A> {
        let mut splats = [self.0; 3];
        for column in 0..3 {
            let entries = self.0[column].lane();
            for row in 0..3 {
                splats[column][row] = Four::splat(arithmetic, entries[row]);
            }
        }
        splats
    }
}
