//! The one call that turns observations into a judged pose.

use nalgebra::{Point3, Rotation3, UnitQuaternion};
use smallvec::SmallVec;

use super::ambiguity::{self, NEGLIGIBLE, is_same, likelihood_ratio};
use super::exclude::{self, Suspects};
use super::initialise::{self, linear_rotation};
use super::points::INLINE_POINTS;
use super::problem::{Problem, Room};
use super::refine::Fit;
use super::trust::TrustLimits;
use super::widen::widened;
use super::{EstimateError, EstimatorSettings, Excluded, Initialisation, Observation, Solution};
use crate::camera::{Camera, Ray};
use crate::geometry::PoseCovariance;

/// rad; a subset that has turned farther from its prior has found a way to fit noise, not the tanker.
const MAX_TURN_FROM_PRIOR: f64 = 20.0 * std::f64::consts::PI / 180.0;

/// Ratio of sigmas beyond which a point does not check the better ones.
const WEAK_SIGMA_RATIO: f64 = 5.0;
/// rad; spread of the attitude about its prior: refuelling keeps the relative angles within ±5°.
const PRIOR_SIGMA: f64 = 5.0 * std::f64::consts::PI / 180.0;

/// Settings with what can be computed once: the limits of the chi-squared test.
#[derive(Debug, Clone, PartialEq)]
pub struct Estimator {
    settings: EstimatorSettings,
    limits: TrustLimits,
}

/// A fit with what is known about its rivals.
struct Judged<'a> {
    fit: &'a Fit,
    ambiguity: f64,
    iterations: u16,
    initialisation: Initialisation,
}

impl Estimator {
    /// Returns an estimator with these settings.
    #[must_use]
    pub fn new(settings: EstimatorSettings) -> Self {
        let limits = TrustLimits::new(settings.trust_probability);
        Self { settings, limits }
    }

    /// Returns the settings in force.
    #[must_use]
    pub fn settings(&self) -> &EstimatorSettings {
        &self.settings
    }

    /// Returns the pose that explains the observations best, with its covariance and the numbers to
    /// judge it by; whether to trust it is [`Solution::is_trusted`] and `ambiguity`.
    ///
    /// When all points together cannot be trusted and `max_outliers` allows it, the pose is that of
    /// the fewest exclusions that can; [`Solution::excluded`] names the points left out.
    ///
    /// # Inputs
    /// * `observations`: each marker once, in any order, finite, sigmas above zero.
    /// * `previous`: the last trusted rotation of `camera_from_tanker`, used by
    ///   [`Initialisation::Previous`] only.
    ///
    /// # Errors
    /// Any [`EstimateError`]: too few points, points that fix no pose, a pixel without a ray, no
    /// minimum, a marker behind the camera.
    pub fn estimate(
        &self,
        camera: &Camera,
        observations: &[Observation],
        previous: Option<&Rotation3<f64>>,
    ) -> Result<Solution, EstimateError> {
        let solver = |points: &[Observation]| self.estimate_with_all(camera, points, previous);
        let of_all = solver(observations);
        let max_outliers = self.settings.max_outliers;
        if max_outliers == 0 || of_all.as_ref().is_ok_and(Solution::is_trusted) {
            return of_all;
        }
        let suspects = suspects(camera, observations, of_all.as_ref().ok());
        let judge = exclude::Judge {
            solve: solver,
            prior_cost: |solution: &Solution| self.prior_cost(solution, previous),
            min_remaining: match self.settings.initialisation {
                Initialisation::Nominal | Initialisation::Previous => {
                    exclude::MIN_REMAINING_WITH_PRIOR
                }
                Initialisation::Dlt | Initialisation::Global => {
                    exclude::MIN_REMAINING_WITHOUT_PRIOR
                }
            },
        };
        exclude::search(&judge, observations, &suspects, max_outliers).map_or(of_all, Ok)
    }

