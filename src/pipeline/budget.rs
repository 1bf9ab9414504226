//! The estimator's error budget, from what map and settings state.

use crate::camera::{
    CalibrationBudget, CalibrationChange, Camera, CameraError, CameraInfo, FIRST_COEFFICIENT,
};
use crate::config::CalibrationSigmas;
use crate::estimation::{CalibrationMode, ErrorBudget, FlexMode};
use crate::target::MapBudget;
use crate::text::{digits, quoted};

/// Returns the budget from a checked map, checked settings and a calibration's own error file.
#[must_use]
pub fn error_budget(
    map: &MapBudget,
    camera: &CalibrationSigmas,
    of_file: &[CalibrationMode],
) -> ErrorBudget {
    let flex = map.flex.iter().filter(|flex| flex.sigma_m > 0.0);
    let flex = flex.map(|flex| FlexMode {
        name: flex.name.clone(),
        time_constant_s: flex.time_constant_s,
        shape: flex
            .shape
            .iter()
            .map(|(id, shift)| (*id, shift * flex.sigma_m))
            .collect(),
    });
    ErrorBudget::of_checked(
        &map.survey_sigma_m,
        flex.collect(),
        [calibration_modes(camera), of_file.to_vec()].concat(),
        camera.jitter_px,
    )
}

/// Returns the modes of a calibration's own error file, for a camera made from `info`.
///
/// # Errors
/// As [`CalibrationBudget::changes`].
pub fn modes_of_file(
    file: &CalibrationBudget,
    info: &CameraInfo,
    camera: &Camera,
) -> Result<Vec<CalibrationMode>, CameraError> {
    let modes = file.changes(info, camera)?.into_iter();
    Ok(modes
        .map(|(name, change)| CalibrationMode { name, change })
        .collect())
}

/// Returns the stated errors of map, settings and a calibration's own file as a log line.
#[must_use]
pub fn budget_in_words(
    map: &MapBudget,
    camera: &CalibrationSigmas,
    of_file: Option<&CalibrationBudget>,
) -> String {
    let sigmas = map.survey_sigma_m.iter().map(|(_, sigma)| *sigma);
    let survey = match (sigmas.clone().reduce(f64::min), sigmas.reduce(f64::max)) {
        (Some(least), Some(most)) if (most - least) < 1e-12 => format!("surveyed to {most} m"),
        (Some(least), Some(most)) => format!("surveyed to {least} to {most} m"),
        _ => "taken as exact".to_owned(),
    };
    let flex: Vec<String> = map
        .flex
        .iter()
        .map(|flex| format!("{} {} m", quoted(&flex.name), flex.sigma_m))
        .collect();
    let airframe = if flex.is_empty() {
        "taken as rigid".to_owned()
    } else {
        format!("bends ({})", flex.join(", "))
    };
    let calibration = if let Some(file) = of_file {
        let jitter = camera.jitter_px;
        format!("known to {}, jitter {jitter} px", file.in_words())
    } else if *camera == CalibrationSigmas::default() {
        "taken as exact".to_owned()
    } else {
        let mut parts = vec![
            format!("focal length {} %", digits(100.0 * camera.focal_length)),
            format!("principal point {} px", camera.principal_point_px),
        ];
        for (index, sigma) in camera.distortion.iter().enumerate() {
            if *sigma > 0.0 {
                parts.push(format!("D[{index}] {sigma}"));
            }
        }
        parts.push(format!("jitter {} px", camera.jitter_px));
        format!("known to {}", parts.join(", "))
    };
    format!(
        "error budget (1 sigma): markers {survey}, airframe {airframe}, calibration {calibration}"
    )
}

