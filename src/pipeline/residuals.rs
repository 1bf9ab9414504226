//! How the detections of a frame lie about its best fit, to explain why it is not trusted.

use nalgebra::Vector2;

use crate::camera::Camera;
use crate::estimation::{Observation, Solution};

/// One detection against a fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MarkerResidual {
    /// Marker id.
    pub id: u32,
    /// Predicted minus seen pixel, px.
    pub residual_px: Vector2<f64>,
    /// Standard deviation that the fit took for the detection, px.
    pub sigma_px: f64,
}

/// Returns the residuals of observations about a fit, without those that the fit puts where the camera sees nothing.
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
