//! A pose message as people read it.

use nalgebra::Matrix6;
use tanker_pose::frames::{PoseEstimate, flu_from_optical, rotation_only};
use tanker_pose::geometry::PoseCovariance;
use tanker_pose::ros::convert::isometry;
use tanker_pose::ros::messages::PoseWithCovarianceStamped;

/// A pose as people read it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// Of the tanker in the camera: right, down, ahead; m.
    pub position_m: [f64; 3],
    /// Its standard deviations, m.
    pub position_sigma_m: [f64; 3],
    /// Roll, pitch and yaw of the tanker against the camera's body axes (x ahead, y left, z up); degrees.
    pub attitude_deg: [f64; 3],
    /// Standard deviations about those axes, degrees.
    pub attitude_sigma_deg: [f64; 3],
}

impl Reading {
    /// Returns what a message says; `None` if it holds no rotation.
    pub fn of(message: &PoseWithCovarianceStamped) -> Option<Self> {
        let optical = PoseEstimate {
            b_from_a: isometry(&message.pose.pose)?,
            covariance: PoseCovariance(Matrix6::from_row_slice(&message.pose.covariance)),
        };
        let body = optical.seen_from(&rotation_only(&flu_from_optical()));
        let (roll, pitch, yaw) = body.b_from_a.rotation.euler_angles();
        let sigma = |pose: &PoseEstimate, axis: usize| pose.covariance.0[(axis, axis)].sqrt();
        Some(Self {
            position_m: optical.b_from_a.translation.vector.into(),
            position_sigma_m: std::array::from_fn(|axis| sigma(&optical, axis)),
            attitude_deg: [roll, pitch, yaw].map(f64::to_degrees),
            attitude_sigma_deg: std::array::from_fn(|axis| sigma(&body, 3 + axis).to_degrees()),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    use tanker_pose::geometry::rotation_from_roll_pitch_yaw;
    use tanker_pose::ros::messages::{Header, Point, Pose, PoseWithCovariance, Quaternion};

    /// Rounding of a few rotations of numbers about 10.
    const ROUNDING: f64 = 1e-12;

    fn message(position: [f64; 3], roll_pitch_yaw_deg: [f64; 3]) -> PoseWithCovarianceStamped {
        let [roll, pitch, yaw] = roll_pitch_yaw_deg.map(f64::to_radians);
        let optical_from_tanker =
            flu_from_optical().inverse() * rotation_from_roll_pitch_yaw(roll, pitch, yaw);
        let q = nalgebra::UnitQuaternion::from_rotation_matrix(&optical_from_tanker);
        let mut covariance = [0.0; 36];
        for (axis, sigma) in [0.1, 0.2, 0.3, 0.01, 0.02, 0.03].into_iter().enumerate() {
            covariance[7 * axis] = sigma * sigma;
        }
        let [x, y, z] = position;
        PoseWithCovarianceStamped {
            header: Header::default(),
            pose: PoseWithCovariance {
                pose: Pose {
                    position: Point { x, y, z },
                    orientation: Quaternion {
                        x: q.i,
                        y: q.j,
                        z: q.k,
                        w: q.w,
                    },
                },
                covariance,
            },
        }
    }

    #[test]
    fn attitude_is_that_against_a_camera_that_looks_ahead_with_the_sigmas_of_its_axes() {
        let reading =
            Reading::of(&message([1.0, -2.0, 30.0], [3.0, -4.0, 5.0])).expect("a rotation");
        for (found, given) in reading.position_m.iter().zip([1.0, -2.0, 30.0]) {
            assert!((found - given).abs() < ROUNDING, "{:?}", reading.position_m);
        }
        for (found, given) in reading.attitude_deg.iter().zip([3.0, -4.0, 5.0]) {
            assert!(
                (found - given).abs() < ROUNDING,
                "{:?}",
                reading.attitude_deg
            );
        }
        // Roll is about the camera's ahead, pitch about its right, yaw about its down.
        for (found, given) in reading
            .attitude_sigma_deg
            .iter()
            .zip([0.03_f64, 0.01, 0.02])
        {
            assert!((found - given.to_degrees()).abs() < ROUNDING);
        }
        assert!((reading.position_sigma_m[2] - 0.3).abs() < ROUNDING);
    }

    #[test]
    fn pose_without_a_rotation_is_not_shown() {
        let mut wrong = message([0.0; 3], [0.0; 3]);
        wrong.pose.pose.orientation = Quaternion {
            x: 0.0,
            y: 0.0,
            z: 0.0,
            w: 0.0,
        };
        assert!(Reading::of(&wrong).is_none());
    }
}
