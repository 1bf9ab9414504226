//! The attitudes that receiver and tanker have sent, and what they are to each other.

use nalgebra::{Rotation3, UnitQuaternion};

use super::contradiction::{Agreement, Contradiction};
use crate::config::{Configuration, ReportedAttitudeSettings};
use crate::convert::{self, FlightStackError};
use crate::frames::{
    AttitudeAt, AttitudeError, AttitudeHistory, RelativeAttitudeError, receiver_from_tanker,
};
use crate::messages::{Imu, VehicleAttitude};
use crate::pipeline::FrameOutcome;
use crate::refuelling::ExpectedAttitude;

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
    history: AttitudeHistory,
    /// PX4's count of corrections by a jump.
    resets: Option<u8>,
    last_bad: Option<String>,
}

impl HeardAttitude {
    fn new(max_age_s: f64) -> Self {
        Self {
            history: AttitudeHistory::new(max_age_s),
            resets: None,
            last_bad: None,
        }
    }

    /// Takes a sample.
    ///
    /// # Errors
    /// [`FlightStackError`]: it cannot be used, and is not.
    fn take(
        &mut self,
        message: &AttitudeMessage,
        px4_minus_ros_us: i64,
    ) -> Result<(), FlightStackError> {
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
        match sample {
            Ok(sample) => self.history.push(sample),
            Err(error) => self.last_bad = Some(error.to_string()),
        }
        sample.map(|_| ())
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
    #[error("{0}: one of them is wrong, or the nominal attitude is")]
    Unlikely(Contradiction),
}

/// Why there is no attitude of the receiver to turn outputs to local axes with.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub(crate) enum NoLocalAttitude {
    #[error(transparent)]
    Missing(#[from] AttitudeError),
    #[error(
        "it or that of the tanker is wrong, and until both agree with the image again, or ~/reset is called, it is not used: {0}"
    )]
    Contradicted(Contradiction),
}

/// The samples of both aircraft.
pub(crate) struct Attitudes {
    pub(super) receiver: HeardAttitude,
    pub(super) tanker: HeardAttitude,
    px4_minus_ros_us: i64,
    /// What both reported together has to be near, and how well it is known; `None` where it is not used.
    expected: Option<(ExpectedAttitude, ReportedAttitudeSettings)>,
    agreement: Agreement,
}

impl Attitudes {
    /// Returns the attitudes of a configuration, none heard yet.
    pub(super) fn new(configuration: &Configuration) -> Self {
        let consumers = &configuration.consumers;
        let mut attitudes = Self {
            receiver: HeardAttitude::new(consumers.attitude_max_age_s),
            tanker: HeardAttitude::new(configuration.tanker_attitude_max_age_s),
            px4_minus_ros_us: consumers.px4_minus_ros_us,
            expected: None,
            agreement: Agreement::default(),
        };
        attitudes.on_configuration(configuration);
        attitudes
    }

    /// Takes changed parameters: of these only the nominal attitude and the limit can change.
    pub(super) fn on_configuration(&mut self, configuration: &Configuration) {
        self.expected = configuration
            .settings
            .reported_attitude
            .map(|settings| (configuration.expected_attitude, settings));
    }

    /// Takes a sample of the receiver's attitude.
    ///
    /// # Errors
    /// [`FlightStackError`]: it is not used.
    pub(super) fn on_receiver(
        &mut self,
        message: &AttitudeMessage,
    ) -> Result<(), FlightStackError> {
        self.receiver.take(message, self.px4_minus_ros_us)
    }

    /// Takes a sample of the tanker's attitude.
    ///
    /// # Errors
    /// [`FlightStackError`]: it is not used.
    pub(super) fn on_tanker(&mut self, message: &AttitudeMessage) -> Result<(), FlightStackError> {
        self.tanker.take(message, self.px4_minus_ros_us)
    }

    /// Returns the receiver's attitude at a stamp, for outputs in local axes.
    ///
    /// # Errors
    /// [`NoLocalAttitude`]: it is missing, or it may be the wrong one of two that contradict each other.
    pub(super) fn of_receiver(&self, stamp_ns: i64) -> Result<AttitudeAt, NoLocalAttitude> {
        match self.agreement.contradiction() {
            Some(contradiction) => Err(NoLocalAttitude::Contradicted(contradiction)),
            None => Ok(self.receiver.history.at(stamp_ns)?),
        }
    }

    /// Compares the outcome of a frame with what was reported for it; returns how they contradict each other, if they did
    /// when both were there last.
    pub(super) fn compare(
        &mut self,
        reported: Option<&Result<Rotation3<f64>, NoReportedAttitude>>,
        outcome: &FrameOutcome,
    ) -> Option<Contradiction> {
        match (reported, &self.expected) {
            (Some(Ok(reported)), Some((_, settings))) => {
                self.agreement.judge(reported, settings, outcome);
            }
            (Some(Err(NoReportedAttitude::Unlikely(contradiction))), _) => {
                self.agreement.contradicted(*contradiction);
            }
            _ => {}
        }
        self.agreement.contradiction()
    }

    /// Forgets that attitudes contradicted each other.
    pub(super) const fn on_reset(&mut self) {
        self.agreement.forget();
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
        let (expected, _) = self.expected?;
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
        Err(NoReportedAttitude::Unlikely(Contradiction::Unlikely {
            off_deg,
            limit_deg,
        }))
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
        for nanosec in [0, 20_000_000] {
            let taken = attitudes.on_receiver(&imu(nanosec, 30.0));
            assert_eq!(taken, Ok(()));
            let taken = attitudes.on_tanker(&imu(nanosec, 30.0 + left_deg));
            assert_eq!(taken, Ok(()));
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
            matches!(refused, Err(NoReportedAttitude::Unlikely(Contradiction::Unlikely { off_deg, limit_deg: 15.0 })) if (off_deg - 20.0).abs() < 1e-9),
            "{refused:?}"
        );
        let nominal = ("nominal_yaw_deg", ParameterValue::Double(15.0));
        assert!(reported(&[SIGMA, nominal], 20.0).expect("used").is_ok());
        let limit = ("max_attitude_deviation_deg", ParameterValue::Double(180.0));
        assert!(reported(&[SIGMA, limit], 179.0).expect("used").is_ok());
    }
}
