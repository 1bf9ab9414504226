//! From raw parameters to checked settings.
//!
//! `table` declares each parameter once; [`Parameters`] holds values that passed the checks of the table;
//! `configuration` converts them to the types of the layers below. Depends on `estimation` and `tracking`, and not on
//! files, topics or the source of a value.

mod attitude;
mod configuration;
mod consumers;
mod people;
mod settings;
mod table;
#[cfg(test)]
mod tests;
mod words;

pub use configuration::{Configuration, nominal_camera_from_tanker};
pub use consumers::{ConsumerConfiguration, OutputError};
pub use people::{parameter_file, parameter_tables};
pub use ros2_node::parameters::{
    Key, Kind, ParameterError, ParameterSpec, ParameterValue, Parameters, Words,
};
pub use settings::{CalibrationSigmas, ReportedAttitudeSettings, Settings};
pub use table::{KEYS, Keys, SECTIONS, TABLE};
pub use words::{Attitude, AttitudeSource, Input};

use crate::estimation::Refinement;
use table::Values;

/// Checks values against each other: each of them is allowed, but one output may need what another parameter switches
/// off.
///
/// # Errors
/// [`TogetherError`] names the parameters.
pub fn check_together(parameters: &Parameters) -> Result<(), TogetherError> {
    let values = Values::from(parameters);
    let said_twice = [
        (KEYS.focal_length_sigma.name(), values.focal_length_sigma),
        (
            KEYS.principal_point_sigma_px.name(),
            values.principal_point_sigma_px,
        ),
        (KEYS.k1_sigma.name(), values.k1_sigma),
        (KEYS.k2_sigma.name(), values.k2_sigma),
    ]
    .into_iter()
    .find(|(_, sigma)| *sigma > 0.0);
    if let (Some((sigma, _)), Some(_)) = (said_twice, &values.calibration_budget_file) {
        let file = KEYS.calibration_budget_file.name();
        return Err(TogetherError::TwoCalibrations { file, sigma });
    }
    let required = values.require_integrity.then_some(&KEYS.require_integrity);
    if let (Some(required), false) = (required, values.publish_integrity) {
        return Err(TogetherError::NoIntegrity {
            required: required.name(),
            missing: KEYS.publish_integrity.name(),
        });
    }
    let priors = [
        (
            &KEYS.nominal_attitude_sigma_deg,
            values.nominal_attitude_sigma_deg,
        ),
        (
            &KEYS.reported_attitude_sigma_deg,
            values.reported_attitude_sigma_deg,
        ),
    ];
    if let (true, Some((prior, _))) = (
        values.publish_integrity,
        priors.iter().find(|(_, sigma_deg)| *sigma_deg > 0.0),
    ) {
        return Err(TogetherError::UnmonitoredPrior {
            output: KEYS.publish_integrity.name(),
            prior: prior.name(),
        });
    }
    if values.publish_integrity && values.refinement != Refinement::MaximumLikelihood {
        return Err(TogetherError::NotMaximumLikelihood {
            output: KEYS.publish_integrity.name(),
            refinement: KEYS.refinement.name(),
        });
    }
    if values.reported_attitude_sigma_deg > 0.0 && values.attitude.0.is_none() {
        return Err(TogetherError::NoReceiverAttitude {
            sigma: KEYS.reported_attitude_sigma_deg.name(),
            needs: KEYS.attitude.name(),
        });
    }
    Ok(ConsumerConfiguration::from(&values).check()?)
}

/// Why values that are allowed individually are not allowed together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum TogetherError {
    /// An output lacks something that it needs.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// Both a file and a parameter state the calibration's errors.
    #[error("{file} and {sigma} both state errors of the calibration: set only one of them")]
    TwoCalibrations {
        /// The parameter that names the file.
        file: &'static str,
        /// A standard deviation above 0.
        sigma: &'static str,
    },
    /// Outputs depend on protection levels that are not computed.
    #[error("{required} needs {missing}")]
    NoIntegrity {
        /// The parameter that asks for them.
        required: &'static str,
        /// The parameter that switches them on.
        missing: &'static str,
    },
    /// Protection levels need an estimate whose errors are known.
    #[error("{output} needs {refinement} maximum_likelihood")]
    NotMaximumLikelihood {
        /// The parameter that switches them on.
        output: &'static str,
        /// The parameter that chooses the estimate.
        refinement: &'static str,
    },
    /// Only one of two attitudes is given.
    #[error(
        "{sigma} above 0 needs the parameter {needs:?}, which is \"none\": the receiver's attitude"
    )]
    NoReceiverAttitude {
        /// A standard deviation above 0.
        sigma: &'static str,
        /// The parameter that is missing.
        needs: &'static str,
    },
    /// A prior of the attitude that nothing monitors.
    #[error("{output} does not go with {prior}: nothing monitors whether the tanker keeps to it")]
    UnmonitoredPrior {
        /// The parameter that switches protection levels on.
        output: &'static str,
        /// The parameter that states the prior.
        prior: &'static str,
    },
}
