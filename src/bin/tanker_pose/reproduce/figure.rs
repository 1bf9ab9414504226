//! Outcomes as figures: which numbers become curves, and how they look.

use plotters::style::BLACK;
use tanker_pose::simulation::{Method, PAPER_COORDINATES, PAPER_UNITS};

use super::monte_carlo::{Outcome, Point};
use crate::plot::panel::{Curve, Figure, Panel, Style};
use crate::plot::scale::Axis;
use crate::plot::style::{BLUE, GREEN, PURPLE, VERMILLION, dashed, rings, solid, thin};

/// Median of the absolute value of a standard normal number: a median divided by it compares with an RMS.
const NORMAL_MEDIAN: f64 = 0.674_489_75;

/// What is drawn of a point, for coordinate `i`.
type Value = fn(&Point, i: usize) -> f64;

/// A curve of every panel: a series, what is drawn of it, and how.
struct Line6<'a> {
    series: &'a str,
    value: Value,
    style: Style,
}

/// Returns the figure of an outcome; `None` for one that is a table only.
pub fn of(outcome: &Outcome) -> Option<Figure> {
    match outcome.experiment.name {
        "fig5" => Some(by_series(outcome, "number of points", Axis::FromZero)),
        "fig7" => Some(by_series(
            outcome,
            "scale of the coordinates",
            Axis::FromZero,
        )),
        "fig8" => Some(by_method(outcome)),
        "fig9" => Some(by_series(outcome, "range, m", Axis::Logarithmic)),
        _ => None,
    }
}

/// A colour for each series; the iteration as line, ours as rings, the bound dashed.
fn by_series(outcome: &Outcome, x_label: &'static str, y: Axis) -> Figure {
    let series = outcome.series();
    let mut lines = Vec::new();
    let mut legend = Vec::new();
    for (name, color) in series.iter().zip([BLUE, VERMILLION, GREEN, PURPLE]) {
        lines.push(line(name, bound, dashed(color)));
        lines.push(line(
            name,
            |p, i| rms(p, Method::NominalIterated, i),
            solid(color),
        ));
        lines.push(line(
            name,
            |p, i| rms(p, Method::MaximumLikelihood, i),
            rings(color),
        ));
        if series.len() > 1 {
            legend.push(((*name).to_owned(), solid(color)));
        }
    }
    let neutral = if series.len() > 1 { BLACK } else { BLUE };
    legend.push(("RMS of In_M2+OI".to_owned(), solid(neutral)));
    legend.push(("RMS of maximum likelihood".to_owned(), rings(neutral)));
    legend.push(("Cramér–Rao bound".to_owned(), dashed(neutral)));
    let mut panels = coordinate_panels(outcome, &lines, y);
    panels.push(Panel {
        title: "attitude RMS / bound".to_owned(),
        curves: series
            .iter()
            .zip([BLUE, VERMILLION, GREEN, PURPLE])
            .flat_map(|(name, color)| {
                let ratio = |method, style| Curve {
                    points: outcome
                        .points_of(name)
                        .map(|point| (point.setting.abscissa, over_bound(point, method)))
                        .collect(),
                    style,
                };
                [
                    ratio(Method::NominalIterated, solid(color)),
                    ratio(Method::MaximumLikelihood, rings(color)),
                ]
            })
            .collect(),
        y: Axis::Within(0.95, 1.1),
    });
    figure(outcome, x_label, panels, legend)
}

