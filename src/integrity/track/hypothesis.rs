//! How far the track is from the one without some suspects, and what that has of errors.

use nalgebra::{Matrix6, Vector6};
use smallvec::SmallVec;

use super::frame::Effect;
use crate::geometry::{Matrix12, Vector12};
use crate::tracking::{Matrix12x6, Step};

/// s that the track without the suspects may coast: then it begins anew with the next frame that has a pose without
/// them. As long as a track may be without a frame by default.
const MOST_UNSEEN_S: f64 = 1.0;

/// How errors go through a frame.
pub(super) struct Passage<'a> {
    pub(super) step: &'a Step<'a>,
    /// `A`.
    pub(super) kept: Matrix12,
    /// `G`.
    pub(super) of_measured: Matrix12x6,
}

/// A lasting cause on its way through a frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct PassingCause {
    /// `exp(−dt/τ)`.
    pub(super) lasts: f64,
    /// Its place in the frame, if that is affected.
    pub(super) in_frame: Option<usize>,
    /// What one sigma of it does to the frame's pose, `n`; zero if that is not affected.
    pub(super) shift: Vector6<f64>,
    /// What one sigma of it does to the track in use: `V` before the frame, `A V`, and `V` after it.
    pub(super) before: Vector12,
    pub(super) passed: Vector12,
    pub(super) after: Vector12,
}

/// What a frame says without the suspects.
#[derive(Debug, Clone, Copy)]
pub(super) enum Seen<'a> {
    /// The same as with them: it does not have them.
    Same,
    /// A pose of its own.
    Pose(&'a Effect),
    /// Nothing: the other points do not fix one pose.
    Nothing,
}

/// The track in use minus the one without some suspects.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Separated {
    /// `D`.
    pub(super) difference: Vector12,
    /// `W` of each cause of the track; those that have come later are missing.
    pub(super) by_cause: Vec<Vector12>,
    /// `Q`.
    pub(super) new: Matrix12,
    /// `Y`.
    pub(super) more: Matrix12,
    /// For how long the track without them has coasted, s.
    pub(super) unseen_s: f64,
}

impl Separated {
    /// Returns suspects that no frame has had.
    pub(super) fn none() -> Self {
        Self {
            difference: Vector12::zeros(),
            by_cause: Vec::new(),
            new: Matrix12::zeros(),
            more: Matrix12::zeros(),
            unseen_s: 0.0,
        }
    }

    /// Returns suspects without whom there is no track.
    pub(super) fn unknown() -> Self {
        Self {
            unseen_s: f64::INFINITY,
            ..Self::none()
        }
    }

    /// Returns whether there is a track without the suspects.
    pub(super) fn is_known(&self) -> bool {
        self.unseen_s <= MOST_UNSEEN_S
    }

    /// Returns the separation that begins with the first frame of a track.
    pub(super) fn begin(seen: Seen) -> Self {
        let mut found = Self::none();
        match seen {
            Seen::Same => {}
            Seen::Nothing => found = Self::unknown(),
            Seen::Pose(effect) => {
                let mut of_measured = Matrix12x6::zeros();
                of_measured.fill_diagonal(1.0);
                found.add(&of_measured, effect);
                let by_cause = effect.by_cause.chunks_exact(effect.lever.len().max(1));
                found.by_cause = by_cause
                    .map(|b| of_measured * moved(&effect.lever, b))
                    .collect();
            }
        }
        found
    }

    /// Becomes what another is after a frame.
    pub(super) fn follow(
        &mut self,
        before: &Self,
        passage: &Passage,
        causes: &[PassingCause],
        seen: Seen,
    ) {
        match seen {
            Seen::Nothing => self.coast(before, passage.step, causes),
            _ if !before.is_known() => self.restart(passage.step, causes, seen),
            _ => self.correct(before, passage, causes, seen),
        }
    }

    fn correct(&mut self, before: &Self, passage: &Passage, causes: &[PassingCause], seen: Seen) {
        let (kept, gain) = (&passage.kept, &passage.of_measured);
        self.unseen_s = 0.0;
        self.difference = kept * before.difference;
        self.new = congruent(kept, &before.new);
        self.more = congruent(kept, &before.more);
        let effect = match seen {
            Seen::Pose(effect) => Some(effect),
            Seen::Same | Seen::Nothing => None,
        };
        let levers = effect.map_or_else(SmallVec::new, |effect| self.add(gain, effect));
        self.by_cause.clear();
        for (at, cause) in causes.iter().enumerate() {
            let by = before.by_cause.get(at);
            let passed = by.map_or_else(Vector12::zeros, |by| kept * by);
            let mut after = passed * cause.lasts;
            if let (Some(effect), Some(place)) = (effect, cause.in_frame) {
                let b = &effect.by_cause[place * levers.len()..][..levers.len()];
                for (lever, b) in levers.iter().zip(b) {
                    after += lever * *b;
                }
            }
            self.by_cause.push(after);
            if cause.lasts < 1.0 {
                // What of it is not common to before and after.
                let lost = 1.0 - cause.lasts * cause.lasts;
                self.new.ger(lost, &passed, &passed, 1.0);
                self.more.ger(lost, &passed, &passed, 1.0);
                self.more.ger(lost, &passed, &cause.passed, 1.0);
                self.more.ger(lost, &cause.passed, &passed, 1.0);
            }
        }
    }

