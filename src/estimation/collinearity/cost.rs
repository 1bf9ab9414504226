//! The quadratic form, its derivatives, and the optimal position for a rotation.

use nalgebra::{Matrix3, Rotation3, Vector3};

use super::ENTRY;
use super::moments::CollinearityMoments;
use crate::estimation::lanes::columns::{Columns, Splats};
use crate::estimation::lanes::four::{Arithmetic, Four, LANES, Lane, Number};
use crate::estimation::lanes::symmetric3::inverse;

/// The collinearity error as a function of the rotation alone.
#[derive(Debug, Clone)]
#[repr(align(32))]
pub(crate) struct CollinearityCost {
    /// Columns of `Ω`, which is symmetric.
    omega: [[Lane; 3]; 9],
    /// Columns of `T`, from the rotation to the markers' mean in the camera.
    centre_from_rotation: [Lane; 9],
}

impl CollinearityCost {
    /// An empty cost, to be filled in place.
    pub(crate) const EMPTY: Self = Self {
        omega: [[[0.0; LANES]; 3]; 9],
        centre_from_rotation: [[0.0; LANES]; 9],
    };

    /// Sets this to the cost of some points; `None` if their rays do not determine a position (because they all
    /// coincide).
    #[inline(always)]
    pub(crate) fn fill<A: Arithmetic>(
        &mut self,
        arithmetic: A,
        moments: &CollinearityMoments,
    ) -> Option<()> {
        let load = |lane| Four::new(arithmetic, lane);
        let splat = |value| Four::splat(arithmetic, value);
        let [w1, w2, w3] = moments.columns[0];
        let w = inverse(&[w1[0], w1[1], w1[2], w2[1], w2[2], w3[2]])?;
        let w_inverse = [
            load([w[0], w[1], w[2], 0.0]),
            load([w[1], w[3], w[4], 0.0]),
            load([w[2], w[4], w[5], 0.0]),
        ];
        let zero = splat(0.0);
        let mut check = zero;
        // Column (b, c) of ΣWA and of Ω belongs to column b, entry c, of the rotation.
        for b in 0..3 {
            for c in 0..3 {
                let wa = moments.columns[1 + b][c];
                let t = zero
                    .minus(w_inverse[0], splat(wa[0]))
                    .minus(w_inverse[1], splat(wa[1]))
                    .minus(w_inverse[2], splat(wa[2]))
                    .lane();
                self.centre_from_rotation[3 * b + c] = t;
                // Ω = Σ AᵀWA − (ΣWA)ᵀ (ΣW)⁻¹ (ΣWA).
                for a in 0..3 {
                    let column = load(moments.columns[4 + ENTRY[a][b]][c])
                        .plus(load(moments.columns[1 + a][0]), splat(t[0]))
                        .plus(load(moments.columns[1 + a][1]), splat(t[1]))
                        .plus(load(moments.columns[1 + a][2]), splat(t[2]));
                    self.omega[3 * b + c][a] = column.lane();
                    check = check + column;
                }
            }
        }
        check.total().is_finite().then_some(())
    }

    /// Returns `mat(Ω vec(R))`, half the gradient of the cost over the nine entries of `R`.
    #[inline(always)]
    pub(crate) fn half_gradient<A: Arithmetic>(
        &self,
        arithmetic: A,
        rotation: &Splats<A>,
    ) -> Columns<A> {
        let mut y = [Four::splat(arithmetic, 0.0); 3];
        for a in 0..3 {
            // Three separate sums, so that additions need not wait for each other.
            let mut of_columns = y;
            for b in 0..3 {
                of_columns[b] = self.times_column(b, a, &rotation[b]);
            }
            y[a] = of_columns[0] + of_columns[1] + of_columns[2];
        }
        Columns(y)
    }

    /// Returns part `a` of the product of `Ω` with a vector that is zero outside column `b`.
    #[inline(always)]
    fn times_column<A: Arithmetic>(&self, b: usize, a: usize, column: &[Four<A>; 3]) -> Four<A> {
        let [x, y, z] = *column;
        (x.another(self.omega[3 * b][a]) * x)
            .plus(x.another(self.omega[3 * b + 1][a]), y)
            .plus(x.another(self.omega[3 * b + 2][a]), z)
    }

    /// Returns `E(R) = rᵀ Ω r`.
    #[inline(always)]
    pub(crate) fn value<A: Arithmetic>(&self, arithmetic: A, rotation: &Rotation3<f64>) -> f64 {
        let r = Columns::new(arithmetic, rotation.matrix());
        r.dot(self.half_gradient(arithmetic, &r.splats(arithmetic)))
    }

