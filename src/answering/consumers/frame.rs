//! Each output's message for a frame.

use super::silence::Silence;
use crate::convert;
use crate::frames::{LocalAttitude, PoseEstimate};
use crate::geometry::Motion;
use crate::messages::{
    FiducialMarkerPosReport, Header, LandingTarget, LandingTargetPose, PoseStamped,
    ReceptacleState, Time,
};
use crate::refuelling::{RefuellingGeometry, RefuellingSetup};

/// A frame with a trusted pose, as outputs need it.
pub(super) struct Frame<'a> {
    pub(super) setup: &'a RefuellingSetup,
    pub(super) geometry: &'a RefuellingGeometry,
    pub(super) stamp: Time,
    pub(super) stamp_ns: i64,
    /// Frame of the receiver.
    pub(super) receiver: &'a str,
    /// The track at the stamp, if the frame has corrected it.
    pub(super) camera_from_tanker: Result<&'a Motion, Silence>,
    /// The receptacle from this frame alone.
    pub(super) target: PoseEstimate,
    /// The receiver's attitude at the stamp.
    pub(super) attitude: Result<LocalAttitude, Silence>,
    /// PX4's clock minus ROS's, µs.
    pub(super) px4_minus_ros_us: i64,
}

impl Frame<'_> {
    fn header(&self, frame_id: String) -> Header {
        Header {
            stamp: self.stamp,
            frame_id,
        }
    }
}

pub(super) fn receptacle(frame: &Frame) -> Result<ReceptacleState, Silence> {
    let receptacle = frame.geometry.receptacle(frame.camera_from_tanker?);
    let assessment = frame.setup.envelope.assess(
        &receptacle.receptacle_from_probe,
        &receptacle.position_covariance(),
    );
    if assessment.outside.is_nan() || assessment.contact.is_nan() {
        return Err(Silence::NoProbability);
    }
    let header = frame.header(frame.receiver.to_owned());
    Ok(convert::receptacle(header, &receptacle, &assessment))
}

pub(super) fn px4_landing_target(frame: &Frame) -> Result<LandingTargetPose, Silence> {
    let motion = frame.camera_from_tanker?;
    let attitude = frame.attitude?;
    let target = frame.geometry.receptacle_motion(motion);
    let offset_us = frame.px4_minus_ros_us;
    let message = convert::px4_landing_target(frame.stamp_ns, &target, &attitude, offset_us);
    Ok(message?)
}

pub(super) fn px4_fiducial_marker(frame: &Frame) -> Result<FiducialMarkerPosReport, Silence> {
    let attitude = frame.attitude?;
    let offset_us = frame.px4_minus_ros_us;
    let message = convert::px4_fiducial_marker(frame.stamp_ns, &frame.target, &attitude, offset_us);
    Ok(message?)
}

pub(super) fn mavros_landing_target(frame: &Frame) -> Result<LandingTarget, Silence> {
    let header = frame.header(frame.receiver.to_owned());
    Ok(convert::mavros_landing_target(header, &frame.target)?)
}

pub(super) fn mavros_pose(frame: &Frame) -> Result<PoseStamped, Silence> {
    let attitude = frame.attitude?;
    let header = frame.header(format!("{}_enu", frame.receiver));
    Ok(convert::mavros_pose(header, &frame.target, &attitude)?)
}
