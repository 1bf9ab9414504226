//! Worlds that depart from what the estimator believes, with the error budget that says so and without.

use std::fmt::Write;
use std::path::PathBuf;

use nalgebra::Vector3;
use rand::RngExt;
use rayon::iter::{IntoParallelIterator, ParallelIterator};
use serde_json::{Value, json};
use tanker_pose::config::CalibrationSigmas;
use tanker_pose::estimation::{ErrorBudget, Estimator, EstimatorSettings, Observation};
use tanker_pose::geometry::pose_error;
use tanker_pose::pipeline::{error_budget, solve};
use tanker_pose::simulation::{World, paper_camera, pose_in_camera, trial_generator};
use tanker_pose::target::{Flex, MapBudget, Marker, MarkerMap};

use crate::plot::panel::{Curve, Figure, Line, Marker as Dot, Panel, Style};
use crate::plot::scale::Axis;
use crate::plot::style::{BLUE, VERMILLION, dashed, solid};

/// px; stated, and true but where it is the departure.
const SIGMA_PX: f64 = 0.5;
/// m ahead.
const RANGE_M: f64 = 15.0;
/// 95 % quantile of chi-squared with six degrees of freedom.
const CHI_SQUARED_6_95: f64 = 12.591_587;
/// A squared error that a right covariance sees in one frame of 25,000.
const WRONG_BY_FAR: f64 = 30.0;
/// m; from the tanker's middle to a wing tip of the paper's map.
const HALF_SPAN_M: f64 = 7.13;
/// Streams of the noise from here on, different from every experiment's.
const STREAM: u16 = 200;

/// One way in which a world differs from what is believed.
struct Departure {
    name: &'static str,
    unit: &'static str,
    title: &'static str,
    /// Standard deviations, but for the factor of the noise.
    sizes: &'static [f64],
    world: fn(f64) -> Causes,
}

/// What a world is drawn from.
#[derive(Default)]
struct Causes {
    survey_m: f64,
    flex_m: f64,
    calibration: CalibrationSigmas,
    /// True noise over the stated one.
    noise: Option<f64>,
}

static DEPARTURES: [Departure; 7] = [
    Departure {
        name: "survey",
        unit: "cm",
        title: "survey of the markers, cm",
        sizes: &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0],
        world: |size| Causes {
            survey_m: 0.01 * size,
            ..Causes::default()
        },
    },
    Departure {
        name: "flex",
        unit: "m",
        title: "wing tips up or down, m",
        sizes: &[0.0, 0.1, 0.2, 0.3, 0.45, 0.6],
        world: |size| Causes {
            flex_m: size,
            ..Causes::default()
        },
    },
    Departure {
        name: "focal_length",
        unit: "%",
        title: "focal length, %",
        sizes: &[0.0, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0],
        world: |size| {
            calibration(CalibrationSigmas {
                focal_length: 0.01 * size,
                ..CalibrationSigmas::default()
            })
        },
    },
    Departure {
        name: "principal_point",
        unit: "px",
        title: "principal point, px",
        sizes: &[0.0, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0],
        world: |size| {
            calibration(CalibrationSigmas {
                principal_point_px: size,
                ..CalibrationSigmas::default()
            })
        },
    },
    Departure {
        name: "k1",
        unit: "1",
        title: "distortion k1",
        sizes: &[0.0, 0.005, 0.01, 0.02, 0.03, 0.04],
        world: |size| {
            calibration(CalibrationSigmas {
                distortion: [size, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
                ..CalibrationSigmas::default()
            })
        },
    },
    Departure {
        name: "jitter",
        unit: "px",
        title: "all points together, px",
        sizes: &[0.0, 0.25, 0.5, 1.0, 1.5, 2.0],
        world: |size| {
            calibration(CalibrationSigmas {
                jitter_px: size,
                ..CalibrationSigmas::default()
            })
        },
    },
    Departure {
        name: "noise",
        unit: "stated sigmas",
        title: "noise, in stated sigmas",
        sizes: &[0.5, 0.75, 1.0, 1.5, 2.0, 2.5, 3.0],
        world: |size| Causes {
            noise: Some(size),
            ..Causes::default()
        },
    },
];

fn calibration(calibration: CalibrationSigmas) -> Causes {
    Causes {
        calibration,
        ..Causes::default()
    }
}

impl Causes {
    /// Returns the budget that says all of it but the noise.
    fn budget(&self, markers: &[Marker]) -> ErrorBudget {
        let bend = |marker: &Marker| {
            let share = (marker.marker_in_tanker.y / HALF_SPAN_M).powi(2);
            (marker.id, Vector3::new(0.0, 0.0, share))
        };
        let map = MapBudget {
            survey_sigma_m: markers.iter().map(|m| (m.id, self.survey_m)).collect(),
            flex: vec![Flex {
                name: "wing_bending".to_owned(),
                sigma_m: self.flex_m,
                time_constant_s: None,
                shape: markers.iter().map(bend).collect(),
            }],
        };
        error_budget(&map, &self.calibration, &[])
    }
}

