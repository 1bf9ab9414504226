//! Errors against the truth, and whether the stated covariance explains them.

use nalgebra::Vector1;

use super::align::Compared;
use super::report::{AXES, AxisReport, EstimateReport, NeesReport, RangeReport, WorstFrame};
use super::statistics::{
    MeanOf, Quantiles, chi_squared_mean_bounds, independent_count, proportion_interval,
};

/// Intervals of range.
const RANGES: usize = 8;
/// Frames with the largest NEES that are named.
const WORST: usize = 10;
/// Of a pose.
pub(super) const DEGREES_OF_FREEDOM: u32 = 6;

/// Returns the figures of estimates against their truth; `None` without any.
pub(super) fn estimate_report(frames: &[Compared], start_ns: i64) -> Option<EstimateReport> {
    if frames.is_empty() {
        return None;
    }
    let bare = frames.iter().filter(|frame| frame.covariance.is_none());
    Some(EstimateReport {
        frames: frames.len() as u64,
        frames_without_covariance: bare.count() as u64,
        axes: (0..6).map(|axis| axis_report(frames, axis)).collect(),
        by_range: by_range(frames),
        nees: nees(frames),
        worst_frames: worst(frames, start_ns),
    })
}

fn axis_report(frames: &[Compared], axis: usize) -> AxisReport {
    let errors = || frames.iter().map(|frame| frame.error[axis]);
    let count = frames.len() as f64;
    let over_sigma: Vec<Vector1<f64>> = frames
        .iter()
        .filter_map(|frame| Some(Vector1::new(frame.error[axis] / frame.sigma(axis)?)))
        .collect();
    let stated = over_sigma.len() as f64;
    let within = over_sigma
        .iter()
        .filter(|ratio| ratio.x.abs() <= 3.0)
        .count();
    let coverage = (stated > 0.0).then(|| within as f64 / stated);
    let independent = independent_count(&over_sigma, MeanOf::Squares);
    AxisReport {
        axis: AXES[axis].to_owned(),
        mean: errors().sum::<f64>() / count,
        rms: root_mean_square(errors()).unwrap_or_default(),
        max_abs: errors().fold(0.0, |most, error| error.abs().max(most)),
        sigma: root_mean_square(frames.iter().filter_map(|frame| frame.sigma(axis))),
        within_3_sigma: within as u64,
        coverage_3_sigma: coverage,
        coverage_interval_if_independent: proportion_interval(within as f64, stated),
        coverage_interval: coverage
            .and_then(|share| proportion_interval(share * independent, independent)),
        independent_frames: independent,
    }
}

/// Returns the figures in equal intervals of range; empty ones are left out.
fn by_range(frames: &[Compared]) -> Vec<RangeReport> {
    let ranges = || frames.iter().map(Compared::range_m);
    let nearest = ranges().fold(f64::INFINITY, f64::min);
    let farthest = ranges().fold(0.0, f64::max);
    let step = (farthest - nearest) / RANGES as f64;
    let edge = |index: usize| nearest + step * index as f64;
    (0..RANGES)
        .filter_map(|index| {
            let is_last = index + 1 == RANGES;
            let inside = |frame: &&Compared| {
                let range_m = frame.range_m();
                range_m >= edge(index) && (range_m < edge(index + 1) || is_last)
            };
            let found: Vec<&Compared> = frames.iter().filter(inside).collect();
            let rms = |axis: usize| root_mean_square(found.iter().map(|frame| frame.error[axis]));
            let sigma =
                |axis: usize| root_mean_square(found.iter().filter_map(|frame| frame.sigma(axis)));
            let nees: Vec<f64> = found.iter().filter_map(|frame| frame.nees()).collect();
            rms(0)?;
            Some(RangeReport {
                from_m: edge(index),
                to_m: if is_last { farthest } else { edge(index + 1) },
                frames: found.len() as u64,
                rms: std::array::from_fn(|axis| rms(axis).unwrap_or_default()),
                sigma: sigma(0)
                    .map(|_| std::array::from_fn(|axis| sigma(axis).unwrap_or_default())),
                nees_mean: (!nees.is_empty()).then(|| nees.iter().sum::<f64>() / nees.len() as f64),
            })
        })
        .collect()
}

fn nees(frames: &[Compared]) -> Option<NeesReport> {
    let normalised: Vec<_> = frames.iter().filter_map(|frame| frame.normalised).collect();
    let values = || normalised.iter().map(nalgebra::Matrix::norm_squared);
    let spread = Quantiles::of(values())?;
    let count = normalised.len() as f64;
    let mean = values().sum::<f64>() / count;
    let independent = independent_count(&normalised, MeanOf::Squares);
    let degrees = f64::from(DEGREES_OF_FREEDOM);
    let bounds = chi_squared_mean_bounds(degrees, independent);
    Some(NeesReport {
        frames: normalised.len() as u64,
        degrees_of_freedom: DEGREES_OF_FREEDOM,
        mean,
        p50: spread.p50,
        p99: spread.p99,
        max: spread.max,
        bounds_if_independent: chi_squared_mean_bounds(degrees, count),
        independent_frames: independent,
        bounds,
        verdict: verdict(mean, bounds).to_owned(),
    })
}

/// Returns where a mean lies with regard to its bounds.
pub(super) fn verdict(mean: f64, bounds: Option<[f64; 2]>) -> &'static str {
    match bounds {
        Some([_, high]) if mean > high => "too_high",
        Some([low, _]) if mean < low => "too_low",
        Some(_) => "within",
        None => "unknown",
    }
}

fn worst(frames: &[Compared], start_ns: i64) -> Vec<WorstFrame> {
    let mut by_nees: Vec<(f64, &Compared)> = frames
        .iter()
        .filter_map(|frame| Some((frame.nees()?, frame)))
        .collect();
    by_nees.sort_by(|a, b| b.0.total_cmp(&a.0));
    let found = by_nees.into_iter().take(WORST);
    found
        .map(|(nees, frame)| WorstFrame {
            stamp_ns: frame.stamp_ns,
            time_s: seconds(frame.stamp_ns.saturating_sub(start_ns)),
            range_m: frame.range_m(),
            nees,
            position_error_m: frame.error.fixed_rows::<3>(0).norm(),
            attitude_error_rad: frame.error.fixed_rows::<3>(3).norm(),
        })
        .collect()
}

/// Returns the root of the mean square; `None` without values.
pub(super) fn root_mean_square(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (count, sum) = values.fold((0_u64, 0.0), |(count, sum), value| {
        (count + 1, sum + value * value)
    });
    (count > 0).then(|| (sum / count as f64).sqrt())
}

/// Returns nanoseconds as seconds.
pub(super) fn seconds(time_ns: i64) -> f64 {
    time_ns as f64 * 1e-9
}
