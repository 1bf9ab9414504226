//! One prepared frame: points about their mean, the quadratic cost, and fits from a seed.

use nalgebra::{Isometry3, Matrix6, Rotation3};

use super::budget::{AttitudePrior, FrameBudget, InDoubt};
use super::centred_pose::CentredPose;
use super::certificate;
use super::collinearity::{CollinearityCost, CollinearityMoments, Weighting};
use super::covariance::sandwich;
use super::lanes::four::{Arithmetic, Kernel, Plain, vectorised};
use super::lanes::points::{Blocks, Points};
use super::refine::{self, Fit, FitFailure};
use super::residuals::{LensResiduals, PinholeResiduals};
use super::{EstimateError, Observation, Refinement, newton};
use crate::camera::Camera;

/// rad; sufficient for the start of maximum likelihood: the error after Newton's step is about its square.
const START_TOLERANCE: f64 = 0.03;
/// rad; convergence is quadratic, so the fixed point is then exact to rounding.
const FIXED_POINT_TOLERANCE: f64 = 1e-7;
/// Chi-squared above that of the chosen pose at which a rival is negligible: its likelihood is below 1e-13 of the
/// chosen one's.
pub(crate) const NEGLIGIBLE: f64 = 60.0;

/// Chi-squared by which another pose may be better in spite of a certificate.
const UNNOTICED: f64 = 0.01;
/// rad²; the same for the paper's cost, which is not weighted by sigmas: a sum of squared angles to the rays.
const UNNOTICED_ANGLE: f64 = 1e-11;
/// Frobenius norm of the difference of rotation matrices, 20°. A minimum farther from a pose belongs to another pose:
/// between maximum likelihood and the cost it moves by a fraction of the attitude's sigma, which the node limits to 10°.
const OWN_MINIMUM: f64 = 0.5;

/// Share of the predicted decrease of chi-squared used as a lower bound of a fit. Far from a minimum a step predicts
/// too much or too little; a quarter proved too large for the descent of the cost.
const SURE_SHARE: f64 = 0.1;

/// A frame with its camera, as shared by all starts and rival poses.
#[derive(Debug)]
pub(crate) struct Problem<'a> {
    pub(crate) camera: &'a Camera,
    refinement: Refinement,
    pub(crate) observations: &'a [Observation],
    pub(crate) points: Points<'a>,
    pub(crate) cost: &'a CollinearityCost,
    /// The error budget of the frame's points, if any.
    doubts: Option<&'a FrameBudget>,
}

/// Storage of a problem: seven kilobytes that are filled in place and never moved.
pub(crate) struct Room {
    blocks: Blocks,
    cost: CollinearityCost,
}

impl Room {
    #[inline(always)]
    pub(crate) fn new() -> Self {
        Self {
            blocks: Blocks::new(),
            cost: CollinearityCost::EMPTY,
        }
    }
}

/// The step from pixels to the cost.
struct Preparation<'a, 'b> {
    camera: &'a Camera,
    observations: &'a [Observation],
    weighting: Weighting,
    blocks: &'a mut Blocks,
    cost: &'b mut CollinearityCost,
}

impl<'a> Kernel for Preparation<'a, '_> {
    type Output = Result<Points<'a>, EstimateError>;

    #[inline(always)]
    fn run<A: Arithmetic>(self, arithmetic: A) -> Self::Output {
        let points = Points::new(arithmetic, self.camera, self.observations, self.blocks)?;
        let moments = CollinearityMoments::new(arithmetic, &points, self.weighting);
        self.cost
            .fill(arithmetic, &moments)
            .ok_or(EstimateError::SAME_RAYS)?;
        Ok(points)
    }
}

/// Maximum likelihood of a camera without distortion.
struct PinholeFit<'a> {
    problem: &'a Problem<'a>,
    start: CentredPose,
}

