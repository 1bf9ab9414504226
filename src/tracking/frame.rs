//! What one frame says of the motion, and whether it can be taken.

use nalgebra::{Isometry3, Matrix6};

use super::lasting::LastingError;
use super::matrix6::symmetric;
use super::outcome::MeasurementError;
use super::symmetric6::{Factor, rows};
use crate::geometry::PoseCovariance;

/// A pose with its covariance given the lasting causes, the floor added.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Measured {
    pub(super) camera_from_tanker: Isometry3<f64>,
    pub(super) noise: PoseCovariance,
}

/// What one frame said.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Frame<I> {
    pub(super) stamp_ns: i64,
    /// `None`: a frame without a pose.
    pub(super) measured: Option<Measured>,
    pub(super) lasting: Vec<LastingError>,
    /// For what follows the error of the track.
    pub(super) input: I,
}

/// Returns nothing when a pose and its errors can be taken.
///
/// # Errors
/// [`MeasurementError`]: what is not finite, or no covariance.
pub(super) fn check(
    pose: &Isometry3<f64>,
    noise: &PoseCovariance,
    lasting: &[LastingError],
) -> Result<(), MeasurementError> {
    let position = pose.translation.vector;
    let numbers = position.iter().chain(pose.rotation.coords.iter());
    if !numbers.copied().all(f64::is_finite) {
        return Err(MeasurementError::PoseNotFinite);
    }
    let is_usable = |error: &LastingError| {
        error.shift.iter().all(|number| number.is_finite())
            && error.time_constant_s.is_none_or(|s| s > 0.0)
    };
    if !lasting.iter().all(is_usable) {
        return Err(MeasurementError::InvalidLastingError);
    }
    let is_symmetric = noise.0 == noise.0.transpose();
    // All of the noise may last: then the frame has none of its own.
    let whole = lasting.iter().fold(noise.0, |sum, error| {
        sum + error.shift * error.shift.transpose()
    });
    let is_covariance = |m: &Matrix6<f64>| Factor::new(&rows(&symmetric(m))).is_some();
    let has_no_negative_variance = noise.0.diagonal().iter().all(|variance| *variance >= 0.0);
    if !(is_symmetric && has_no_negative_variance && is_covariance(&whole)) {
        return Err(MeasurementError::InvalidCovariance);
    }
    Ok(())
}
