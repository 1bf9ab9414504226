//! The models `plumb_bob` and `rational_polynomial`.

use nalgebra::{Matrix2, Point2, Vector2};

use super::limits::{MAX_ANGLE, MAX_STRETCH, MIN_STRETCH};
use super::polynomial;
use super::rising::solve_rising;

/// A lens with a radial ratio and a tangential part, with `s = x² + y²`:
/// ```text
/// L  = (1 + k1 s + k2 s² + k3 s³) / (1 + k4 s + k5 s² + k6 s³)
/// x' = L x + 2 p1 x y + p2 (s + 2 x²)
/// y' = L y + p1 (s + 2 y²) + 2 p2 x y
/// ```
///
/// Its derivative is symmetric, hence the Hessian of a potential, and the mapping is one-to-one on any convex region
/// where it is positive definite. The valid region is the largest such disc.
///
/// # Source
/// `OpenCV` `projectPoints`; Brown, *Photogrammetric Engineering* 32(3), 1966.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::camera) struct BrownConrady {
    numerator: [f64; 4],
    denominator: [f64; 4],
    p1: f64,
    p2: f64,
    /// Radius of the valid disc.
    max_radius: f64,
}

impl BrownConrady {
    /// Returns the lens with finite `radial = [k1, ..., k6]` and `tangential = [p1, p2]`.
    pub fn new(radial: [f64; 6], tangential: [f64; 2]) -> Self {
        let [k1, k2, k3, k4, k5, k6] = radial;
        let [p1, p2] = tangential;
        let mut lens = Self {
            numerator: [1.0, k1, k2, k3],
            denominator: [1.0, k4, k5, k6],
            p1,
            p2,
            max_radius: 0.0,
        };
        lens.max_radius = lens.disc_within(lens.radial_limit());
        lens
    }

    /// Returns the lens with its coefficients changed: k1, k2, p1, p2, k3, k4, k5, k6.
    pub fn with_change(&self, by: [f64; 8]) -> Self {
        let [_, k1, k2, k3] = self.numerator;
        let [_, k4, k5, k6] = self.denominator;
        Self::new(
            [
                k1 + by[0],
                k2 + by[1],
                k3 + by[4],
                k4 + by[5],
                k5 + by[6],
                k6 + by[7],
            ],
            [self.p1 + by[2], self.p2 + by[3]],
        )
    }

    /// Returns the derivatives of the distorted point by k1, k2, p1, p2, k3, k4, k5, k6.
    pub fn by_coefficients(&self, ideal: Point2<f64>) -> [Vector2<f64>; 8] {
        let (x, y) = (ideal.x, ideal.y);
        let s = x * x + y * y;
        let inverse = 1.0 / polynomial::evaluate(&self.denominator, s);
        let ratio = polynomial::evaluate(&self.numerator, s) * inverse;
        let up = ideal.coords * inverse;
        let down = -up * ratio;
        [
            up * s,
            up * (s * s),
            Vector2::new(2.0 * x * y, s + 2.0 * y * y),
            Vector2::new(s + 2.0 * x * x, 2.0 * x * y),
            up * (s * s * s),
            down * s,
            down * (s * s),
            down * (s * s * s),
        ]
    }

    /// Returns the first radius at which `d(L r)/dr` falls to [`MIN_STRETCH`] or, on the way up to a pole, rises to
    /// [`MAX_STRETCH`], or at which the denominator has a root; at most that of 89°. All are roots of polynomials in
    /// `s`.
    ///
    /// The size of the denominator is no criterion: calibrations often give a numerator and a denominator that nearly
    /// cancel, both close to 0 where their ratio is close to 1. A pole is a root, and before it the stretch grows
    /// without bound.
    fn radial_limit(&self) -> f64 {
        let (n, d) = (&self.numerator[..], &self.denominator[..]);
        let upper = MAX_ANGLE.tan().powi(2);
        // d(L r)/dr · D² = N D + 2 s (N' D - N D')
        let mut stretch = polynomial::multiply(n, d);
        let up = polynomial::multiply(&polynomial::derivative(n), d);
        let down = polynomial::multiply(n, &polynomial::derivative(d));
        for (power, (up, down)) in up.iter().zip(&down).enumerate() {
            stretch[power + 1] += 2.0 * (up - down);
        }
        let square = polynomial::multiply(d, d);
        let less = |limit: f64| -> Vec<f64> {
            let members = stretch.iter().zip(&square);
            members
                .map(|(value, square)| value - limit * square)
                .collect()
        };
        let mut limits = vec![less(MIN_STRETCH)];
        if self.denominator[1..].iter().any(|&member| member != 0.0) {
            limits.extend([less(MAX_STRETCH), d.to_vec()]);
        }
        limits
            .iter()
            .filter_map(|limit| polynomial::first_sign_change(limit, upper))
            .fold(upper, f64::min)
            .sqrt()
    }

