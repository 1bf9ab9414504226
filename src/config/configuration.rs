//! The checked parameters as the types that the node uses.

use nalgebra::Rotation3;

use super::attitude::expected_attitude;
use super::table::Values;
use super::{
    CalibrationSigmas, ConsumerConfiguration, Input, Parameters, ReportedAttitudeSettings, Settings,
};
use crate::estimation::{CorrelatedNoise, EstimatorSettings, Initialisation};
use crate::geometry::optical_from_body;
use crate::integrity::IntegritySettings;
use crate::refuelling::ExpectedAttitude;
use crate::tracking::{CheckedFilterSettings, FilterSettings};

/// All parameters, in the types that the node uses.
#[derive(Debug, Clone, PartialEq)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "switches that are independent of each other"
)]
pub struct Configuration {
    /// Settings for the processing of a frame.
    pub settings: Settings,
    /// Name of a shipped marker map, or the path of one.
    pub marker_map: String,
    /// Path of a calibration error budget, used in place of the sigmas in the settings.
    pub calibration_budget_file: Option<String>,
    /// Child frame of the published transform.
    pub tanker_frame_id: String,
    /// Whether to publish to /tf.
    pub publish_tf: bool,
    /// Whether time comes from /clock.
    pub use_sim_time: bool,
    /// Whether the node is managed: a lifecycle node.
    pub lifecycle: bool,
    /// Whether to publish protection levels.
    pub publish_integrity: bool,
    /// Whether to publish markers for `RViz` and Foxglove.
    pub publish_markers: bool,
    /// Whether to publish predicted points for detectors.
    pub publish_predicted_points: bool,
    /// The source of detections.
    pub input: Input,
    /// Most corrected bits of a tag.
    pub max_hamming: i32,
    /// How long detections may stay the same to the last bit, s; 0: for ever.
    pub max_frozen_s: f64,
    /// Settings of the outputs for refuelling and flight stacks.
    pub consumers: ConsumerConfiguration,
    /// Farthest that an attitude of the tanker may be from the image, s.
    pub tanker_attitude_max_age_s: f64,
    /// The mount of the camera and the expected attitude of the tanker.
    pub expected_attitude: ExpectedAttitude,
}

impl Configuration {
    /// Returns whether estimates start from the nominal attitude, always or until a better one is known.
    #[must_use]
    pub const fn starts_from_nominal(&self) -> bool {
        matches!(
            self.settings.estimator.initialisation,
            Initialisation::Nominal | Initialisation::Previous
        )
    }
}

impl From<&Parameters> for Configuration {
    /// Converts the parameters; this cannot fail for checked values.
    fn from(parameters: &Parameters) -> Self {
        let values = Values::from(parameters);
        Self {
            settings: Settings {
                calibration: calibration_sigmas(&values),
                correlated_noise: correlated_noise(&values),
                estimator: estimator_settings(&values),
                reported_attitude: reported_attitude(&values),
                pixel_sigma_px: values.pixel_sigma_px,
                edge_margin_px: values.edge_margin_px,
                widen_by_sigma_factor: values.widen_by_sigma_factor,
                rectified: values.rectified,
                integrity: values.publish_integrity.then(|| integrity(&values)),
                receiver_from_camera: expected_attitude(&values).receiver_from_camera(),
                track: values.track.then(|| filter_settings(&values)),
            },
            tanker_attitude_max_age_s: values.tanker_attitude_max_age_s,
            expected_attitude: expected_attitude(&values),
            consumers: ConsumerConfiguration::from(&values),
            marker_map: values.marker_map,
            calibration_budget_file: values.calibration_budget_file,
            tanker_frame_id: values.tanker_frame_id,
            publish_tf: values.publish_tf,
            use_sim_time: values.use_sim_time,
            lifecycle: values.lifecycle,
            publish_integrity: values.publish_integrity,
            publish_markers: values.publish_markers,
            publish_predicted_points: values.publish_predicted_points,
            input: values.input,
            max_hamming: values.max_hamming,
            max_frozen_s: values.max_frozen_s,
        }
    }
}

