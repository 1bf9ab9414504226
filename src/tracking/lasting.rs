//! Errors that frames have in common: propagated with the motion, never averaged out.
//!
//! A survey error, a bent wing or a wrong focal length shifts the pose of every frame in nearly the same way. A filter
//! that treats such poses as independent becomes overconfident about a wrong position. Here each cause `c` of unit
//! variance is a consider state: it is not estimated, but its covariance with the motion is propagated. With `δ` the
//! error of the motion, two matrices are propagated, and `P` is published:
//!
//! ```text
//! Q = cov(δ | c)      U = E[δ cᵀ]      P = Q + U Uᵀ
//! ```
//!
//! With `B` the shifts that one sigma of each cause makes in a frame, `N` the frame's independent noise, `H = (I 0)`:
//!
//! | step | formula |
//! |---|---|
//! | start | `U = −H' B`, since the pose itself is the initial state |
//! | predict | `U ← a Φ U`, `Q ← Φ Q Φᵀ + (1 − a²) Φ U Uᵀ Φᵀ + noise`; `a = exp(−dt/τ)`, 1 for a constant cause |
//! | innovation | `W = H U + B`, `S = H Q Hᵀ + W Wᵀ + N` |
//! | update | `K = (Q Hᵀ + U Wᵀ) S⁻¹`, `Q ← (I − K H) Q (I − K H)ᵀ + K N Kᵀ`, `U ← U − K W` |
//!
//! # Source
//! Schmidt, *Application of state-space methods to navigation problems*, 1966 (consider states). DIFFERENCE: the
//! covariance of the motion's error given the causes is propagated separately, so that `P` is positive definite by
//! construction.

use nalgebra::{Matrix3, Matrix6, Vector6};

use super::matrix6::times_vector;
use super::model::{Blocks, Correction, LastingSums, Transition, turned};
use crate::geometry::{Matrix12, Vector12, principal_root};

/// Largest number of causes with a column each. The smaller ones of a larger budget are combined. A time constant
/// cannot be kept for them, so those with a time constant count both as constant and as noise.
const MAX_SINGLE: usize = 58;
/// Numbers from here on are reserved for the combined causes, one for each axis.
const TOGETHER: u64 = u64::MAX - 5;

/// The error of one frame's pose by a cause that it has in common with other frames.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LastingError {
    /// Identifies the cause: the same number in every frame. Numbers from `u64::MAX − 5` on are reserved.
    pub cause: u64,
    /// Error of the pose that one sigma of the cause makes, in the order of
    /// [`PoseCovariance`](crate::geometry::PoseCovariance).
    pub shift: Vector6<f64>,
    /// Time constant of the cause (a first-order Gauss–Markov process), s; `None`: constant for the whole flight.
    pub time_constant_s: Option<f64>,
}

/// One cause: its column of `U`, and its shift of the latest frame.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Column {
    cause: u64,
    time_constant_s: Option<f64>,
    pose: Vector6<f64>,
    rates: Vector6<f64>,
    /// Its column of `B`; zero if the frame is not affected.
    shift: Vector6<f64>,
    /// Its column of `W`.
    seen: Vector6<f64>,
}

impl Column {
    fn new(error: &LastingError) -> Self {
        Self {
            cause: error.cause,
            time_constant_s: error.time_constant_s,
            pose: Vector6::zeros(),
            rates: Vector6::zeros(),
            shift: error.shift,
            seen: error.shift,
        }
    }
}

/// The causes of a track. Memory is kept when it is refilled.
#[derive(Debug, PartialEq, Default)]
pub(super) struct Lasting {
    columns: Vec<Column>,
}

impl Clone for Lasting {
    fn clone(&self) -> Self {
        Self {
            columns: self.columns.clone(),
        }
    }

    fn clone_from(&mut self, source: &Self) {
        self.columns.clone_from(&source.columns);
    }
}

impl Lasting {
    /// Replaces all causes by those of a frame whose pose is the initial state. Returns the same as [`Self::see`].
    pub(super) fn start(&mut self, errors: &[LastingError]) -> Matrix6<f64> {
        self.columns.clear();
        let noise = self.see(errors, &Matrix3::identity());
        for column in &mut self.columns {
            column.pose = -column.shift;
        }
        noise
    }

    /// Propagates the causes of another state in time, without shifts. The variance that is no longer common to before and
    /// after goes into `added`.
    #[inline(always)]
    pub(super) fn predict_from(
        &mut self,
        before: &Self,
        dt_s: f64,
        transition: &Transition,
        added: &mut Blocks,
    ) {
        self.columns.clear();
        self.columns
            .extend(before.columns.iter().map(|column| Column {
                pose: transition.of_pose(&column.pose, &column.rates),
                shift: Vector6::zeros(),
                ..*column
            }));
        for column in &mut self.columns {
            let Some(time_constant_s) = column.time_constant_s else {
                continue;
            };
            let kept = (-dt_s / time_constant_s).exp();
            let lost = 1.0 - kept * kept;
            added.pose.ger(lost, &column.pose, &column.pose, 1.0);
            added.cross.ger(lost, &column.pose, &column.rates, 1.0);
            added.rates.ger(lost, &column.rates, &column.rates, 1.0);
            column.pose *= kept;
            column.rates *= kept;
        }
    }