/// A colour for each method; medians dashed where failures rule the RMS.
fn by_method(outcome: &Outcome) -> Figure {
    let series = outcome.points.first().map_or("", |p| &p.setting.series);
    let shown: [(&str, Value, Style); 7] = [
        (
            "In_M1, RMS",
            |p, i| rms(p, Method::LinearAlone, i),
            solid(GREEN),
        ),
        (
            "In_M1, median / 0.674",
            |p, i| median(p, Method::LinearAlone, i),
            dashed(GREEN),
        ),
        (
            "In_M1+OI, RMS",
            |p, i| rms(p, Method::LinearIterated, i),
            solid(PURPLE),
        ),
        (
            "In_M1+OI, median / 0.674",
            |p, i| median(p, Method::LinearIterated, i),
            dashed(PURPLE),
        ),
        (
            "In_M2+OI, RMS",
            |p, i| rms(p, Method::NominalIterated, i),
            solid(BLUE),
        ),
        (
            "maximum likelihood, RMS",
            |p, i| rms(p, Method::MaximumLikelihood, i),
            rings(VERMILLION),
        ),
        // Last, so that it lies above the curves that reach it.
        ("Cramér–Rao bound", bound, thin(BLACK)),
    ];
    let lines: Vec<Line6> = shown
        .iter()
        .map(|&(_, value, style)| line(series, value, style))
        .collect();
    let legend = shown
        .iter()
        .map(|&(name, _, style)| (name.to_owned(), style))
        .collect();
    let mut panels = coordinate_panels(outcome, &lines, Axis::Logarithmic);
    let shares = [
        (Method::LinearAlone, solid(GREEN)),
        (Method::LinearIterated, solid(PURPLE)),
        (Method::NominalIterated, solid(BLUE)),
        (Method::MaximumLikelihood, rings(VERMILLION)),
    ];
    panels.push(Panel {
        title: "attitude off by more than 5°, % of trials".to_owned(),
        curves: shares
            .into_iter()
            .map(|(method, style)| Curve {
                points: outcome
                    .points
                    .iter()
                    .filter_map(|p| Some((p.setting.abscissa, 100.0 * p.of(method)?.failures)))
                    .collect(),
                style,
            })
            .collect(),
        y: Axis::Within(0.0, 100.0),
    });
    figure(outcome, "range, m", panels, legend)
}

fn figure(
    outcome: &Outcome,
    x_label: &'static str,
    panels: Vec<Panel>,
    legend: Vec<(String, Style)>,
) -> Figure {
    let first = outcome.points.first();
    let mut notes: Vec<String> = first
        .and_then(|point| point.summaries.first())
        .map(|(_, summary)| format!("{} trials a point", summary.trials))
        .into_iter()
        .collect();
    if let Some(point) = first.filter(|_| outcome.experiment.name != "fig9") {
        notes.push(format!("noise {} px", point.setting.sigma_px));
    }
    if x_label.starts_with("range") {
        notes.push("10 m: wing tips beyond the image border".to_owned());
    }
    Figure {
        title: outcome.experiment.title.to_owned(),
        x_label,
        panels,
        legend,
        notes,
    }
}

fn coordinate_panels(outcome: &Outcome, lines: &[Line6], y: Axis) -> Vec<Panel> {
    (0..)
        .zip(PAPER_COORDINATES.iter().zip(PAPER_UNITS))
        .map(|(i, (name, unit))| Panel {
            title: format!("{name} error, {unit}"),
            curves: lines
                .iter()
                .map(|line| Curve {
                    points: outcome
                        .points_of(line.series)
                        .map(|point| (point.setting.abscissa, (line.value)(point, i)))
                        .collect(),
                    style: line.style,
                })
                .collect(),
            y,
        })
        .collect()
}

fn line(series: &str, value: Value, style: Style) -> Line6<'_> {
    Line6 {
        series,
        value,
        style,
    }
}

fn bound(point: &Point, i: usize) -> f64 {
    point.bound.coordinates[i]
}

fn rms(point: &Point, method: Method, i: usize) -> f64 {
    point.of(method).map_or(f64::NAN, |s| s.rms[i])
}

fn median(point: &Point, method: Method, i: usize) -> f64 {
    point
        .of(method)
        .map_or(f64::NAN, |s| s.median[i] / NORMAL_MEDIAN)
}

fn over_bound(point: &Point, method: Method) -> f64 {
    point
        .of(method)
        .map_or(f64::NAN, |s| s.rotation_rms_deg / point.bound.rotation_deg)
}
