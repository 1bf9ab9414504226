//! Which approach, seen by which camera.

use std::fmt::{self, Display, Formatter};
use std::path::PathBuf;

use clap::Args;
use tanker_pose::camera::{Camera, CameraError, CameraInfo};
use tanker_pose::config::CalibrationSigmas;
use tanker_pose::estimation::ErrorBudget;
use tanker_pose::pipeline::error_budget;
use tanker_pose::simulation::{Approach, ApproachSettings};
use tanker_pose::target::MarkerMap;

use crate::options::{self, CalibrationError};
use crate::ros_options::between;

/// The camera of the paper, for those who name none.
pub const PAPER_CAMERA: &str = include_str!("../../../../config/cameras/paper.yaml");

/// What the approach looks like.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Approach")]
pub struct ApproachOptions {
    /// Beacons of the tanker: paper, fin6 or the path of a marker map
    #[arg(long, value_name = "MAP", default_value = "paper")]
    pub marker_map: String,
    /// Calibration file as ROS's `camera_calibration` writes it; the paper's camera when missing
    #[arg(long, value_name = "FILE")]
    camera: Option<PathBuf>,
    /// Distance ahead at the start, m
    #[arg(long, value_name = "M", default_value_t = 60.0, value_parser = between(0.1, 10000.0))]
    start_range_m: f64,
    /// Distance ahead at the end, m
    #[arg(long, value_name = "M", default_value_t = 15.0, value_parser = between(0.1, 10000.0))]
    end_range_m: f64,
    /// How long the approach takes, s
    #[arg(long, value_name = "S", default_value_t = 25.0, value_parser = between(0.001, 86400.0))]
    duration_s: f64,
    /// Images a second
    #[arg(long, value_name = "HZ", default_value_t = 30.0, value_parser = between(0.01, 1000.0))]
    pub rate_hz: f64,
    /// Noise of the detector on columns and rows, px; also what the detections state, and 0 states "not known"
    #[arg(long, value_name = "PX", default_value_t = 0.5, value_parser = between(0.0, 100.0))]
    sigma_px: f64,
    /// Amplitude of roll, pitch and yaw relative to the receiver, degrees
    #[arg(long, value_name = "DEG", default_value_t = 3.0, value_parser = between(0.0, 180.0))]
    attitude_deg: f64,
    /// Seed of noise, motion, faults and tanker
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
}

/// Why there is no such approach.
#[derive(Debug, thiserror::Error)]
pub enum ApproachError {
    #[error("cannot use the marker map: {0}")]
    MarkerMap(String),
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
    #[error("cannot use the camera's calibration: {0}")]
    Camera(#[from] CameraError),
    #[error(
        "expected a marker map with `sigma` or `flex` to draw the tanker from, and {name} has neither"
    )]
    ExactMap { name: String },
    #[error("expected at least one frame, but {duration_s} s at {rate_hz} Hz have none")]
    NoFrame { duration_s: f64, rate_hz: f64 },
}

impl ApproachOptions {
    /// Returns the approach, and the camera info that goes with it.
    ///
    /// # Inputs
    /// * `draw_tanker`: whether markers and airframe differ from the map, as its `sigma` and `flex` say.
    pub fn read(&self, draw_tanker: bool) -> Result<(Approach, CameraInfo), ApproachError> {
        let info = match &self.camera {
            None => {
                CameraInfo::from_yaml(PAPER_CAMERA, "paper.yaml")
                    .map_err(CalibrationError::from)?
                    .0
            }
            Some(path) => options::calibration(path)?,
        };
        let map = self.map()?;
        let budget = self.budget(&map, draw_tanker)?;
        let camera = Camera::from_info(&info, false)?;
        let mut approach = Approach::new(self.settings(), camera, map);
        if let Some(budget) = budget {
            approach = approach.in_a_world_of(&budget);
        }
        if approach.frame_count() == 0 {
            return Err(ApproachError::NoFrame {
                duration_s: self.duration_s,
                rate_hz: self.rate_hz,
            });
        }
        Ok((approach, info))
    }

    /// Returns the tanker's beacons.
    pub fn map(&self) -> Result<MarkerMap, ApproachError> {
        options::marker_map(&self.marker_map).map_err(ApproachError::MarkerMap)
    }

    /// Returns what the tanker is drawn from, if it is.
    fn budget(
        &self,
        map: &MarkerMap,
        draw_tanker: bool,
    ) -> Result<Option<ErrorBudget>, ApproachError> {
        if !draw_tanker {
            return Ok(None);
        }
        if map.budget().is_exact() {
            return Err(ApproachError::ExactMap {
                name: self.marker_map.clone(),
            });
        }
        let calibration = CalibrationSigmas::default();
        Ok(Some(error_budget(map.budget(), &calibration, &[])))
    }

    const fn settings(&self) -> ApproachSettings {
        ApproachSettings {
            start_range_m: self.start_range_m,
            end_range_m: self.end_range_m,
            duration_s: self.duration_s,
            rate_hz: self.rate_hz,
            sigma_px: self.sigma_px,
            attitude_deg: self.attitude_deg,
            seed: self.seed,
        }
    }
}

impl Display for ApproachOptions {
    fn fmt(&self, out: &mut Formatter<'_>) -> fmt::Result {
        write!(
            out,
            "{} m to {} m in {} s at {} Hz, {} px, seed {}",
            self.start_range_m,
            self.end_range_m,
            self.duration_s,
            self.rate_hz,
            self.sigma_px,
            self.seed
        )
    }
}
