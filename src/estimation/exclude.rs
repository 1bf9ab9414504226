//! Wrong detections: leave out as few points as it takes for the rest to agree.
//!
//! With six points, estimators that only weigh large residuals down (Huber, Cauchy, graduated
//! non-convexity) have too little to go by. All subsets without one point, then all without two, are
//! few enough to be solved one by one, each from the prior, and judged by the chi-squared test of the
//! remainder. Two exchanged ids are a hypothesis of their own: it keeps all points, so its test has
//! four more degrees of freedom than that of two exclusions and tells the right pair more surely. The
//! pose then still rests on the other points alone: data that had to be corrected are not flown.

use super::ambiguity::likelihood_ratio;
use super::{EstimateError, Excluded, Observation, Solution};
use crate::geometry::pose_error;

/// Among more points than this only the ones with the largest residuals are suspected, so that the
/// cost stays bounded: one gross error among many hardly moves the fit of all of them.
pub(crate) const MAX_SUSPECTS: usize = 12;
/// Points that must remain: fewer leave nothing that the chi-squared test could judge.
const MIN_REMAINING: usize = 4;
/// Squared Mahalanobis distance at which two hypotheses disagree: no correct pair of poses with most
/// of their points in common is so far apart.
const ELSEWHERE: f64 = 30.0;

/// How a set of points is solved and judged.
pub(crate) trait Solve {
    /// The pose of these points, judged.
    fn solve(&self, observations: &[Observation]) -> Result<Solution, EstimateError>;
}

impl<F: Fn(&[Observation]) -> Result<Solution, EstimateError>> Solve for F {
    fn solve(&self, observations: &[Observation]) -> Result<Solution, EstimateError> {
        self(observations)
    }
}

/// Returns the trusted solution that leaves out the fewest points, at most `max_outliers`; none when
/// no hypothesis passes.
///
/// `suspects` are indices of the points that may be left out.
pub(crate) fn search(
    solver: &impl Solve,
    observations: &[Observation],
    suspects: &[usize],
    max_outliers: usize,
) -> Option<Solution> {
    let spare = observations.len().saturating_sub(MIN_REMAINING);
    let mut scratch = Vec::with_capacity(observations.len());
    if max_outliers >= 1 && spare >= 1 {
        let singles = suspects.iter().map(|&i| [i, i]);
        let solution = best(solver, observations, &mut scratch, singles);
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
            let solution = solver.solve(&scratch).ok().filter(Solution::is_trusted)?;
            Some((solution.chi_squared, pair))
        })
        .min_by(|a, b| a.0.total_cmp(&b.0));
    if let Some((_, pair)) = exchange {
        let without_pair = best(solver, observations, &mut scratch, std::iter::once(pair));
        if without_pair.is_some() {
            return without_pair;
        }
    }
    best(solver, observations, &mut scratch, pairs())
}

/// The trusted solution with the least chi-squared among those that leave out one of these pairs
/// (the same index twice: one point). Another one that says something else is its rival.
fn best(
    solver: &impl Solve,
    observations: &[Observation],
    scratch: &mut Vec<Observation>,
    left_out: impl Iterator<Item = [usize; 2]>,
) -> Option<Solution> {
    let mut trusted: Vec<Solution> = left_out
        .filter_map(|[i, j]| {
            scratch.clear();
            let remaining = observations
                .iter()
                .enumerate()
                .filter(|(k, _)| *k != i && *k != j);
            scratch.extend(remaining.map(|(_, seen)| *seen));
            let mut solution = solver.solve(scratch).ok().filter(Solution::is_trusted)?;
            let second = (j != i).then(|| observations[j].id);
            solution.excluded = Excluded([Some(observations[i].id), second]);
            Some(solution)
        })
        .collect();
    trusted.sort_by(|a, b| a.chi_squared.total_cmp(&b.chi_squared));
    let mut trusted = trusted.into_iter();
    let mut best = trusted.next()?;
    if let Some(rival) = trusted.find(|other| is_elsewhere(&best, other)) {
        let ratio = likelihood_ratio(rival.chi_squared, best.chi_squared);
        best.ambiguity = best.ambiguity.max(ratio);
    }
    Some(best)
}

fn is_elsewhere(best: &Solution, other: &Solution) -> bool {
    let error = pose_error(&other.camera_from_tanker, &best.camera_from_tanker);
    best.covariance
        .mahalanobis_squared(&error)
        .is_none_or(|distance| distance > ELSEWHERE)
}
