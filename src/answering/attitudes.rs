//! The attitudes that receiver and tanker have sent, and what they are to each other.

use std::time::Instant;

use nalgebra::{Rotation3, UnitQuaternion};

use crate::config::Configuration;
use crate::convert;
use crate::frames::{
    AttitudeAt, AttitudeError, AttitudeHistory, RelativeAttitudeError, receiver_from_tanker,
};
use crate::messages::{Imu, VehicleAttitude};
use crate::refuelling::ExpectedAttitude;
use ros2_node::once::SaidOnce;

/// One sample, as a flight stack sends it.
#[derive(Debug)]
pub enum AttitudeMessage {
    /// `px4_msgs/VehicleAttitude`.
    Px4(VehicleAttitude),
    /// `sensor_msgs/Imu`.
    Imu(Box<Imu>),
}

/// The samples of one aircraft.
pub(crate) struct HeardAttitude {
    of: &'static str,
    history: AttitudeHistory,
    /// PX4's count of corrections by a jump.
    resets: Option<u8>,
    bad: SaidOnce<()>,
    last_bad: Option<String>,
}

impl HeardAttitude {
    fn new(of: &'static str, max_age_s: f64) -> Self {
        Self {
            of,
            history: AttitudeHistory::new(max_age_s),
            resets: None,
            bad: SaidOnce::default(),
            last_bad: None,
        }
    }

    /// Takes a sample; says so if it cannot be used.
    pub(super) fn take(&mut self, message: &AttitudeMessage, px4_minus_ros_us: i64, now: Instant) {
        let sample = match message {
            AttitudeMessage::Px4(message) => {
                // Across a reset the difference of two samples is no rate.
                if self.resets.replace(message.quat_reset_counter)
                    != Some(message.quat_reset_counter)
                {
                    self.history.clear();
                }
                convert::px4_attitude(message, px4_minus_ros_us)
            }
            AttitudeMessage::Imu(message) => convert::imu_attitude(message),
        };
        let of = self.of;
        match sample {
            Ok(sample) => {
                self.history.push(sample);
                if let Some(count) = self.bad.good() {
                    log::info!("the {of}'s attitude is usable again after {count} bad samples");
                }
            }
            Err(error) => {
                if self.bad.fault((), now) {
                    log::warn!("ignoring a sample of the {of}'s attitude: {error}");
                }
                self.last_bad = Some(error.to_string());
            }
        }
    }

    /// Returns the attitude at a stamp.
    ///
    /// # Errors
    /// [`AttitudeError`] says what is missing.
    pub(super) fn at(&self, stamp_ns: i64) -> Result<AttitudeAt, AttitudeError> {
        self.history.at(stamp_ns)
    }

    /// Returns why a sample was not used, if any was not since this was asked last.
    pub(super) fn take_last_bad(&mut self) -> Option<String> {
        self.last_bad.take()
    }
}

/// Why a frame has no prior from reported attitudes.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub(super) enum NoReportedAttitude {
    #[error(transparent)]
    Missing(#[from] RelativeAttitudeError),
    #[error(
        "by both attitudes the tanker stands {off_deg:.1}° off its nominal attitude, allowed by max_attitude_deviation_deg is {limit_deg}°: \
         one of them is wrong, or the nominal attitude is"
    )]
    Unlikely { off_deg: f64, limit_deg: f64 },
}

/// The samples of both aircraft.
pub(super) struct Attitudes {
    pub(super) receiver: HeardAttitude,
    pub(super) tanker: HeardAttitude,
    px4_minus_ros_us: i64,
    /// What both reported together has to be near; `None` where it is not used.
    expected: Option<ExpectedAttitude>,
}

impl Attitudes {
    /// Returns the attitudes of a configuration, none heard yet.
    pub(super) fn new(configuration: &Configuration) -> Self {
        let consumers = &configuration.consumers;
        let mut attitudes = Self {
            receiver: HeardAttitude::new("receiver", consumers.attitude_max_age_s),
            tanker: HeardAttitude::new("tanker", configuration.tanker_attitude_max_age_s),
            px4_minus_ros_us: consumers.px4_minus_ros_us,
            expected: None,
        };
        attitudes.on_configuration(configuration);
        attitudes
    }

    /// Takes changed parameters: of these only the nominal attitude and the limit can change.
    pub(super) fn on_configuration(&mut self, configuration: &Configuration) {
        let is_used = configuration.settings.reported_attitude.is_some();
        self.expected = is_used.then_some(configuration.expected_attitude);
    }

    /// Takes a sample of the receiver's attitude.
    pub(super) fn on_receiver(&mut self, message: &AttitudeMessage, now: Instant) {
        self.receiver.take(message, self.px4_minus_ros_us, now);
    }

