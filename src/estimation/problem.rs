//! One frame's problem, prepared: markers about their mean, the quadratic cost, fits from a seed.

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};

use super::collinearity::{
    CollinearityCost, CollinearityMoments, image_weight, mean, object_space_weight,
};
use super::covariance::{ray_information, sandwich};
use super::refine::{self, CentredPose, Fit, FitFailure};
use super::{EstimateError, Observation, Refinement, newton};
use crate::camera::Camera;

/// rad; a start for maximum likelihood needs no more.
pub(crate) const START_TOLERANCE: f64 = 1e-3;
/// rad; convergence is quadratic, so the fixed point is then met to rounding.
const FIXED_POINT_TOLERANCE: f64 = 1e-7;
/// Least second moment of the markers about their line, relative to the first: a thousandth in length.
const MIN_WIDTH_SHARE: f64 = 1e-6;

/// A frame with its camera: what every hypothesis about it shares.
#[derive(Debug)]
pub(crate) struct Problem<'a> {
    pub(crate) camera: &'a Camera,
    pub(crate) refinement: Refinement,
    /// Reference point of all fits, m, tanker frame.
    pub(crate) markers_mean: Point3<f64>,
}

impl<'a> Problem<'a> {
    pub(crate) fn new(
        camera: &'a Camera,
        refinement: Refinement,
        observations: &[Observation],
    ) -> Self {
        let markers_mean = mean(observations.iter().map(|o| &o.marker_in_tanker));
        Self {
            camera,
            refinement,
            markers_mean,
        }
    }

    /// Returns the quadratic cost: that of the paper, or the one nearest to maximum likelihood.
    pub(crate) fn cost(
        &self,
        observations: &[Observation],
    ) -> Result<CollinearityCost, EstimateError> {
        let mut moments = CollinearityMoments::ZERO;
        for observation in observations {
            let ray = self
                .camera
                .ray_from_pixel(observation.pixel)
                .map_err(|cause| EstimateError::NoRay {
                    id: observation.id,
                    cause,
                })?;
            let weight = match self.refinement {
                Refinement::None => object_space_weight(ray),
                Refinement::MaximumLikelihood => {
                    let information = ray_information(self.camera, ray, observation.sigma_px)
                        .ok_or(EstimateError::SAME_RAYS)?;
                    image_weight(ray, information)
                }
            };
            moments.add(&(observation.marker_in_tanker - self.markers_mean), &weight);
        }
        Self::check_spread(observations)?;
        CollinearityCost::new(&moments).ok_or(EstimateError::SAME_RAYS)
    }

    /// Returns how far from the prior's basin a minimum of the cost needs to be followed.
    pub(crate) fn step_tolerance(&self) -> f64 {
        match self.refinement {
            Refinement::None => FIXED_POINT_TOLERANCE,
            Refinement::MaximumLikelihood => START_TOLERANCE,
        }
    }

    /// Returns the minimum in whose basin `seed` lies.
    pub(crate) fn descend(
        &self,
        cost: &CollinearityCost,
        seed: &Rotation3<f64>,
    ) -> Result<newton::Minimum, EstimateError> {
        let minimum = newton::minimise(cost, seed, self.step_tolerance());
        if minimum.converged {
            Ok(minimum)
        } else {
            Err(EstimateError::NoConvergence {
                iterations: minimum.iterations,
            })
        }
    }

    /// Returns the final pose from a minimum of the cost, every point in front of the camera.
    pub(crate) fn fit(
        &self,
        observations: &[Observation],
        cost: &CollinearityCost,
        rotation: &Rotation3<f64>,
    ) -> Result<Fit, EstimateError> {
        let start = CentredPose {
            rotation: *rotation,
            centre_in_camera: cost.centre_in_camera(rotation),
        };
        self.check_in_front(observations, &start)?;
        let fit = match self.refinement {
            Refinement::MaximumLikelihood => {
                refine::maximum_likelihood(self.camera, observations, &self.markers_mean, start)
                    .map_err(|failure| self.explain(failure, observations, &start))?
            }
            Refinement::None => self.as_it_is(observations, start)?,
        };
        self.check_in_front(observations, &fit.pose)?;
        Ok(fit)
    }

