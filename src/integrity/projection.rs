//! A linearised frame -> the projections that every hypothesis about faults needs.
//!
//! With whitened rows `J`, residuals `r` and modes `H` (all in sigmas), `Σ = 1 + H Hᵀ` and the prior's information `Π`:
//!
//! ```text
//! W = Σ⁻¹ = 1 − Vᵀ V,      V = L_A⁻¹ Hᵀ,         A = 1 + Hᵀ H = L_A L_Aᵀ
//! P = (Jᵀ W J + Π)⁻¹,      Jᵀ W J + Π = L L ᵀ
//! M = W − W J P Jᵀ W = 1 − Zᵀ Z,                 Z = [V; Y],  Y = L⁻¹ Jᵀ W
//! ```
//!
//! `M` takes an error of the pixels to the residuals of the fit; `aᵀ P Jᵀ W = (L⁻¹ a)ᵀ Y` takes it to the error of the
//! pose in the direction `a`.

use nalgebra::{Matrix6, Vector6};
use smallvec::SmallVec;

use crate::estimation::LinearFrame;

/// Rows kept without the heap.
const ROWS: usize = 32;
/// Numbers of a matrix kept without it: of twelve points.
pub(super) const MATRIX: usize = 24 * 24;
/// Of the variance that the curvature gives: below it, a covariance differs by the step that it was taken before.
pub(super) const WIDENED: f64 = 1.02;
/// The pose's own dimensions.
const POSE: usize = 6;

/// The projections of one frame.
#[derive(Debug)]
pub(super) struct Projection {
    /// Columns of `Z`, one for each row of the frame, `stride` numbers each: `V` before `Y`.
    z: SmallVec<[f64; ROWS * (POSE + 2)]>,
    stride: usize,
    /// `W r`.
    weighted_residuals: SmallVec<[f64; ROWS]>,
    /// `L`.
    root: Matrix6<f64>,
}

impl Projection {
    /// Returns the projections; `None` where the points do not fix a pose.
    pub(super) fn new(frame: &LinearFrame) -> Option<Self> {
        let (rows, modes) = (frame.residuals.len(), frame.modes);
        let stride = modes + POSE;
        let mut projection = Self {
            z: SmallVec::from_elem(0.0, rows * stride),
            stride,
            weighted_residuals: frame.residuals.iter().copied().collect(),
            root: Matrix6::zeros(),
        };
        if modes > 0 {
            projection.whiten_modes(frame)?;
        }
        projection.fill_pose(frame)?;
        Some(projection)
    }

    /// Fills `V`, and takes its part out of the residuals.
    fn whiten_modes(&mut self, frame: &LinearFrame) -> Option<()> {
        let (modes, stride) = (frame.modes, self.stride);
        let mut a: SmallVec<[f64; 64]> = SmallVec::from_elem(0.0, modes * modes);
        for shifts in frame.by_mode.chunks_exact(modes) {
            for i in 0..modes {
                for j in 0..=i {
                    a[i * modes + j] += shifts[i] * shifts[j];
                }
            }
        }
        for i in 0..modes {
            a[i * modes + i] += 1.0;
        }
        factor(&mut a, modes)?;
        let mut explained: SmallVec<[f64; 32]> = SmallVec::from_elem(0.0, modes);
        for ((z, shifts), residual) in self
            .z
            .chunks_exact_mut(stride)
            .zip(frame.by_mode.chunks_exact(modes))
            .zip(&frame.residuals)
        {
            z[..modes].copy_from_slice(shifts);
            forward(&a, modes, &mut z[..modes]);
            for (sum, v) in explained.iter_mut().zip(&z[..modes]) {
                *sum += v * residual;
            }
        }
        for (z, weighted) in self
            .z
            .chunks_exact(stride)
            .zip(&mut self.weighted_residuals)
        {
            *weighted -= dot(&z[..modes], &explained);
        }
        Some(())
    }

