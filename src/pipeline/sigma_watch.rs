//! How large the residuals of the last seconds are against the sigmas that were stated.
//!
//! The median counts, so that a few gross errors among many fits say nothing. A frame of which points were left out
//! counts with the fit of all its points: of those that remain chi-squared is small because they remain.

use std::collections::VecDeque;

use super::Stamp;
use crate::estimation::Solution;

/// s; what is older says nothing about now.
const WINDOW_S: f64 = 10.0;
/// Fits that make an estimate: 10 Hz. The factor is then known to 4 % (1 sigma) with six points.
const ENOUGH: usize = 100;
/// s; of fits that come faster some are passed over, which bounds their number.
const LEAST_STEP_S: f64 = 0.002;

/// By what factor stated sigmas are too small (above 1) or too large (below 1).
///
/// What is wrong the same way in every frame (map, calibration) makes residuals larger too, and a solution's covariance
/// knows of neither. Nothing is widened by it: that would be for whoever makes the observations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SigmaFactor {
    /// What the sigmas would have to be multiplied by.
    pub factor: f64,
    /// How many fits it rests on.
    pub fits: usize,
    /// From the first of them to the last, s.
    pub span_s: f64,
}

impl SigmaFactor {
    /// Returns whether it rests on ten seconds at ten fits a second or more.
    #[must_use]
    pub fn is_settled(&self) -> bool {
        self.fits >= ENOUGH && self.span_s >= WINDOW_S
    }
}

/// Fits of the last seconds.
#[derive(Debug, Default)]
pub(super) struct SigmaWatch {
    /// Times with chi-squared over its median.
    ratios: VecDeque<(f64, f64)>,
}

impl SigmaWatch {
    /// Takes a fit, trusted or not.
    pub(super) fn take(&mut self, stamp: Stamp, solution: &Solution) {
        let (chi_squared, degrees_of_freedom) = solution.of_all_points();
        if degrees_of_freedom == 0 {
            return;
        }
        let now_s = stamp.seconds();
        if let Some((latest_s, _)) = self.ratios.back() {
            if now_s < latest_s - WINDOW_S {
                // A recording that begins anew.
                self.ratios.clear();
            } else if now_s < latest_s + LEAST_STEP_S {
                return;
            }
        }
        let ratio = chi_squared / median_of_chi_squared(f64::from(degrees_of_freedom));
        self.ratios.push_back((now_s, ratio));
        // One that is older stays, to show that the window is full.
        while self
            .ratios
            .get(1)
            .is_some_and(|(second_s, _)| now_s - second_s >= WINDOW_S)
        {
            self.ratios.pop_front();
        }
    }

    /// Returns the factor; `None` before a fit.
    pub(super) fn factor(&self) -> Option<SigmaFactor> {
        let (first_s, _) = self.ratios.front()?;
        let (latest_s, _) = self.ratios.back()?;
        let mut ratios: Vec<f64> = self.ratios.iter().map(|(_, ratio)| *ratio).collect();
        let middle = ratios.len() / 2;
        let (_, median, _) = ratios.select_nth_unstable_by(middle, f64::total_cmp);
        Some(SigmaFactor {
            factor: median.max(0.0).sqrt(),
            fits: self.ratios.len(),
            span_s: latest_s - first_s,
        })
    }

    pub(super) fn forget(&mut self) {
        self.ratios.clear();
    }
}

/// Returns the median of chi-squared, to 0.5 % from four degrees of freedom on.
///
/// # Source
/// Wilson, Hilferty, *PNAS* 17(12), 1931.
fn median_of_chi_squared(degrees_of_freedom: f64) -> f64 {
    degrees_of_freedom * (1.0 - 2.0 / (9.0 * degrees_of_freedom)).powi(3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn median_agrees_with_printed_tables() {
        // NIST/SEMATECH e-Handbook, table 1.3.6.7.4, has no median; these are R's qchisq(0.5, n).
        for (degrees_of_freedom, exact) in [(4.0, 3.3567), (6.0, 5.3481), (10.0, 9.3418)] {
            let found = median_of_chi_squared(degrees_of_freedom);
            assert!((found / exact - 1.0).abs() < 5e-3, "{found} {exact}");
        }
    }
}
