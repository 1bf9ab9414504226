//! The estimator: from observations to a pose with the numbers to judge it by.

mod certify;
mod leave_out;

use nalgebra::{Point3, Rotation3, UnitQuaternion};
use smallvec::SmallVec;

use super::ambiguity::{self, is_same, likelihood_ratio};
use super::budget::{
    self, AttitudePrior, CauseKind, ErrorBudget, FrameBudget, FrameCauses, LinearFrame,
};
use super::exclude::Found;
use super::initialise::{self, linear_rotation};
use super::lanes::points::{INLINE_POINTS, mean};
use super::prior_agreement::prior_agreement;
use super::problem::{NEGLIGIBLE, Problem, Room};
use super::redundancy::{count_checking, with_sigma_floor};
use super::refine::Fit;
use super::trust::TrustLimits;
use super::widen::honest_covariance;
use super::{
    EstimateError, EstimatorSettings, Excluded, Expected, Initialisation, Observation, Refinement,
    Solution,
};
use crate::camera::{Camera, Ray};

/// rad; standard deviation of the attitude about its prior: refuelling keeps the relative angles within ±5°.
pub(crate) const PRIOR_SIGMA: f64 = 5.0 * std::f64::consts::PI / 180.0;

/// Settings with precomputed limits of the chi-squared test.
#[derive(Debug, Clone, PartialEq)]
pub struct Estimator {
    settings: EstimatorSettings,
    limits: TrustLimits,
    /// `None` without any stated errors.
    budget: Option<ErrorBudget>,
}

