//! Shared by the tests of the filter: motions with a known truth, and the whole way from pixels to track.

#![allow(dead_code)] // each test binary uses its part

use std::sync::LazyLock;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use tanker_pose::camera::Pixel;
use tanker_pose::estimation::{
    Estimator, EstimatorSettings, Initialisation, Observation, Solution,
};
use tanker_pose::geometry::{Matrix12, Motion, pose_error};
use tanker_pose::pipeline;
use tanker_pose::simulation::{Approach, ApproachSettings, Scene, paper_camera, pose_in_camera};
use tanker_pose::target::MarkerMap;
use tanker_pose::tracking::{Filter, FilterSettings, TrackOutcome};

pub const RATE_HZ: f64 = 30.0;
/// px
pub const SIGMA_PX: f64 = 1.0;

/// One image with its truth, whose covariance is empty.
pub struct Frame {
    pub stamp_ns: i64,
    pub truth: Motion,
    pub observations: Vec<Observation>,
}

/// What became of one frame.
pub struct Record {
    pub time_s: f64,
    pub truth: Motion,
    pub single: Option<Solution>,
    pub outcome: TrackOutcome,
    /// The track at this frame's stamp, predicted where the frame did not correct it.
    pub track: Option<Motion>,
}

#[allow(clippy::cast_possible_truncation)] // a few minutes
pub fn stamp_ns(time_s: f64) -> i64 {
    1_700_000_000_000_000_000 + (time_s * 1e9).round() as i64
}

fn motion(pose: Isometry3<f64>, velocity: Vector3<f64>, rate: Vector3<f64>) -> Motion {
    Motion {
        b_from_a: pose,
        velocity_in_b: velocity,
        rate_in_b: rate,
        covariance: Matrix12::zeros(),
    }
}

/// Returns the motion between the poses one step before and one after, by central differences.
fn differentiated(
    before: &Isometry3<f64>,
    at: &Isometry3<f64>,
    after: &Isometry3<f64>,
    step_s: f64,
) -> Motion {
    motion(
        *at,
        (after.translation.vector - before.translation.vector) / (2.0 * step_s),
        (after.rotation * before.rotation.inverse()).scaled_axis() / (2.0 * step_s),
    )
}

/// 60 m to 12 m in 50 s, swaying and turning by ±3°: smooth, and none of the filter's own making.
pub fn approach(seed: u64) -> Vec<Frame> {
    let map = MarkerMap::shipped("paper").expect("shipped");
    let settings = ApproachSettings {
        start_range_m: 60.0,
        end_range_m: 12.0,
        duration_s: 50.0,
        rate_hz: RATE_HZ,
        sigma_px: SIGMA_PX,
        attitude_deg: 3.0,
        seed,
        ..ApproachSettings::default()
    };
    let approach = Approach::new(settings, paper_camera(), map.clone());
    let pose = |k| approach.frame(k).truth_camera_from_tanker;
    (1..approach.frame_count() - 1)
        .map(|k| {
            let frame = approach.frame(k);
            let observations = frame
                .detections
                .iter()
                .filter_map(|seen| {
                    Some(Observation {
                        id: seen.id,
                        marker_in_tanker: map.get(seen.id)?,
                        pixel: Pixel {
                            u: seen.u_px,
                            v: seen.v_px,
                        },
                        sigma_px: seen.sigma_px,
                    })
                })
                .collect();
            Frame {
                stamp_ns: stamp_ns(frame.time_s),
                truth: differentiated(&pose(k - 1), &pose(k), &pose(k + 1), 1.0 / RATE_HZ),
                observations,
            }
        })
        .collect()
}

fn normal3(random: &mut ChaCha8Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| StandardNormal.sample(random))
}

/// Read once: in a flight of 1500 frames the YAML would take most of the time.
static PAPER_MAP: LazyLock<MarkerMap> =
    LazyLock::new(|| MarkerMap::shipped("paper").expect("shipped"));

fn seen(pose: &Isometry3<f64>, random: &mut ChaCha8Rng) -> Vec<Observation> {
    Scene::new(paper_camera(), &PAPER_MAP, *pose).noisy_observations(SIGMA_PX, random)
}

