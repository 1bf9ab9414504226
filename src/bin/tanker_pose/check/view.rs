//! What one image is good for: sigmas by cause, and protection levels.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Matrix3x6, RowVector6};
use tanker_pose::estimation::{Estimator, Expected, Observation, Solution};
use tanker_pose::geometry::{PoseCovariance, skew};
use tanker_pose::integrity::SolvedFrame;
use tanker_pose::pipeline;

use super::situation::Situation;

/// Axes of the receiver, in the order of all triples.
pub const AXES: [&str; 3] = ["ahead", "lateral", "vertical"];

/// What one image is good for.
#[derive(Debug, Clone)]
pub struct View {
    pub ambiguity: f64,
    /// In the order of the monitor's points.
    pub points: Vec<PointView>,
    /// Why there is no protection level; `None`: there is one.
    pub no_level: Option<String>,
}

/// One declared point; triples are ahead, lateral, vertical in the receiver.
#[derive(Debug, Clone)]
pub struct PointView {
    /// Standard deviations, mount and point included, m.
    pub sigma_m: [f64; 3],
    /// Variance by cause, m², the largest on any axis first.
    pub shares: Vec<Share>,
    /// Protection levels, m.
    pub level_m: Option<[f64; 3]>,
    /// What has the largest part in each level; `None`: noise and budget alone.
    pub weakest: [Option<String>; 3],
}

/// One cause of error at one point.
#[derive(Debug, Clone)]
pub struct Share {
    pub cause: String,
    pub variance_m2: [f64; 3],
}

impl View {
    /// Returns the largest level of all axes and points, m; infinite without levels.
    pub fn worst_level_m(&self) -> f64 {
        let levels = self.points.iter().map(|point| point.level_m);
        levels
            .map(|level| level.map_or(f64::INFINITY, |level| largest(&level).1))
            .fold(0.0, f64::max)
    }

    /// Returns the largest sigma of all axes and points, m.
    pub fn worst_sigma_m(&self) -> f64 {
        let sigmas = self.points.iter().map(|point| largest(&point.sigma_m).1);
        sigmas.fold(0.0, f64::max)
    }
}

/// Returns the axis with the largest value, and the value.
pub fn largest(values: &[f64; 3]) -> (usize, f64) {
    let of_axis = values.iter().copied().enumerate();
    of_axis
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .unwrap_or((0, 0.0))
}

/// Whether the share of each cause is wanted too.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wanted {
    Shares,
    LevelsOnly,
}

/// Returns what these observations are good for, or why the node would refuse them.
pub fn view(
    situation: &Situation,
    estimator: &Estimator,
    observations: &[Observation],
    wanted: Wanted,
) -> Result<View, String> {
    let camera = &situation.camera;
    let outcome = pipeline::solve(estimator, camera, observations, None);
    let solution = outcome.result.map_err(|refusal| refusal.to_string())?;
    let monitor = &situation.monitor;
    let judged = monitor.judge(&SolvedFrame {
        estimator,
        map: Some(&situation.map),
        camera,
        observations,
        solution: &solution,
    });
    let mode = |index: usize| {
        let name = estimator
            .budget()
            .and_then(|budget| budget.mode_name(index));
        name.map_or_else(|| format!("mode {index}"), str::to_owned)
    };
    let causes = match wanted {
        Wanted::Shares => estimator.causes(camera, observations, &solution, &Expected::default()),
        Wanted::LevelsOnly => None,
    };
    let causes = causes.map_or_else(Vec::new, |causes| causes.causes);
    let points = monitor.points().iter().enumerate().map(|(index, point)| {
        let axes = Axes::new(situation, &solution, &point.point_in_tanker.coords.into());
        let mut shares: BTreeMap<String, [f64; 3]> = BTreeMap::new();
        let mut add = |cause: &str, variance_m2: [f64; 3]| {
            let sum = shares.entry(cause.to_owned()).or_default();
            (0..3).for_each(|axis| sum[axis] += variance_m2[axis].max(0.0));
        };
        let of_solution = axes.by_pose(&solution.covariance);
        for cause in &causes {
            add(&cause.name, axes.by_pose(&cause.covariance));
        }
        let fixed = [
            ("mount", axes.by_mount(situation)),
            ("point", axes.by_point(&point.covariance)),
        ];
        let mut variance_m2 = of_solution;
        for (name, of_fixed) in fixed {
            add(name, of_fixed);
            (0..3).for_each(|axis| variance_m2[axis] += of_fixed[axis].max(0.0));
        }
        let mut shares: Vec<Share> = shares
            .into_iter()
            .filter(|(_, variance_m2)| variance_m2.iter().any(|value| *value > 0.0))
            .map(|(cause, variance_m2)| Share { cause, variance_m2 })
            .collect();
        shares.sort_by(|a, b| {
            largest(&b.variance_m2)
                .1
                .total_cmp(&largest(&a.variance_m2).1)
        });
        let found = judged.as_ref().ok().map(|found| &found.points[index]);
        let weakest = found.map_or([None; 3], |found| found.weakest);
        PointView {
            sigma_m: found.map_or(variance_m2.map(f64::sqrt), |found| found.sigma_m),
            shares,
            level_m: found.map(|found| found.level_m),
            weakest: weakest.map(|fault| fault.map(|fault| fault.in_words(mode))),
        }
    });
    Ok(View {
        ambiguity: solution.ambiguity,
        points: points.collect(),
        no_level: judged.as_ref().err().map(|reason| reason.in_words(mode)),
    })
}

/// Derivatives of a point's position in the receiver.
struct Axes {
    by_pose: Matrix3x6<f64>,
    by_mount: Matrix3x6<f64>,
    receiver_from_tanker: Matrix3<f64>,
}

impl Axes {
    fn new(
        situation: &Situation,
        solution: &Solution,
        point_in_tanker: &nalgebra::Point3<f64>,
    ) -> Self {
        let pose = &solution.camera_from_tanker;
        let receiver = *situation.receiver_from_camera.matrix();
        let arm = pose.rotation * point_in_tanker.coords;
        let derivative = |axes: &Matrix3<f64>, arm| {
            let mut by = Matrix3x6::zeros();
            by.fixed_view_mut::<3, 3>(0, 0).copy_from(axes);
            by.fixed_view_mut::<3, 3>(0, 3)
                .copy_from(&(axes * -skew(arm)));
            by
        };
        let from_mount = receiver * (arm + pose.translation.vector);
        Self {
            by_pose: derivative(&receiver, arm),
            by_mount: derivative(&Matrix3::identity(), from_mount),
            receiver_from_tanker: receiver * pose.rotation.to_rotation_matrix().matrix(),
        }
    }

    fn by_pose(&self, covariance: &PoseCovariance) -> [f64; 3] {
        variances(&self.by_pose, covariance)
    }

    fn by_mount(&self, situation: &Situation) -> [f64; 3] {
        situation.geometry.as_ref().map_or([0.0; 3], |geometry| {
            variances(&self.by_mount, &geometry.mount_covariance)
        })
    }

    fn by_point(&self, covariance: &Matrix3<f64>) -> [f64; 3] {
        let turned = self.receiver_from_tanker * covariance * self.receiver_from_tanker.transpose();
        [0, 1, 2].map(|axis| turned[(axis, axis)])
    }
}

fn variances(by: &Matrix3x6<f64>, covariance: &PoseCovariance) -> [f64; 3] {
    [0, 1, 2].map(|axis| {
        let row: RowVector6<f64> = by.row(axis).into_owned();
        (row * covariance.0).dot(&row)
    })
}
