//! Lens models: an ideal point on the plane `z = 1` <-> where the lens puts it on that plane.
//!
//! Every model comes with its valid region, a disc of ideal points found once at construction, on
//! which it is one-to-one: both directions refuse what lies outside. A calibrated polynomial means
//! nothing beyond its turning point, where a second ray falls on the same pixel.
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

/// Largest residual of an accepted inverse, on the plane `z = 1`, relative beyond radius 1.
const MAX_RESIDUAL: f64 = 1.0e-12;

/// A pair of radii that tells why a distorted point has no ideal one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Outside {
    /// Radius of the distorted point.
    pub radius: f64,
    /// Radius of the image of the valid disc's rim in the same direction.
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
        // Verified whatever the solver did: inside the disc, and distorted back to where it came from.
        found
            .filter(|&ideal| {
                self.distort(ideal).is_some_and(|(back, _)| {
                    (back - distorted).norm() <= MAX_RESIDUAL * radius.max(1.0)
                })
            })
            .ok_or(Outside { radius, max_radius })
    }
}
