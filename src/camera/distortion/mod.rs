//! Lens models: the mapping from ideal to distorted points on the plane `z = 1`, and its inverse.
//!
//! Every model has a valid region, a disc of ideal points that is determined once at construction and on which the
//! mapping is one-to-one. Both directions refuse points outside. A calibrated polynomial is meaningless beyond its
//! turning point, where a second ray falls on the same pixel.
//!
//! The formulas are those of `OpenCV` (`projectPoints`, `fisheye::projectPoints`), which ROS's
//! `distortion_model` names refer to.

mod brown_conrady;
mod equidistant;
mod limits;
mod polynomial;
mod rising;

use nalgebra::{Matrix2, Point2};

pub(super) use brown_conrady::BrownConrady;
pub(super) use equidistant::Equidistant;

/// Largest residual of an accepted inverse on the plane `z = 1`; relative for radii above 1.
const MAX_RESIDUAL: f64 = 1.0e-12;

/// Two radii that explain why a distorted point has no ideal one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Outside {
    /// Radius of the distorted point.
    pub radius: f64,
    /// Radius of the valid disc's rim in the same direction, distorted.
    pub max_radius: f64,
}

/// A lens model with coefficients.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Lens {
    /// `plumb_bob` and `rational_polynomial`.
    BrownConrady(BrownConrady),
    /// `equidistant`: fisheye.
    Equidistant(Equidistant),
}

impl Lens {
    /// Returns the distorted point and its derivative by the ideal one; `None` outside the valid disc.
    pub fn distort(&self, ideal: Point2<f64>) -> Option<(Point2<f64>, Matrix2<f64>)> {
        match self {
            Self::BrownConrady(lens) => lens.distort(ideal),
            Self::Equidistant(lens) => lens.distort(ideal),
        }
    }

    /// Returns the ideal point of a finite distorted one.
    ///
    /// # Errors
    /// [`Outside`] if no point of the valid disc is distorted to it.
    pub fn undistort(&self, distorted: Point2<f64>) -> Result<Point2<f64>, Outside> {
        let (found, max_radius) = match self {
            Self::BrownConrady(lens) => (lens.undistort(distorted), lens.rim_radius(distorted)),
            Self::Equidistant(lens) => (lens.undistort(distorted), lens.rim_radius()),
        };
        let radius = distorted.coords.norm();
        // Verified independently of the solver: inside the disc, and distorted back to the input.
        found
            .filter(|&ideal| {
                self.distort(ideal).is_some_and(|(back, _)| {
                    (back - distorted).norm() <= MAX_RESIDUAL * radius.max(1.0)
                })
            })
            .ok_or(Outside { radius, max_radius })
    }
}
