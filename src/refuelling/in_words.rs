//! Mount, lever arms and nominal attitude as sentences for the log, with warnings about implausible ones.
//!
//! A wrong lever arm shifts every result without any visible sign, so it is stated where it can be compared with the
//! aircraft.

use nalgebra::{Point3, Vector3};

use super::attitude::angle_deg;
use super::{ExpectedAttitude, RefuellingGeometry};

/// deg; a camera that looks farther away from straight ahead cannot see a tanker ahead.
const MOST_ASIDE_DEG: f64 = 60.0;
/// deg; a camera that is rolled by more is implausible.
const MOST_ROLLED_DEG: f64 = 45.0;
/// deg; a larger nominal attitude is implausible.
const MOST_NOMINAL_DEG: f64 = 30.0;
/// m; a larger distance of camera or probe on a receiver is implausible.
const MOST_ON_RECEIVER_M: f64 = 30.0;
/// m; length of a boom, or of a hose with drogue.
const MOST_FROM_MARKERS_M: f64 = 40.0;
/// deg from the optical axis; wider lenses are not used at refuelling distance.
const WIDEST_DEG: f64 = 60.0;
/// m and deg; smaller values are not mentioned.
const NOTHING: f64 = 0.05;

/// The configuration as sentences, to be compared with the aircraft.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Understood {
    /// One statement each.
    pub lines: Vec<String>,
    /// Implausible values.
    pub warnings: Vec<String>,
}

impl Understood {
    /// Returns the sentences for a mount and a nominal attitude, and for lever arms if there are any.
    ///
    /// # Inputs
    /// * `markers_in_tanker`: of the marker map, m.
    /// * `need`: number of markers that a pose needs.
    #[must_use]
    pub fn new(
        expected: &ExpectedAttitude,
        geometry: Option<&RefuellingGeometry>,
        markers_in_tanker: &[Point3<f64>],
        need: usize,
    ) -> Self {
        let mut found = Self::default();
        found.add_mount(expected);
        found.add_nominal(expected);
        if let Some(geometry) = geometry {
            found.add_lever_arms(geometry, markers_in_tanker);
            found.add_contact(expected, geometry, markers_in_tanker, need);
        }
        found
    }

    fn add_mount(&mut self, expected: &ExpectedAttitude) {
        let axis = expected.mount.rotation() * Vector3::x();
        let down_deg = (-axis.z).clamp(-1.0, 1.0).asin().to_degrees();
        let left_deg = axis.y.atan2(axis.x).to_degrees();
        let aside = parts(
            &[(down_deg, "down", "up"), (left_deg, "left", "right")],
            "°",
        );
        let looks = if aside.is_empty() {
            "straight ahead".to_owned()
        } else {
            aside.join(", ")
        };
        let roll_deg = expected.mount.roll_deg;
        let rolled = match parts(&[(roll_deg, "", "")], "°").first() {
            None => "upright".to_owned(),
            Some(_) if roll_deg.abs() > 180.0 - MOST_ROLLED_DEG => "upside down".to_owned(),
            Some(by) => {
                let side = if roll_deg > 0.0 { "right" } else { "left" };
                format!("rolled {}, its {side} side low", by.trim_end())
            }
        };
        self.lines.push(format!(
            "mount: the camera looks {looks}, {rolled} (camera_mount: {})",
            expected.mount
        ));
        let aside_deg = axis.x.clamp(-1.0, 1.0).acos().to_degrees();
        if aside_deg > MOST_ASIDE_DEG {
            self.warnings.push(format!(
                "the camera looks {aside_deg:.0}° away from straight ahead, expected are {MOST_ASIDE_DEG}° at most: \
                 check camera_mount_pitch_deg and camera_mount_yaw_deg"
            ));
        }
        if roll_deg.abs() > MOST_ROLLED_DEG {
            self.warnings.push(format!(
                "the camera is rolled by {roll_deg:.0}°, expected are {MOST_ROLLED_DEG}° at most: \
                 check camera_mount_roll_deg"
            ));
        }
    }

    fn add_nominal(&mut self, expected: &ExpectedAttitude) {
        let nominal = &expected.nominal;
        let mut turns = Vec::new();
        for (deg, positive, negative) in [
            (nominal.pitch_deg, "nose lower", "nose higher"),
            (nominal.yaw_deg, "nose to the left", "nose to the right"),
            (nominal.roll_deg, "right wing lower", "left wing lower"),
        ] {
            if deg.abs() >= NOTHING {
                let what = if deg > 0.0 { positive } else { negative };
                turns.push(format!("{what} by {:.1}°", deg.abs()));
            }
        }
        let flies = if turns.is_empty() {
            "parallel to the receiver".to_owned()
        } else {
            format!("with its {} compared with the receiver", turns.join(", "))
        };
        self.lines.push(format!(
            "nominal attitude: the tanker flies {flies}, up to {}° off that",
            expected.limit_deg
        ));
        let turn_deg = angle_deg(&nominal.rotation());
        if turn_deg > MOST_NOMINAL_DEG {
            self.warnings.push(format!(
                "the nominal attitude is {turn_deg:.0}° from parallel flight, expected are {MOST_NOMINAL_DEG}° at most: \
                 check nominal_*_deg"
            ));
        }
    }

