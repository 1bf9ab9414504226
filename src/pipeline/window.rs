//! Ratios of squared residuals to their expectation over the last seconds, and their median.

use std::collections::VecDeque;

/// s; older fits are stale.
pub(super) const WINDOW_S: f64 = 10.0;
/// s; frames in quicker succession are skipped, which bounds their number.
const LEAST_STEP_S: f64 = 0.002;

/// Ratios of the last seconds: chi-squared over its median.
#[derive(Debug, Default)]
pub(super) struct Window {
    /// With their times.
    ratios: VecDeque<(f64, f64)>,
}

impl Window {
    /// Returns whether a frame at this time is used: not if it follows too closely.
    pub(super) fn takes(&self, now_s: f64) -> bool {
        self.ratios.back().is_none_or(|(latest_s, _)| {
            now_s < latest_s - WINDOW_S || now_s >= latest_s + LEAST_STEP_S
        })
    }

    /// Adds a frame's chi-squared.
    pub(super) fn take(&mut self, now_s: f64, chi_squared: f64, degrees_of_freedom: f64) {
        if !self.takes(now_s) {
            return;
        }
        if let Some((latest_s, _)) = self.ratios.back()
            && now_s < *latest_s
        {
            // A recording that restarts.
            self.ratios.clear();
        }
        let ratio = chi_squared / median_of_chi_squared(degrees_of_freedom);
        self.ratios.push_back((now_s, ratio));
        // One older value is kept, as evidence that the window is full.
        while self
            .ratios
            .get(1)
            .is_some_and(|(second_s, _)| now_s - second_s >= WINDOW_S)
        {
            self.ratios.pop_front();
        }
    }

    /// Returns the root of the median, which is robust against a few gross errors; `None` without a frame.
    pub(super) fn factor(&self) -> Option<f64> {
        let mut ratios: Vec<f64> = self.ratios.iter().map(|(_, ratio)| *ratio).collect();
        let middle = ratios.len() / 2;
        if ratios.is_empty() {
            return None;
        }
        let (_, median, _) = ratios.select_nth_unstable_by(middle, f64::total_cmp);
        Some(median.max(0.0).sqrt())
    }

    pub(super) fn count(&self) -> usize {
        self.ratios.len()
    }

    /// Returns the time from the first frame to the last, s.
    pub(super) fn span_s(&self) -> f64 {
        match (self.ratios.front(), self.ratios.back()) {
            (Some((first_s, _)), Some((latest_s, _))) => latest_s - first_s,
            _ => 0.0,
        }
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
