//! A pose from known markers: pixels have been checked, a pose has not yet become a track.
//!
//! Knows `geometry` and `camera`; never a clock, a file, a topic or the last frame (the last attitude
//! is an argument). One frame goes straight through:
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
mod collinearity;
mod covariance;
mod estimator;
mod exclude;
mod initialise;
mod lanes;
mod newton;
mod orthogonal_iteration;
mod problem;
mod refine;
mod residuals;
mod trust;
mod widen;

use nalgebra::{Isometry3, Point3, Rotation3, Vector2};

use crate::camera::{Camera, Pixel, Ray, UndistortError};
use crate::geometry::PoseCovariance;

pub use budget::{
    BudgetError, CalibrationMode, Cause, CauseKind, CorrelatedNoise, CorrelatedNoiseError,
    ErrorBudget, FlexMode, FrameCauses,
};
pub use estimator::Estimator;
pub(crate) use estimator::PRIOR_SIGMA;
pub use initialise::linear_rotation;
pub use orthogonal_iteration::{Iterated, fixed_point, iterate_accelerated, iterate_literally};

/// Where the iteration starts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Initialisation {
    /// `In_M2`: the nominal attitude. At least 3 points.
    Nominal,
    /// `In_M1`: the linear camera matrix. At least 6 points, not in one plane.
    Dlt,
    /// The last trusted attitude, or the nominal one where there is none or it gives no pose. At least 3 points.
    Previous,
    /// No prior: the best of all attitudes. At least 4 points.
    Global,
}

impl Initialisation {
    /// Returns how many points this start needs.
    #[must_use]
    pub fn min_points(self) -> usize {
        match self {
            Self::Nominal | Self::Previous => 3,
            Self::Global => 4,
            Self::Dlt => 6,
        }
    }
}

/// Which estimate is wanted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Refinement {
    /// The pose with the least squared pixel residuals over their variances.
    MaximumLikelihood,
    /// The paper's: the converged orthogonal iteration as it is.
    None,
}

/// How a pose is found and judged.
#[derive(Debug, Clone, PartialEq)]
pub struct EstimatorSettings {
    /// Where the iteration starts.
    pub initialisation: Initialisation,
    /// Which estimate is wanted.
    pub refinement: Refinement,
    /// Rotation part of the expected `camera_from_tanker`.
    pub nominal_camera_from_tanker: Rotation3<f64>,
    /// Fewer points give no pose, nor do fewer whose sigma is at most five times that of the third
    /// best; the initialisation may need more. From 5 on no sigma counts as less than half of that of the
    /// point at this place, best first.
    pub min_points: usize,
    /// At most this many points may be excluded as wrong, 0 to 2.
    pub max_outliers: usize,
    /// Probability with which a correct frame passes the chi-squared test, 0 to 1.
    pub trust_probability: f64,
    /// A rival pose at least this likely means refusal, 0 to 1; 1 or more: never.
    pub max_ambiguity: f64,
    /// Standard deviation of the attitude about the nominal one, each axis, rad; `None`: nothing is known of it.
    pub attitude_sigma_rad: Option<f64>,
}

impl Default for EstimatorSettings {
    /// The node's: aligned airframes, a camera that looks straight ahead, maximum likelihood; of five points or
    /// more one may be wrong, and no second pose may come near. A test holds the table of parameters to it.
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
        }
    }
}

/// One marker as an image shows it. Values are checked by the caller: finite, `sigma_px > 0`, ids unique.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observation {
    /// Marker id, for naming the point.
    pub id: u32,
    /// Where the marker sits, tanker frame, m.
    pub marker_in_tanker: Point3<f64>,
    /// Where the image shows it.
    pub pixel: Pixel,
    /// Standard deviation of column and of row, px.
    pub sigma_px: f64,
}

impl Observation {
    /// Returns predicted minus seen pixel, px; `None` where the marker has no pixel at this pose.
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
        let (pixel, _) = camera.project(Ray {
            x: q.x / q.z,
            y: q.y / q.z,
        })?;
        Some(Vector2::new(pixel.u - self.pixel.u, pixel.v - self.pixel.v))
    }
}

