//! Charts of what became of the frames: refusals, integrity states, modes, residuals.

use std::collections::BTreeMap;

use super::chart::{Chart, Layer, Shape, X};
use super::errors::{gap, largest, range};
use super::style::COLOURS;
use crate::evaluation::Evaluation;
use crate::evaluation::outcomes::outcome_name;
use crate::evaluation::report::{MarkerReport, ResidualReport};
use crate::pipeline::{IntegrityState, Stamp};

/// Intervals of time.
const BINS: u32 = 80;

/// Returns how many frames ended how, over time.
pub(super) fn outcomes(evaluation: &Evaluation) -> Option<Chart> {
    let statuses = evaluation.gathered.statuses.iter();
    let named = statuses.map(|status| (status.header.stamp, outcome_name(status.outcome)));
    stacked(
        "outcomes-time",
        "Frames over time, by outcome",
        evaluation,
        named.map(|(stamp, name)| (Stamp::from(stamp).nanoseconds(), name)),
        "OK",
    )
}

/// Returns how many frames had which integrity state, over time.
pub(super) fn states(evaluation: &Evaluation) -> Option<Chart> {
    let messages = evaluation.gathered.integrity.iter();
    let name = |number: u8| {
        let known = IntegrityState::ALL
            .iter()
            .find(|state| state.number() == number);
        known.map_or_else(
            || format!("UNKNOWN_{number}"),
            |state| state.name().to_owned(),
        )
    };
    let named = messages.map(|message| {
        (
            Stamp::from(message.header.stamp).nanoseconds(),
            name(message.state),
        )
    });
    stacked(
        "integrity-time",
        "Frames over time, by integrity state",
        evaluation,
        named,
        "AVAILABLE",
    )
}

/// Returns frames per second, one name above the other; `best` is at the bottom, in its own colour.
fn stacked(
    id: &str,
    title: &str,
    evaluation: &Evaluation,
    frames: impl Iterator<Item = (i64, String)>,
    best: &str,
) -> Option<Chart> {
    let length_s = evaluation.report.duration_s?.max(1e-3);
    let width_s = length_s / f64::from(BINS);
    let mut counts: BTreeMap<String, BTreeMap<u32, f64>> = BTreeMap::new();
    for (stamp_ns, name) in frames.filter(|(stamp_ns, _)| *stamp_ns > 0) {
        let place = evaluation.time_s(stamp_ns) / width_s;
        // Saturates, and is limited to the bins there are.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let bin = (place as u32).min(BINS - 1);
        *counts.entry(name).or_default().entry(bin).or_default() += 1.0 / width_s;
    }
    let mut names: Vec<(String, f64)> = counts
        .iter()
        .map(|(name, bins)| (name.clone(), bins.values().sum()))
        .collect();
    names.sort_by(|a, b| (b.0 == best).cmp(&(a.0 == best)).then(b.1.total_cmp(&a.1)));
    let mut heights: BTreeMap<u32, f64> = BTreeMap::new();
    let mut layers = Vec::new();
    let mut colour = 1;
    for (name, _) in names {
        let boxes: Vec<[f64; 4]> = counts
            .get(&name)?
            .iter()
            .map(|(&bin, &rate)| {
                let height = heights.entry(bin).or_default();
                let from = *height;
                *height += rate;
                let x = f64::from(bin) * width_s;
                [x, x + width_s, from, *height]
            })
            .collect();
        let class = if name == best {
            "ok".to_owned()
        } else {
            colour += 1;
            format!("c{}", (colour - 1) % COLOURS)
        };
        layers.push(Layer::new(Shape::Boxes(boxes), &class, &name));
    }
    (!layers.is_empty()).then(|| Chart {
        id: id.to_owned(),
        title: title.to_owned(),
        x_label: "time since the start, s".to_owned(),
        y_label: "frames per second".to_owned(),
        x: X::Range((0.0, length_s)),
        y: (0.0, 1.05 * largest(heights.into_values())),
        is_y_logarithmic: false,
        layers,
    })
}