fn estimator_settings(values: &Values) -> EstimatorSettings {
    EstimatorSettings {
        initialisation: values.initialisation,
        refinement: values.refinement,
        nominal_camera_from_tanker: nominal_attitude(values),
        min_points: values.min_points,
        max_outliers: values.max_outliers,
        trust_probability: values.trust_probability,
        max_ambiguity: values.max_ambiguity,
        attitude_sigma_rad: (values.nominal_attitude_sigma_deg > 0.0)
            .then(|| values.nominal_attitude_sigma_deg.to_radians()),
        certify: values.certify || values.require_certificate,
        require_certificate: values.require_certificate,
    }
}

fn integrity(values: &Values) -> IntegritySettings {
    IntegritySettings {
        hmi_probability: values.hmi_probability,
        false_alert_probability: values.false_alert_probability,
        fault_probability: values.beacon_fault_probability,
        pairs: values.monitor_pairs,
        flex_fault_probability: values.flex_fault_probability,
        calibration_fault_probability: values.calibration_fault_probability,
        frames: values.integrity_frames,
    }
}

fn reported_attitude(values: &Values) -> Option<ReportedAttitudeSettings> {
    let sigma_deg = values.reported_attitude_sigma_deg;
    (sigma_deg > 0.0).then(|| ReportedAttitudeSettings {
        camera_from_receiver: expected_attitude(values).receiver_from_camera().inverse(),
        sigma_rad: sigma_deg.to_radians(),
    })
}

fn calibration_sigmas(values: &Values) -> CalibrationSigmas {
    CalibrationSigmas {
        focal_length: values.focal_length_sigma,
        principal_point_px: values.principal_point_sigma_px,
        distortion: [
            values.k1_sigma,
            values.k2_sigma,
            0.0,
            0.0,
            0.0,
            0.0,
            0.0,
            0.0,
        ],
        jitter_px: values.jitter_px,
    }
}

fn correlated_noise(values: &Values) -> Option<CorrelatedNoise> {
    let share = values.correlated_noise_share;
    (share > 0.0).then(|| {
        CorrelatedNoise::new(share, values.correlated_noise_time_s)
            .expect("the ranges in the table are those of the check")
    })
}

fn filter_settings(values: &Values) -> CheckedFilterSettings {
    let settings = FilterSettings {
        acceleration_density_mps2: values.acceleration_density_mps2,
        angular_acceleration_density_dps2: values.angular_acceleration_density_dps2,
        manoeuvre_factor: values.manoeuvre_factor,
        initial_speed_sigma_mps: values.initial_speed_sigma_mps,
        initial_rate_sigma_dps: values.initial_rate_sigma_dps,
        gate_probability: values.gate_probability,
        max_gap_s: values.max_gap_s,
        confirm_frames: values.confirm_frames,
        ..FilterSettings::default()
    };
    settings
        .checked()
        .expect("the ranges in the table are within those of the filter, as a test checks")
}

/// Returns the expected attitude of the tanker in the camera.
///
/// `camera_from_tanker = optical_from_body · receiver_from_camera_bodyᵀ · receiver_from_tanker`: the angles rotate
/// bodies with x forward, y left, z up; the optical frame looks along that x.
#[must_use]
pub fn nominal_camera_from_tanker(
    receiver_from_tanker: &Rotation3<f64>,
    receiver_from_camera_body: &Rotation3<f64>,
) -> Rotation3<f64> {
    optical_from_body() * receiver_from_camera_body.inverse() * receiver_from_tanker
}