    fn add_lever_arms(&mut self, geometry: &RefuellingGeometry, markers: &[Point3<f64>]) {
        let camera = geometry.receiver_from_camera.translation.vector;
        let tip = geometry.probe_tip_in_receiver.coords;
        let receptacle = geometry.receptacle_in_tanker;
        self.lines.push(format!(
            "camera_in_receiver: the camera is {} the receiver's origin",
            place(&camera)
        ));
        let from_camera = tip - camera;
        self.lines.push(format!(
            "probe_tip_in_receiver: the probe tip is {} the camera",
            place(&from_camera)
        ));
        let nearest_m = markers
            .iter()
            .map(|marker| (marker - receptacle).norm())
            .fold(f64::INFINITY, f64::min);
        self.lines.push(format!(
            "receptacle_in_tanker: the receptacle is {} the tanker's origin, {nearest_m:.1} m from the nearest marker",
            place(&receptacle.coords)
        ));
        for (name, of, distance_m, most_m) in [
            (
                "camera_in_receiver",
                "the camera is {} m from the receiver's origin",
                camera.norm(),
                MOST_ON_RECEIVER_M,
            ),
            (
                "probe_tip_in_receiver",
                "the probe tip is {} m from the camera",
                from_camera.norm(),
                MOST_ON_RECEIVER_M,
            ),
            (
                "receptacle_in_tanker",
                "the receptacle is {} m from the nearest marker",
                nearest_m,
                MOST_FROM_MARKERS_M,
            ),
        ] {
            if distance_m > most_m {
                let is = of.replace("{}", &format!("{distance_m:.1}"));
                self.warnings.push(format!(
                    "{is}, expected are {most_m} m at most: check {name}"
                ));
            }
        }
        let ahead_m = (geometry.receiver_from_camera.rotation * Vector3::z()).dot(&from_camera);
        if ahead_m < -NOTHING {
            self.warnings.push(format!(
                "the probe tip is {:.1} m behind the camera, expected ahead of it: check the signs of \
                 probe_tip_in_receiver and camera_in_receiver",
                -ahead_m
            ));
        }
    }

    /// Checks whether a pose could be found in contact: a lever arm with the wrong sign often leads past the tanker.
    fn add_contact(
        &mut self,
        expected: &ExpectedAttitude,
        geometry: &RefuellingGeometry,
        markers: &[Point3<f64>],
        need: usize,
    ) {
        let receiver_from_tanker = expected.nominal.rotation();
        let in_camera = |marker: &Point3<f64>| {
            let from_receptacle = receiver_from_tanker * (marker - geometry.receptacle_in_tanker);
            let in_receiver = geometry.probe_tip_in_receiver + from_receptacle;
            geometry
                .receiver_from_camera
                .inverse_transform_point(&in_receiver)
        };
        let widest = WIDEST_DEG.to_radians().tan();
        let in_view = markers
            .iter()
            .map(in_camera)
            .filter(|point| point.z > 0.0 && point.xy().coords.norm() < widest * point.z)
            .count();
        if in_view < need.min(markers.len()) {
            self.warnings.push(format!(
                "with the probe tip in the receptacle and the tanker at its nominal attitude {in_view} of {} markers are \
                 within {WIDEST_DEG}° of the camera's axis, a pose needs {need}: a sign of probe_tip_in_receiver, \
                 receptacle_in_tanker or camera_mount is wrong, or the camera cannot see the contact",
                markers.len()
            ));
        }
    }
}

/// Returns a position relative to a body with x forward, y left, z up, as distances ahead, right and above.
fn place(vector_m: &Vector3<f64>) -> String {
    let found = parts(
        &[
            (vector_m.x, "ahead", "behind"),
            (vector_m.y, "left", "right"),
            (vector_m.z, "above", "below"),
        ],
        " m",
    );
    let Some(last) = found.last() else {
        return "at".to_owned();
    };
    let of = if last.ends_with("ahead") || last.ends_with("left") || last.ends_with("right") {
        " of"
    } else {
        ""
    };
    format!("{}{of}", found.join(", "))
}

