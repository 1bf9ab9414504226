//! `tanker_pose/EstimatorStatus` and its constants.

use serde::{Deserialize, Serialize};

use super::{Duration, Header};

/// `tanker_pose/EstimatorStatus`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct EstimatorStatus {
    /// That of the feature points, bit for bit.
    pub header: Header,
    /// An [`OutcomeCode`](crate::pipeline::OutcomeCode) as its number.
    pub outcome: u8,
    /// What was expected and what came; empty when all is well.
    pub message: String,
    /// Marker ids that the pose rests on.
    pub used_ids: Vec<u32>,
    /// Marker ids excluded as wrong.
    pub rejected_ids: Vec<u32>,
    /// Root mean square residual, px; NaN without a solution.
    pub rms_residual: f64,
    /// Sum of squared residuals over their variances; NaN without a solution.
    pub chi_squared: f64,
    /// Degrees of freedom of `chi_squared`.
    pub degrees_of_freedom: u16,
    /// Iterations of all solver stages.
    pub iterations: u16,
    /// One of the `INITIALISATION` constants of this type.
    pub initialisation: u8,
    /// Likelihood of the second-best pose over that of the best; NaN without a solution.
    pub ambiguity: f64,
    /// From the message in hand to the outcome.
    pub solve_time: Duration,
    /// A [`TrackCode`](crate::pipeline::TrackCode) as its number.
    pub track: u8,
    /// Modes of the error budget; empty without a budget or a solution.
    pub mode_names: Vec<String>,
    /// Estimated amplitude of each mode, in its sigmas.
    pub mode_amplitudes: Vec<f64>,
    /// The cause with the largest share of the position's variance; empty as above.
    pub dominant_cause: String,
    /// One of the `CERTIFICATE` constants of this type.
    pub certificate: u8,
}

impl EstimatorStatus {
    /// No solve was attempted.
    pub const INITIALISATION_NONE: u8 = 0;
    /// The nominal attitude.
    pub const INITIALISATION_NOMINAL: u8 = 1;
    /// Linear camera matrix.
    pub const INITIALISATION_DLT: u8 = 2;
    /// The last trusted pose.
    pub const INITIALISATION_PREVIOUS: u8 = 3;
    /// Search over all attitudes.
    pub const INITIALISATION_GLOBAL: u8 = 4;

    /// No proof was asked for, or there is no solution.
    pub const CERTIFICATE_NONE: u8 = 0;
    /// No pose in front of the camera has a lower cost.
    pub const CERTIFICATE_CERTIFIED: u8 = 1;
    /// Not proven.
    pub const CERTIFICATE_NOT_CERTIFIED: u8 = 2;
    /// Proven for a better pose than that of the start.
    pub const CERTIFICATE_REPLACED: u8 = 3;
}

#[cfg(test)]
mod tests {
    use super::*;

    const STATUS_MSG: &str = include_str!("../../msg/EstimatorStatus.msg");

    /// Constants of the `.msg` file as (name, value).
    fn constants() -> Vec<(String, u8)> {
        let declaration = |line: &str| {
            let code = line.split('#').next()?;
            let (name, value) = code.strip_prefix("uint8 ")?.split_once('=')?;
            Some((name.trim().to_owned(), value.trim().parse().ok()?))
        };
        STATUS_MSG.lines().filter_map(declaration).collect()
    }

    fn numbers(prefix: &str) -> Vec<u8> {
        constants()
            .into_iter()
            .filter(|(name, _)| name.starts_with(prefix))
            .map(|(_, value)| value)
            .collect()
    }

    #[test]
    fn certificates_are_the_constants_of_the_msg_file() {
        let here = [
            EstimatorStatus::CERTIFICATE_NONE,
            EstimatorStatus::CERTIFICATE_CERTIFIED,
            EstimatorStatus::CERTIFICATE_NOT_CERTIFIED,
            EstimatorStatus::CERTIFICATE_REPLACED,
        ];
        assert_eq!(numbers("CERTIFICATE"), here);
    }

    #[test]
    fn initialisations_are_the_constants_of_the_msg_file() {
        let here = [
            EstimatorStatus::INITIALISATION_NONE,
            EstimatorStatus::INITIALISATION_NOMINAL,
            EstimatorStatus::INITIALISATION_DLT,
            EstimatorStatus::INITIALISATION_PREVIOUS,
            EstimatorStatus::INITIALISATION_GLOBAL,
        ];
        assert_eq!(numbers("INITIALISATION"), here);
    }
}
