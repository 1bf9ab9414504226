//! Pose estimation from known markers in one image.
//!
//! Depends on `geometry` and `camera`, and not on clocks, files, topics or the last frame (the last attitude is an
//! argument). The steps of one frame:
//!
//! ```text
//! observations -> rays -> quadratic cost -> seed rotation -> Newton to its minimum
//!              -> in front? -> maximum likelihood -> covariance -> rival pose? -> chi-squared limit
//! ```
//!
//! | paper  | here                 | shape, unit             |
//! |--------|----------------------|-------------------------|
//! | `R, t` | `camera_from_tanker` | `Isometry3`, m          |
//! | `Pᵢʷ`  | `marker_in_tanker`   | `Point3`, m             |
//! | `Qᵢᶜ`  | `point_in_camera`    | `Vector3`, m            |
//! | `vᵢ`   | `ray`                | [`Ray`], `z = 1` |
//! | `K`    | [`Camera`]           | px                      |

mod ambiguity;
mod budget;
mod centred_pose;
mod certificate;
mod collinearity;
mod covariance;
mod estimator;
mod exclude;
mod initialise;
mod lanes;
mod newton;
mod orthogonal_iteration;
mod prior_agreement;
mod problem;
mod redundancy;
mod refine;
mod residuals;
mod trust;
mod widen;

use nalgebra::{Isometry3, Point3, Rotation3, Vector2};

use crate::camera::{Camera, Pixel, Ray, UndistortError};
use crate::geometry::PoseCovariance;

pub use budget::{
    BudgetError, CalibrationMode, Cause, CauseKind, CorrelatedNoise, CorrelatedNoiseError,
    ErrorBudget, FlexMode, FrameCauses, LinearFrame,
};
pub use estimator::Estimator;
pub(crate) use estimator::PRIOR_SIGMA;
pub use initialise::linear_rotation;
pub use orthogonal_iteration::{Iterated, fixed_point, iterate_accelerated, iterate_literally};

/// How the iteration is started.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Initialisation {
    /// `In_M2`: the nominal attitude. At least 3 points.
    Nominal,
    /// `In_M1`: the linear camera matrix. At least 6 points, not in one plane.
    Dlt,
    /// The last trusted attitude; the nominal one if there is none or no pose results from it. At least 3 points.
    Previous,
    /// No prior: the best of all attitudes. At least 4 points.
    Global,
}

impl Initialisation {
    /// Returns how many points this initialisation needs.
    #[must_use]
    pub fn min_points(self) -> usize {
        match self {
            Self::Nominal | Self::Previous => 3,
            Self::Global => 4,
            Self::Dlt => 6,
        }
    }
}

/// Which estimate is computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Refinement {
    /// The pose with the least squared pixel residuals over their variances.
    MaximumLikelihood,
    /// The paper's: the converged orthogonal iteration.
    None,
}

/// Settings of the estimator.
#[derive(Debug, Clone, PartialEq)]
pub struct EstimatorSettings {
    /// How the iteration is started.
    pub initialisation: Initialisation,
    /// Which estimate is computed.
    pub refinement: Refinement,
    /// Rotation part of the expected `camera_from_tanker`.
    pub nominal_camera_from_tanker: Rotation3<f64>,
    /// Least number of points, and least number of points whose sigma is at most five times the third smallest; the
    /// initialisation may need more. From 5 on, sigmas below half the `min_points`-th smallest are raised to that.
    pub min_points: usize,
    /// At most this many points may be excluded as wrong, 0 to 2.
    pub max_outliers: usize,
    /// Probability that a correct frame passes the chi-squared test, 0 to 1.
    pub trust_probability: f64,
    /// Frames with a rival pose of at least this likelihood are refused, 0 to 1; 1 or more: never.
    pub max_ambiguity: f64,
    /// Standard deviation of the attitude about the nominal one, each axis, rad; `None`: no prior.
    pub attitude_sigma_rad: Option<f64>,
    /// Whether to prove for each pose that no other one in front of the camera has a lower quadratic cost, and to search
    /// for a better one where that cannot be proven: see [`Certificate`].
    pub certify: bool,
    /// Whether poses without that proof are refused; needs `certify`.
    pub require_certificate: bool,
}

impl Default for EstimatorSettings {
    /// The node's defaults: aligned airframes, a camera that looks straight ahead, maximum likelihood, one exclusion
    /// from five points on, no tolerated second pose. A test compares them with the table of parameters.
    fn default() -> Self {
        Self {
            initialisation: Initialisation::Nominal,
            refinement: Refinement::MaximumLikelihood,
            nominal_camera_from_tanker: crate::geometry::optical_from_body(),
            min_points: 5,
            max_outliers: 1,
            trust_probability: 0.999,
            max_ambiguity: 0.1,
            attitude_sigma_rad: None,
            certify: false,
            require_certificate: false,
        }
    }
}