    /// Returns the radius of the largest disc within `limit` on which every stretch is above [`MIN_STRETCH`].
    fn disc_within(&self, limit: f64) -> f64 {
        /// Steps of the search; the condition is smooth, and each point used is checked again anyway.
        const STEPS: u32 = 4096;
        if self.p1 == 0.0 && self.p2 == 0.0 {
            return limit;
        }
        let at = |step: u32| limit * f64::from(step) / f64::from(STEPS);
        // The end itself is at the limit of the radial part, so any tangential part exceeds it.
        match (1..=STEPS).find(|&step| !self.stretches_all_around(at(step))) {
            Some(step) => polynomial::bisect(at(step - 1), at(step), |radius| {
                self.stretches_all_around(radius)
            }),
            None => limit,
        }
    }

    /// Returns whether the derivative's eigenvalues are above [`MIN_STRETCH`] on the whole circle.
    ///
    /// In the basis outwards and along the circle, at the angle `ψ` from `(p2, p1)`, and with
    /// `a = r |(p1, p2)|`, the derivative is `[[g' + 6 a cos ψ, 2 a sin ψ], [2 a sin ψ, L + 2 a cos ψ]]`.
    /// Its determinant is a parabola in `cos ψ`, whose least value over `[-1, 1]` is compared with 0.
    fn stretches_all_around(&self, radius: f64) -> bool {
        let square = radius * radius;
        let (ratio, ratio_by_square) = self.ratio(square);
        let across = ratio + 2.0 * square * ratio_by_square - MIN_STRETCH;
        let along = ratio - MIN_STRETCH;
        let a = radius * self.p1.hypot(self.p2);
        let unfolded = across > 0.0 && along > 0.0; // false for NaN
        if !unfolded {
            return false;
        }
        if across + 3.0 * along >= 16.0 * a {
            across > 6.0 * a && along > 2.0 * a
        } else {
            across * along - 4.0 * a * a - (across + 3.0 * along).powi(2) / 16.0 > 0.0
        }
    }

    /// Returns `L` and `dL/ds`.
    fn ratio(&self, square: f64) -> (f64, f64) {
        let [_, k1, k2, k3] = self.numerator;
        let [_, k4, k5, k6] = self.denominator;
        let denominator = polynomial::evaluate(&self.denominator, square);
        let ratio = polynomial::evaluate(&self.numerator, square) / denominator;
        let up = polynomial::evaluate(&[k1, 2.0 * k2, 3.0 * k3], square);
        let down = polynomial::evaluate(&[k4, 2.0 * k5, 3.0 * k6], square);
        (ratio, (up - ratio * down) / denominator)
    }

    /// Returns the distorted point and its derivative by the ideal one, valid or not.
    fn bend(&self, ideal: Point2<f64>) -> (Point2<f64>, Matrix2<f64>) {
        let (x, y, p1, p2) = (ideal.x, ideal.y, self.p1, self.p2);
        let square = x * x + y * y;
        let (ratio, slope) = self.ratio(square);
        let distorted = Point2::new(
            ratio * x + 2.0 * p1 * x * y + p2 * (square + 2.0 * x * x),
            ratio * y + p1 * (square + 2.0 * y * y) + 2.0 * p2 * x * y,
        );
        let mixed = 2.0 * (slope * x * y + p1 * x + p2 * y);
        let derivative = Matrix2::new(
            ratio + 2.0 * slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x,
            mixed,
            mixed,
            ratio + 2.0 * slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x,
        );
        (distorted, derivative)
    }

