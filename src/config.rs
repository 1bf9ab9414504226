//! Raw parameters -> checked settings.
use crate::estimation::EstimatorSettings;
/// Everything a frame's processing depends on, checked.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// How a pose is found and judged.
    pub estimator: EstimatorSettings,
    /// Standard deviation for detections that bring none, px.
    pub pixel_sigma_px: f64,
    /// Pixels are those of the rectified image: P instead of K and D.
    pub rectified: bool,
}