    /// Returns `Jᵀ Ω J` for the three turns `R [e_k]×`, `J` their columns as vectors.
    ///
    /// Rotation `k` has two non-zero columns: with `(i, j, k)` in cyclic order, column `i` is `r_j` and column `j` is
    /// `−r_i`.
    #[inline(always)]
    pub(crate) fn curvature<A: Arithmetic>(
        &self,
        arithmetic: A,
        rotation: Columns<A>,
        splats: &Splats<A>,
    ) -> Matrix3<f64> {
        let r = rotation.0;
        // Ω J of each turn.
        let mut omega_j = [[Four::splat(arithmetic, 0.0); 3]; 3];
        for k in 0..3 {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            for a in 0..3 {
                omega_j[k][a] =
                    self.times_column(i, a, &splats[j]) - self.times_column(j, a, &splats[i]);
            }
        }
        let m11 = turn_times(&r, 0, &omega_j[0]);
        let m21 = turn_times(&r, 1, &omega_j[0]);
        let m31 = turn_times(&r, 2, &omega_j[0]);
        let m22 = turn_times(&r, 1, &omega_j[1]);
        let m32 = turn_times(&r, 2, &omega_j[1]);
        let m33 = turn_times(&r, 2, &omega_j[2]);
        let [m11, m21, m31, m22] = Four::totals([m11, m21, m31, m22]).lane();
        let [m32, m33, ..] = Four::totals([m32, m33, m33, m33]).lane();
        Matrix3::new(m11, m21, m31, m21, m22, m32, m31, m32, m33)
    }

    /// Returns the position of the markers' mean in the camera frame for a given rotation, m.
    ///
    /// # Source
    /// Ding, Wei, Wang 2011, Eq. (13), for centred points.
    #[inline(always)]
    pub(crate) fn centre_in_camera(&self, rotation: &Rotation3<f64>) -> Vector3<f64> {
        let mut centre = [0.0; LANES];
        for (column, r) in self.centre_from_rotation.iter().zip(rotation.matrix()) {
            for k in 0..LANES {
                centre[k] += column[k] * r;
            }
        }
        Vector3::new(centre[0], centre[1], centre[2])
    }

    /// Returns the columns of `Ω`.
    #[inline(always)]
    pub(crate) fn omega(&self) -> [[f64; 9]; 9] {
        self.omega
            .map(|[a, b, c]| [a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2]])
    }

    /// Returns what the depth of the markers' mean is in the nine entries of a rotation, m.
    #[inline(always)]
    pub(crate) fn depth_from_rotation(&self) -> [f64; 9] {
        self.centre_from_rotation.map(|column| column[2])
    }

    /// Returns the form's coefficients, in the order of [`products`].
    pub(crate) fn coefficients(&self) -> [f64; PRODUCTS] {
        let mut coefficients = [0.0; PRODUCTS];
        let mut place = 0;
        for j in 0..9 {
            for i in 0..=j {
                // Ω is symmetric, so off-diagonal entries count twice.
                let count = if i == j { 1.0 } else { 2.0 };
                coefficients[place] = count * self.omega[j][i / 3][i % 3];
                place += 1;
            }
        }
        coefficients
    }

    /// Returns the depths of the markers' mean for four rotations, their entries side by side.
    #[inline(always)]
    pub(crate) fn depths<A: Arithmetic>(&self, arithmetic: A, entries: &[Lane; 9]) -> Lane {
        let mut depth = Four::splat(arithmetic, 0.0);
        for (column, entry) in self.centre_from_rotation.iter().zip(entries) {
            depth = depth.plus(
                Four::splat(arithmetic, column[2]),
                Four::new(arithmetic, *entry),
            );
        }
        depth.lane()
    }
}

/// Number of products of two of nine entries.
pub(crate) const PRODUCTS: usize = 45;

/// Returns the products of all pairs of entries of a rotation, to evaluate the form at rotations that are known in
/// advance.
pub(crate) fn products(rotation: &Rotation3<f64>) -> [f64; PRODUCTS] {
    let r = rotation.matrix();
    let mut products = [0.0; PRODUCTS];
    let pairs = (0..9).flat_map(|j| (0..=j).map(move |i| (i, j)));
    for (product, (i, j)) in products.iter_mut().zip(pairs) {
        *product = r[i] * r[j];
    }
    products
}

/// Returns the sums of coefficients times values, for four vectors of values at once.
#[inline(always)]
pub(crate) fn combined<A: Arithmetic>(
    arithmetic: A,
    coefficients: &[f64; PRODUCTS],
    four: &[Lane; PRODUCTS],
) -> Lane {
    // Five sums in turn, so that additions need not wait for each other.
    let mut sums = [Four::splat(arithmetic, 0.0); 5];
    for (coefficients, products) in coefficients.chunks_exact(5).zip(four.chunks_exact(5)) {
        for k in 0..5 {
            let product = Four::new(arithmetic, products[k]);
            sums[k] = sums[k].plus(Four::splat(arithmetic, coefficients[k]), product);
        }
    }
    (sums[0] + sums[1] + (sums[2] + sums[3]) + sums[4]).lane()
}

/// Returns the product of rotation `k`'s columns with a vector, as four summands that the caller adds.
#[inline(always)]
fn turn_times<A: Arithmetic>(rotation: &[Four<A>; 3], k: usize, v: &[Four<A>; 3]) -> Four<A> {
    let (i, j) = ((k + 1) % 3, (k + 2) % 3);
    (rotation[j] * v[i]).minus(rotation[i], v[j])
}
