//! Limits of the chi-squared test that decides whether a frame is trusted.

use statrs::distribution::{ChiSquared, ContinuousCDF, Normal};

/// Degrees of freedom with a tabulated limit; beyond them an approximation is as good.
const TABULATED: usize = 256;

/// The largest chi-squared that passes, by degrees of freedom, at one probability.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct TrustLimits {
    /// The limit of a standard normal variable at the same probability.
    normal: f64,
    tabulated: Vec<f64>,
}

impl TrustLimits {
    /// Returns the limits that a frame with correct sigmas passes with the given probability.
    pub(crate) fn new(probability: f64) -> Self {
        Self {
            normal: Normal::standard().inverse_cdf(probability),
            tabulated: (0..TABULATED)
                .map(|dof| quantile(probability, dof))
                .collect(),
        }
    }

    /// Returns the limit for some degrees of freedom.
    ///
    /// With zero degrees of freedom the residuals of the right pose are zero, except for points that no pose can reach.
    /// The limit for one degree of freedom is used then, so that a fit stuck elsewhere fails.
    pub(crate) fn limit(&self, degrees_of_freedom: usize) -> f64 {
        self.tabulated
            .get(degrees_of_freedom)
            .copied()
            .unwrap_or_else(|| expansion(self.normal, degrees_of_freedom as f64))
    }
}

/// Returns the quantile of chi-squared from that of the normal distribution, with a relative error of 1e-6 from
/// [`TABULATED`] degrees of freedom on.
///
/// # Source
/// Cornish and Fisher's expansion in powers of `n^-1/2`; Goldberg, Levine, *Ann. Math. Stat.* 17(2), 1946.
fn expansion(x: f64, n: f64) -> f64 {
    let (x2, root) = (x * x, (2.0 * n).sqrt());
    n + root * x + 2.0 / 3.0 * (x2 - 1.0) + x * (x2 - 7.0) / (9.0 * root)
        - (6.0 * x2 * x2 + 14.0 * x2 - 32.0) / (405.0 * n)
        + x * (9.0 * x2 * x2 + 256.0 * x2 - 433.0) / (4860.0 * n * root)
}

fn quantile(probability: f64, degrees_of_freedom: usize) -> f64 {
    ChiSquared::new(degrees_of_freedom.max(1) as f64).map_or(f64::NAN, |distribution| {
        distribution.inverse_cdf(probability)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_agree_with_printed_tables() {
        // NIST/SEMATECH e-Handbook, table 1.3.6.7.4, upper tail 0.001.
        let limits = TrustLimits::new(0.999);
        for (dof, printed) in [(1, 10.828), (6, 22.458), (18, 42.312), (100, 149.449)] {
            assert!((limits.limit(dof) - printed).abs() < 5e-4);
        }
        assert_eq!(limits.limit(0).to_bits(), limits.limit(1).to_bits());
    }

    #[test]
    fn approximation_of_many_degrees_of_freedom_is_as_good_as_the_quantile() {
        for probability in [0.5, 0.9, 0.999, 0.999_999] {
            let limits = TrustLimits::new(probability);
            for dof in [256, 300, 1000, 1994, 20_000, 60_000] {
                let (found, exact) = (limits.limit(dof), quantile(probability, dof));
                assert!(
                    ((found - exact) / exact).abs() < 1e-6,
                    "{probability}, {dof}: {found}, {exact}"
                );
            }
        }
    }
}
