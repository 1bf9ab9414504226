//! The tail of the standard normal distribution, and its inverse.

use libm::erfc;
use statrs::function::erf::erfc_inv;

/// Returns `Q(x)`, the probability that a standard normal variable exceeds `x`.
pub(super) fn tail(x: f64) -> f64 {
    0.5 * erfc(x * std::f64::consts::FRAC_1_SQRT_2)
}

/// Returns `Q⁻¹(p)`; infinite for 0 and below, negatively infinite for 1 and above.
pub(super) fn tail_inverse(probability: f64) -> f64 {
    if probability <= 0.0 {
        return f64::INFINITY;
    }
    if probability >= 1.0 {
        return f64::NEG_INFINITY;
    }
    let x = std::f64::consts::SQRT_2 * erfc_inv(2.0 * probability);
    // One step of Newton's method: to the last digits where the approximation is not. The tail itself is that of libm,
    // since that of statrs is right to eleven digits only.
    let density = (-0.5 * x * x).exp() / std::f64::consts::TAU.sqrt();
    let refined = x + (tail(x) - probability) / density;
    if refined.is_finite() { refined } else { x }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tail_and_inverse_agree_with_printed_tables() {
        // Abramowitz, Stegun, table 26.1 and 26.2, and scipy.stats.norm.isf.
        for (x, probability) in [
            (0.0, 0.5),
            (1.0, 0.158_655_253_931_457_05),
            (3.090_232_306_167_813, 1e-3),
            (5.199_337_582_192_817, 1e-7),
            (6.361_340_902_404_056, 1e-10),
        ] {
            assert!((tail(x) / probability - 1.0).abs() < 1e-12, "{x}");
            assert!(
                (tail_inverse(probability) - x).abs() < 1e-12,
                "{probability}"
            );
        }
        let is_infinite = |x: f64, sign: f64| x.is_infinite() && x * sign > 0.0;
        assert!(is_infinite(tail_inverse(0.0), 1.0));
        assert!(is_infinite(tail_inverse(1.0), -1.0));
        assert!((tail_inverse(0.9) + tail_inverse(0.1)).abs() < 1e-15);
    }
}
