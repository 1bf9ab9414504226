//! The fisheye model `equidistant`.

use nalgebra::{Matrix2, Point2, Vector2};

use super::limits::{MAX_ANGLE, MIN_STRETCH};
use super::polynomial;
use super::rising::solve_rising;

/// Below this radius the distortion is the identity to rounding: its next term is of second order.
const CENTRE_RADIUS: f64 = 1.0e-9;

/// A lens whose image radius is a polynomial of the angle off the axis:
/// `θ_d = θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸)`, with `θ = atan r`.
///
/// # Source
/// `OpenCV` `fisheye::projectPoints`; Kannala and Brandt, *PAMI* 28(8), 2006, Eq. (6).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::camera) struct Equidistant {
    k: [f64; 4],
    /// Widest valid angle off the axis, rad.
    max_angle: f64,
    /// Its tangent: radius of the valid disc.
    max_radius: f64,
}

impl Equidistant {
    /// Returns the lens with finite `k = [k1, k2, k3, k4]`.
    ///
    /// It is valid up to the first angle at which `dθ_d/dθ` falls to [`MIN_STRETCH`], at most to 89°.
    pub fn new(k: [f64; 4]) -> Self {
        let [k1, k2, k3, k4] = k;
        let slope = [1.0 - MIN_STRETCH, 3.0 * k1, 5.0 * k2, 7.0 * k3, 9.0 * k4];
        let max_angle = polynomial::first_sign_change(&slope, MAX_ANGLE * MAX_ANGLE)
            .map_or(MAX_ANGLE, f64::sqrt);
        Self {
            k,
            max_angle,
            max_radius: max_angle.tan(),
        }
    }

    /// Returns the lens with k1 to k4 changed; the remaining entries are ignored.
    pub fn with_change(&self, by: [f64; 8]) -> Self {
        Self::new(std::array::from_fn(|index| self.k[index] + by[index]))
    }

    /// Returns the derivatives of the distorted point by k1 to k4, then zeros.
    pub fn by_coefficients(ideal: Point2<f64>) -> [Vector2<f64>; 8] {
        let radius = ideal.coords.norm();
        let angle = radius.atan();
        let outwards = if radius < CENTRE_RADIUS {
            Vector2::zeros()
        } else {
            ideal.coords / radius
        };
        let mut power = angle;
        let mut columns = [Vector2::zeros(); 8];
        for column in columns.iter_mut().take(4) {
            power *= angle * angle;
            *column = outwards * power;
        }
        columns
    }

    /// Returns `θ_d` and `dθ_d/dθ`.
    fn bend(&self, angle: f64) -> (f64, f64) {
        let [k1, k2, k3, k4] = self.k;
        let t = angle * angle;
        let value = angle * polynomial::evaluate(&[1.0, k1, k2, k3, k4], t);
        let slope = polynomial::evaluate(&[1.0, 3.0 * k1, 5.0 * k2, 7.0 * k3, 9.0 * k4], t);
        (value, slope)
    }

    /// Returns the distorted point and its derivative by the ideal one; `None` outside the valid disc.
    ///
    /// With `n` the direction outwards the derivative is `h 1 + (g' - h) n nᵀ`: `h = θ_d / r` along
    /// the circle, `g' = dθ_d/dr` across it.
    pub fn distort(&self, ideal: Point2<f64>) -> Option<(Point2<f64>, Matrix2<f64>)> {
        let radius = ideal.coords.norm();
        if radius < CENTRE_RADIUS {
            return Some((ideal, Matrix2::identity()));
        }
        let valid = radius <= self.max_radius; // false for NaN
        if !valid {
            return None;
        }
        let (bent, slope) = self.bend(radius.atan());
        let along = bent / radius;
        let across = slope / (1.0 + radius * radius);
        let outwards: Vector2<f64> = ideal.coords / radius;
        let derivative = Matrix2::from_diagonal_element(along)
            + (across - along) * outwards * outwards.transpose();
        Some((ideal * along, derivative))
    }

    /// Returns the ideal point within the valid disc; the caller verifies it.
    pub fn undistort(&self, distorted: Point2<f64>) -> Option<Point2<f64>> {
        let bent = distorted.coords.norm();
        if bent < CENTRE_RADIUS {
            return Some(distorted);
        }
        if bent > self.rim_radius() {
            return None;
        }
        let angle = solve_rising(bent, self.max_angle, |angle| self.bend(angle));
        Some(distorted * (angle.tan() / bent))
    }

    /// Returns the distorted radius of the valid disc's rim, the same in all directions.
    pub fn rim_radius(&self) -> f64 {
        self.bend(self.max_angle).0
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_4;

    use super::*;

    #[test]
    fn without_coefficients_the_lens_is_still_a_fisheye_and_valid_to_89_degrees() {
        let lens = Equidistant::new([0.0; 4]);
        let (distorted, _) = lens
            .distort(Point2::new(1.0, 0.0))
            .expect("45° off the axis");
        assert!((distorted.x - FRAC_PI_4).abs() < 1.0e-15);
        assert!(
            lens.distort(Point2::new(88.9_f64.to_radians().tan(), 0.0))
                .is_some()
        );
        assert_eq!(
            lens.distort(Point2::new(89.1_f64.to_radians().tan(), 0.0)),
            None
        );
        assert!(
            lens.undistort(Point2::new(0.0, 88.9_f64.to_radians()))
                .is_some()
        );
        assert_eq!(
            lens.undistort(Point2::new(0.0, 89.1_f64.to_radians())),
            None
        );
    }

    #[test]
    fn the_region_ends_where_the_angle_turns_back() {
        // dθ_d/dθ = 1 - 0.6 θ² is MIN_STRETCH at this angle.
        let turn = ((1.0 - MIN_STRETCH) / 0.6_f64).sqrt();
        let lens = Equidistant::new([-0.2, 0.0, 0.0, 0.0]);
        assert!((lens.max_angle - turn).abs() < 1.0e-12);
    }
}
