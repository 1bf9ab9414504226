//! Outcomes as CSV for plotting programs, as tables for people, as JSON for programs.

use std::fmt::Write;
use std::path::PathBuf;

use serde_json::{Value, json};
use tanker_pose::simulation::{Method, PAPER_COORDINATES, PAPER_UNITS, Summary};

use super::monte_carlo::{Outcome, Point};

/// Columns of every table, which may be an experiment's abscissa too.
const SETTING_COLUMNS: [&str; 2] = ["sigma_px", "points"];

/// Returns one line for each setting and method; the bound is repeated on the lines of its setting.
pub fn csv(outcome: &Outcome) -> String {
    let coordinates = |what: &str| {
        PAPER_COORDINATES
            .iter()
            .zip(PAPER_UNITS)
            .fold(String::new(), |columns, (name, unit)| {
                columns + &format!(",{name}_{what}_{unit}")
            })
    };
    let mut text = format!(
        "series,{}method,sigma_px,points,points_in_image,trials,solved{}{}{},rotation_rms_deg,\
         rotation_median_deg,rotation_bound_deg,position_rms_m,position_median_m,position_bound_m,\
         share_above_5_deg,share_other_minimum,iterations_median,iterations_p95\n",
        own_abscissa(outcome).map_or_else(String::new, |name| format!("{name},")),
        coordinates("rms"),
        coordinates("median"),
        coordinates("bound"),
    );
    for point in &outcome.points {
        for (method, summary) in &point.summaries {
            let abscissa = own_abscissa(outcome)
                .map_or_else(String::new, |_| abscissa(point.setting.abscissa) + ",");
            line(&mut text, point, &abscissa, *method, summary).unwrap_or_default();
        }
    }
    text
}

/// Returns the name of the abscissa's column, none where every table has that column.
fn own_abscissa(outcome: &Outcome) -> Option<String> {
    let name = outcome.experiment.abscissa;
    (!SETTING_COLUMNS.contains(&name)).then(|| name.replace("iterations", "max_iterations"))
}

fn line(
    text: &mut String,
    point: &Point,
    abscissa: &str,
    method: Method,
    summary: &Summary,
) -> std::fmt::Result {
    let setting = &point.setting;
    write!(
        text,
        "{},{abscissa}{},{},{},{},{},{}",
        setting.series,
        method.name(),
        setting.sigma_px,
        setting.scene.markers().len(),
        setting.markers_in_image(),
        summary.trials,
        summary.solved,
    )?;
    for values in [&summary.rms, &summary.median, &point.bound.coordinates] {
        for value in values.iter() {
            write!(text, ",{value:.6}")?;
        }
    }
    let other = summary
        .other_minimum
        .map_or_else(String::new, |share| format!("{share:.6}"));
    let steps = |count: u32| {
        if method.iterates() {
            count.to_string()
        } else {
            String::new()
        }
    };
    let (median, p95) = (
        steps(summary.iterations_median),
        steps(summary.iterations_p95),
    );
    writeln!(
        text,
        ",{:.6},{:.6},{:.6},{:.6},{:.6},{:.6},{:.6},{other},{median},{p95}",
        summary.rotation_rms_deg,
        summary.rotation_median_deg,
        point.bound.rotation_deg,
        summary.position_rms_m,
        summary.position_median_m,
        point.bound.position_m,
        summary.failures,
    )
}

/// Returns a table: errors as RMS, the last columns as shares and medians.
pub fn text(outcome: &Outcome) -> String {
    let experiment = &outcome.experiment;
    let trials = outcome.points.first().and_then(|p| p.summaries.first());
    let mut table = format!(
        "{} ({} trials a line; RMS errors, angles in degrees, distances in m)\n\
         {:<16} {:>13} {:<9}{:>8}{:>8}{:>8}{:>8}{:>8}{:>8}{:>10}{:>10}{:>9}{:>10}{:>9}{:>9}{:>7}\n",
        experiment.title,
        trials.map_or(0, |(_, summary)| summary.trials),
        "series",
        experiment.abscissa,
        "method",
        "yaw",
        "pitch",
        "roll",
        "x",
        "y",
        "z",
        "rotation",
        "position",
        "/bound",
        "med.rot.",
        ">5° %",
        "other %",
        "steps",
    );
    for point in &outcome.points {
        for (method, summary) in &point.summaries {
            table.push_str(&text_line(point, *method, summary));
            table.push('\n');
        }
    }
    table
}