impl Kernel for PinholeFit<'_> {
    type Output = Result<Fit, EstimateError>;

    #[inline(always)]
    fn run<A: Arithmetic>(self, arithmetic: A) -> Self::Output {
        let residuals = PinholeResiduals {
            arithmetic,
            points: &self.problem.points,
        };
        let explain = |failure| self.problem.explain(failure, &self.start);
        refine::maximum_likelihood(&residuals, self.start, explain)
    }
}

impl<'a> Problem<'a> {
    /// Returns the problem with the paper's quadratic cost, or with the one that approximates maximum likelihood.
    pub(crate) fn new(
        camera: &'a Camera,
        refinement: Refinement,
        observations: &'a [Observation],
        room: &'a mut Room,
    ) -> Result<Self, EstimateError> {
        let weighting = match refinement {
            Refinement::None => Weighting::ObjectSpace,
            Refinement::MaximumLikelihood => Weighting::Image,
        };
        let Room { blocks, cost } = room;
        let points = vectorised(Preparation {
            camera,
            observations,
            weighting,
            blocks,
            cost,
        })?;
        Ok(Self {
            camera,
            refinement,
            observations,
            points,
            cost,
            doubts: None,
        })
    }

    /// Returns whether it is proven that no pose with the markers' mean in front of the camera has a lower quadratic cost
    /// than the minimum next to a rotation.
    pub(crate) fn is_best_in_front(&self, rotation: &Rotation3<f64>) -> bool {
        let minimum = newton::minimise(self.cost, rotation, FIXED_POINT_TOLERANCE);
        let turn = minimum.rotation.matrix() - rotation.matrix();
        if !minimum.converged || turn.norm() > OWN_MINIMUM {
            return false;
        }
        let tolerance = self.unnoticed(self.cost.centre_in_camera(&minimum.rotation).z);
        certificate::is_best_in_front(self.cost, &minimum.rotation, tolerance)
    }

    /// Returns by how much the cost of another pose may be lower in spite of a certificate, for a depth of the markers'
    /// mean, m.
    pub(crate) fn unnoticed(&self, depth: f64) -> f64 {
        let unnoticed = match self.refinement {
            Refinement::MaximumLikelihood => UNNOTICED,
            Refinement::None => UNNOTICED_ANGLE,
        };
        unnoticed * depth * depth
    }

    /// Returns the problem with a budget that has been filled for its points.
    pub(crate) fn in_doubt(self, doubts: &'a FrameBudget) -> Self {
        Self {
            doubts: Some(doubts),
            ..self
        }
    }

