//! An aircraft's attitude as flight stacks send it, if it can be one.

use nalgebra::{Quaternion, Rotation3, UnitQuaternion, Vector3};

use super::FlightStackError;
use crate::frames::{
    AttitudeSample, check_upright, frd_from_flu, ned_from_enu, ros_ns_from_px4_us,
};
use crate::messages::{Imu, VehicleAttitude};
use crate::pipeline::Stamp;

/// The axes of PX4's attitude, in words.
const NED_FROM_FRD: &str = "from FRD (x forward, y right, z down) to NED (north, east, down)";
/// Those of ROS's.
const ENU_FROM_FLU: &str = "from FLU (x forward, y left, z up) to ENU (east, north, up)";

/// Returns stamp (ns of ROS's clock) and `NED_from_FRD` of PX4's message, which holds no rate.
///
/// # Errors
/// [`FlightStackError::Time`], [`FlightStackError::Orientation`], [`FlightStackError::Axes`].
pub fn px4_attitude(
    message: &VehicleAttitude,
    px4_minus_ros_us: i64,
) -> Result<AttitudeSample, FlightStackError> {
    let [w, x, y, z] = message.q.map(f64::from);
    let stamp_ns = ros_ns_from_px4_us(message.timestamp_sample, px4_minus_ros_us)?;
    let ned_from_frd = unit(Quaternion::new(w, x, y, z))?;
    check_upright(&ned_from_frd, None).map_err(|reason| FlightStackError::Axes {
        expected: NED_FROM_FRD,
        reason,
    })?;
    Ok(AttitudeSample {
        stamp_ns,
        local_from_body: ned_from_frd,
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
/// [`FlightStackError::NoOrientation`], [`FlightStackError::Orientation`], [`FlightStackError::Axes`],
/// [`FlightStackError::Rate`].
pub fn imu_attitude(message: &Imu) -> Result<AttitudeSample, FlightStackError> {
    // sensor_msgs/Imu: −1 marks it as missing. NaN does not.
    if message.orientation_covariance[0] < 0.0 {
        return Err(FlightStackError::NoOrientation);
    }
    let q = &message.orientation;
    let enu_from_flu = unit(Quaternion::new(q.w, q.x, q.y, q.z))?;
    let axes = |rotation: &Rotation3<f64>| UnitQuaternion::from_rotation_matrix(rotation);
    let ned_from_frd = axes(&ned_from_enu()) * enu_from_flu * axes(&frd_from_flu());
    check_upright(&ned_from_frd, force_in_frd(message).as_ref()).map_err(|reason| {
        FlightStackError::Axes {
            expected: ENU_FROM_FLU,
            reason,
        }
    })?;
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

/// What the accelerometer of an `Imu` measures, FRD; `None` where the message says that it holds nothing, or zero.
fn force_in_frd(message: &Imu) -> Option<Vector3<f64>> {
    let force = &message.linear_acceleration;
    let force_in_flu = Vector3::new(force.x, force.y, force.z);
    // As for the orientation. What is not finite is not compared: nothing else is made of it.
    let says_none = message.linear_acceleration_covariance[0] < 0.0;
    let is_measured = !says_none && force_in_flu.iter().all(|axis| axis.is_finite());
    is_measured.then(|| frd_from_flu() * force_in_flu)
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
