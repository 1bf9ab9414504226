//! The detector's noise from residuals: its sigma, how it grows with the range, and what of it is correlated.

use std::collections::BTreeMap;

use serde::Serialize;

use super::correlation::{
    CornerCorrelation, LEAST_FREEDOM, SIGNIFICANT, TimeCorrelation, corner_correlation,
    time_correlation, usual_spacing_s,
};
use super::leverage::{CornerSums, FrameResiduals};

/// Ranges of equal ratio; as many as a recording of one approach fills.
const BINS_PER_DOUBLING: f64 = 2.0;

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
        sigma_px * self.corner_factor()
    }

    /// Returns by what factor sigmas are larger where the corners of a tag are averaged as if they were independent: the
    /// mean of four has the variance `σ² (1 + 3ρ) / 4`.
    pub(super) fn corner_factor(&self) -> f64 {
        (1.0 + 3.0 * told(self.between_corners.as_ref())).sqrt()
    }

    /// Returns by what factor sigmas are larger where many frames are averaged as if they were independent.
    pub(super) fn lasting_factor(&self, spacing_s: f64) -> f64 {
        self.in_time.map_or(1.0, |lasting| {
            let kept = (-spacing_s / lasting.time_constant_s).exp();
            (1.0 + 2.0 * lasting.share * kept / (1.0 - kept).max(1e-3)).sqrt()
        })
    }
}

/// Returns a correlation that is above zero beyond doubt, or else 0.
fn told(corners: Option<&CornerCorrelation>) -> f64 {
    let is_told = |corners: &&CornerCorrelation| corners.correlation > SIGNIFICANT * corners.error;
    corners
        .filter(is_told)
        .map_or(0.0, |corners| corners.correlation)
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
    let between_corners = corner_correlation(&corners);
    // A pose takes away more of what corners have in common than of the rest.
    let common = told(between_corners.as_ref());
    let left = corners.m / (corners.m + common * corners.mk);
    let widened = if common > 0.0 && left > 1.0 {
        left.sqrt()
    } else {
        1.0
    };
    let sigma_px = whole.sigma()? * widened;
    let in_time = time_correlation(frames);
    let spacing_s = usual_spacing_s(frames);
    let mut noise = DetectorNoise {
        sigma_px,
        sigma_error_px: 0.0,
        factor_of_stated: factor * widened * (relative.squares / relative.freedom).sqrt(),
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
        between_corners,
    };
    // Squares of noise that lasts are correlated for half as long.
    let lasting = noise.lasting_factor(2.0 * spacing_s);
    let error = |sigma: f64, freedom: f64| sigma * lasting / (2.0 * freedom).sqrt();
    noise.sigma_error_px = error(sigma_px, whole.freedom);
    for (bin, sum) in by_range {
        let edge = |bin: i64| (bin as f64 / BINS_PER_DOUBLING).exp2();
        if let Some(sigma_px) = sum.sigma().map(|sigma_px| sigma_px * widened) {
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