    /// Returns the distorted point and its derivative by the ideal one; `None` outside the valid disc.
    pub fn distort(&self, ideal: Point2<f64>) -> Option<(Point2<f64>, Matrix2<f64>)> {
        let valid = ideal.coords.norm_squared() <= self.max_radius * self.max_radius; // false for NaN
        if !valid {
            return None;
        }
        let (distorted, derivative) = self.bend(ideal);
        (derivative.determinant() > 0.0 && derivative.trace() > 0.0)
            .then_some((distorted, derivative))
    }

    /// Returns the ideal point within the valid disc; the caller verifies it.
    ///
    /// The radial part alone gives the start. Newton's method follows, its steps halved until they stay in the disc and
    /// reduce the residual. It ends when no step does: at the solution, if the disc contains it.
    pub fn undistort(&self, distorted: Point2<f64>) -> Option<Point2<f64>> {
        /// Convergence is quadratic: about five steps suffice, more are needed only near the rim.
        const MAX_STEPS: usize = 60;
        /// A step of this many halvings is below rounding.
        const MAX_HALVINGS: usize = 50;
        let radius = distorted.coords.norm();
        if radius == 0.0 {
            return Some(distorted);
        }
        let start = solve_rising(radius, self.max_radius, |radius| {
            let square = radius * radius;
            let (ratio, slope) = self.ratio(square);
            (ratio * radius, ratio + 2.0 * square * slope)
        });
        let mut ideal = distorted * (start / radius).min(self.max_radius / radius);
        let residual_at = |point: Point2<f64>| -> (Vector2<f64>, Matrix2<f64>) {
            let (image, derivative) = self.bend(point);
            (distorted - image, derivative)
        };
        let (mut residual, mut derivative) = residual_at(ideal);
        for _ in 0..MAX_STEPS {
            let full = derivative.try_inverse()? * residual;
            let improved = std::iter::successors(Some(full), |step| Some(step * 0.5))
                .take(MAX_HALVINGS)
                .map(|step| ideal + step)
                .filter(|point| point.coords.norm() <= self.max_radius)
                .map(|point| (point, residual_at(point)))
                .find(|(_, (next, _))| next.norm_squared() < residual.norm_squared());
            let Some((point, next)) = improved else { break };
            ideal = point;
            (residual, derivative) = next;
        }
        Some(ideal)
    }

