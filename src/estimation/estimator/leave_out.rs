//! The search for wrong detections: what the estimator knows of priors, and the points under suspicion.

use nalgebra::{Isometry3, Rotation3};
use smallvec::SmallVec;

use super::{Estimator, PRIOR_SIGMA, squared_turn};
use crate::camera::Camera;
use crate::estimation::exclude::{self, Found, Suspects};
use crate::estimation::lanes::points::INLINE_POINTS;
use crate::estimation::problem::{Problem, Room};
use crate::estimation::{Expected, Initialisation, Observation, Refinement, Solution};

/// rad; a subset whose pose is turned farther from its prior than this fits noise.
pub(super) const MAX_TURN_FROM_PRIOR: f64 = 20.0 * std::f64::consts::PI / 180.0;

impl Estimator {
    /// Searches for the smallest set of points whose exclusion makes the rest pass the test.
    #[cold]
    pub(super) fn leave_out(
        &self,
        camera: &Camera,
        observations: &[Observation],
        expected: &Expected,
        of_all: Option<&Solution>,
    ) -> Found {
        let suspects = self.suspects(camera, observations, of_all, expected);
        let judge = exclude::Judge {
            solve: |points: &[Observation]| {
                self.check_count(points)?;
                self.estimate_with_all(camera, points, expected)
            },
            prior_cost: |solution: &Solution| self.prior_cost(solution, expected),
            min_remaining: match self.settings.initialisation {
                Initialisation::Nominal | Initialisation::Previous => {
                    exclude::MIN_REMAINING_WITH_PRIOR
                }
                Initialisation::Dlt | Initialisation::Global => {
                    exclude::MIN_REMAINING_WITHOUT_PRIOR
                }
            },
            // The last attitude may be wrong; the nominal one is stated by the user.
            is_prior_sure: self.settings.initialisation != Initialisation::Previous,
        };
        exclude::search(&judge, observations, &suspects, self.settings.max_outliers)
    }

    /// Returns the cost of the prior for a hypothesis about wrong points: infinite beyond [`MAX_TURN_FROM_PRIOR`], 0
    /// for initialisations without a prior.
    fn prior_cost(&self, solution: &Solution, expected: &Expected) -> f64 {
        let prior = match solution.initialisation {
            Initialisation::Nominal => Some(self.likely_rotation(expected)),
            Initialisation::Previous => expected.previous,
            Initialisation::Dlt | Initialisation::Global => None,
        };
        let cost = squared_turn(
            &solution.camera_from_tanker.rotation.to_rotation_matrix(),
            prior,
        );
        if cost > (MAX_TURN_FROM_PRIOR / PRIOR_SIGMA).powi(2) {
            f64::INFINITY
        } else {
            cost
        }
    }

    /// Indices of the points that may be excluded: all if they are few, otherwise those that fit worst. Without a
    /// solution the fit is judged at the expected attitude, at the position that suits the points best.
    fn suspects(
        &self,
        camera: &Camera,
        observations: &[Observation],
        of_all: Option<&Solution>,
        expected: &Expected,
    ) -> Suspects {
        let most = exclude::max_suspects(observations.len());
        let count = observations.len();
        let pose = of_all
            .map(|solution| solution.camera_from_tanker)
            .or_else(|| {
                let likely = expected.previous.unwrap_or(self.likely_rotation(expected));
                (count > most).then(|| expected_pose(camera, observations, likely))?
            });
        let mut all: SmallVec<[(f64, usize); INLINE_POINTS]> = observations
            .iter()
            .enumerate()
            .map(|(index, seen)| {
                let residual = pose.and_then(|pose| seen.residual_px(camera, &pose));
                (
                    residual.map_or(f64::INFINITY, |r| r.norm() / seen.sigma_px),
                    index,
                )
            })
            .collect();
        all.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        all.truncate(most);
        let mut suspects: Suspects = all.into_iter().map(|(_, index)| index).collect();
        suspects.sort_unstable();
        suspects
    }
}

/// Returns the pose with a given attitude that fits the points best; `None` if their rays do not determine a position.
fn expected_pose(
    camera: &Camera,
    observations: &[Observation],
    attitude: &Rotation3<f64>,
) -> Option<Isometry3<f64>> {
    let mut room = Room::new();
    let refinement = Refinement::MaximumLikelihood;
    let problem = Problem::new(camera, refinement, observations, &mut room).ok()?;
    Some(problem.pose(&problem.placed(attitude)))
}
