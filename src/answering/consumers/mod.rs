//! Outputs for refuelling and flight stacks: each is enabled by its own parameter, and held back with a reason where
//! something is missing.
//!
//! States (`receptacle`, PX4's landing target) come from the track. What a flight stack feeds to a filter of its
//! own (PX4's marker report, MAVROS) comes from single frames: two filters in series would be overconfident.

mod frame;
mod gated;
mod silence;

use std::path::PathBuf;
use std::time::Instant;

use crate::answering::attitudes::{Attitudes, HeardAttitude};
use crate::answering::diagnostics::Tally;
use crate::answering::output::Sinks;
use crate::answering::topics;
use crate::config::{Configuration, ConsumerConfiguration, OutputError};
use crate::estimation::Solution;
use crate::frames::{LocalAttitude, PoseEstimate};
use crate::geometry::Motion;
use crate::messages::{DiagnosticStatus, Header, KeyValue};
use crate::pipeline::Stamp;
use crate::refuelling::{RefuellingGeometry, RefuellingSetup, RefuellingSetupError};
use crate::text;
use frame::Frame;
use gated::GatedOutput;
pub(crate) use silence::Silence;

/// Why the outputs cannot be opened.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConsumersError {
    /// Inconsistent parameters.
    #[error(transparent)]
    Outputs(#[from] OutputError),
    /// The setup's file.
    #[error("parameter \"refuelling\": cannot read {}: {source}", text::path(path))]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// Outputs depend on alert limits that the setup does not state.
    #[error("parameter \"require_integrity\": {name} has no alert_limit to keep")]
    NoAlertLimit {
        /// The file.
        name: String,
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
    let setup = RefuellingSetup::from_yaml(&text, name)?;
    if configuration.require_integrity && setup.alert_limit_m.is_none() {
        return Err(ConsumersError::NoAlertLimit { name: name.clone() });
    }
    Ok(Some(setup))
}

/// Whether protection levels are available and keep their limits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Protection {
    /// Those of the frame.
    pub(crate) of_frame: bool,
    /// Those of the track at its stamp.
    pub(crate) of_track: bool,
}

impl Protection {
    /// Returns the track where it may be published, or why it may not; or why nothing may.
    fn permits<T>(
        self,
        is_required: bool,
        track: Option<T>,
    ) -> Result<Result<T, Silence>, Silence> {
        if is_required && !self.of_frame {
            return Err(Silence::NotProtected);
        }
        Ok(match track {
            None => Err(Silence::NoTrack),
            Some(_) if is_required && !self.of_track => Err(Silence::TrackNotProtected),
            Some(track) => Ok(track),
        })
    }
}

/// The outputs that are on.
pub struct Consumers {
    setup: RefuellingSetup,
    geometry: RefuellingGeometry,
    configuration: ConsumerConfiguration,
    outputs: Vec<Box<dyn GatedOutput>>,
}

impl Consumers {
    /// Returns the outputs of a configuration, opened; `None` when all are off.
    ///
    /// # Errors
    /// When a topic cannot be opened.
    pub fn open<S: Sinks>(
        sinks: &mut S,
        wanted: &Configuration,
        setup: Option<RefuellingSetup>,
    ) -> Result<Option<Self>, S::Error> {
        let configuration = &wanted.consumers;
        let Some(setup) = setup.filter(|_| configuration.any()) else {
            return Ok(None);
        };
        let outputs = [
            gated::open(sinks, &topics::RECEPTACLE, wanted, frame::receptacle)?,
            gated::open(
                sinks,
                &topics::PX4_LANDING_TARGET,
                wanted,
                frame::px4_landing_target,
            )?,
            gated::open(
                sinks,
                &topics::PX4_FIDUCIAL_MARKER,
                wanted,
                frame::px4_fiducial_marker,
            )?,
            gated::open(
                sinks,
                &topics::MAVROS_LANDING_TARGET,
                wanted,
                frame::mavros_landing_target,
            )?,
            gated::open(sinks, &topics::MAVROS_POSE, wanted, frame::mavros_pose)?,
        ];
        Ok(Some(Self {
            geometry: setup.geometry(&configuration.receiver_from_camera),
            setup,
            outputs: outputs.into_iter().flatten().collect(),
            configuration: configuration.clone(),
        }))
    }