/// A pose with all that is needed to judge it.
#[derive(Debug, Clone, PartialEq)]
pub struct Solution {
    /// The tanker's pose in the camera optical frame.
    pub camera_from_tanker: Isometry3<f64>,
    /// Covariance of that pose, from the given sigmas, never from the residuals.
    pub covariance: PoseCovariance,
    /// Root mean square over all columns and rows of the used points' residuals, px.
    pub rms_px: f64,
    /// Sum of the squared residuals over their variances.
    pub chi_squared: f64,
    /// Of `chi_squared`: `2 n − 6`.
    pub degrees_of_freedom: u16,
    /// The largest `chi_squared` to trust.
    pub chi_squared_limit: f64,
    /// Of all solver stages together, but for descents that were given up.
    pub iterations: u16,
    /// Where the iteration really started.
    pub initialisation: Initialisation,
    /// Likelihood of the best rival pose in front of the camera over that of this one, at most 1; 0: no
    /// rival. From the image alone, whatever the prior says.
    pub ambiguity: f64,
    /// Points left out as wrong.
    pub excluded: Excluded,
    /// `chi_squared` of the fit of all points, before any were left out; infinite where they had none.
    pub chi_squared_of_all: f64,
    /// Two points of which either may be wrong; empty unless one is and it is not clear which.
    pub unclear: Excluded,
}

impl Solution {
    /// Returns predicted minus seen pixel, px; `None` where the marker has no pixel at this pose.
    #[must_use]
    pub fn residual_px(&self, camera: &Camera, seen: &Observation) -> Option<Vector2<f64>> {
        seen.residual_px(camera, &self.camera_from_tanker)
    }

    /// Returns chi-squared of the fit of all points with its degrees of freedom, whether or not any were left out.
    #[must_use]
    pub fn of_all_points(&self) -> (f64, u16) {
        let left_out = u16::try_from(self.excluded.ids().count()).unwrap_or(0);
        let degrees_of_freedom = self.degrees_of_freedom.saturating_add(2 * left_out);
        (self.chi_squared_of_all, degrees_of_freedom)
    }

    /// Returns whether the residuals are as small as the sigmas promise.
    #[must_use]
    pub fn is_trusted(&self) -> bool {
        self.chi_squared <= self.chi_squared_limit
    }
}

/// Ids of the points that a solution leaves out: none, one or two.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Excluded([Option<u32>; 2]);

impl Excluded {
    /// Returns the ids.
    pub fn ids(&self) -> impl Iterator<Item = u32> {
        self.0.into_iter().flatten()
    }

    /// Returns whether a point was left out.
    #[must_use]
    pub fn contains(&self, id: u32) -> bool {
        self.0.contains(&Some(id))
    }
}

/// Why no pose can be given. A poor pose is not an error: see [`Solution`].
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EstimateError {
    /// Fewer points than the solver needs.
    #[error("expected at least {need} points, got {got}")]
    TooFewPoints {
        /// Points at hand.
        got: usize,
        /// Points needed.
        need: usize,
    },
    /// Enough points, but too few that are precise enough to check each other.
    #[error(
        "expected at least {need} points of similar sigma, got {precise} of {got}: sigmas above five times the third best check nothing"
    )]
    TooFewPrecisePoints {
        /// Points whose sigma is near that of the best.
        precise: usize,
        /// Points at hand.
        got: usize,
        /// Points needed.
        need: usize,
    },
    /// A pixel that the lens model cannot turn into a ray.
    #[error("id {id}: {cause}")]
    NoRay {
        /// Its marker id.
        id: u32,
        /// Why.
        cause: UndistortError,
    },
    /// The points cannot fix a pose.
    #[error("expected points that determine a pose, but {reason}")]
    Degenerate {
        /// What is wrong with them.
        reason: &'static str,
    },
    /// No minimum found.
    #[error("expected the solver to converge, but it did not within {iterations} iterations")]
    NoConvergence {
        /// Iterations of the stage that gave up.
        iterations: u16,
    },
    /// The best fit puts a marker behind the lens.
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
