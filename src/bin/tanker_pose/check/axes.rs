//! Hypotheses about a map's axes, held against a recording: which axis points the other way, or is exchanged.

use std::cmp::Reverse;

use nalgebra::{Matrix3, Point3, Rotation3, UnitQuaternion, Vector3};
use tanker_pose::estimation::{Estimator, EstimatorSettings, Initialisation};
use tanker_pose::pipeline;
use tanker_pose::target::MarkerMap;

use super::recording::Frame;

/// A tanker turned farther from the nominal attitude than this is not flying along, rad.
const TURNED: f64 = std::f64::consts::FRAC_PI_4;
/// A chi-squared so much smaller decides between hypotheses that both fit.
const FAR_BETTER: f64 = 0.5;

/// What the true coordinates are, made from the map's: each is one of them or its negative.
#[derive(Debug, Clone, PartialEq)]
pub struct Hypothesis {
    pub true_from_map: Matrix3<f64>,
}

/// How a map fits a recording.
#[derive(Debug, Clone, Default)]
pub struct Fit {
    pub frames: usize,
    /// Accepted, and near the nominal attitude.
    pub good: usize,
    /// Accepted, but turned away from it.
    pub turned: usize,
    /// Why the others are refused, with how often; most frequent first.
    pub refusals: Vec<(String, usize)>,
    /// Over the frames with a fit of all points.
    pub chi_squared: f64,
    pub degrees_of_freedom: f64,
    /// Distances of the accepted poses, ascending, m.
    pub distances_m: Vec<f64>,
    /// Ids that accepted frames left out as wrong, with how often.
    pub excluded: Vec<(u32, usize)>,
}

impl Fit {
    /// Returns the share of good frames.
    pub fn share(&self) -> f64 {
        self.good as f64 / self.frames.max(1) as f64
    }

    /// Returns whether as many frames are good as the test of the residuals lets pass, with room for a few faults.
    pub fn is_good(&self, trust_probability: f64) -> bool {
        self.share() >= 0.8 * trust_probability
    }

    /// Returns chi-squared over its degrees of freedom; 1 where sigmas are right.
    pub fn ratio(&self) -> f64 {
        self.chi_squared / self.degrees_of_freedom
    }

    /// Returns the distance in the middle of all, m.
    pub fn median_distance_m(&self) -> Option<f64> {
        self.distances_m.get(self.distances_m.len() / 2).copied()
    }
}

impl Hypothesis {
    /// Returns all 48, the likelier mistakes first, the map as it is before all.
    pub fn all() -> Vec<Self> {
        let mut all: Vec<Self> = Vec::with_capacity(48);
        let permutations = [
            [0, 1, 2],
            [1, 0, 2],
            [0, 2, 1],
            [2, 1, 0],
            [1, 2, 0],
            [2, 0, 1],
        ];
        for permutation in permutations {
            for signs in 0..8_u8 {
                let sign = |axis: usize| if signs >> axis & 1 == 1 { -1.0 } else { 1.0 };
                let true_from_map = Matrix3::from_fn(|row, column| {
                    if permutation[row] == column {
                        sign(row)
                    } else {
                        0.0
                    }
                });
                all.push(Self { true_from_map });
            }
        }
        // Rotations are mistakes about a convention, reflections ones of a sign: conventions are the likelier.
        all.sort_by_key(|hypothesis| {
            let exchanged = (0..3)
                .filter(|&axis| hypothesis.true_from_map[(axis, axis)] == 0.0)
                .count();
            (
                exchanged,
                hypothesis.is_mirror() && !hypothesis.is_left_right(),
            )
        });
        all
    }

    pub fn is_as_given(&self) -> bool {
        self.true_from_map == Matrix3::identity()
    }

    fn is_mirror(&self) -> bool {
        self.true_from_map.determinant() < 0.0
    }

    fn is_left_right(&self) -> bool {
        self.true_from_map == Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, 1.0))
    }

    /// Returns the true place of a marker.
    pub fn place(&self, marker: Point3<f64>) -> Point3<f64> {
        Point3::from(self.true_from_map * marker.coords)
    }

    /// Returns what is wrong with the map.
    pub fn in_words(&self) -> String {
        let diagonal = self.true_from_map.diagonal();
        let signs = [diagonal.x, diagonal.y, diagonal.z];
        match signs {
            [1.0, 1.0, 1.0] => "the map as it is".to_owned(),
            [-1.0, -1.0, 1.0] => "x of the map points aft and y right".to_owned(),
            [1.0, -1.0, -1.0] => {
                "y of the map points right and z down, as axes of aircraft do".to_owned()
            }
            [-1.0, 1.0, -1.0] => "x of the map points aft and z down".to_owned(),
            [1.0, -1.0, 1.0] => {
                "left and right are exchanged: y of the map points right, or the ids of left and right beacons are exchanged"
                    .to_owned()
            }
            [-1.0, 1.0, 1.0] => "x of the map points aft, while y points left and z up".to_owned(),
            [1.0, 1.0, -1.0] => "z of the map points down, while x points ahead and y left".to_owned(),
            [-1.0, -1.0, -1.0] => "every axis of the map points the wrong way".to_owned(),
            _ => format!("axes of the map are exchanged: the true ones are {}", self.formula()),
        }
    }

    /// Returns how the coordinates are put right.
    pub fn advice(&self) -> String {
        format!(
            "write {} for x, y, z of every marker, turn tags and points along, and check again",
            self.formula()
        )
    }

    fn formula(&self) -> String {
        let row = |row: usize| {
            let column = (0..3).find(|&column| self.true_from_map[(row, column)] != 0.0);
            let name = ["x", "y", "z"][column.unwrap_or(row)];
            if self.true_from_map.row(row).sum() < 0.0 {
                format!("-{name}")
            } else {
                name.to_owned()
            }
        };
        format!("({}, {}, {})", row(0), row(1), row(2))
    }
}

