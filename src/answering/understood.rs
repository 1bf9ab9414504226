//! Mount, lever arms and nominal attitude, said when they are understood.

use nalgebra::Point3;

use crate::refuelling::{ExpectedAttitude, RefuellingGeometry, Understood};
use crate::target::MarkerMap;

/// Logs them in words, and warns of what is outside its sanity range.
pub fn say_understood(
    expected: &ExpectedAttitude,
    geometry: Option<&RefuellingGeometry>,
    map: &MarkerMap,
    need: usize,
) {
    let markers: Vec<Point3<f64>> = map
        .markers()
        .iter()
        .map(|marker| marker.marker_in_tanker)
        .collect();
    let understood = Understood::new(expected, geometry, &markers, need);
    for line in &understood.lines {
        log::info!("{line}");
    }
    for warning in &understood.warnings {
        log::warn!("{warning}");
    }
}