    /// Returns the pose of all these points, or the reason for none.
    fn estimate_with_all(
        &self,
        camera: &Camera,
        observations: &[Observation],
        previous: Option<&Rotation3<f64>>,
    ) -> Result<Solution, EstimateError> {
        let start = self.settings.initialisation;
        let need = self.settings.min_points.max(start.min_points());
        if observations.len() < need {
            return Err(EstimateError::TooFewPoints {
                got: observations.len(),
                need,
            });
        }
        let precise = count_checking(observations);
        if precise < self.settings.min_points {
            return Err(EstimateError::TooFewPrecisePoints {
                precise,
                got: observations.len(),
                need: self.settings.min_points,
            });
        }
        let mut room = Room::new();
        let problem = Problem::new(camera, self.settings.refinement, observations, &mut room)?;
        let nominal = || {
            let seed = &self.settings.nominal_camera_from_tanker;
            self.solve_from(&problem, seed, Initialisation::Nominal)
        };
        match (start, previous) {
            (Initialisation::Previous, Some(seed)) => {
                match self.solve_from(&problem, seed, start) {
                    Ok(solution) if solution.is_trusted() => Ok(solution),
                    // A tanker that turned meanwhile, or a last pose that was wrong: begin anew.
                    _ => nominal(),
                }
            }
            (Initialisation::Nominal | Initialisation::Previous, _) => nominal(),
            (Initialisation::Dlt, _) => {
                let seed = dlt_seed(camera, observations)?;
                self.solve_from(&problem, &seed, start)
            }
            (Initialisation::Global, _) => self.solve_globally(&problem),
        }
    }

