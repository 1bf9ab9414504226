//! Markers that are excluded in many frames. The cause is not an occasional wrong detection, but a wrong position on
//! the map, a bending airframe, a wrong calibration, or a detector that confuses something else with the marker.
//!
//! The cause is unknown, and with all but the last one the other markers are wrong too. So while it lasts, no pose of a
//! frame that shows such a marker is trusted, whether or not the marker is used.

use super::{FrameOutcome, Refusal, Stamp, SuspectMarker};
use crate::estimation::Solution;

/// s; time constant of the sums.
const MEMORY_S: f64 = 3.0;
/// s; longest step of the decay: without observations nothing is resolved.
const MAX_FADE_S: f64 = 1.0;
/// A marker becomes suspect from this share on, of the frames that show it.
const MANY_OF_ALL: f64 = 0.3;
/// Below this share a run ends.
const NOT_MANY: f64 = 0.2;
/// Below this share a suspicion ends.
const FEW_OF_ALL: f64 = 0.1;
/// s; least duration of a run.
const LASTING_S: f64 = 3.0;
/// Least number of exclusions.
const MANY: f64 = 10.0;
/// Weight of a frame in which either of two markers may be wrong.
const EITHER: f64 = 0.5;
/// Below this share a marker is removed from the list.
const NEGLIGIBLE: f64 = 0.01;

/// The recent exclusions of a marker.
#[derive(Debug)]
struct Record {
    id: u32,
    latest_s: f64,
    seen: f64,
    left_out: f64,
    run: Option<Run>,
    is_suspect: bool,
}

/// A time in which a marker is often excluded.
#[derive(Debug)]
struct Run {
    since_s: f64,
    left_out: f64,
}

impl Record {
    fn take(&mut self, left_out: f64, now_s: f64) {
        let passed_s = now_s - self.latest_s;
        if passed_s < 0.0 {
            // A recording that restarts, or a late image.
            self.run = None;
        }
        let left = (-passed_s.clamp(0.0, MAX_FADE_S) / MEMORY_S).exp();
        self.latest_s = now_s;
        self.seen = self.seen * left + 1.0;
        self.left_out = self.left_out * left + left_out;
        let share = self.share();
        if share < FEW_OF_ALL {
            self.is_suspect = false;
        }
        if share < NOT_MANY {
            self.run = None;
        }
        if self.run.is_none() && share >= MANY_OF_ALL {
            self.run = Some(Run {
                since_s: now_s,
                left_out: 0.0,
            });
        }
        if let Some(run) = &mut self.run {
            run.left_out += left_out;
            let lasts = run.left_out >= MANY && now_s - run.since_s >= LASTING_S;
            // Only in a frame that excludes it: the decaying sum of a past reflection is not sufficient.
            self.is_suspect |= lasts && left_out > 0.0 && share >= MANY_OF_ALL;
        }
    }

    fn share(&self) -> f64 {
        self.left_out / self.seen
    }

    fn is_forgotten(&self) -> bool {
        !self.is_suspect && self.left_out < NEGLIGIBLE
    }

    fn suspect(&self) -> Option<SuspectMarker> {
        self.is_suspect.then(|| SuspectMarker {
            id: self.id,
            share: self.share(),
            lasted_s: self
                .run
                .as_ref()
                .map_or(0.0, |run| self.latest_s - run.since_s),
        })
    }
}

/// Markers with recent exclusions; usually empty.
#[derive(Debug, Default)]
pub(super) struct Suspects {
    records: Vec<Record>,
}

impl Suspects {
    /// Updates with the outcome of a frame with a fit, trusted or not.
    pub(super) fn take(&mut self, stamp: Stamp, outcome: &FrameOutcome, solution: &Solution) {
        let in_question = solution.excluded.ids().chain(solution.unclear.ids());
        for id in in_question {
            if !self.records.iter().any(|record| record.id == id) {
                self.records.push(Record {
                    id,
                    latest_s: stamp.seconds(),
                    seen: 0.0,
                    left_out: 0.0,
                    run: None,
                    is_suspect: false,
                });
            }
        }
        if self.records.is_empty() {
            return;
        }
        for record in &mut self.records {
            if !shows(outcome, record.id) {
                continue;
            }
            let left_out = if solution.excluded.contains(record.id) {
                1.0
            } else if solution.unclear.contains(record.id) {
                EITHER
            } else {
                0.0
            };
            record.take(left_out, stamp.seconds());
        }
        self.records.retain(|record| !record.is_forgotten());
    }

    /// Refuses the pose of a frame that shows a suspect marker.
    pub(super) fn judge(&self, outcome: FrameOutcome) -> FrameOutcome {
        let shown = self.iter().filter(|suspect| shows(&outcome, suspect.id));
        match shown.max_by(|a, b| a.share.total_cmp(&b.share)) {
            Some(worst) => outcome.refused_for(Refusal::SuspectMarker(worst)),
            None => outcome,
        }
    }

    /// Returns the current suspects.
    pub(super) fn iter(&self) -> impl Iterator<Item = SuspectMarker> {
        self.records.iter().filter_map(Record::suspect)
    }

    pub(super) fn forget(&mut self) {
        self.records.clear();
    }
}

/// Returns whether a frame shows a marker to the solver, that is, not at the edge of the image.
fn shows(outcome: &FrameOutcome, id: u32) -> bool {
    let excludes = |solution: &Solution| solution.excluded.contains(id);
    outcome.used_ids.contains(&id) || outcome.solution().is_some_and(excludes)
}
