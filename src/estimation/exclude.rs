//! Wrong detections: leave out as few points as it takes for the rest to agree.
//!
//! With six points, estimators that only weigh large residuals down (Huber, Cauchy, graduated
//! non-convexity) have too little to go by. All subsets without one point, then all without two, are
//! few enough to be solved one by one, each from the prior, and judged by the chi-squared test of the
//! remainder. Two exchanged ids are a hypothesis of their own: it keeps all points, so its test has
//! four more degrees of freedom than that of two exclusions and tells the right pair more surely. The
//! pose then still rests on the other points alone: data that had to be corrected are not flown.
//!
//! The best subset is not enough. Two points that pull the pose the same way can stand for one another, and the
//! wrong one of them left out is a wrong pose that passes. So a point is left out only if no other choice of as many
//! points explains the frame within a likelihood ratio of 1000; else the frame is refused as unclear.

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
/// Difference of two costs below which either choice may be the right one: a likelihood ratio of 1000.
const INDISTINCT: f64 = 13.8;
/// Points beyond those that must remain from which on two wrong ones can be distinguished from one: with a prior, eight points.
const SPARE_TO_CHECK_PAIRS: usize = 4;
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

/// What a search came to.
#[expect(
    clippy::large_enum_variant,
    reason = "a box would allocate, and a frame has one of these"
)]
pub(crate) enum Found {
    /// The pose without the points that are wrong.
    Solution(Solution),
    /// Leaving out either of these explains the frame: something is wrong, and it is not clear what.
    Unclear(Excluded),
    /// No hypothesis passes.
    Nothing,
}

impl<S, P> Judge<S, P>
where
    S: Fn(&[Observation]) -> Result<Solution, EstimateError>,
    P: Fn(&Solution) -> f64,
{
    /// Returns a hypothesis if its points have a pose that counts. What a sure prior excludes does not; with another
    /// prior it is a rival, but is not chosen.
    fn judged(&self, left_out: [usize; 2], solution: &Solution) -> Option<Hypothesis> {
        let cost = solution.chi_squared + (self.prior_cost)(solution);
        let is_plausible = cost.is_finite();
        (is_plausible || !self.is_prior_sure).then(|| Hypothesis {
            cost: if is_plausible {
                cost
            } else {
                solution.chi_squared
            },
            chi_squared: solution.chi_squared,
            passes: solution.is_trusted(),
            is_plausible,
            left_out,
            camera_from_tanker: solution.camera_from_tanker,
        })
    }
}

/// Leaves out the fewest points, at most `max_outliers`, for the rest to pass the test; a point is left out only if no
/// other choice of as many explains the frame nearly as well.
///
/// `suspects` are indices of the points that may be left out.
pub(crate) fn search<S, P>(
    judge: &Judge<S, P>,
    observations: &[Observation],
    suspects: &[usize],
    max_outliers: usize,
) -> Found
where
    S: Fn(&[Observation]) -> Result<Solution, EstimateError>,
    P: Fn(&Solution) -> f64,
{
    let spare = observations.len().saturating_sub(judge.min_remaining);
    let mut scratch = Subset::new();
    if max_outliers >= 1 && spare >= 1 {
        let singles = suspects.iter().map(|&i| [i, i]);
        let found = best(judge, observations, &mut scratch, singles, None);
        match found {
            Found::Nothing => {}
            Found::Solution(single) if spare >= SPARE_TO_CHECK_PAIRS => {
                return match better_pair(judge, observations, &mut scratch, suspects, &single) {
                    Some(pair) => Found::Unclear(pair),
                    None => Found::Solution(single),
                };
            }
            found => return found,
        }
    }
    if max_outliers < 2 || spare < 2 {
        return Found::Nothing;
    }
    let pairs = || {
        suspects
            .iter()
            .enumerate()
            .flat_map(|(at, &i)| suspects[at + 1..].iter().map(move |&j| [i, j]))
    };
    let exchanges: SmallVec<[Hypothesis; MAX_PAIRS]> = pairs()
        .filter_map(|pair| {
            scratch.clear();
            scratch.extend_from_slice(observations);
            let [i, j] = pair;
            (scratch[i].pixel, scratch[j].pixel) = (observations[j].pixel, observations[i].pixel);
            (scratch[i].sigma_px, scratch[j].sigma_px) =
                (observations[j].sigma_px, observations[i].sigma_px);
            judge.judged(pair, &(judge.solve)(&scratch).ok()?)
        })
        .collect();
    let exchange = least(&exchanges).filter(|first| rival_choice(&exchanges, first).is_none());
    let preferred = exchange.map(|first| first.left_out);
    best(judge, observations, &mut scratch, pairs(), preferred)
}

