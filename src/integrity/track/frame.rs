//! A linearised frame -> the separations of all its hypotheses in six dimensions, and what lasting causes do to them.

use nalgebra::{Matrix6, Vector6};
use smallvec::SmallVec;

use super::choices::LeftOut;
use crate::estimation::{ErrorBudget, LinearFrame, Solution};
use crate::integrity::hypotheses::{Beacon, Unit};
use crate::integrity::projection::{Projection, WIDENED, dot, factor, forward};
use crate::integrity::separation::{Suspicion, is_visible};

/// A cause that frames have in common.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum CauseKey {
    /// Place of a marker along an axis of the tanker.
    Survey(u32, usize),
    /// Correlated noise of a marker in u or v.
    Noise(u32, usize),
    /// A mode of the budget, by its place.
    Mode(usize),
}

/// Such a cause in one frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct FrameCause {
    pub(super) key: CauseKey,
    pub(super) time_constant_s: Option<f64>,
    /// Error of the pose in use by one sigma of it, `n`.
    pub(super) shift: Vector6<f64>,
}

/// The pose without some suspects beside the one in use, in `r` dimensions.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Effect {
    /// `L`: `r` columns.
    pub(super) lever: SmallVec<[Vector6<f64>; 4]>,
    /// `s`: the pose without them is `L s` away from the one in use.
    pub(super) seen: SmallVec<[f64; 4]>,
    /// `b` of each cause, `r` numbers each: the pose without them has an error of `n + L b` by one sigma of it.
    pub(super) by_cause: Vec<f64>,
    /// `1 − Σ b bᵀ`: covariance of what is new in `s`; `r` rows.
    pub(super) new: SmallVec<[f64; 16]>,
    /// `Σ n bᵀ`: `r` columns.
    pub(super) cross: SmallVec<[Vector6<f64>; 4]>,
}

impl Effect {
    /// Returns that of suspects that nothing depends on.
    pub(super) fn none() -> Self {
        Self {
            lever: SmallVec::new(),
            seen: SmallVec::new(),
            by_cause: Vec::new(),
            new: SmallVec::new(),
            cross: SmallVec::new(),
        }
    }
}

/// What may be faulty in a frame, by places in it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Suspects {
    One(usize),
    /// The first is the smaller place.
    Two(usize, usize),
    /// A mode of the budget.
    Mode(usize),
}

/// What the protection levels of a track need of one frame.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FrameSeparations {
    pub(super) beacons: SmallVec<[Beacon; 16]>,
    pub(super) has_pairs: bool,
    /// Of each beacon, followed by those of it with each later one; then of modes. `None`: without the suspects the
    /// others do not fix a pose.
    effects: Vec<Option<Effect>>,
    /// The modes that are hypotheses.
    pub(super) modes: SmallVec<[usize; 4]>,
    pub(super) flex_modes: usize,
    pub(super) all_modes: usize,
    pub(super) causes: Vec<FrameCause>,
    pub(super) left_out: LeftOut,
    /// Probability of the second pose.
    pub(super) ambiguity: f64,
}

/// A frame as levels of its own look at it.
pub(in crate::integrity) struct Linearised<'a> {
    pub(in crate::integrity) linear: &'a LinearFrame,
    pub(in crate::integrity) projection: &'a Projection,
    pub(in crate::integrity) suspicion: &'a Suspicion<'a>,
    pub(in crate::integrity) solution: &'a Solution,
    pub(in crate::integrity) budget: Option<&'a ErrorBudget>,
}

impl FrameSeparations {
    /// Returns whether there is a frame.
    pub(in crate::integrity) fn is_of_frame(&self) -> bool {
        !self.beacons.is_empty()
    }

    /// Returns the separations of a frame.
    ///
    /// # Inputs
    /// * `modes`: those that are hypotheses.
    /// * `is_monitored`: of each hypothesis, in the order of the effects.
    pub(in crate::integrity) fn new(
        frame: &Linearised,
        units: &[Unit],
        has_pairs: bool,
        modes: &[usize],
        is_monitored: &[bool],
        left_out: LeftOut,
    ) -> Self {
        let rows = Rows::new(frame);
        let mut effects = Vec::with_capacity(is_monitored.len());
        let mut monitored = is_monitored.iter();
        let mut push = |effect: &dyn Fn() -> Option<Effect>| {
            let is_monitored = monitored.next().is_some_and(|is| *is);
            effects.push(is_monitored.then(effect).flatten());
        };
        for (at, unit) in units.iter().enumerate() {
            push(&|| rows.without(&unit.rows));
            for other in units[at + 1..].iter().take_while(|_| has_pairs) {
                let both: SmallVec<[usize; 16]> =
                    unit.rows.iter().chain(&other.rows).copied().collect();
                push(&|| rows.without(&both));
            }
        }
        for mode in modes {
            push(&|| rows.without_mode(*mode));
        }
        Self {
            beacons: units.iter().map(|unit| unit.beacon).collect(),
            has_pairs,
            effects,
            modes: modes.iter().copied().collect(),
            flex_modes: frame.linear.flex_modes,
            all_modes: frame.linear.modes,
            causes: rows.causes,
            left_out,
            ambiguity: frame.solution.ambiguity,
        }
    }