fn text_line(point: &Point, method: Method, summary: &Summary) -> String {
    let errors = summary.rms.iter().fold(String::new(), |line, value| {
        line + &format!("{:>8}", short(*value))
    });
    let other = summary
        .other_minimum
        .map_or_else(|| "-".to_owned(), |share| format!("{:.3}", 100.0 * share));
    let steps = if method.iterates() {
        summary.iterations_median.to_string()
    } else {
        "-".to_owned()
    };
    format!(
        "{:<16} {:>13} {:<9}{errors}{:>10}{:>10}{:>9.3}{:>10}{:>9.3}{other:>9}{steps:>7}",
        point.setting.series,
        abscissa(point.setting.abscissa),
        method.name(),
        short(summary.rotation_rms_deg),
        short(summary.position_rms_m),
        summary.rotation_rms_deg / point.bound.rotation_deg,
        short(summary.rotation_median_deg),
        100.0 * summary.failures,
    )
}

/// Four figures at least, as few characters as that takes.
fn short(value: f64) -> String {
    match value.abs() {
        size if size < 10.0 => format!("{value:.4}"),
        size if size < 1000.0 => format!("{value:.2}"),
        _ => format!("{value:.3e}"),
    }
}

fn abscissa(value: f64) -> String {
    if value > 0.0 && value < 0.01 {
        format!("{value:e}")
    } else {
        value.to_string()
    }
}

/// Returns everything that the CSV files hold; NaN becomes null.
pub fn json(outcomes: &[Outcome], files: &[PathBuf], seed: u64) -> Value {
    let experiments: Vec<Value> = outcomes
        .iter()
        .map(|outcome| {
            json!({
                "name": outcome.experiment.name,
                "title": outcome.experiment.title,
                "abscissa": outcome.experiment.abscissa,
                "points": outcome.points.iter().map(point_json).collect::<Vec<_>>(),
            })
        })
        .collect();
    let files: Vec<_> = files.iter().map(|f| f.display().to_string()).collect();
    json!({"seed": seed, "files": files, "experiments": experiments})
}

fn point_json(point: &Point) -> Value {
    let bound = &point.bound;
    json!({
        "series": point.setting.series,
        "abscissa": point.setting.abscissa,
        "sigma_px": point.setting.sigma_px,
        "points": point.setting.scene.markers().len(),
        "points_in_image": point.setting.markers_in_image(),
        "bound": {
            "coordinates": coordinates_json(&bound.coordinates),
            "rotation_deg": bound.rotation_deg,
            "position_m": bound.position_m,
        },
        "methods": point.summaries.iter().map(|(m, s)| method_json(*m, s)).collect::<Vec<_>>(),
    })
}

fn method_json(method: Method, summary: &Summary) -> Value {
    json!({
        "method": method.name(),
        "trials": summary.trials,
        "solved": summary.solved,
        "rms": coordinates_json(&summary.rms),
        "median": coordinates_json(&summary.median),
        "rotation_rms_deg": summary.rotation_rms_deg,
        "rotation_median_deg": summary.rotation_median_deg,
        "position_rms_m": summary.position_rms_m,
        "position_median_m": summary.position_median_m,
        "share_above_5_deg": summary.failures,
        "share_other_minimum": summary.other_minimum,
        "iterations_median": method.iterates().then_some(summary.iterations_median),
        "iterations_p95": method.iterates().then_some(summary.iterations_p95),
    })
}

fn coordinates_json(values: &nalgebra::Vector6<f64>) -> Value {
    PAPER_COORDINATES
        .iter()
        .zip(PAPER_UNITS)
        .zip(values.iter())
        .map(|((name, unit), value)| (format!("{name}_{unit}"), json!(value)))
        .collect::<serde_json::Map<_, _>>()
        .into()
}
