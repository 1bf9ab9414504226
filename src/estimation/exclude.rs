//! Wrong detections: leave out as few points as it takes for the rest to agree.
//!
//! With six points, estimators that only weigh large residuals down (Huber, Cauchy, graduated
//! non-convexity) have too little to go by. All subsets without one point, then all without two, are
//! few enough to be solved one by one, each from the prior, and judged by the chi-squared test of the
//! remainder. Two exchanged ids are a hypothesis of their own: it keeps all points, so its test has
//! four more degrees of freedom than that of two exclusions and tells the right pair more surely. The
//! pose then still rests on the other points alone: data that had to be corrected are not flown.

use nalgebra::Isometry3;
use smallvec::SmallVec;

use super::ambiguity::likelihood_ratio;
use super::lanes::points::INLINE_POINTS;
use super::{EstimateError, Excluded, Observation, Solution};
use crate::geometry::pose_error;

/// Returns how many points are suspected at most: those with the largest residuals, so that the cost
/// stays bounded. Among many points a gross error hardly moves the fit of all, and stands out.
pub(crate) const fn max_suspects(points: usize) -> usize {
    if points <= 64 { MAX_SUSPECTS } else { 4 }
}
const MAX_SUSPECTS: usize = 12;
const MAX_PAIRS: usize = MAX_SUSPECTS * (MAX_SUSPECTS - 1) / 2;
/// Indices of points that may be left out.
pub(crate) type Suspects = SmallVec<[usize; MAX_SUSPECTS]>;
/// Some of the points; in place unless they are many.
type Subset = SmallVec<[Observation; INLINE_POINTS]>;
/// Points that must remain where a prior says what is plausible: fewer leave nothing to judge by.
pub(crate) const MIN_REMAINING_WITH_PRIOR: usize = 4;
/// Points that must remain where nothing does: any four fit some attitude too often. Left and right
/// exchanged on the whole of a symmetric tanker would pass with two more points left out.
pub(crate) const MIN_REMAINING_WITHOUT_PRIOR: usize = 5;
/// Squared Mahalanobis distance at which two hypotheses disagree: no correct pair of poses with most
/// of their points in common is so far apart.
const ELSEWHERE: f64 = 30.0;

/// How the points of a hypothesis are solved, and how hypotheses are ranked.
pub(crate) struct Judge<S, P> {
    /// The pose of some points, judged.
    pub(crate) solve: S,
    /// What the prior holds against a pose: a squared distance in sigmas, added to chi-squared.
    pub(crate) prior_cost: P,
    /// Points that must remain.
    pub(crate) min_remaining: usize,
    /// Whether what the prior excludes is excluded. If the prior may be wrong itself, such poses are not
    /// chosen, but they still are rivals.
    pub(crate) is_prior_sure: bool,
}

impl<S, P> Judge<S, P>
where
    S: Fn(&[Observation]) -> Result<Solution, EstimateError>,
    P: Fn(&Solution) -> f64,
{
    fn trusted(&self, observations: &[Observation]) -> Option<Solution> {
        (self.solve)(observations).ok().filter(|solution| {
            solution.is_trusted() && (!self.is_prior_sure || self.cost(solution).is_finite())
        })
    }

    fn cost(&self, solution: &Solution) -> f64 {
        solution.chi_squared + (self.prior_cost)(solution)
    }
}

