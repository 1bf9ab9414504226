//! Keyword arguments as the node's parameters: the same names, ranges and words.

use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyString};
use tanker_pose::config::{self, Configuration, KEYS, ParameterValue, Parameters, TABLE};

use crate::errors::value_error;

/// Parameters that only a sequence of frames has a use for.
fn is_of_sequences(name: &str) -> bool {
    [
        KEYS.attitude.name(),
        KEYS.widen_by_sigma_factor.name(),
        KEYS.reported_attitude_sigma_deg.name(),
        KEYS.correlated_noise_share.name(),
        KEYS.correlated_noise_time_s.name(),
        KEYS.track.name(),
        KEYS.acceleration_density_mps2.name(),
        KEYS.angular_acceleration_density_dps2.name(),
        KEYS.manoeuvre_factor.name(),
        KEYS.initial_speed_sigma_mps.name(),
        KEYS.initial_rate_sigma_dps.name(),
        KEYS.gate_probability.name(),
        KEYS.max_gap_s.name(),
        KEYS.confirm_frames.name(),
    ]
    .contains(&name)
}

/// Parameters of an estimate.
fn is_of_estimates(name: &str) -> bool {
    [
        KEYS.pixel_sigma_px.name(),
        KEYS.edge_margin_px.name(),
        KEYS.min_points.name(),
        KEYS.max_outliers.name(),
        KEYS.initialisation.name(),
        KEYS.nominal_roll_deg.name(),
        KEYS.nominal_pitch_deg.name(),
        KEYS.nominal_yaw_deg.name(),
        KEYS.camera_mount_roll_deg.name(),
        KEYS.camera_mount_pitch_deg.name(),
        KEYS.camera_mount_yaw_deg.name(),
        KEYS.refinement.name(),
        KEYS.trust_probability.name(),
        KEYS.max_ambiguity.name(),
        KEYS.certify.name(),
        KEYS.require_certificate.name(),
        KEYS.nominal_attitude_sigma_deg.name(),
        KEYS.focal_length_sigma.name(),
        KEYS.principal_point_sigma_px.name(),
        KEYS.k1_sigma.name(),
        KEYS.k2_sigma.name(),
        KEYS.jitter_px.name(),
    ]
    .contains(&name)
}

/// What the keyword arguments are for.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Use {
    /// Frames on their own.
    Frames,
    /// Frames one after another, with a track.
    Sequences,
}

/// Returns the configuration that keyword arguments make of the node's defaults.
///
/// # Inputs
/// * `has_budget`: whether a budget of the calibration is given besides, in place of the file that the node reads.
///
/// # Errors
/// A `ValueError` with the words that the node has for the parameter.
pub fn configuration(
    given: Option<&Bound<'_, PyDict>>,
    of: Use,
    has_budget: bool,
) -> PyResult<Configuration> {
    let mut parameters = Parameters::new(TABLE);
    for (name, value) in given.into_iter().flatten() {
        let name: String = name.extract()?;
        let is_known = is_of_estimates(&name) || (of != Use::Frames && is_of_sequences(&name));
        if parameters.spec(&name).is_some() && !is_known {
            let hint = if is_of_sequences(&name) {
                "; Pipeline takes it"
            } else {
                ""
            };
            return Err(value_error(format!(
                "parameter {name:?} has no effect here{hint}"
            )));
        }
        parameters
            .set(&name, parameter(&value)?)
            .map_err(value_error)?;
    }
    if has_budget {
        let file = ParameterValue::String("budget".to_owned());
        parameters
            .set(KEYS.calibration_budget_file.name(), file)
            .map_err(value_error)?;
    }
    config::check_together(&parameters).map_err(value_error)?;
    Ok(Configuration::from(&parameters))
}

fn parameter(value: &Bound<'_, PyAny>) -> PyResult<ParameterValue> {
    // Python's bool is an int too.
    if value.is_instance_of::<PyBool>() {
        return Ok(ParameterValue::Bool(value.extract()?));
    }
    // Whole numbers of numpy too.
    if let Ok(number) = value.extract::<i64>() {
        return Ok(ParameterValue::Integer(number));
    }
    if value.is_instance_of::<PyString>() {
        return Ok(ParameterValue::String(value.extract()?));
    }
    Ok(ParameterValue::Double(value.extract()?))
}
