//! One figure for each declared point: sigmas by cause, and protection levels, against range.

use plotters::style::{BLACK, RGBColor};
use tanker_pose::integrity::IntegrityPoint;

use super::along::{Station, Without};
use super::situation::Situation;
use super::view::{AXES, View};
use crate::plot::panel::{Curve, Figure, Panel, Style};
use crate::plot::scale::Axis;
use crate::plot::style::{
    BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILLION, dashed, plain, solid, thin,
};

/// Causes with a colour of their own; the others are drawn as one.
const COLORS: [RGBColor; 5] = [BLUE, VERMILLION, GREEN, ORANGE, SKY];

/// A cause below this part of the smallest sigma only stretches the axis.
const SMALLEST_DRAWN: f64 = 10.0;

/// Returns the figure of a declared point.
pub fn figure(situation: &Situation, stations: &[Station], index: usize) -> Figure {
    let point: &IntegrityPoint = &situation.monitor.points()[index];
    let causes = main_causes(stations, index);
    let mut panels: Vec<Panel> = (0..3)
        .map(|axis| sigma_panel(stations, index, axis, &causes))
        .collect();
    panels.push(view_panel(situation, stations));
    panels.extend((0..3).map(|axis| level_panel(stations, index, axis)));
    let mut legend: Vec<(String, Style)> =
        vec![("all causes, all beacons".to_owned(), solid(BLACK))];
    let colors = causes.iter().zip(COLORS);
    legend.extend(colors.map(|(cause, color)| (format!("sigma: {cause}"), plain(color))));
    if has_others(stations, index, &causes) {
        legend.push(("sigma: other causes".to_owned(), thin(GREY)));
    }
    let has_losses = (stations.iter().flat_map(|station| &station.without))
        .any(|without| without.worst_level_m().is_finite());
    if has_losses {
        legend.push(("level without the worst beacon".to_owned(), solid(PURPLE)));
        legend.push(("level without each one".to_owned(), thin(GREY)));
    }
    legend.push(("share of markers in the image".to_owned(), solid(BLUE)));
    legend.push(("likelihood of a second pose".to_owned(), dashed(VERMILLION)));
    Figure {
        title: format!("Map {}: {}", situation.map.name(), point.name),
        x_label: "range, m",
        panels,
        legend,
        notes: notes(situation, stations),
    }
}

fn notes(situation: &Situation, stations: &[Station]) -> Vec<String> {
    let mut notes = vec![format!(
        "level: exceeded with probability {:.0e} a frame",
        situation.monitor.settings().hmi_probability
    )];
    let is_missing =
        |station: &Station| of_view(station).is_none_or(|view| view.no_level.is_some());
    if stations.iter().any(is_missing) {
        notes.push("no curve: no pose, or no level".to_owned());
    }
    let mut losses = stations.iter().flat_map(|station| &station.without);
    if losses.all(|without| without.worst_level_m().is_infinite()) {
        notes.push("without any one beacon there is no level".to_owned());
    }
    notes
}

/// Returns the causes with the largest share of the variance anywhere, as many as have a colour.
fn main_causes(stations: &[Station], index: usize) -> Vec<String> {
    let mut causes: Vec<(String, f64)> = Vec::new();
    for view in stations
        .iter()
        .filter_map(|station| station.view.as_ref().ok())
    {
        let shares = &view.points[index].shares;
        for axis in 0..3 {
            let total: f64 = shares.iter().map(|share| share.variance_m2[axis]).sum();
            for share in shares {
                let part = share.variance_m2[axis] / total;
                match causes.iter_mut().find(|(known, _)| *known == share.cause) {
                    Some((_, most)) => *most = most.max(part),
                    None => causes.push((share.cause.clone(), part)),
                }
            }
        }
    }
    causes.sort_by(|a, b| b.1.total_cmp(&a.1));
    causes.truncate(COLORS.len());
    causes.into_iter().map(|(cause, _)| cause).collect()
}

