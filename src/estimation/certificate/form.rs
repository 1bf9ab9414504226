//! The excess cost of another attitude, as a polynomial in the rotation to it, and the depth there.

use nalgebra::Matrix3;

use super::dense::Square;

/// Number of products of two components of a quaternion `(q₀, q₁, q₂, q₃)`, without `q₀²`:
/// `q₀q₁, q₀q₂, q₀q₃, q₁², q₂², q₃², q₂q₃, q₁q₃, q₁q₂`.
pub(super) const PRODUCTS: usize = 9;
/// A symmetric matrix `X` of the polynomial `zᵀ X z`, `z` the products above.
pub(super) type Gram = Square<PRODUCTS>;

/// The products `qᵢ qⱼ` of the vector part: `i − 1`, `j − 1`, and their index in `z`.
pub(super) const OF_VECTOR: [(usize, usize, usize); 6] = [
    (0, 0, 3),
    (1, 1, 4),
    (2, 2, 5),
    (1, 2, 6),
    (0, 2, 7),
    (0, 1, 8),
];

/// Upper bound of the rounding error of a number, as a share of the sum of the magnitudes that it was computed from: 90
/// roundings of 1.1e-16 in the worst direction. No entry of a matrix here is the result of more than 45 in sequence, and
/// the factorisation of nine rows adds 20.
pub(super) const ROUNDING: f64 = 1e-14;

/// `E(R̂ R(q)) − E(R̂) |q|⁴` and the depth of the markers' mean, about a rotation `R̂`, `R(q)` the matrix of a
/// quaternion of any length.
pub(super) struct Form {
    /// The first, except for terms that [`Form::rest`] bounds.
    pub(super) excess: Gram,
    /// The depth is `depth (q₀² + wᵀ z)`, m.
    pub(super) depth: f64,
    /// `w`.
    pub(super) depth_shares: [f64; PRODUCTS],
    /// Upper bound of the terms that [`Form::excess`] omits, for `|q| = 1`: `q₀³ qᵢ`, zero at a minimum, and rounding.
    pub(super) rest: f64,
    /// Sum of the magnitudes of all that `excess` was computed from.
    pub(super) magnitude: f64,
}

impl Form {
    /// Returns the form of a cost `vec(R)ᵀ Ω vec(R)` and a depth `tᵀ vec(R)`.
    ///
    /// # Inputs
    /// * `omega`, `t`: in the order of the columns of `R`.
    #[inline(always)]
    pub(super) fn new(omega: &Square<9>, t: &[f64; 9], rotation: &Matrix3<f64>) -> Self {
        let omega = turned(omega, rotation);
        let mut half = [[0.0; 9]; 10];
        for i in 0..9 {
            let column = in_products(&omega[i]);
            for j in 0..10 {
                half[j][i] = column[j];
            }
        }
        let mut full = half.map(|row| in_products(&row));
        let least = full[0][0];
        // |q|⁴ is the square of the sum of four of the products.
        for i in [0, 4, 5, 6] {
            for j in [0, 4, 5, 6] {
                full[i][j] -= least;
            }
        }
        let mut excess = [[0.0; PRODUCTS]; PRODUCTS];
        for i in 0..PRODUCTS {
            for j in 0..PRODUCTS {
                excess[i][j] = full[i + 1][j + 1];
            }
        }
        // q₀² · qᵢqⱼ is q₀qᵢ · q₀qⱼ.
        for (i, j, place) in OF_VECTOR {
            let entry = full[0][place + 1];
            if i == j {
                excess[i][i] += 2.0 * entry;
            } else {
                excess[i][j] += entry;
                excess[j][i] += entry;
            }
        }
        let sum = |rows: &[[f64; 9]; 9]| rows.iter().flatten().map(|entry| entry.abs()).sum();
        let (of_omega, of_excess): (f64, f64) = (sum(&omega), sum(&excess));
        // An entry of `full` contains an entry of Ω at most 4² times.
        let magnitude = 16.0 * of_omega + of_excess;
        let slope = full[0][1].abs() + full[0][2].abs() + full[0][3].abs();
        // The row of q₀² uses a third of the entries, each with a weight of at most 2.
        let rest = 2.0 * (slope + ROUNDING * of_omega);

        let depths = in_products(&turned_vector(t, rotation));
        let mut depth_shares = [0.0; PRODUCTS];
        for i in 0..PRODUCTS {
            depth_shares[i] = depths[i + 1] / depths[0];
        }
        Self {
            excess,
            depth: depths[0],
            depth_shares,
            rest,
            magnitude,
        }
    }
}

/// Returns the coefficients of `xᵀ vec(R(q))` at `q₀²` and the other products.
#[inline(always)]
fn in_products(x: &[f64; 9]) -> [f64; 10] {
    [
        x[0] + x[4] + x[8],
        2.0 * (x[5] - x[7]),
        2.0 * (x[6] - x[2]),
        2.0 * (x[1] - x[3]),
        x[0] - x[4] - x[8],
        x[4] - x[0] - x[8],
        x[8] - x[0] - x[4],
        2.0 * (x[5] + x[7]),
        2.0 * (x[2] + x[6]),
        2.0 * (x[1] + x[3]),
    ]
}

/// Returns `(I ⊗ R)ᵀ Ω (I ⊗ R)`.
#[inline(always)]
fn turned(omega: &Square<9>, rotation: &Matrix3<f64>) -> Square<9> {
    let half = omega.map(|row| turned_vector(&row, rotation));
    let mut turned = [[0.0; 9]; 9];
    for block in 0..3 {
        for k in 0..3 {
            for l in 0..3 {
                let factor = rotation[(l, k)];
                for j in 0..9 {
                    turned[3 * block + k][j] += factor * half[3 * block + l][j];
                }
            }
        }
    }
    turned
}

/// Returns `(I ⊗ R)ᵀ x`.
#[inline(always)]
fn turned_vector(x: &[f64; 9], rotation: &Matrix3<f64>) -> [f64; 9] {
    let mut turned = [0.0; 9];
    for block in 0..3 {
        for k in 0..3 {
            for l in 0..3 {
                turned[3 * block + k] += rotation[(l, k)] * x[3 * block + l];
            }
        }
    }
    turned
}
