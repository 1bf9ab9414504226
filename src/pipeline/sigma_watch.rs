//! Ratio of the residuals of the last seconds to the stated sigmas.
//!
//! The median is used, so that a few gross errors among many fits have no effect. A frame with exclusions counts with
//! the fit of all its points, because the chi-squared of the remaining ones is small by selection.

use super::Stamp;
use super::window::{WINDOW_S, Window};
use crate::estimation::Solution;

/// Number of fits for an estimate: 10 Hz. With six points the factor is then known to 4 % (1 sigma).
pub(super) const ENOUGH: usize = 100;

/// The factor by which stated sigmas are too small (above 1) or too large (below 1).
///
/// Errors that are the same in every frame (map, calibration) increase residuals as well, and the covariance does not
/// contain them. This factor does not widen anything: see [`super::Pipeline::widened_by`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SigmaFactor {
    /// The factor by which the sigmas would have to be multiplied.
    pub factor: f64,
    /// Number of fits that it is based on.
    pub fits: usize,
    /// From the first of them to the last, s.
    pub span_s: f64,
}

impl SigmaFactor {
    /// Returns whether it is based on ten seconds with at least ten fits a second.
    #[must_use]
    pub fn is_settled(&self) -> bool {
        self.fits >= ENOUGH && self.span_s >= WINDOW_S
    }
}

/// Fits of the last seconds.
#[derive(Debug, Default)]
pub(super) struct SigmaWatch(Window);

impl SigmaWatch {
    /// Adds a fit, trusted or not.
    ///
    /// # Inputs
    /// * `widened_by`: the factor by which the stated sigmas were multiplied for it.
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
