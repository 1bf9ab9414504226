//! The few statistics that the demo shows.

use statrs::distribution::{ChiSquared, ContinuousCDF};

/// A pose has six of them.
pub const POSE_DEGREES_OF_FREEDOM: f64 = 6.0;

/// Returns the value that a share `p` of the values does not exceed (nearest rank); `None` without values.
pub fn percentile(values: &[f64], p: f64) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "from 0 to the length, which is far below 2^53"
    )]
    let rank = (p * sorted.len() as f64).ceil() as usize;
    sorted.get(rank.saturating_sub(1)).copied()
}

/// Returns the mean; `None` without values.
pub fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// Returns the root of the mean square; `None` without values.
pub fn rms(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let squares: Vec<f64> = values.into_iter().map(|value| value * value).collect();
    mean(&squares).map(f64::sqrt)
}

/// Returns between which bounds the mean NEES of `count` honest estimates lies with a probability of
/// 95 %: their sum has a chi-squared distribution with `6 count` degrees of freedom.
pub fn mean_nees_interval(count: usize) -> Option<[f64; 2]> {
    let n = count as f64;
    let distribution = ChiSquared::new(POSE_DEGREES_OF_FREEDOM * n).ok()?;
    Some([0.025, 0.975].map(|p| distribution.inverse_cdf(p) / n))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_values_that_occurred() {
        let values: Vec<f64> = (1..=100).rev().map(f64::from).collect();
        assert_eq!(percentile(&values, 0.5), Some(50.0));
        assert_eq!(percentile(&values, 0.99), Some(99.0));
        assert_eq!(percentile(&values, 1.0), Some(100.0));
        assert_eq!(percentile(&[3.0], 0.01), Some(3.0));
        assert_eq!(percentile(&[], 0.5), None);
    }

    #[test]
    fn root_mean_square_of_three_and_four() {
        let found = rms([3.0, 4.0]).expect("there are values");
        assert!((found - 12.5_f64.sqrt()).abs() < 1e-15);
        assert_eq!(rms([]), None);
    }

    #[test]
    fn nees_interval_narrows_about_six() {
        // chi-squared quantiles of 6 degrees of freedom: 1.237 and 14.449, as tables have them.
        let [low, high] = mean_nees_interval(1).expect("one is enough");
        assert!((low - 1.237).abs() < 1e-3 && (high - 14.449).abs() < 1e-3);
        let [low, high] = mean_nees_interval(1000).expect("more than enough");
        assert!(low > 5.7 && low < 6.0 && high > 6.0 && high < 6.3);
        assert_eq!(mean_nees_interval(0), None);
    }
}