/// Returns how a map fits, if a hypothesis about it is true.
pub fn fit(
    frames: &[Frame],
    map: &MarkerMap,
    hypothesis: &Hypothesis,
    estimator: &Estimator,
    sigma_px: f64,
    margin_px: f64,
) -> Fit {
    let mut found = Fit {
        frames: frames.len(),
        ..Fit::default()
    };
    let nominal = estimator.settings().nominal_camera_from_tanker;
    for frame in frames {
        let place = |id| map.get(id).map(|marker| hypothesis.place(marker));
        let observations = match frame.observations(sigma_px, margin_px, place) {
            Ok(observations) => observations,
            Err(reason) => {
                found.count(reason);
                continue;
            }
        };
        let outcome = pipeline::solve(estimator, &frame.sight.camera, &observations, None);
        let solution = outcome.result.as_ref().ok().or(outcome.doubtful.as_ref());
        if let Some(solution) = solution {
            let (chi_squared, degrees_of_freedom) = solution.of_all_points();
            if chi_squared.is_finite() {
                found.chi_squared += chi_squared;
                found.degrees_of_freedom += f64::from(degrees_of_freedom);
            }
        }
        match &outcome.result {
            Ok(solution) => {
                let pose = &solution.camera_from_tanker;
                if turn(&pose.rotation, &nominal) > TURNED {
                    found.turned += 1;
                } else {
                    found.good += 1;
                }
                let distance_m = pose.translation.vector.norm();
                found.distances_m.push(distance_m);
                for id in solution.excluded.ids() {
                    match found.excluded.iter_mut().find(|(known, _)| *known == id) {
                        Some((_, count)) => *count += 1,
                        None => found.excluded.push((id, 1)),
                    }
                }
            }
            Err(refusal) => found.count(outcome_name(refusal)),
        }
    }
    found.distances_m.sort_unstable_by(f64::total_cmp);
    found.refusals.sort_by_key(|(_, count)| Reverse(*count));
    found.excluded.sort_by_key(|(_, count)| Reverse(*count));
    found
}

impl Fit {
    fn count(&mut self, reason: String) {
        match self.refusals.iter_mut().find(|(known, _)| *known == reason) {
            Some((_, count)) => *count += 1,
            None => self.refusals.push((reason, 1)),
        }
    }
}

/// Returns the kind of a refusal: its message has numbers that differ in each frame.
fn outcome_name(refusal: &pipeline::Refusal) -> String {
    refusal.code().name().to_ascii_lowercase()
}

fn turn(found: &UnitQuaternion<f64>, nominal: &Rotation3<f64>) -> f64 {
    (found.to_rotation_matrix() * nominal.inverse()).angle()
}

/// Returns the hypothesis that fits best, with its fit; the earlier of two that fit alike.
pub fn best(
    frames: &[Frame],
    map: &MarkerMap,
    estimator: &Estimator,
    sigma_px: f64,
    margin_px: f64,
) -> (Hypothesis, Fit) {
    // Another start would find the pose that is turned as the axes are.
    let estimator = {
        let nominal = Estimator::new(EstimatorSettings {
            initialisation: Initialisation::Nominal,
            ..estimator.settings().clone()
        });
        match estimator.budget() {
            Some(budget) => nominal.with_budget(budget.clone()),
            None => nominal,
        }
    };
    let mut best: Option<(Hypothesis, Fit)> = None;
    for hypothesis in Hypothesis::all() {
        let fit = fit(frames, map, &hypothesis, &estimator, sigma_px, margin_px);
        let is_better = best.as_ref().is_none_or(|(_, best)| {
            // A few frames more are no reason to turn the axes of a map; a fit that is far better is.
            fit.good > best.good && best.good as f64 <= 0.9 * fit.good as f64
                || fit.good as f64 >= 0.9 * best.good as f64
                    && fit.ratio() < FAR_BETTER * best.ratio()
        });
        if is_better {
            best = Some((hypothesis, fit));
        }
    }
    best.unwrap_or_else(|| {
        let given = Hypothesis {
            true_from_map: Matrix3::identity(),
        };
        (given, Fit::default())
    })
}
