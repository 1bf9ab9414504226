//! Settings for the processing of a frame.

use nalgebra::Rotation3;

use crate::estimation::{CorrelatedNoise, EstimatorSettings};
use crate::integrity::IntegritySettings;
use crate::tracking::CheckedFilterSettings;

/// All settings for the processing of a frame, checked.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Settings of the estimator.
    pub estimator: EstimatorSettings,
    /// Standard deviation of detections that do not state one, px.
    pub pixel_sigma_px: f64,
    /// Detections closer than this to the edge of the image are left out, px; 0: no margin.
    pub edge_margin_px: f64,
    /// How attitudes that both aircraft report are taken; `None`: not at all.
    pub reported_attitude: Option<ReportedAttitudeSettings>,
    /// Standard deviations of the calibration's errors.
    pub calibration: CalibrationSigmas,
    /// Whether to multiply the sigmas of detections by the factor by which the scatter of residuals exceeds them.
    pub widen_by_sigma_factor: bool,
    /// Noise of detections that is correlated from frame to frame.
    pub correlated_noise: Option<CorrelatedNoise>,
    /// Whether pixels are those of the rectified image: P instead of K and D.
    pub rectified: bool,
    /// Probabilities of protection levels; `None`: none are computed.
    pub integrity: Option<IntegritySettings>,
    /// How the camera is turned in the receiver: optical axes to x ahead, y left, z up.
    pub receiver_from_camera: Rotation3<f64>,
    /// Track settings; `None` disables tracking.
    pub track: Option<CheckedFilterSettings>,
}

/// What turns the attitudes that both aircraft report into a prior.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReportedAttitudeSettings {
    /// The camera's mount: the receiver's axes (x forward, y left, z up) to the optical ones.
    pub camera_from_receiver: Rotation3<f64>,
    /// Standard deviation of both attitudes and the mount together, about each axis, rad.
    pub sigma_rad: f64,
}

/// Standard deviations of the calibration and of image jitter; 0: no error.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CalibrationSigmas {
    /// Of both focal lengths together, relative: 0.003 is 0.3 %.
    pub focal_length: f64,
    /// Of each coordinate of the principal point, px.
    pub principal_point_px: f64,
    /// Of the coefficients of D, in the order of `sensor_msgs/CameraInfo`.
    pub distortion: [f64; 8],
    /// Of a shift of the whole image, independent in each frame, px.
    pub jitter_px: f64,
}
