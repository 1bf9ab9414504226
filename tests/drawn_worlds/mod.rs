//! Worlds drawn from error budgets, and Monte Carlo estimates of poses in them.

use nalgebra::{Matrix3, SMatrix, Vector3};
use rand::RngExt;
use rayon::prelude::*;
use tanker_pose::estimation::{ErrorBudget, Estimator, EstimatorSettings, Solution};
use tanker_pose::geometry::{pose_error, skew};
use tanker_pose::simulation::{World, paper_camera, pose_in_camera, trial_generator};
use tanker_pose::target::Marker;

use crate::budgets::{calibration_mode, calibration_modes, wing_bending};

const TRIALS: u32 = 2000;
pub const SEED: u64 = 11;
pub const SIGMA_PX: f64 = 0.5;
/// 95 % quantiles of chi-squared with six and three degrees of freedom.
const CHI_SQUARED_6_95: f64 = 12.591_587;
const CHI_SQUARED_3_95: f64 = 7.814_728;
/// m; a point at the tail, amid the markers.
const TAIL: Vector3<f64> = Vector3::new(7.8, 0.0, 1.0);

/// Standard deviations of a world.
#[derive(Clone, Copy, Default)]
pub struct Causes {
    pub survey_m: f64,
    /// Of the wing tips, upwards.
    pub flex_m: f64,
    /// A share.
    pub focal: f64,
    pub principal_point_px: f64,
    pub k1: f64,
    pub jitter_px: f64,
}

pub const EVERYTHING: Causes = Causes {
    survey_m: 0.02,
    flex_m: 0.3,
    focal: 0.003,
    principal_point_px: 3.0,
    k1: 0.02,
    jitter_px: 0.5,
};

impl Causes {
    pub fn budget(&self, markers: &[Marker]) -> ErrorBudget {
        let survey: Vec<(u32, f64)> = markers.iter().map(|m| (m.id, self.survey_m)).collect();
        let places = markers.iter().map(|m| (m.id, m.marker_in_tanker.y));
        let flex = wing_bending(places, self.flex_m, 7.13, None);
        let mut calibration = calibration_modes(self.focal, self.principal_point_px);
        calibration.push(calibration_mode("k1", &[4], self.k1));
        calibration.retain(|mode| mode.change.amax() > 0.0);
        let flex = if self.flex_m > 0.0 {
            vec![flex]
        } else {
            vec![]
        };
        ErrorBudget::new(&survey, flex, calibration, self.jitter_px).expect("a budget")
    }
}

/// Sums over trials, or their means.
#[derive(Default, Clone, Copy)]
pub struct Tally {
    pub trials: f64,
    pub trusted: f64,
    pub nees: f64,
    pub covered: f64,
    pub nees_at_tail: f64,
    pub covered_at_tail: f64,
    pub beyond_30: f64,
}

impl Tally {
    fn plus(self, other: Self) -> Self {
        Self {
            trials: self.trials + other.trials,
            trusted: self.trusted + other.trusted,
            nees: self.nees + other.nees,
            covered: self.covered + other.covered,
            nees_at_tail: self.nees_at_tail + other.nees_at_tail,
            covered_at_tail: self.covered_at_tail + other.covered_at_tail,
            beyond_30: self.beyond_30 + other.beyond_30,
        }
    }

    /// Means over the trusted frames; shares in percent.
    pub fn report(self, name: &str) -> Self {
        let n = self.trusted;
        let means = Self {
            trials: self.trials,
            trusted: 100.0 * n / self.trials,
            nees: self.nees / n,
            covered: 100.0 * self.covered / n,
            nees_at_tail: self.nees_at_tail / n,
            covered_at_tail: 100.0 * self.covered_at_tail / n,
            beyond_30: 100.0 * self.beyond_30 / n,
        };
        println!(
            "{name:32} trusted {:6.2} %, NEES {:5.2}, 95 %: {:5.2}; tail {:4.2}, 95 %: {:5.2}; m² > 30: {:.2} %",
            means.trusted,
            means.nees,
            means.covered,
            means.nees_at_tail,
            means.covered_at_tail,
            means.beyond_30
        );
        means
    }
}

