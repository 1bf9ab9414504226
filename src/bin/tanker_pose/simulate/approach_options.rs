//! Options of the approach and the camera.

use std::fmt::{self, Display, Formatter};
use std::path::PathBuf;

use clap::Args;
use tanker_pose::camera::{Camera, CameraError, CameraInfo};
use tanker_pose::config::{CalibrationSigmas, KEYS};
use tanker_pose::estimation::ErrorBudget;
use tanker_pose::pipeline::{budget_in_words, error_budget};
use tanker_pose::simulation::{Approach, ApproachSettings};
use tanker_pose::target::{MapBudget, MarkerMap};

use crate::options::{self, CalibrationError, double};
use crate::ros_options::between;

/// The paper's camera, the default.
pub const PAPER_CAMERA: &str = include_str!("../../../../config/cameras/paper.yaml");

/// The approach.
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
    /// How long an error of a detection lasts, s; 0: it is another in each image
    #[arg(long, value_name = "S", default_value_t = 0.0, value_parser = between(0.0, 10.0))]
    noise_time_constant_s: f64,
    /// Gusts: root mean square of the relative acceleration to the left and upwards, m/s²
    #[arg(long, value_name = "MPS2", default_value_t = 0.0, value_parser = between(0.0, 100.0))]
    gust_mps2: f64,
    /// Amplitude of roll, pitch and yaw relative to the receiver, degrees
    #[arg(long, value_name = "DEG", default_value_t = 3.0, value_parser = between(0.0, 180.0))]
    attitude_deg: f64,
    /// Seed of noise, motion, faults and world
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Draw the true tanker from the map's `sigma` and `flex`: markers are not where the map has them, and the airframe
    /// moves
    #[arg(long, help_heading = WORLD)]
    draw_tanker: bool,
    /// The true focal length is off the calibration's by a share that is drawn with this standard deviation
    #[arg(long, help_heading = WORLD, value_name = "SHARE", default_value_t = 0.0, value_parser = double(KEYS.focal_length_sigma))]
    focal_length_sigma: f64,
    /// The same of each coordinate of the principal point, px
    #[arg(long, help_heading = WORLD, value_name = "PX", default_value_t = 0.0, value_parser = double(KEYS.principal_point_sigma_px))]
    principal_point_sigma_px: f64,
    /// The same of the first coefficient of D
    #[arg(long, help_heading = WORLD, value_name = "SIGMA", default_value_t = 0.0, value_parser = double(KEYS.k1_sigma))]
    k1_sigma: f64,
    /// The same of the second coefficient of D
    #[arg(long, help_heading = WORLD, value_name = "SIGMA", default_value_t = 0.0, value_parser = double(KEYS.k2_sigma))]
    k2_sigma: f64,
    /// The image shakes: each is shifted as a whole, with this standard deviation, px
    #[arg(long, help_heading = WORLD, value_name = "PX", default_value_t = 0.0, value_parser = double(KEYS.jitter_px))]
    jitter_px: f64,
}

/// Above the options of a world that differs from what is published about it.
const WORLD: &str = "World";

/// Why the approach is not possible.
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
    /// Returns the approach and its camera info.
    ///
    /// The camera info is what the world's camera is drawn about.
    pub fn read(&self) -> Result<(Approach, CameraInfo), ApproachError> {
        let info = match &self.camera {
            None => {
                CameraInfo::from_yaml(PAPER_CAMERA, "paper.yaml")
                    .map_err(CalibrationError::from)?
                    .0
            }
            Some(path) => options::calibration(path)?,
        };
        let map = self.map()?;
        let budget = self.budget(&map)?;
        let camera = Camera::from_info(&info, false)?;
        let mut approach = Approach::new(self.settings(), camera, map);
        if !budget.is_empty() {
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

    /// Returns what the world is drawn from; nothing unless an option says so.
    fn budget(&self, map: &MarkerMap) -> Result<ErrorBudget, ApproachError> {
        let exact = MapBudget::default();
        let of_map = if self.draw_tanker {
            map.budget()
        } else {
            &exact
        };
        if self.draw_tanker && of_map.is_exact() {
            return Err(ApproachError::ExactMap {
                name: self.marker_map.clone(),
            });
        }
        Ok(error_budget(of_map, &self.calibration(), &[]))
    }

    /// Returns what the camera is drawn from.
    fn calibration(&self) -> CalibrationSigmas {
        CalibrationSigmas {
            focal_length: self.focal_length_sigma,
            principal_point_px: self.principal_point_sigma_px,
            distortion: [self.k1_sigma, self.k2_sigma, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            jitter_px: self.jitter_px,
        }
    }

    /// Returns the node's parameters that say what the camera is drawn from.
    pub fn parameters(&self) -> [(&'static str, f64); 5] {
        [
            (KEYS.focal_length_sigma.name(), self.focal_length_sigma),
            (
                KEYS.principal_point_sigma_px.name(),
                self.principal_point_sigma_px,
            ),
            (KEYS.k1_sigma.name(), self.k1_sigma),
            (KEYS.k2_sigma.name(), self.k2_sigma),
            (KEYS.jitter_px.name(), self.jitter_px),
        ]
    }

    /// Returns whether something is off for many images, so that their errors are not independent.
    pub fn has_lasting_errors(&self) -> bool {
        let unshaken = CalibrationSigmas {
            jitter_px: 0.0,
            ..self.calibration()
        };
        self.draw_tanker
            || self.noise_time_constant_s > 0.0
            || unshaken != CalibrationSigmas::default()
    }

    /// Returns what the world is drawn from, for people; `None` where it is as published.
    pub fn world_in_words(&self, map: &MarkerMap) -> Option<String> {
        let is_drawn = self.draw_tanker || self.calibration() != CalibrationSigmas::default();
        let exact = MapBudget::default();
        let of_map = if self.draw_tanker {
            map.budget()
        } else {
            &exact
        };
        is_drawn.then(|| budget_in_words(of_map, &self.calibration(), None))
    }

    const fn settings(&self) -> ApproachSettings {
        ApproachSettings {
            start_range_m: self.start_range_m,
            end_range_m: self.end_range_m,
            duration_s: self.duration_s,
            rate_hz: self.rate_hz,
            sigma_px: self.sigma_px,
            noise_time_constant_s: self.noise_time_constant_s,
            gust_mps2: self.gust_mps2,
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
