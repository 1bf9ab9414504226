//! Bounds that follow from a number of frames, and how many independent frames a number of correlated ones are worth.

use nalgebra::{SMatrix, SVector};
use statrs::distribution::{Beta, ChiSquared, ContinuousCDF, Normal};

/// Probability of all two-sided intervals and bounds.
pub const CONFIDENCE: f64 = 0.95;
/// Lags grow by this factor beyond the first ones: the cost is then that of a few dozen lags.
const LAG_GROWTH: f64 = 1.15;
/// Correlation at which the sum ends: what lies beyond cannot be told from what a finite recording gives by chance.
const NEGLIGIBLE: f64 = 0.02;

/// Returns the bounds of the mean of `count` values that are chi-squared with `degrees_of_freedom` each.
///
/// `None` without values.
#[must_use]
pub fn chi_squared_mean_bounds(degrees_of_freedom: f64, count: f64) -> Option<[f64; 2]> {
    let total = degrees_of_freedom * count;
    let law = ChiSquared::new(total).ok()?;
    let tail = 0.5 * (1.0 - CONFIDENCE);
    let quantile = |probability: f64| {
        if total > 1000.0 {
            // Wilson and Hilferty: from here on better than a millionth, and it needs no search.
            let spread = 2.0 / (9.0 * total);
            let normal = Normal::standard().inverse_cdf(probability);
            (1.0 - spread + normal * spread.sqrt()).powi(3) * total
        } else {
            law.inverse_cdf(probability)
        }
    };
    Some([quantile(tail) / count, quantile(1.0 - tail) / count])
}

/// Returns the interval of Clopper and Pearson for a probability that gave `successes` of `trials`; both may be fractions.
///
/// `None` without trials.
#[must_use]
pub fn proportion_interval(successes: f64, trials: f64) -> Option<[f64; 2]> {
    if trials.is_nan() || trials <= 0.0 {
        return None;
    }
    let tail = 0.5 * (1.0 - CONFIDENCE);
    let failures = (trials - successes).max(0.0);
    let low = if successes <= 0.0 {
        0.0
    } else {
        Beta::new(successes, failures + 1.0).ok()?.inverse_cdf(tail)
    };
    let high = if failures <= 0.0 {
        1.0
    } else {
        Beta::new(successes + 1.0, failures)
            .ok()?
            .inverse_cdf(1.0 - tail)
    };
    Some([low, high])
}

/// Which mean the number of independent frames is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MeanOf {
    /// Of the values themselves: correlations count.
    Values,
    /// Of an even function of them, such as their square: squared correlations count, as an upper bound.
    Squares,
}

/// Returns how many independent vectors give a mean as certain as these, which are in the order of time.
///
/// Each is to have mean zero and equal variance on all axes if what it was divided by is right. Correlations are
/// therefore taken about zero: an error that stays the same over all frames counts as one.
#[must_use]
pub fn independent_count<const D: usize>(series: &[SVector<f64, D>], of: MeanOf) -> f64 {
    let count = series.len() as f64;
    let at_zero = lagged(series, 0);
    let power = match of {
        MeanOf::Values => at_zero.trace(),
        MeanOf::Squares => at_zero.norm_squared(),
    };
    if series.len() < 3 || power.is_nan() || power <= 0.0 {
        return count;
    }
    let correlation = |lag: usize| {
        let at_lag = lagged(series, lag);
        match of {
            MeanOf::Values => at_lag.trace() / power,
            MeanOf::Squares => {
                // What independent frames would give by chance.
                let chance = at_zero.trace().powi(2) / (count - lag as f64);
                (at_lag.norm_squared() - chance) / power
            }
        }
    };
    let mut sum = 0.0;
    let (mut last_lag, mut last) = (0_usize, 1.0);
    let mut lag = 1_usize;
    while lag <= series.len() / 2 {
        let found = correlation(lag);
        if found.is_nan() || found <= NEGLIGIBLE {
            break;
        }
        // Between the lags that were computed, linear.
        for between in last_lag + 1..=lag {
            let share = (between - last_lag) as f64 / (lag - last_lag) as f64;
            sum += (last + (found - last) * share) * (1.0 - between as f64 / count);
        }
        (last_lag, last) = (lag, found);
        // Lags are far below what a float holds exactly.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let next = (lag as f64 * LAG_GROWTH) as usize;
        lag = next.max(lag + 1);
    }
    (count / (1.0 + 2.0 * sum)).clamp(1.0, count)
}

/// Returns the mean of `a_t a_{t+lag}ᵀ`.
fn lagged<const D: usize>(series: &[SVector<f64, D>], lag: usize) -> SMatrix<f64, D, D> {
    let pairs = series.iter().zip(series.iter().skip(lag));
    let sum = pairs.fold(SMatrix::<f64, D, D>::zeros(), |sum, (a, b)| {
        sum + a * b.transpose()
    });
    sum / (series.len() - lag).max(1) as f64
}