    /// Returns what the prior holds against a hypothesis about wrong points; infinite beyond
    /// [`MAX_TURN_FROM_PRIOR`], nothing for starts that have no prior.
    fn prior_cost(&self, solution: &Solution, previous: Option<&Rotation3<f64>>) -> f64 {
        let prior = match solution.initialisation {
            Initialisation::Nominal => Some(&self.settings.nominal_camera_from_tanker),
            Initialisation::Previous => previous,
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

    fn solve_from(
        &self,
        problem: &Problem,
        seed: &Rotation3<f64>,
        initialisation: Initialisation,
    ) -> Result<Solution, EstimateError> {
        let minimum = problem.descend(seed)?;
        let fit = problem.fit(&minimum.rotation)?;
        // The last attitude says nothing against a rival: it may have been the wrong one of the two.
        let prior = (initialisation == Initialisation::Nominal).then_some(seed);
        let cost = |fit: &Fit| fit.chi_squared + squared_turn(&fit.pose.rotation, prior);
        let rival = ambiguity::rival(problem, &fit);
        let (best, other) = match &rival {
            Some(rival) if cost(rival) < cost(&fit) => (rival, Some(&fit)),
            rival => (&fit, rival.as_ref()),
        };
        let judged = Judged {
            fit: best,
            // The prior chooses, but does not make the choice look surer than the image does.
            ambiguity: other.map_or(0.0, |other| {
                likelihood_ratio(other.chi_squared, best.chi_squared)
            }),
            iterations: minimum.iterations.saturating_add(fit.iterations),
            initialisation,
        };
        Ok(self.judge(problem, &judged))
    }

    /// The best of all minima in front of the camera, and the second best as its rival.
    fn solve_globally(&self, problem: &Problem) -> Result<Solution, EstimateError> {
        let minima = initialise::search(problem.cost, problem.step_tolerance());
        let mut iterations = minima.iterations;
        let mut ranking = Ranking::default();
        // With every minimum behind the camera, that is the reason.
        let mut failure = minima
            .behind
            .and_then(|minimum| problem.fit(&minimum.rotation).err())
            .unwrap_or(EstimateError::NoConvergence { iterations });
        for minimum in minima.in_front.iter().flatten() {
            let best = ranking.best.map(|(fit, _)| fit.chi_squared);
            let least = problem.least_chi_squared(minimum);
            if matches!((best, least), (Some(best), Some(least)) if least > best + NEGLIGIBLE) {
                continue;
            }
            match problem.fit(&minimum.rotation) {
                Ok(fit) => {
                    iterations = iterations.saturating_add(fit.iterations);
                    ranking.consider(&fit, problem.merit(&fit));
                }
                Err(error) => failure = error,
            }
        }
        let (fit, _) = ranking.best.ok_or(failure)?;
        if let Some(rival) = ambiguity::rival(problem, &fit) {
            ranking.consider(&rival, problem.merit(&rival));
        }
        let (fit, _) = ranking.best.unwrap_or((fit, 0.0));
        let judged = Judged {
            fit: &fit,
            ambiguity: ranking.rival.map_or(0.0, |(rival, _)| {
                likelihood_ratio(rival.chi_squared, fit.chi_squared)
            }),
            iterations,
            initialisation: Initialisation::Global,
        };
        Ok(self.judge(problem, &judged))
    }

    #[inline(always)]
    fn judge(&self, problem: &Problem, judged: &Judged) -> Solution {
        let fit = judged.fit;
        let residuals = 2 * problem.observations.len();
        let lever = fit.pose.rotation * problem.points.mean.coords;
        Solution {
            camera_from_tanker: problem.pose(fit),
            covariance: PoseCovariance::from_point(&widened(problem, fit), &lever),
            rms_px: (fit.squared_residuals_px / residuals as f64).sqrt(),
            chi_squared: fit.chi_squared,
            degrees_of_freedom: u16::try_from(residuals - 6).unwrap_or(u16::MAX),
            chi_squared_limit: self.limits.limit(residuals - 6),
            iterations: judged.iterations,
            initialisation: judged.initialisation,
            ambiguity: judged.ambiguity,
            excluded: Excluded::default(),
        }
    }
}

/// Returns the squared turn from a prior attitude in units of [`PRIOR_SIGMA`]; 0 without a prior.
fn squared_turn(found: &Rotation3<f64>, prior: Option<&Rotation3<f64>>) -> f64 {
    prior.map_or(0.0, |prior| {
        let turn = UnitQuaternion::from_rotation_matrix(&(found * prior.inverse())).angle();
        (turn / PRIOR_SIGMA).powi(2)
    })
}

/// Returns how many points are precise enough to check others: those whose sigma is at most
/// [`WEAK_SIGMA_RATIO`] times that of the third best. Any three fix a pose; what is much weaker than
/// they are could not contradict them, so it gives no redundancy.
fn count_checking(observations: &[Observation]) -> usize {
    // Nearly always all sigmas are alike.
    let (mut least, mut largest) = ([f64::INFINITY; 4], [0.0_f64; 4]);
    let (fours, rest) = observations.as_chunks::<4>();
    let mut look = |lane: usize, seen: &Observation| {
        least[lane] = least[lane].min(seen.sigma_px);
        largest[lane] = largest[lane].max(seen.sigma_px);
    };
    // Four limits in turn, so that none waits for the one before it.
    for four in fours {
        for lane in 0..4 {
            look(lane, &four[lane]);
        }
    }
    for seen in rest {
        look(0, seen);
    }
    let least = least.into_iter().fold(f64::INFINITY, f64::min);
    if largest
        .iter()
        .all(|sigma| *sigma <= WEAK_SIGMA_RATIO * least)
    {
        return observations.len();
    }
    let mut best = [f64::INFINITY; 3];
    for seen in observations {
        if let Some(place) = best.iter().position(|sigma| seen.sigma_px < *sigma) {
            best[place..].rotate_right(1);
            best[place] = seen.sigma_px;
        }
    }
    observations
        .iter()
        .filter(|seen| seen.sigma_px <= WEAK_SIGMA_RATIO * best[2])
        .count()
}

/// Indices of the points that may be left out: all of a few, of many those that fit worst.
fn suspects(camera: &Camera, observations: &[Observation], of_all: Option<&Solution>) -> Suspects {
    let mut all: SmallVec<[(f64, usize); INLINE_POINTS]> = observations
        .iter()
        .enumerate()
        .map(|(index, seen)| {
            let residual = of_all.and_then(|solution| solution.residual_px(camera, seen));
            (
                residual.map_or(f64::INFINITY, |r| r.norm() / seen.sigma_px),
                index,
            )
        })
        .collect();
    all.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    all.truncate(exclude::max_suspects(observations.len()));
    let mut suspects: Suspects = all.into_iter().map(|(_, index)| index).collect();
    suspects.sort_unstable();
    suspects
}

fn dlt_seed(
    camera: &Camera,
    observations: &[Observation],
) -> Result<Rotation3<f64>, EstimateError> {
    let rays = observations
        .iter()
        .map(|o| {
            camera
                .ray_from_pixel(o.pixel)
                .map_err(|cause| EstimateError::NoRay { id: o.id, cause })
        })
        .collect::<Result<SmallVec<[Ray; INLINE_POINTS]>, _>>()?;
    let markers: SmallVec<[Point3<f64>; INLINE_POINTS]> =
        observations.iter().map(|o| o.marker_in_tanker).collect();
    linear_rotation(&rays, &markers)
}

/// The best two of different poses, with their merits.
#[derive(Default)]
struct Ranking {
    best: Option<(Fit, f64)>,
    rival: Option<(Fit, f64)>,
}

impl Ranking {
    fn consider(&mut self, fit: &Fit, merit: f64) {
        match &self.best {
            Some((known, _)) if is_same(&known.pose.rotation, &fit.pose.rotation) => {}
            Some((_, best)) if *best <= merit => {
                if self.rival.as_ref().is_none_or(|(_, rival)| merit < *rival) {
                    self.rival = Some((*fit, merit));
                }
            }
            _ => {
                self.rival = self.best.take();
                self.best = Some((*fit, merit));
            }
        }
    }
}
