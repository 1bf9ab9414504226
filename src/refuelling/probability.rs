//! Probability of a region under a normal distribution: two integrals by quadrature, one in closed form.
//!
//! With `Σ = L Lᵀ` and `r = m + L u`, `u` is white. Along `u₂` the region is an interval, whose probability is a
//! difference of two error functions; along `u₁` and `u₀` an adaptive Gauss-Kronrod rule integrates. Where the
//! conditional mean crosses the border, the integrand has a step as wide as the remaining spread, so the range is split
//! there and on both sides of it.

use nalgebra::{Matrix3, Vector3};
use statrs::function::erf::erfc;

/// Standard deviations; the probability beyond is below 1e-18.
const REACH: f64 = 9.0;
/// Absolute tolerance of the outer integral; that of the inner one is a tenth of it.
const TOLERANCE: f64 = 1e-6;
/// Largest number of bisections of a range.
const MAX_DEPTH: u32 = 16;
/// The middle, and three for each of four crossings.
const CUTS: usize = 13;
/// The step where the conditional mean crosses a border ends within this many sigmas.
const STEP_SIGMAS: f64 = 6.0;
/// Standard deviations; a wider step is resolved without a split.
const WIDE_STEP: f64 = 1.0;
/// m; least uncertainty of a position, so that every covariance can be factored.
const LEAST_SIGMA_M: f64 = 1e-6;

/// A region's section across x.
#[derive(Debug, Clone, Copy)]
pub(super) enum Section {
    Rectangle { y_m: (f64, f64), z_m: (f64, f64) },
    Disc { radius_m: f64 },
}

impl Section {
    fn y_m(self) -> (f64, f64) {
        match self {
            Self::Rectangle { y_m, .. } => y_m,
            Self::Disc { radius_m } => (-radius_m, radius_m),
        }
    }

    /// Returns the extent along z of the section at `y`.
    fn z_at_m(self, y: f64) -> (f64, f64) {
        match self {
            Self::Rectangle { z_m, .. } => z_m,
            Self::Disc { radius_m } => {
                let half = (radius_m * radius_m - y * y).max(0.0).sqrt();
                (-half, half)
            }
        }
    }

    /// Returns where the line `start + u direction` in (y, z) crosses the border, and its rate there; NaN where it does
    /// not.
    fn crossings(self, start: [f64; 2], direction: [f64; 2]) -> [(f64, f64); 4] {
        match self {
            Self::Rectangle { y_m, z_m } => {
                let cross = |limit: f64, axis: usize| {
                    let speed = direction[axis];
                    ((limit - start[axis]) / speed, speed.abs())
                };
                [
                    cross(y_m.0, 0),
                    cross(y_m.1, 0),
                    cross(z_m.0, 1),
                    cross(z_m.1, 1),
                ]
            }
            Self::Disc { radius_m } => {
                let dot = |a: [f64; 2], b: [f64; 2]| a[0] * b[0] + a[1] * b[1];
                let (a, b) = (dot(direction, direction), dot(start, direction));
                // NaN if the line misses the circle.
                let root = (b * b - a * (dot(start, start) - radius_m * radius_m)).sqrt();
                let speed = root / radius_m;
                let none = (f64::NAN, f64::NAN);
                [
                    ((-b - root) / a, speed),
                    ((-b + root) / a, speed),
                    none,
                    none,
                ]
            }
        }
    }

    /// Returns where to split the range of `u`, for a spread of `spread_m` about the line.
    fn cuts(self, start: [f64; 2], direction: [f64; 2], spread_m: f64) -> [f64; CUTS] {
        let mut cuts = [f64::NAN; CUTS];
        cuts[0] = 0.0;
        for (i, (at, speed)) in self.crossings(start, direction).into_iter().enumerate() {
            cuts[1 + 3 * i] = at;
            let width = STEP_SIGMAS * spread_m / speed;
            if width < WIDE_STEP {
                cuts[2 + 3 * i] = at - width;
                cuts[3 + 3 * i] = at + width;
            }
        }
        cuts
    }
}

/// Returns the probability of a position inside `x_m` and the section; NaN for an invalid covariance.
pub(super) fn region_probability(
    x_m: (f64, f64),
    section: Section,
    mean: &Vector3<f64>,
    covariance: &Matrix3<f64>,
) -> f64 {
    let widened = covariance + Matrix3::identity() * LEAST_SIGMA_M * LEAST_SIGMA_M;
    let Some(factor) = widened.cholesky() else {
        return f64::NAN;
    };
    if !mean.iter().all(|value| value.is_finite()) {
        return f64::NAN;
    }
    let l = factor.l();
    let within = |(low, high): (f64, f64), middle: f64, sigma: f64| {
        let clip = |limit: f64| ((limit - middle) / sigma).clamp(-REACH, REACH);
        (clip(low), clip(high))
    };
    let along_x = |u0: f64| {
        let y_middle = mean.y + l[(1, 0)] * u0;
        let z_middle = mean.z + l[(2, 0)] * u0;
        let along_y = |u1: f64| {
            let middle = z_middle + l[(2, 1)] * u1;
            let (low, high) = section.z_at_m(y_middle + l[(1, 1)] * u1);
            let share = normal_between((low - middle) / l[(2, 2)], (high - middle) / l[(2, 2)]);
            density(u1) * share
        };
        let range = within(section.y_m(), y_middle, l[(1, 1)]);
        let cuts = section.cuts([y_middle, z_middle], [l[(1, 1)], l[(2, 1)]], l[(2, 2)]);
        density(u0) * integrate_cut(&along_y, range, &cuts, TOLERANCE / 10.0)
    };
    let spread_m = (l[(1, 1)].powi(2) + l[(2, 1)].powi(2) + l[(2, 2)].powi(2)).sqrt();
    let cuts = section.cuts([mean.y, mean.z], [l[(1, 0)], l[(2, 0)]], spread_m);
    let range = within(x_m, mean.x, l[(0, 0)]);
    integrate_cut(&along_x, range, &cuts, TOLERANCE).clamp(0.0, 1.0)
}

