//! What detectors are told: where the markers will be, and a sigma that holds.
//!
//! "NEES" is the squared distance of a detection from the prediction over its covariance; when honest it is
//! chi-squared with 2 degrees of freedom, and the sum of n independent ones has 2 n. Markers of one image have nearly
//! the same error, so of every flight one marker of one image counts. Bounds are the two-sided 99.9 % of that law;
//! figures are printed with `--nocapture`.

mod flight;

use std::sync::Arc;

use flight::{Frame, RATE_HZ, SIGMA_PX, drawn, rough_approach};
use nalgebra::{Rotation3, Vector2, Vector3};
use statrs::distribution::{ChiSquared, ContinuousCDF};
use tanker_pose::camera::{CameraInfo, RegionOfInterest};
use tanker_pose::config::{Configuration, Parameters, Settings, TABLE};
use tanker_pose::estimation::Observation;
use tanker_pose::pipeline::{
    Detection, DetectionFrame, OutcomeCode, Pipeline, PredictedPoint, Stamp,
};
use tanker_pose::target::MarkerMap;
use tanker_pose::tracking::FilterSettings;

const FRAME_ID: &str = "camera";

/// Noise that lets a drawn motion stay in view for some seconds.
const CALM: FilterSettings = FilterSettings {
    acceleration_density_mps2: 0.2,
    angular_acceleration_density_dps2: 0.5,
    manoeuvre_factor: 5.0,
    initial_speed_sigma_mps: 0.5,
    initial_rate_sigma_dps: 1.0,
    position_floor_m: 1e-6,
    attitude_floor_deg: 1e-5,
    gate_probability: 0.9999,
    max_gap_s: 1.0,
    confirm_frames: 5,
};

fn settings(track: Option<FilterSettings>) -> Settings {
    Settings {
        track: track.map(|track| track.checked().expect("in range")),
        pixel_sigma_px: SIGMA_PX,
        ..Configuration::from(&Parameters::new(TABLE)).settings
    }
}

fn paper_info() -> CameraInfo {
    CameraInfo {
        width: 508,
        height: 412,
        k: [571.0, 0.0, 254.0, 0.0, 571.0, 206.0, 0.0, 0.0, 1.0],
        ..CameraInfo::default()
    }
}

