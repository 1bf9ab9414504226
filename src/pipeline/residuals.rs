//! How the detections of a frame lie about its best fit, for whoever asks why it is not trusted.

use nalgebra::Vector2;

use super::{DetectionFrame, FrameOutcome, Pipeline};

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

impl Pipeline {
    /// Returns the residuals of a frame's detections about its best fit, trusted or not; none without a fit.
    #[must_use]
    pub fn residuals(&self, frame: &DetectionFrame, outcome: &FrameOutcome) -> Vec<MarkerResidual> {
        let (Some(solution), Ok((camera, observations, _))) =
            (outcome.solution(), self.observations(frame))
        else {
            return Vec::new();
        };
        observations
            .iter()
            .filter_map(|seen| {
                Some(MarkerResidual {
                    id: seen.id,
                    residual_px: solution.residual_px(camera, seen)?,
                    sigma_px: seen.sigma_px,
                })
            })
            .collect()
    }
}
