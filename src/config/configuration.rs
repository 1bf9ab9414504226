//! What the checked parameters mean together.

use nalgebra::Rotation3;

use super::{ConsumerConfiguration, Parameters, Settings};
use crate::estimation::{EstimatorSettings, Initialisation, Refinement};
use crate::geometry::optical_from_body;
use crate::refuelling::{Angles, ExpectedAttitude};
use crate::tracking::FilterSettings;

/// Everything that the parameters say, in the types that the node works with.
#[derive(Debug, Clone, PartialEq)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "switches that are independent of each other"
)]
pub struct Configuration {
    /// What the processing of a frame depends on.
    pub settings: Settings,
    /// Name of a shipped marker map, or the path of one.
    pub marker_map: String,
    /// Child frame of the published transform.
    pub tanker_frame_id: String,
    /// Whether to publish to /tf.
    pub publish_tf: bool,
    /// Whether time comes from /clock.
    pub use_sim_time: bool,
    /// Whether others manage the node's state.
    pub lifecycle: bool,
    /// Whether to publish what `RViz` and Foxglove can draw.
    pub publish_markers: bool,
    /// Whether to tell detectors where markers will be.
    pub publish_predicted_points: bool,
    /// Where detections come from.
    pub input: Input,
    /// Most corrected bits of a tag.
    pub max_hamming: i32,
    /// What refuelling and flight stacks are told.
    pub consumers: ConsumerConfiguration,
    /// How the camera is turned, and the tanker should be.
    pub expected_attitude: ExpectedAttitude,
}

impl Configuration {
    /// Returns whether estimates start from the nominal attitude, always or while there is no better.
    #[must_use]
    pub const fn starts_from_nominal(&self) -> bool {
        matches!(
            self.settings.estimator.initialisation,
            Initialisation::Nominal | Initialisation::Previous
        )
    }
}

/// Which messages bring the detections.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Input {
    /// `tanker_pose/FeaturePointArray`.
    FeaturePoints,
    /// `vision_msgs/Detection2DArray`.
    Detections,
    /// `apriltag_msgs/AprilTagDetectionArray`.
    AprilTags,
}

impl From<&Parameters> for Configuration {
    /// Returns the parameters' meaning; every checked set of values has one.
    fn from(parameters: &Parameters) -> Self {
        Self {
            settings: Settings {
                calibration: crate::config::CalibrationSigmas::default(),
                estimator: estimator_settings(parameters),
                pixel_sigma_px: parameters.double("pixel_sigma_px"),
                edge_margin_px: parameters.double("edge_margin_px"),
                rectified: parameters.bool("rectified"),
                track: parameters
                    .bool("track")
                    .then(|| filter_settings(parameters)),
            },
            marker_map: parameters.text("marker_map").to_owned(),
            tanker_frame_id: parameters.text("tanker_frame_id").to_owned(),
            publish_tf: parameters.bool("publish_tf"),
            use_sim_time: parameters.bool("use_sim_time"),
            lifecycle: parameters.bool("lifecycle"),
            publish_markers: parameters.bool("publish_markers"),
            publish_predicted_points: parameters.bool("publish_predicted_points"),
            input: match parameters.text("input") {
                "detections" => Input::Detections,
                "apriltags" => Input::AprilTags,
                _ => Input::FeaturePoints,
            },
            max_hamming: i32::try_from(parameters.count("max_hamming")).unwrap_or(0),
            consumers: ConsumerConfiguration::from(parameters),
            expected_attitude: expected_attitude(parameters),
        }
    }
}

fn estimator_settings(parameters: &Parameters) -> EstimatorSettings {
    EstimatorSettings {
        initialisation: match parameters.text("initialisation") {
            "dlt" => Initialisation::Dlt,
            "previous" => Initialisation::Previous,
            "global" => Initialisation::Global,
            _ => Initialisation::Nominal,
        },
        refinement: match parameters.text("refinement") {
            "none" => Refinement::None,
            _ => Refinement::MaximumLikelihood,
        },
        nominal_camera_from_tanker: nominal_attitude(parameters),
        min_points: parameters.count("min_points"),
        max_outliers: parameters.count("max_outliers"),
        trust_probability: parameters.double("trust_probability"),
        max_ambiguity: parameters.double("max_ambiguity"),
        attitude_sigma_rad: None,
    }
}

fn filter_settings(parameters: &Parameters) -> FilterSettings {
    let confirm_frames = parameters.count("confirm_frames");
    FilterSettings {
        acceleration_density_mps2: parameters.double("acceleration_density_mps2"),
        angular_acceleration_density_dps2: parameters.double("angular_acceleration_density_dps2"),
        manoeuvre_factor: parameters.double("manoeuvre_factor"),
        initial_speed_sigma_mps: parameters.double("initial_speed_sigma_mps"),
        initial_rate_sigma_dps: parameters.double("initial_rate_sigma_dps"),
        gate_probability: parameters.double("gate_probability"),
        max_gap_s: parameters.double("max_gap_s"),
        confirm_frames: u32::try_from(confirm_frames).unwrap_or(u32::MAX),
        ..FilterSettings::default()
    }
}

