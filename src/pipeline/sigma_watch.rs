//! How large the residuals of the last seconds are against the sigmas that were stated.
//!
//! The median counts, so that a few gross errors among many fits say nothing. A frame of which points were left out
//! counts with the fit of all its points: of those that remain chi-squared is small because they remain.

use super::Stamp;
use super::window::{WINDOW_S, Window};
use crate::estimation::Solution;

/// Fits that make an estimate: 10 Hz. The factor is then known to 4 % (1 sigma) with six points.
pub(super) const ENOUGH: usize = 100;

/// By what factor stated sigmas are too small (above 1) or too large (below 1).
///
/// What is wrong the same way in every frame (map, calibration) makes residuals larger too, and a solution's covariance
/// knows of neither. Nothing is widened by it: see [`super::Pipeline::widened_by`].
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
pub(super) struct SigmaWatch(Window);

impl SigmaWatch {
    /// Takes a fit, trusted or not.
    ///
    /// # Inputs
    /// * `widened_by`: what the stated sigmas were multiplied by for it.
    pub(super) fn take(&mut self, stamp: Stamp, solution: &Solution, widened_by: f64) {
        let (chi_squared, degrees_of_freedom) = solution.of_all_points();
        if degrees_of_freedom > 0 {
            let of_stated = chi_squared * widened_by * widened_by;
            self.0
                .take(stamp.seconds(), of_stated, f64::from(degrees_of_freedom));
        }
    }

    /// Returns the factor; `None` before a fit.
    pub(super) fn factor(&self) -> Option<SigmaFactor> {
        Some(SigmaFactor {
            factor: self.0.factor()?,
            fits: self.0.count(),
            span_s: self.0.span_s(),
        })
    }

    pub(super) fn forget(&mut self) {
        self.0.forget();
    }
}