/// What came out of one size of a departure.
pub struct Point {
    departure: &'static Departure,
    size: f64,
    /// Taken as exact, and with the budget.
    found: [Shares; 2],
}

/// Of the trusted frames, but for `trusted`, which is of all.
#[derive(Clone, Copy, Default)]
struct Shares {
    trusted: f64,
    nees: f64,
    covered: f64,
    wrong_by_far: f64,
}

const NAMES: [&str; 2] = ["taken as exact", "with the budget"];

/// Returns all points; the same whatever the number of threads.
pub fn run(trials: u32, seed: u64) -> Vec<Point> {
    let map = MarkerMap::shipped("paper").expect("the paper's map is shipped");
    let markers = map.markers();
    let mut points = Vec::new();
    for (stream, departure) in (STREAM..).zip(&DEPARTURES) {
        for (index, &size) in (0..).zip(departure.sizes) {
            let causes = (departure.world)(size);
            let budget = causes.budget(markers);
            let exact = Estimator::new(EstimatorSettings::default());
            let told = exact.clone().with_budget(budget.clone());
            let noise = causes.noise.unwrap_or(1.0);
            let frames: Vec<[Option<f64>; 2]> = (0..trials)
                .into_par_iter()
                .map(|trial| {
                    let mut random = trial_generator(seed, stream, index, trial);
                    let mut angle = || random.random_range(-3.0..3.0);
                    let (roll, pitch, yaw) = (angle(), angle(), angle());
                    let aside = Vector3::new(0.0, 0.3 * angle(), 0.3 * RANGE_M + 0.3 * angle());
                    let truth = pose_in_camera(Vector3::x() * RANGE_M + aside, roll, pitch, yaw);
                    let world = World::draw(&paper_camera(), markers, &budget, &mut random);
                    let seen = world.observe(&truth, noise * SIGMA_PX, &mut random);
                    // Noise has no budget but its sigma.
                    let sigmas = [SIGMA_PX, noise * SIGMA_PX];
                    [(&exact, sigmas[0]), (&told, sigmas[1])].map(|(estimator, sigma_px)| {
                        let seen: Vec<Observation> = seen
                            .iter()
                            .map(|seen| Observation { sigma_px, ..*seen })
                            .collect();
                        let outcome = solve(estimator, &paper_camera(), &seen, None);
                        let found = outcome.result.ok()?;
                        let error = pose_error(&found.camera_from_tanker, &truth);
                        found.covariance.mahalanobis_squared(&error)
                    })
                })
                .collect();
            points.push(Point {
                departure,
                size,
                found: [0, 1].map(|which| Shares::of(frames.iter().map(|both| both[which]))),
            });
        }
    }
    points
}

impl Shares {
    fn of(frames: impl Iterator<Item = Option<f64>>) -> Self {
        let (mut all, mut sum) = (0.0, Self::default());
        for frame in frames {
            all += 1.0;
            let Some(squared) = frame else { continue };
            let one_if = |is: bool| f64::from(u8::from(is));
            sum.trusted += 1.0;
            sum.nees += squared;
            sum.covered += one_if(squared <= CHI_SQUARED_6_95);
            sum.wrong_by_far += one_if(squared > WRONG_BY_FAR);
        }
        Self {
            trusted: sum.trusted / all,
            nees: sum.nees / sum.trusted,
            covered: sum.covered / sum.trusted,
            wrong_by_far: sum.wrong_by_far / sum.trusted,
        }
    }

    fn json(self) -> Value {
        json!({
            "trusted": self.trusted,
            "nees": self.nees,
            "covered": self.covered,
            "wrong_by_far": self.wrong_by_far,
        })
    }
}

/// Returns one line for each size of a departure.
pub fn csv(points: &[Point]) -> String {
    let mut text = String::from("departure,unit,size");
    for name in ["exact", "budget"] {
        // Writing into a String cannot fail.
        let _ = write!(
            text,
            ",{name}_trusted,{name}_nees,{name}_coverage,{name}_beyond_30"
        );
    }
    text.push('\n');
    for point in points {
        let Departure { name, unit, .. } = point.departure;
        let _ = write!(text, "{name},{unit},{}", point.size);
        for found in point.found {
            let Shares {
                trusted,
                nees,
                covered,
                wrong_by_far,
            } = found;
            let _ = write!(
                text,
                ",{trusted:.5},{nees:.4},{covered:.5},{wrong_by_far:.5}"
            );
        }
        text.push('\n');
    }
    text
}

