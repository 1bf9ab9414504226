//! What the processing of a frame depends on.

use crate::estimation::{CorrelatedNoise, EstimatorSettings};
use crate::tracking::CheckedFilterSettings;

/// Everything a frame's processing depends on, checked.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// How a pose is found and judged.
    pub estimator: EstimatorSettings,
    /// Standard deviation for detections that bring none, px.
    pub pixel_sigma_px: f64,
    /// Detections nearer than this to the edge of the image are left out, px; 0: none.
    pub edge_margin_px: f64,
    /// What the calibration may have wrong.
    pub calibration: CalibrationSigmas,
    /// Sigmas of detections are multiplied by the factor by which residuals scatter more than they say.
    pub widen_by_sigma_factor: bool,
    /// What part of the noise of detections lasts from frame to frame.
    pub correlated_noise: Option<CorrelatedNoise>,
    /// Pixels are those of the rectified image: P instead of K and D.
    pub rectified: bool,
    /// Track settings; `None` disables tracking.
    pub track: Option<CheckedFilterSettings>,
}

/// Standard deviations of the calibration and of a shaking image; all 0: both are exact.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CalibrationSigmas {
    /// Of both focal lengths together, a share: 0.003 is 0.3 %.
    pub focal_length: f64,
    /// Of each coordinate of the principal point, px.
    pub principal_point_px: f64,
    /// Of the coefficients of D, in the order of `sensor_msgs/CameraInfo`.
    pub distortion: [f64; 8],
    /// Of a shift of the whole image, each frame another one, px.
    pub jitter_px: f64,
}
