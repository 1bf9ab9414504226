//! Error budgets as the tests state them: parts, and the one of the documents' example.

#![allow(dead_code)] // each test binary uses its part

use nalgebra::Vector3;
use tanker_pose::camera::CalibrationChange;
use tanker_pose::estimation::{CalibrationMode, ErrorBudget, FlexMode};
use tanker_pose::target::Marker;

pub fn no_budget() -> ErrorBudget {
    ErrorBudget::new(&[], vec![], vec![], 0.0).expect("nothing is wrong with nothing")
}

/// A mode in which these parameters of the calibration change by one sigma together.
pub fn calibration_mode(name: &str, places: &[usize], sigma: f64) -> CalibrationMode {
    let mut change = CalibrationChange::zeros();
    for &place in places {
        change[place] = sigma;
    }
    CalibrationMode {
        name: name.to_owned(),
        change,
    }
}

/// Focal length by a share, and principal point by pixels.
pub fn calibration_modes(focal: f64, principal_point_px: f64) -> Vec<CalibrationMode> {
    vec![
        calibration_mode("focal_length", &[0, 1], focal),
        calibration_mode("principal_point_u", &[2], principal_point_px),
        calibration_mode("principal_point_v", &[3], principal_point_px),
    ]
}

/// Wings that bend up by the square of the distance from the middle: `tip_m` at `span_m`.
///
/// # Inputs
/// * `places`: id of each marker, and how far left it is, m.
pub fn wing_bending(
    places: impl IntoIterator<Item = (u32, f64)>,
    tip_m: f64,
    span_m: f64,
    time_constant_s: Option<f64>,
) -> FlexMode {
    let up = |left_m: f64| tip_m * (left_m / span_m).powi(2);
    FlexMode {
        name: "wing_bending".to_owned(),
        time_constant_s,
        shape: places
            .into_iter()
            .map(|(id, left_m)| (id, Vector3::new(0.0, 0.0, up(left_m))))
            .collect(),
    }
}

/// A budget as the example of a map with one has it, and of a calibration.
pub fn example_budget(markers: &[Marker]) -> ErrorBudget {
    let survey: Vec<(u32, f64)> = markers.iter().map(|marker| (marker.id, 0.01)).collect();
    let places = markers
        .iter()
        .map(|marker| (marker.id, marker.marker_in_tanker.y));
    let flex = wing_bending(places, 0.2, 7.13, Some(4.0));
    ErrorBudget::new(&survey, vec![flex], calibration_modes(0.001, 1.0), 0.3).expect("a budget")
}
