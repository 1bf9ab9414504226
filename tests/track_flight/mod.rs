//! Approaches of a track with faults that last, judged by its protection levels.

#![allow(dead_code)] // each test binary uses its part
#![allow(clippy::unused_self)] // what belongs to a flight is asked of it

use nalgebra::{
    DMatrix, DVector, Isometry3, Matrix3, Matrix6, Point3, Translation3, Vector2, Vector3,
};
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use tanker_pose::camera::Camera;
use tanker_pose::estimation::{ErrorBudget, Estimator, EstimatorSettings, Observation};
use tanker_pose::frames::flu_from_optical;
use tanker_pose::geometry::{Motion, PoseCovariance, skew};
use tanker_pose::integrity::{
    FrameIntegrity, IntegrityMonitor, IntegrityPoint, IntegritySettings, Mount, SolvedFrame,
    TrackSeparations, Unavailable,
};
use tanker_pose::pipeline::{FrameErrors, solve};
use tanker_pose::simulation::{World, paper_camera, pose_in_camera, trial_generator};
use tanker_pose::target::MarkerMap;
use tanker_pose::tracking::{Filter, FilterSettings};

use crate::support::tanker_markers;

pub const SIGMA_PX: f64 = 0.5;
pub const FRAMES: u32 = 45;
const STEP_NS: i64 = 33_333_333;
/// m; a point at the tail, amid the markers.
pub const TAIL: Point3<f64> = Point3::new(7.8, 0.0, 1.0);
/// Of a frame's threshold in its separation's sigmas, about.
const THRESHOLD_SIGMAS: f64 = 4.5;

/// How a fault goes on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Course {
    Constant,
    /// From nothing to its size at the end.
    Ramp,
    FromTheMiddle,
    /// In every other frame.
    Blinking,
}

/// So many beacons that move in the direction that the lateral position at the tail follows most and residuals least.
#[derive(Debug, Clone, Copy)]
pub struct Fault {
    pub beacons: usize,
    pub course: Course,
    /// Of what makes an alert in a single frame.
    pub part: f64,
}

impl Fault {
    pub const NONE: Self = Self {
        beacons: 0,
        course: Course::Constant,
        part: 0.0,
    };

    fn size(&self, frame: u32) -> f64 {
        self.part
            * match self.course {
                Course::Constant => 1.0,
                Course::Ramp => f64::from(frame) / f64::from(FRAMES - 1),
                Course::FromTheMiddle => f64::from(u8::from(frame >= FRAMES / 2)),
                Course::Blinking => f64::from(frame % 2),
            }
    }
}

/// What one frame of a flight came to.
pub struct Moment<'a> {
    pub frame: Option<Result<FrameIntegrity, Unavailable>>,
    /// The track at the frame's stamp, what follows it, and the truth.
    pub motion: Motion,
    pub followed: &'a TrackSeparations,
    pub transition: tanker_pose::geometry::Matrix12,
    pub truth: Isometry3<f64>,
}

/// Six beacons 16 m ahead.
pub struct Flight {
    pub camera: Camera,
    pub map: MarkerMap,
    pub estimator: Estimator,
    pub budget: ErrorBudget,
    pub monitors: Vec<IntegrityMonitor>,
}

impl Flight {
    pub fn new(budget: ErrorBudget, settings: &[IntegritySettings]) -> Self {
        Self {
            camera: paper_camera(),
            map: MarkerMap::new("tanker", &tanker_markers(6)).expect("a map"),
            estimator: Estimator::new(EstimatorSettings::default()).with_budget(budget.clone()),
            budget,
            monitors: settings.iter().map(|settings| monitor(*settings)).collect(),
        }
    }

    pub fn pose(&self, frame: u32, phase: f64) -> Isometry3<f64> {
        let time_s = f64::from(frame) / 30.0;
        let sway = |hz: f64| (hz * std::f64::consts::TAU * time_s + phase).sin();
        pose_in_camera(
            Vector3::new(16.0 - 0.8 * time_s, 0.2 * sway(0.1), 4.5 + 0.2 * sway(0.07)),
            2.0 * sway(0.11),
            2.0 * sway(0.09),
            2.0 * sway(0.13),
        )
    }

    /// Returns a frame's detections with a fault, if its beacons are known.
    pub fn spoil(&self, seen: &mut [Observation], shifts: &[(u32, Vector2<f64>)], size: f64) {
        for seen in seen {
            for (_, by) in shifts.iter().filter(|(id, _)| *id == seen.id) {
                seen.pixel.u += by.x * size;
                seen.pixel.v += by.y * size;
            }
        }
    }

    /// Flies an approach; `each` is asked after every frame with a track.
    pub fn fly(&self, fault: &Fault, random: &mut ChaCha8Rng, mut each: impl FnMut(&Moment)) {
        let phase = std::f64::consts::TAU * rand::RngExt::random::<f64>(random);
        let mut world = World::draw(&self.camera, self.map.markers(), &self.budget, random);
        let mut filter: Filter<TrackSeparations> =
            FilterSettings::default().checked().expect("default").into();
        let mut order: Vec<usize> = (0..self.map.markers().len()).collect();
        order.shuffle(random);
        let shifts = self.worst(&order[..fault.beacons], phase);
        for frame in 0..FRAMES {
            let truth = self.pose(frame, phase);
            world.advance(1.0 / 30.0, random);
            let mut seen = world.observe(&truth, SIGMA_PX, random);
            self.spoil(&mut seen, &shifts, fault.size(frame));
            let stamp_ns = STEP_NS * i64::from(frame);
            let levels = self.take(&mut filter, stamp_ns, &seen);
            let motion = filter.predict(stamp_ns).ok();
            if let (Some(motion), Some((followed, transition))) =
                (motion, filter.follower(stamp_ns))
            {
                each(&Moment {
                    frame: levels,
                    motion,
                    followed,
                    transition,
                    truth,
                });
            }
        }
    }