/// A motion drawn from the filter's own model, 40 m ahead: start and noise have the settings' variances.
pub fn drawn(seed: u64, duration_s: f64, settings: &FilterSettings) -> Vec<Frame> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let start = motion(
        pose_in_camera(Vector3::new(40.0, 0.0, 12.0), 1.0, -2.0, 2.0),
        normal3(&mut random) * settings.initial_speed_sigma_mps,
        normal3(&mut random) * settings.initial_rate_sigma_dps.to_radians(),
    );
    disturbed(&start, duration_s, settings, &mut random, |_, _| {
        (Vector3::zeros(), Vector3::zeros())
    })
}

/// 60 m to 12 m in 50 s in air of the settings' own noise: autopilot and pilot bring the receiver back to
/// its path within some seconds, of which the filter knows nothing.
pub fn rough_approach(seed: u64, settings: &FilterSettings) -> Vec<Frame> {
    const DURATION_S: f64 = 50.0;
    const SPEED_MPS: f64 = (60.0 - 12.0) / DURATION_S;
    /// rad/s, of the restoring motion, which is damped by 0.7.
    const POSITION_RATE: f64 = 0.4;
    const ATTITUDE_RATE: f64 = 1.0;
    let planned = |time_s: f64| {
        let range_m = 60.0 - SPEED_MPS * time_s;
        pose_in_camera(Vector3::new(range_m, 0.0, 0.3 * range_m), 0.0, 0.0, 0.0)
    };
    let planned_velocity = planned(1.0).translation.vector - planned(0.0).translation.vector;
    let start = motion(planned(0.0), planned_velocity, Vector3::zeros());
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    disturbed(&start, DURATION_S, settings, &mut random, |time_s, now| {
        let to_plan = pose_error(&planned(time_s), &now.b_from_a);
        let (away, turned) = (
            to_plan.fixed_rows::<3>(0).into_owned(),
            to_plan.fixed_rows::<3>(3).into_owned(),
        );
        let slip = now.velocity_in_b - planned_velocity;
        (
            away * POSITION_RATE.powi(2) - slip * (1.4 * POSITION_RATE),
            turned * ATTITUDE_RATE.powi(2) - now.rate_in_b * (1.4 * ATTITUDE_RATE),
        )
    })
}

/// Returns a motion that white noise of the settings' densities drives, besides the linear and angular
/// acceleration that `steer` answers to a time and a motion.
fn disturbed(
    start: &Motion,
    duration_s: f64,
    settings: &FilterSettings,
    random: &mut ChaCha8Rng,
    steer: impl Fn(f64, &Motion) -> (Vector3<f64>, Vector3<f64>),
) -> Vec<Frame> {
    let dt = 1.0 / RATE_HZ;
    let acceleration = settings.acceleration_density_mps2;
    let angular = settings.angular_acceleration_density_dps2.to_radians();
    let mut now = *start;
    let mut frames = Vec::new();
    let mut time_s = 0.0;
    while time_s <= duration_s + 0.5 * dt {
        frames.push(Frame {
            stamp_ns: stamp_ns(time_s),
            truth: now,
            observations: seen(&now.b_from_a, random),
        });
        let (pull, twist) = steer(time_s, &now);
        // The integral of white noise over a step, and the integral of that, are correlated.
        let mut step = |density: f64, steered: Vector3<f64>| {
            let (first, second) = (normal3(random), normal3(random));
            let gained = first * (density * dt.sqrt()) + steered * dt;
            let moved = gained * (dt / 2.0) + second * (density * (dt.powi(3) / 12.0).sqrt());
            (moved, gained)
        };
        let (moved, gained) = step(acceleration, pull);
        let (turned, spun) = step(angular, twist);
        now = motion(
            Isometry3::from_parts(
                Translation3::from(
                    now.b_from_a.translation.vector + now.velocity_in_b * dt + moved,
                ),
                UnitQuaternion::from_scaled_axis(now.rate_in_b * dt + turned)
                    * now.b_from_a.rotation,
            ),
            now.velocity_in_b + gained,
            now.rate_in_b + spun,
        );
        time_s += dt;
    }
    frames
}