    fn doubt(&self, budget: &'a FrameBudget) -> InDoubt<'_> {
        InDoubt {
            camera: self.camera,
            observations: self.observations,
            points: &self.points,
            budget,
        }
    }

    /// Returns the degrees of freedom of the residuals, including those of a prior.
    pub(crate) fn degrees_of_freedom(&self) -> usize {
        2 * self.observations.len() - 6 + self.doubts.map_or(0, FrameBudget::degrees_of_freedom)
    }

    /// Returns the prior of the attitude, if there is one.
    #[inline(always)]
    pub(crate) fn attitude_prior(&self) -> Option<&AttitudePrior> {
        self.doubts?.attitude()
    }

    /// Returns the step length, rad, at which a minimum of the cost is accurate enough.
    pub(crate) fn step_tolerance(&self) -> f64 {
        match self.refinement {
            Refinement::None => FIXED_POINT_TOLERANCE,
            Refinement::MaximumLikelihood => START_TOLERANCE,
        }
    }

    /// Returns the minimum in whose basin `seed` lies.
    pub(crate) fn descend(&self, seed: &Rotation3<f64>) -> Result<newton::Minimum, EstimateError> {
        let minimum = newton::minimise(self.cost, seed, self.step_tolerance());
        if minimum.converged {
            Ok(minimum)
        } else {
            Err(EstimateError::NoConvergence {
                iterations: minimum.iterations,
            })
        }
    }

    /// Returns the minimum in whose basin `seed` lies; `None` without one, or if chi-squared there will clearly exceed
    /// a limit.
    pub(crate) fn descend_below(
        &self,
        seed: &Rotation3<f64>,
        chi_squared: f64,
    ) -> Option<newton::Minimum> {
        let limit = match self.refinement {
            // The cost does not include the budget, with which chi-squared may be far smaller.
            _ if self.doubts.is_some() => f64::INFINITY,
            Refinement::None => f64::INFINITY,
            Refinement::MaximumLikelihood => {
                let depth = self.cost.centre_in_camera(seed).z.abs() + self.points.radius;
                chi_squared * depth * depth
            }
        };
        newton::minimise_below(self.cost, seed, self.step_tolerance(), limit)
            .filter(|minimum| minimum.converged)
    }

    /// Returns the final pose from a minimum of the cost, with every point in front of the camera.
    pub(crate) fn fit(&self, rotation: &Rotation3<f64>) -> Result<Fit, EstimateError> {
        let start = self.placed(rotation);
        let mut fit = match (self.refinement, self.doubts) {
            (Refinement::None, _) => self.as_it_is(start),
            (Refinement::MaximumLikelihood, Some(budget)) => self
                .doubt(budget)
                .fit(start)
                .map_err(|failure| self.explain(failure, &start)),
            (Refinement::MaximumLikelihood, None) if self.camera.is_pinhole() => {
                vectorised(PinholeFit {
                    problem: self,
                    start,
                })
            }
            (Refinement::MaximumLikelihood, None) => {
                let explain = |failure| self.explain(failure, &start);
                refine::maximum_likelihood(&self.lens_residuals(), start, explain)
            }
        };
        if let Ok(found) = &fit
            && let Err(error) = self.check_in_front(&found.pose)
        {
            fit = Err(error);
        }
        fit
    }

    /// Returns the covariance of a fit, rotation before position of the markers' mean.
    pub(crate) fn covariance(&self, fit: &Fit) -> Result<Matrix6<f64>, EstimateError> {
        match &fit.solver {
            Some(solver) => Ok(solver.covariance()),
            None => sandwich(
                self.camera,
                self.observations,
                &self.points.mean,
                &fit.pose,
                self.doubts,
            )
            .ok_or(EstimateError::SINGULAR),
        }
    }

    /// Returns the pose with this rotation that fits the points best.
    #[inline]
    pub(crate) fn placed(&self, rotation: &Rotation3<f64>) -> CentredPose {
        CentredPose {
            rotation: *rotation,
            centre_in_camera: self.cost.centre_in_camera(rotation),
        }
    }

    /// The paper's own estimate.
    fn as_it_is(&self, pose: CentredPose) -> Result<Fit, EstimateError> {
        let (chi_squared, squared_residuals_px) = self
            .chi_squared_at(&pose)
            .ok_or_else(|| self.explain(FitFailure::StartNotVisible, &pose))?;
        Ok(Fit {
            pose,
            chi_squared,
            squared_residuals_px,
            solver: None,
            iterations: 0,
        })
    }

    /// Returns chi-squared and the squared residuals, px², at a pose; `None` if a point has no pixel there.
    fn chi_squared_at(&self, pose: &CentredPose) -> Option<(f64, f64)> {
        match self.doubts {
            Some(budget) => self.doubt(budget).at(*pose),
            None => refine::squared_residuals(&self.lens_residuals(), pose),
        }
    }

    fn lens_residuals(&self) -> LensResiduals<'_> {
        LensResiduals {
            camera: self.camera,
            observations: self.observations,
            markers_mean: self.points.mean,
        }
    }

    /// Returns `camera_from_tanker` of a pose about the markers' mean.
    pub(crate) fn pose(&self, pose: &CentredPose) -> Isometry3<f64> {
        pose.about_origin(&(pose.rotation * self.points.mean.coords))
    }