    /// Reloads setup and mount: a stale lever arm gives a plausible but wrong position. Counts start again, like
    /// everything that a clean-up forgets.
    pub fn configure(&mut self, configuration: &ConsumerConfiguration, setup: RefuellingSetup) {
        self.setup = setup;
        self.on_configuration(configuration);
        for output in &mut self.outputs {
            output.reset();
        }
    }

    /// Takes changed parameters: of these only the camera's mount can change.
    pub fn on_configuration(&mut self, configuration: &ConsumerConfiguration) {
        self.geometry = self.setup.geometry(&configuration.receiver_from_camera);
    }

    /// Returns what is fixed to the two aircraft.
    #[must_use]
    pub const fn geometry(&self) -> &RefuellingGeometry {
        &self.geometry
    }

    /// Returns the track where outputs may be published with this protection; what carries single frames does not need
    /// it.
    pub(crate) fn check<'a>(
        &self,
        protection: Protection,
        track: Option<&'a Motion>,
    ) -> Result<Result<&'a Motion, Silence>, Silence> {
        protection.permits(self.configuration.require_integrity, track)
    }

    /// Publishes what follows from a frame's trusted pose, and from the track at its stamp as [`Self::check`] has it; or
    /// nothing, while the tanker's attitude shows that they would be misread.
    pub(crate) fn on_pose(
        &mut self,
        header: &Header,
        place: Result<(&Solution, Result<&Motion, Silence>), Silence>,
        attitudes: &Attitudes,
        tally: &mut Tally,
        now: Instant,
    ) {
        let frame = match place {
            Ok((solution, camera_from_tanker)) => {
                let stamp_ns = Stamp::from(header.stamp).nanoseconds();
                Ok(Frame {
                    setup: &self.setup,
                    geometry: &self.geometry,
                    stamp: header.stamp,
                    stamp_ns,
                    receiver: &self.configuration.receiver_frame_id,
                    camera_from_tanker,
                    target: self.geometry.receptacle_pose(&PoseEstimate {
                        b_from_a: solution.camera_from_tanker,
                        covariance: solution.covariance,
                    }),
                    attitude: self.attitude_at(attitudes, stamp_ns),
                    px4_minus_ros_us: self.configuration.px4_minus_ros_us,
                })
            }
            Err(silence) => Err(silence),
        };
        for output in &mut self.outputs {
            output.publish(&frame, tally, now);
        }
    }

    /// Returns the health of these outputs since the last report.
    pub(super) fn diagnostics(
        &mut self,
        node: &str,
        receiver: &mut HeardAttitude,
    ) -> DiagnosticStatus {
        let mut values = Vec::new();
        let mut reasons: Vec<String> = Vec::new();
        for output in &mut self.outputs {
            reasons.extend(output.report(&mut values));
        }
        values.push(KeyValue {
            key: "unusable_attitude".to_owned(),
            value: receiver.take_last_bad().unwrap_or_default(),
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

    fn attitude_at(&self, attitudes: &Attitudes, stamp_ns: i64) -> Result<LocalAttitude, Silence> {
        let found = attitudes.of_receiver(stamp_ns)?;
        Ok(LocalAttitude {
            local_from_b: found.local_from_body,
            covariance: self.configuration.attitude_covariance,
            rate_in_b: found.rate_in_body,
            rate_covariance: self.configuration.attitude_rate_covariance,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME_ONLY: Protection = Protection {
        of_frame: true,
        of_track: false,
    };
    const BOTH: Protection = Protection {
        of_frame: true,
        of_track: true,
    };
    const TRACK_ONLY: Protection = Protection {
        of_frame: false,
        of_track: true,
    };

    #[test]
    fn track_is_held_back_without_levels_of_its_own_and_all_without_those_of_the_frame() {
        let track = Some("track");
        assert!(matches!(BOTH.permits(true, track), Ok(Ok("track"))));
        let held = FRAME_ONLY.permits(true, track);
        assert!(
            matches!(held, Ok(Err(Silence::TrackNotProtected))),
            "{held:?}"
        );
        let held = TRACK_ONLY.permits(true, track);
        assert!(matches!(held, Err(Silence::NotProtected)), "{held:?}");
    }

    #[test]
    fn levels_that_are_not_required_hold_nothing_back() {
        let none = Protection::default();
        assert!(matches!(
            none.permits(false, Some("track")),
            Ok(Ok("track"))
        ));
        let missing = none.permits(false, None::<&str>);
        assert!(matches!(missing, Ok(Err(Silence::NoTrack))), "{missing:?}");
    }
}