fn density(u: f64) -> f64 {
    (-0.5 * u * u).exp() / std::f64::consts::TAU.sqrt()
}

/// Returns the probability of the standard normal distribution between two limits.
fn normal_between(low: f64, high: f64) -> f64 {
    // Computed in the tail on the side of both limits, so that small probabilities are not differences of ones.
    let tail = |u: f64| 0.5 * erfc(u * std::f64::consts::FRAC_1_SQRT_2);
    let share = if low > 0.0 {
        tail(low) - tail(high)
    } else {
        tail(-high) - tail(-low)
    };
    share.max(0.0)
}

/// Returns the integral over a range, split at those of `cuts` that are inside.
fn integrate_cut(
    f: &dyn Fn(f64) -> f64,
    (low, high): (f64, f64),
    cuts: &[f64; CUTS],
    tolerance: f64,
) -> f64 {
    if low >= high {
        return 0.0;
    }
    let mut cuts = *cuts;
    cuts.sort_unstable_by(f64::total_cmp);
    let mut sum = 0.0;
    let mut from = low;
    // Comparisons with NaN are false.
    for to in cuts.into_iter().filter(|&cut| cut > low && cut < high) {
        sum += integrate(f, from, to, tolerance, MAX_DEPTH);
        from = to;
    }
    sum + integrate(f, from, high, tolerance, MAX_DEPTH)
}

fn integrate(f: &dyn Fn(f64) -> f64, low: f64, high: f64, tolerance: f64, depth: u32) -> f64 {
    let (value, error) = gauss_kronrod(f, low, high);
    if error <= tolerance || depth == 0 {
        return value;
    }
    let middle = f64::midpoint(low, high);
    let half = tolerance / 2.0;
    integrate(f, low, middle, half, depth - 1) + integrate(f, middle, high, half, depth - 1)
}

/// Abscissae of the 15-point Kronrod rule; every second one belongs to the 7-point Gauss rule too.
const NODES: [f64; 8] = [
    0.991_455_371_120_812_6,
    0.949_107_912_342_758_5,
    0.864_864_423_359_769_1,
    0.741_531_185_599_394_4,
    0.586_087_235_467_691_1,
    0.405_845_151_377_397_2,
    0.207_784_955_007_898_47,
    0.0,
];
const KRONROD: [f64; 8] = [
    0.022_935_322_010_529_224,
    0.063_092_092_629_978_55,
    0.104_790_010_322_250_18,
    0.140_653_259_715_525_92,
    0.169_004_726_639_267_9,
    0.190_350_578_064_785_4,
    0.204_432_940_075_298_9,
    0.209_482_141_084_727_83,
];
const GAUSS: [f64; 4] = [
    0.129_484_966_168_869_7,
    0.279_705_391_489_276_64,
    0.381_830_050_505_118_9,
    0.417_959_183_673_469_4,
];

/// Returns the integral and a bound of its error.
///
/// # Source
/// The rule of QUADPACK (Piessens et al., 1983).
fn gauss_kronrod(f: &dyn Fn(f64) -> f64, low: f64, high: f64) -> (f64, f64) {
    let (middle, half) = (f64::midpoint(low, high), 0.5 * (high - low));
    let (mut fine, mut coarse) = (0.0, 0.0);
    for (i, node) in NODES.iter().enumerate() {
        let value = if i == 7 {
            f(middle)
        } else {
            f(middle - half * node) + f(middle + half * node)
        };
        fine += KRONROD[i] * value;
        if i % 2 == 1 {
            coarse += GAUSS[i / 2] * value;
        }
    }
    (fine * half, ((fine - coarse) * half).abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rules_are_exact_for_polynomials_of_their_degree() {
        for degree in 0..=22 {
            let (value, error) = gauss_kronrod(&|x| x.powi(degree), 0.0, 1.0);
            let expected = 1.0 / f64::from(degree + 1);
            assert!((value - expected).abs() < 1e-15, "{degree}: {value}");
            if degree <= 13 {
                assert!(error < 1e-15, "{degree}: {error:e}");
            }
        }
    }

    #[test]
    fn a_step_is_found_by_halving() {
        let step = |x: f64| f64::from(x > 0.123_456);
        let value = integrate(&step, 0.0, 1.0, 1e-6, 30);
        assert!((value - 0.876_544).abs() < 1e-6);
    }
}