    /// Returns the distorted radius of the valid disc's rim in the direction of a point.
    pub fn rim_radius(&self, towards: Point2<f64>) -> f64 {
        let outwards = towards.coords.try_normalize(0.0).unwrap_or_else(Vector2::x);
        self.bend(Point2::from(outwards * self.max_radius))
            .0
            .coords
            .norm()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_region_ends_where_the_radius_turns_back() {
        // d(L r)/dr = 1 - 0.9 r² is MIN_STRETCH at this radius.
        let turn = ((1.0 - MIN_STRETCH) / 0.9_f64).sqrt();
        let lens = BrownConrady::new([-0.3, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0; 2]);
        assert!((lens.max_radius - turn).abs() < 1.0e-12);
        // Two stationary radii, of which the first counts: 1 - 5 s + 4 s² at s = 1/4 and 1.
        let lens = BrownConrady::new([-5.0 / 3.0, 0.8, 0.0, 0.0, 0.0, 0.0], [0.0; 2]);
        assert!((lens.max_radius - 0.5).abs() < MIN_STRETCH);
    }

    #[test]
    fn a_rising_radius_is_valid_to_89_degrees() {
        let lens = BrownConrady::new([-0.3, 0.1, 0.0, 0.0, 0.0, 0.0], [0.0; 2]);
        assert!((lens.max_radius - 89.0_f64.to_radians().tan()).abs() < 1.0e-9);
    }

    #[test]
    fn the_region_ends_before_a_pole() {
        // L r = r / (1 - s) has the slope (1 + s) / (1 - s)², and its pole at 1.
        let lens = BrownConrady::new([0.0, 0.0, 0.0, -1.0, 0.0, 0.0], [0.0; 2]);
        let square = lens.max_radius * lens.max_radius;
        let slope = (1.0 + square) / (1.0 - square).powi(2);
        assert!(
            square < 1.0 && (slope - MAX_STRETCH).abs() < 1.0e-9,
            "{square}"
        );
    }

    #[test]
    fn a_pole_that_a_root_of_the_numerator_nearly_cancels_still_ends_the_region() {
        // The pole is at s = 0.25; its residue is so small that the ratio is 1 nearly everywhere.
        let numerator = -1.0 / 0.250_000_1;
        let lens = BrownConrady::new([numerator, 0.0, 0.0, -4.0, 0.0, 0.0], [0.0; 2]);
        assert!(
            lens.max_radius < 0.5 && lens.max_radius > 0.49,
            "{}",
            lens.max_radius
        );
        let beyond = Point2::new(0.6 * lens.ratio(0.36).0, 0.0);
        let ray = lens.undistort(beyond).and_then(|ideal| lens.distort(ideal));
        assert!(
            ray.is_none_or(|(back, _)| (back - beyond).norm() > 1.0e-6),
            "{ray:?}"
        );
    }

    #[test]
    fn a_small_denominator_without_a_root_ends_nothing() {
        // A real calibration: both go down to 0.002, their ratio stays within 0.9 and 1.1.
        let radial = [
            -13.238_113,
            -98.012_135,
            1_357.782_415,
            -13.050_801,
            -102.363_353,
            1_383.055_291,
        ];
        let lens = BrownConrady::new(radial, [0.001_444, 0.002_849]);
        assert!(lens.max_radius > 0.6, "{}", lens.max_radius);
    }

    #[test]
    fn a_tangential_part_alone_is_valid_up_to_its_own_fold() {
        // Straight against (p2, p1) the stretches are 1 - 6 a and 1 - 2 a; 4 > 16 a there, so it is the worst.
        let limit = (1.0 - MIN_STRETCH) / 6.0 / 0.01;
        let lens = BrownConrady::new([0.0; 6], [0.01, 0.0]);
        assert!(
            (lens.max_radius - limit).abs() < 1.0e-9,
            "{}",
            lens.max_radius
        );
    }

    proptest! {
        /// The claim behind "one-to-one": positive definite everywhere in the disc, to rounding.
        #[test]
        fn every_stretch_in_the_disc_is_above_the_limit(
            radial in prop::array::uniform6(-1.0_f64..1.0),
            tangential in prop::array::uniform2(-0.1_f64..0.1),
            part in 0.0_f64..1.0,
            angle in 0.0_f64..std::f64::consts::TAU,
        ) {
            let lens = BrownConrady::new(radial, tangential);
            let radius = part * lens.max_radius;
            let (_, derivative) = lens.bend(Point2::new(radius * angle.cos(), radius * angle.sin()));
            let eigenvalues = derivative.symmetric_eigenvalues();
            prop_assert!(eigenvalues.min() > MIN_STRETCH * 0.999, "{} at {}", eigenvalues.min(), radius);
        }

        /// And it is the largest such disc: just outside, some direction falls below the limit.
        #[test]
        fn beyond_the_disc_some_stretch_is_below_the_limit(
            radial in prop::array::uniform3(-1.0_f64..1.0),
            tangential in prop::array::uniform2(-0.1_f64..0.1),
        ) {
            let lens = BrownConrady::new([radial[0], radial[1], radial[2], 0.0, 0.0, 0.0], tangential);
            prop_assume!(lens.max_radius < 57.0);
            let radius = 1.001 * lens.max_radius;
            let least = (0..3600)
                .map(|tenth| f64::from(tenth).to_radians() / 10.0)
                .map(|angle| lens.bend(Point2::new(radius * angle.cos(), radius * angle.sin())).1)
                .map(|derivative| derivative.symmetric_eigenvalues().min())
                .fold(f64::INFINITY, f64::min);
            prop_assert!(least < MIN_STRETCH * 1.001, "{} at {}", least, radius);
        }
    }
}
