//! How long what frames leave out weighs in the track.

use smallvec::SmallVec;

use super::choices::SHARE_OF_EXCLUSIONS;
use super::frame::FrameSeparations;
use super::hypothesis::Passage;
use crate::geometry::Matrix12;

/// Share of a variance below which frames do not count any more: a thousandth of the standard deviation.
const LEAST_SHARE: f64 = 1e-6;

/// Frames that make the track less certain than hypotheses say, until they weigh nothing.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Weighing {
    /// Whether frames may leave detections out.
    may_leave_out: bool,
    /// Each set of detections that frames have left out.
    sets: Vec<Set>,
    /// Frames that nearly allow a second pose.
    ambiguous: Option<Ambiguous>,
}

/// Frames that have left out the same detections.
#[derive(Debug, Clone, PartialEq)]
struct Set {
    ids: SmallVec<[u32; 2]>,
    choices: f64,
    /// Their part of the track's variance.
    weight: Matrix12,
}

/// Frames that may show another pose than the one in use.
#[derive(Debug, Clone, PartialEq)]
struct Ambiguous {
    /// Of any of them.
    probability: f64,
    weight: Matrix12,
}

impl Weighing {
    /// Returns the share of the risk that the track has.
    pub(super) fn share(&self) -> f64 {
        if !self.may_leave_out {
            return 1.0;
        }
        if self.sets.is_empty() {
            return 1.0 - SHARE_OF_EXCLUSIONS;
        }
        let choices: f64 = self.sets.iter().map(|set| set.choices).product();
        SHARE_OF_EXCLUSIONS / choices
    }

    /// Returns the probability that a frame of the track shows another pose.
    pub(super) fn ambiguity(&self) -> f64 {
        self.ambiguous.as_ref().map_or(0.0, |of| of.probability)
    }

    pub(super) fn begin(&mut self, frame: &FrameSeparations) {
        *self = Self::default();
        // All of the track.
        self.take(frame, &Matrix12::identity());
    }

    pub(super) fn follow(&mut self, before: &Self, passage: &Passage, frame: &FrameSeparations) {
        self.clone_from(before);
        let is_needed = !self.sets.is_empty() || self.ambiguous.is_some();
        let is_new = !frame.left_out.ids.is_empty() || frame.ambiguity > 0.0;
        self.may_leave_out |= frame.left_out.choices.is_some();
        if !(is_needed || is_new) {
            return;
        }
        let pass = |weight: &mut Matrix12| {
            *weight = passage.kept * *weight * passage.kept.transpose();
        };
        let whole = passage.step.corrected_covariance();
        let weighs = |weight: &Matrix12| {
            (0..6).any(|axis| weight[(axis, axis)] > LEAST_SHARE * whole[(axis, axis)])
        };
        self.sets.iter_mut().for_each(|set| pass(&mut set.weight));
        self.sets.retain(|set| weighs(&set.weight));
        if let Some(ambiguous) = &mut self.ambiguous {
            pass(&mut ambiguous.weight);
        }
        self.ambiguous = self.ambiguous.take().filter(|of| weighs(&of.weight));
        let gain = &passage.of_measured;
        self.take(frame, &(gain * passage.step.noise() * gain.transpose()));
    }

    fn take(&mut self, frame: &FrameSeparations, weight: &Matrix12) {
        self.may_leave_out |= frame.left_out.choices.is_some();
        if let (Some(choices), false) = (frame.left_out.choices, frame.left_out.ids.is_empty()) {
            let ids = &frame.left_out.ids;
            match self.sets.iter_mut().find(|set| set.ids == *ids) {
                Some(set) => {
                    set.choices = set.choices.max(choices);
                    set.weight += weight;
                }
                None => self.sets.push(Set {
                    ids: ids.clone(),
                    choices,
                    weight: *weight,
                }),
            }
        }
        if frame.ambiguity > 0.0 {
            match &mut self.ambiguous {
                Some(of) => {
                    of.probability += frame.ambiguity;
                    of.weight += weight;
                }
                None => {
                    self.ambiguous = Some(Ambiguous {
                        probability: frame.ambiguity,
                        weight: *weight,
                    });
                }
            }
        }
    }
}