/// The attitude that both aircraft report for the time of an image: a normal distribution, the same about every axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReportedAttitude {
    /// Rotation part of `camera_from_tanker`.
    pub camera_from_tanker: Rotation3<f64>,
    /// Standard deviation about each axis, rad; finite and above zero.
    pub sigma_rad: f64,
}

/// What is known of one frame's attitude before its image is looked at.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Expected<'a> {
    /// The last trusted rotation of `camera_from_tanker`, used by [`Initialisation::Previous`] only.
    pub previous: Option<&'a Rotation3<f64>>,
    /// What both aircraft report. It stands in for the nominal attitude of the settings and for the prior about it.
    pub reported: Option<ReportedAttitude>,
}

/// The observation of one marker in an image. Values are checked by the caller: finite, `sigma_px > 0`, ids unique.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observation {
    /// Marker id.
    pub id: u32,
    /// Position of the marker, tanker frame, m.
    pub marker_in_tanker: Point3<f64>,
    /// Detected position in the image.
    pub pixel: Pixel,
    /// Standard deviation of column and of row, px.
    pub sigma_px: f64,
}

impl Observation {
    /// Returns predicted minus detected pixel, px; `None` if the marker has no pixel at this pose.
    #[must_use]
    pub fn residual_px(
        &self,
        camera: &Camera,
        camera_from_tanker: &Isometry3<f64>,
    ) -> Option<Vector2<f64>> {
        let q = camera_from_tanker * self.marker_in_tanker;
        if q.z <= 0.0 {
            return None;
        }
        let (pixel, _) = camera.project(Ray::through(&q.coords))?;
        Some(Vector2::new(pixel.u - self.pixel.u, pixel.v - self.pixel.v))
    }
}

/// A pose with the numbers to judge it by.
#[derive(Debug, Clone, PartialEq)]
pub struct Solution {
    /// The tanker's pose in the camera optical frame.
    pub camera_from_tanker: Isometry3<f64>,
    /// Covariance of that pose, from the stated sigmas, not from the residuals.
    pub covariance: PoseCovariance,
    /// Root mean square over all columns and rows of the used points' residuals, px.
    pub rms_px: f64,
    /// Sum of the squared residuals over their variances.
    pub chi_squared: f64,
    /// Degrees of freedom of `chi_squared`: `2 n − 6`.
    pub degrees_of_freedom: u16,
    /// The largest `chi_squared` that passes the test.
    pub chi_squared_limit: f64,
    /// Iterations of all solver stages, without descents that were abandoned.
    pub iterations: u16,
    /// The initialisation that was used in the end.
    pub initialisation: Initialisation,
    /// Likelihood of the best rival pose in front of the camera relative to this one, at most 1; 0: no rival. From the
    /// image alone, without the prior.
    pub ambiguity: f64,
    /// Points excluded as wrong.
    pub excluded: Excluded,
    /// `chi_squared` of the fit of all points, before any exclusion; infinite if they have no fit.
    pub chi_squared_of_all: f64,
    /// How it agrees with the prior of the attitude, if there is one.
    pub prior: Option<PriorAgreement>,
    /// Two points of which either may be wrong; empty unless the frame is unclear.
    pub unclear: Excluded,
    /// Whether the pose is proven to be the best one in front of the camera; `None` unless [`EstimatorSettings::certify`].
    pub certificate: Option<Certificate>,
}

/// Whether the minimum of the quadratic cost next to a pose is the lowest one in front of the camera.
///
/// The quadratic cost is the one that every start minimises first: squared distances from rays, weighted by the sigmas of
/// the detections (with [`Refinement::None`] the paper's). The proof says that no pose with the mean of its markers in
/// front of the camera has a lower one, except by less than 0.01 of chi-squared. It does not cover excluded points, poses
/// behind the camera, and terms that only the maximum likelihood fit has: an error budget, an attitude prior, and the
/// lens away from the detections.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Certificate {
    /// Proven.
    Certified,
    /// Not proven. A search found no better pose, or only one that is worse by the prior or by maximum likelihood; other
    /// poses that it found are included in [`Solution::ambiguity`].
    NotCertified,
    /// Proven, for a better pose that a search found in place of the one that the start led to.
    Replaced,
}

impl Certificate {
    /// Returns whether there is a proof.
    #[must_use]
    pub fn is_proven(self) -> bool {
        match self {
            Self::Certified | Self::Replaced => true,
            Self::NotCertified => false,
        }
    }

