//! All hypotheses about a track, which follow its filter.

use nalgebra::Vector6;
use smallvec::SmallVec;

use super::frame::{CauseKey, FrameSeparations, Suspects};
use super::hypothesis::{Passage, PassingCause, Seen, Separated};
use super::left_out::Weighing;
use crate::geometry::{Matrix12, Vector12};
use crate::integrity::hypotheses::{Beacon, Hypothesis};
use crate::tracking::{Follower, Matrix12x6, Step};

/// Numbers that a track may keep: those of 16 beacons with pairs and a survey error each. The filter keeps as many for
/// each frame of half a second.
const MOST_NUMBERS: usize = 200_000;

/// Why hypotheses about a track are not followed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Lost {
    /// A frame that has shaped the track was not linearised.
    Frame,
    /// There are too many.
    TooMany,
}

/// A lasting cause of the track's error.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct TrackCause {
    key: CauseKey,
    time_constant_s: Option<f64>,
    /// `V`.
    pub(super) by: Vector12,
}

/// The track in use minus the one without some suspects, in the order of [`Motion`](crate::geometry::Motion).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackSeparation {
    /// Of the two motions.
    pub difference: Vector12,
    /// Its covariance without a fault.
    pub covariance: Matrix12,
    /// By which the covariance of the track without the suspects is larger than that of the track in use.
    pub more: Matrix12,
}

/// The track without the suspects of each hypothesis, beside the one in use.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TrackSeparations {
    pub(super) lost: Option<Lost>,
    /// All that a frame of the track has had.
    pub(super) beacons: Vec<Beacon>,
    has_pairs: bool,
    pub(super) flex_modes: usize,
    pub(super) all_modes: usize,
    pub(super) causes: Vec<TrackCause>,
    /// By places of beacons.
    pub(super) hypotheses: Vec<(Suspects, Separated)>,
    pub(super) weighing: Weighing,
}

impl TrackSeparations {
    /// Returns what suspects are.
    pub(super) fn hypothesis(&self, suspects: Suspects) -> Hypothesis {
        match suspects {
            Suspects::One(at) => self.beacons[at].into(),
            Suspects::Two(one, other) => Hypothesis::Pair(self.beacons[one], self.beacons[other]),
            Suspects::Mode(mode) => Hypothesis::Mode(mode),
        }
    }

    /// Returns how far the track is from the one without the suspects of a hypothesis; `None` where there is none.
    #[must_use]
    pub fn separation(&self, hypothesis: &Hypothesis) -> Option<TrackSeparation> {
        let is_it = |suspects: Suspects| match (self.hypothesis(suspects), *hypothesis) {
            (Hypothesis::Pair(a, b), Hypothesis::Pair(c, d)) => {
                (a, b) == (c, d) || (a, b) == (d, c)
            }
            (one, other) => one == other,
        };
        let (_, found) = self.hypotheses.iter().find(|(of, _)| is_it(*of))?;
        let mut separation = TrackSeparation {
            difference: found.difference,
            covariance: found.new,
            more: found.more,
        };
        for (by, cause) in found.by_cause.iter().zip(&self.causes) {
            separation.covariance.ger(1.0, by, by, 1.0);
            separation.more.ger(1.0, by, &(by + cause.by), 1.0);
            separation.more.ger(1.0, &cause.by, by, 1.0);
        }
        found.is_known().then_some(separation)
    }

    fn lose(&mut self, why: Lost) {
        *self = Self {
            lost: Some(why),
            ..Self::default()
        };
    }

    /// Takes the beacons of another, and those of a frame that it has not had.
    fn take_beacons(&mut self, before: &Self, frame: &FrameSeparations) {
        self.beacons.clear();
        self.beacons.extend_from_slice(&before.beacons);
        for beacon in &frame.beacons {
            if !self.beacons.contains(beacon) {
                self.beacons.push(*beacon);
            }
        }
        self.has_pairs = frame.has_pairs;
        self.flex_modes = frame.flex_modes;
        self.all_modes = frame.all_modes;
    }

    /// Returns all hypotheses about the beacons, and about the modes of a frame.
    fn suspects<'a>(&self, frame: &'a FrameSeparations) -> impl Iterator<Item = Suspects> + 'a {
        let (count, has_pairs) = (self.beacons.len(), self.has_pairs);
        let of_beacons = (0..count).flat_map(move |one| {
            let pairs = (0..one).take_while(move |_| has_pairs);
            std::iter::once(Suspects::One(one))
                .chain(pairs.map(move |other| Suspects::Two(other, one)))
        });
        let modes = frame.modes.iter().map(|mode| Suspects::Mode(*mode));
        of_beacons.chain(modes)
    }

    /// Returns where each beacon is in a frame.
    fn places(&self, frame: &FrameSeparations) -> SmallVec<[Option<usize>; 16]> {
        let of_frame = |beacon: &Beacon| frame.beacons.iter().position(|of| of == beacon);
        self.beacons.iter().map(of_frame).collect()
    }

    /// Returns whether so many hypotheses can be followed.
    fn has_room(&self) -> bool {
        let beacons = self.beacons.len();
        let pairs = if self.has_pairs {
            beacons * beacons / 2
        } else {
            0
        };
        (beacons + pairs) * (300 + 12 * self.causes.len()) <= MOST_NUMBERS
    }
}