/// Returns the value below which this share of the sorted values lies; `None` without values.
#[must_use]
pub fn quantile(sorted: &[f64], share: f64) -> Option<f64> {
    let last = sorted.len().checked_sub(1)?;
    let place = share.clamp(0.0, 1.0) * last as f64;
    // Between 0 and the last index.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let below = place.floor() as usize;
    let above = (below + 1).min(last);
    Some(sorted[below] + (sorted[above] - sorted[below]) * (place - below as f64))
}

/// Median, 99th percentile and largest of some values.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct Quantiles {
    /// How many values.
    pub count: u64,
    /// Median.
    pub p50: f64,
    /// 99th percentile.
    pub p99: f64,
    /// Largest.
    pub max: f64,
}

impl Quantiles {
    /// Returns those of the finite values; `None` without any.
    #[must_use]
    pub fn of(values: impl Iterator<Item = f64>) -> Option<Self> {
        let mut sorted: Vec<f64> = values.filter(|value| value.is_finite()).collect();
        sorted.sort_unstable_by(f64::total_cmp);
        Some(Self {
            count: sorted.len() as u64,
            p50: quantile(&sorted, 0.5)?,
            p99: quantile(&sorted, 0.99)?,
            max: *sorted.last()?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector2;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    /// scipy 1.17: chi2.ppf([0.025, 0.975], 6 n) / n.
    #[test]
    fn bounds_of_a_mean_are_those_of_scipy() {
        for (count, low, high) in [
            (1.0, 1.237_344_25, 14.449_375_34),
            (100.0, 5.340_185_5, 6.697_691_52),
            (750.0, 5.754_617_31, 6.250_434_01),
        ] {
            let [found_low, found_high] = chi_squared_mean_bounds(6.0, count).expect("frames");
            assert!((found_low / low - 1.0).abs() < 1e-5, "{found_low} {low}");
            assert!(
                (found_high / high - 1.0).abs() < 1e-5,
                "{found_high} {high}"
            );
        }
        assert_eq!(chi_squared_mean_bounds(6.0, 0.0), None);
    }

    /// scipy 1.17: `binomtest(k, n).proportion_ci()`.
    #[test]
    fn intervals_of_a_proportion_are_those_of_scipy() {
        for (successes, trials, low, high) in [
            (0.0, 10.0, 0.0, 0.308_497_1),
            (10.0, 10.0, 0.691_502_9, 1.0),
            (995.0, 1000.0, 0.988_370_53, 0.998_374_58),
        ] {
            let [found_low, found_high] = proportion_interval(successes, trials).expect("trials");
            assert!((found_low - low).abs() < 1e-5, "{found_low} {low}");
            assert!((found_high - high).abs() < 1e-5, "{found_high} {high}");
        }
        assert_eq!(proportion_interval(0.0, 0.0), None);
    }

    fn correlated(kept: f64, count: usize) -> Vec<Vector2<f64>> {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let mut draw = || {
            let [a, b]: [f64; 2] = [(); 2].map(|()| StandardNormal.sample(&mut random));
            Vector2::new(a, b)
        };
        let mut now = draw();
        (0..count)
            .map(|_| {
                now = now * kept + draw() * (1.0 - kept * kept).sqrt();
                now
            })
            .collect()
    }

    /// Of a process with correlation `k` from frame to frame the sum of correlations is `(1 + k) / (1 - k)`; the estimate
    /// from 20 000 frames with fifty frames of memory varies by a tenth.
    #[test]
    fn correlated_frames_are_worth_fewer_independent_ones() {
        const COUNT: usize = 20_000;
        let kept: f64 = 0.95;
        let series = correlated(kept, COUNT);
        for (of, k) in [(MeanOf::Values, kept), (MeanOf::Squares, kept * kept)] {
            let expected = COUNT as f64 * (1.0 - k) / (1.0 + k);
            let found = independent_count(&series, of);
            assert!(
                (found / expected - 1.0).abs() < 0.35,
                "{of:?} {found} {expected}"
            );
        }
        let fresh = correlated(0.0, COUNT);
        for of in [MeanOf::Values, MeanOf::Squares] {
            let found = independent_count(&fresh, of);
            assert!(found > 0.9 * COUNT as f64, "{of:?} {found}");
        }
    }

    #[test]
    fn an_error_that_never_changes_is_one() {
        let series = vec![Vector2::new(0.7, -0.2); 1000];
        assert!(independent_count(&series, MeanOf::Squares) < 1.6);
        assert!(independent_count(&series, MeanOf::Values) < 1.6);
    }

    #[test]
    fn quantiles_are_between_the_values() {
        let found = Quantiles::of([3.0, 1.0, f64::NAN, 2.0].into_iter()).expect("values");
        assert_eq!(found.count, 3);
        assert!((found.p50 - 2.0).abs() < 1e-12 && (found.max - 3.0).abs() < 1e-12);
        assert!((found.p99 - 2.98).abs() < 1e-12);
        assert_eq!(Quantiles::of(std::iter::empty()), None);
    }
}