fn has_others(stations: &[Station], index: usize, causes: &[String]) -> bool {
    let views = stations.iter().filter_map(of_view);
    let mut shares = views.flat_map(|view| &view.points[index].shares);
    shares.any(|share| !causes.contains(&share.cause))
}

fn curve(stations: &[Station], style: Style, value: impl Fn(&Station) -> Option<f64>) -> Curve {
    // A missing value breaks the axis nowhere: it is not drawn.
    let points = stations
        .iter()
        .map(|station| (station.range_m, value(station).unwrap_or(f64::NAN)));
    Curve {
        points: points.collect(),
        style,
    }
}

fn of_view(station: &Station) -> Option<&View> {
    station.view.as_ref().ok()
}

fn sigma_panel(stations: &[Station], index: usize, axis: usize, causes: &[String]) -> Panel {
    let total = |station: &Station| Some(of_view(station)?.points[index].sigma_m[axis]);
    let smallest_m = stations.iter().filter_map(total).fold(f64::MAX, f64::min) / SMALLEST_DRAWN;
    let of_cause = |station: &Station, is_it: &dyn Fn(&str) -> bool| {
        let shares = &of_view(station)?.points[index].shares;
        let parts = shares.iter().filter(|share| is_it(&share.cause));
        let variance_m2: f64 = parts.map(|share| share.variance_m2[axis]).sum();
        let sigma_m = variance_m2.sqrt();
        (sigma_m > smallest_m).then_some(sigma_m)
    };
    let mut curves = vec![curve(stations, thin(GREY), |station| {
        of_cause(station, &|name| causes.iter().all(|cause| cause != name))
    })];
    curves.extend(causes.iter().zip(COLORS).map(|(cause, color)| {
        curve(stations, plain(color), |station| {
            of_cause(station, &|name| name == cause)
        })
    }));
    curves.push(curve(stations, solid(BLACK), total));
    logarithmic(&format!("sigma {}", AXES[axis]), curves)
}

fn level_panel(stations: &[Station], index: usize, axis: usize) -> Panel {
    let mut names: Vec<&str> = Vec::new();
    for without in stations.iter().flat_map(|station| &station.without) {
        if !names.contains(&without.beacon.as_str()) {
            names.push(&without.beacon);
        }
    }
    let level = |view: &View| view.points[index].level_m.map(|level_m| level_m[axis]);
    let of_loss = |without: &Without| level(without.view.as_ref().ok()?);
    let mut curves: Vec<Curve> = names
        .into_iter()
        .map(|name| {
            curve(stations, thin(GREY), |station| {
                let mut all = station.without.iter();
                of_loss(all.find(|without| without.beacon == name)?)
            })
        })
        .collect();
    curves.push(curve(stations, solid(PURPLE), |station| {
        // None where the loss of any leaves none: then the worst is that.
        let levels: Option<Vec<f64>> = station.without.iter().map(of_loss).collect();
        levels?.into_iter().reduce(f64::max)
    }));
    curves.push(curve(stations, solid(BLACK), |station| {
        level(of_view(station)?)
    }));
    logarithmic(&format!("protection level {}", AXES[axis]), curves)
}

/// Returns a panel in metres, which says so where it is empty.
fn logarithmic(title: &str, curves: Vec<Curve>) -> Panel {
    let mut points = curves.iter().flat_map(|curve| &curve.points);
    if points.any(|point| point.1.is_finite()) {
        Panel {
            title: format!("{title}, m"),
            curves,
            y: Axis::Logarithmic,
        }
    } else {
        Panel {
            title: format!("{title}: none"),
            curves,
            y: Axis::Within(0.0, 1.0),
        }
    }
}

fn view_panel(situation: &Situation, stations: &[Station]) -> Panel {
    let count = situation.map.markers().len() as f64;
    Panel {
        title: "markers in the image; second pose".to_owned(),
        curves: vec![
            curve(stations, solid(BLUE), |station| {
                Some(station.used as f64 / count)
            }),
            curve(stations, dashed(VERMILLION), |station| {
                Some(of_view(station)?.ambiguity)
            }),
        ],
        y: Axis::Within(0.0, 1.0),
    }
}
