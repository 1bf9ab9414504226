//! Exchanged ids: whether the image shows it when the detector takes left for right on a symmetric map.

use tanker_pose::estimation::{Estimator, EstimatorSettings, Initialisation};
use tanker_pose::pipeline;

use super::finding::Finding;
use super::situation::Situation;

/// Returns what happens when the detector exchanges the ids of each pair.
pub fn lint(situation: &Situation, pairs: &[(u32, u32)]) -> Finding {
    let names: Vec<String> = pairs.iter().map(|(a, b)| format!("{a} and {b}")).collect();
    let names = names.join(", ");
    let with = |settings: EstimatorSettings| {
        let estimator = Estimator::new(settings);
        match situation.estimator.budget() {
            Some(budget) => estimator.with_budget(budget.clone()),
            None => estimator,
        }
    };
    let settings = situation.estimator.settings();
    let with_prior = with(settings.clone());
    let without_prior = with(EstimatorSettings {
        initialisation: Initialisation::Global,
        attitude_sigma_rad: None,
        ..settings.clone()
    });
    let passes = |estimator: &Estimator| {
        let ranges = situation.route.ranges_m.iter().copied();
        let mut passing = ranges.filter(|&range_m| {
            let mut seen = situation
                .image(situation.map.markers(), range_m)
                .observations;
            let partner = |id: u32| {
                let pair = pairs.iter().find(|pair| pair.0 == id || pair.1 == id);
                pair.map_or(id, |&(a, b)| if a == id { b } else { a })
            };
            for seen in &mut seen {
                seen.id = partner(seen.id);
                if let Some(marker) = situation.map.get(seen.id) {
                    seen.marker_in_tanker = marker;
                }
            }
            pipeline::solve(estimator, &situation.camera, &seen, None)
                .result
                .is_ok()
        });
        // Descending ranges: the last one is the nearest.
        let first = passing.next();
        first.map(|first| match passing.next_back() {
            Some(last) => format!("{first:.0} m to {last:.0} m away"),
            None => format!("{first:.0} m away"),
        })
    };
    let found =
        format!("the map is its own mirror image left to right, with ids {names} exchanged");
    if let Some(away) = passes(&with_prior) {
        return Finding::warning(
            "mirror",
            format!("{found}, and an image with those ids exchanged is accepted, {away}"),
            "one beacon off the symmetry would show it",
        );
    }
    let shown = match passes(&without_prior) {
        Some(away) => format!(
            "; by the image alone exchanged ids cannot be told {away}, where a tanker that \
             flies the other way fits as well: only the nominal attitude tells"
        ),
        None => "; exchanged ids are refused at every range".to_owned(),
    };
    Finding::note(
        "mirror",
        format!("{found}{shown}"),
        "make sure once, on the ground, that the detector's ids are those of the map, not mirrored",
    )
}
