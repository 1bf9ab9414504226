//! Exclusion of wrong detections: as few points as necessary for the rest to agree.
//!
//! With six points, estimators that reduce the weight of large residuals (Huber, Cauchy, graduated non-convexity) have
//! too little redundancy. The subsets without one point, then those without two, are few enough to be solved one by
//! one, each from the prior, and judged by the chi-squared test of the remaining points. Two exchanged ids are a
//! hypothesis of their own: it keeps all points, so its test has four more degrees of freedom than that of two
//! exclusions and identifies the pair more reliably. The pose is still computed from the other points only: corrected
//! data are not used for flight.
//!
//! Taking the best subset is not sufficient. If two points pull the pose in the same direction, excluding either may
//! explain the frame, and excluding the wrong one gives a wrong pose that passes. So a point is excluded only if no
//! other choice of as many points explains the frame within a likelihood ratio of 1000; otherwise the frame is refused
//! as unclear.

use nalgebra::Isometry3;
use smallvec::SmallVec;

use super::ambiguity::likelihood_ratio;
use super::lanes::points::INLINE_POINTS;
use super::{EstimateError, Excluded, Observation, Solution};
use crate::geometry::pose_error;

/// Returns the largest number of suspected points: those with the largest residuals, so that the cost is bounded. Among
/// many points a gross error hardly changes the fit and has a large residual.
pub(crate) const fn max_suspects(points: usize) -> usize {
    if points <= 64 { MAX_SUSPECTS } else { 4 }
}
const MAX_SUSPECTS: usize = 12;
const MAX_PAIRS: usize = MAX_SUSPECTS * (MAX_SUSPECTS - 1) / 2;
/// Indices of points that may be excluded.
pub(crate) type Suspects = SmallVec<[usize; MAX_SUSPECTS]>;
/// Some of the points; on the stack unless they are many.
type Subset = SmallVec<[Observation; INLINE_POINTS]>;
/// Points that must remain if a prior determines what is plausible; with fewer there is no redundancy.
pub(crate) const MIN_REMAINING_WITH_PRIOR: usize = 4;
/// Points that must remain without a prior: any four fit some attitude too often. Detections that are left-right
/// exchanged on a symmetric tanker would pass with two further points excluded.
pub(crate) const MIN_REMAINING_WITHOUT_PRIOR: usize = 5;
/// Difference of two costs below which both choices are plausible: a likelihood ratio of 1000.
const INDISTINCT: f64 = 13.8;
/// Points beyond those that must remain from which on two wrong ones can be distinguished from one: eight points in
/// total with a prior.
const SPARE_TO_CHECK_PAIRS: usize = 4;
/// Squared Mahalanobis distance above which two poses are different: correct poses that share most of their points are
/// never so far apart.
const ELSEWHERE: f64 = 30.0;

/// How the points of a hypothesis are solved, and how hypotheses are ranked.
pub(crate) struct Judge<S, P> {
    /// Solves for the pose of some points, judged.
    pub(crate) solve: S,
    /// The cost of a pose under the prior: a squared distance in sigmas, added to chi-squared.
    pub(crate) prior_cost: P,
    /// Points that must remain.
    pub(crate) min_remaining: usize,
    /// Whether poses that the prior rules out are discarded. If the prior may itself be wrong, such poses are not
    /// chosen, but they still count as rivals.
    pub(crate) is_prior_sure: bool,
}

/// Result of a search.
#[expect(
    clippy::large_enum_variant,
    reason = "a box would allocate, and a frame has one of these"
)]
pub(crate) enum Found {
    /// The pose without the wrong points.
    Solution(Solution),
    /// Excluding either of these explains the frame: a detection is wrong, but it is not clear which.
    Unclear(Excluded),
    /// No hypothesis passes.
    Nothing,
}

impl<S, P> Judge<S, P>
where
    S: Fn(&[Observation]) -> Result<Solution, EstimateError>,
    P: Fn(&Solution) -> f64,
{
    /// Returns a hypothesis if its points have a pose that is not discarded. What a certain prior rules out is
    /// discarded; with another prior it is a rival, but is not chosen.
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

/// Excludes as few points as possible, at most `max_outliers`, such that the rest passes the test. A point is excluded
/// only if no other choice of as many explains the frame nearly as well.
///
/// `suspects` are indices of the points that may be excluded.
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

/// Returns two points whose joint exclusion explains the frame better than the exclusion that a solution made. Two
/// reflections with the same shift agree with each other, and a correct point can look wrong beside them. Two wrong
/// points are less likely than one by about the ratio behind [`INDISTINCT`]: so there is no tolerance, the rest must
/// fit better than that of the one.
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

/// Copies all points but two into `scratch`; the same index twice excludes one.
fn keep_others(observations: &[Observation], [i, j]: [usize; 2], scratch: &mut Subset) {
    scratch.clear();
    let remaining = observations
        .iter()
        .enumerate()
        .filter(|(k, _)| *k != i && *k != j);
    scratch.extend(remaining.map(|(_, seen)| *seen));
}

/// A hypothesis about which points are wrong, with the pose of the rest.
struct Hypothesis {
    /// Chi-squared plus the cost of the prior.
    cost: f64,
    chi_squared: f64,
    /// Whether the rest passes the test.
    passes: bool,
    /// Whether the prior allows the pose.
    is_plausible: bool,
    left_out: [usize; 2],
    camera_from_tanker: Isometry3<f64>,
}

/// Returns the hypothesis with the least cost among those that may be chosen.
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

/// Returns the choice with the least cost among those that exclude one of these pairs (the same index twice: one
/// point), or the preferred one if its rest passes. Another pose that passes is its rival; its likelihood is judged by
/// the image alone.
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
    // Solving again is cheaper than keeping every solution.
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

/// Returns one point from each of two choices, from those in which they differ.
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