/// Returns the amplitudes of the budget's modes over time; `None` without modes.
pub(super) fn modes(evaluation: &Evaluation) -> Option<Chart> {
    let mut series: Vec<(&str, Vec<(f64, f64)>)> = Vec::new();
    for status in &evaluation.gathered.statuses {
        let time_s = evaluation.time_s(Stamp::from(status.header.stamp).nanoseconds());
        for (name, amplitude) in status.mode_names.iter().zip(&status.mode_amplitudes) {
            match series.iter_mut().find(|(known, _)| known == name) {
                Some((_, points)) => points.push((time_s, *amplitude)),
                None => series.push((name, vec![(time_s, *amplitude)])),
            }
        }
    }
    let all = || series.iter().flat_map(|(_, points)| points);
    let most = largest(all().map(|point| point.1)).max(1.0);
    let x = range(all().map(|point| point.0));
    let layers: Vec<Layer> = series
        .iter()
        .enumerate()
        .map(|(index, (name, points))| {
            let class = format!("c{} thin", index % COLOURS);
            let shape = Shape::Broken(points.clone(), gap(points));
            Layer::new(shape, &class, &crate::text::clip(name))
        })
        .collect();
    (!layers.is_empty()).then(|| Chart {
        id: "modes-time".to_owned(),
        title: "Amplitude of each mode of the error budget".to_owned(),
        x_label: "time since the start, s".to_owned(),
        y_label: "amplitude, its sigmas".to_owned(),
        x: X::Range(x),
        y: (-1.05 * most, 1.05 * most),
        is_y_logarithmic: false,
        layers,
    })
}

/// Returns charts of the residuals by marker.
pub(super) fn residuals(report: &ResidualReport) -> Vec<Chart> {
    let markers = &report.markers;
    let at = |index: usize, offset: f64| index as f64 + 1.0 + offset;
    let names = || markers.iter().map(|marker| marker.id.to_string()).collect();
    let whiskers = |axis: usize, offset: f64| {
        let bar = |(index, marker): (usize, &MarkerReport)| {
            let sigma = 3.0 * marker.sigma_px[axis] / marker.independent_frames.max(1.0).sqrt();
            let mean = marker.mean_px[axis];
            (at(index, offset), mean - sigma, mean + sigma)
        };
        markers.iter().enumerate().map(bar).collect::<Vec<_>>()
    };
    let means = |axis: usize, offset: f64| {
        let each = markers.iter().enumerate();
        each.map(|(index, marker)| (at(index, offset), marker.mean_px[axis]))
            .collect::<Vec<_>>()
    };
    let (columns, rows) = (whiskers(0, -0.12), whiskers(1, 0.12));
    let most = largest(columns.iter().chain(&rows).flat_map(|bar| [bar.1, bar.2]));
    let mean_chart = Chart {
        id: "residual-mean".to_owned(),
        title: "Mean residual by marker".to_owned(),
        x_label: "marker".to_owned(),
        y_label: "detection − projection, px".to_owned(),
        x: X::Names(names()),
        y: (-1.1 * most, 1.1 * most),
        is_y_logarithmic: false,
        layers: vec![
            Layer::new(Shape::Across(0.0), "grey", ""),
            Layer::new(
                Shape::Whiskers(columns),
                "c0",
                "column, with ±3 sigmas of the mean",
            ),
            Layer::new(Shape::Dots(means(0, -0.12)), "c0", ""),
            Layer::new(Shape::Whiskers(rows), "c1", "row"),
            Layer::new(Shape::Dots(means(1, 0.12)), "c1", ""),
        ],
    };
    let bars: Vec<[f64; 4]> = (markers.iter().enumerate())
        .map(|(index, marker)| {
            [
                at(index, -0.3),
                at(index, 0.3),
                0.0,
                marker.chi_squared_mean,
            ]
        })
        .collect();
    let tallest = largest(bars.iter().map(|bar| bar[3])).max(2.0);
    let chi_chart = Chart {
        id: "residual-chi".to_owned(),
        title: "Mean chi-squared by marker".to_owned(),
        x_label: "marker".to_owned(),
        y_label: "chi-squared, no unit".to_owned(),
        x: X::Names(names()),
        y: (0.0, 1.1 * tallest),
        is_y_logarithmic: false,
        layers: vec![
            Layer::new(Shape::Boxes(bars), "c5", "mean over frames"),
            Layer::new(
                Shape::Across(2.0),
                "c1 dashed",
                "2, if noise and map are as stated",
            ),
        ],
    };
    vec![mean_chart, chi_chart]
}
