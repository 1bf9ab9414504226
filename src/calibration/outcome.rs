//! The result of a calibration.

use nalgebra::{DMatrix, Rotation3};
use serde::Serialize;

use super::gauge::GaugeMode;
use super::noise::DetectorNoise;
use crate::camera::CalibrationChange;
use crate::target::{MapChange, MarkerMap};

/// What a recording tells beyond the survey.
#[derive(Debug, Clone)]
pub struct Calibration {
    /// Frames of the recording.
    pub frames: usize,
    /// Frames that were used.
    pub used_frames: usize,
    /// Detections that were used.
    pub used_points: usize,
    /// Detections that were left out as wrong, in frames that were used.
    pub left_out_points: usize,
    /// Steps of the last adjustment.
    pub steps: usize,
    /// The sum of squared residuals over their variances, priors included, of the last adjustment.
    pub cost: f64,
    /// Every unknown and what became of it.
    pub parameters: Vec<Parameter>,
    /// What no image can tell.
    pub gauge: Vec<GaugeMode>,
    /// The detector.
    pub noise: DetectorNoise,
    /// By what factor sigmas were widened because noise lasts from frame to frame.
    pub lasting_factor: f64,
    /// The map.
    pub map: MapOutcome,
    /// The camera, if its budget states a sigma.
    pub camera: Option<CameraOutcome>,
    /// The mount, if it was asked for.
    pub mount: Option<MountOutcome>,
    /// What a reader has to know before using the result.
    pub warnings: Vec<String>,
}

/// One unknown.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Parameter {
    #[serde(skip)]
    pub(super) column: usize,
    /// Its name.
    pub name: String,
    /// `m`, `rad`, or `sigma`: of a mode of the camera's budget.
    pub unit: &'static str,
    /// Estimate minus what was believed.
    pub estimate: f64,
    /// Before the recording.
    pub sigma_before: f64,
    /// After it.
    pub sigma_after: f64,
    /// The estimate over the sigma that it should have if prior and data are as stated.
    pub sigmas: f64,
    /// Whether that is believable.
    pub is_plausible: bool,
    /// Whether it is written.
    pub movement: Movement,
}

/// What becomes of an unknown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Movement {
    /// It is written as estimated.
    Moved,
    /// It stays: the data hardly reduce its sigma.
    NotSupported,
    /// It stays: it was estimated, but moving it was not asked for.
    NotAsked,
    /// It stays: many of its detections were left out as wrong, so the rest may be a selection.
    DetectionsLeftOut,
    /// It stays: no frame has the attitudes of both aircraft.
    NoAttitudes,
}

impl Movement {
    /// Returns the reason in words.
    #[must_use]
    pub const fn reason(self) -> &'static str {
        match self {
            Self::Moved => "moved",
            Self::NotSupported => "not moved: the data hardly reduce its sigma",
            Self::NotAsked => "not moved: estimated, but not asked for (--intrinsics)",
            Self::DetectionsLeftOut => {
                "not moved: many of its detections were left out as wrong; check its id and its survey"
            }
            Self::NoAttitudes => {
                "not moved: no frame has attitudes of both aircraft (parameters attitude and reported_attitude_sigma_deg), and without them no image tells the mount"
            }
        }
    }
}

/// The adjusted map.
#[derive(Debug, Clone)]
pub struct MapOutcome {
    /// What changes in the map's file.
    pub change: MapChange,
    /// The map with these changes, as the node will read it.
    pub map: MarkerMap,
    /// Covariance of the written positions of all unknown markers and tags, x, y, z each, m².
    pub covariance: DMatrix<f64>,
    /// The covariance that sigmas and modes of the written map claim; never smaller.
    pub claimed: DMatrix<f64>,
    /// Names of the rows of both, three rows each.
    pub bodies: Vec<String>,
}

/// The adjusted camera.
#[derive(Debug, Clone)]
pub struct CameraOutcome {
    /// Whether anything was moved.
    pub is_moved: bool,
    /// The change of the calibration that is written.
    pub change: CalibrationChange,
    /// Covariance of the written calibration, in the order of [`CalibrationChange`], that a budget has to state.
    pub covariance: DMatrix<f64>,
}

/// The adjusted mount.
#[derive(Debug, Clone)]
pub struct MountOutcome {
    /// Whether it was moved about any axis.
    pub is_moved: bool,
    /// Frames with reported attitudes.
    pub frames: usize,
    /// The receiver's axes to the optical ones, as written.
    pub camera_from_receiver: Rotation3<f64>,
    /// Standard deviation that remains about each of the camera's axes, rad.
    pub sigma_rad: [f64; 3],
}
