//! One hypothesis -> how far its own estimate is from the one in use, in each direction.

use nalgebra::Vector6;
use smallvec::SmallVec;

use super::projection::{MATRIX, Projection, dot, factor, forward};

/// Share of an error that residuals must show: below it, a fault is as good as invisible.
const LEAST_VISIBLE: f64 = 1e-9;

/// Returns whether residuals show enough of a shift.
///
/// # Inputs
/// * `visible`, `whole`: the square of it in the residuals, and in the pixels.
pub(super) fn is_visible(visible: f64, whole: f64) -> bool {
    visible > LEAST_VISIBLE * whole
}

/// Along one direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Separation {
    /// Of the estimate in use from that without the suspects, m.
    pub(super) difference_m: f64,
    /// Its standard deviation without a fault, m.
    pub(super) sigma_m: f64,
}

/// Separations along all directions.
pub(super) type Separations = SmallVec<[Separation; 12]>;

/// A frame as hypotheses look at it.
#[derive(Debug)]
pub(super) struct Suspicion<'a> {
    /// `M`, row by row.
    residuals_by_error: SmallVec<[f64; MATRIX]>,
    /// `W r`.
    weighted_residuals: &'a [f64],
    /// `aᵀ P Jᵀ W` of each direction, one after the other.
    gains: SmallVec<[f64; 128]>,
}

impl<'a> Suspicion<'a> {
    /// Returns a frame with directions in which separations are wanted, whitened by the projection.
    pub(super) fn new(projection: &'a Projection, directions: &[Vector6<f64>]) -> Self {
        Self {
            residuals_by_error: projection.residuals_by_error(),
            weighted_residuals: projection.weighted_residuals(),
            gains: directions
                .iter()
                .flat_map(|direction| projection.gains(direction))
                .collect(),
        }
    }

    /// Returns `M`, row by row.
    pub(super) fn rows_of_residuals(&self) -> impl Iterator<Item = &[f64]> {
        self.residuals_by_error.chunks_exact(self.rows())
    }

    /// Returns a row of `M`.
    pub(super) fn row_of_residuals(&self, row: usize) -> &[f64] {
        &self.residuals_by_error[row * self.rows()..][..self.rows()]
    }

    /// Returns `W r`.
    pub(super) fn weighted_residuals(&self) -> &[f64] {
        self.weighted_residuals
    }

    fn rows(&self) -> usize {
        self.weighted_residuals.len()
    }

    /// Finds the separations if these rows are wrong by any amount; `None` where those that are left do not fix a pose.
    pub(super) fn without_rows(&self, suspects: &[usize], found: &mut Separations) -> Option<()> {
        let size = suspects.len();
        let mut s: SmallVec<[f64; 16]> = SmallVec::from_elem(0.0, size * size);
        for (i, row) in suspects.iter().enumerate() {
            let row = &self.residuals_by_error[row * self.rows()..][..self.rows()];
            for (j, other) in suspects[..=i].iter().enumerate() {
                s[i * size + j] = row[*other];
            }
        }
        factor(&mut s, size)?;
        if (0..size).any(|i| s[i * size + i].powi(2) < LEAST_VISIBLE) {
            return None;
        }
        let of_suspects = |rows: &[f64]| -> SmallVec<[f64; 16]> {
            let mut chosen = suspects
                .iter()
                .map(|&row| rows[row])
                .collect::<SmallVec<_>>();
            forward(&s, size, &mut chosen);
            chosen
        };
        let residuals = of_suspects(self.weighted_residuals);
        found.clear();
        found.extend(self.gains.chunks_exact(self.rows()).map(|gains| {
            let gains = of_suspects(gains);
            Separation {
                difference_m: dot(&gains, &residuals),
                sigma_m: dot(&gains, &gains).sqrt(),
            }
        }));
        Some(())
    }

    /// Finds the separations if the amplitude of a mode is any number.
    ///
    /// # Inputs
    /// * `shifts`: of each row at one sigma.
    pub(super) fn without_mode(&self, shifts: &[f64], found: &mut Separations) -> Option<()> {
        let rows = self.residuals_by_error.chunks_exact(self.rows());
        let visible: f64 = rows.zip(shifts).map(|(row, h)| h * dot(row, shifts)).sum();
        let whole = dot(shifts, shifts);
        if whole > 0.0 && !is_visible(visible, whole) {
            return None;
        }
        let seen = dot(shifts, self.weighted_residuals);
        found.clear();
        found.extend(self.gains.chunks_exact(self.rows()).map(|gains| {
            if whole == 0.0 {
                // No point that is used moves with it.
                return Separation {
                    difference_m: 0.0,
                    sigma_m: 0.0,
                };
            }
            let gain = dot(gains, shifts);
            Separation {
                difference_m: gain * seen / visible,
                sigma_m: gain.abs() / visible.sqrt(),
            }
        }));
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector, Matrix6, RowDVector};

    use super::*;
    use crate::estimation::LinearFrame;

