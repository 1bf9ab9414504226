//! The outcome of a frame: a trusted pose, or the reason for a refusal.

use super::residuals::{MarkerResidual, residuals};
use super::{FrameTrack, LeftOut, OutcomeCode, Refusal};
use crate::camera::Camera;
use crate::estimation::{
    Certificate, EstimateError, EstimatorSettings, FrameCauses, Initialisation, Observation,
    PriorAgreement, Solution,
};
use crate::integrity::{FrameIntegrity, FrameSeparations, Unavailable};

/// The outcome of one frame.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameOutcome {
    /// The trusted pose, or the reason for a refusal.
    pub result: Result<Solution, Refusal>,
    /// The solution that was refused because of its numbers; for the status, not for guidance.
    pub doubtful: Option<Solution>,
    /// Residuals of all detections at the best fit, trusted or not, including excluded ones; empty without a fit.
    pub residuals: Vec<MarkerResidual>,
    /// Ids of the markers used in the solution.
    pub used_ids: Vec<u32>,
    /// Ids of the markers not used: excluded as wrong, or at the edge of the image.
    pub rejected_ids: Vec<u32>,
    /// Those at the edge of the image, which the solver did not receive.
    pub left_out: LeftOut,
    /// The initialisation; `None` if no solve was attempted.
    pub initialisation: Option<Initialisation>,
    /// The effect of the frame on the track.
    pub track: FrameTrack,
    /// The effect of each cause of the error budget in this frame; `None` without a budget or a solution.
    pub causes: Option<FrameCauses>,
    /// Protection levels, or why there are none; `None` where none are wanted.
    pub integrity: Option<Result<FrameIntegrity, Unavailable>>,
    /// The same of the track, at the stamp of the frame.
    pub track_integrity: Option<Result<FrameIntegrity, Unavailable>>,
    /// What the track's levels need of the frame, until the track has it.
    pub(crate) separations: Option<Box<FrameSeparations>>,
    /// The factor by which the stated sigmas were multiplied; 1 if they were not.
    pub widened_by: f64,
}

impl FrameOutcome {
    /// Returns the outcome of a frame without a solution.
    #[must_use]
    pub fn refused(refusal: Refusal) -> Self {
        Self {
            result: Err(refusal),
            doubtful: None,
            residuals: Vec::new(),
            used_ids: Vec::new(),
            rejected_ids: Vec::new(),
            left_out: LeftOut::default(),
            initialisation: None,
            track: FrameTrack::default(),
            causes: None,
            integrity: None,
            track_integrity: None,
            separations: None,
            widened_by: 1.0,
        }
    }

    pub(super) fn judged(
        solution: Solution,
        camera: &Camera,
        observations: &[Observation],
        settings: &EstimatorSettings,
        is_reported: bool,
    ) -> Self {
        let (rejected_ids, used_ids) = observations
            .iter()
            .map(|o| o.id)
            .partition(|&id| solution.excluded.contains(id));
        let initialisation = Some(solution.initialisation);
        let residuals = residuals(&solution, camera, observations);
        let (result, doubtful) = match doubt(&solution, settings, is_reported) {
            Some(refusal) => (Err(refusal), Some(solution)),
            None => (Ok(solution), None),
        };
        Self {
            result,
            doubtful,
            residuals,
            used_ids,
            rejected_ids,
            left_out: LeftOut::default(),
            initialisation,
            track: FrameTrack::default(),
            causes: None,
            integrity: None,
            track_integrity: None,
            separations: None,
            widened_by: 1.0,
        }
    }

    /// Returns the outcome with its pose, if any, refused.
    pub(super) fn refused_for(mut self, refusal: Refusal) -> Self {
        if let Ok(solution) = self.result {
            self.doubtful = Some(solution);
            self.result = Err(refusal);
        }
        self
    }

    /// Returns the outcome with the detections that were left out before the solver.
    #[must_use]
    pub fn without(mut self, left_out: LeftOut) -> Self {
        self.rejected_ids.extend(&left_out.ids);
        self.left_out = left_out;
        self
    }

