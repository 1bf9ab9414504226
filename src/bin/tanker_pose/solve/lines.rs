//! The lines that `solve` writes.

use std::collections::BTreeMap;

use serde::Serialize;
use tanker_pose::estimation::{Cause, FrameCauses, Solution};
use tanker_pose::pipeline::FrameOutcome;

use super::levels::{Levels, OutputLevels};

/// Outcome of a line that is not a frame.
const MALFORMED: &str = "malformed";

#[derive(Debug, Serialize)]
pub struct OutputFrame {
    id: serde_json::Value,
    outcome: String,
    message: String,
    #[serde(flatten)]
    pose: Option<OutputPose>,
    used_ids: Vec<u32>,
    rejected_ids: Vec<u32>,
    #[serde(flatten)]
    numbers: Option<OutputNumbers>,
    #[serde(flatten)]
    causes: Option<OutputCauses>,
    #[serde(skip_serializing_if = "Option::is_none")]
    integrity: Option<OutputLevels>,
}

/// Effects of the error budget's causes; only with a budget.
#[derive(Debug, Serialize)]
pub struct OutputCauses {
    /// Estimated amplitude of each mode, in its sigmas.
    modes: BTreeMap<String, f64>,
    /// The cause with the largest share of the position's variance.
    dominant_cause: Option<String>,
}

/// Only for trusted frames: a doubtful pose is not printed.
#[derive(Debug, Serialize)]
pub struct OutputPose {
    rotation: Vec<f64>,
    translation: Vec<f64>,
    covariance: Vec<f64>,
}

#[derive(Debug, Serialize)]
pub struct OutputNumbers {
    rms_px: f64,
    chi_squared: f64,
    degrees_of_freedom: u16,
    ambiguity: f64,
    iterations: u16,
    #[serde(flatten)]
    certificate: Option<OutputCertificate>,
}

/// Only where a proof was asked for.
#[derive(Debug, Serialize)]
pub struct OutputCertificate {
    certificate: &'static str,
    /// Chi-squared of the second-best pose less that of this one; null where there is none that counts.
    runner_up_gap: Option<f64>,
}

impl OutputFrame {
    pub fn malformed(id: serde_json::Value, message: String) -> Self {
        Self {
            id,
            outcome: MALFORMED.to_owned(),
            message,
            pose: None,
            used_ids: Vec::new(),
            rejected_ids: Vec::new(),
            numbers: None,
            causes: None,
            integrity: None,
        }
    }

    pub fn new(id: serde_json::Value, outcome: FrameOutcome, levels: Option<Levels>) -> Self {
        let integrity = levels.zip(outcome.integrity.as_ref());
        Self {
            id,
            outcome: outcome.code().name().to_ascii_lowercase(),
            message: outcome.message(),
            pose: outcome.result.as_ref().ok().map(OutputPose::new),
            numbers: outcome.solution().map(OutputNumbers::new),
            causes: outcome.causes.as_ref().map(OutputCauses::new),
            integrity: integrity.map(|(levels, found)| levels.output(found)),
            used_ids: outcome.used_ids,
            rejected_ids: outcome.rejected_ids,
        }
    }
}

impl OutputCauses {
    fn new(causes: &FrameCauses) -> Self {
        let amplitude = |cause: &Cause| Some((cause.name.clone(), cause.amplitude_sigmas?));
        Self {
            modes: causes.causes.iter().filter_map(amplitude).collect(),
            dominant_cause: causes.dominant().map(|cause| cause.name.clone()),
        }
    }
}

impl OutputPose {
    pub fn new(solution: &Solution) -> Self {
        let pose = &solution.camera_from_tanker;
        let rotation = pose.rotation.to_rotation_matrix();
        Self {
            // nalgebra stores columns; the transpose's columns are the rows.
            rotation: rotation.matrix().transpose().as_slice().to_vec(),
            translation: pose.translation.vector.as_slice().to_vec(),
            covariance: solution.covariance.row_major().to_vec(),
        }
    }
}

impl OutputNumbers {
    pub fn new(solution: &Solution) -> Self {
        Self {
            rms_px: solution.rms_px,
            chi_squared: solution.chi_squared,
            degrees_of_freedom: solution.degrees_of_freedom,
            ambiguity: solution.ambiguity,
            iterations: solution.iterations,
            certificate: solution.certificate.map(|certificate| OutputCertificate {
                certificate: certificate.name(),
                runner_up_gap: solution.runner_up_gap(),
            }),
        }
    }
}