    /// Gives a frame to a filter; returns its own levels.
    pub fn take(
        &self,
        filter: &mut Filter<TrackSeparations>,
        stamp_ns: i64,
        seen: &[Observation],
    ) -> Option<Result<FrameIntegrity, Unavailable>> {
        let outcome = solve(&self.estimator, &self.camera, seen, None);
        let Ok(solution) = &outcome.result else {
            filter.miss(stamp_ns);
            return None;
        };
        let (levels, separations) = self.monitors[0].judge_for_track(&SolvedFrame {
            estimator: &self.estimator,
            map: Some(&self.map),
            camera: &self.camera,
            observations: seen,
            solution,
        });
        let has_causes = self.estimator.has_causes();
        let errors = FrameErrors::new(solution, outcome.causes.as_ref(), has_causes);
        filter.update_followed(
            stamp_ns,
            &solution.camera_from_tanker,
            &errors.noise,
            &errors.lasting,
            separations,
        );
        Some(levels)
    }

    /// Returns the shift of each of some beacons that moves the lateral position at the tail most for what residuals
    /// show, as large as what makes an alert in one frame, px.
    fn worst(&self, which: &[usize], phase: f64) -> Vec<(u32, Vector2<f64>)> {
        let pose = self.pose(FRAMES / 2, phase);
        let seen = tanker_pose::simulation::Scene::new(self.camera.clone(), &self.map, pose)
            .exact_observations();
        let rows = 2 * seen.len();
        let mut j = DMatrix::zeros(rows, 6);
        for (at, seen) in seen.iter().enumerate() {
            let pixel = |step: usize, size: f64| {
                let mut moved = pose;
                if step < 3 {
                    moved.translation.vector[step] += size;
                } else {
                    let mut turn = Vector3::zeros();
                    turn[step - 3] = size;
                    moved.rotation =
                        nalgebra::UnitQuaternion::from_scaled_axis(turn) * moved.rotation;
                }
                seen.residual_px(&self.camera, &moved).expect("in front")
            };
            for step in 0..6 {
                let by = (pixel(step, 1e-5) - pixel(step, -1e-5)) / (2e-5 * SIGMA_PX);
                j[(2 * at, step)] = by.x;
                j[(2 * at + 1, step)] = by.y;
            }
        }
        let p = (j.transpose() * &j).try_inverse().expect("a pose");
        let arm = pose.rotation * TAIL.coords;
        let axes = flu_from_optical();
        let by_turn = axes.matrix() * -skew(arm);
        let lateral = DMatrix::from_fn(1, 6, |_, column| {
            if column < 3 {
                axes.matrix()[(1, column)]
            } else {
                by_turn[(1, column - 3)]
            }
        });
        let gain = (lateral * &p * j.transpose()).transpose();
        let m = DMatrix::identity(rows, rows) - &j * &p * j.transpose();
        let of: Vec<usize> = which.iter().flat_map(|at| [2 * at, 2 * at + 1]).collect();
        let s = DMatrix::from_fn(of.len(), of.len(), |a, b| m[(of[a], of[b])]);
        let gain = DVector::from_fn(of.len(), |a, _| gain[(of[a], 0)]);
        if of.is_empty() {
            return Vec::new();
        }
        let direction = s.try_inverse().expect("visible") * &gain;
        let size = THRESHOLD_SIGMAS / gain.dot(&direction).sqrt() * SIGMA_PX;
        let shift = |at: usize| Vector2::new(direction[2 * at], direction[2 * at + 1]) * size;
        let shifts = which.iter().enumerate();
        shifts
            .map(|(at, place)| (seen[*place].id, shift(at)))
            .collect()
    }

    /// Flies many approaches, in parallel and always the same.
    pub fn sum<T: Send + Sync + Clone>(
        &self,
        trials: u32,
        seed: u64,
        fault: &Fault,
        none: &T,
        each: impl Fn(&mut T, &Moment) + Sync,
        add: impl Fn(T, T) -> T + Sync + Send,
    ) -> T {
        (0..trials)
            .into_par_iter()
            .map(|trial| {
                let mut random = trial_generator(seed, 6, 16, trial);
                let mut sum = none.clone();
                self.fly(fault, &mut random, |moment| each(&mut sum, moment));
                sum
            })
            .reduce(|| none.clone(), add)
    }
}

/// Returns the error of a point, ahead, lateral, vertical, m.
pub fn error_m(moment: &Moment, point: &Point3<f64>) -> Vector3<f64> {
    flu_from_optical() * (moment.motion.b_from_a * point - moment.truth * point)
}

pub fn monitor(settings: IntegritySettings) -> IntegrityMonitor {
    let mount = Mount {
        receiver_from_camera: Isometry3::from_parts(
            Translation3::identity(),
            flu_from_optical().into(),
        ),
        covariance: PoseCovariance(Matrix6::zeros()),
    };
    let point = |name: &str, point_in_tanker| IntegrityPoint {
        name: name.to_owned(),
        point_in_tanker,
        covariance: Matrix3::zeros(),
        alert_limit_m: None,
    };
    IntegrityMonitor::new(
        settings,
        mount,
        vec![point("origin", Point3::origin()), point("tail", TAIL)],
    )
}
