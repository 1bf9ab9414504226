//! What one frame's pose is protected to, or why not.

use super::hypotheses::{Beacon, Hypothesis};
use crate::camera::Camera;
use crate::estimation::{Estimator, Observation, Solution};
use crate::target::MarkerMap;

/// Axes of the receiver, in the order of all levels.
pub(super) const AXES: [&str; 3] = ["ahead", "lateral", "vertical"];

/// A solution with all that it came from.
#[derive(Debug, Clone, Copy)]
pub struct SolvedFrame<'a> {
    /// That found it.
    pub estimator: &'a Estimator,
    /// Tells which points are corners of one tag; without one each is a beacon of its own.
    pub map: Option<&'a MarkerMap>,
    /// That saw the points.
    pub camera: &'a Camera,
    /// Those that the solution was estimated from, with those that it left out.
    pub observations: &'a [Observation],
    /// What is to be judged.
    pub solution: &'a Solution,
}

/// The levels of one frame.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameIntegrity {
    /// In the order in which they were declared.
    pub points: Vec<PointIntegrity>,
    /// Probability of everything that no hypothesis covers: more faults at once than are monitored, faults that the
    /// other beacons could not show, and the second pose.
    pub unmonitored_probability: f64,
    /// The level that exceeds its alert limit by the largest factor; `None`: all limits are kept.
    pub above_limit: Option<AboveLimit>,
}

/// A level beyond its alert limit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AboveLimit {
    /// Index of the point.
    pub point: usize,
    /// 0 ahead, 1 lateral, 2 vertical.
    pub axis: usize,
    /// m.
    pub level_m: f64,
    /// m.
    pub limit_m: f64,
    /// The hypothesis with the largest part in the level; `None`: noise and budget alone.
    pub weakest: Option<Hypothesis>,
}

impl AboveLimit {
    /// Returns it in words.
    ///
    /// # Inputs
    /// * `point`: the point's name.
    /// * `mode`: names a mode of the budget by its place.
    #[must_use]
    pub fn in_words(&self, point: &str, mode: impl Fn(usize) -> String) -> String {
        let because = self.weakest.map_or_else(String::new, |weakest| {
            format!(", mostly because {} may be faulty", weakest.in_words(mode))
        });
        format!(
            "the {} protection level of {point} is {:.3} m, allowed is {} m{because}",
            AXES[self.axis], self.level_m, self.limit_m
        )
    }
}

/// The levels of one point, ahead, lateral and vertical in the receiver's axes, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointIntegrity {
    /// Protection levels.
    pub level_m: [f64; 3],
    /// Standard deviations without a fault, mount and point included.
    pub sigma_m: [f64; 3],
    /// The hypothesis with the largest part in each level; `None`: noise and budget alone.
    pub weakest: [Option<Hypothesis>; 3],
}

/// Why there is no level.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Unavailable {
    /// The frame has no trusted pose.
    #[error("no trusted pose")]
    NoPose,
    /// Not the maximum likelihood estimate, whose errors are known.
    #[error("protection levels need refinement maximum_likelihood")]
    NotMaximumLikelihood,
    /// The pose cannot be linearised.
    #[error("the points do not determine the pose well enough for protection levels")]
    Singular,
    /// There is no track.
    #[error("no track")]
    NoTrack,
    /// A frame that has shaped the track has no separations.
    #[error(
        "a frame of the track could not be linearised: there are levels again when a track begins anew"
    )]
    TrackNotFollowed,
    /// More hypotheses than are followed.
    #[error(
        "the track has more beacons and causes of error than protection levels are computed for"
    )]
    TooManyHypotheses,
    /// A fault is visible.
    #[error(
        "{}",
        self.in_words(|index| format!("mode {index} of the budget"))
    )]
    Fault {
        /// What may be faulty.
        hypothesis: Hypothesis,
        /// 0 ahead, 1 lateral, 2 vertical.
        axis: usize,
        /// m.
        separation_m: f64,
        /// m.
        threshold_m: f64,
    },
    /// Too much is not monitored.
    #[error(
        "unmonitored faults have a probability of {probability:.1e}, {allowed:.1e} are allowed: {}",
        reason.in_words()
    )]
    Unmonitored {
        /// Of all of it.
        probability: f64,
        /// The risk.
        allowed: f64,
        /// The largest part.
        reason: Unmonitored,
    },
}

/// The largest part of what is not monitored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unmonitored {
    /// More faulty beacons at once than are monitored.
    Several,
    /// The points without the suspects are too few, or allow a second pose.
    TooFewPoints,
    /// The second pose.
    SecondPose,
}

impl Unavailable {
    /// Returns it in words, with the names of the budget's modes.
    ///
    /// # Inputs
    /// * `mode`: names a mode of the budget by its place.
    #[must_use]
    pub fn in_words(&self, mode: impl Fn(usize) -> String) -> String {
        match *self {
            Self::Fault {
                hypothesis,
                axis,
                separation_m,
                threshold_m,
            } => format!(
                "the beacons contradict each other: without {} the estimate is {separation_m:.3} m elsewhere ({}), \
                 allowed are {threshold_m:.3} m",
                hypothesis.in_words(mode),
                AXES[axis]
            ),
            other => other.to_string(),
        }
    }
}

impl Unmonitored {
    fn in_words(self) -> &'static str {
        match self {
            Self::Several => "more beacons may fail at once than are monitored",
            Self::TooFewPoints => "without the suspects the other points do not fix one pose",
            Self::SecondPose => "the image nearly allows a second pose",
        }
    }
}

impl Hypothesis {
    /// Returns it in words.
    ///
    /// # Inputs
    /// * `mode`: names a mode of the budget by its place.
    #[must_use]
    pub fn in_words(self, mode: impl Fn(usize) -> String) -> String {
        match self {
            Self::Marker(id) => Beacon::Marker(id).to_string(),
            Self::Tag(id) => Beacon::Tag(id).to_string(),
            Self::Pair(one, other) => format!("{one} and {other}"),
            Self::Mode(index) => mode(index),
        }
    }
}
