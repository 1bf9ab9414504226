//! Whether the attitudes that both aircraft report agree with what the camera sees.
//!
//! The camera measures the tanker's attitude in the receiver, and both aircraft report it too. Where the two differ, one
//! of the reports is wrong, and nothing tells which. Outputs in local axes are turned by the receiver's.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion};

use crate::config::ReportedAttitudeSettings;
use crate::estimation::Solution;
use crate::pipeline::{FrameOutcome, Refusal};

/// Chi-squared of three degrees of freedom that one turn in a hundred thousand exceeds.
const LIMIT: f64 = 25.9;

/// How the reports contradict what is seen.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub(crate) enum Contradiction {
    /// No tanker flies as both together report.
    #[error(
        "by both attitudes the tanker stands {off_deg:.1}° off its nominal attitude, allowed by max_attitude_deviation_deg is {limit_deg}°"
    )]
    Unlikely {
        /// deg.
        off_deg: f64,
        /// deg.
        limit_deg: f64,
    },
    /// The camera sees another attitude.
    #[error(
        "the camera shows the tanker {turn_deg:.1}° off what both aircraft report: chi-squared {chi_squared:.1}, limit {limit:.1}"
    )]
    Image {
        /// From what is reported to the estimate, deg.
        turn_deg: f64,
        /// Of that turn.
        chi_squared: f64,
        /// The largest to accept.
        limit: f64,
    },
}

/// The latest comparison. It stands until another is possible: a contradiction does not end by silence.
#[derive(Debug, Default)]
pub(super) struct Agreement {
    found: Option<Contradiction>,
}

impl Agreement {
    /// Returns how the reports contradict what is seen, if they did when they were compared last.
    pub(super) const fn contradiction(&self) -> Option<Contradiction> {
        self.found
    }

    /// Takes a contradiction.
    pub(super) const fn contradicted(&mut self, found: Contradiction) {
        self.found = Some(found);
    }

    /// Forgets it.
    pub(super) const fn forget(&mut self) {
        self.found = None;
    }

    /// Compares the outcome of a frame with the attitude that was its prior. A frame that is refused for another reason
    /// says nothing of either.
    pub(super) fn judge(
        &mut self,
        receiver_from_tanker: &Rotation3<f64>,
        settings: &ReportedAttitudeSettings,
        outcome: &FrameOutcome,
    ) {
        match &outcome.result {
            Ok(solution) => self.found = contradiction(receiver_from_tanker, settings, solution),
            Err(Refusal::ContradictsPrior {
                turn_deg,
                chi_squared,
                limit,
                ..
            }) => {
                self.found = Some(Contradiction::Image {
                    turn_deg: *turn_deg,
                    chi_squared: *chi_squared,
                    limit: *limit,
                });
            }
            Err(_) => {}
        }
    }
}

/// Returns how a trusted pose contradicts a reported attitude. Where the estimate has that as a prior, it was tested
/// already, and more sharply; without maximum likelihood it has not.
fn contradiction(
    receiver_from_tanker: &Rotation3<f64>,
    settings: &ReportedAttitudeSettings,
    solution: &Solution,
) -> Option<Contradiction> {
    let reported = settings.camera_from_receiver * receiver_from_tanker;
    let turn = solution.camera_from_tanker.rotation
        * UnitQuaternion::from_rotation_matrix(&reported).inverse();
    let turn = turn.scaled_axis();
    let of_estimate = solution.covariance.0.fixed_view::<3, 3>(3, 3).into_owned();
    let covariance = of_estimate + Matrix3::identity() * settings.sigma_rad.powi(2);
    // What cannot be compared does not agree.
    let chi_squared = covariance
        .cholesky()
        .map_or(f64::INFINITY, |root| turn.dot(&root.solve(&turn)));
    let agrees = chi_squared <= LIMIT;
    (!agrees).then_some(Contradiction::Image {
        turn_deg: turn.norm().to_degrees(),
        chi_squared,
        limit: LIMIT,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use statrs::distribution::{ChiSquared, ContinuousCDF};

    #[test]
    fn the_limit_is_the_quantile_that_its_words_state() {
        let three = ChiSquared::new(3.0).expect("degrees of freedom");
        assert!((three.inverse_cdf(1.0 - 1e-5) - LIMIT).abs() < 0.05);
    }
}
