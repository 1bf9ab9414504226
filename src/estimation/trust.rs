//! Limits of the chi-squared test that separates a frame to trust from one to refuse.

use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Degrees of freedom whose limit is kept ready; more are computed when they come.
const TABULATED: usize = 256;

/// The largest chi-squared that passes, by degrees of freedom, at one probability.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct TrustLimits {
    probability: f64,
    tabulated: Vec<f64>,
}

impl TrustLimits {
    /// Returns the limits that a frame with correct sigmas passes with the given probability.
    pub(crate) fn new(probability: f64) -> Self {
        Self {
            probability,
            tabulated: (0..TABULATED)
                .map(|dof| quantile(probability, dof))
                .collect(),
        }
    }

    /// Returns the limit for some degrees of freedom.
    ///
    /// Without any freedom the residuals of a true pose are zero up to points that no pose can
    /// reach; the limit of one degree of freedom is kept then, so that a fit stuck elsewhere fails.
    pub(crate) fn limit(&self, degrees_of_freedom: usize) -> f64 {
        self.tabulated
            .get(degrees_of_freedom)
            .copied()
            .unwrap_or_else(|| quantile(self.probability, degrees_of_freedom))
    }
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
        assert!(limits.limit(1000) > 1100.0 && limits.limit(1000) < 1200.0);
        assert_eq!(limits.limit(0).to_bits(), limits.limit(1).to_bits());
    }
}
