//! Sums over points that couple modes to the pose and to each other, and the elimination of the modes.
//!
//! With `W` the inverse covariance of the noise of single points, `H` the modes and `J` the derivative by the pose, the
//! amplitudes have the normal equations `A = 1 + HᵀWH`, with the coupling `C = JᵀWH` to the pose. Then
//! `JᵀΣ⁻¹J = JᵀWJ − C A⁻¹ Cᵀ`, and likewise for gradient and chi-squared (Woodbury's identity).

use crate::estimation::lanes::four::{Arithmetic, Four, Number, totals};
use crate::estimation::lanes::information::{Information, Vector};
use crate::estimation::residuals::Slope;

/// Sums for at most `K` modes.
#[derive(Clone, Copy)]
pub(super) struct Gram<N, const K: usize> {
    /// `JᵀWH`, a row for each mode: rotation before position.
    cross: [[N; 6]; K],
    /// `HᵀWH`, the lower triangle.
    modes: [[N; K]; K],
    /// `HᵀWr`.
    residual: [N; K],
}

impl<N: Number, const K: usize> Gram<N, K> {
    #[inline(always)]
    pub(super) fn new(zero: N) -> Self {
        Self {
            cross: [[zero; 6]; K],
            modes: [[zero; K]; K],
            residual: [zero; K],
        }
    }

    /// Adds the coupling of a mode with the pose: `a` the arm, `s = Dᵀ W h`.
    #[inline(always)]
    pub(super) fn add_cross(&mut self, mode: usize, [a1, a2, a3]: [N; 3], s: [N; 3]) {
        let row = &mut self.cross[mode];
        row[0] = row[0].plus(a2, s[2]).minus(a3, s[1]);
        row[1] = row[1].plus(a3, s[0]).minus(a1, s[2]);
        row[2] = row[2].plus(a1, s[1]).minus(a2, s[0]);
        for i in 0..3 {
            row[3 + i] = row[3 + i] + s[i];
        }
    }

    /// Adds the product of two modes; the second index is not greater than the first.
    #[inline(always)]
    pub(super) fn add_pair(&mut self, mode: usize, other: usize, q: [N; 2], h: [N; 2]) {
        let sum = &mut self.modes[mode][other];
        *sum = sum.plus(q[0], h[0]).plus(q[1], h[1]);
    }
}

impl<A: Arithmetic, const K: usize> Gram<Four<A>, K> {
    #[inline(always)]
    pub(super) fn total(&self, modes: usize) -> Gram<f64, K> {
        let mut total = Gram::new(0.0);
        for mode in 0..modes {
            total.cross[mode] = totals(&self.cross[mode]);
            for other in 0..=mode {
                total.modes[mode][other] = self.modes[mode][other].total();
            }
        }
        total
    }
}

/// `A = L Lᵀ` and `Y = L⁻¹ Cᵀ`, with which the modes are eliminated.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Elimination<const K: usize> {
    modes: usize,
    /// The lower triangle of `L`, its diagonal inverted.
    lower: [[f64; K]; K],
    cross: [[f64; 6]; K],
}

impl<const K: usize> Elimination<K> {
    /// Returns the elimination; `None` if the sums are not finite.
    #[inline(always)]
    pub(super) fn new(gram: &Gram<f64, K>, modes: usize) -> Option<Self> {
        let mut lower = [[0.0; K]; K];
        let mut cross = [[0.0; 6]; K];
        for i in 0..modes {
            for j in 0..i {
                let mut sum = gram.modes[i][j];
                for k in 0..j {
                    sum -= lower[i][k] * lower[j][k];
                }
                lower[i][j] = sum * lower[j][j];
            }
            let mut square = 1.0 + gram.modes[i][i];
            let mut row = gram.cross[i];
            for k in 0..i {
                square -= lower[i][k] * lower[i][k];
                for column in 0..6 {
                    row[column] -= lower[i][k] * cross[k][column];
                }
            }
            if !(square > 0.0 && square.is_finite()) {
                return None;
            }
            let inverse = 1.0 / square.sqrt();
            lower[i][i] = inverse;
            cross[i] = row.map(|value| value * inverse);
        }
        Some(Self {
            modes,
            lower,
            cross,
        })
    }

    /// Subtracts from the information what the modes explain.
    #[inline(always)]
    pub(super) fn reduce(&self, information: &mut Information) {
        for [a, b, c, d, e, f] in &self.cross[..self.modes] {
            let turn = [a * a, a * b, a * c, b * b, b * c, c * c];
            let position = [d * d, d * e, d * f, e * e, e * f, f * f];
            for entry in 0..6 {
                information.turn[entry] -= turn[entry];
                information.position[entry] -= position[entry];
            }
            for (row, by) in [a, b, c].into_iter().enumerate() {
                for (column, other) in [d, e, f].into_iter().enumerate() {
                    information.mixed[row][column] -= by * other;
                }
            }
        }
    }

    /// Subtracts from gradient and chi-squared what the modes explain; `residual` is `HᵀWr`.
    #[inline(always)]
    pub(super) fn reduce_slope(&self, residual: &[f64; K], slope: &mut Slope) {
        let whitened = self.forward(residual);
        for mode in 0..self.modes {
            let value = whitened[mode];
            slope.chi_squared -= value * value;
            let gradient: &mut Vector = &mut slope.gradient;
            for entry in 0..6 {
                gradient[entry] -= self.cross[mode][entry] * value;
            }
        }
        slope.chi_squared = slope.chi_squared.max(0.0);
    }

    /// Returns `L⁻¹ b`.
    #[inline(always)]
    fn forward(&self, b: &[f64; K]) -> [f64; K] {
        let mut solution = *b;
        for i in 0..self.modes {
            for k in 0..i {
                solution[i] -= self.lower[i][k] * solution[k];
            }
            solution[i] *= self.lower[i][i];
        }
        solution
    }
}

impl<N, const K: usize> Gram<N, K> {
    #[inline(always)]
    pub(super) fn residual_mut(&mut self) -> &mut [N; K] {
        &mut self.residual
    }
}
