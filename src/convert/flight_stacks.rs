//! The receptacle as flight stacks take it, and the receiver's attitude as they send it.
//!
//! All start from the receptacle in the receiver's body axes (FLU, about its origin). Local axes are NED here;
//! attitudes are `NED_from_FRD`.

use nalgebra::{Isometry3, Quaternion, Rotation3, UnitQuaternion, Vector3};

use super::tools::pose_message;
use crate::frames::{
    AttitudeSample, LocalAttitude, PoseEstimate, TimeError, VarianceError, frd_from_flu,
    ned_from_enu, px4_us_from_ros_ns, px4_variances, ros_ns_from_px4_us, rotation_only,
};
use crate::geometry::Motion;
use crate::messages::{
    FiducialMarkerPosReport, Header, Imu, LandingTarget, LandingTargetPose, PoseStamped,
    VehicleAttitude,
};
use crate::pipeline::Stamp;

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

/// Returns stamp (ns of ROS's clock) and `NED_from_FRD` of PX4's message, which holds no rate.
///
/// # Errors
/// [`FlightStackError::Time`], [`FlightStackError::Orientation`].
pub fn px4_attitude(
    message: &VehicleAttitude,
    px4_minus_ros_us: i64,
) -> Result<AttitudeSample, FlightStackError> {
    let [w, x, y, z] = message.q.map(f64::from);
    let stamp_ns = ros_ns_from_px4_us(message.timestamp_sample, px4_minus_ros_us)?;
    Ok(AttitudeSample {
        stamp_ns,
        local_from_body: unit(Quaternion::new(w, x, y, z))?,
        rate_in_body: None,
    })
}

/// Returns stamp (ns), `NED_from_FRD` and the gyro's rate (FRD) of an `Imu` whose orientation is `ENU_from_FLU` and whose
/// rate is in FLU.
///
/// No rate where the message says that it holds none, or zero on all axes: a source that fills in attitudes only leaves it
/// so, and a gyro never is.
///
/// # Errors
/// [`FlightStackError::NoOrientation`], [`FlightStackError::Orientation`], [`FlightStackError::Rate`].
pub fn imu_attitude(message: &Imu) -> Result<AttitudeSample, FlightStackError> {
    // sensor_msgs/Imu: −1 marks it as missing. NaN does not.
    if message.orientation_covariance[0] < 0.0 {
        return Err(FlightStackError::NoOrientation);
    }
    let q = &message.orientation;
    let enu_from_flu = unit(Quaternion::new(q.w, q.x, q.y, q.z))?;
    let axes = |rotation: &Rotation3<f64>| UnitQuaternion::from_rotation_matrix(rotation);
    let ned_from_frd = axes(&ned_from_enu()) * enu_from_flu * axes(&frd_from_flu());
    let of_gyro = &message.angular_velocity;
    let rate_in_flu = Vector3::new(of_gyro.x, of_gyro.y, of_gyro.z);
    // As for the orientation.
    let says_none = message.angular_velocity_covariance[0] < 0.0;
    let is_measured = !says_none && rate_in_flu != Vector3::zeros();
    if is_measured && !rate_in_flu.iter().all(|rate| rate.is_finite()) {
        return Err(FlightStackError::Rate {
            rate_radps: rate_in_flu.into(),
        });
    }
    Ok(AttitudeSample {
        stamp_ns: Stamp::from(message.header.stamp).nanoseconds(),
        local_from_body: ned_from_frd,
        rate_in_body: is_measured.then(|| frd_from_flu() * rate_in_flu),
    })
}

fn turned(to_from: &Rotation3<f64>, pose: &Isometry3<f64>) -> Isometry3<f64> {
    rotation_only(to_from) * pose
}

fn unit(q: Quaternion<f64>) -> Result<UnitQuaternion<f64>, FlightStackError> {
    let norm = q.norm();
    // ROS's own tolerance for a quaternion that should have length 1.
    if (norm - 1.0).abs() < 0.01 {
        Ok(UnitQuaternion::from_quaternion(q))
    } else {
        Err(FlightStackError::Orientation { norm })
    }
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