/// Returns the trusted solution that leaves out the fewest points, at most `max_outliers`; none when
/// no hypothesis passes.
///
/// `suspects` are indices of the points that may be left out.
pub(crate) fn search<S, P>(
    judge: &Judge<S, P>,
    observations: &[Observation],
    suspects: &[usize],
    max_outliers: usize,
) -> Option<Solution>
where
    S: Fn(&[Observation]) -> Result<Solution, EstimateError>,
    P: Fn(&Solution) -> f64,
{
    let spare = observations.len().saturating_sub(judge.min_remaining);
    let mut scratch = Subset::new();
    if max_outliers >= 1 && spare >= 1 {
        let singles = suspects.iter().map(|&i| [i, i]);
        let solution = best(judge, observations, &mut scratch, singles, None);
        if solution.is_some() {
            return solution;
        }
    }
    if max_outliers < 2 || spare < 2 {
        return None;
    }
    let pairs = || {
        suspects
            .iter()
            .enumerate()
            .flat_map(|(at, &i)| suspects[at + 1..].iter().map(move |&j| [i, j]))
    };
    let exchange = pairs()
        .filter_map(|pair| {
            scratch.clear();
            scratch.extend_from_slice(observations);
            let [i, j] = pair;
            (scratch[i].pixel, scratch[j].pixel) = (observations[j].pixel, observations[i].pixel);
            (scratch[i].sigma_px, scratch[j].sigma_px) =
                (observations[j].sigma_px, observations[i].sigma_px);
            let solution = judge.trusted(&scratch)?;
            Some((judge.cost(&solution), pair))
        })
        .filter(|(cost, _)| cost.is_finite())
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, pair)| pair);
    best(judge, observations, &mut scratch, pairs(), exchange)
}

/// A hypothesis that passed.
struct Passed {
    cost: f64,
    chi_squared: f64,
    left_out: [usize; 2],
    camera_from_tanker: Isometry3<f64>,
}

/// The trusted solution with the least cost among those that leave out one of these pairs (the same index
/// twice: one point), or the preferred one if it is trusted. Another one that says something else is its
/// rival; how likely that is, is the image's to say.
fn best<S, P>(
    judge: &Judge<S, P>,
    observations: &[Observation],
    scratch: &mut Subset,
    hypotheses: impl Iterator<Item = [usize; 2]>,
    preferred: Option<[usize; 2]>,
) -> Option<Solution>
where
    S: Fn(&[Observation]) -> Result<Solution, EstimateError>,
    P: Fn(&Solution) -> f64,
{
    let mut solve = |[i, j]: [usize; 2]| {
        scratch.clear();
        let remaining = observations
            .iter()
            .enumerate()
            .filter(|(k, _)| *k != i && *k != j);
        scratch.extend(remaining.map(|(_, seen)| *seen));
        judge.trusted(scratch)
    };
    let passed: SmallVec<[Passed; MAX_PAIRS]> = hypotheses
        .filter_map(|left_out| {
            let solution = solve(left_out)?;
            Some(Passed {
                cost: judge.cost(&solution),
                chi_squared: solution.chi_squared,
                left_out,
                camera_from_tanker: solution.camera_from_tanker,
            })
        })
        .collect();
    let plausible = || passed.iter().filter(|passed| passed.cost.is_finite());
    let first = plausible()
        .find(|passed| Some(passed.left_out) == preferred)
        .or_else(|| plausible().min_by(|a, b| a.cost.total_cmp(&b.cost)))?;
    // Solved once more: cheaper than to keep every solution.
    let [i, j] = first.left_out;
    let mut best = solve(first.left_out)?;
    let second = (j != i).then(|| observations[j].id);
    best.excluded = Excluded([Some(observations[i].id), second]);
    let rival = passed
        .iter()
        .filter(|other| is_elsewhere(&best, &other.camera_from_tanker))
        .min_by(|a, b| a.chi_squared.total_cmp(&b.chi_squared));
    if let Some(rival) = rival {
        let ratio = likelihood_ratio(rival.chi_squared, first.chi_squared);
        best.ambiguity = best.ambiguity.max(ratio);
    }
    Some(best)
}

fn is_elsewhere(best: &Solution, other: &Isometry3<f64>) -> bool {
    let error = pose_error(other, &best.camera_from_tanker);
    best.covariance
        .mahalanobis_squared(&error)
        .is_none_or(|distance| distance > ELSEWHERE)
}