    /// Returns the effect of suspects; `None` without one pose of the others.
    pub(super) fn effect(&self, of: Suspects) -> Option<&Effect> {
        let count = self.beacons.len();
        // Before a beacon there are those before it, each with its pairs.
        let start = |at: usize| {
            if self.has_pairs {
                at * count - at * at.saturating_sub(1) / 2
            } else {
                at
            }
        };
        let at = match of {
            Suspects::One(at) => start(at),
            Suspects::Two(one, other) => start(one) + other - one,
            Suspects::Mode(mode) => start(count) + self.modes.iter().position(|at| *at == mode)?,
        };
        self.effects.get(at)?.as_ref()
    }
}

/// The rows of a frame with the causes that last.
struct Rows<'a> {
    frame: &'a Linearised<'a>,
    /// `P Jᵀ W`: a column for each row.
    levers: Vec<Vector6<f64>>,
    causes: Vec<FrameCause>,
    /// `M h` of each cause: as many numbers as there are rows.
    seen_causes: Vec<f64>,
    /// By which standard deviations are larger than the curvature says.
    widened: f64,
}

impl<'a> Rows<'a> {
    fn new(frame: &'a Linearised<'a>) -> Self {
        let mut rows = Self {
            frame,
            levers: frame.projection.levers(),
            causes: Vec::new(),
            seen_causes: Vec::new(),
            widened: widened(frame),
        };
        if let Some(budget) = frame.budget {
            rows.add_causes(budget);
        }
        rows
    }

    fn add_causes(&mut self, budget: &ErrorBudget) {
        let linear = self.frame.linear;
        let rotation = self
            .frame
            .solution
            .camera_from_tanker
            .rotation
            .to_rotation_matrix();
        for (at, &id) in linear.ids.iter().enumerate() {
            let rows = [2 * at, 2 * at + 1];
            let survey_m = budget.survey_sigma_m(id);
            if survey_m > 0.0 {
                for axis in 0..3 {
                    let along = rotation.matrix().column(axis) * survey_m;
                    let shift = rows.map(|row| dot(&linear.by_pose[row][..3], along.as_slice()));
                    self.add_of_point(CauseKey::Survey(id, axis), None, rows, shift);
                }
            }
            if let Some(noise) = budget.correlated_noise() {
                for axis in 0..2 {
                    let shift = rows.map(|row| linear.by_noise[row][axis] * noise.share().sqrt());
                    let key = CauseKey::Noise(id, axis);
                    self.add_of_point(key, Some(noise.time_constant_s()), rows, shift);
                }
            }
        }
        for mode in 0..linear.modes {
            let (share, time_constant_s) = budget.mode_lasts(mode);
            if share > 0.0 {
                let mut shifts = self.shifts(mode);
                shifts.iter_mut().for_each(|shift| *shift *= share);
                let shift = -self.moved_by(&shifts);
                self.causes.push(FrameCause {
                    key: CauseKey::Mode(mode),
                    time_constant_s,
                    shift,
                });
                let seen = self
                    .frame
                    .suspicion
                    .rows_of_residuals()
                    .map(|row| dot(row, &shifts));
                self.seen_causes.extend(seen);
            }
        }
    }

    fn add_of_point(
        &mut self,
        key: CauseKey,
        time_constant_s: Option<f64>,
        rows: [usize; 2],
        shift: [f64; 2],
    ) {
        self.causes.push(FrameCause {
            key,
            time_constant_s,
            shift: -(self.levers[rows[0]] * shift[0] + self.levers[rows[1]] * shift[1]),
        });
        let seen = self.frame.suspicion.rows_of_residuals();
        let seen = seen.map(|row| row[rows[0]] * shift[0] + row[rows[1]] * shift[1]);
        self.seen_causes.extend(seen);
    }