/// Returns two points that explain the frame better than the one that a solution leaves out, if both are wrong: two
/// reflections of the same shift agree with each other, and a healthy point can look wrong beside them. That two are
/// wrong is as much less likely than one as [`INDISTINCT`] says, so their rest must fit better than that of the one.
fn better_pair<S, P>(
    judge: &Judge<S, P>,
    observations: &[Observation],
    scratch: &mut Subset,
    suspects: &[usize],
    single: &Solution,
) -> Option<Excluded>
where
    S: Fn(&[Observation]) -> Result<Solution, EstimateError>,
    P: Fn(&Solution) -> f64,
{
    let least = single.chi_squared + (judge.prior_cost)(single);
    let others = suspects
        .iter()
        .filter(|&&i| !single.excluded.contains(observations[i].id));
    others.clone().enumerate().find_map(|(at, &i)| {
        others.clone().skip(at + 1).find_map(|&j| {
            keep_others(observations, [i, j], scratch);
            let hypothesis = judge.judged([i, j], &(judge.solve)(scratch).ok()?)?;
            let is_better = hypothesis.passes && hypothesis.cost < least;
            is_better.then(|| Excluded([Some(observations[i].id), Some(observations[j].id)]))
        })
    })
}

/// Puts all points but two into `scratch`; the same index twice leaves out one.
fn keep_others(observations: &[Observation], [i, j]: [usize; 2], scratch: &mut Subset) {
    scratch.clear();
    let remaining = observations
        .iter()
        .enumerate()
        .filter(|(k, _)| *k != i && *k != j);
    scratch.extend(remaining.map(|(_, seen)| *seen));
}

/// A hypothesis about what is wrong, with the pose of the rest.
struct Hypothesis {
    /// Chi-squared and what the prior holds against the pose.
    cost: f64,
    chi_squared: f64,
    /// Whether the rest passes the test.
    passes: bool,
    /// Whether the prior allows the pose.
    is_plausible: bool,
    left_out: [usize; 2],
    camera_from_tanker: Isometry3<f64>,
}

/// Returns the hypothesis with the least cost of those that may be chosen.
fn least(hypotheses: &[Hypothesis]) -> Option<&Hypothesis> {
    hypotheses
        .iter()
        .filter(|hypothesis| hypothesis.passes && hypothesis.is_plausible)
        .min_by(|a, b| a.cost.total_cmp(&b.cost))
}

/// Returns the best other choice that explains the frame nearly as well, whether or not its rest passes the test.
fn rival_choice<'a>(hypotheses: &'a [Hypothesis], first: &Hypothesis) -> Option<&'a Hypothesis> {
    hypotheses
        .iter()
        .filter(|other| other.left_out != first.left_out && other.cost < first.cost + INDISTINCT)
        .min_by(|a, b| a.cost.total_cmp(&b.cost))
}

/// The choice with the least cost among those that leave out one of these pairs (the same index twice: one point), or
/// the preferred one if its rest passes. Another pose that passes is its rival; how likely that is, is the image's to
/// say.
fn best<S, P>(
    judge: &Judge<S, P>,
    observations: &[Observation],
    scratch: &mut Subset,
    choices: impl Iterator<Item = [usize; 2]>,
    preferred: Option<[usize; 2]>,
) -> Found
where
    S: Fn(&[Observation]) -> Result<Solution, EstimateError>,
    P: Fn(&Solution) -> f64,
{
    let mut solve = |left_out: [usize; 2]| {
        keep_others(observations, left_out, scratch);
        (judge.solve)(scratch).ok()
    };
    let hypotheses: SmallVec<[Hypothesis; MAX_PAIRS]> = choices
        .filter_map(|left_out| judge.judged(left_out, &solve(left_out)?))
        .collect();
    let may_be_chosen = |hypothesis: &&Hypothesis| {
        Some(hypothesis.left_out) == preferred && hypothesis.passes && hypothesis.is_plausible
    };
    let is_preferred = hypotheses.iter().find(may_be_chosen);
    let Some(first) = is_preferred.or_else(|| least(&hypotheses)) else {
        return Found::Nothing;
    };
    if is_preferred.is_none()
        && let Some(other) = rival_choice(&hypotheses, first)
    {
        return Found::Unclear(between(observations, first, other));
    }
    // Solved once more: cheaper than to keep every solution.
    let [i, j] = first.left_out;
    let Some(mut best) = solve(first.left_out) else {
        return Found::Nothing;
    };
    let second = (j != i).then(|| observations[j].id);
    best.excluded = Excluded([Some(observations[i].id), second]);
    let rival = hypotheses
        .iter()
        .filter(|other| other.passes && is_elsewhere(&best, &other.camera_from_tanker))
        .min_by(|a, b| a.chi_squared.total_cmp(&b.chi_squared));
    if let Some(rival) = rival {
        let ratio = likelihood_ratio(rival.chi_squared, first.chi_squared);
        best.ambiguity = best.ambiguity.max(ratio);
    }
    Found::Solution(best)
}

/// Returns a point of each of two choices, those in which they differ.
fn between(observations: &[Observation], first: &Hypothesis, other: &Hypothesis) -> Excluded {
    let only_in = |a: &Hypothesis, b: &Hypothesis| {
        let point = a.left_out.iter().find(|i| !b.left_out.contains(i));
        point.map(|&i| observations[i].id)
    };
    Excluded([only_in(first, other), only_in(other, first)])
}

fn is_elsewhere(best: &Solution, other: &Isometry3<f64>) -> bool {
    let error = pose_error(other, &best.camera_from_tanker);
    best.covariance
        .mahalanobis_squared(&error)
        .is_none_or(|distance| distance > ELSEWHERE)
}