    /// Takes a sample of the tanker's attitude.
    pub(super) fn on_tanker(&mut self, message: &AttitudeMessage, now: Instant) {
        self.tanker.take(message, self.px4_minus_ros_us, now);
    }

    /// Returns the tanker's attitude in the receiver at a stamp as both report it; `None` where that is not used.
    ///
    /// # Errors
    /// [`NoReportedAttitude`]: one is missing, or both together are not believable. A mirror image of a flat target may
    /// have just the attitude that a gross error reports.
    pub(super) fn reported(
        &self,
        stamp_ns: i64,
    ) -> Option<Result<Rotation3<f64>, NoReportedAttitude>> {
        let expected = self.expected?;
        let found = receiver_from_tanker(&self.receiver.history, &self.tanker.history, stamp_ns);
        Some(
            found
                .map_err(NoReportedAttitude::from)
                .and_then(|found| near(&expected, found)),
        )
    }
}

fn near(
    expected: &ExpectedAttitude,
    receiver_from_tanker: Rotation3<f64>,
) -> Result<Rotation3<f64>, NoReportedAttitude> {
    let turn = receiver_from_tanker * expected.nominal.rotation().inverse();
    // By its quaternion: of no turn the matrix's trace may give NaN.
    let off_deg = UnitQuaternion::from_rotation_matrix(&turn)
        .angle()
        .to_degrees();
    let limit_deg = expected.limit_deg;
    if off_deg <= limit_deg {
        Ok(receiver_from_tanker)
    } else {
        Err(NoReportedAttitude::Unlikely { off_deg, limit_deg })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{ParameterValue, Parameters, TABLE};
    use crate::messages::{Header, Imu, Quaternion, Time};

    fn configuration(changes: &[(&str, ParameterValue)]) -> Configuration {
        let mut parameters = Parameters::new(TABLE);
        for (name, value) in changes {
            let set = parameters.set(name, value.clone());
            set.expect("the test's values are valid");
        }
        Configuration::from(&parameters)
    }

    /// An attitude that is turned to the left of east, deg, ENU from FLU.
    fn imu(nanosec: u32, left_deg: f64) -> AttitudeMessage {
        let q = UnitQuaternion::from_euler_angles(0.0, 0.0, left_deg.to_radians());
        AttitudeMessage::Imu(Box::new(Imu {
            header: Header {
                stamp: Time { sec: 5, nanosec },
                ..Header::default()
            },
            orientation: Quaternion {
                x: q.i,
                y: q.j,
                z: q.k,
                w: q.w,
            },
            ..Imu::default()
        }))
    }

    fn reported(
        changes: &[(&str, ParameterValue)],
        left_deg: f64,
    ) -> Option<Result<Rotation3<f64>, NoReportedAttitude>> {
        let mut attitudes = Attitudes::new(&configuration(changes));
        let now = Instant::now();
        for nanosec in [0, 20_000_000] {
            attitudes.on_receiver(&imu(nanosec, 30.0), now);
            attitudes.on_tanker(&imu(nanosec, 30.0 + left_deg), now);
        }
        attitudes.reported(5_010_000_000)
    }

    const SIGMA: (&str, ParameterValue) =
        ("reported_attitude_sigma_deg", ParameterValue::Double(2.0));

    #[test]
    fn what_both_report_is_the_tanker_in_the_receiver() {
        let found = reported(&[SIGMA], 8.0).expect("used").expect("near");
        let (roll, pitch, yaw) = found.euler_angles();
        assert!(roll.abs() < 1e-12 && pitch.abs() < 1e-12);
        assert!((yaw.to_degrees() - 8.0).abs() < 1e-9, "{yaw}");
    }

    #[test]
    fn without_a_sigma_nothing_is_asked_for() {
        assert_eq!(reported(&[], 8.0), None);
    }

    #[test]
    fn what_no_tanker_flies_is_not_believed_unless_the_limit_allows_it() {
        let refused = reported(&[SIGMA], 20.0).expect("used");
        assert!(
            matches!(refused, Err(NoReportedAttitude::Unlikely { off_deg, limit_deg: 15.0 }) if (off_deg - 20.0).abs() < 1e-9),
            "{refused:?}"
        );
        let nominal = ("nominal_yaw_deg", ParameterValue::Double(15.0));
        assert!(reported(&[SIGMA, nominal], 20.0).expect("used").is_ok());
        let limit = ("max_attitude_deviation_deg", ParameterValue::Double(180.0));
        assert!(reported(&[SIGMA, limit], 179.0).expect("used").is_ok());
    }
}
