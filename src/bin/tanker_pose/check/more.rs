//! Where one more beacon would help most.

use nalgebra::{Point3, Vector3};
use tanker_pose::estimation::{ErrorBudget, Estimator, FlexMode};
use tanker_pose::target::Marker;

use super::situation::Situation;
use super::view::{View, Wanted, view};

/// Positions along x, y and z: odd across the plane of symmetry, so that it is among them.
const GRID: [u32; 3] = [5, 7, 5];
/// Growth of the box of markers on each side, share of its size.
const GROWTH: f64 = 0.2;
/// And at least this, m: a flat map has no size across its plane.
const LEAST_GROWTH_M: f64 = 0.5;
/// Positions nearer than this to a marker add nothing that a better beacon in its place would not, m.
const TOO_NEAR_M: f64 = 0.3;

/// The best place for one more beacon.
pub struct OneMore {
    pub place_in_tanker: Point3<f64>,
    pub range_m: f64,
    /// Before, m: infinite without levels.
    pub level_m: f64,
    /// Infinite without a pose.
    pub sigma_m: f64,
    /// After.
    pub new_level_m: f64,
    pub new_sigma_m: f64,
    /// Survey error that was assumed of it, m.
    pub survey_m: f64,
}

/// Returns the best place at the nearest range at which any place gives a pose; `None` if there is none.
///
/// The beacon is assumed to be surveyed as the median of the others, and to move with the bending airframe as the
/// nearest of them.
pub fn best(situation: &Situation) -> Option<OneMore> {
    let ranges = situation.route.ranges_m.iter().rev();
    ranges
        .copied()
        .find_map(|range_m| best_at(situation, range_m))
}

fn best_at(situation: &Situation, range_m: f64) -> Option<OneMore> {
    let markers = situation.map.markers();
    let now = look(situation, &situation.estimator, markers, range_m);
    let merit = |view: &Option<View>| {
        view.as_ref()
            .map_or((f64::INFINITY, f64::INFINITY), |view| {
                (view.worst_level_m(), view.worst_sigma_m())
            })
    };
    let (level_m, sigma_m) = merit(&now);
    let id = free_id(situation)?;
    let mut best: Option<OneMore> = None;
    for place_in_tanker in places(markers) {
        let (estimator, survey_m) = with_beacon(situation, id, &place_in_tanker);
        let mut all = markers.to_vec();
        all.push(Marker::from((id, place_in_tanker)));
        let seen = situation.image(&all, range_m);
        if seen.lost.contains(&id) {
            continue;
        }
        let Some(view) = view(
            situation,
            &estimator,
            &seen.observations,
            Wanted::LevelsOnly,
        )
        .ok() else {
            continue;
        };
        let (new_level_m, new_sigma_m) = (view.worst_level_m(), view.worst_sigma_m());
        let is_better = best.as_ref().is_none_or(|best| {
            (new_level_m.total_cmp(&best.new_level_m))
                .then(new_sigma_m.total_cmp(&best.new_sigma_m))
                .is_lt()
        });
        if is_better {
            best = Some(OneMore {
                place_in_tanker,
                range_m,
                level_m,
                sigma_m,
                new_level_m,
                new_sigma_m,
                survey_m,
            });
        }
    }
    best
}

fn look(
    situation: &Situation,
    estimator: &Estimator,
    markers: &[Marker],
    range_m: f64,
) -> Option<View> {
    let seen = situation.image(markers, range_m).observations;
    view(situation, estimator, &seen, Wanted::LevelsOnly).ok()
}

/// Returns an id that no marker has, and no corner of a tag.
fn free_id(situation: &Situation) -> Option<u32> {
    let most = situation.map.markers().iter().map(|marker| marker.id).max();
    let is_free =
        |id: &u32| situation.map.get(*id).is_none() && situation.map.tag_of_corner(*id).is_none();
    (most.unwrap_or(0)..u32::MAX)
        .find(is_free)
        .or_else(|| (0..u32::MAX).find(is_free))
}

/// Returns positions in the box of the markers, grown.
fn places(markers: &[Marker]) -> impl Iterator<Item = Point3<f64>> {
    let coordinates = || markers.iter().map(|marker| marker.marker_in_tanker.coords);
    let all = |of: fn(&Vector3<f64>, &Vector3<f64>) -> Vector3<f64>| {
        coordinates()
            .reduce(|a, b| of(&a, &b))
            .unwrap_or_else(Vector3::zeros)
    };
    let (low, high) = (all(Vector3::inf), all(Vector3::sup));
    let growth = (high - low).map(|size| (GROWTH * size).max(LEAST_GROWTH_M));
    let (low, high) = (low - growth, high + growth);
    let steps = move |axis: usize| {
        (0..GRID[axis]).map(move |step| {
            let share = f64::from(step) / f64::from(GRID[axis] - 1);
            low[axis] + share * (high[axis] - low[axis])
        })
    };
    steps(0)
        .flat_map(move |x| steps(1).flat_map(move |y| steps(2).map(move |z| Point3::new(x, y, z))))
        .filter(move |place| {
            markers
                .iter()
                .all(|marker| (marker.marker_in_tanker - place).norm() > TOO_NEAR_M)
        })
}

/// Returns the estimator with the errors of one more beacon, and the survey error assumed of it.
fn with_beacon(situation: &Situation, id: u32, place: &Point3<f64>) -> (Estimator, f64) {
    let settings = situation.estimator.settings().clone();
    let Some(budget) = situation.estimator.budget() else {
        return (Estimator::new(settings), 0.0);
    };
    let markers = situation.map.markers();
    let mut survey: Vec<(u32, f64)> = markers
        .iter()
        .map(|marker| (marker.id, budget.survey_sigma_m(marker.id)))
        .collect();
    let mut sigmas: Vec<f64> = survey.iter().map(|(_, sigma)| *sigma).collect();
    sigmas.sort_unstable_by(f64::total_cmp);
    let survey_m = sigmas.get(sigmas.len() / 2).copied().unwrap_or(0.0);
    survey.push((id, survey_m));
    let distance_m = |marker: &&Marker| (marker.marker_in_tanker - place).norm();
    let nearest = markers
        .iter()
        .min_by(|a, b| distance_m(a).total_cmp(&distance_m(b)))
        .map_or(id, |marker| marker.id);
    let flex = budget.flex().iter().map(|mode| {
        let mut mode: FlexMode = mode.clone();
        let shift = mode.shape.iter().find(|(of, _)| *of == nearest);
        if let Some(&(_, shift)) = shift {
            mode.shape.push((id, shift));
        }
        mode
    });
    let (calibration, jitter_px) = (budget.calibration().to_vec(), budget.jitter_px());
    let plain = Estimator::new(settings);
    match ErrorBudget::new(&survey, flex.collect(), calibration, jitter_px) {
        Ok(budget) => (plain.with_budget(budget), survey_m),
        // Checked values and one more of them: cannot fail; the old budget takes the beacon as exact.
        Err(_) => (plain.with_budget(budget.clone()), 0.0),
    }
}