/// Each cause alone, and all at once.
pub fn worlds() -> [(&'static str, Causes); 7] {
    let nothing = Causes::default();
    [
        (
            "survey 2 cm",
            Causes {
                survey_m: 0.02,
                ..nothing
            },
        ),
        (
            "flex 0.3 m",
            Causes {
                flex_m: 0.3,
                ..nothing
            },
        ),
        (
            "focal length 0.3 %",
            Causes {
                focal: 0.003,
                ..nothing
            },
        ),
        (
            "principal point 3 px",
            Causes {
                principal_point_px: 3.0,
                ..nothing
            },
        ),
        (
            "k1 0.02",
            Causes {
                k1: 0.02,
                ..nothing
            },
        ),
        (
            "jitter 0.5 px",
            Causes {
                jitter_px: 0.5,
                ..nothing
            },
        ),
        ("everything", EVERYTHING),
    ]
}

/// Frames of worlds drawn anew each; `adjust` may set what was drawn.
pub fn monte_carlo(
    markers: &[Marker],
    range_m: u16,
    budget: &ErrorBudget,
    estimator: &Estimator,
    adjust: impl Fn(&mut World) + Sync,
) -> Tally {
    let camera = paper_camera();
    let count = u16::try_from(markers.len()).expect("few");
    let ahead_m = f64::from(range_m);
    (0..TRIALS)
        .into_par_iter()
        .map(|trial| {
            let mut random = trial_generator(SEED, count, range_m, trial);
            let mut angle = || random.random_range(-3.0..3.0);
            let (roll, pitch, yaw) = (angle(), angle(), angle());
            let aside = Vector3::new(0.0, 0.3 * angle(), 0.3 * ahead_m + 0.3 * angle());
            let ahead = Vector3::new(ahead_m, 0.0, 0.0);
            let pose = pose_in_camera(ahead + aside, roll, pitch, yaw);
            let mut world = World::draw(&camera, markers, budget, &mut random);
            adjust(&mut world);
            let seen = world.observe(&pose, SIGMA_PX, &mut random);
            let mut tally = Tally {
                trials: 1.0,
                ..Tally::default()
            };
            let Ok(found) = estimator.estimate(&camera, &seen, None) else {
                return tally;
            };
            if !is_flown(&found) {
                return tally;
            }
            let error = pose_error(&found.camera_from_tanker, &pose);
            let nees = found
                .covariance
                .mahalanobis_squared(&error)
                .expect("positive definite");
            let mut by_pose = SMatrix::<f64, 3, 6>::zeros();
            by_pose.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
            let arm = found.camera_from_tanker.rotation * TAIL;
            by_pose.fixed_view_mut::<3, 3>(0, 3).copy_from(&-skew(arm));
            let covariance: Matrix3<f64> = by_pose * found.covariance.0 * by_pose.transpose();
            let off = by_pose * error;
            let at_tail = off.dot(&(covariance.try_inverse().expect("definite") * off));
            let share = |is: bool| if is { 1.0 } else { 0.0 };
            tally.trusted = 1.0;
            tally.nees = nees;
            tally.covered = share(nees < CHI_SQUARED_6_95);
            tally.nees_at_tail = at_tail;
            tally.covered_at_tail = share(at_tail < CHI_SQUARED_3_95);
            tally.beyond_30 = share(nees > 30.0);
            tally
        })
        .reduce(Tally::default, Tally::plus)
}

/// Whether the node would publish it.
fn is_flown(solution: &Solution) -> bool {
    solution.is_trusted() && solution.ambiguity <= EstimatorSettings::default().max_ambiguity
}

pub fn estimator(budget: ErrorBudget) -> Estimator {
    Estimator::new(EstimatorSettings::default()).with_budget(budget)
}