/// Returns the attitude that the tanker is expected to have in the camera.
///
/// `camera_from_tanker = optical_from_body · receiver_from_camera_bodyᵀ · receiver_from_tanker`:
/// the angles turn bodies with x forward, y left, z up; the optical frame looks along that x.
#[must_use]
pub fn nominal_camera_from_tanker(
    receiver_from_tanker: &Rotation3<f64>,
    receiver_from_camera_body: &Rotation3<f64>,
) -> Rotation3<f64> {
    optical_from_body() * receiver_from_camera_body.inverse() * receiver_from_tanker
}

fn nominal_attitude(parameters: &Parameters) -> Rotation3<f64> {
    let ExpectedAttitude { mount, nominal, .. } = expected_attitude(parameters);
    nominal_camera_from_tanker(&nominal.rotation(), &mount.rotation())
}

pub(super) fn expected_attitude(parameters: &Parameters) -> ExpectedAttitude {
    ExpectedAttitude {
        mount: angles(parameters, "camera_mount"),
        nominal: angles(parameters, "nominal"),
        limit_deg: parameters.double("max_attitude_deviation_deg"),
    }
}

fn angles(parameters: &Parameters, prefix: &str) -> Angles {
    let angle_deg = |axis: &str| parameters.double(&format!("{prefix}_{axis}_deg"));
    Angles {
        roll_deg: angle_deg("roll"),
        pitch_deg: angle_deg("pitch"),
        yaw_deg: angle_deg("yaw"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::ParameterValue::{Bool, Double, Integer, String};
    use nalgebra::Vector3;

    /// Rounding of a few products of sines, no unit.
    const ROUNDING: f64 = 1e-15;

    fn configuration(changes: &[(&str, crate::config::ParameterValue)]) -> Configuration {
        let mut parameters = Parameters::new(crate::config::TABLE);
        for (name, value) in changes {
            parameters
                .set(name, value.clone())
                .expect("the test's values are valid");
        }
        Configuration::from(&parameters)
    }

    fn nominal(changes: &[(&str, f64)]) -> Rotation3<f64> {
        let changes: Vec<_> = changes
            .iter()
            .map(|(name, deg)| (*name, Double(*deg)))
            .collect();
        configuration(&changes)
            .settings
            .estimator
            .nominal_camera_from_tanker
    }

    fn assert_direction(found: Vector3<f64>, expected: [f64; 3]) {
        assert!(
            (found - Vector3::from(expected)).norm() < ROUNDING,
            "{found:?} {expected:?}"
        );
    }

    #[test]
    fn aligned_tanker_flies_away_along_the_optical_axis() {
        let camera_from_tanker = nominal(&[]);
        assert_direction(camera_from_tanker * Vector3::x(), [0.0, 0.0, 1.0]);
        assert_direction(camera_from_tanker * Vector3::y(), [-1.0, 0.0, 0.0]);
        assert_direction(camera_from_tanker * Vector3::z(), [0.0, -1.0, 0.0]);
    }

    #[test]
    fn tanker_yawed_left_points_left_in_the_image() {
        let camera_from_tanker = nominal(&[("nominal_yaw_deg", 90.0)]);
        assert_direction(camera_from_tanker * Vector3::x(), [-1.0, 0.0, 0.0]);
    }

    #[test]
    fn camera_that_looks_up_sees_a_level_tanker_fly_downwards() {
        // Positive pitch turns x towards minus z: a camera that looks up has a negative one.
        let camera_from_tanker = nominal(&[("camera_mount_pitch_deg", -90.0)]);
        assert_direction(camera_from_tanker * Vector3::x(), [0.0, 1.0, 0.0]);
        assert_direction(camera_from_tanker * Vector3::z(), [0.0, 0.0, 1.0]);
    }

    #[test]
    fn camera_turned_with_the_tanker_sees_no_turn() {
        let turned = nominal(&[
            ("nominal_roll_deg", 10.0),
            ("nominal_pitch_deg", -20.0),
            ("nominal_yaw_deg", 30.0),
            ("camera_mount_roll_deg", 10.0),
            ("camera_mount_pitch_deg", -20.0),
            ("camera_mount_yaw_deg", 30.0),
        ]);
        assert!(turned.rotation_to(&nominal(&[])).angle() < 1e-7); // acos near 1 loses half the digits
    }

    #[test]
    fn every_parameter_reaches_its_setting() {
        let found = configuration(&[
            ("marker_map", String("fin6".into())),
            ("tanker_frame_id", String("kc46".into())),
            ("publish_tf", Bool(true)),
            ("use_sim_time", Bool(true)),
            ("lifecycle", Bool(true)),
            ("publish_markers", Bool(true)),
            ("publish_predicted_points", Bool(true)),
            ("input", String("apriltags".into())),
            ("max_hamming", Integer(2)),
            ("pixel_sigma_px", Double(0.25)),
            ("edge_margin_px", Double(7.0)),
            ("rectified", Bool(true)),
            ("initialisation", String("global".into())),
            ("refinement", String("none".into())),
            ("max_outliers", Integer(1)),
            ("min_points", Integer(5)),
            ("trust_probability", Double(0.95)),
            ("max_ambiguity", Double(0.5)),
            ("acceleration_density_mps2", Double(0.3)),
            ("angular_acceleration_density_dps2", Double(5.0)),
            ("manoeuvre_factor", Double(2.0)),
            ("initial_speed_sigma_mps", Double(7.0)),
            ("initial_rate_sigma_dps", Double(8.0)),
            ("gate_probability", Double(0.99)),
            ("max_gap_s", Double(0.5)),
            ("confirm_frames", Integer(9)),
        ]);
        let estimator = &found.settings.estimator;
        assert_eq!(
            (found.marker_map.as_str(), found.tanker_frame_id.as_str()),
            ("fin6", "kc46")
        );
        assert!(found.publish_tf && found.publish_markers && found.settings.rectified);
        assert!(found.use_sim_time && found.lifecycle && found.publish_predicted_points);
        assert_eq!((found.input, found.max_hamming), (Input::AprilTags, 2));
        assert!((found.settings.pixel_sigma_px - 0.25).abs() < f64::EPSILON);
        assert!((found.settings.edge_margin_px - 7.0).abs() < f64::EPSILON);
        assert_eq!(estimator.initialisation, Initialisation::Global);
        assert_eq!(estimator.refinement, Refinement::None);
        assert_eq!((estimator.max_outliers, estimator.min_points), (1, 5));
        assert!((estimator.trust_probability - 0.95).abs() < f64::EPSILON);
        assert!((estimator.max_ambiguity - 0.5).abs() < f64::EPSILON);
        let track = FilterSettings {
            acceleration_density_mps2: 0.3,
            angular_acceleration_density_dps2: 5.0,
            manoeuvre_factor: 2.0,
            initial_speed_sigma_mps: 7.0,
            initial_rate_sigma_dps: 8.0,
            gate_probability: 0.99,
            max_gap_s: 0.5,
            confirm_frames: 9,
            ..FilterSettings::default()
        };
        assert_eq!(found.settings.track, Some(track));
    }

    #[test]
    fn frames_are_judged_with_the_estimators_own_defaults() {
        let default = configuration(&[]).settings.estimator;
        assert_eq!(default, EstimatorSettings::default());
    }

    #[test]
    fn track_is_on_with_the_filters_own_defaults_and_can_be_switched_off() {
        let default = configuration(&[]).settings.track;
        assert_eq!(default, Some(FilterSettings::default()));
        let off = configuration(&[("track", Bool(false))]).settings.track;
        assert_eq!(off, None);
    }

    #[test]
    fn every_value_that_the_table_allows_is_one_that_the_filter_takes() {
        for spec in crate::config::TABLE {
            let extremes = match spec.kind {
                crate::config::Kind::Double { min, max, .. } => [Double(min), Double(max)],
                crate::config::Kind::Integer { min, max, .. } => [Integer(min), Integer(max)],
                _ => continue,
            };
            for value in extremes {
                let track = configuration(&[(spec.name, value.clone())]).settings.track;
                let filter = track.map(crate::tracking::Filter::new);
                assert!(matches!(filter, Some(Ok(_))), "{} {value}", spec.name);
            }
        }
    }

    #[test]
    fn every_word_of_input_has_its_own_meaning() {
        for (word, meaning) in [
            ("feature_points", Input::FeaturePoints),
            ("detections", Input::Detections),
            ("apriltags", Input::AprilTags),
        ] {
            assert_eq!(
                configuration(&[("input", String(word.into()))]).input,
                meaning
            );
        }
    }

    #[test]
    fn every_word_of_initialisation_has_its_own_meaning() {
        for (word, meaning) in [
            ("nominal", Initialisation::Nominal),
            ("dlt", Initialisation::Dlt),
            ("previous", Initialisation::Previous),
            ("global", Initialisation::Global),
        ] {
            let found = configuration(&[("initialisation", String(word.into()))]);
            assert_eq!(found.settings.estimator.initialisation, meaning);
        }
    }
}
