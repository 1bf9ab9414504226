//! Messages <-> plain types. Nothing is checked and nothing rounded: stamps pass as their two fields.

mod apriltags;
mod flight_stacks;
mod integrity;
mod markers;
mod receptacle;
mod tools;
mod vision;

use std::time::Duration;

use nalgebra::{Isometry3, Matrix6, UnitQuaternion, Vector3};

use super::messages::{self, EstimatorStatus, Header, Time};
use crate::camera;
use crate::estimation::{Certificate, FrameCauses, Initialisation, Solution};
use crate::geometry::{Motion, PoseCovariance};
use crate::pipeline::{Detection, FrameOutcome, Stamp};

pub use apriltags::{TagDetections, tag_detections};
pub use flight_stacks::{
    FlightStackError, imu_attitude, mavros_landing_target, mavros_pose, px4_attitude,
    px4_fiducial_marker, px4_landing_target,
};
pub use integrity::integrity;
pub use markers::markers;
pub use receptacle::receptacle;
pub use tools::{camera_info_message, feature_points_message, isometry, pose_message};
pub use vision::vision_detections;

impl From<Time> for Stamp {
    fn from(time: Time) -> Self {
        Self {
            sec: time.sec,
            nanosec: time.nanosec,
        }
    }
}

impl From<Stamp> for Time {
    fn from(stamp: Stamp) -> Self {
        Self {
            sec: stamp.sec,
            nanosec: stamp.nanosec,
        }
    }
}

/// Returns the detections of a message.
#[must_use]
pub fn detections(message: &messages::FeaturePointArray) -> Vec<Detection> {
    let detection = |point: &messages::FeaturePoint| Detection {
        id: point.id,
        u_px: point.u,
        v_px: point.v,
        sigma_px: point.sigma,
    };
    message.points.iter().map(detection).collect()
}

/// Returns the camera info of a message, without its header.
#[must_use]
pub fn camera_info(message: &messages::CameraInfo) -> camera::CameraInfo {
    camera::CameraInfo {
        height: message.height,
        width: message.width,
        distortion_model: message.distortion_model.clone(),
        d: message.d.clone(),
        k: message.k,
        r: message.r,
        p: message.p,
        binning_x: message.binning_x,
        binning_y: message.binning_y,
        roi: camera::RegionOfInterest {
            x_offset: message.roi.x_offset,
            y_offset: message.roi.y_offset,
            height: message.roi.height,
            width: message.roi.width,
            do_rectify: message.roi.do_rectify,
        },
    }
}

/// Returns the pose message of a trusted solution.
#[must_use]
pub fn pose(header: Header, solution: &Solution) -> messages::PoseWithCovarianceStamped {
    messages::PoseWithCovarianceStamped {
        header,
        pose: pose_with_covariance(&solution.camera_from_tanker, &solution.covariance),
    }
}

/// Returns the odometry message of a track: the twist is in the axes of the tanker.
#[must_use]
pub fn odometry(
    header: Header,
    tanker_frame_id: &str,
    camera_from_tanker: &Motion,
) -> messages::Odometry {
    let twist = camera_from_tanker.twist_in_a();
    messages::Odometry {
        header,
        child_frame_id: tanker_frame_id.to_owned(),
        pose: pose_with_covariance(
            &camera_from_tanker.b_from_a,
            &camera_from_tanker.pose_covariance(),
        ),
        twist: messages::TwistWithCovariance {
            twist: messages::Twist {
                linear: vector(&twist.linear),
                angular: vector(&twist.angular),
            },
            covariance: row_major(&twist.covariance),
        },
    }
}

fn pose_with_covariance(
    camera_from_tanker: &Isometry3<f64>,
    covariance: &PoseCovariance,
) -> messages::PoseWithCovariance {
    let translation = &camera_from_tanker.translation.vector;
    messages::PoseWithCovariance {
        pose: messages::Pose {
            position: messages::Point {
                x: translation.x,
                y: translation.y,
                z: translation.z,
            },
            orientation: orientation(&camera_from_tanker.rotation),
        },
        covariance: covariance.row_major(),
    }
}

fn row_major(matrix: &Matrix6<f64>) -> [f64; 36] {
    std::array::from_fn(|index| matrix[(index / 6, index % 6)])
}