    /// Adds what is new in a frame; returns `G L`.
    fn add(&mut self, gain: &Matrix12x6, effect: &Effect) -> SmallVec<[Vector12; 4]> {
        let size = effect.lever.len();
        let levers: SmallVec<[Vector12; 4]> =
            effect.lever.iter().map(|lever| gain * lever).collect();
        for (i, lever) in levers.iter().enumerate() {
            self.difference -= lever * effect.seen[i];
            let mut weighted = Vector12::zeros();
            for (other, new) in levers.iter().zip(&effect.new[i * size..]) {
                weighted += other * *new;
            }
            self.new.ger(1.0, lever, &weighted, 1.0);
            let cross = gain * effect.cross[i];
            self.more.ger(1.0, lever, &(weighted - cross), 1.0);
            self.more.ger(-1.0, &cross, lever, 1.0);
        }
        levers
    }

    /// Leaves the track without the suspects as it is predicted.
    fn coast(&mut self, before: &Self, step: &Step, causes: &[PassingCause]) {
        self.unseen_s = before.unseen_s + step.seconds();
        if !self.is_known() {
            *self = Self::unknown();
            return;
        }
        let reset = step.reset();
        let moved = reset * step.transition();
        let gain = reset * step.gain();
        self.difference = moved * before.difference + gain * step.innovation();
        // The innovation is not independent of the separation: a bound of the covariance of their sum.
        let (one, other) = (
            congruent(&moved, &before.new),
            gain * step.innovation_covariance() * gain.transpose(),
        );
        let size = |m: &Matrix12| m.fixed_view::<3, 3>(0, 0).trace();
        let share = (size(&other) / size(&one)).sqrt();
        let share = if share.is_finite() {
            share.clamp(1e-3, 1e3)
        } else {
            1e3
        };
        self.new = one * (1.0 + share) + other * (1.0 + 1.0 / share);
        self.more = congruent(&moved, &before.more)
            + congruent(&reset, &step.predicted_covariance())
            - step.corrected_covariance();
        self.by_cause.clear();
        for (at, cause) in causes.iter().enumerate() {
            let by = before.by_cause.get(at);
            let without = by.map_or(cause.before, |by| cause.before + by);
            let (without, with) = (moved * without, moved * cause.before);
            self.by_cause.push(without * cause.lasts - cause.after);
            if cause.lasts < 1.0 {
                let lost = 1.0 - cause.lasts * cause.lasts;
                self.more.ger(lost, &without, &without, 1.0);
                self.more.ger(-lost, &with, &with, 1.0);
            }
        }
    }

    /// Begins the track without the suspects with this frame.
    fn restart(&mut self, step: &Step, causes: &[PassingCause], seen: Seen) {
        let nothing = Effect::none();
        let effect = match seen {
            Seen::Pose(effect) => effect,
            Seen::Same | Seen::Nothing => &nothing,
        };
        let mut turn = Matrix6::identity();
        turn.fixed_view_mut::<3, 3>(3, 3)
            .copy_from(&step.measured_turn());
        let reset = step.reset();
        let whole = |pose: &Vector6<f64>| {
            let mut whole = Vector12::zeros();
            whole.fixed_rows_mut::<6>(0).copy_from(pose);
            whole
        };
        self.unseen_s = 0.0;
        let beside = turn * moved(&effect.lever, &effect.seen);
        let (velocity, rate) = step.rates();
        let mut rates = Vector12::zeros();
        rates.fixed_rows_mut::<3>(6).copy_from(&velocity);
        rates.fixed_rows_mut::<3>(9).copy_from(&rate);
        let mut corrected = step.gain() * step.innovation();
        corrected.fixed_rows_mut::<6>(6).fill(0.0);
        self.difference = reset * (corrected - whole(&(step.innovation() + beside))) + rates;
        let mut of_pose = Matrix6::zeros();
        let size = effect.lever.len();
        for (i, lever) in effect.lever.iter().enumerate() {
            for (other, new) in effect.lever.iter().zip(&effect.new[i * size..]) {
                of_pose += lever * other.transpose() * *new;
            }
            let cross = effect.cross[i] * lever.transpose();
            of_pose -= cross + cross.transpose();
        }
        let of_pose = step.noise() + turn * of_pose * turn.transpose();
        let mut own = Matrix12::zeros();
        own.fixed_view_mut::<6, 6>(0, 0).copy_from(&of_pose);
        let (of_velocity, of_rate) = step.initial_rates_variance();
        for axis in 0..3 {
            own[(6 + axis, 6 + axis)] = of_velocity;
            own[(9 + axis, 9 + axis)] = of_rate;
        }
        let own = congruent(&reset, &own);
        self.more = own - step.corrected_covariance();
        // Both may have any part in common.
        self.new = (own + step.corrected_covariance()) * 2.0;
        self.by_cause.clear();
        for cause in causes {
            let mut without = Vector12::zeros();
            if let Some(place) = cause.in_frame {
                let b = &effect.by_cause.get(place * size..).unwrap_or(&[]);
                let by_pose = cause.shift + moved(&effect.lever, b);
                without = reset * whole(&(turn * by_pose));
            }
            self.by_cause.push(without - cause.after);
        }
    }
}

/// Returns `L b`.
fn moved(lever: &[Vector6<f64>], by: &[f64]) -> Vector6<f64> {
    let parts = lever.iter().zip(by);
    parts.fold(Vector6::zeros(), |sum, (lever, by)| sum + lever * *by)
}

/// Returns `A M Aᵀ`.
fn congruent(a: &Matrix12, m: &Matrix12) -> Matrix12 {
    a * m * a.transpose()
}
