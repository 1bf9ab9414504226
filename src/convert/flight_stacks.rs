//! The receptacle as flight stacks take it, and an aircraft's attitude as they send it.
//!
//! All start from the receptacle in the receiver's body axes (FLU, about its origin). Local axes are NED here;
//! attitudes are `NED_from_FRD`.

mod attitudes;

use nalgebra::{Isometry3, Rotation3, Vector3};

pub use attitudes::{imu_attitude, px4_attitude};

use super::tools::pose_message;
use crate::frames::{
    LocalAttitude, PoseEstimate, TimeError, UprightError, VarianceError, frd_from_flu,
    ned_from_enu, px4_us_from_ros_ns, px4_variances, rotation_only,
};
use crate::geometry::Motion;
use crate::messages::{
    FiducialMarkerPosReport, Header, LandingTarget, LandingTargetPose, PoseStamped,
};

/// Why there is no message for a flight stack.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FlightStackError {
    /// The stamp has no counterpart.
    #[error(transparent)]
    Time(#[from] TimeError),
    /// A variance that flight stacks reject.
    #[error(transparent)]
    Variance(#[from] VarianceError),
    /// A number that single precision does not hold, or at no distance.
    #[error("expected a finite position other than zero, got {position_m:?} m")]
    Position {
        /// m.
        position_m: [f64; 3],
    },
    /// A quaternion that is not of length 1.
    #[error("expected a quaternion of length 1, got one of length {norm}")]
    Orientation {
        /// Its length.
        norm: f64,
    },
    /// A rate that is not finite.
    #[error("expected finite rates, got {rate_radps:?} rad/s")]
    Rate {
        /// rad/s.
        rate_radps: [f64; 3],
    },
    /// The message says that it holds no orientation.
    #[error("expected an Imu with an orientation, got orientation_covariance[0] = -1")]
    NoOrientation,
    /// An attitude that no aircraft in refuelling has.
    #[error(
        "expected the rotation {expected}, got another or an aircraft that does not fly the right way up: {reason}"
    )]
    Axes {
        /// The axes that the message is defined with.
        expected: &'static str,
        /// What tells.
        reason: UprightError,
    },
}

/// Returns PX4's landing target of the track: receptacle against receiver, NED.
///
/// The target moves, so it is never static and its velocity never the vehicle's own. There is no absolute position;
/// `abs_pos_valid` is false, which not every reader in PX4 checks.
///
/// # Errors
/// [`FlightStackError`]: what PX4 would reject is not sent.
pub fn px4_landing_target(
    stamp_ns: i64,
    receiver_from_receptacle: &Motion,
    ned_from_frd: &LocalAttitude,
    px4_minus_ros_us: i64,
) -> Result<LandingTargetPose, FlightStackError> {
    let ned = receiver_from_receptacle
        .seen_from(&rotation_only(&frd_from_flu()))
        .in_local_axes(ned_from_frd);
    let position = single(&ned.b_from_a.translation.vector)?;
    let velocity = single(&ned.velocity_in_b)?;
    let variance = |first: usize| {
        px4_variances(&std::array::from_fn::<f64, 3, _>(|i| {
            ned.covariance[(first + i, first + i)]
        }))
    };
    let (of_position, of_velocity) = (variance(0)?, variance(6)?);
    Ok(LandingTargetPose {
        timestamp: px4_us_from_ros_ns(stamp_ns, px4_minus_ros_us)?,
        is_static: false,
        rel_pos_valid: true,
        rel_vel_valid: true,
        rel_vel_ekf2_valid: false,
        x_rel: position[0],
        y_rel: position[1],
        z_rel: position[2],
        vx_rel: velocity[0],
        vy_rel: velocity[1],
        vz_rel: velocity[2],
        cov_x_rel: of_position[0],
        cov_y_rel: of_position[1],
        cov_z_rel: of_position[2],
        cov_vx_rel: of_velocity[0],
        cov_vy_rel: of_velocity[1],
        cov_vz_rel: of_velocity[2],
        ..LandingTargetPose::default()
    })
}

