//! One frame's straight line: detections in, one outcome out, the same for node, tools and tests.
//!
//! ```text
//! stamp -> camera -> frame_id -> every detection -> observations -> estimate -> trusted? -> outcome
//! ```
//!
//! Knows `estimation`, `camera`, `target`; time enters only as the stamp of a frame. Never reads a
//! clock, a file or a topic. What is missing is never replaced by a default, and every frame has an
//! outcome: a pose, or the one reason for none.

mod checks;
mod code;
mod outcome;

use std::sync::Arc;

use nalgebra::Rotation3;

use crate::camera::{Camera, CameraError, CameraInfo};
use crate::config::Settings;
use crate::estimation::{EstimateError, Estimator, Observation};
use crate::target::MarkerMap;

pub use checks::observe;
pub use code::OutcomeCode;
pub use outcome::{FrameOutcome, Refusal};

/// The time at which an image was taken, as ROS carries it: never converted, so never rounded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Hash)]
pub struct Stamp {
    /// Whole seconds.
    pub sec: i32,
    /// Nanoseconds on top, below 1e9.
    pub nanosec: u32,
}

/// s; a pose older than this says little about the next one.
const MAX_PREVIOUS_AGE_S: f64 = 2.0;

impl Stamp {
    /// Returns whether this is at or after `earlier`, by [`MAX_PREVIOUS_AGE_S`] at the most.
    fn follows_closely(self, earlier: Self) -> bool {
        let seconds = f64::from(self.sec) - f64::from(earlier.sec);
        let nanoseconds = f64::from(self.nanosec) - f64::from(earlier.nanosec);
        (0.0..=MAX_PREVIOUS_AGE_S).contains(&(seconds + nanoseconds * 1e-9))
    }
}

/// One beacon found in an image, before any check.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Detection {
    /// Marker id in the tanker's marker map.
    pub id: u32,
    /// Column of the centre, px; the centre of the top-left pixel is (0, 0).
    pub u_px: f64,
    /// Row of the centre, px.
    pub v_px: f64,
    /// Standard deviation of column and of row, px; 0 where the detector does not know it.
    pub sigma_px: f64,
}

/// All detections of one image, before any check.
#[derive(Debug, Clone, PartialEq)]
pub struct DetectionFrame {
    /// When the image was taken.
    pub stamp: Stamp,
    /// The camera optical frame that the pixels belong to.
    pub frame_id: String,
    /// The detections, in any order.
    pub detections: Vec<Detection>,
}

/// What the latest camera info came to.
#[derive(Debug)]
struct LatchedCamera {
    info: CameraInfo,
    frame_id: String,
    camera: Result<Camera, CameraError>,
}

/// The estimator with what it remembers between frames: the camera, and the last trusted attitude.
#[derive(Debug)]
pub struct Pipeline {
    settings: Settings,
    estimator: Estimator,
    map: Arc<MarkerMap>,
    camera: Option<LatchedCamera>,
    /// Rotation of the last trusted pose, with its time.
    previous: Option<(Rotation3<f64>, Stamp)>,
}

impl Pipeline {
    /// Returns a pipeline that has not seen a camera yet.
    #[must_use]
    pub fn new(settings: Settings, map: Arc<MarkerMap>) -> Self {
        Self {
            estimator: Estimator::new(settings.estimator.clone()),
            settings,
            map,
            camera: None,
            previous: None,
        }
    }

    /// Replaces the settings from the next frame on; the camera and the last attitude stay.
    pub fn set_settings(&mut self, settings: Settings) {
        if settings.estimator != *self.estimator.settings() {
            self.estimator = Estimator::new(settings.estimator.clone());
        }
        if settings.rectified != self.settings.rectified
            && let Some(latched) = &mut self.camera
        {
            latched.camera = Camera::from_info(&latched.info, settings.rectified);
        }
        self.settings = settings;
    }

    /// Latches a camera info; returns whether it differs from the one before.
    ///
    /// # Errors
    /// [`CameraError`] when it cannot be used. It then replaces a good one all the same, so that
    /// frames are refused rather than solved with a calibration that no longer holds.
    pub fn set_camera(&mut self, info: &CameraInfo, frame_id: &str) -> Result<bool, CameraError> {
        if let Some(latched) = &self.camera
            && latched.info == *info
            && latched.frame_id == frame_id
        {
            return latched.camera.as_ref().map(|_| false).map_err(Clone::clone);
        }
        let camera = Camera::from_info(info, self.settings.rectified);
        let result = camera.as_ref().map(|_| true).map_err(Clone::clone);
        self.camera = Some(LatchedCamera {
            info: info.clone(),
            frame_id: frame_id.to_owned(),
            camera,
        });
        result
    }

    /// Returns what the latest camera info came to, with its frame; none before the first one.
    #[must_use]
    pub fn camera(&self) -> Option<(&str, Result<&Camera, &CameraError>)> {
        let latched = self.camera.as_ref()?;
        Some((&latched.frame_id, latched.camera.as_ref()))
    }

    /// Returns the outcome of one frame.
    pub fn process(&mut self, frame: &DetectionFrame) -> FrameOutcome {
        let previous = self
            .previous
            .filter(|(_, stamp)| frame.stamp.follows_closely(*stamp));
        let outcome = match self.observations(frame) {
            Ok((camera, observations)) => {
                let rotation = previous.as_ref().map(|(rotation, _)| rotation);
                solve(&self.estimator, camera, &observations, rotation)
            }
            Err(refusal) => FrameOutcome::refused(refusal),
        };
        if let Ok(solution) = &outcome.result {
            let rotation = solution.camera_from_tanker.rotation.to_rotation_matrix();
            self.previous = Some((rotation, frame.stamp));
        }
        outcome
    }

    /// Returns the camera of a frame with this header.
    ///
    /// # Errors
    /// [`Refusal`] when the stamp is none, there is no camera, or not this one: what [`Self::process`] asks first.
    pub fn camera_for(&self, stamp: Stamp, frame_id: &str) -> Result<&Camera, Refusal> {
        checks::check_stamp(stamp)?;
        let latched = self.camera.as_ref().ok_or(Refusal::NoCameraInfo)?;
        let camera = latched
            .camera
            .as_ref()
            .map_err(|cause| Refusal::InvalidCameraInfo(cause.clone()))?;
        checks::check_frame_id(&latched.frame_id, frame_id)?;
        Ok(camera)
    }

    fn observations(&self, frame: &DetectionFrame) -> Result<(&Camera, Vec<Observation>), Refusal> {
        let camera = self.camera_for(frame.stamp, &frame.frame_id)?;
        let observations = observe(
            camera,
            &frame.detections,
            self.settings.pixel_sigma_px,
            |id| self.map.get(id),
        )?;
        Ok((camera, observations))
    }
}

/// Returns the outcome of checked observations: the estimate, judged.
#[must_use]
pub fn solve(
    estimator: &Estimator,
    camera: &Camera,
    observations: &[Observation],
    previous: Option<&Rotation3<f64>>,
) -> FrameOutcome {
    let asked = estimator.settings().initialisation;
    match estimator.estimate(camera, observations, previous) {
        Ok(solution) => FrameOutcome::judged(solution, observations, estimator.settings()),
        Err(error) => {
            let attempted = !matches!(
                error,
                EstimateError::TooFewPoints { .. }
                    | EstimateError::TooFewPrecisePoints { .. }
                    | EstimateError::NoRay { .. }
            );
            let mut outcome = FrameOutcome::refused(Refusal::from(error));
            outcome.initialisation = attempted.then_some(asked);
            outcome
        }
    }
}