    /// The quantity that is least for the best fit; each refinement minimises its own error.
    pub(crate) fn merit(&self, fit: &Fit) -> f64 {
        match self.refinement {
            Refinement::MaximumLikelihood => fit.chi_squared,
            Refinement::None => self.cost.value(Plain, &fit.pose.rotation),
        }
    }

    /// Returns the increase of chi-squared when a fit is turned to another attitude, at the best position for it;
    /// `None` if a point has no pixel there.
    pub(crate) fn rise(&self, fit: &Fit, rotation: &Rotation3<f64>) -> Option<f64> {
        let rise = match (self.refinement, self.doubts) {
            (Refinement::MaximumLikelihood, Some(budget)) => {
                let there = self.placed(rotation);
                self.doubt(budget).with_attitude(there)? - fit.chi_squared
            }
            // To first order, the cost is chi-squared times the squared depths.
            (Refinement::MaximumLikelihood, None) => {
                let depth = fit.pose.centre_in_camera.z;
                let cost = |rotation| self.cost.value(Plain, rotation);
                (cost(rotation) - cost(&fit.pose.rotation)) / (depth * depth)
            }
            // The paper's cost is not weighted by the noise.
            (Refinement::None, _) => {
                let there = self.placed(rotation);
                self.chi_squared_at(&there)?.0 - fit.chi_squared
            }
        };
        Some(rise.max(0.0))
    }

    /// Returns a lower bound of chi-squared in the basin of a minimum of the cost; `None` for the paper's cost, which
    /// is not weighted by the noise.
    ///
    /// To first order, the cost is the sum of squared whitened residuals times squared depths.
    pub(crate) fn least_chi_squared(&self, minimum: &newton::Minimum) -> Option<f64> {
        if let Some(budget) = self.doubts {
            let promised = self.doubt(budget).promised(self.placed(&minimum.rotation));
            return promised.map(|promised| SURE_SHARE * promised);
        }
        let centre_depth = self.cost.centre_in_camera(&minimum.rotation).z;
        let largest_depth = centre_depth + self.points.radius;
        (self.refinement == Refinement::MaximumLikelihood)
            .then_some(minimum.cost / (largest_depth * largest_depth))
    }

    /// Returns the cost above which a minimum is negligible next to this one. Infinite for the paper's cost, which is
    /// not weighted by the noise; with a budget, which the cost does not include; and next to a minimum that may be
    /// discarded because a marker is behind the camera.
    pub(crate) fn negligible_cost(&self, best: &newton::Minimum) -> f64 {
        let (depth, radius) = (
            self.cost.centre_in_camera(&best.rotation).z,
            self.points.radius,
        );
        if self.refinement == Refinement::MaximumLikelihood
            && depth > radius
            && self.doubts.is_none()
        {
            best.cost + NEGLIGIBLE * (depth + radius).powi(2)
        } else {
            f64::INFINITY
        }
    }

    fn check_in_front(&self, pose: &CentredPose) -> Result<(), EstimateError> {
        if pose.centre_in_camera.z > self.points.radius {
            return Ok(()); // no rotation puts a marker behind the camera
        }
        for seen in self.observations {
            let arm = pose.rotation * (seen.marker_in_tanker - self.points.mean);
            let depth_m = arm.z + pose.centre_in_camera.z;
            if !(depth_m > 0.0 && depth_m.is_finite()) {
                return Err(EstimateError::BehindCamera {
                    id: seen.id,
                    depth_m,
                });
            }
        }
        Ok(())
    }

    #[cold]
    fn explain(&self, failure: FitFailure, start: &CentredPose) -> EstimateError {
        match failure {
            FitFailure::Singular => EstimateError::SINGULAR,
            FitFailure::NotConverged => EstimateError::NoConvergence {
                iterations: refine::MAX_ITERATIONS,
            },
            // In front but without a pixel: outside the lens model's valid region.
            FitFailure::StartNotVisible => self
                .check_in_front(start)
                .err()
                .unwrap_or(EstimateError::NoConvergence { iterations: 0 }),
        }
    }
}
