//! The approach, range by range: what all beacons are good for, and what all but one.

use super::situation::{Beacon, Image, Situation};
use super::view::{View, Wanted, view};

/// One range.
pub struct Station {
    pub range_m: f64,
    /// Ids of the points that the node would use.
    pub used: usize,
    /// Ids of markers that are not in the image, or at its edge.
    pub lost: Vec<u32>,
    /// What the image is good for, or why the node would refuse it.
    pub view: Result<View, String>,
    /// Without each of the beacons in the image.
    pub without: Vec<Without>,
}

/// The same image without one beacon.
pub struct Without {
    pub beacon: String,
    pub view: Result<View, String>,
}

impl Without {
    /// Returns the largest level, m; infinite without a pose or without levels.
    pub fn worst_level_m(&self) -> f64 {
        self.view
            .as_ref()
            .map_or(f64::INFINITY, View::worst_level_m)
    }

    fn worst_sigma_m(&self) -> f64 {
        self.view
            .as_ref()
            .map_or(f64::INFINITY, View::worst_sigma_m)
    }
}

impl Station {
    /// Returns the beacon whose loss raises the level most; of several that leave no level, the one that leaves the
    /// largest sigma.
    pub fn weakest(&self) -> Option<&Without> {
        let worse = |a: &&Without, b: &&Without| {
            (a.worst_level_m().total_cmp(&b.worst_level_m()))
                .then(a.worst_sigma_m().total_cmp(&b.worst_sigma_m()))
        };
        self.without.iter().max_by(worse)
    }
}

/// Returns every range of the approach.
pub fn stations(situation: &Situation) -> Vec<Station> {
    let beacons = situation.beacons();
    let markers = situation.map.markers();
    let ranges = situation.route.ranges_m.iter();
    ranges
        .map(|&range_m| {
            let Image { observations, lost } = situation.image(markers, range_m);
            let all = view(
                situation,
                &situation.estimator,
                &observations,
                Wanted::Shares,
            );
            let is_seen = |beacon: &&Beacon| beacon.ids.iter().any(|id| !lost.contains(id));
            let without = beacons.iter().filter(is_seen).map(|beacon| {
                let mut others = observations.clone();
                others.retain(|seen| !beacon.ids.contains(&seen.id));
                let wanted = Wanted::LevelsOnly;
                Without {
                    beacon: beacon.name.clone(),
                    view: view(situation, &situation.estimator, &others, wanted),
                }
            });
            Station {
                range_m,
                used: observations.len(),
                without: without.collect(),
                view: all,
                lost,
            }
        })
        .collect()
}

/// Returns the beacon that is the weakest at most ranges where its loss leaves a level, or else at most of all.
pub fn overall_weakest(stations: &[Station]) -> Option<String> {
    let count = |is_counted: &dyn Fn(&Station) -> bool| {
        let mut counts: Vec<(&str, usize)> = Vec::new();
        for station in stations
            .iter()
            .filter(|station| station.view.is_ok() && is_counted(station))
        {
            let name = station.weakest()?.beacon.as_str();
            match counts.iter_mut().find(|(known, _)| *known == name) {
                Some((_, count)) => *count += 1,
                None => counts.push((name, 1)),
            }
        }
        let most = counts.iter().max_by_key(|(_, count)| *count);
        most.map(|(name, _)| (*name).to_owned())
    };
    let leaves_a_level = |station: &Station| {
        let weakest = station.weakest();
        weakest.is_some_and(|weakest| weakest.worst_level_m().is_finite())
    };
    count(&leaves_a_level).or_else(|| count(&|_| true))
}
