//! Settings of the outputs for refuelling and flight stacks, and their requirements.

use nalgebra::{Matrix3, Rotation3};
use ros2_node::parameters::Key;

use super::attitude::expected_attitude;
use super::table::{KEYS, Values};
use super::words::AttitudeSource;

/// The optional outputs and the settings that they need.
#[derive(Debug, Clone, PartialEq)]
#[expect(clippy::struct_excessive_bools, reason = "a switch for each output")]
pub struct ConsumerConfiguration {
    /// Path of the refuelling setup.
    pub refuelling: Option<String>,
    /// Frame of the receptacle's messages.
    pub receiver_frame_id: String,
    /// The mount of the camera: rotation from optical axes to the receiver's, FLU.
    pub receiver_from_camera: Rotation3<f64>,
    /// Whether to publish the receptacle relative to the probe tip.
    pub receptacle: bool,
    /// `px4_msgs/LandingTargetPose`.
    pub px4_landing_target: bool,
    /// `px4_msgs/FiducialMarkerPosReport`.
    pub px4_fiducial_marker: bool,
    /// `mavros_msgs/LandingTarget`.
    pub mavros_landing_target: bool,
    /// `geometry_msgs/PoseStamped` for MAVROS.
    pub mavros_pose: bool,
    /// The source of the receiver's attitude.
    pub attitude: Option<AttitudeSource>,
    /// Largest time difference between an attitude and the image, s.
    pub attitude_max_age_s: f64,
    /// Covariance of the attitude, rad².
    pub attitude_covariance: Matrix3<f64>,
    /// Covariance of the receiver's rate, (rad/s)².
    pub attitude_rate_covariance: Matrix3<f64>,
    /// PX4's clock minus ROS's, µs.
    pub px4_minus_ros_us: i64,
    /// Whether there is a track; some outputs publish it.
    pub track: bool,
    /// Whether outputs are held back while an alert limit is not kept.
    pub require_integrity: bool,
}

/// Why outputs cannot be switched on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum OutputError {
    /// A parameter that an output needs is not set.
    #[error("{output} needs the parameter {needs:?}, which is \"none\"")]
    Missing {
        /// The parameter that switches the output on.
        output: &'static str,
        /// The parameter that is missing.
        needs: &'static str,
    },
    /// The output needs the track, which is switched off.
    #[error("{output} comes from the track: the parameter \"track\" must be true with it")]
    NoTrack {
        /// The parameter that switches the output on.
        output: &'static str,
    },
    /// Two outputs that the same reader would receive alternately.
    #[error(
        "{first} and {second} exclude each other: PX4 answers the second with a landing target of its own, \
         which would alternate with the first on one topic"
    )]
    TwoWriters {
        /// The parameter that switches the first one on.
        first: &'static str,
        /// The parameter that switches the second one on.
        second: &'static str,
    },
}

/// One output.
struct OutputSpec {
    /// The parameter that switches it on.
    name: &'static str,
    on: bool,
    needs_attitude: bool,
    /// Whether it publishes the track rather than single frames.
    needs_track: bool,
}

impl ConsumerConfiguration {
    /// Checks that every output has what it needs.
    ///
    /// # Errors
    /// [`OutputError`] names the first output that lacks something, or two that exclude each other.
    pub fn check(&self) -> Result<(), OutputError> {
        for output in self.outputs().into_iter().filter(|output| output.on) {
            let missing = |needs| OutputError::Missing {
                output: output.name,
                needs,
            };
            if self.refuelling.is_none() {
                return Err(missing(KEYS.refuelling.name()));
            }
            if output.needs_attitude && self.attitude.is_none() {
                return Err(missing(KEYS.attitude.name()));
            }
            if output.needs_track && !self.track {
                return Err(OutputError::NoTrack {
                    output: output.name,
                });
            }
        }
        // PX4's vision_target_estimator publishes landing_target_pose from the marker report. With ours on the same
        // uORB topic, readers receive both alternately, and the approach of precision landing reads x_abs and y_abs of
        // each message, valid or not.
        if self.px4_landing_target && self.px4_fiducial_marker {
            return Err(OutputError::TwoWriters {
                first: KEYS.publish_px4_landing_target.name(),
                second: KEYS.publish_px4_fiducial_marker.name(),
            });
        }
        Ok(())
    }

    /// Returns whether any output is on.
    #[must_use]
    pub fn any(&self) -> bool {
        self.outputs().iter().any(|output| output.on)
    }

    fn outputs(&self) -> [OutputSpec; 5] {
        let output = |key: &Key<bool>, on, needs_attitude, needs_track| OutputSpec {
            name: key.name(),
            on,
            needs_attitude,
            needs_track,
        };
        let keys = KEYS;
        [
            output(&keys.publish_receptacle, self.receptacle, false, true),
            output(
                &keys.publish_px4_landing_target,
                self.px4_landing_target,
                true,
                true,
            ),
            output(
                &keys.publish_px4_fiducial_marker,
                self.px4_fiducial_marker,
                true,
                false,
            ),
            output(
                &keys.publish_mavros_landing_target,
                self.mavros_landing_target,
                false,
                false,
            ),
            output(&keys.publish_mavros_pose, self.mavros_pose, true, false),
        ]
    }
}