    /// Fills `Y` and `L`.
    fn fill_pose(&mut self, frame: &LinearFrame) -> Option<()> {
        let (modes, stride) = (frame.modes, self.stride);
        // V J: what of the derivatives the modes can explain.
        let mut through: SmallVec<[[f64; POSE]; 32]> = SmallVec::from_elem([0.0; POSE], modes);
        for (z, row) in self.z.chunks_exact(stride).zip(&frame.by_pose) {
            for (sums, v) in through.iter_mut().zip(&z[..modes]) {
                for (sum, by) in sums.iter_mut().zip(row) {
                    *sum += v * by;
                }
            }
        }
        let mut information = Matrix6::zeros();
        for row in &frame.by_pose {
            add_square(&mut information, row, 1.0);
        }
        for sums in &through {
            add_square(&mut information, sums, -1.0);
        }
        for axis in 3..POSE {
            information[(axis, axis)] += frame.attitude_information;
        }
        self.root = information.cholesky()?.unpack();
        for (z, row) in self.z.chunks_exact_mut(stride).zip(&frame.by_pose) {
            let (v, y) = z.split_at_mut(modes);
            let mut column = *row;
            for (sums, v) in through.iter().zip(v.iter()) {
                for (entry, sum) in column.iter_mut().zip(sums) {
                    *entry -= v * sum;
                }
            }
            y.copy_from_slice(&column);
            for i in 0..POSE {
                for j in 0..i {
                    y[i] -= self.root[(i, j)] * y[j];
                }
                y[i] /= self.root[(i, i)];
            }
        }
        Some(())
    }

    /// Returns `L⁻¹ a`; its squared length is `aᵀ P a`.
    pub(super) fn whitened(&self, direction: &Vector6<f64>) -> Option<Vector6<f64>> {
        self.root.solve_lower_triangular(direction)
    }

    /// Returns the errors in a direction that one sigma of each row makes: `aᵀ P Jᵀ W`.
    ///
    /// # Inputs
    /// * `whitened`: of the direction.
    pub(super) fn gains(&self, whitened: &Vector6<f64>) -> impl Iterator<Item = f64> {
        self.z
            .chunks_exact(self.stride)
            .map(|z| dot(&z[self.stride - POSE..], whitened.as_slice()))
    }

    /// Returns `L`.
    pub(super) fn root(&self) -> &Matrix6<f64> {
        &self.root
    }

    /// Returns `P Jᵀ W`, a column for each row: the error of the pose that one sigma of it makes.
    pub(super) fn levers(&self) -> Vec<Vector6<f64>> {
        let columns = self.z.chunks_exact(self.stride).map(|z| {
            let mut column = Vector6::from_column_slice(&z[self.stride - POSE..]);
            // The root is that of a positive definite matrix.
            self.root.tr_solve_lower_triangular_mut(&mut column);
            column
        });
        columns.collect()
    }

    /// Returns `M`, row by row.
    pub(super) fn residuals_by_error(&self) -> SmallVec<[f64; MATRIX]> {
        let rows = self.weighted_residuals.len();
        let mut m = SmallVec::from_elem(0.0, rows * rows);
        for row in 0..rows {
            for other in 0..=row {
                let same = if row == other { 1.0 } else { 0.0 };
                let entry = same - dot(self.column(row), self.column(other));
                m[row * rows + other] = entry;
                m[other * rows + row] = entry;
            }
        }
        m
    }

    /// Returns the residuals, weighted by what all rows share: `W r`.
    pub(super) fn weighted_residuals(&self) -> &[f64] {
        &self.weighted_residuals
    }

    fn column(&self, row: usize) -> &[f64] {
        &self.z[row * self.stride..][..self.stride]
    }
}

fn add_square(information: &mut Matrix6<f64>, row: &[f64; POSE], sign: f64) {
    for i in 0..POSE {
        for j in 0..=i {
            let product = sign * row[i] * row[j];
            information[(i, j)] += product;
            if i != j {
                information[(j, i)] += product;
            }
        }
    }
}

/// Replaces the lower triangle of a matrix of `size` rows by its Cholesky factor; `None` where it is not positive
/// definite.
pub(super) fn factor(matrix: &mut [f64], size: usize) -> Option<()> {
    for i in 0..size {
        for j in 0..=i {
            let mut sum = matrix[i * size + j];
            for k in 0..j {
                sum -= matrix[i * size + k] * matrix[j * size + k];
            }
            if i > j {
                matrix[i * size + j] = sum / matrix[j * size + j];
            } else if sum > 0.0 {
                matrix[i * size + i] = sum.sqrt();
            } else {
                return None;
            }
        }
    }
    Some(())
}

/// Replaces `vector` by `L⁻¹ vector`.
pub(super) fn forward(root: &[f64], size: usize, vector: &mut [f64]) {
    for i in 0..size {
        let (done, rest) = vector.split_at_mut(i);
        let known = dot(&root[i * size..][..i], done);
        rest[0] = (rest[0] - known) / root[i * size + i];
    }
}

pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
