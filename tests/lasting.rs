//! The track in worlds drawn from an error budget: what lasts from frame to frame stays in its covariance.
//!
//! Survey, calibration and flex are drawn once a flight; the wing moves as a Gauss–Markov process, the image shakes.
//! NEES of position and of velocity have three degrees of freedom each, and the mean of 50 flights lies between 2.36 and
//! 3.72 with 95 % probability (chi-squared with 150 degrees of freedom). Figures are printed with `--nocapture`.

mod flight;
mod support;

use std::sync::Arc;

use flight::{Frame, RATE_HZ, manoeuvre, rough_approach, stamp_ns};
use nalgebra::{Matrix3, Vector3};
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use support::tanker_markers;
use tanker_pose::camera::CameraInfo;
use tanker_pose::config::{CalibrationSigmas, Configuration, Parameters, Settings, TABLE};
use tanker_pose::estimation::{
    CorrelatedNoise, ErrorBudget, Estimator, EstimatorSettings, FlexMode, Initialisation,
};
use tanker_pose::geometry::{Motion, Vector12, motion_error};
use tanker_pose::pipeline::{
    self, Detection, DetectionFrame, FrameErrors, Pipeline, Stamp, TrackCode, error_budget,
};
use tanker_pose::simulation::{Approach, ApproachSettings, World, paper_camera};
use tanker_pose::target::{MapBudget, Marker, MarkerMap};
use tanker_pose::tracking::{Filter, FilterSettings};

const FLIGHTS: u64 = 50;
const SIGMA_PX: f64 = 0.5;
/// Of the whole image, px.
const JITTER_PX: f64 = 0.5;
/// s; of the wing.
const TIME_CONSTANT_S: f64 = 5.0;
/// A larger `manoeuvre_factor` than the default.
const STRONG: f64 = 8.0;

/// What the track believes of errors that last.
#[derive(Clone, Copy, PartialEq)]
enum Belief {
    /// They last.
    Lasting,
    /// They are the budget's, and others in each frame.
    Independent,
    /// There are none, though there are.
    Exact,
    /// There are none, and so it is: only the image shakes.
    NothingLasts,
    /// They last, and a manoeuvre is taken to be [`STRONG`].
    StrongManoeuvre,
    /// They last, and so does half of the noise's variance.
    CorrelatedNoise,
}

fn correlated_noise() -> CorrelatedNoise {
    CorrelatedNoise::new(0.5, 1.0).expect("in range")
}