/// Returns what a frame says without suspects.
fn seen<'a>(frame: &'a FrameSeparations, places: &[Option<usize>], suspects: Suspects) -> Seen<'a> {
    let of_frame = match suspects {
        Suspects::One(at) => places[at].map(Suspects::One),
        Suspects::Two(one, other) => match (places[one], places[other]) {
            (Some(one), Some(other)) => Some(Suspects::Two(one.min(other), one.max(other))),
            (Some(one), None) | (None, Some(one)) => Some(Suspects::One(one)),
            (None, None) => None,
        },
        Suspects::Mode(mode) => Some(Suspects::Mode(mode)),
    };
    match of_frame {
        None => Seen::Same,
        Some(of_frame) => frame.effect(of_frame).map_or(Seen::Nothing, Seen::Pose),
    }
}

impl Follower for TrackSeparations {
    type Input = Option<FrameSeparations>;

    fn begin(&mut self, input: &Self::Input) {
        let Some(frame) = input else {
            self.lose(Lost::Frame);
            return;
        };
        *self = Self::default();
        self.take_beacons(&Self::default(), frame);
        let mut of_measured = Matrix12x6::zeros();
        of_measured.fill_diagonal(1.0);
        self.causes = frame
            .causes
            .iter()
            .map(|cause| TrackCause {
                key: cause.key,
                time_constant_s: cause.time_constant_s,
                by: of_measured * cause.shift,
            })
            .collect();
        if !self.has_room() {
            self.lose(Lost::TooMany);
            return;
        }
        let places = self.places(frame);
        self.hypotheses = self
            .suspects(frame)
            .map(|suspects| (suspects, Separated::begin(seen(frame, &places, suspects))))
            .collect();
        self.weighing.begin(frame);
    }

    fn follow(&mut self, before: &Self, step: &Step, input: &Self::Input) {
        if let Some(why) = before.lost {
            self.lose(why);
            return;
        }
        let Some(frame) = input else {
            self.lose(Lost::Frame);
            return;
        };
        self.lost = None;
        self.take_beacons(before, frame);
        let passage = Passage {
            step,
            kept: step.kept(),
            of_measured: step.of_measured(),
        };
        let passing = self.take_causes(before, &passage, frame);
        if !self.has_room() {
            self.lose(Lost::TooMany);
            return;
        }
        let places = self.places(frame);
        let all: Vec<Suspects> = self.suspects(frame).collect();
        self.hypotheses
            .resize_with(all.len(), || (Suspects::One(0), Separated::none()));
        let find = |suspects: Suspects| {
            let found = before.hypotheses.iter().find(|(of, _)| *of == suspects);
            found.map(|(_, separated)| separated)
        };
        let known = before.beacons.len();
        let (none, unknown) = (Separated::none(), Separated::unknown());
        let same_place = before
            .hypotheses
            .iter()
            .map(Some)
            .chain(std::iter::repeat(None));
        for ((after, suspects), before) in self.hypotheses.iter_mut().zip(all).zip(same_place) {
            // A beacon that is new has had no part in what was before; in a pair only the other one has had.
            let from = match (before, suspects) {
                (Some((of, separated)), _) if *of == suspects => separated,
                (_, Suspects::One(at)) if at >= known => &none,
                (_, Suspects::Two(one, other)) if other >= known => {
                    find(Suspects::One(one)).unwrap_or(&none)
                }
                _ => find(suspects).unwrap_or(&unknown),
            };
            after.0 = suspects;
            let seen = seen(frame, &places, suspects);
            after.1.follow(from, &passage, &passing, seen);
        }
        self.weighing.follow(&before.weighing, &passage, frame);
    }
}

impl TrackSeparations {
    /// Takes the causes of another through a frame, and those that the frame has first.
    fn take_causes(
        &mut self,
        before: &Self,
        passage: &Passage,
        frame: &FrameSeparations,
    ) -> Vec<PassingCause> {
        self.causes.clear();
        let mut passing = Vec::with_capacity(before.causes.len());
        let mut take = |known: Option<&TrackCause>, in_frame: Option<usize>| {
            let of_frame = in_frame.map(|at| &frame.causes[at]);
            let Some((key, time_constant_s)) = known
                .map(|cause| (cause.key, cause.time_constant_s))
                .or_else(|| of_frame.map(|cause| (cause.key, cause.time_constant_s)))
            else {
                return;
            };
            let shift = of_frame.map_or_else(Vector6::zeros, |cause| cause.shift);
            let before = known.map_or_else(Vector12::zeros, |cause| cause.by);
            let lasts = time_constant_s.map_or(1.0, |s| (-passage.step.seconds() / s).exp());
            let passed = passage.kept * before;
            let after = passed * lasts + passage.of_measured * shift;
            passing.push(PassingCause {
                lasts,
                in_frame,
                shift,
                before,
                passed,
                after,
            });
            self.causes.push(TrackCause {
                key,
                time_constant_s,
                by: after,
            });
        };
        let mut hint = 0;
        for cause in &before.causes {
            let is_it = |at: &usize| frame.causes.get(*at).is_some_and(|of| of.key == cause.key);
            let at = Some(hint).filter(is_it);
            let at = at.or_else(|| (0..frame.causes.len()).find(is_it));
            hint = at.map_or(hint, |at| at + 1);
            take(Some(cause), at);
        }
        for (at, cause) in frame.causes.iter().enumerate() {
            if !before.causes.iter().any(|of| of.key == cause.key) {
                take(None, Some(at));
            }
        }
        passing
    }
}