/// A fit with its rivals.
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
        Self {
            settings,
            limits,
            budget: None,
        }
    }

    /// Returns the estimator with a budget of the errors of map, calibration and airframe. An empty budget changes
    /// nothing.
    #[must_use]
    pub fn with_budget(self, budget: ErrorBudget) -> Self {
        Self {
            budget: (!budget.is_empty() || budget.correlated_noise().is_some()).then_some(budget),
            ..self
        }
    }

    /// Returns the error budget, if any.
    #[must_use]
    pub fn budget(&self) -> Option<&ErrorBudget> {
        self.budget.as_ref()
    }

    /// Returns whether errors beside the noise of detections are stated for every frame: a budget, or a prior about the
    /// nominal attitude.
    #[must_use]
    pub fn has_causes(&self) -> bool {
        self.budget.is_some() || self.settings.attitude_sigma_rad.is_some()
    }

    /// Returns whether another estimator has the same causes of error, so that errors of its poses are correlated with
    /// those of this one.
    #[must_use]
    pub fn has_the_causes_of(&self, other: &Self) -> bool {
        let prior = |of: &Self| {
            let nominal = of.settings.nominal_camera_from_tanker;
            of.settings.attitude_sigma_rad.map(|sigma| (sigma, nominal))
        };
        let is_split = |of: &Self| of.settings.refinement == Refinement::MaximumLikelihood;
        self.budget == other.budget
            && prior(self) == prior(other)
            && (!self.has_causes() || is_split(self) == is_split(other))
    }

    /// Returns the effect of each cause of the budget in a frame: its amplitude and its share of the covariance; `None`
    /// for an estimate that is not maximum likelihood.
    ///
    /// # Inputs
    /// * `observations`, `expected`: those that the solution was estimated from.
    #[must_use]
    pub fn causes(
        &self,
        camera: &Camera,
        observations: &[Observation],
        solution: &Solution,
        expected: &Expected,
    ) -> Option<FrameCauses> {
        if self.settings.refinement != Refinement::MaximumLikelihood {
            return None;
        }
        let floored = with_sigma_floor(observations, self.settings.min_points);
        let observations = floored.as_deref().unwrap_or(observations);
        let (is_reported, prior) = (expected.reported.is_some(), self.attitude_prior(expected));
        let prior = prior.map(|prior| {
            let kind = if is_reported {
                CauseKind::ReportedAttitude
            } else {
                CauseKind::Attitude
            };
            (kind, prior.information)
        });
        budget::frame_causes(self.budget.as_ref(), prior, camera, observations, solution)
    }

    /// Returns the pose of all these points, none left out, and however few they are.
    ///
    /// # Errors
    /// As [`Self::estimate`].
    pub(crate) fn estimate_of_all(
        &self,
        camera: &Camera,
        observations: &[Observation],
    ) -> Result<Solution, EstimateError> {
        let floored = with_sigma_floor(observations, self.settings.min_points);
        let observations = floored.as_deref().unwrap_or(observations);
        self.estimate_with_all(camera, observations, &Expected::default())
    }

    /// Returns a frame linearised at its solution, without the points that it leaves out; `None` for an estimate that
    /// is not maximum likelihood, or where a point has no pixel at the pose.
    ///
    /// # Inputs
    /// * `observations`: those that the solution was estimated from.
    #[must_use]
    pub fn linearised(
        &self,
        camera: &Camera,
        observations: &[Observation],
        solution: &Solution,
    ) -> Option<LinearFrame> {
        if self.settings.refinement != Refinement::MaximumLikelihood {
            return None;
        }
        let floored = with_sigma_floor(observations, self.settings.min_points);
        let used = floored
            .as_deref()
            .unwrap_or(observations)
            .iter()
            .filter(|seen| !solution.excluded.contains(seen.id));
        let information = solution.prior.map_or(0.0, |prior| prior.information);
        let pose = &solution.camera_from_tanker;
        LinearFrame::new(self.budget.as_ref(), information, camera, used, pose)
    }

    /// Returns the prior of a frame: about what both aircraft report, or else about the nominal attitude.
    fn attitude_prior(&self, expected: &Expected) -> Option<AttitudePrior> {
        let reported = expected.reported.map(|reported| reported.sigma_rad);
        let sigma_rad = reported.or(self.settings.attitude_sigma_rad)?;
        Some(AttitudePrior {
            camera_from_tanker: *self.likely_rotation(expected),
            information: sigma_rad.powi(-2),
        })
    }

    /// Returns the attitude that both aircraft report, or else the nominal one.
    fn likely_rotation<'a>(&'a self, expected: &'a Expected) -> &'a Rotation3<f64> {
        match &expected.reported {
            Some(reported) => &reported.camera_from_tanker,
            None => &self.settings.nominal_camera_from_tanker,
        }
    }

    /// Returns the settings.
    #[must_use]
    pub fn settings(&self) -> &EstimatorSettings {
        &self.settings
    }

    /// Returns the pose that fits the observations best, with its covariance and the numbers to judge it by:
    /// [`Solution::is_trusted`] and `ambiguity`.
    ///
    /// If all points together do not pass the test and `max_outliers` permits it, points are excluded, as few as
    /// possible; [`Solution::excluded`] names them. If several exclusions explain the frame equally well, none is made:
    /// the solution of all points is returned, not trusted, and [`Solution::unclear`] names two points of which either
    /// may be wrong.
    ///
    /// # Inputs
    /// * `observations`: each marker once, in any order, finite, sigmas above zero.
    /// * `previous`: the last trusted rotation of `camera_from_tanker`, used by
    ///   [`Initialisation::Previous`] only.
    ///
    /// # Errors
    /// Any [`EstimateError`]: too few points, points that do not determine a pose, a pixel without a ray, no minimum, a
    /// marker behind the camera.
    pub fn estimate(
        &self,
        camera: &Camera,
        observations: &[Observation],
        previous: Option<&Rotation3<f64>>,
    ) -> Result<Solution, EstimateError> {
        let expected = Expected {
            previous,
            reported: None,
        };
        self.estimate_expecting(camera, observations, &expected)
    }

    /// The same as [`Self::estimate`] with all that may be known of the frame's attitude.
    ///
    /// # Errors
    /// As [`Self::estimate`].
    pub fn estimate_expecting(
        &self,
        camera: &Camera,
        observations: &[Observation],
        expected: &Expected,
    ) -> Result<Solution, EstimateError> {
        self.check_count(observations)?;
        let floored = with_sigma_floor(observations, self.settings.min_points);
        let observations = floored.as_deref().unwrap_or(observations);
        let mut estimate = self.estimate_with_all(camera, observations, expected);
        if self.settings.certify
            && let Ok(solution) = &mut estimate
        {
            self.certify(camera, observations, expected, solution);
        }
        let is_final = match &estimate {
            Ok(solution) => solution.is_trusted(),
            // A pixel outside the lens model is an invalid input, not a wrong detection.
            Err(error) => matches!(error, EstimateError::NoRay { .. }),
        };
        if !is_final && self.settings.max_outliers > 0 {
            let of_all = estimate.as_ref().ok();
            match self.leave_out(camera, observations, expected, of_all) {
                Found::Solution(mut of_others) => {
                    of_others.chi_squared_of_all =
                        of_all.map_or(f64::INFINITY, |of_all| of_all.chi_squared);
                    if self.settings.certify {
                        self.certify(camera, observations, expected, &mut of_others);
                    }
                    estimate = Ok(of_others);
                }
                Found::Unclear(ids) => {
                    if let Ok(of_all) = &mut estimate {
                        of_all.unclear = ids;
                    }
                }
                Found::Nothing => {}
            }
        }
        estimate
    }

    /// Checks that there are enough points, and enough of similar precision to check each other.
    #[inline]
    fn check_count(&self, observations: &[Observation]) -> Result<(), EstimateError> {
        let (got, min_points) = (observations.len(), self.settings.min_points);
        let need = min_points.max(self.settings.initialisation.min_points());
        if got < need {
            return Err(EstimateError::TooFewPoints { got, need });
        }
        let precise = count_checking(observations);
        if precise < min_points {
            return Err(EstimateError::TooFewPrecisePoints {
                precise,
                got,
                need: min_points,
            });
        }
        Ok(())
    }

    /// Returns the pose of all these points.
    fn estimate_with_all(
        &self,
        camera: &Camera,
        observations: &[Observation],
        expected: &Expected,
    ) -> Result<Solution, EstimateError> {
        let is_exact = self.budget.as_ref().is_none_or(ErrorBudget::is_empty);
        let prior = self.attitude_prior(expected);
        if !is_exact || prior.is_some() {
            return self.estimate_in_doubt(camera, observations, expected);
        }
        let mut room = Room::new();
        let problem = Problem::new(camera, self.settings.refinement, observations, &mut room)?;
        self.solve(&problem, expected)
    }

    /// As [`Self::estimate_with_all`], with a budget; separate because of its stack space.
    #[inline(never)]
    fn estimate_in_doubt(
        &self,
        camera: &Camera,
        observations: &[Observation],
        expected: &Expected,
    ) -> Result<Solution, EstimateError> {
        let mut room = Room::new();
        let mut doubts = FrameBudget::new(self.attitude_prior(expected));
        let problem = Problem::new(camera, self.settings.refinement, observations, &mut room)?;
        doubts.fill(self.budget.as_ref(), camera, observations, &problem.points);
        self.solve(&problem.in_doubt(&doubts), expected)
    }

    #[inline(always)]
    fn solve(&self, problem: &Problem, expected: &Expected) -> Result<Solution, EstimateError> {
        let start = self.settings.initialisation;
        let nominal = || {
            let seed = self.likely_rotation(expected);
            self.solve_from(problem, seed, Initialisation::Nominal)
        };
        match (start, expected.previous) {
            (Initialisation::Previous, Some(seed)) => {
                match self.solve_from(problem, seed, start) {
                    Ok(solution) if solution.is_trusted() => Ok(solution),
                    // The tanker has turned, or the last pose was wrong: restart from the nominal attitude.
                    _ => nominal(),
                }
            }
            (Initialisation::Nominal | Initialisation::Previous, _) => nominal(),
            (Initialisation::Dlt, _) => {
                let seed = dlt_seed(problem.camera, problem.observations)?;
                self.solve_from(problem, &seed, start)
            }
            (Initialisation::Global, _) => self.solve_globally(problem),
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
        // The last attitude cannot exclude a rival, because it may itself have been the wrong one of the two.
        let prior = (initialisation == Initialisation::Nominal).then_some(seed);
        let cost = |fit: &Fit| fit.chi_squared + squared_turn(&fit.pose.rotation, prior);
        let rival = ambiguity::rival(problem, &fit);
        let (best, other) = match &rival {
            Some(rival) if cost(rival) < cost(&fit) => (rival, Some(&fit)),
            rival => (&fit, rival.as_ref()),
        };
        let judged = Judged {
            fit: best,
            // The prior selects the pose but must not make it look less ambiguous than the image does.
            ambiguity: other.map_or(0.0, |other| {
                likelihood_ratio(other.chi_squared, best.chi_squared)
            }),
            iterations: minimum.iterations.saturating_add(fit.iterations),
            initialisation,
        };
        self.judge(problem, &judged)
    }

    /// Returns the best of all minima in front of the camera, with the second best as its rival.
    fn solve_globally(&self, problem: &Problem) -> Result<Solution, EstimateError> {
        let minima = initialise::search(problem);
        let mut iterations = minima.iterations;
        let mut ranking = Ranking::default();
        // If every minimum is behind the camera, that is the reason to report.
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
        self.judge(problem, &judged)
    }

    #[inline(always)]
    fn judge(&self, problem: &Problem, judged: &Judged) -> Result<Solution, EstimateError> {
        let fit = judged.fit;
        let residuals = 2 * problem.observations.len();
        let degrees_of_freedom = problem.degrees_of_freedom();
        let lever = fit.pose.rotation * problem.points.mean.coords;
        Ok(Solution {
            camera_from_tanker: fit.pose.about_origin(&lever),
            covariance: honest_covariance(problem, fit, &lever)?,
            rms_px: (fit.squared_residuals_px / residuals as f64).sqrt(),
            chi_squared: fit.chi_squared,
            chi_squared_of_all: fit.chi_squared,
            degrees_of_freedom: u16::try_from(degrees_of_freedom).unwrap_or(u16::MAX),
            chi_squared_limit: self.limits.limit(degrees_of_freedom),
            iterations: judged.iterations,
            initialisation: judged.initialisation,
            ambiguity: judged.ambiguity,
            excluded: Excluded::default(),
            prior: prior_agreement(problem, fit, &self.limits),
            unclear: Excluded::default(),
            certificate: None,
        })
    }
}

/// Returns the squared rotation from a prior attitude in units of [`PRIOR_SIGMA`]; 0 without a prior.
fn squared_turn(found: &Rotation3<f64>, prior: Option<&Rotation3<f64>>) -> f64 {
    prior.map_or(0.0, |prior| {
        let turn = UnitQuaternion::from_rotation_matrix(&(found * prior.inverse())).angle();
        (turn / PRIOR_SIGMA).powi(2)
    })
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
    linear_rotation(&rays, &markers, &mean(&markers, |marker| marker))
}

/// The best two different poses, with their merits.
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
