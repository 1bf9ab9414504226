//! What refuelling and flight stacks are told of a frame: each output by its own parameter, and silence with a
//! reason where something is missing.
//!
//! States (`receptacle`, PX4's landing target) come from the track. What a flight stack feeds to a filter of its
//! own (PX4's marker report, MAVROS) comes from single frames: a filter behind a filter believes too much.

mod told;

use std::path::PathBuf;
use std::time::Instant;

use crate::config::{ConsumerConfiguration, OutputError};
use crate::estimation::Solution;
use crate::frames::{AttitudeHistory, LocalAttitude, PoseEstimate};
use crate::geometry::Motion;
use crate::pipeline::Stamp;
use crate::refuelling::{RefuellingGeometry, RefuellingSetup, RefuellingSetupError};
use crate::ros::attitude::AttitudeMessage;
use crate::ros::convert;
use crate::ros::diagnostics::Tally;
use crate::ros::health::Unexpected;
use crate::ros::messages::{
    DiagnosticStatus, FiducialMarkerPosReport, Header, KeyValue, LandingTarget, LandingTargetPose,
    Message, PoseStamped, ReceptacleState,
};
use crate::ros::once::SaidOnce;
use crate::ros::participant::{EndpointError, QosProfile, RosNode, reliable};
use crate::text;
use told::{Silence, Told};

/// Where the receptacle is before the probe tip.
pub const RECEPTACLE: &str = "receptacle";
/// PX4's landing target.
pub const PX4_LANDING_TARGET: &str = "/fmu/in/landing_target_pose";
/// PX4's marker report.
pub const PX4_FIDUCIAL_MARKER: &str = "/fmu/in/fiducial_marker_pos_report";
/// MAVROS's landing target (its parameter `listen_lt`).
pub const MAVROS_LANDING_TARGET: &str = "/mavros/landing_target/raw";
/// The receptacle as a pose in ENU, under MAVROS's name for a landing target: for consumers of ENU. What MAVROS makes
/// of it, no autopilot may have: PX4 takes it as an absolute place.
pub const MAVROS_POSE: &str = "/mavros/landing_target/pose";

/// Reliable, so that MAVROS hears it; PX4's bridge, which asks for best effort, does too.
pub(super) const QOS: QosProfile = reliable(10);

