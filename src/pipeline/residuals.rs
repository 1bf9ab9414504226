//! Residuals of a frame's detections at its best fit, which explain why it is not trusted.

use nalgebra::Vector2;

use crate::camera::Camera;
use crate::estimation::{Observation, Solution};

/// The residual of one detection.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MarkerResidual {
    /// Marker id.
    pub id: u32,
    /// Predicted minus detected pixel, px.
    pub residual_px: Vector2<f64>,
    /// Standard deviation used in the fit, px.
    pub sigma_px: f64,
}

/// Returns the residuals of observations at a fit, without markers that have no pixel there.
pub(super) fn residuals(
    solution: &Solution,
    camera: &Camera,
    observations: &[Observation],
) -> Vec<MarkerResidual> {
    let residual = |seen: &Observation| {
        Some(MarkerResidual {
            id: seen.id,
            residual_px: solution.residual_px(camera, seen)?,
            sigma_px: seen.sigma_px,
        })
    };
    observations.iter().filter_map(residual).collect()
}