/// Returns each number that is not negligible with its unit and the word for its sign.
fn parts(numbers: &[(f64, &str, &str)], unit: &str) -> Vec<String> {
    numbers
        .iter()
        .filter(|(number, _, _)| number.abs() >= NOTHING)
        .map(|(number, positive, negative)| {
            let word = if *number > 0.0 { positive } else { negative };
            format!("{:.1}{unit} {word}", number.abs())
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::refuelling::{Angles, RefuellingSetup};
    use crate::target::MarkerMap;

    const EXAMPLE: &str = include_str!("../../config/refuelling/example.yaml");

    fn understood(mount: Angles, nominal: Angles, setup: &str) -> Understood {
        let expected = ExpectedAttitude {
            mount,
            nominal,
            limit_deg: 15.0,
        };
        let setup = RefuellingSetup::from_yaml(setup, "s.yaml").expect("a good setup");
        let geometry = setup.geometry(&expected.receiver_from_camera());
        let map = MarkerMap::shipped("paper").expect("shipped");
        let markers: Vec<_> = map.markers().iter().map(|m| m.marker_in_tanker).collect();
        Understood::new(&expected, Some(&geometry), &markers, 5)
    }

    fn angles(roll_deg: f64, pitch_deg: f64, yaw_deg: f64) -> Angles {
        Angles {
            roll_deg,
            pitch_deg,
            yaw_deg,
        }
    }

    #[test]
    fn example_is_understood_in_words_and_nothing_about_it_is_unlikely() {
        let found = understood(Angles::default(), Angles::default(), EXAMPLE);
        assert_eq!(
            found.lines,
            [
                "mount: the camera looks straight ahead, upright (camera_mount: roll 0°, pitch 0°, yaw 0°)",
                "nominal attitude: the tanker flies parallel to the receiver, up to 15° off that",
                "camera_in_receiver: the camera is 1.0 m ahead, 0.8 m above the receiver's origin",
                "probe_tip_in_receiver: the probe tip is 4.0 m ahead, 0.5 m right, 0.2 m above the camera",
                "receptacle_in_tanker: the receptacle is 4.0 m behind, 2.5 m below the tanker's origin, \
                 4.7 m from the nearest marker",
            ]
        );
        assert_eq!(found.warnings, [] as [&str; 0]);
    }

    #[test]
    fn angles_are_told_by_where_they_turn_to() {
        let found = understood(angles(3.0, 14.0, -5.0), angles(2.0, -3.0, 4.0), EXAMPLE);
        assert!(
            found.lines[0].starts_with(
                "mount: the camera looks 14.0° down, 5.0° right, rolled 3.0°, its right side low"
            ),
            "{found:?}"
        );
        assert_eq!(
            found.lines[1],
            "nominal attitude: the tanker flies with its nose higher by 3.0°, nose to the left by 4.0°, \
             right wing lower by 2.0° compared with the receiver, up to 15° off that"
        );
        let found = understood(angles(180.0, -14.0, 0.0), Angles::default(), EXAMPLE);
        assert!(
            found.lines[0].contains("looks 14.0° up, upside down"),
            "{found:?}"
        );
        assert!(
            found.warnings[0].starts_with("the camera is rolled by 180°"),
            "{found:?}"
        );
    }

    #[test]
    fn what_is_outside_its_sanity_range_is_warned_of() {
        let changed = |from: &str, to: &str| {
            assert!(EXAMPLE.contains(from), "{from}");
            let setup = EXAMPLE.replacen(from, to, 1);
            understood(Angles::default(), Angles::default(), &setup).warnings
        };
        let tip = changed(
            "probe_tip_in_receiver: {x: 5.0",
            "probe_tip_in_receiver: {x: -5.0",
        );
        assert!(
            tip[0].starts_with("the probe tip is 6.0 m behind the camera"),
            "{tip:?}"
        );
        let tip = changed(
            "probe_tip_in_receiver: {x: 5.0",
            "probe_tip_in_receiver: {x: 50.0",
        );
        assert!(
            tip[0].starts_with("the probe tip is 49.0 m from the camera"),
            "{tip:?}"
        );
        let camera = changed(
            "camera_in_receiver: {x: 1.0",
            "camera_in_receiver: {x: -40.0",
        );
        assert!(
            camera[0].starts_with("the camera is 40.0 m from the receiver's origin"),
            "{camera:?}"
        );
        let receptacle = changed(
            "receptacle_in_tanker: {x: -4.0",
            "receptacle_in_tanker: {x: 4.0",
        );
        assert!(
            receptacle[0].contains("markers are within 60° of the camera's axis, a pose needs 5"),
            "{receptacle:?}"
        );
        let receptacle = changed(
            "receptacle_in_tanker: {x: -4.0",
            "receptacle_in_tanker: {x: -400.0",
        );
        assert!(
            receptacle[0].starts_with("the receptacle is 400.0 m from the nearest marker"),
            "{receptacle:?}"
        );
        // Which of them, only people can see.
        assert_eq!(
            changed("y: -0.5, z: 1.0}", "y: 0.5, z: 1.0}"),
            [] as [&str; 0]
        );

        let aside = understood(angles(0.0, 0.0, 90.0), Angles::default(), EXAMPLE).warnings;
        assert!(
            aside[0].starts_with("the camera looks 90° away from straight ahead"),
            "{aside:?}"
        );
        let nominal = understood(Angles::default(), angles(0.0, 0.0, -40.0), EXAMPLE).warnings;
        assert!(
            nominal[0].starts_with("the nominal attitude is 40° from"),
            "{nominal:?}"
        );
    }
}
