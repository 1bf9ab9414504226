//! The detector's noise from residuals: its sigma, how it grows with the range, and what of it is correlated.

use std::collections::BTreeMap;

use serde::Serialize;

use super::leverage::{CornerSums, FrameResiduals};

/// Ranges of equal ratio; as many as a recording of one approach fills.
const BINS_PER_DOUBLING: f64 = 2.0;
/// Degrees of freedom below which a sigma is not stated: 10 % of it is then its own standard error.
const LEAST_FREEDOM: f64 = 50.0;
/// How many of its standard errors a correlation has to be above zero to be stated.
const SIGNIFICANT: f64 = 4.0;
/// Correlations below this change no figure of a budget.
const NOTABLE: f64 = 0.02;
/// Share of the recording that the longest lag may be: beyond, too few pairs are independent.
const LONGEST_LAG: usize = 5;

/// What the residuals tell of the detector. Sigmas are of one coordinate of one detection, px.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DetectorNoise {
    /// The sigma of all detections together.
    pub sigma_px: f64,
    /// Its standard error, correlation in time included.
    pub sigma_error_px: f64,
    /// By what the sigmas that were stated have to be multiplied.
    pub factor_of_stated: f64,
    /// Degrees of freedom of the residuals.
    pub degrees_of_freedom: f64,
    /// By range, nearest first.
    pub by_range: Vec<RangeBin>,
    /// Exponent of the sigma's growth with the range, and its standard error; `None` without a spread of ranges.
    pub growth_exponent: Option<(f64, f64)>,
    /// By marker, ascending id.
    pub by_marker: Vec<MarkerNoise>,
    /// What is correlated from frame to frame; `None` if nothing is, as far as can be told.
    pub in_time: Option<TimeCorrelation>,
    /// Correlation between corners of one tag; `None` without tags, or where it cannot be told.
    pub between_corners: Option<CornerCorrelation>,
}

/// The sigma in a bin of ranges.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RangeBin {
    /// m.
    pub from_m: f64,
    /// m.
    pub until_m: f64,
    /// px.
    pub sigma_px: f64,
    /// px.
    pub sigma_error_px: f64,
    /// Degrees of freedom of its residuals.
    pub degrees_of_freedom: f64,
}

/// The sigma of one marker's detections.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MarkerNoise {
    /// Its id.
    pub id: u32,
    /// px; `None` where its residuals have too few degrees of freedom.
    pub sigma_px: Option<f64>,
    /// Detections that were used.
    pub used: usize,
}

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

impl DetectorNoise {
    /// Returns the sigma to state for all detections: the largest of the ranges that tell one, if it depends on the range,
    /// wide enough for the mean of a tag's corners.
    #[must_use]
    pub fn sigma_to_state_px(&self) -> f64 {
        let depends = self
            .growth_exponent
            .is_some_and(|(exponent, error)| exponent.abs() > SIGNIFICANT * error);
        let of_ranges = self.by_range.iter().map(|bin| bin.sigma_px);
        let sigma_px = if depends {
            of_ranges.fold(self.sigma_px, f64::max)
        } else {
            self.sigma_px
        };
        let together = self.between_corners.map_or(0.0, |corners| {
            if corners.correlation > SIGNIFICANT * corners.error {
                corners.correlation
            } else {
                0.0
            }
        });
        // The mean of four corners has the variance σ² (1 + 3ρ) / 4.
        sigma_px * (1.0 + 3.0 * together).sqrt()
    }

    /// Returns by what factor sigmas are larger where many frames are averaged as if they were independent.
    pub(super) fn lasting_factor(&self, spacing_s: f64) -> f64 {
        self.in_time.map_or(1.0, |lasting| {
            let kept = (-spacing_s / lasting.time_constant_s).exp();
            (1.0 + 2.0 * lasting.share * kept / (1.0 - kept).max(1e-3)).sqrt()
        })
    }
}

/// A sum of squared residuals with its degrees of freedom.
#[derive(Default, Clone, Copy)]
struct Sum {
    squares: f64,
    freedom: f64,
    used: usize,
}

impl Sum {
    fn add(&mut self, squares: f64, freedom: f64) {
        self.squares += squares;
        self.freedom += freedom;
        self.used += 1;
    }

    fn sigma(self) -> Option<f64> {
        (self.freedom >= LEAST_FREEDOM).then(|| (self.squares / self.freedom).sqrt())
    }
}

