//! Charts of errors against the truth.

use super::chart::{Chart, Layer, Shape, X};
use crate::evaluation::Evaluation;
use crate::evaluation::align::Compared;
use crate::evaluation::report::{EstimateReport, RangeReport};
use crate::evaluation::statistics::{CONFIDENCE, chi_squared_mean_bounds};

/// Names of the axes on the page; attitudes are shown in mrad.
pub(super) const NAMES: [&str; 6] = [
    "x, right",
    "y, down",
    "z, ahead",
    "rotation about x",
    "rotation about y",
    "rotation about z",
];

/// Unit of an axis on the page, and what a value is multiplied by for it.
pub(super) const fn unit(axis: usize) -> (&'static str, f64) {
    if axis < 3 { ("m", 1.0) } else { ("mrad", 1e3) }
}

/// Returns a chart of each axis against time, with three stated sigmas.
pub(super) fn against_time(evaluation: &Evaluation) -> Vec<Chart> {
    let frames = &evaluation.poses;
    (0..6)
        .map(|axis| {
            let (unit, factor) = unit(axis);
            let time = |frame: &Compared| evaluation.time_s(frame.stamp_ns);
            let errors: Vec<(f64, f64)> = frames
                .iter()
                .map(|frame| (time(frame), factor * frame.error[axis]))
                .collect();
            let limit = |sign: f64| -> Vec<(f64, f64)> {
                let found = frames.iter().filter_map(|frame| {
                    Some((time(frame), sign * 3.0 * factor * frame.sigma(axis)?))
                });
                found.collect()
            };
            let (above, below) = (limit(1.0), limit(-1.0));
            let most = largest(errors.iter().chain(&above).map(|point| point.1));
            let gap = gap(&errors);
            Chart {
                id: format!("error-time-{axis}"),
                title: format!("Error along {}", NAMES[axis])
                    .replace("along rotation", "of rotation"),
                x_label: "time since the start, s".to_owned(),
                y_label: format!("truth − estimate, {unit}"),
                x: X::Range(range(errors.iter().map(|point| point.0))),
                y: (-1.05 * most, 1.05 * most),
                is_y_logarithmic: false,
                layers: vec![
                    Layer::new(Shape::Broken(errors, gap), "c0 thin", "error"),
                    Layer::new(Shape::Broken(above, gap), "c1", "±3 stated sigmas"),
                    Layer::new(Shape::Broken(below, gap), "c1", ""),
                ],
            }
        })
        .collect()
}

/// Returns charts of root mean square errors and stated sigmas against range: positions, attitudes.
pub(super) fn against_range(report: &EstimateReport) -> Vec<Chart> {
    let middle = |range: &RangeReport| 0.5 * (range.from_m + range.to_m);
    [0, 3]
        .into_iter()
        .map(|first| {
            let (unit, factor) = unit(first);
            let mut layers = Vec::new();
            let mut most = 0.0_f64;
            for axis in first..first + 3 {
                let rms: Vec<(f64, f64)> = report
                    .by_range
                    .iter()
                    .map(|range| (middle(range), factor * range.rms[axis]))
                    .collect();
                let stated: Vec<(f64, f64)> = report
                    .by_range
                    .iter()
                    .filter_map(|range| Some((middle(range), factor * range.sigma?[axis])))
                    .collect();
                most = most.max(largest(rms.iter().chain(&stated).map(|point| point.1)));
                let class = format!("c{}", axis - first);
                let name = NAMES[axis];
                layers.push(Layer::new(
                    Shape::Line(rms.clone()),
                    &class,
                    &format!("{name}: rms error"),
                ));
                layers.push(Layer::new(Shape::Dots(rms), &class, ""));
                let dashed = format!("{class} dashed");
                layers.push(Layer::new(Shape::Line(stated), &dashed, "stated sigma"));
            }
            let what = if first == 0 { "Position" } else { "Attitude" };
            Chart {
                id: format!("error-range-{first}"),
                title: format!("{what}: error and stated sigma against range"),
                x_label: "true range, m".to_owned(),
                y_label: format!("root mean square, {unit}"),
                x: X::Range(range(
                    report
                        .by_range
                        .iter()
                        .flat_map(|range| [range.from_m, range.to_m]),
                )),
                y: (0.0, 1.05 * most),
                is_y_logarithmic: false,
                layers,
            }
        })
        .collect()
}

/// Returns the chart of NEES against time; `None` without covariances.
pub(super) fn nees(evaluation: &Evaluation) -> Option<Chart> {
    let values: Vec<(f64, f64)> = evaluation
        .poses
        .iter()
        .filter_map(|frame| Some((evaluation.time_s(frame.stamp_ns), frame.nees()?)))
        .collect();
    let mean = evaluation.report.pose.as_ref()?.nees.as_ref()?.mean;
    let [low, high] = chi_squared_mean_bounds(6.0, 1.0)?;
    let positive = || {
        values
            .iter()
            .map(|point| point.1)
            .filter(|value| *value > 0.0)
    };
    let least = positive().fold(low, f64::min).max(1e-2);
    let most = positive().fold(high, f64::max);
    let per_cent = 100.0 * CONFIDENCE;
    Some(Chart {
        id: "nees".to_owned(),
        title: "NEES of single frames".to_owned(),
        x_label: "time since the start, s".to_owned(),
        y_label: "NEES, no unit".to_owned(),
        x: X::Range(range(values.iter().map(|point| point.0))),
        y: (0.8 * least, 1.25 * most),
        is_y_logarithmic: true,
        layers: vec![
            Layer::new(Shape::Dots(values), "c0 small", "a frame"),
            Layer::new(
                Shape::Across(low),
                "c1",
                &format!("{per_cent:.0} % of honest frames are between"),
            ),
            Layer::new(Shape::Across(high), "c1", ""),
            Layer::new(Shape::Across(mean), "c2", &format!("mean, {mean:.2}")),
            Layer::new(Shape::Across(6.0), "c7 dashed", "6, expected mean"),
        ],
    })
}

/// Returns the largest size of the finite values.
pub(super) fn largest(values: impl Iterator<Item = f64>) -> f64 {
    let sizes = values.filter(|value| value.is_finite()).map(f64::abs);
    sizes.fold(0.0, f64::max)
}

/// Returns least and largest of the finite values.
pub(super) fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values
        .filter(|value| value.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
            (low.min(value), high.max(value))
        })
}

/// Returns the distance of x beyond which a line is interrupted: five median steps.
pub(super) fn gap(points: &[(f64, f64)]) -> f64 {
    let mut steps: Vec<f64> = points
        .windows(2)
        .map(|pair| pair[1].0 - pair[0].0)
        .collect();
    steps.sort_unstable_by(f64::total_cmp);
    steps
        .get(steps.len() / 2)
        .map_or(f64::INFINITY, |step| 5.0 * step)
}
