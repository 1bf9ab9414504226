//! Correlation of a detector's noise: from frame to frame, and between the corners of a tag.

use serde::Serialize;

use super::leverage::{CornerSums, FrameResiduals};

/// Degrees of freedom below which a sigma is not stated: 10 % of it is then its own standard error.
pub(super) const LEAST_FREEDOM: f64 = 50.0;
/// How many of its standard errors a correlation has to be above zero to be stated.
pub(super) const SIGNIFICANT: f64 = 4.0;
/// Correlations below this change no figure of a budget.
const NOTABLE: f64 = 0.02;
/// Share of the recording that the longest lag may be: beyond, too few pairs are independent.
const LONGEST_LAG: usize = 5;

/// Noise that is correlated from frame to frame: `share · exp(−t / time_constant_s)`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TimeCorrelation {
    /// Share of the variance.
    pub share: f64,
    /// s.
    pub time_constant_s: f64,
}

/// Correlation between the corners of a tag in one frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CornerCorrelation {
    /// −1/3 to 1.
    pub correlation: f64,
    /// Its standard error.
    pub error: f64,
}

/// Returns the correlation between corners of a tag from two moments of the residuals: with noise `σ²(1 + ρK)` they are
/// `σ²(tr M + ρ tr MK)` and `σ²(tr MK + ρ tr MKMK)`.
pub(super) fn corner_correlation(sums: &CornerSums) -> Option<CornerCorrelation> {
    let ratio = sums.pairs / sums.own;
    let told = sums.mkmk - ratio * sums.mk;
    // Without pairs there are no sums either.
    let is_told = told > LEAST_FREEDOM && ratio.is_finite();
    is_told.then(|| CornerCorrelation {
        correlation: ((ratio * sums.m - sums.mk) / told).clamp(-1.0 / 3.0, 1.0),
        error: (2.0 / told).sqrt(),
    })
}

/// Returns the median time from frame to frame, s.
pub(super) fn usual_spacing_s(frames: &[FrameResiduals]) -> f64 {
    let mut gaps: Vec<f64> = frames
        .windows(2)
        .map(|pair| pair[1].time_s - pair[0].time_s)
        .filter(|gap| *gap > 0.0)
        .collect();
    gaps.sort_unstable_by(f64::total_cmp);
    gaps.get(gaps.len() / 2).copied().unwrap_or(f64::INFINITY)
}

/// Products of residuals that are some frames apart, over what they are if nothing changes from one to the other.
struct Lag {
    time_s: f64,
    correlation: f64,
    /// Number of products that would be independent.
    weight: f64,
}

pub(super) fn time_correlation(frames: &[FrameResiduals]) -> Option<TimeCorrelation> {
    let spacing_s = usual_spacing_s(frames);
    let lags: Vec<Lag> = lag_counts(frames.len() / LONGEST_LAG)
        .filter_map(|count| lag(frames, count, spacing_s))
        .collect();
    let first = lags.first()?;
    if first.correlation < NOTABLE.max(SIGNIFICANT * first.weight.recip().sqrt()) {
        return None;
    }
    // Time constants from a fifth of the spacing to the longest lag.
    let shortest_s = 0.2 * spacing_s;
    let longest_s = lags.last()?.time_s.max(spacing_s);
    let steps = 200;
    let mut best: Option<(f64, TimeCorrelation)> = None;
    for step in 0..=steps {
        let time_constant_s =
            shortest_s * (longest_s / shortest_s).powf(f64::from(step) / f64::from(steps));
        let (mut xy, mut xx) = (0.0, 0.0);
        for lag in &lags {
            let kept = (-lag.time_s / time_constant_s).exp();
            xy += lag.weight * lag.correlation * kept;
            xx += lag.weight * kept * kept;
        }
        let share = (xy / xx.max(1e-12)).clamp(0.0, 1.0);
        let misfit: f64 = lags
            .iter()
            .map(|lag| {
                let kept = (-lag.time_s / time_constant_s).exp();
                lag.weight * (lag.correlation - share * kept).powi(2)
            })
            .sum();
        let is_better = best.as_ref().is_none_or(|(least, _)| misfit < *least);
        if is_better {
            let found = TimeCorrelation {
                share,
                time_constant_s,
            };
            best = Some((misfit, found));
        }
    }
    best.map(|(_, found)| found)
}

/// Returns 1, 2, 3, 4, 6, 8, 12 and so on.
fn lag_counts(most: usize) -> impl Iterator<Item = usize> {
    let powers = (0..).map(|power| 1_usize << power);
    powers
        .take_while(move |power| *power <= most)
        .flat_map(|power| [power, power + power / 2])
        .filter(|count| *count > 0)
        .scan(0, |last, count| {
            let is_new = count != *last;
            *last = count;
            Some(is_new.then_some(count))
        })
        .flatten()
        .filter(move |count| *count <= most)
}

fn lag(frames: &[FrameResiduals], count: usize, spacing_s: f64) -> Option<Lag> {
    let (mut products, mut expected, mut times, mut pairs) = (0.0, 0.0, 0.0, 0.0);
    for (earlier, later) in frames.iter().zip(&frames[count..]) {
        let apart_s = later.time_s - earlier.time_s;
        // Across gaps a lag is another.
        if (apart_s - count as f64 * spacing_s).abs() > 0.5 * spacing_s {
            continue;
        }
        for seen in &later.points {
            let Some(before) = earlier.points.iter().find(|point| point.id == seen.id) else {
                continue;
            };
            let both = seen.sigma_px * before.sigma_px;
            products += seen.px.dot(&before.px) / both;
            let freedom = seen.freedom.component_mul(&before.freedom).map(f64::sqrt);
            expected += freedom.sum();
        }
        times += apart_s;
        pairs += 1.0;
    }
    let variance = variance_of_all(frames)?;
    (expected >= LEAST_FREEDOM).then(|| Lag {
        time_s: times / pairs,
        correlation: products / (expected * variance),
        weight: expected,
    })
}

/// Returns the variance of residuals in their sigmas.
fn variance_of_all(frames: &[FrameResiduals]) -> Option<f64> {
    let (mut squares, mut freedom) = (0.0, 0.0);
    for point in frames.iter().flat_map(|frame| &frame.points) {
        squares += point.px.norm_squared() / point.sigma_px.powi(2);
        freedom += point.freedom.sum();
    }
    let variance = squares / freedom;
    (variance > 0.0 && variance.is_finite()).then_some(variance)
}