fn pipeline(settings: Settings, info: &CameraInfo) -> Pipeline {
    let map = MarkerMap::shipped("paper").expect("shipped");
    let mut pipeline = Pipeline::new(settings, Arc::new(map));
    pipeline
        .set_camera(info, FRAME_ID)
        .expect("a camera that can be used");
    pipeline
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // of these days
fn stamp(stamp_ns: i64) -> Stamp {
    Stamp {
        sec: (stamp_ns / 1_000_000_000) as i32,
        nanosec: (stamp_ns % 1_000_000_000) as u32,
    }
}

fn detections(seen: &[Observation]) -> Vec<Detection> {
    seen.iter()
        .map(|seen| Detection {
            id: seen.id,
            u_px: seen.pixel.u,
            v_px: seen.pixel.v,
            sigma_px: seen.sigma_px,
        })
        .collect()
}

/// Sends a frame with these detections; returns what became of it.
fn send(pipeline: &mut Pipeline, stamp_ns: i64, detections: Vec<Detection>) -> OutcomeCode {
    pipeline
        .process(&DetectionFrame {
            stamp: stamp(stamp_ns),
            frame_id: FRAME_ID.to_owned(),
            detections: Ok(detections),
            receiver_from_tanker: None,
        })
        .code()
}

fn predict(pipeline: &Pipeline, stamp_ns: i64) -> Vec<PredictedPoint> {
    pipeline
        .predict(stamp(stamp_ns), FRAME_ID)
        .expect("the camera is known")
}

fn nees(point: &PredictedPoint, seen: &Observation) -> f64 {
    let error = Vector2::new(seen.pixel.u - point.pixel.u, seen.pixel.v - point.pixel.v);
    let factor = point.covariance.cholesky().expect("positive definite");
    error.dot(&factor.solve(&error))
}

/// Between these the mean of `n` honest values lies with 99.9 % probability.
fn bounds(n: usize) -> (f64, f64) {
    let law = ChiSquared::new(2.0 * n as f64).expect("positive");
    (
        law.inverse_cdf(0.0005) / n as f64,
        law.inverse_cdf(0.9995) / n as f64,
    )
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// What flights give that see all until `blind_from_s` and nothing after it: for each gap the NEES of one marker a
/// flight, the mean sigma and how many flights still predicted anything.
struct Blind {
    gap_s: f64,
    nees: Vec<f64>,
    sigma_px: Vec<f64>,
}

fn fly_blind(
    flights: impl Iterator<Item = Vec<Frame>>,
    settings: &Settings,
    blind_from_s: f64,
    gaps_s: &[f64],
) -> Vec<Blind> {
    let mut found: Vec<Blind> = gaps_s
        .iter()
        .map(|&gap_s| Blind {
            gap_s,
            nees: Vec::new(),
            sigma_px: Vec::new(),
        })
        .collect();
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let frames_in = |time_s: f64| (time_s * RATE_HZ).round() as usize;
    for (flight, frames) in flights.enumerate() {
        let mut pipeline = pipeline(settings.clone(), &paper_info());
        let seen = frames_in(blind_from_s);
        for frame in &frames[..seen] {
            send(
                &mut pipeline,
                frame.stamp_ns,
                detections(&frame.observations),
            );
        }
        for gap in &mut found {
            let frame = &frames[seen - 1 + frames_in(gap.gap_s)];
            // What a blind detector sends; it must not end the prediction.
            let outcome = send(&mut pipeline, frame.stamp_ns, Vec::new());
            assert_eq!(outcome, OutcomeCode::TooFewPoints);
            let points = predict(&pipeline, frame.stamp_ns);
            let Some(point) = points.get(flight % points.len().max(1)) else {
                continue;
            };
            let seen = frame.observations.iter().find(|seen| seen.id == point.id);
            gap.nees
                .push(nees(point, seen.expect("in front of the camera")));
            gap.sigma_px.push(point.sigma_px());
        }
    }
    for gap in &found {
        println!(
            "{:.2} s after the last fit: {} flights predict, sigma {:.1} px, NEES {:.2} of 2",
            gap.gap_s,
            gap.nees.len(),
            mean(&gap.sigma_px),
            mean(&gap.nees)
        );
    }
    found
}

#[test]
fn predicted_pixels_are_as_far_off_as_their_covariance_says() {
    const FLIGHTS: u64 = 400;
    let flights = (1..=FLIGHTS).map(|seed| drawn(seed, 5.2, &CALM));
    let gaps = [1.0 / RATE_HZ, 0.5, 1.0, 2.0, 3.0];
    for gap in fly_blind(flights, &settings(Some(CALM)), 2.0, &gaps) {
        // A motion that left the view of the camera is not predicted.
        assert!(gap.nees.len() > 350, "{}", gap.nees.len());
        let (low, high) = bounds(gap.nees.len());
        let found = mean(&gap.nees);
        assert!(
            (low..=high).contains(&found),
            "{} s: {found:.2}, expected {low:.2} to {high:.2}",
            gap.gap_s
        );
    }
}

/// Air of the settings' own noise, against which autopilot and pilot hold the path: calmer than the filter thinks.
#[test]
fn a_blind_receiver_on_a_rough_approach_is_told_for_seconds_and_never_too_surely() {
    const FLIGHTS: u64 = 100;
    let track = FilterSettings::default();
    let flights = (1..=FLIGHTS).map(|seed| rough_approach(seed, &track));
    let gaps = [0.5, 1.0, 2.0, 3.0, 4.0, 6.0];
    let found = fly_blind(flights, &settings(Some(track)), 30.0, &gaps);
    for gap in &found {
        let (_, high) = bounds(gap.nees.len());
        assert!(mean(&gap.nees) < high, "{} s", gap.gap_s);
    }
    let told = |gap_s: f64| {
        let gap = found.iter().find(|gap| (gap.gap_s - gap_s).abs() < 1e-9);
        gap.expect("in the list").nees.len()
    };
    // Long after odometry has ended, at max_gap_s.
    assert_eq!(told(3.0), 100);
    let grown: Vec<f64> = found.iter().map(|gap| mean(&gap.sigma_px)).collect();
    assert!(grown.windows(2).all(|pair| pair[0] < pair[1]), "{grown:?}");
}

/// A mount that is told 10° wrong turns the nominal attitude by as much.
#[test]
fn a_nominal_attitude_that_the_last_fit_contradicts_is_believed_less() {
    const FLIGHTS: u64 = 100;
    let track = FilterSettings::default();
    let flights = (1..=FLIGHTS).map(|seed| rough_approach(seed, &track));
    let mut settings = settings(Some(track));
    let wrong = Rotation3::from_axis_angle(&Vector3::x_axis(), 10.0_f64.to_radians());
    settings.estimator.nominal_camera_from_tanker =
        wrong * settings.estimator.nominal_camera_from_tanker;
    for gap in fly_blind(flights, &settings, 30.0, &[0.5, 1.0, 2.0, 3.0]) {
        assert!(gap.nees.len() > 80, "{}", gap.nees.len());
        let (_, high) = bounds(gap.nees.len());
        assert!(mean(&gap.nees) < high, "{} s", gap.gap_s);
    }
}

#[test]
fn without_a_track_the_last_pose_alone_is_worth_some_frames() {
    const FLIGHTS: u64 = 200;
    let flights = (1..=FLIGHTS).map(|seed| drawn(seed, 1.2, &CALM));
    let gaps = [1.0 / RATE_HZ, 0.2];
    for gap in fly_blind(flights, &settings(None), 1.0, &gaps) {
        let (_, high) = bounds(gap.nees.len());
        assert!(gap.nees.len() > 180 && mean(&gap.nees) < high);
    }
}

#[test]
fn nothing_is_predicted_before_a_pose_and_after_it_is_worth_nothing() {
    let frames = drawn(3, 1.0, &CALM);
    let mut pipeline = pipeline(settings(Some(FilterSettings::default())), &paper_info());
    let last_ns = frames.last().expect("some").stamp_ns;
    assert!(predict(&pipeline, last_ns).is_empty());
    for frame in &frames {
        send(
            &mut pipeline,
            frame.stamp_ns,
            detections(&frame.observations),
        );
    }
    let after = |seconds: i64| predict(&pipeline, last_ns + seconds * 1_000_000_000);
    assert_eq!(after(0).len(), 6);
    assert!(after(-1).is_empty(), "before its own stamp");
    let end_s = (1..120).find(|&seconds| after(seconds).is_empty());
    println!("40 m away, the prediction ends {end_s:?} s after the last fit");
    assert!(end_s.is_some_and(|end_s| (4..60).contains(&end_s)));
    // An eighth of the image's shorter side.
    let worst_px = (0..120).flat_map(after).map(|point| point.sigma_px());
    assert!(worst_px.fold(0.0, f64::max) <= 412.0 / 8.0);

    pipeline.reset();
    assert!(predict(&pipeline, last_ns + 10_000_000).is_empty());
}

#[test]
fn one_pose_after_a_gap_does_not_shorten_what_the_track_knew() {
    let frames = drawn(5, 3.5, &CALM);
    let mut pipeline = pipeline(settings(Some(CALM)), &paper_info());
    let (before, after) = frames.split_at(60);
    for frame in before {
        send(
            &mut pipeline,
            frame.stamp_ns,
            detections(&frame.observations),
        );
    }
    // 1.5 s later, when the track has ended: a single pose begins a candidate.
    let single = &after[44];
    assert_eq!(
        send(
            &mut pipeline,
            single.stamp_ns,
            detections(&single.observations)
        ),
        OutcomeCode::Ok
    );
    let next = predict(&pipeline, single.stamp_ns + 33_000_000);
    assert!(next.iter().all(|point| point.sigma_px() < 5.0), "{next:?}");
    // Without its velocity the candidate is soon worth nothing; the track of before is.
    assert_eq!(predict(&pipeline, single.stamp_ns + 1_500_000_000).len(), 6);
}

/// When nothing is predicted any more, s after the last fit of frames that show the tanker at these poses.
fn end_s(frames: &[Frame]) -> f64 {
    let mut pipeline = pipeline(settings(Some(FilterSettings::default())), &paper_info());
    for frame in frames {
        send(
            &mut pipeline,
            frame.stamp_ns,
            detections(&frame.observations),
        );
    }
    let last_ns = frames.last().expect("some").stamp_ns;
    (0..600)
        .find(|tenth| predict(&pipeline, last_ns + tenth * 100_000_000).is_empty())
        .map_or(f64::INFINITY, |tenth| tenth as f64 / 10.0)
}

#[test]
fn predictions_last_longer_the_farther_and_the_calmer_the_tanker_was() {
    let station = |range_m: f64| {
        let at = tanker_pose::simulation::pose_in_camera(
            Vector3::new(range_m, 0.0, 0.3 * range_m),
            1.0,
            1.0,
            -1.0,
        );
        end_s(&flight::station(9, at, 3.0))
    };
    let (near_s, far_s) = (station(15.0), station(40.0));
    let (quiet, moved) = (
        end_s(&flight::manoeuvre(9, 4.0, 4.0)),
        end_s(&flight::manoeuvre(9, 2.0, 4.0)),
    );
    println!(
        "predictions end after {near_s} s at 15 m, {far_s} s at 40 m; at 25 m after {quiet} s, in a manoeuvre {moved} s"
    );
    assert!((4.0..10.0).contains(&near_s) && (8.0..20.0).contains(&far_s));
    assert!((1.5..quiet - 1.0).contains(&moved));
}

/// Raw pixels of a lens, of a part of the sensor, binned.
#[test]
fn predictions_are_pixels_of_the_image_that_detections_come_from() {
    let info = CameraInfo {
        width: 1600,
        height: 1200,
        distortion_model: "plumb_bob".to_owned(),
        d: vec![-0.25, 0.08, 0.001, -0.0005, 0.0],
        k: [1150.0, 0.0, 800.0, 0.0, 1140.0, 600.0, 0.0, 0.0, 1.0],
        binning_x: 2,
        binning_y: 2,
        roi: RegionOfInterest {
            x_offset: 100,
            y_offset: 40,
            width: 1400,
            height: 1100,
            do_rectify: false,
        },
        ..CameraInfo::default()
    };
    let camera = tanker_pose::camera::Camera::from_info(&info, false).expect("a good camera");
    let map = MarkerMap::shipped("paper").expect("shipped");
    let truth =
        tanker_pose::simulation::pose_in_camera(Vector3::new(20.0, 0.3, 5.0), 1.0, 2.0, -1.0);
    let scene = tanker_pose::simulation::Scene::new(camera, &map, truth);
    let exact = scene.exact_observations();
    let mut pipeline = pipeline(settings(Some(FilterSettings::default())), &info);
    let first_ns = 1_700_000_000_000_000_000;
    for k in 0..20 {
        let outcome = send(&mut pipeline, first_ns + k * 33_000_000, detections(&exact));
        assert_eq!(outcome, OutcomeCode::Ok);
    }
    let points = predict(&pipeline, first_ns + 20 * 33_000_000);
    assert_eq!(points.len(), 6);
    for point in points {
        let seen = exact.iter().find(|seen| seen.id == point.id).expect("seen");
        let off = (seen.pixel.u - point.pixel.u).hypot(seen.pixel.v - point.pixel.v);
        // The nominal attitude, 2.4° away, draws by a thousandth of that.
        assert!(off < 0.01, "id {}: {off} px", point.id);
        // Its own noise of 1 px, and little of the track's.
        assert!((1.0..1.6).contains(&point.sigma_px()), "{point:?}");
    }
}

/// The largest derivative of the pixels by pose and rates, against differences: of the sigma all else follows.
#[test]
fn sigma_is_that_of_the_worst_direction() {
    let frames = drawn(4, 1.0, &CALM);
    let mut pipeline = pipeline(settings(Some(CALM)), &paper_info());
    for frame in &frames {
        send(
            &mut pipeline,
            frame.stamp_ns,
            detections(&frame.observations),
        );
    }
    for point in predict(
        &pipeline,
        frames.last().expect("some").stamp_ns + 500_000_000,
    ) {
        let worst = (0..360)
            .map(|degrees| {
                let (sin, cos) = f64::from(degrees).to_radians().sin_cos();
                let direction = Vector2::new(cos, sin);
                (point.covariance * direction).dot(&direction).sqrt()
            })
            .fold(0.0, f64::max);
        assert!((point.detection().sigma_px / worst - 1.0).abs() < 1e-3);
    }
}
