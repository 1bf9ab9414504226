//! The points of a frame without some of them: do they still fix one pose?

use nalgebra::{Matrix3, Vector3};
use smallvec::SmallVec;

use super::frame::SolvedFrame;
use crate::estimation::Observation;

/// rad, 10°; beyond it the error does not follow the covariance.
const MOST_ATTITUDE_SIGMA: f64 = 10.0 * std::f64::consts::PI / 180.0;
/// Sigmas of the attitude without a beacon: farther, a pose without it is another one.
const MOST_TURN_SIGMAS: f64 = 10.0;
/// Thickness of a target over its length below which it counts as flat.
const FLAT: f64 = 0.02;

/// The points of a frame without some of them.
pub(super) struct Alone<'a>(pub(super) &'a SolvedFrame<'a>);

impl Alone<'_> {
    /// Returns the used points but those of these rows.
    fn without<'a>(&'a self, rows: &'a [usize]) -> impl Iterator<Item = &'a Observation> {
        let used = self.0.observations.iter();
        used.filter(|seen| !self.0.solution.excluded.contains(seen.id))
            .enumerate()
            .filter(|(at, _)| !rows.contains(&(2 * at)))
            .map(|(_, seen)| seen)
    }

    /// Returns whether the points without these rows have one pose, near the one in use: no second one that they
    /// allow, where a fault could have led, and an attitude that is known.
    pub(super) fn fix_one_pose(&self, rows: &[usize]) -> bool {
        let others: SmallVec<[Observation; 16]> = self.without(rows).copied().collect();
        let found = self.0.estimator.estimate_of_all(self.0.camera, &others);
        found.is_ok_and(|found| {
            let turn = found
                .camera_from_tanker
                .rotation
                .angle_to(&self.0.solution.camera_from_tanker.rotation);
            let sigma = found.covariance.largest_attitude_sigma();
            found.ambiguity <= 0.0 && sigma < MOST_ATTITUDE_SIGMA && turn < MOST_TURN_SIGMAS * sigma
        })
    }

    /// Returns whether the points without these rows lie near one plane, so that they allow two poses.
    pub(super) fn are_flat(&self, rows: &[usize]) -> bool {
        let (mut count, mut sum) = (0.0, Vector3::zeros());
        for seen in self.without(rows) {
            count += 1.0;
            sum += seen.marker_in_tanker.coords;
        }
        let mean = sum / count;
        let mut scatter = Matrix3::zeros();
        for seen in self.without(rows) {
            let arm = seen.marker_in_tanker.coords - mean;
            scatter += arm * arm.transpose();
        }
        let spread = scatter.symmetric_eigenvalues();
        let is_deep = spread.min() > FLAT * FLAT * spread.max();
        !is_deep
    }
}