/// Returns PX4's marker report of one frame: receptacle against receiver, FRD, with the attitude beside it.
///
/// For a PX4 whose vision target estimator is built for moving targets (`CONFIG_VTEST_MOVING=y`): one for static targets
/// would let EKF2 take the tanker's velocity for the vehicle's own. It takes that attitude for exact, so the position's variances hold its error too.
///
/// # Errors
/// [`FlightStackError`]: what PX4 would reject is not sent.
pub fn px4_fiducial_marker(
    stamp_ns: i64,
    receiver_from_receptacle: &PoseEstimate,
    ned_from_frd: &LocalAttitude,
    px4_minus_ros_us: i64,
) -> Result<FiducialMarkerPosReport, FlightStackError> {
    let frd = receiver_from_receptacle.seen_from(&rotation_only(&frd_from_flu()));
    let in_ned = frd.in_local_axes(ned_from_frd).covariance;
    let frd_from_ned = ned_from_frd.local_from_b.inverse().to_rotation_matrix();
    let in_frd = in_ned.rotated(&frd_from_ned).0;
    let q = ned_from_frd.local_from_b.quaternion();
    let timestamp = px4_us_from_ros_ns(stamp_ns, px4_minus_ros_us)?;
    Ok(FiducialMarkerPosReport {
        timestamp,
        timestamp_sample: timestamp,
        rel_pos: single(&frd.b_from_a.translation.vector)?,
        cov_rel_pos: px4_variances(&[in_frd[(0, 0)], in_frd[(1, 1)], in_frd[(2, 2)]])?,
        q: [narrow(q.w), narrow(q.i), narrow(q.j), narrow(q.k)],
    })
}

/// Returns MAVROS's landing target of one frame, such that `MAVLink`'s `LANDING_TARGET` has it in `BODY_FRD`.
///
/// MAVROS converts the pose from ENU to NED regardless of `frame`, so FRD is encoded as if it were NED in ENU.
///
/// # Errors
/// [`FlightStackError::Position`]: `ArduPilot` drops a target at no distance.
pub fn mavros_landing_target(
    header: Header,
    receiver_from_receptacle: &PoseEstimate,
) -> Result<LandingTarget, FlightStackError> {
    let frd = receiver_from_receptacle
        .seen_from(&rotation_only(&frd_from_flu()))
        .b_from_a;
    let position = frd.translation.vector;
    let [_, _, _] = single(&position)?;
    let distance = narrow(position.norm());
    if distance <= 0.0 {
        return Err(FlightStackError::Position {
            position_m: position.into(),
        });
    }
    Ok(LandingTarget {
        target_num: 0,
        frame: LandingTarget::BODY_FRD,
        angle: [
            narrow(position.y.atan2(position.x)),
            narrow(position.z.atan2(position.x)),
        ],
        distance,
        size: [0.0, 0.0],
        pose: pose_message(header.clone(), &turned(&ned_from_enu(), &frd)).pose,
        r#type: LandingTarget::VISION_OTHER,
        header,
    })
}

/// Returns the receptacle in ENU axes about the receiver's origin.
///
/// For consumers of ENU, not for an autopilot: `MAVROS` would call it `LOCAL_NED`, which PX4 takes as an absolute place.
///
/// # Errors
/// [`FlightStackError::Position`] for what is not finite.
pub fn mavros_pose(
    header: Header,
    receiver_from_receptacle: &PoseEstimate,
    ned_from_frd: &LocalAttitude,
) -> Result<PoseStamped, FlightStackError> {
    let ned = receiver_from_receptacle
        .seen_from(&rotation_only(&frd_from_flu()))
        .in_local_axes(ned_from_frd)
        .b_from_a;
    let [_, _, _] = single(&ned.translation.vector)?;
    // ENU from NED is NED from ENU.
    Ok(pose_message(header, &turned(&ned_from_enu(), &ned)))
}

fn turned(to_from: &Rotation3<f64>, pose: &Isometry3<f64>) -> Isometry3<f64> {
    rotation_only(to_from) * pose
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "PX4's and MAVLink's messages are in single precision"
)]
const fn narrow(value: f64) -> f32 {
    value as f32
}

fn single(vector: &Vector3<f64>) -> Result<[f32; 3], FlightStackError> {
    let result = [narrow(vector.x), narrow(vector.y), narrow(vector.z)];
    if result.iter().all(|value| value.is_finite()) {
        Ok(result)
    } else {
        Err(FlightStackError::Position {
            position_m: (*vector).into(),
        })
    }
}

#[cfg(test)]
mod tests;
