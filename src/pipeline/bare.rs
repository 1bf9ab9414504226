//! A frame on its own by its code alone: the same verdict as [`super::solve`] gives, without words, and without the heap.

use nalgebra::{Point3, Rotation3};

use super::checks::{Fault, check_detection, first_duplicate};
use super::outcome::doubt;
use super::{Detection, ImageEdges, OutcomeCode, Refusal};
use crate::camera::Camera;
use crate::estimation::{Estimator, Observation, Solution};

/// What a frame is checked and solved with.
pub struct Bare<'a> {
    /// Estimator with its error budget.
    pub estimator: &'a Estimator,
    /// The camera that took the image.
    pub camera: &'a Camera,
    /// Where its image ends.
    pub edges: &'a ImageEdges,
    /// Detections closer than this to an edge are left out, px.
    pub edge_margin_px: f64,
    /// Standard deviation of detections that do not state one, px.
    pub pixel_sigma_px: f64,
}

impl Bare<'_> {
    /// Returns the outcome of one frame, and the numbers of its best fit, trusted or not.
    ///
    /// No heap is used up to [`super::MOST_INLINE_DETECTIONS`] detections, if `room` has space for them: it holds the observations
    /// that were used afterwards.
    ///
    /// # Inputs
    /// * `previous`: the last trusted rotation of `camera_from_tanker`, as in [`Estimator::estimate`].
    pub fn solve(
        &self,
        detections: &[Detection],
        marker_in_tanker: impl Fn(u32) -> Option<Point3<f64>>,
        previous: Option<&Rotation3<f64>>,
        room: &mut Vec<Observation>,
    ) -> (OutcomeCode, Option<Solution>) {
        room.clear();
        for seen in detections {
            match check_detection(self.camera, seen, self.pixel_sigma_px, &marker_in_tanker) {
                Ok(observation) => room.push(observation),
                Err(fault) => return (code_of(fault), None),
            }
        }
        if first_duplicate(detections).is_some() {
            return (OutcomeCode::DuplicateId, None);
        }
        room.retain(|seen| self.edges.is_clear(seen.pixel, self.edge_margin_px));
        match self.estimator.estimate(self.camera, room, previous) {
            Ok(solution) => {
                let refusal = doubt(&solution, self.estimator.settings(), false);
                let code = refusal.map_or(OutcomeCode::Ok, |refusal| refusal.code());
                (code, Some(solution))
            }
            Err(error) => (Refusal::Estimate(error).code(), None),
        }
    }
}

const fn code_of(fault: Fault) -> OutcomeCode {
    match fault {
        Fault::NotFinite => OutcomeCode::NotFinite,
        Fault::Sigma => OutcomeCode::InvalidSigma,
        Fault::UnknownId => OutcomeCode::UnknownId,
        Fault::OutsideImage => OutcomeCode::OutsideImage,
    }
}
