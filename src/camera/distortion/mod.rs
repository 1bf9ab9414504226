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
mod polynomial;

use nalgebra::{Matrix2, Point2};

pub(super) use brown_conrady::BrownConrady;
pub(super) use equidistant::Equidistant;

/// Least stretch at which a lens model still counts as valid, as a part of that in the image centre.
///
/// At the turning point the stretch is 0 and the ray of a pixel undetermined. Here a ray is a thousand
/// times as uncertain as in the centre and the inverse has lost three of its sixteen digits. The disc
/// to this limit is about a thousandth smaller than that to the turning point.
const MIN_STRETCH: f64 = 1.0e-3;

/// Largest radial stretch at which a rational lens model still counts as valid, as a part of that in the image centre.
///
/// Lenses stay within a factor of three or so. More is the way up to a pole of a rational model, on which all of the
/// plane beyond the image is squeezed into a thin ring of rays.
const MAX_STRETCH: f64 = 10.0;

/// Widest angle off the axis, rad: near 90° a ray leaves the plane `z = 1`.
const MAX_ANGLE: f64 = 89.0 * std::f64::consts::PI / 180.0;

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
    /// Returns the distorted point and its derivative by the ideal one; none outside the valid disc.
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

/// Returns the `x` in `[0, upper]` where a rising function meets a target, by Newton kept in a bracket.
///
/// `function` gives value and slope, with value 0 at 0; a target beyond the value at `upper` gives
/// `upper`. Ends after a bounded number of steps whatever the function does.
fn solve_rising(target: f64, upper: f64, function: impl Fn(f64) -> (f64, f64)) -> f64 {
    /// Bisection alone needs about 60 from any bracket.
    const MAX_STEPS: usize = 120;
    let (mut low, mut high) = (0.0, upper);
    let mut x = target.min(upper);
    for _ in 0..MAX_STEPS {
        let (value, slope) = function(x);
        if value < target {
            low = x;
        } else {
            high = x;
        }
        let newton = x - (value - target) / slope;
        // A step out of the bracket, or NaN, becomes a bisection.
        let next = if newton >= low && newton <= high {
            newton
        } else {
            f64::midpoint(low, high)
        };
        if (next - x).abs() <= f64::EPSILON * x {
            return next;
        }
        x = next;
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rising_function_is_solved_whatever_its_slope_says() {
        let cube = |x: f64| (x * x * x, 3.0 * x * x);
        let lying = |x: f64| (x * x * x, -1.0);
        let silent = |x: f64| (x * x * x, f64::NAN);
        assert!((solve_rising(8.0, 10.0, cube) - 2.0).abs() < 1.0e-14);
        assert!((solve_rising(8.0, 10.0, lying) - 2.0).abs() < 1.0e-14);
        assert!((solve_rising(8.0, 10.0, silent) - 2.0).abs() < 1.0e-14);
        assert!((solve_rising(2000.0, 10.0, cube) - 10.0).abs() < 1.0e-14);
        assert!(solve_rising(0.0, 10.0, cube).abs() < 1.0e-14);
    }
}