/// Sends the frames through estimator and filter; those that `is_lost` names have no detections.
pub fn fly(
    frames: &[Frame],
    settings: &FilterSettings,
    is_lost: impl Fn(usize) -> bool,
) -> Vec<Record> {
    let estimator = Estimator::new(EstimatorSettings {
        initialisation: Initialisation::Previous,
        min_points: 5,
        max_outliers: 1,
        max_ambiguity: 0.1,
        ..Default::default()
    });
    let camera = paper_camera();
    let mut filter = Filter::new(*settings).expect("settings in range");
    let first_ns = frames[0].stamp_ns;
    frames
        .iter()
        .enumerate()
        .map(|(k, frame)| {
            let prior = filter.predict(frame.stamp_ns).ok();
            let seed = prior.map(|motion| motion.b_from_a.rotation.to_rotation_matrix());
            let single = (!is_lost(k))
                .then(|| pipeline::solve(&estimator, &camera, &frame.observations, seed.as_ref()))
                .and_then(|outcome| outcome.result.ok());
            let outcome = match &single {
                Some(s) => filter.update(frame.stamp_ns, &s.camera_from_tanker, &s.covariance),
                None => filter.miss(frame.stamp_ns),
            };
            Record {
                time_s: (frame.stamp_ns - first_ns) as f64 * 1e-9,
                truth: frame.truth,
                single,
                outcome,
                track: filter.predict(frame.stamp_ns).ok(),
            }
        })
        .collect()
}

/// m/s²; lateral, its sign changes every second.
pub const MANOEUVRE_MPS2: f64 = 2.0;
/// s; of the differences that the true velocity is taken from.
const STEP_S: f64 = 1e-4;
/// deg/s; of roll, its sign changes every two seconds.
pub const MANOEUVRE_DPS: f64 = 5.0;

/// A quiet second 25 m ahead, then a manoeuvre to both sides, never smooth: the acceleration jumps
/// between its limits, and so does the rate.
pub fn manoeuvre(seed: u64, quiet_s: f64, duration_s: f64) -> Vec<Frame> {
    let pose = |time_s: f64| {
        let t = (time_s - quiet_s).max(0.0);
        // Between two reversals the path is a parabola; it begins at the top of one.
        let stroke_m = |u: f64| 0.5 * MANOEUVRE_MPS2 * u * (1.0 - u);
        let phase = (t + 0.5).rem_euclid(2.0);
        let lateral_m = if phase < 1.0 {
            -stroke_m(phase)
        } else {
            stroke_m(phase - 1.0)
        };
        let phase = (t + 1.0).rem_euclid(4.0);
        let roll_deg = MANOEUVRE_DPS * (1.0 - (phase - 2.0).abs());
        pose_in_camera(Vector3::new(25.0, lateral_m, 7.5), roll_deg, 1.0, -1.0)
    };
    sampled(seed, duration_s, pose)
}

/// Station 15 m ahead, then a lateral acceleration from one moment to the next, held for a second.
pub fn jerk(seed: u64, acceleration_mps2: f64, quiet_s: f64, duration_s: f64) -> Vec<Frame> {
    const PUSH_S: f64 = 1.0;
    sampled(seed, duration_s, |time_s| {
        let t = (time_s - quiet_s).max(0.0);
        let pushed = t.min(PUSH_S);
        let lateral_m = acceleration_mps2 * pushed * (t - 0.5 * pushed);
        pose_in_camera(Vector3::new(15.0, lateral_m, 4.5), 0.0, 1.0, -1.0)
    })
}

/// Images of a tanker that stands still.
pub fn station(seed: u64, at: Isometry3<f64>, duration_s: f64) -> Vec<Frame> {
    sampled(seed, duration_s, |_| at)
}

/// Images of a motion, its velocity by differences.
fn sampled(seed: u64, duration_s: f64, pose: impl Fn(f64) -> Isometry3<f64>) -> Vec<Frame> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let step_s = 1.0 / RATE_HZ;
    let mut frames = Vec::new();
    let mut time_s = 0.0;
    while time_s < duration_s {
        let at = pose(time_s);
        frames.push(Frame {
            stamp_ns: stamp_ns(time_s),
            truth: differentiated(&pose(time_s - STEP_S), &at, &pose(time_s + STEP_S), STEP_S),
            observations: seen(&at, &mut random),
        });
        time_s += step_s;
    }
    frames
}