/// Returns a table for people.
pub fn text(points: &[Point], trials: u32) -> String {
    let mut table = format!(
        "six points at {RANGE_M} m, {SIGMA_PX} px, {trials} frames a line; NEES (6 is right) and coverage of the 95 % \
         ellipsoid are those of the trusted frames\n{:<34}{:^42}{:^42}\n{:<34}",
        "", NAMES[0], NAMES[1], "departure (1 sigma)"
    );
    for _ in NAMES {
        let _ = write!(
            table,
            "{:>11}{:>9}{:>9}{:>13}",
            "trusted %", "NEES", "95 %", "m² > 30 %"
        );
    }
    table.push('\n');
    for point in points {
        let Departure { title, .. } = point.departure;
        let _ = write!(table, "{title:<26}{:>7} ", point.size);
        for found in point.found {
            let percent = |share: f64| 100.0 * share;
            let _ = write!(
                table,
                "{:>11.2}{:>9.2}{:>9.1}{:>13.2}",
                percent(found.trusted),
                found.nees,
                percent(found.covered),
                percent(found.wrong_by_far),
            );
        }
        table.push('\n');
    }
    table
}

/// Returns everything that the table holds.
pub fn json(points: &[Point], files: &[PathBuf], seed: u64) -> Value {
    let files: Vec<_> = files.iter().map(|f| f.display().to_string()).collect();
    let departures: Value = points
        .iter()
        .map(|point| {
            json!({
                "departure": point.departure.name,
                "unit": point.departure.unit,
                "size": point.size,
                "exact": point.found[0].json(),
                "budget": point.found[1].json(),
            })
        })
        .collect();
    json!({"seed": seed, "files": files, "departures": departures})
}

/// Returns the figures with their names: NEES, and shares.
pub fn figures(points: &[Point], trials: u32) -> [(&'static str, Figure); 2] {
    let [exact, budget] = [VERMILLION, BLUE];
    let named = |style: fn(_) -> Style| {
        [(NAMES[0], style(exact)), (NAMES[1], style(budget))]
            .map(|(name, style)| (name.to_owned(), style))
    };
    let notes = vec![
        format!("six points at {RANGE_M} m, {SIGMA_PX} px"),
        format!("{trials} frames a point"),
        "departures: 1 sigma, drawn for each frame".to_owned(),
        "noise: with the budget, the true sigma is stated".to_owned(),
    ];
    let mut legend = named(solid).to_vec();
    legend.push(("right: 6".to_owned(), right()));
    let nees = Figure {
        title: "Squared error in sigmas (NEES), mean over the trusted frames".to_owned(),
        x_label: "departure",
        panels: panels(points, Axis::Decades(1.0, 5000.0), |departure| {
            let mut curves = both(points, departure, solid, |found| found.nees).to_vec();
            curves.push(level(departure, 6.0));
            curves
        }),
        legend,
        notes: notes.clone(),
    };
    let mut legend = named(solid).to_vec();
    legend.push(("right: 95 %".to_owned(), right()));
    legend.push(("frames that are trusted, %".to_owned(), dashed(exact)));
    legend.push(("the same, with the budget".to_owned(), dashed(budget)));
    let coverage = Figure {
        title: "Trusted frames with the truth in the 95 % ellipsoid, %".to_owned(),
        x_label: "departure",
        panels: panels(points, Axis::Within(0.0, 104.0), |departure| {
            let trusted = both(points, departure, dashed, |found| 100.0 * found.trusted);
            let covered = both(points, departure, solid, |found| 100.0 * found.covered);
            let mut curves = [trusted, covered].concat();
            // Last, so that it lies above the curves that reach it.
            curves.push(level(departure, 95.0));
            curves
        }),
        legend,
        notes,
    };
    [("departures_nees", nees), ("departures_coverage", coverage)]
}

fn panels(
    points: &[Point],
    y: Axis,
    curves: impl Fn(&'static Departure) -> Vec<Curve>,
) -> Vec<Panel> {
    let mut departures: Vec<&'static Departure> =
        points.iter().map(|point| point.departure).collect();
    departures.dedup_by_key(|departure| departure.name);
    let panel = |departure: &'static Departure| Panel {
        title: departure.title.to_owned(),
        curves: curves(departure),
        y,
    };
    departures.into_iter().map(panel).collect()
}

fn both(
    points: &[Point],
    departure: &'static Departure,
    style: fn(plotters::style::RGBColor) -> Style,
    value: impl Fn(&Shares) -> f64,
) -> [Curve; 2] {
    [(0, VERMILLION), (1, BLUE)].map(|(which, color)| Curve {
        points: points
            .iter()
            .filter(|point| point.departure.name == departure.name)
            .map(|point| (point.size, value(&point.found[which])))
            .collect(),
        style: style(color),
    })
}

fn level(departure: &Departure, value: f64) -> Curve {
    let ends = [departure.sizes.first(), departure.sizes.last()];
    Curve {
        points: ends
            .into_iter()
            .flatten()
            .map(|size| (*size, value))
            .collect(),
        style: right(),
    }
}

fn right() -> Style {
    Style {
        color: plotters::style::BLACK,
        line: Line::Thin,
        marker: Dot::None,
    }
}
