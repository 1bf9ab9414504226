//! Raw parameters -> checked settings.
//!
//! `table` declares each parameter once; [`Parameters`] keeps values that were held against it; `configuration` makes of
//! them what the floors below work with. Knows `estimation` and `tracking`; never a file, a topic or where a value came
//! from.

mod configuration;
mod consumers;
mod people;
mod table;
#[cfg(test)]
mod tests;
mod words;

pub use configuration::{Configuration, nominal_camera_from_tanker};
pub use consumers::{AttitudeSource, ConsumerConfiguration, OutputError};
pub use people::{parameter_file, parameter_tables};
pub use ros2_node::parameters::{
    Key, Kind, ParameterError, ParameterSpec, ParameterValue, Parameters, Words,
};
pub use table::{KEYS, Keys, SECTIONS, TABLE};
pub use words::{Attitude, Input};

use table::Values;

use crate::estimation::EstimatorSettings;
use crate::tracking::FilterSettings;

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
    /// Pixels are those of the rectified image: P instead of K and D.
    pub rectified: bool,
    /// Track settings; `None` disables tracking. Settings out of the filter's ranges disable it too: the table allows none.
    pub track: Option<FilterSettings>,
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

/// Checks values that are allowed one by one, but perhaps not together: what one output needs, another parameter may
/// take away.
///
/// # Errors
/// [`OutputError`] names the output.
pub fn check_together(parameters: &Parameters) -> Result<(), OutputError> {
    ConsumerConfiguration::from(&Values::from(parameters)).check()
}