    /// Sets the shifts of a frame, whose attitude errors are rotated by `turn`; before, all are zero. Returns the
    /// covariance of causes with a time constant that have no column of their own: they are combined as constant, and
    /// count as noise as well.
    pub(super) fn see(&mut self, errors: &[LastingError], turn: &Matrix3<f64>) -> Matrix6<f64> {
        let mut together = Matrix6::zeros();
        let mut noise = Matrix6::zeros();
        // Frames list their causes in about the same order, so the search starts at the next one.
        let mut hint = 0;
        for error in errors {
            let error = LastingError {
                shift: turned(&error.shift, turn),
                ..*error
            };
            if let Some(at) = self.place(error.cause, hint) {
                self.columns[at].shift = error.shift;
                self.columns[at].time_constant_s = error.time_constant_s;
                hint = at + 1;
            } else if self.columns.len() < MAX_SINGLE {
                self.columns.push(Column::new(&error));
                hint = self.columns.len();
            } else {
                let covariance = error.shift * error.shift.transpose();
                together += covariance;
                if error.time_constant_s.is_some() {
                    noise += covariance;
                }
            }
        }
        if together != Matrix6::zeros() {
            self.see_together(&together);
        }
        for column in &mut self.columns {
            column.seen = column.pose + column.shift;
        }
        noise
    }

    /// Sets the covariance of the causes that have no column of their own.
    fn see_together(&mut self, covariance: &Matrix6<f64>) {
        let root = principal_root(covariance);
        for (cause, axis) in (TOGETHER..=u64::MAX).zip(0..6) {
            let shift = root.column(axis).into_owned();
            if let Some(at) = self.place(cause, MAX_SINGLE + axis) {
                self.columns[at].shift = shift;
            } else {
                self.columns.push(Column::new(&LastingError {
                    cause,
                    shift,
                    time_constant_s: None,
                }));
            }
        }
    }

    fn place(&self, cause: u64, hint: usize) -> Option<usize> {
        let is_it = |column: &Column| column.cause == cause;
        if self.columns.get(hint).is_some_and(is_it) {
            return Some(hint);
        }
        self.columns.iter().position(is_it)
    }

    /// Returns the sums for innovation and gain; `None` without causes.
    #[inline(always)]
    pub(super) fn sums(&self) -> Option<LastingSums> {
        // Two columns at a time: they stay in registers.
        let sum = |other: fn(&Column) -> &Vector6<f64>| {
            let mut sums = Matrix6::zeros();
            for (pair, to) in sums.data.0.as_chunks_mut::<2>().0.iter_mut().enumerate() {
                let mut sum = [[0.0; 6]; 2];
                for column in &self.columns {
                    let (seen, other) = (&column.seen.data.0[0], &other(column).data.0[0]);
                    for side in 0..2 {
                        for row in 0..6 {
                            sum[side][row] += seen[row] * other[2 * pair + side];
                        }
                    }
                }
                *to = sum;
            }
            sums
        };
        (!self.columns.is_empty()).then(|| LastingSums {
            pose: sum(|column| &column.pose),
            rates: sum(|column| &column.rates),
            shift: sum(|column| &column.shift),
        })
    }

    /// Applies a correction of the motion: `U − K W`.
    pub(super) fn correct(&mut self, correction: &Correction) {
        for column in &mut self.columns {
            let pose = column.pose - times_vector(&correction.pose_gain, &column.seen);
            column.pose = turned(&pose, &correction.reset);
            column.rates -= times_vector(&correction.rates_gain, &column.seen);
        }
    }

    /// Returns a column of `U`.
    #[cfg(test)]
    pub(super) fn column(&self, at: usize) -> Option<Vector12> {
        let column = self.columns.get(at)?;
        let mut both = Vector12::zeros();
        both.fixed_rows_mut::<6>(0).copy_from(&column.pose);
        both.fixed_rows_mut::<6>(6).copy_from(&column.rates);
        Some(both)
    }

    /// Adds `U Uᵀ`.
    pub(super) fn add_to(&self, covariance: &mut Matrix12) {
        for column in &self.columns {
            add_outer(covariance, column, 1.0);
        }
    }
}

/// Adds the outer product of a column of `U` with itself, multiplied by `times`.
fn add_outer(covariance: &mut Matrix12, column: &Column, times: f64) {
    let mut both = Vector12::zeros();
    both.fixed_rows_mut::<6>(0).copy_from(&column.pose);
    both.fixed_rows_mut::<6>(6).copy_from(&column.rates);
    covariance.ger(times, &both, &both, 1.0);
}