/// One mode for both focal lengths together, one for each coordinate of the principal point, and one for each
/// coefficient of D.
fn calibration_modes(sigmas: &CalibrationSigmas) -> Vec<CalibrationMode> {
    let mode = |name: &str, places: &[usize], sigma: f64| {
        let mut change = CalibrationChange::zeros();
        for &place in places {
            change[place] = sigma;
        }
        (sigma > 0.0).then(|| CalibrationMode {
            name: name.to_owned(),
            change,
        })
    };
    let coefficients = sigmas.distortion.iter().enumerate().map(|(index, &sigma)| {
        let name = format!("distortion_{index}");
        mode(&name, &[FIRST_COEFFICIENT + index], sigma)
    });
    [
        mode("focal_length", &[0, 1], sigmas.focal_length),
        mode("principal_point_u", &[2], sigmas.principal_point_px),
        mode("principal_point_v", &[3], sigmas.principal_point_px),
    ]
    .into_iter()
    .chain(coefficients)
    .flatten()
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::target::MarkerMap;

    const MAP: &str = "name: kite
sigma: 0.01
markers:
  - {id: 1, x: 0, y: -1.5, z: 0}
  - {id: 2, x: 0, y: 1.5, z: 0, sigma: 0}
  - {id: 3, x: 3, y: 0, z: 0.25}
flex:
  - {name: wing, sigma: 0.2, time_constant_s: 3, shape: [{id: 1, z: 1}, {id: 2, z: 0.5}]}
  - {name: off, sigma: 0, shape: [{id: 1, z: 1}]}
";

    #[test]
    fn map_and_settings_become_one_budget() {
        let map = MarkerMap::from_yaml(MAP, "kite.yaml").expect("a good map");
        let sigmas = CalibrationSigmas {
            focal_length: 0.002,
            principal_point_px: 1.5,
            distortion: [0.01, 0.0, 0.0, 0.0, 0.03, 0.0, 0.0, 0.0],
            jitter_px: 0.4,
        };
        let budget = error_budget(map.budget(), &sigmas, &[]);
        for (id, sigma) in [(1, 0.01), (2, 0.0), (3, 0.01)] {
            assert!((budget.survey_sigma_m(id) - sigma).abs() < f64::EPSILON);
        }
        assert_eq!(budget.flex().len(), 1, "one mode has a sigma");
        let wing = &budget.flex()[0];
        let is = |value: f64, expected: f64| assert!((value - expected).abs() < 1e-15, "{value}");
        assert_eq!(wing.time_constant_s, Some(3.0));
        is(wing.shape[1].1.z, 0.1);
        let names: Vec<&str> = budget
            .calibration()
            .iter()
            .map(|mode| mode.name.as_str())
            .collect();
        let expected = [
            "focal_length",
            "principal_point_u",
            "principal_point_v",
            "distortion_0",
            "distortion_4",
        ];
        assert_eq!(names, expected);
        is(budget.calibration()[0].change[1], 0.002);
        is(budget.calibration()[4].change[8], 0.03);
        is(budget.jitter_px(), 0.4);
    }

    #[test]
    fn words_say_what_is_taken_as_exact() {
        let exact = budget_in_words(&MapBudget::default(), &CalibrationSigmas::default(), None);
        assert_eq!(
            exact,
            "error budget (1 sigma): markers taken as exact, airframe taken as rigid, calibration taken as exact"
        );
        let map = MarkerMap::from_yaml(MAP, "kite.yaml").expect("a good map");
        let sigmas = CalibrationSigmas {
            focal_length: 0.003,
            distortion: [0.02, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            ..CalibrationSigmas::default()
        };
        let words = budget_in_words(map.budget(), &sigmas, None);
        assert!(words.contains("markers surveyed to 0.01 m"), "{words}");
        assert!(words.contains("airframe bends ("), "{words}");
        assert!(words.contains("D[0] 0.02"), "{words}");
        let file = CalibrationBudget::from_yaml("sigmas: {fx: 1.5, k1: 0.01}\n", "c.yaml");
        let exact = CalibrationSigmas::default();
        let words = budget_in_words(map.budget(), &exact, file.ok().as_ref());
        let expected = "calibration known to fx 1.50 px, k1 0.01000, jitter 0 px";
        assert!(words.contains(expected), "{words}");
    }

    #[test]
    fn an_exact_map_and_no_sigmas_are_an_empty_budget() {
        let exact = MapBudget::default();
        assert!(error_budget(&exact, &CalibrationSigmas::default(), &[]).is_empty());
    }
}
