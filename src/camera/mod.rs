//! Conversion between pixels and rays.
//!
//! A [`CameraInfo`] is plain unchecked data; a [`Camera`] can only be constructed through the checks. This module
//! contains ROS's rules for calibrations, lens formulas and their limits. It does not depend on topics, files, clocks
//! or the use of the rays.
//!
//! Rays are in the `camera` frame (optical: x right, y down, z ahead), given by their point on `z = 1`. Pixels are
//! those of the detections: of the raw or the rectified image, after region of interest and binning.
//!
//! A lens polynomial is calibrated inside the image and folds back somewhere outside. Both [`Camera::ray_from_pixel`]
//! and [`Camera::project`] refuse points beyond the same limit, which is determined at construction, because the result
//! would look plausible and be wrong.

mod budget_file;
mod calibration;
mod distortion;
mod error;
mod file;
mod from_info;
mod image;
mod info;
mod model;
#[cfg(test)]
mod tests;
mod written;

pub use budget_file::{CalibrationBudget, CalibrationBudgetError};
pub use calibration::{CALIBRATION_SIZE, CalibrationChange, FIRST_COEFFICIENT};
pub use error::{CameraError, UndistortError};
pub use file::{CameraFileError, CameraFileWarning};
pub use image::OffCentre;
pub use info::{CameraInfo, RegionOfInterest};
pub use model::{Camera, Pixel, Ray};