fn budget(markers: &[Marker]) -> ErrorBudget {
    let survey: Vec<(u32, f64)> = markers.iter().map(|m| (m.id, 0.02)).collect();
    let bend = |marker: &Marker| {
        let up = 0.3 * (marker.marker_in_tanker.y / 7.13).powi(2);
        (marker.id, Vector3::new(0.0, 0.0, up))
    };
    let flex = FlexMode {
        name: "wing_bending".to_owned(),
        time_constant_s: Some(TIME_CONSTANT_S),
        shape: markers.iter().map(bend).collect(),
    };
    let camera = error_budget(
        &MapBudget::default(),
        &CalibrationSigmas {
            focal_length: 0.003,
            principal_point_px: 3.0,
            distortion: [0.02, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            jitter_px: JITTER_PX,
        },
        &[],
    );
    ErrorBudget::new(
        &survey,
        vec![flex],
        camera.calibration().to_vec(),
        JITTER_PX,
    )
    .expect("a budget")
}

/// A true motion at a time.
#[derive(Clone, Copy)]
struct Instant {
    time_s: f64,
    truth: Motion,
}

fn instants(frames: &[Frame]) -> Vec<Instant> {
    frames
        .iter()
        .zip(0_u32..)
        .map(|(frame, k)| Instant {
            time_s: f64::from(k) / RATE_HZ,
            truth: frame.truth,
        })
        .collect()
}

/// 60 m to 12 m in 50 s, in air as rough as the filter takes it to be.
fn approach(seed: u64) -> Vec<Instant> {
    instants(&rough_approach(seed, &FilterSettings::default()))
}

/// Returns the track at each frame of a flight in a world of its own.
fn fly(
    markers: &[Marker],
    instants: &[Instant],
    seed: u64,
    belief: Belief,
    is_lost: impl Fn(usize) -> bool,
) -> Vec<Option<Motion>> {
    let camera = paper_camera();
    let budget = if belief == Belief::NothingLasts {
        ErrorBudget::new(&[], vec![], vec![], JITTER_PX).expect("a budget")
    } else {
        budget(markers)
    };
    let correlated_noise = (belief == Belief::CorrelatedNoise).then(correlated_noise);
    let budget = budget.with_correlated_noise(correlated_noise);
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut world = World::draw(&camera, markers, &budget, &mut random);
    let estimator = Estimator::new(EstimatorSettings {
        initialisation: Initialisation::Previous,
        ..Default::default()
    });
    let estimator = match belief {
        Belief::Exact => estimator,
        _ => estimator.with_budget(budget),
    };
    let mut settings = FilterSettings::default();
    if belief == Belief::StrongManoeuvre {
        settings.manoeuvre_factor = STRONG;
    }
    let mut filter = Filter::new(settings).expect("in range");
    let mut tracks = Vec::with_capacity(instants.len());
    for (k, instant) in instants.iter().enumerate() {
        world.advance(1.0 / RATE_HZ, &mut random);
        let observations = world.observe(&instant.truth.b_from_a, SIGMA_PX, &mut random);
        let stamp_ns = stamp_ns(instant.time_s);
        let prior = filter.predict(stamp_ns).ok();
        let start = prior.map(|motion| motion.b_from_a.rotation.to_rotation_matrix());
        let outcome = pipeline::solve(&estimator, &camera, &observations, start.as_ref());
        match outcome.result {
            Ok(solution) if !is_lost(k) => {
                let lasts = matches!(
                    belief,
                    Belief::Lasting | Belief::StrongManoeuvre | Belief::CorrelatedNoise
                );
                let causes = outcome.causes.as_ref().filter(|_| lasts);
                let errors = FrameErrors::new(&solution, causes, lasts);
                let pose = solution.camera_from_tanker;
                filter.update_with_lasting(stamp_ns, &pose, &errors.noise, &errors.lasting);
            }
            _ => {
                filter.miss(stamp_ns);
            }
        }
        tracks.push(filter.predict(stamp_ns).ok());
    }
    tracks
}

/// Position's and velocity's squared error over their covariance.
fn nees(truth: &Motion, track: &Motion) -> [f64; 2] {
    let error: Vector12 = motion_error(truth, track);
    [0, 6].map(|first| {
        let error = error.fixed_rows::<3>(first).into_owned();
        let covariance: Matrix3<f64> = track.covariance.fixed_view::<3, 3>(first, first).into();
        let factor = covariance.cholesky().expect("positive definite");
        error.dot(&factor.solve(&error))
    })
}

fn bounds_95(flights: u64) -> (f64, f64) {
    let n = flights as f64;
    let law = ChiSquared::new(3.0 * n).expect("positive");
    (law.inverse_cdf(0.025) / n, law.inverse_cdf(0.975) / n)
}

/// Means at some frames, over the flights that have a track there; with how many.
fn mean_nees(
    markers: &[Marker],
    belief: Belief,
    instants: impl Fn(u64) -> Vec<Instant> + Sync,
    at: &[usize],
    is_lost: impl Fn(usize) -> bool + Sync,
) -> Vec<([f64; 2], usize)> {
    let flights: Vec<Vec<Option<[f64; 2]>>> = (1..=FLIGHTS)
        .into_par_iter()
        .map(|seed| {
            let mut instants = instants(seed);
            // Later frames would not change what is evaluated.
            instants.truncate(at.iter().max().map_or(0, |&last| last + 1));
            let tracks = fly(markers, &instants, seed, belief, &is_lost);
            at.iter()
                .map(|&k| Some(nees(&instants[k].truth, tracks[k].as_ref()?)))
                .collect()
        })
        .collect();
    (0..at.len())
        .map(|place| {
            let there: Vec<[f64; 2]> = flights.iter().filter_map(|flight| flight[place]).collect();
            let sum = |which: usize| there.iter().map(|nees| nees[which]).sum::<f64>();
            let count = there.len();
            ([0, 1].map(|which| sum(which) / count as f64), count)
        })
        .collect()
}

/// Returns the means of a track that every flight has.
fn of_all<const N: usize>(means: &[([f64; 2], usize)]) -> [[f64; 2]; N] {
    std::array::from_fn(|place| {
        let (nees, flights) = means[place];
        assert_eq!(flights as u64, FLIGHTS, "every flight has a track");
        nees
    })
}

/// Frames of the approach at about 58, 30 and 15 m.
const STATIONS: [usize; 3] = [63, 938, 1406];

#[test]
fn on_an_approach_with_constant_errors_position_and_velocity_are_honest() {
    let (low, high) = bounds_95(FLIGHTS);
    println!("95 % of such means lie in {low:.2} to {high:.2}");
    for count in [6, 12] {
        let markers = tanker_markers(count);
        for (name, belief) in [
            ("lasting errors known", Belief::Lasting),
            ("taken as independent", Belief::Independent),
            ("no budget", Belief::Exact),
        ] {
            // What is wrong by far shows in the six points.
            if count > 6 && belief != Belief::Lasting {
                continue;
            }
            let means = mean_nees(&markers, belief, approach, &STATIONS, |_| false);
            println!("{count} points, {name}: position, velocity at 58, 30, 15 m: {means:.2?}");
            if belief == Belief::Lasting {
                for [position, velocity] in of_all::<3>(&means) {
                    assert!((low..=high).contains(&position), "position {position}");
                    assert!((low..=high).contains(&velocity), "velocity {velocity}");
                }
            } else {
                // Otherwise this would not show anything. Without a budget fewer frames are trusted.
                for ([position, _], flights) in means {
                    assert!(flights > 25, "{flights} flights have a track");
                    assert!(position > 10.0, "{position}");
                }
            }
        }
    }
}

#[test]
fn noise_that_lasts_does_not_make_the_track_too_sure() {
    let (low, high) = bounds_95(FLIGHTS);
    let markers = tanker_markers(6);
    let means = mean_nees(
        &markers,
        Belief::CorrelatedNoise,
        approach,
        &STATIONS,
        |_| false,
    );
    println!("half of the noise lasts: position, velocity at 58, 30, 15 m: {means:.2?}");
    for [position, velocity] in of_all::<3>(&means) {
        assert!((low..=high).contains(&position), "position {position}");
        assert!((low..=high).contains(&velocity), "velocity {velocity}");
    }
}

#[test]
fn after_a_gap_the_prediction_is_honest_too() {
    let (low, high) = bounds_95(FLIGHTS);
    // 0.4 s without detections. The last lost frame, and one soon after.
    let lost = 444..456;
    let markers = tanker_markers(6);
    let means = mean_nees(&markers, Belief::Lasting, approach, &[455, 470], |k| {
        lost.contains(&k)
    });
    println!("end of a gap, and half a second later: {means:.2?}, {low:.2} to {high:.2}");
    for [position, velocity] in of_all::<2>(&means) {
        assert!((low..=high).contains(&position), "position {position}");
        assert!((low..=high).contains(&velocity), "velocity {velocity}");
    }
}

#[test]
fn in_a_manoeuvre_the_position_stays_honest_while_the_velocity_lags() {
    const MOMENTS: usize = 34;
    let (_, high) = bounds_95(FLIGHTS);
    let markers = tanker_markers(6);
    // Accelerations change sign every second: at all phases of that, from the first second on.
    let at: [usize; MOMENTS] = std::array::from_fn(|moment| 120 + 7 * moment);
    let mean = |belief: Belief| {
        let flown = |seed: u64| instants(&manoeuvre(seed, 3.0, 12.0));
        let means: [_; MOMENTS] = of_all(&mean_nees(&markers, belief, flown, &at, |_| false));
        [0, 1].map(|which| means.iter().map(|at| at[which]).sum::<f64>() / MOMENTS as f64)
    };
    let [position, velocity] = mean(Belief::Lasting);
    let [_, velocity_alone] = mean(Belief::NothingLasts);
    let [_, with_strong] = mean(Belief::StrongManoeuvre);
    println!(
        "in a manoeuvre: position {position:.2} (at most {high:.2}), velocity {velocity:.2}; where nothing lasts {velocity_alone:.2}; with manoeuvre_factor {STRONG} {with_strong:.2}"
    );
    assert!(position <= high, "{position}");
    // A manoeuvre is not of the filter's model: until it shows in the innovations the velocity lags, and so it does after
    // that, since accelerations that last for a second are more than five times the usual noise.
    assert!(velocity_alone <= 4.0, "{velocity_alone}");
    assert!(velocity <= 6.0, "{velocity}");
    assert!(with_strong < velocity, "{with_strong}");
}

const FRAME_ID: &str = "camera";

fn settings() -> Settings {
    let mut settings = Configuration::from(&Parameters::new(TABLE)).settings;
    settings.pixel_sigma_px = SIGMA_PX;
    settings.calibration.focal_length = 0.003;
    settings.calibration.principal_point_px = 3.0;
    settings
}

fn new_pipeline() -> Pipeline {
    let map = MarkerMap::shipped("paper").expect("shipped");
    let info = CameraInfo {
        width: 1280,
        height: 960,
        k: [900.0, 0.0, 640.0, 0.0, 900.0, 480.0, 0.0, 0.0, 1.0],
        ..CameraInfo::default()
    };
    let mut pipeline = Pipeline::new(settings(), Arc::new(map));
    pipeline.set_camera(&info, FRAME_ID).expect("a camera");
    pipeline
}

/// Detections of an approach with the time of each image; some frames have none.
fn images(seed: u64) -> Vec<(f64, DetectionFrame)> {
    let camera = CameraInfo {
        width: 1280,
        height: 960,
        k: [900.0, 0.0, 640.0, 0.0, 900.0, 480.0, 0.0, 0.0, 1.0],
        ..CameraInfo::default()
    };
    let camera = tanker_pose::camera::Camera::from_info(&camera, false).expect("a camera");
    let map = MarkerMap::shipped("paper").expect("shipped");
    let settings = ApproachSettings {
        rate_hz: RATE_HZ,
        duration_s: 10.0,
        seed,
        ..ApproachSettings::default()
    };
    let approach = Approach::new(settings, camera, map);
    (0..approach.frame_count())
        .map(|k| {
            let frame = approach.frame(k);
            let at_ns = stamp_ns(frame.time_s);
            let detections: Vec<Detection> = if k % 17 == 5 {
                Vec::new()
            } else {
                frame.detections
            };
            let stamp = Stamp {
                sec: i32::try_from(at_ns / 1_000_000_000).expect("a stamp of these days"),
                nanosec: u32::try_from(at_ns % 1_000_000_000).expect("below a second"),
            };
            let frame_of_it = DetectionFrame {
                stamp,
                frame_id: FRAME_ID.to_owned(),
                detections: Ok(detections),
                receiver_from_tanker: None,
            };
            (frame.time_s, frame_of_it)
        })
        .collect()
}

#[test]
fn frames_that_overtake_each_other_end_in_the_same_track() {
    for seed in 1..=3 {
        let images = images(seed);
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut order: Vec<(f64, &DetectionFrame)> = images
            .iter()
            .map(|(time_s, frame)| {
                let is_late = random.random_range(0.0..1.0) < 0.1;
                let delay_s = if is_late {
                    random.random_range(0.0..0.4)
                } else {
                    0.0
                };
                (time_s + delay_s, frame)
            })
            .collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (mut sorted, mut delayed) = (new_pipeline(), new_pipeline());
        for (_, frame) in &images {
            sorted.process(frame);
        }
        let mut inserted = 0;
        let mut newest = None;
        for (_, frame) in order {
            let outcome = delayed.process(frame);
            if outcome.track.code() == TrackCode::Inserted {
                inserted += 1;
                assert_eq!(
                    outcome.track.motion, None,
                    "odometry does not go back in time"
                );
            } else if outcome.track.motion.is_some() {
                let stamp_ns = frame.stamp.nanoseconds();
                assert!(newest < Some(stamp_ns), "odometry does not go back in time");
                newest = Some(stamp_ns);
            }
        }
        assert!(inserted >= 10, "{inserted} frames came late");
        // One more frame on each shows what they believe.
        let mut last = images.last().expect("images").1.clone();
        last.stamp.nanosec += 20_000_000;
        last.detections = Ok(Vec::new());
        let expected = sorted.process(&last).track;
        assert_eq!(delayed.process(&last).track, expected);
        assert!(expected.motion.is_some());
    }
}

#[test]
fn any_order_of_half_a_second_gives_one_track() {
    let images = images(9);
    let (early, mut last) = (&images[..45], images[45].1.clone());
    last.detections = Ok(Vec::new());
    let mut sorted = new_pipeline();
    for (_, frame) in early {
        sorted.process(frame);
    }
    let expected = sorted.process(&last).track.motion;
    assert!(expected.is_some());
    let mut random = ChaCha8Rng::seed_from_u64(1);
    for _ in 0..5 {
        let mut shuffled = new_pipeline();
        for block in early.chunks(9) {
            let mut block = block.to_vec();
            block.shuffle(&mut random);
            for (_, frame) in &block {
                shuffled.process(frame);
            }
        }
        assert_eq!(shuffled.process(&last).track.motion, expected);
    }
}