/// Why the outputs cannot be.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConsumersError {
    /// Parameters that do not go together.
    #[error(transparent)]
    Outputs(#[from] OutputError),
    /// The setup's file.
    #[error("parameter \"refuelling\": cannot read {}: {source}", text::path(path))]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The setup cannot be used.
    #[error("parameter \"refuelling\": {0}")]
    Setup(#[from] RefuellingSetupError),
}

/// Returns the setup that a configuration names, if its outputs have what they need.
///
/// # Errors
/// [`ConsumersError`]: a missing parameter, or a file that cannot be read or used.
pub fn refuelling_setup(
    configuration: &ConsumerConfiguration,
) -> Result<Option<RefuellingSetup>, ConsumersError> {
    configuration.check()?;
    let Some(name) = &configuration.refuelling else {
        return Ok(None);
    };
    let path = PathBuf::from(name);
    let text = crate::text_file::read(&path)
        .map_err(|source| ConsumersError::Unreadable { path, source })?;
    Ok(Some(RefuellingSetup::from_yaml(&text, name)?))
}

/// The outputs that are on.
pub struct Consumers {
    setup: RefuellingSetup,
    geometry: RefuellingGeometry,
    configuration: ConsumerConfiguration,
    attitudes: AttitudeHistory,
    resets: Option<u8>,
    bad_attitude: SaidOnce<()>,
    last_bad_attitude: Option<String>,
    receptacle: Option<Told<ReceptacleState>>,
    px4_landing_target: Option<Told<LandingTargetPose>>,
    px4_fiducial_marker: Option<Told<FiducialMarkerPosReport>>,
    mavros_landing_target: Option<Told<LandingTarget>>,
    mavros_pose: Option<Told<PoseStamped>>,
}

impl Consumers {
    /// Returns the outputs of a configuration, opened; none when it asks for none.
    ///
    /// # Errors
    /// [`EndpointError`] when a name is malformed or the middleware refuses.
    pub fn open(
        ros: &mut RosNode,
        configuration: &ConsumerConfiguration,
        setup: Option<RefuellingSetup>,
    ) -> Result<Option<Self>, EndpointError> {
        let Some(setup) = setup.filter(|_| configuration.any()) else {
            return Ok(None);
        };
        let on = configuration.clone();
        Ok(Some(Self {
            geometry: setup.geometry(&on.receiver_from_camera),
            setup,
            attitudes: AttitudeHistory::new(on.attitude_max_age_s),
            resets: None,
            bad_attitude: SaidOnce::default(),
            last_bad_attitude: None,
            receptacle: Told::open(ros, on.receptacle, RECEPTACLE)?,
            px4_landing_target: Told::open(ros, on.px4_landing_target, PX4_LANDING_TARGET)?,
            px4_fiducial_marker: Told::open(ros, on.px4_fiducial_marker, PX4_FIDUCIAL_MARKER)?,
            mavros_landing_target: Told::open(
                ros,
                on.mavros_landing_target,
                MAVROS_LANDING_TARGET,
            )?,
            mavros_pose: Told::open(ros, on.mavros_pose, MAVROS_POSE)?,
            configuration: on,
        }))
    }

    /// Reloads setup and mount: a stale lever arm gives a plausible but wrong position. Attitudes and counts start again,
    /// like everything that a clean-up forgets.
    pub fn configure(&mut self, configuration: &ConsumerConfiguration, setup: RefuellingSetup) {
        self.setup = setup;
        self.on_configuration(configuration);
        self.attitudes.clear();
        self.resets = None;
        self.bad_attitude = SaidOnce::default();
        self.last_bad_attitude = None;
        begin_anew(&mut self.receptacle);
        begin_anew(&mut self.px4_landing_target);
        begin_anew(&mut self.px4_fiducial_marker);
        begin_anew(&mut self.mavros_landing_target);
        begin_anew(&mut self.mavros_pose);
    }

    /// Takes changed parameters: of these only the camera's mount can change.
    pub fn on_configuration(&mut self, configuration: &ConsumerConfiguration) {
        self.geometry = self.setup.geometry(&configuration.receiver_from_camera);
    }

    /// Takes a sample of the receiver's attitude.
    pub fn on_attitude(&mut self, message: &AttitudeMessage) {
        let sample = match message {
            AttitudeMessage::Px4(message) => {
                // Across a reset the difference of two samples is no rate.
                if self.resets.replace(message.quat_reset_counter)
                    != Some(message.quat_reset_counter)
                {
                    self.attitudes.clear();
                }
                convert::px4_attitude(message, self.configuration.px4_minus_ros_us)
            }
            AttitudeMessage::Imu(message) => convert::imu_attitude(message),
        };
        match sample {
            Ok(sample) => {
                self.attitudes.push(sample);
                if let Some(count) = self.bad_attitude.good() {
                    log::info!("the receiver's attitude is usable again after {count} samples");
                }
            }
            Err(error) => {
                if self.bad_attitude.fault((), Instant::now()) {
                    log::warn!("a sample of the receiver's attitude is not used: {error}");
                }
                self.last_bad_attitude = Some(error.to_string());
            }
        }
    }

    /// Returns what is fixed to the two aircraft.
    #[must_use]
    pub const fn geometry(&self) -> &RefuellingGeometry {
        &self.geometry
    }

    /// Tells a frame's trusted pose, and the track at its stamp if the frame has corrected one; or nothing, while the
    /// tanker's attitude shows that they would be misread.
    pub fn on_pose(
        &mut self,
        header: &Header,
        place: Result<(&Solution, Option<&Motion>), Unexpected>,
        tally: &mut Tally,
    ) {
        match place {
            Ok((solution, camera_from_tanker)) => {
                self.tell(header, solution, camera_from_tanker, tally);
            }
            Err(unexpected) => self.hold_back(unexpected.into(), tally),
        }
    }

    fn hold_back(&mut self, silence: Silence, tally: &mut Tally) {
        hold_back(&mut self.receptacle, silence, tally);
        hold_back(&mut self.px4_landing_target, silence, tally);
        hold_back(&mut self.px4_fiducial_marker, silence, tally);
        hold_back(&mut self.mavros_landing_target, silence, tally);
        hold_back(&mut self.mavros_pose, silence, tally);
    }

    fn tell(
        &mut self,
        header: &Header,
        solution: &Solution,
        camera_from_tanker: Option<&Motion>,
        tally: &mut Tally,
    ) {
        let stamp_ns = Stamp::from(header.stamp).nanoseconds();
        let attitude = self.attitude_at(stamp_ns);
        let px4_minus_ros_us = self.configuration.px4_minus_ros_us;
        let in_frame = |frame_id: String| Header {
            stamp: header.stamp,
            frame_id,
        };
        let receiver = &self.configuration.receiver_frame_id;

        let motion = camera_from_tanker.ok_or(Silence::NoTrack);
        if let Some(told) = &mut self.receptacle {
            let message = motion.and_then(|motion| {
                let receptacle = self.geometry.receptacle(motion);
                let assessment = self.setup.envelope.assess(
                    &receptacle.receptacle_from_probe,
                    &receptacle.position_covariance(),
                );
                if assessment.outside.is_nan() || assessment.contact.is_nan() {
                    return Err(Silence::NoProbability);
                }
                let header = in_frame(receiver.clone());
                Ok(convert::receptacle(header, &receptacle, &assessment))
            });
            told.tell(message, tally);
        }
        if let Some(told) = &mut self.px4_landing_target {
            let message = motion.and_then(|motion| {
                let (attitude, target) = (attitude?, self.geometry.receptacle_motion(motion));
                let message =
                    convert::px4_landing_target(stamp_ns, &target, &attitude, px4_minus_ros_us);
                Ok(message?)
            });
            told.tell(message, tally);
        }

        let target = self.geometry.receptacle_pose(&PoseEstimate {
            b_from_a: solution.camera_from_tanker,
            covariance: solution.covariance,
        });
        if let Some(told) = &mut self.px4_fiducial_marker {
            let message = attitude.and_then(|attitude| {
                let message =
                    convert::px4_fiducial_marker(stamp_ns, &target, &attitude, px4_minus_ros_us);
                Ok(message?)
            });
            told.tell(message, tally);
        }
        if let Some(told) = &mut self.mavros_landing_target {
            let message = convert::mavros_landing_target(in_frame(receiver.clone()), &target);
            told.tell(message.map_err(Silence::from), tally);
        }
        if let Some(told) = &mut self.mavros_pose {
            let message = attitude.and_then(|attitude| {
                let header = in_frame(format!("{receiver}_enu"));
                Ok(convert::mavros_pose(header, &target, &attitude)?)
            });
            told.tell(message, tally);
        }
    }

    /// Returns the health of these outputs since the last report.
    pub fn diagnostics(&mut self, node: &str) -> DiagnosticStatus {
        let mut values = Vec::new();
        let mut reasons: Vec<String> = Vec::new();
        if let Some(told) = &mut self.receptacle {
            reasons.extend(told.report(&mut values));
        }
        if let Some(told) = &mut self.px4_landing_target {
            reasons.extend(told.report(&mut values));
        }
        if let Some(told) = &mut self.px4_fiducial_marker {
            reasons.extend(told.report(&mut values));
        }
        if let Some(told) = &mut self.mavros_landing_target {
            reasons.extend(told.report(&mut values));
        }
        if let Some(told) = &mut self.mavros_pose {
            reasons.extend(told.report(&mut values));
        }
        values.push(KeyValue {
            key: "unusable_attitude".to_owned(),
            value: self.last_bad_attitude.take().unwrap_or_default(),
        });
        DiagnosticStatus {
            level: if reasons.is_empty() {
                DiagnosticStatus::OK
            } else {
                DiagnosticStatus::WARN
            },
            name: format!("{node}: consumers"),
            message: if reasons.is_empty() {
                "no output is held back".to_owned()
            } else {
                reasons.join("; ")
            },
            hardware_id: self.configuration.receiver_frame_id.clone(),
            values,
        }
    }

    fn attitude_at(&self, stamp_ns: i64) -> Result<LocalAttitude, Silence> {
        let found = self.attitudes.at(stamp_ns)?;
        Ok(LocalAttitude {
            local_from_b: found.local_from_body,
            covariance: self.configuration.attitude_covariance,
            rate_in_b: found.rate_in_body,
            rate_covariance: self.configuration.attitude_rate_covariance,
        })
    }
}

fn hold_back<M: Message>(told: &mut Option<Told<M>>, silence: Silence, tally: &mut Tally) {
    if let Some(told) = told {
        told.tell(Err(silence), tally);
    }
}

fn begin_anew<M: Message>(told: &mut Option<Told<M>>) {
    if let Some(told) = told {
        told.begin_anew();
    }
}