    /// Returns the message about the frame: the refusal, detections left out at the edge of the image, and widened
    /// sigmas; usually empty.
    #[must_use]
    pub fn message(&self) -> String {
        let refusal = self.result.as_ref().err().map(ToString::to_string);
        let left_out = (!self.left_out.ids.is_empty()).then(|| self.left_out.to_string());
        let widened = (self.widened_by > 1.0).then(|| {
            let factor = self.widened_by;
            format!("sigmas were multiplied by {factor:.2}, as residuals scatter (widen_by_sigma_factor)")
        });
        let parts = refusal.into_iter().chain(left_out).chain(widened);
        let parts: Vec<String> = parts.collect();
        parts.join("; ")
    }

    /// Returns the outcome's code.
    #[must_use]
    pub fn code(&self) -> OutcomeCode {
        self.result
            .as_ref()
            .err()
            .map_or(OutcomeCode::Ok, Refusal::code)
    }

    /// Returns whether stamp and `frame_id` belong to an image of a known, usable camera.
    #[must_use]
    pub fn header_fits(&self) -> bool {
        !self.result.as_ref().is_err_and(Refusal::is_of_header)
    }

    /// Returns the numbers of the best fit, trusted or not.
    #[must_use]
    pub fn solution(&self) -> Option<&Solution> {
        self.result.as_ref().ok().or(self.doubtful.as_ref())
    }
}

/// degrees; up to this the true error follows the covariance, beyond it the projection is too nonlinear.
const MAX_ATTITUDE_SIGMA_DEG: f64 = 10.0;

/// Returns why a solution is not trusted. Uses no heap.
pub(super) fn doubt(
    solution: &Solution,
    settings: &EstimatorSettings,
    is_reported: bool,
) -> Option<Refusal> {
    // The prior is to blame where the points agree without it.
    let is_to_blame = |prior: &PriorAgreement| {
        !prior.agrees() && solution.chi_squared - prior.chi_squared <= solution.chi_squared_limit
    };
    if let Some(prior) = solution.prior.filter(is_to_blame) {
        return Some(Refusal::ContradictsPrior {
            prior: if is_reported {
                "what both aircraft report"
            } else {
                "the nominal attitude"
            },
            turn_deg: prior.turn_rad.to_degrees(),
            chi_squared: prior.chi_squared,
            limit: prior.limit,
        });
    }
    if !solution.is_trusted() {
        return Some(Refusal::NotTrusted {
            chi_squared: solution.chi_squared,
            limit: solution.chi_squared_limit,
            degrees_of_freedom: solution.degrees_of_freedom,
            rms_px: solution.rms_px,
            unclear: solution.unclear,
        });
    }
    if !solution.covariance.is_valid() {
        let reason = "from this view they leave a direction of the pose free";
        return Some(EstimateError::Degenerate { reason }.into());
    }
    // Before the uncertainty, because a large covariance can be the consequence of a second pose near the first.
    let limit = settings.max_ambiguity;
    let has_rival = solution.ambiguity > 0.0 && solution.ambiguity >= limit;
    if has_rival && limit < 1.0 {
        return Some(Refusal::Ambiguous {
            ambiguity: solution.ambiguity,
            limit: settings.max_ambiguity,
        });
    }
    let is_proven = solution.certificate.is_some_and(Certificate::is_proven);
    if settings.require_certificate && !is_proven {
        return Some(Refusal::NotCertified);
    }
    // Almost every frame is far below the limit, and the bound takes no decomposition.
    if solution.covariance.attitude_sigma_bound().to_degrees() <= MAX_ATTITUDE_SIGMA_DEG {
        return None;
    }
    let sigma_deg = solution.covariance.largest_attitude_sigma().to_degrees();
    (sigma_deg > MAX_ATTITUDE_SIGMA_DEG).then_some(Refusal::TooUncertain {
        sigma_deg,
        limit_deg: MAX_ATTITUDE_SIGMA_DEG,
    })
}