    /// Returns the shifts of all rows by one sigma of a mode.
    fn shifts(&self, mode: usize) -> SmallVec<[f64; 32]> {
        let linear = self.frame.linear;
        let shifts = linear.by_mode.iter().skip(mode).step_by(linear.modes);
        shifts.copied().collect()
    }

    /// Returns `P Jᵀ W h`.
    fn moved_by(&self, shifts: &[f64]) -> Vector6<f64> {
        let parts = self.levers.iter().zip(shifts);
        parts.fold(Vector6::zeros(), |sum, (lever, shift)| sum + lever * *shift)
    }

    /// Returns the effect if these rows are wrong by any amount.
    fn without(&self, suspects: &[usize]) -> Option<Effect> {
        let size = suspects.len();
        let mut root: SmallVec<[f64; 16]> = SmallVec::from_elem(0.0, size * size);
        for (i, row) in suspects.iter().enumerate() {
            let row = self.frame.suspicion.row_of_residuals(*row);
            for (j, other) in suspects[..=i].iter().enumerate() {
                root[i * size + j] = row[*other];
            }
        }
        factor(&mut root, size)?;
        let whitened = |numbers: &dyn Fn(usize) -> f64| {
            let mut numbers: SmallVec<[f64; 4]> =
                suspects.iter().map(|row| numbers(*row)).collect();
            forward(&root, size, &mut numbers);
            numbers
        };
        let seen = whitened(&|row| self.frame.suspicion.weighted_residuals()[row]);
        let mut lever: SmallVec<[Vector6<f64>; 4]> = SmallVec::from_elem(Vector6::zeros(), size);
        for dimension in 0..6 {
            let whole = whitened(&|row| self.levers[row][dimension]);
            for (column, number) in lever.iter_mut().zip(whole) {
                column[dimension] = number;
            }
        }
        let count = self.levers.len();
        let mut by_cause = Vec::with_capacity(size * self.causes.len());
        for seen in self.seen_causes.chunks_exact(count) {
            by_cause.extend(whitened(&|row| seen[row]));
        }
        Some(self.effect(lever, seen, by_cause))
    }

    /// Returns the effect if the amplitude of a mode is any number.
    fn without_mode(&self, mode: usize) -> Option<Effect> {
        let shifts = self.shifts(mode);
        let suspicion = self.frame.suspicion;
        let rows = suspicion.rows_of_residuals();
        let visible: f64 = rows
            .zip(&shifts)
            .map(|(row, h)| h * dot(row, &shifts))
            .sum();
        let whole = dot(&shifts, &shifts);
        if whole == 0.0 {
            // No point that is used moves with it.
            return Some(Effect::none());
        }
        if !is_visible(visible, whole) {
            return None;
        }
        let scale = visible.sqrt().recip();
        let seen = dot(&shifts, suspicion.weighted_residuals()) * scale;
        let of_causes = self.seen_causes.chunks_exact(self.levers.len());
        let by_cause = of_causes.map(|seen| dot(&shifts, seen) * scale).collect();
        let lever = self.moved_by(&shifts) * scale;
        Some(self.effect(
            SmallVec::from_elem(lever, 1),
            SmallVec::from_elem(seen, 1),
            by_cause,
        ))
    }

    fn effect(
        &self,
        lever: SmallVec<[Vector6<f64>; 4]>,
        seen: SmallVec<[f64; 4]>,
        mut by_cause: Vec<f64>,
    ) -> Effect {
        let size = lever.len();
        let mut new = SmallVec::from_elem(0.0, size * size);
        for i in 0..size {
            new[i * size + i] = self.widened * self.widened;
        }
        let mut cross = SmallVec::from_elem(Vector6::zeros(), size);
        for b in &mut by_cause {
            *b *= self.widened;
        }
        if size > 0 {
            for (cause, b) in self.causes.iter().zip(by_cause.chunks_exact(size)) {
                for i in 0..size {
                    cross[i] += cause.shift * b[i];
                    for j in 0..size {
                        new[i * size + j] -= b[i] * b[j];
                    }
                }
            }
        }
        Effect {
            lever,
            seen,
            by_cause,
            new,
            cross,
        }
    }
}

/// Returns by which a standard deviation is at most larger than the curvature says.
fn widened(frame: &Linearised) -> f64 {
    let root: &Matrix6<f64> = frame.projection.root();
    let stated = root.transpose() * frame.solution.covariance.0 * root;
    let largest = stated.symmetric_eigenvalues().max();
    if largest > WIDENED {
        largest.sqrt()
    } else {
        1.0
    }
}