impl From<&Values> for ConsumerConfiguration {
    fn from(values: &Values) -> Self {
        let isotropic = |sigma_deg: f64| {
            let sigma = sigma_deg.to_radians();
            Matrix3::identity() * (sigma * sigma)
        };
        Self {
            refuelling: values.refuelling.clone(),
            receiver_frame_id: values.receiver_frame_id.clone(),
            receiver_from_camera: expected_attitude(values).receiver_from_camera(),
            receptacle: values.publish_receptacle,
            px4_landing_target: values.publish_px4_landing_target,
            px4_fiducial_marker: values.publish_px4_fiducial_marker,
            mavros_landing_target: values.publish_mavros_landing_target,
            mavros_pose: values.publish_mavros_pose,
            attitude: values.attitude.0,
            attitude_max_age_s: values.attitude_max_age_s,
            attitude_covariance: isotropic(values.attitude_sigma_deg),
            attitude_rate_covariance: isotropic(values.attitude_rate_sigma_dps),
            px4_minus_ros_us: values.px4_minus_ros_us,
            track: values.track,
            require_integrity: values.require_integrity,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::ParameterValue::{self, Bool, Double, Integer, String};
    use crate::config::Parameters;
    use nalgebra::Vector3;

    fn found(changes: &[(&str, ParameterValue)]) -> ConsumerConfiguration {
        let mut parameters = Parameters::new(crate::config::TABLE);
        for (name, value) in changes {
            parameters
                .set(name, value.clone())
                .expect("the test's values are valid");
        }
        ConsumerConfiguration::from(&Values::from(&parameters))
    }

    #[test]
    fn nothing_is_on_by_default() {
        assert!(!found(&[]).any());
        assert_eq!(found(&[]).check(), Ok(()));
    }

    #[test]
    fn each_output_has_its_own_parameter_and_asks_for_what_it_needs() {
        for (i, output) in found(&[]).outputs().into_iter().enumerate() {
            let name = output.name;
            let on = (name, Bool(true));
            let file = ("refuelling", String("a.yaml".into()));
            let attitude = ("attitude", String("imu".into()));
            let alone = found(std::slice::from_ref(&on));
            let switched: Vec<bool> = alone.outputs().iter().map(|output| output.on).collect();
            assert_eq!(switched.iter().filter(|on| **on).count(), 1);
            assert!(switched[i] && alone.any(), "{name}");
            let missing = |needs| {
                Err(OutputError::Missing {
                    output: name,
                    needs,
                })
            };
            assert_eq!(alone.check(), missing("refuelling"));
            let with_file = found(&[on.clone(), file.clone()]).check();
            if output.needs_attitude {
                assert_eq!(with_file, missing("attitude"));
            } else {
                assert_eq!(with_file, Ok(()));
            }
            let with_all = [on, file, attitude, ("track", Bool(true))];
            assert_eq!(found(&with_all).check(), Ok(()), "{name}");
            let mut without_track = with_all;
            without_track[3].1 = Bool(false);
            let refused = Err(OutputError::NoTrack { output: name });
            let expected = if output.needs_track { refused } else { Ok(()) };
            assert_eq!(found(&without_track).check(), expected);
        }
    }

    #[test]
    fn the_outputs_that_px4_would_take_in_turns_exclude_each_other_and_no_others_do() {
        let names = found(&[]).outputs().map(|output| output.name);
        for (i, first) in names.into_iter().enumerate() {
            for second in &names[i + 1..] {
                let refused = found(&[
                    ("refuelling", String("a.yaml".into())),
                    ("attitude", String("px4".into())),
                    (first, Bool(true)),
                    (second, Bool(true)),
                ])
                .check()
                .is_err();
                let px4 = first.contains("px4") && second.contains("px4");
                assert_eq!(refused, px4, "{first} {second}");
            }
        }
    }

    #[test]
    fn every_parameter_reaches_its_place() {
        let found = found(&[
            ("receiver_frame_id", String("uav1/base_link".into())),
            ("camera_mount_yaw_deg", Double(90.0)),
            ("attitude", String("px4".into())),
            ("attitude_max_age_s", Double(0.25)),
            ("attitude_sigma_deg", Double(2.0)),
            ("attitude_rate_sigma_dps", Double(3.0)),
            ("px4_minus_ros_us", Integer(-7)),
            ("track", Bool(false)),
        ]);
        assert_eq!(found.receiver_frame_id, "uav1/base_link");
        // The camera looks left.
        let ahead = found.receiver_from_camera * Vector3::z();
        assert!((ahead - Vector3::y()).norm() < 1e-15);
        assert_eq!(found.attitude, Some(AttitudeSource::Px4));
        assert!((found.attitude_max_age_s - 0.25).abs() < f64::EPSILON);
        let (sigma, rate) = (2.0_f64.to_radians(), 3.0_f64.to_radians());
        assert!((found.attitude_covariance[(2, 2)] - sigma * sigma).abs() < 1e-18);
        assert!((found.attitude_rate_covariance[(0, 0)] - rate * rate).abs() < 1e-18);
        assert_eq!(found.px4_minus_ros_us, -7);
        assert!(!found.track);
    }
}
