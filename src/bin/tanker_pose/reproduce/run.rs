//! One approach with moving attitude, as the paper's Fig. 8 shows it: values that the methods find,
//! against the truth.

use std::fmt::Write;

use nalgebra::Vector6;
use tanker_pose::simulation::{
    Approach, ApproachSettings, Method, PAPER_COORDINATES, PAPER_UNITS, Scene, Solver, Stop,
    paper_camera, paper_coordinates, trial_generator,
};
use tanker_pose::target::MarkerMap;

use crate::plot::panel::{Curve, Figure, Line, Marker, Panel, Style};
use crate::plot::scale::Axis;
use crate::plot::style::{BLUE, GREEN, PURPLE, VERMILLION};

/// Stream of the run's noise, different from every experiment's.
const STREAM: u16 = 100;
/// px; as in Fig. 8.
const SIGMA_PX: f64 = 0.5;
/// degrees; amplitude of each angle.
const ATTITUDE_DEG: f64 = 4.0;
/// degrees, and below it m; half the height of a panel: what is beyond it is on its edge.
const MAX_ANGLE_DEG: f64 = 8.0;
const MAX_POSITION_ERROR_M: [f64; 3] = [2.0, 1.0, 1.0];

pub struct Run {
    images: Vec<Image>,
}

struct Image {
    time_s: f64,
    truth: Vector6<f64>,
    /// In the order of [`Method::ALL`].
    found: Vec<Option<Vector6<f64>>>,
}

impl Run {
    /// Returns an approach from 60 m to 15 m, the nearest at which the image holds the wing tips.
    pub fn new(seed: u64, rate_hz: f64) -> Self {
        let solver = Solver::default();
        let settings = ApproachSettings {
            rate_hz,
            sigma_px: SIGMA_PX,
            attitude_deg: ATTITUDE_DEG,
            seed,
            ..ApproachSettings::default()
        };
        let map = MarkerMap::shipped("paper").expect("the paper's map is shipped");
        let approach = Approach::new(settings, paper_camera(), map.clone());
        let images = (0..approach.frame_count())
            .map(|index| {
                let frame = approach.frame(index);
                let truth = frame.truth_camera_from_tanker;
                let scene = Scene::new(paper_camera(), &map, truth);
                let mut random = trial_generator(seed, STREAM, 0, index);
                let seen = scene.noisy_observations(SIGMA_PX, &mut random);
                let found = Method::ALL.map(|method| {
                    let solved = solver.solve(method, scene.camera(), &seen, Stop::Converged);
                    solved.ok().map(|(pose, _)| paper_coordinates(&pose))
                });
                Image {
                    time_s: frame.time_s,
                    truth: paper_coordinates(&truth),
                    found: found.to_vec(),
                }
            })
            .collect();
        Self { images }
    }

    /// Returns one line for each image and method, the truth first.
    pub fn csv(&self) -> String {
        let columns: Vec<String> = PAPER_COORDINATES
            .iter()
            .zip(PAPER_UNITS)
            .map(|(name, unit)| format!("{name}_{unit}"))
            .collect();
        let mut text = format!("time_s,method,{}\n", columns.join(","));
        for image in &self.images {
            let found = Method::ALL
                .iter()
                .zip(&image.found)
                .filter_map(|(method, found)| Some((method.name(), found.as_ref()?)));
            for (name, values) in std::iter::once(("truth", &image.truth)).chain(found) {
                let values: Vec<String> = values.iter().map(|v| format!("{v:.6}")).collect();
                // Writing into a String cannot fail.
                let _ = writeln!(text, "{},{name},{}", image.time_s, values.join(","));
            }
        }
        text
    }

    /// Returns the angles beside their truth, and the errors of the position, over time.
    pub fn figure(&self) -> Figure {
        let styles = [
            ("In_M1 alone", GREEN, Marker::Speck),
            ("In_M1+OI", PURPLE, Marker::Ring),
            ("In_M2+OI", BLUE, Marker::Dot),
            ("maximum likelihood", VERMILLION, Marker::Speck),
        ]
        .map(|(name, color, marker)| (name.to_owned(), style(color, Line::None, marker)));
        let truth = style(plotters::style::BLACK, Line::Solid, Marker::None);
        let mut legend = styles.to_vec();
        legend.push(("truth".to_owned(), truth));
        let mut panels: Vec<Panel> = (0..6)
            .map(|i| {
                let mut curves: Vec<Curve> = (0..)
                    .zip(&styles)
                    .map(|(m, (_, style))| self.curve(*style, |image| image.value(m, i)))
                    .collect();
                curves.push(self.curve(truth, |image| Some(image.shown_truth(i))));
                panel(i, curves)
            })
            .collect();
        panels.push(Panel {
            title: "x, m".to_owned(),
            curves: vec![self.curve(truth, |image| Some(image.truth[3]))],
            y: Axis::FromZero,
        });
        Figure {
            title: "Fig. 8: one approach, values of the methods against the truth".to_owned(),
            x_label: "time, s",
            panels,
            legend,
            notes: vec![
                format!("noise {SIGMA_PX} px, {} images", self.images.len()),
                "beyond a panel: drawn on its edge".to_owned(),
            ],
        }
    }

    fn curve(&self, style: Style, value: impl Fn(&Image) -> Option<f64>) -> Curve {
        Curve {
            points: self
                .images
                .iter()
                .filter_map(|image| Some((image.time_s, value(image)?)))
                .collect(),
            style,
        }
    }
}

impl Image {
    /// An angle as it is, a position as its error: next to 60 m an error of 0.3 m is not seen.
    fn value(&self, method: usize, i: usize) -> Option<f64> {
        let found = self.found[method].as_ref()?[i];
        Some(if i < 3 { found } else { found - self.truth[i] })
    }

    fn shown_truth(&self, i: usize) -> f64 {
        if i < 3 { self.truth[i] } else { 0.0 }
    }
}

fn panel(i: usize, curves: Vec<Curve>) -> Panel {
    let (name, unit) = (PAPER_COORDINATES[i], PAPER_UNITS[i]);
    let (title, limit) = if i < 3 {
        (format!("{name}, {unit}"), MAX_ANGLE_DEG)
    } else {
        let limit = MAX_POSITION_ERROR_M[i - 3];
        (format!("{name} minus truth, {unit}"), limit)
    };
    Panel {
        title,
        curves,
        y: Axis::Within(-limit, limit),
    }
}

fn style(color: plotters::style::RGBColor, line: Line, marker: Marker) -> Style {
    Style {
        color,
        line,
        marker,
    }
}