/// Returns the detector's noise; `None` if the residuals have hardly any degrees of freedom.
///
/// # Inputs
/// * `factor`: by which the stated sigmas have been multiplied.
pub(super) fn detector_noise(frames: &[FrameResiduals], factor: f64) -> Option<DetectorNoise> {
    let (mut whole, mut relative) = (Sum::default(), Sum::default());
    let mut by_marker: BTreeMap<u32, Sum> = BTreeMap::new();
    let mut by_range: BTreeMap<i64, Sum> = BTreeMap::new();
    let mut corners = CornerSums::default();
    for frame in frames {
        // Ranges are within the map's limits.
        #[allow(clippy::cast_possible_truncation)]
        let bin = (frame.range_m.max(0.1).log2() * BINS_PER_DOUBLING).floor() as i64;
        for point in &frame.points {
            let (squares, freedom) = (point.px.norm_squared(), point.freedom.sum());
            whole.add(squares, freedom);
            relative.add(squares / point.sigma_px.powi(2), freedom);
            by_marker.entry(point.id).or_default().add(squares, freedom);
            by_range.entry(bin).or_default().add(squares, freedom);
        }
        corners.own += frame.corners.own;
        corners.pairs += frame.corners.pairs;
        corners.m += frame.corners.m;
        corners.mk += frame.corners.mk;
        corners.mkmk += frame.corners.mkmk;
    }
    let sigma_px = whole.sigma()?;
    let in_time = time_correlation(frames);
    let spacing_s = usual_spacing_s(frames);
    let mut noise = DetectorNoise {
        sigma_px,
        sigma_error_px: 0.0,
        factor_of_stated: factor * (relative.squares / relative.freedom).sqrt(),
        degrees_of_freedom: whole.freedom,
        by_range: Vec::new(),
        growth_exponent: None,
        by_marker: by_marker
            .into_iter()
            .map(|(id, sum)| MarkerNoise {
                id,
                sigma_px: sum.sigma(),
                used: sum.used,
            })
            .collect(),
        in_time,
        between_corners: corner_correlation(&corners),
    };
    // Squares of noise that lasts are correlated for half as long.
    let lasting = noise.lasting_factor(2.0 * spacing_s);
    let error = |sigma: f64, freedom: f64| sigma * lasting / (2.0 * freedom).sqrt();
    noise.sigma_error_px = error(sigma_px, whole.freedom);
    for (bin, sum) in by_range {
        let edge = |bin: i64| (bin as f64 / BINS_PER_DOUBLING).exp2();
        if let Some(sigma_px) = sum.sigma() {
            noise.by_range.push(RangeBin {
                from_m: edge(bin),
                until_m: edge(bin + 1),
                sigma_px,
                sigma_error_px: error(sigma_px, sum.freedom),
                degrees_of_freedom: sum.freedom,
            });
        }
    }
    noise.growth_exponent = growth(&noise.by_range);
    Some(noise)
}

/// Returns the slope of ln σ over ln range by weighted least squares, with its standard error.
fn growth(bins: &[RangeBin]) -> Option<(f64, f64)> {
    if bins.len() < 2 {
        return None;
    }
    let points = bins.iter().map(|bin| {
        let x = (bin.from_m * bin.until_m).sqrt().ln();
        let weight = (bin.sigma_px / bin.sigma_error_px).powi(2);
        (x, bin.sigma_px.ln(), weight)
    });
    let (mut w, mut x, mut y) = (0.0, 0.0, 0.0);
    for (at, value, weight) in points.clone() {
        w += weight;
        x += weight * at;
        y += weight * value;
    }
    let (mean_x, mean_y) = (x / w, y / w);
    let (mut xx, mut xy) = (0.0, 0.0);
    for (at, value, weight) in points {
        xx += weight * (at - mean_x).powi(2);
        xy += weight * (at - mean_x) * (value - mean_y);
    }
    (xx > 0.0).then(|| (xy / xx, xx.recip().sqrt()))
}

/// Returns the correlation between corners of a tag from two moments of the residuals: with noise `σ²(1 + ρK)` they are
/// `σ²(tr M + ρ tr MK)` and `σ²(tr MK + ρ tr MKMK)`.
fn corner_correlation(sums: &CornerSums) -> Option<CornerCorrelation> {
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

fn time_correlation(frames: &[FrameResiduals]) -> Option<TimeCorrelation> {
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
    let mut sum = Sum::default();
    for point in frames.iter().flat_map(|frame| &frame.points) {
        sum.add(
            point.px.norm_squared() / point.sigma_px.powi(2),
            point.freedom.sum(),
        );
    }
    let variance = sum.squares / sum.freedom;
    (variance > 0.0 && variance.is_finite()).then_some(variance)
}