fn nominal_attitude(values: &Values) -> Rotation3<f64> {
    let ExpectedAttitude { mount, nominal, .. } = expected_attitude(values);
    nominal_camera_from_tanker(&nominal.rotation(), &mount.rotation())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::ParameterValue::{Bool, Double, Integer, String};
    use crate::estimation::Refinement;
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
    fn a_reported_attitude_passes_through_the_mount_as_the_nominal_one_does() {
        let mount = [
            ("camera_mount_roll_deg", Double(3.0)),
            ("camera_mount_pitch_deg", Double(14.0)),
            ("camera_mount_yaw_deg", Double(-6.0)),
            ("reported_attitude_sigma_deg", Double(1.0)),
            ("nominal_roll_deg", Double(2.0)),
            ("nominal_pitch_deg", Double(-4.0)),
            ("nominal_yaw_deg", Double(9.0)),
        ];
        let Configuration {
            settings,
            expected_attitude,
            ..
        } = configuration(&mount);
        let reported = settings.reported_attitude.expect("a prior");
        let found = reported.camera_from_receiver * expected_attitude.nominal.rotation();
        let expected = settings.estimator.nominal_camera_from_tanker;
        assert!((found.matrix() - expected.matrix()).norm() < 1e-14);
        assert_eq!(configuration(&[]).settings.reported_attitude, None);
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
            ("max_frozen_s", Double(2.5)),
            ("pixel_sigma_px", Double(0.25)),
            ("edge_margin_px", Double(7.0)),
            ("rectified", Bool(true)),
            ("widen_by_sigma_factor", Bool(true)),
            ("initialisation", String("global".into())),
            ("refinement", String("none".into())),
            ("max_outliers", Integer(1)),
            ("min_points", Integer(5)),
            ("trust_probability", Double(0.95)),
            ("max_ambiguity", Double(0.5)),
            ("nominal_attitude_sigma_deg", Double(6.0)),
            ("reported_attitude_sigma_deg", Double(2.0)),
            ("tanker_attitude_max_age_s", Double(0.3)),
            ("focal_length_sigma", Double(0.003)),
            ("principal_point_sigma_px", Double(3.0)),
            ("k1_sigma", Double(0.02)),
            ("k2_sigma", Double(0.01)),
            ("jitter_px", Double(0.4)),
            ("calibration_budget_file", String("c.yaml".into())),
            ("correlated_noise_share", Double(0.3)),
            ("correlated_noise_time_s", Double(2.0)),
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
        assert!(found.settings.widen_by_sigma_factor);
        assert_eq!(found.calibration_budget_file.as_deref(), Some("c.yaml"));
        let lasting = CorrelatedNoise::new(0.3, 2.0).expect("in range");
        assert_eq!(found.settings.correlated_noise, Some(lasting));
        assert!(found.use_sim_time && found.lifecycle && found.publish_predicted_points);
        assert!((found.max_frozen_s - 2.5).abs() < f64::EPSILON);
        assert_eq!((found.input, found.max_hamming), (Input::AprilTags, 2));
        assert!((found.settings.pixel_sigma_px - 0.25).abs() < f64::EPSILON);
        assert!((found.settings.edge_margin_px - 7.0).abs() < f64::EPSILON);
        assert_eq!(estimator.initialisation, Initialisation::Global);
        assert_eq!(estimator.refinement, Refinement::None);
        assert_eq!((estimator.max_outliers, estimator.min_points), (1, 5));
        assert!((estimator.trust_probability - 0.95).abs() < f64::EPSILON);
        assert!((estimator.max_ambiguity - 0.5).abs() < f64::EPSILON);
        let sigma = estimator.attitude_sigma_rad.expect("a prior");
        assert!((sigma.to_degrees() - 6.0).abs() < 1e-12);
        let reported = found.settings.reported_attitude.expect("a prior");
        assert!((reported.sigma_rad.to_degrees() - 2.0).abs() < 1e-12);
        assert!((found.tanker_attitude_max_age_s - 0.3).abs() < f64::EPSILON);
        let calibration = CalibrationSigmas {
            focal_length: 0.003,
            principal_point_px: 3.0,
            distortion: [0.02, 0.01, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            jitter_px: 0.4,
        };
        assert_eq!(found.settings.calibration, calibration);
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
        assert_eq!(
            found.settings.track,
            Some(track.checked().expect("in range"))
        );
    }

    #[test]
    fn frames_are_judged_with_the_estimators_own_defaults() {
        let default = configuration(&[]).settings.estimator;
        assert_eq!(default, EstimatorSettings::default());
    }

    #[test]
    fn track_is_on_with_the_filters_own_defaults_and_can_be_switched_off() {
        let default = configuration(&[]).settings.track;
        let own = FilterSettings::default().checked().expect("in range");
        assert_eq!(default, Some(own));
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
                // Settings out of the filter's ranges would panic here.
                let track = configuration(&[(spec.name, value.clone())]).settings.track;
                assert!(track.is_some(), "{} {value}", spec.name);
            }
        }
    }
}
