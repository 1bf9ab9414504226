//! Shared by the statistics tests: random frames, and a maximum likelihood fit written apart from the
//! estimator's (numerical derivatives, started at the truth) to hold it against.

#![allow(dead_code)] // each test binary uses its part

use std::sync::LazyLock;

use nalgebra::{
    Isometry3, Matrix6, Quaternion, Translation3, UnitQuaternion, Vector3, Vector4, Vector6,
};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use tanker_pose::camera::{Camera, Ray};
use tanker_pose::estimation::{
    EstimatorSettings, Initialisation, Observation, Refinement, Solution,
};
use tanker_pose::geometry::pose_error;
use tanker_pose::simulation::{Scene, paper_camera, pose_in_camera};
use tanker_pose::target::{Marker, MarkerMap};

/// Read once: parsing the YAML takes longer than a frame.
pub static PAPER_MAP: LazyLock<MarkerMap> =
    LazyLock::new(|| MarkerMap::shipped("paper").expect("shipped"));

/// Settings that only estimate: any three points will do, none is left out, and no rival pose refuses one.
pub fn settings(initialisation: Initialisation, refinement: Refinement) -> EstimatorSettings {
    EstimatorSettings {
        initialisation,
        refinement,
        min_points: 3,
        max_outliers: 0,
        max_ambiguity: 1.0,
        ..Default::default()
    }
}

/// The paper's markers seen along its route, t = (r, 0, 0.3 r), with ±5° on each axis.
pub fn random_refuelling_scene(
    random: &mut ChaCha8Rng,
    min_range_m: f64,
    max_range_m: f64,
) -> Scene {
    let range_m = random.random_range(min_range_m..max_range_m);
    let mut angle = || random.random_range(-5.0..5.0);
    let pose = pose_in_camera(
        Vector3::new(range_m, 0.0, 0.3 * range_m),
        angle(),
        angle(),
        angle(),
    );
    Scene::new(paper_camera(), &PAPER_MAP, pose)
}

/// Six points in general position about the tanker's origin, at any attitude, 15 m ahead.
pub fn random_attitude_scene(random: &mut ChaCha8Rng, count: u32) -> Scene {
    let markers = (1..=count)
        .map(|id| Marker {
            id,
            marker_in_tanker: nalgebra::Point3::from(Vector3::from_fn(|_, _| {
                random.random_range(-4.0..4.0)
            })),
        })
        .collect();
    let q = Vector4::from_fn(|_, _| StandardNormal.sample(random));
    let pose = Isometry3::from_parts(
        Translation3::new(
            random.random_range(-2.0..2.0),
            random.random_range(-2.0..2.0),
            random.random_range(12.0..25.0),
        ),
        UnitQuaternion::from_quaternion(Quaternion::from(q)),
    );
    Scene::with_markers(paper_camera(), markers, pose)
}

fn residuals(
    camera: &Camera,
    observations: &[Observation],
    pose: &Isometry3<f64>,
) -> Option<Vec<f64>> {
    let mut residuals = Vec::with_capacity(2 * observations.len());
    for seen in observations {
        let q = pose * seen.marker_in_tanker;
        if q.z <= 0.0 {
            return None;
        }
        let (pixel, _) = camera.project(Ray {
            x: q.x / q.z,
            y: q.y / q.z,
        })?;
        residuals.push((pixel.u - seen.pixel.u) / seen.sigma_px);
        residuals.push((pixel.v - seen.pixel.v) / seen.sigma_px);
    }
    Some(residuals)
}

fn moved(pose: &Isometry3<f64>, step: &Vector6<f64>) -> Isometry3<f64> {
    Isometry3::from_parts(
        Translation3::from(pose.translation.vector + step.fixed_rows::<3>(0)),
        UnitQuaternion::from_scaled_axis(step.fixed_rows::<3>(3).into_owned()) * pose.rotation,
    )
}

/// Levenberg-Marquardt from `start`; `None` when it does not settle.
pub fn oracle_maximum_likelihood(
    camera: &Camera,
    observations: &[Observation],
    start: &Isometry3<f64>,
) -> Option<Isometry3<f64>> {
    const H: f64 = 1e-6;
    let mut pose = *start;
    let mut here = residuals(camera, observations, &pose)?;
    let mut damping = 1e-6;
    for _ in 0..200 {
        let mut information = Matrix6::zeros();
        let mut gradient = Vector6::zeros();
        let columns: Vec<Vec<f64>> = (0..6)
            .map(|axis| {
                let mut step = Vector6::zeros();
                step[axis] = H;
                let plus = residuals(camera, observations, &moved(&pose, &step))?;
                let minus = residuals(camera, observations, &moved(&pose, &-step))?;
                Some(
                    plus.iter()
                        .zip(&minus)
                        .map(|(p, m)| (p - m) / (2.0 * H))
                        .collect(),
                )
            })
            .collect::<Option<_>>()?;
        for a in 0..6 {
            gradient[a] = columns[a].iter().zip(&here).map(|(j, r)| j * r).sum();
            for b in 0..6 {
                information[(a, b)] = columns[a].iter().zip(&columns[b]).map(|(x, y)| x * y).sum();
            }
        }
        let mut damped = information;
        for i in 0..6 {
            damped[(i, i)] *= 1.0 + damping;
        }
        let step = -damped.cholesky()?.solve(&gradient);
        let trial = moved(&pose, &step);
        let square = |r: &[f64]| r.iter().map(|x| x * x).sum::<f64>();
        match residuals(camera, observations, &trial) {
            Some(there) if square(&there) <= square(&here) => {
                let gain = -step.dot(&gradient);
                (pose, here) = (trial, there);
                damping *= 0.1;
                if gain < 1e-12 {
                    return Some(pose);
                }
            }
            _ => {
                damping *= 10.0;
                if damping > 1e12 {
                    return Some(pose);
                }
            }
        }
    }
    None
}

/// Squared Mahalanobis distance between a solution and another pose.
pub fn distance_squared(solution: &Solution, pose: &Isometry3<f64>) -> f64 {
    solution
        .covariance
        .mahalanobis_squared(&pose_error(pose, &solution.camera_from_tanker))
        .expect("a solution's covariance is positive definite")
}

/// The paper's markers and up to six more on wings, fuselage and tail.
pub fn tanker_markers(count: usize) -> Vec<Marker> {
    let more = [
        (7, 4.0, -3.5, 0.5),
        (8, 4.0, 3.5, 0.5),
        (9, 2.0, -1.2, 0.2),
        (10, 2.0, 1.2, 0.2),
        (11, 6.0, -1.5, 2.0),
        (12, 6.0, 1.5, 2.0),
    ];
    let mut markers = PAPER_MAP.markers().to_vec();
    markers.extend(more.map(|(id, x, y, z)| Marker {
        id,
        marker_in_tanker: nalgebra::Point3::new(x, y, z),
    }));
    markers.truncate(count);
    markers
}