fn vector(vector: &Vector3<f64>) -> messages::Vector3 {
    messages::Vector3 {
        x: vector.x,
        y: vector.y,
        z: vector.z,
    }
}

/// Returns the transform message of a trusted solution.
#[must_use]
pub fn transform(
    header: Header,
    tanker_frame_id: &str,
    solution: &Solution,
) -> messages::TFMessage {
    let transform = messages::TransformStamped {
        header,
        child_frame_id: tanker_frame_id.to_owned(),
        transform: messages::Transform {
            translation: vector(&solution.camera_from_tanker.translation.vector),
            rotation: orientation(&solution.camera_from_tanker.rotation),
        },
    };
    messages::TFMessage {
        transforms: vec![transform],
    }
}

/// Of the two quaternions of a rotation, the one with `w ≥ 0`: the same attitude is always the same
/// message.
fn orientation(rotation: &UnitQuaternion<f64>) -> messages::Quaternion {
    let q = rotation.quaternion();
    let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
    messages::Quaternion {
        x: sign * q.i,
        y: sign * q.j,
        z: sign * q.k,
        w: sign * q.w,
    }
}

/// Returns the status message of a frame, of which points with `ignored_ids` were left out before any check.
#[must_use]
pub fn status(
    header: Header,
    frame: &FrameOutcome,
    ignored_ids: &[u32],
    solve_time: Duration,
) -> EstimatorStatus {
    let solution = frame.solution();
    let number = |of: fn(&Solution) -> f64| solution.map_or(f64::NAN, of);
    let count = |of: fn(&Solution) -> u16| solution.map_or(0, of);
    let modes = || {
        let causes = frame.causes.iter().flat_map(|causes| &causes.causes);
        causes.filter_map(|cause| Some((cause, cause.amplitude_sigmas?)))
    };
    EstimatorStatus {
        header,
        outcome: frame.code().number(),
        message: frame.message(),
        used_ids: frame.used_ids.clone(),
        rejected_ids: [&frame.rejected_ids, ignored_ids].concat(),
        rms_residual: number(|solution| solution.rms_px),
        chi_squared: number(|solution| solution.chi_squared),
        degrees_of_freedom: count(|solution| solution.degrees_of_freedom),
        iterations: count(|solution| solution.iterations),
        initialisation: initialisation(frame.initialisation),
        ambiguity: number(|solution| solution.ambiguity),
        solve_time: duration(solve_time),
        track: frame.track.code().number(),
        mode_names: modes().map(|(cause, _)| cause.name.clone()).collect(),
        mode_amplitudes: modes().map(|(_, amplitude)| amplitude).collect(),
        dominant_cause: frame
            .causes
            .as_ref()
            .and_then(FrameCauses::dominant)
            .map_or_else(String::new, |cause| cause.name.clone()),
        certificate: certificate(solution.and_then(|solution| solution.certificate)),
    }
}

const fn certificate(of_pose: Option<Certificate>) -> u8 {
    match of_pose {
        None => EstimatorStatus::CERTIFICATE_NONE,
        Some(Certificate::Certified) => EstimatorStatus::CERTIFICATE_CERTIFIED,
        Some(Certificate::NotCertified) => EstimatorStatus::CERTIFICATE_NOT_CERTIFIED,
        Some(Certificate::Replaced) => EstimatorStatus::CERTIFICATE_REPLACED,
    }
}

const fn initialisation(used: Option<Initialisation>) -> u8 {
    match used {
        None => EstimatorStatus::INITIALISATION_NONE,
        Some(Initialisation::Nominal) => EstimatorStatus::INITIALISATION_NOMINAL,
        Some(Initialisation::Dlt) => EstimatorStatus::INITIALISATION_DLT,
        Some(Initialisation::Previous) => EstimatorStatus::INITIALISATION_PREVIOUS,
        Some(Initialisation::Global) => EstimatorStatus::INITIALISATION_GLOBAL,
    }
}

fn duration(duration: Duration) -> messages::Duration {
    messages::Duration {
        sec: i32::try_from(duration.as_secs()).unwrap_or(i32::MAX),
        nanosec: duration.subsec_nanos(),
    }
}

#[cfg(test)]
mod tests;
