//! What refuelling and flight stacks are told, and what that needs.

use nalgebra::{Matrix3, Rotation3};

use super::Parameters;
use super::configuration::turned;
use crate::geometry::optical_from_body;

/// Where the receiver's attitude comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AttitudeSource {
    /// `px4_msgs/VehicleAttitude`.
    Px4,
    /// `sensor_msgs/Imu`.
    Imu,
}

/// The optional outputs behind the pose, and what they need.
#[derive(Debug, Clone, PartialEq)]
#[expect(clippy::struct_excessive_bools, reason = "a switch for each output")]
pub struct ConsumerConfiguration {
    /// Path of the refuelling setup.
    pub refuelling: Option<String>,
    /// Frame of the receptacle's messages.
    pub receiver_frame_id: String,
    /// How the camera is turned: optical axes to the receiver's, FLU.
    pub receiver_from_camera: Rotation3<f64>,
    /// The receptacle before the probe tip.
    pub receptacle: bool,
    /// `px4_msgs/LandingTargetPose`.
    pub px4_landing_target: bool,
    /// `px4_msgs/FiducialMarkerPosReport`.
    pub px4_fiducial_marker: bool,
    /// `mavros_msgs/LandingTarget`.
    pub mavros_landing_target: bool,
    /// `geometry_msgs/PoseStamped` for MAVROS.
    pub mavros_pose: bool,
    /// Where the receiver's attitude comes from.
    pub attitude: Option<AttitudeSource>,
    /// Farthest that an attitude may be from the image, s.
    pub attitude_max_age_s: f64,
    /// Covariance of the attitude, rad².
    pub attitude_covariance: Matrix3<f64>,
    /// Covariance of the receiver's rate, (rad/s)².
    pub attitude_rate_covariance: Matrix3<f64>,
    /// What PX4's clock shows more than ROS's, µs.
    pub px4_minus_ros_us: i64,
}

/// An output that cannot be, since what it needs is not given.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{output} needs the parameter {needs:?}, which is \"none\"")]
pub struct MissingForOutput {
    /// The parameter that switches it on.
    pub output: &'static str,
    /// The parameter that is missing.
    pub needs: &'static str,
}

impl ConsumerConfiguration {
    /// Returns nothing when every output has what it needs.
    ///
    /// # Errors
    /// [`MissingForOutput`] names the first that has not.
    pub fn check(&self) -> Result<(), MissingForOutput> {
        for (output, on, needs_attitude) in self.outputs() {
            if on && self.refuelling.is_none() {
                let needs = "refuelling";
                return Err(MissingForOutput { output, needs });
            }
            if on && needs_attitude && self.attitude.is_none() {
                let needs = "attitude";
                return Err(MissingForOutput { output, needs });
            }
        }
        Ok(())
    }

    /// Returns whether any output is on.
    #[must_use]
    pub fn any(&self) -> bool {
        self.outputs().iter().any(|(_, on, _)| *on)
    }

    fn outputs(&self) -> [(&'static str, bool, bool); 5] {
        [
            ("publish_receptacle", self.receptacle, false),
            ("publish_px4_landing_target", self.px4_landing_target, true),
            (
                "publish_px4_fiducial_marker",
                self.px4_fiducial_marker,
                true,
            ),
            (
                "publish_mavros_landing_target",
                self.mavros_landing_target,
                false,
            ),
            ("publish_mavros_pose", self.mavros_pose, true),
        ]
    }
}

impl From<&Parameters> for ConsumerConfiguration {
    fn from(parameters: &Parameters) -> Self {
        let isotropic = |name| {
            let sigma = parameters.double(name).to_radians();
            Matrix3::identity() * (sigma * sigma)
        };
        Self {
            refuelling: match parameters.text("refuelling") {
                "none" => None,
                path => Some(path.to_owned()),
            },
            receiver_frame_id: parameters.text("receiver_frame_id").to_owned(),
            receiver_from_camera: turned(parameters, "camera_mount")
                * optical_from_body().inverse(),
            receptacle: parameters.bool("publish_receptacle"),
            px4_landing_target: parameters.bool("publish_px4_landing_target"),
            px4_fiducial_marker: parameters.bool("publish_px4_fiducial_marker"),
            mavros_landing_target: parameters.bool("publish_mavros_landing_target"),
            mavros_pose: parameters.bool("publish_mavros_pose"),
            attitude: match parameters.text("attitude") {
                "px4" => Some(AttitudeSource::Px4),
                "imu" => Some(AttitudeSource::Imu),
                _ => None,
            },
            attitude_max_age_s: parameters.double("attitude_max_age_s"),
            attitude_covariance: isotropic("attitude_sigma_deg"),
            attitude_rate_covariance: isotropic("attitude_rate_sigma_dps"),
            px4_minus_ros_us: parameters.integer("px4_minus_ros_us"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::ParameterValue::{self, Bool, Double, Integer, String};
    use nalgebra::Vector3;

    fn found(changes: &[(&str, ParameterValue)]) -> ConsumerConfiguration {
        let mut parameters = Parameters::default();
        for (name, value) in changes {
            parameters
                .set(name, value.clone())
                .expect("the test's values are valid");
        }
        ConsumerConfiguration::from(&parameters)
    }

    #[test]
    fn nothing_is_on_by_default() {
        assert!(!found(&[]).any());
        assert_eq!(found(&[]).check(), Ok(()));
    }

    #[test]
    fn each_output_has_its_own_parameter_and_asks_for_what_it_needs() {
        let outputs = found(&[]).outputs();
        for (i, (name, _, needs_attitude)) in outputs.into_iter().enumerate() {
            let on = (name, Bool(true));
            let file = ("refuelling", String("a.yaml".into()));
            let alone = found(std::slice::from_ref(&on));
            let switched: Vec<bool> = alone.outputs().iter().map(|(_, on, _)| *on).collect();
            assert_eq!(switched.iter().filter(|on| **on).count(), 1);
            assert!(switched[i] && alone.any(), "{name}");
            let missing = alone.check().expect_err("no setup");
            assert_eq!((missing.output, missing.needs), (name, "refuelling"));
            let with_file = found(&[on.clone(), file.clone()]).check();
            assert_eq!(with_file.is_err(), needs_attitude, "{name}");
            let with_all = found(&[on, file, ("attitude", String("imu".into()))]);
            assert_eq!(with_all.check(), Ok(()), "{name}");
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
    }
}