    /// Returns its name: that of the message's constant, in lower case.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Certified => "certified",
            Self::NotCertified => "not_certified",
            Self::Replaced => "replaced",
        }
    }
}

impl Solution {
    /// Returns predicted minus detected pixel, px; `None` if the marker has no pixel at this pose.
    #[must_use]
    pub fn residual_px(&self, camera: &Camera, seen: &Observation) -> Option<Vector2<f64>> {
        seen.residual_px(camera, &self.camera_from_tanker)
    }

    /// Returns chi-squared of the fit of all points with its degrees of freedom, with or without exclusions.
    #[must_use]
    pub fn of_all_points(&self) -> (f64, u16) {
        let left_out = u16::try_from(self.excluded.ids().count()).unwrap_or(0);
        let degrees_of_freedom = self.degrees_of_freedom.saturating_add(2 * left_out);
        (self.chi_squared_of_all, degrees_of_freedom)
    }

    /// Returns by how much the chi-squared of the second-best pose exceeds that of this one, by
    /// [`Self::ambiguity`]; `None` where none was found, or its likelihood is negligible.
    #[must_use]
    pub fn runner_up_gap(&self) -> Option<f64> {
        // Not −2 ln(1), which is minus zero.
        (self.ambiguity > 0.0).then(|| 2.0 * self.ambiguity.recip().ln())
    }

    /// Returns whether the residuals are as small as the sigmas promise, and image and prior agree.
    #[must_use]
    pub fn is_trusted(&self) -> bool {
        self.chi_squared <= self.chi_squared_limit
            && self.prior.as_ref().is_none_or(PriorAgreement::agrees)
    }
}

/// How an estimate agrees with the prior of its attitude.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PriorAgreement {
    /// Of the prior about each axis, 1/rad².
    pub information: f64,
    /// How far the estimate is turned from the prior, rad.
    pub turn_rad: f64,
    /// The square of that turn over its covariance: a chi-squared variable if prior and image are as stated.
    pub chi_squared: f64,
    /// The largest to trust.
    pub limit: f64,
}

impl PriorAgreement {
    /// Returns whether they agree.
    #[must_use]
    pub fn agrees(&self) -> bool {
        self.chi_squared <= self.limit
    }
}

/// Ids of the points that a solution excludes: at most two.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Excluded([Option<u32>; 2]);

impl Excluded {
    /// Returns the ids.
    pub fn ids(&self) -> impl Iterator<Item = u32> {
        self.0.into_iter().flatten()
    }

    /// Returns whether a point was excluded.
    #[must_use]
    pub fn contains(&self, id: u32) -> bool {
        self.0.contains(&Some(id))
    }
}

/// Why there is no pose. A poor pose is not an error: see [`Solution`].
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EstimateError {
    /// Fewer points than the solver needs.
    #[error("expected at least {need} points, got {got}")]
    TooFewPoints {
        /// Number of points.
        got: usize,
        /// Number of points needed.
        need: usize,
    },
    /// Enough points, but too few of similar precision to check each other.
    #[error(
        "expected at least {need} points of similar sigma, got {precise} of {got}: sigmas above five times the third best are not counted"
    )]
    TooFewPrecisePoints {
        /// Number of points whose sigma is similar to the best ones.
        precise: usize,
        /// Number of points.
        got: usize,
        /// Number of points needed.
        need: usize,
    },
    /// A pixel for which the lens model has no ray.
    #[error("id {id}: {cause}")]
    NoRay {
        /// Its marker id.
        id: u32,
        /// The reason.
        cause: UndistortError,
    },
    /// The points do not determine a pose.
    #[error("expected points that determine a pose, but {reason}")]
    Degenerate {
        /// The reason.
        reason: &'static str,
    },
    /// The solver did not converge.
    #[error("expected the solver to converge, but it did not within {iterations} iterations")]
    NoConvergence {
        /// Iterations of the stage that failed.
        iterations: u16,
    },
    /// The best fit has a marker behind the camera.
    #[error(
        "expected every marker in front of the camera, but the best fit puts id {id} at depth {} m",
        crate::text::digits(*depth_m)
    )]
    BehindCamera {
        /// Its marker id.
        id: u32,
        /// Its depth in the camera frame, m.
        depth_m: f64,
    },
}

impl EstimateError {
    pub(crate) const SAME_RAYS: Self = Self::Degenerate {
        reason: "all of them lie in the same direction",
    };
    pub(crate) const ON_ONE_LINE: Self = Self::Degenerate {
        reason: "their markers lie on one line",
    };
    pub(crate) const SINGULAR: Self = Self::Degenerate {
        reason: "from this view they leave a direction of the pose free",
    };
}
