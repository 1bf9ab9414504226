//! Pixel <-> ray: what a camera does to a direction before it becomes a place in an image.
//!
//! A [`CameraInfo`] is plain data from outside, unchecked; a [`Camera`] exists only checked. Knows ROS's
//! rules for calibrations, lens formulas and their limits; never a topic, a file, a clock or what the
//! rays are for.
//!
//! Rays are in the `camera` frame (optical: x right, y down, z ahead), by their point on `z = 1`. Pixels
//! are those that detections come in: of the raw or the rectified image, after region of interest and
//! binning.
//!
//! A lens polynomial is calibrated inside the image and folds back somewhere outside. Both
//! [`Camera::ray_from_pixel`] and [`Camera::project`] refuse what lies beyond the same limit, found at
//! construction, instead of returning a ray that is plausible and wrong.

mod budget_file;
mod calibration;
mod distortion;
mod error;
mod file;
mod info;
mod model;
#[cfg(test)]
mod tests;

pub use budget_file::{CalibrationBudget, CalibrationBudgetError};
pub use calibration::{CALIBRATION_SIZE, CalibrationChange, FIRST_COEFFICIENT};
pub use error::{CameraError, UndistortError};
pub use file::{CameraFileError, CameraFileWarning};
pub use info::{CameraInfo, OffCentre, RegionOfInterest};
pub use model::{Camera, Pixel, Ray};