    /// A frame of six points with arbitrary numbers and two modes.
    fn frame() -> LinearFrame {
        let number = |seed: usize| ((seed * 7919 + 13) % 1009) as f64 / 504.5 - 1.0;
        LinearFrame {
            ids: (1..=6).collect(),
            by_pose: (0..12)
                .map(|row| std::array::from_fn(|column| 3.0 * number(row * 6 + column)))
                .collect(),
            by_noise: (0..12).map(|_| [0.0; 2]).collect(),
            residuals: (0..12).map(|row| number(row + 500)).collect(),
            by_mode: (0..24).map(|at| 2.0 * number(at + 700)).collect(),
            modes: 2,
            flex_modes: 1,
            attitude_information: 0.7,
        }
    }

    /// Amplitudes in the least squares sense of `columns` beside the pose: the pose's step, and its covariance.
    fn fitted(frame: &LinearFrame, columns: &DMatrix<f64>) -> (DVector<f64>, DMatrix<f64>) {
        let rows = frame.residuals.len();
        let h = DMatrix::from_row_slice(rows, frame.modes, &frame.by_mode);
        let covariance = DMatrix::identity(rows, rows) + &h * h.transpose();
        let w = covariance.try_inverse().expect("definite");
        let width = 6 + columns.ncols();
        let a = DMatrix::from_fn(rows, width, |row, column| {
            if column < 6 {
                frame.by_pose[row][column]
            } else {
                columns[(row, column - 6)]
            }
        });
        let mut information = a.transpose() * &w * &a;
        for axis in 3..6 {
            information[(axis, axis)] += frame.attitude_information;
        }
        let covariance = information.try_inverse().expect("observable");
        let residuals = DVector::from_row_slice(&frame.residuals);
        let step = -&covariance * a.transpose() * w * residuals;
        (
            step.rows(0, 6).into_owned(),
            covariance.view((0, 0), (6, 6)).into_owned(),
        )
    }

    fn assert_same(
        frame: &LinearFrame,
        columns: &DMatrix<f64>,
        found: &Separations,
        directions: &[Vector6<f64>],
    ) {
        // At the minimum the step of all points would be zero; here it is not, so both are compared with it.
        let (of_all, covariance_of_all) = fitted(frame, &DMatrix::zeros(12, 0));
        let (of_others, covariance_of_others) = fitted(frame, columns);
        for (direction, found) in directions.iter().zip(found) {
            let a = RowDVector::from_row_slice(direction.as_slice());
            let moved = (&a * (&of_others - &of_all))[0];
            let variance =
                (&a * (&covariance_of_others - &covariance_of_all) * a.transpose())[(0, 0)];
            assert!((found.sigma_m.powi(2) / variance - 1.0).abs() < 1e-9);
            assert!(
                (found.difference_m - moved).abs() < 1e-9 * moved.abs().max(1.0),
                "{} {moved}",
                found.difference_m
            );
        }
    }

    /// Residuals of a fit: as they are after the step.
    fn at_minimum(mut frame: LinearFrame) -> LinearFrame {
        // Without the prior the step is the whole of the gradient.
        frame.attitude_information = 0.0;
        let (step, _) = fitted(&frame, &DMatrix::zeros(12, 0));
        for (residual, row) in frame.residuals.iter_mut().zip(&frame.by_pose) {
            *residual += (0..6).map(|i| row[i] * step[i]).sum::<f64>();
        }
        frame
    }

    #[test]
    fn separations_are_those_of_fits_without_the_suspects() {
        let frame = at_minimum(frame());
        let projection = Projection::new(&frame).expect("fixed");
        let directions = [
            Vector6::new(1.0, 0.0, 0.0, 0.0, 0.0, 0.0),
            Vector6::new(0.0, 0.3, -1.0, 2.0, 0.1, 0.5),
        ];
        let whitened = directions.map(|a| projection.whitened(&a).expect("fixed"));
        let suspicion = Suspicion::new(&projection, &whitened);
        let mut found = Separations::new();
        for suspects in [vec![2, 3], vec![0, 1, 8, 9]] {
            let free = DMatrix::from_fn(12, suspects.len(), |row, column| {
                f64::from(u8::from(row == suspects[column]))
            });
            suspicion
                .without_rows(&suspects, &mut found)
                .expect("observable");
            assert_same(&frame, &free, &found, &directions);
        }
        let shifts: Vec<f64> = frame.by_mode.iter().step_by(2).copied().collect();
        suspicion
            .without_mode(&shifts, &mut found)
            .expect("observable");
        let free = DMatrix::from_column_slice(12, 1, &shifts);
        assert_same(&frame, &free, &found, &directions);
    }

    #[test]
    fn a_prior_of_the_attitude_counts_in_the_covariance() {
        let frame = frame();
        let projection = Projection::new(&frame).expect("fixed");
        let (_, covariance) = fitted(&frame, &DMatrix::zeros(12, 0));
        let expected = Matrix6::from_iterator(covariance.iter().copied());
        let a = Vector6::new(0.0, 0.3, -1.0, 2.0, 0.1, 0.5);
        let found = projection.whitened(&a).expect("fixed").norm_squared();
        assert!((found / a.dot(&(expected * a)) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn six_rows_or_fewer_fix_nothing_that_can_be_checked() {
        let frame = at_minimum(frame());
        let projection = Projection::new(&frame).expect("fixed");
        let suspicion = Suspicion::new(&projection, &[Vector6::x()]);
        let mut found = Separations::new();
        assert_eq!(
            suspicion.without_rows(&[0, 1, 2, 3, 4, 5, 6, 7], &mut found),
            None
        );
    }
}
