//! Whether the points of a frame are precise enough to check each other.

use smallvec::SmallVec;

use super::Observation;
use super::lanes::points::INLINE_POINTS;

/// Points whose sigma is more than this ratio above that of the better ones do not check them.
const WEAK_SIGMA_RATIO: f64 = 5.0;
/// Points whose sigma is more than this ratio below the others' cannot be checked by them.
const BOLD_SIGMA_RATIO: f64 = 2.0;
/// From this many `min_points` on, the checks of sigmas apply. With four points most errors go undetected in any case.
const CHECKED_FROM: usize = 5;

/// Returns the points with sigmas raised to a floor, or `None` if no sigma is below it. The floor is the `of_count`-th
/// smallest sigma over [`BOLD_SIGMA_RATIO`]. Without it, two points with much smaller sigmas than the rest would
/// dominate the pose, and the other points could not reveal an error of theirs.
pub(super) fn with_sigma_floor(
    observations: &[Observation],
    of_count: usize,
) -> Option<SmallVec<[Observation; INLINE_POINTS]>> {
    if of_count < CHECKED_FROM || are_alike(observations, BOLD_SIGMA_RATIO) {
        return None;
    }
    let mut sigmas: SmallVec<[f64; INLINE_POINTS]> =
        observations.iter().map(|seen| seen.sigma_px).collect();
    sigmas.sort_unstable_by(f64::total_cmp);
    let floor_px = sigmas.get(of_count - 1)? / BOLD_SIGMA_RATIO;
    (sigmas[0] < floor_px).then(|| {
        observations
            .iter()
            .map(|seen| Observation {
                sigma_px: seen.sigma_px.max(floor_px),
                ..*seen
            })
            .collect()
    })
}

/// Returns whether no sigma is more than `ratio` times another, which is the usual case.
fn are_alike(observations: &[Observation], ratio: f64) -> bool {
    let Some(first) = observations.first() else {
        return true;
    };
    // Within √ratio of the first implies within the ratio of each other.
    let (least, largest) = (first.sigma_px / ratio.sqrt(), first.sigma_px * ratio.sqrt());
    let is_near = |seen: &Observation| seen.sigma_px >= least && seen.sigma_px <= largest;
    observations.iter().all(is_near) || {
        let sigmas = observations.iter().map(|seen| seen.sigma_px);
        let least = sigmas.clone().fold(f64::INFINITY, f64::min);
        sigmas.fold(0.0, f64::max) <= ratio * least
    }
}

/// Returns how many points are precise enough to check others: those whose sigma is at most [`WEAK_SIGMA_RATIO`] times
/// the third smallest. Any three points determine a pose; much weaker points could not contradict them and add no
/// redundancy.
pub(super) fn count_checking(observations: &[Observation]) -> usize {
    if are_alike(observations, WEAK_SIGMA_RATIO) {
        return observations.len();
    }
    let mut best = [f64::INFINITY; 3];
    for seen in observations {
        if let Some(place) = best.iter().position(|sigma| seen.sigma_px < *sigma) {
            best[place..].rotate_right(1);
            best[place] = seen.sigma_px;
        }
    }
    observations
        .iter()
        .filter(|seen| seen.sigma_px <= WEAK_SIGMA_RATIO * best[2])
        .count()
}