    /// The paper's own estimate, with the covariance that it really has.
    fn as_it_is(
        &self,
        observations: &[Observation],
        pose: CentredPose,
    ) -> Result<Fit, EstimateError> {
        let chi_squared = refine::chi_squared(self.camera, observations, &self.markers_mean, &pose)
            .ok_or_else(|| self.explain(FitFailure::StartNotVisible, observations, &pose))?;
        let covariance = sandwich(self.camera, observations, &self.markers_mean, &pose)
            .ok_or(EstimateError::SINGULAR)?;
        Ok(Fit {
            pose,
            chi_squared,
            covariance,
            iterations: 0,
        })
    }

    /// Returns `camera_from_tanker` of a fit.
    pub(crate) fn pose(&self, fit: &Fit) -> Isometry3<f64> {
        let t = fit.pose.centre_in_camera - fit.pose.rotation * self.markers_mean.coords;
        Isometry3::from_parts(
            Translation3::from(t),
            UnitQuaternion::from_rotation_matrix(&fit.pose.rotation),
        )
    }

    /// Returns the root mean square residual over columns and rows, px.
    pub(crate) fn rms_px(&self, observations: &[Observation], fit: &Fit) -> f64 {
        let unweighted = observations.iter().try_fold(0.0, |sum, observation| {
            refine::residual_px(self.camera, observation, &self.markers_mean, &fit.pose)
                .map(|residual| sum + residual.norm_squared())
        });
        unweighted.map_or(f64::NAN, |sum| {
            (sum / (2 * observations.len()) as f64).sqrt()
        })
    }

    /// Refuses points on one line: the turn about it is free.
    fn check_spread(observations: &[Observation]) -> Result<(), EstimateError> {
        let s = scatter(observations);
        // The second invariant is about the product of the two largest eigenvalues.
        let second = s.m11 * s.m22 + s.m22 * s.m33 + s.m33 * s.m11
            - (s.m12 * s.m12 + s.m23 * s.m23 + s.m13 * s.m13);
        if second > MIN_WIDTH_SHARE * s.trace() * s.trace() {
            Ok(())
        } else {
            Err(EstimateError::ON_ONE_LINE)
        }
    }

    fn check_in_front(
        &self,
        observations: &[Observation],
        pose: &CentredPose,
    ) -> Result<(), EstimateError> {
        for observation in observations {
            let arm = pose.rotation * (observation.marker_in_tanker - self.markers_mean);
            let depth_m = arm.z + pose.centre_in_camera.z;
            if !(depth_m > 0.0 && depth_m.is_finite()) {
                return Err(EstimateError::BehindCamera {
                    id: observation.id,
                    depth_m,
                });
            }
        }
        Ok(())
    }

    fn explain(
        &self,
        failure: FitFailure,
        observations: &[Observation],
        start: &CentredPose,
    ) -> EstimateError {
        match failure {
            FitFailure::Singular => EstimateError::SINGULAR,
            FitFailure::NotConverged => EstimateError::NoConvergence {
                iterations: refine::MAX_ITERATIONS,
            },
            FitFailure::StartNotVisible => {
                self.check_in_front(observations, start).err().unwrap_or(
                    // In front, yet without a pixel: the lens model does not reach there.
                    EstimateError::NoConvergence { iterations: 0 },
                )
            }
        }
    }
}

/// Returns the direction in which the markers spread least, tanker frame.
pub(crate) fn flattest_axis(observations: &[Observation]) -> Option<Vector3<f64>> {
    let eigen = scatter(observations).symmetric_eigen();
    let axis = eigen
        .eigenvectors
        .column(eigen.eigenvalues.imin())
        .into_owned();
    axis.iter().all(|value| value.is_finite()).then_some(axis)
}

/// Second moments of the markers about their mean, m².
fn scatter(observations: &[Observation]) -> Matrix3<f64> {
    let centre = mean(observations.iter().map(|o| &o.marker_in_tanker));
    observations
        .iter()
        .fold(Matrix3::zeros(), |sum, observation| {
            let p = observation.marker_in_tanker - centre;
            sum + p * p.transpose()
        })
}
