//! What is wrong for long: sigmas, a marker's place in the map. The pipeline by itself, ten seconds at 20 Hz, fixed
//! seeds; figures are printed with `--nocapture`.

use std::sync::Arc;

use nalgebra::{Point3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tanker_pose::camera::{Camera, CameraInfo};
use tanker_pose::config::{Configuration, Parameters, Settings, TABLE};
use tanker_pose::pipeline::{
    Detection, DetectionFrame, FrameOutcome, OutcomeCode, Pipeline, Refusal, SigmaFactor, Stamp,
};
use tanker_pose::simulation::{Scene, pose_in_camera};
use tanker_pose::target::{Marker, MarkerMap};

const FRAME_ID: &str = "camera";
const SIGMA_PX: f64 = 0.5;
const RATE_HZ: u32 = 20;
const STEP_NS: u32 = 1_000_000_000 / RATE_HZ;

fn camera_info() -> CameraInfo {
    CameraInfo {
        width: 1280,
        height: 960,
        k: [900.0, 0.0, 640.0, 0.0, 900.0, 480.0, 0.0, 0.0, 1.0],
        ..CameraInfo::default()
    }
}

/// A tanker 20 m ahead, its markers perhaps not where the map has them.
struct Flight {
    pipeline: Pipeline,
    scene: Scene,
    random: ChaCha8Rng,
    noise_px: f64,
    frame: u32,
}

impl Flight {
    /// `moved`: markers that stand this far from their place in the map, m.
    fn new(noise_px: f64, moved: &[(u32, Vector3<f64>)], seed: u64) -> Self {
        let map = MarkerMap::shipped("paper").expect("shipped");
        let truly = |marker: &Marker| {
            let by = moved.iter().find(|(id, _)| *id == marker.id);
            let by = by.map_or(Vector3::zeros(), |(_, by)| *by);
            let marker_in_tanker: Point3<f64> = marker.marker_in_tanker + by;
            Marker {
                marker_in_tanker,
                ..*marker
            }
        };
        let markers = map.markers().iter().map(truly).collect();
        let camera = Camera::from_info(&camera_info(), false).expect("a camera");
        let pose = pose_in_camera(Vector3::new(20.0, -0.3, 1.0), 1.0, -1.0, 2.0);
        let settings = Settings {
            pixel_sigma_px: SIGMA_PX,
            ..Configuration::from(&Parameters::new(TABLE)).settings
        };
        let mut pipeline = Pipeline::new(settings, Arc::new(map));
        pipeline
            .set_camera(&camera_info(), FRAME_ID)
            .expect("a camera that can be used");
        Self {
            pipeline,
            scene: Scene::with_markers(camera, markers, pose),
            random: ChaCha8Rng::seed_from_u64(seed),
            noise_px,
            frame: 0,
        }
    }

    /// Returns the outcome of the next image, its detections spoilt.
    fn next(&mut self, spoil: impl FnOnce(&mut Vec<Detection>, &mut ChaCha8Rng)) -> FrameOutcome {
        let seen = self
            .scene
            .noisy_observations(self.noise_px, &mut self.random);
        let mut detections: Vec<Detection> = seen
            .iter()
            .map(|seen| Detection {
                id: seen.id,
                u_px: seen.pixel.u,
                v_px: seen.pixel.v,
                sigma_px: 0.0,
            })
            .collect();
        spoil(&mut detections, &mut self.random);
        self.frame += 1;
        let stamp = Stamp {
            sec: 1_700_000_000 + i32::try_from(self.frame / RATE_HZ).expect("small"),
            nanosec: self.frame % RATE_HZ * STEP_NS,
        };
        self.pipeline.process(&DetectionFrame {
            stamp,
            frame_id: FRAME_ID.to_owned(),
            detections: Ok(detections),
            receiver_from_tanker: None,
        })
    }

    fn pass(&mut self, seconds: u32) -> Vec<FrameOutcome> {
        (0..seconds * RATE_HZ)
            .map(|_| self.next(|_, _| ()))
            .collect()
    }

    fn settled(&self) -> SigmaFactor {
        let factor = self.pipeline.sigma_factor().expect("there were fits");
        assert!(factor.is_settled(), "{factor:?}");
        factor
    }
}

fn is_suspect(outcome: &FrameOutcome) -> bool {
    matches!(outcome.result, Err(Refusal::SuspectMarker(_)))
}

fn share(outcomes: &[FrameOutcome], is: impl Fn(&FrameOutcome) -> bool) -> f64 {
    outcomes.iter().filter(|outcome| is(outcome)).count() as f64 / outcomes.len() as f64
}

fn leaves_out(outcome: &FrameOutcome) -> bool {
    let solution = outcome.solution();
    solution.is_some_and(|solution| solution.excluded.ids().next().is_some())
}

fn summary(what: &str, outcomes: &[FrameOutcome]) {
    let percent = |is: fn(&FrameOutcome) -> bool| 100.0 * share(outcomes, is);
    println!(
        "{what}: {:.0}% OK ({:.0}% leave one out), {:.0}% NOT_TRUSTED, of these {:.0}% unclear, {:.0}% for a suspect",
        percent(|o| o.code() == OutcomeCode::Ok),
        percent(|o| o.code() == OutcomeCode::Ok && leaves_out(o)),
        percent(|o| o.code() == OutcomeCode::NotTrusted),
        percent(|o| o
            .solution()
            .is_some_and(|s| s.unclear.ids().next().is_some())),
        percent(is_suspect),
    );
}

#[test]
fn factor_of_wrong_sigmas_is_named_within_a_fifth() {
    for true_factor in [0.5, 1.0, 1.5, 2.0, 3.0] {
        for seed in 0..4 {
            let mut flight = Flight::new(true_factor * SIGMA_PX, &[], seed);
            let outcomes = flight.pass(11);
            let found = flight.settled().factor;
            summary(
                &format!("noise {true_factor} sigma, factor {found:.2}"),
                &outcomes,
            );
            assert!(
                (found / true_factor - 1.0).abs() < 0.2,
                "{true_factor}: {found}"
            );
        }
    }
}

#[test]
fn gross_errors_now_and_then_do_not_make_sigmas_wrong_or_a_marker_suspect() {
    for seed in 0..4 {
        let mut flight = Flight::new(SIGMA_PX, &[], seed);
        let outcomes: Vec<FrameOutcome> = (0..30 * RATE_HZ)
            .map(|_| {
                flight.next(|detections, random| {
                    // In a tenth of the frames, one marker of six.
                    if random.random_bool(0.1) {
                        detections[random.random_range(0..6)].u_px += 30.0;
                    }
                })
            })
            .collect();
        let found = flight.settled().factor;
        summary(
            &format!("gross errors in a tenth, factor {found:.2}"),
            &outcomes,
        );
        assert!((found - 1.0).abs() < 0.2, "{found}");
        assert!(!outcomes.iter().any(is_suspect));
    }
}

#[test]
fn factor_needs_ten_seconds_and_is_forgotten_with_a_reset() {
    let mut flight = Flight::new(SIGMA_PX, &[], 1);
    assert_eq!(flight.pipeline.sigma_factor(), None);
    flight.pass(9);
    let early = flight.pipeline.sigma_factor().expect("nine seconds");
    assert!(!early.is_settled() && early.fits == 180, "{early:?}");
    flight.pass(2);
    let late = flight.settled();
    assert!(late.fits <= 202, "{late:?}");
    flight.pipeline.reset();
    assert_eq!(flight.pipeline.sigma_factor(), None);
}

#[test]
fn marker_in_another_place_than_the_map_has_it_ends_trust() {
    for (id, by) in [
        (5, Vector3::new(0.0, 0.1, 0.0)),
        (1, Vector3::new(0.0, 0.1, 0.0)),
        (6, Vector3::new(0.3, 0.3, 0.3)),
    ] {
        let mut flight = Flight::new(SIGMA_PX, &[(id, by)], 3);
        let first = flight.pass(10);
        let then = flight.pass(10);
        summary(
            &format!("marker {id} off by {:.2} m, first", by.norm()),
            &first,
        );
        summary("  then", &then);
        assert!(
            !then.iter().any(|outcome| outcome.code() == OutcomeCode::Ok),
            "{id}"
        );
        let suspects: Vec<u32> = flight.pipeline.suspect_markers().map(|s| s.id).collect();
        assert!(suspects.contains(&id), "{id}: {suspects:?}");
        let message = then.iter().find(|o| is_suspect(o)).expect("some").message();
        assert!(
            message.contains(&format!("marker {id} was left out of"))
                && message.contains("its position in the marker map or the calibration"),
            "{message}"
        );
    }
}

/// What hardly ever makes a frame disagree shows in the residuals of all.
#[test]
fn map_that_is_a_little_off_shows_in_the_factor() {
    let aside = Vector3::new(0.0, 0.05, 0.0);
    let up = Vector3::new(0.0, 0.0, 0.03);
    for moved in [vec![(5, aside)], vec![(3, aside)], vec![(3, up), (5, -up)]] {
        let mut flight = Flight::new(SIGMA_PX, &moved, 3);
        let outcomes = flight.pass(20);
        let found = flight.settled().factor;
        summary(
            &format!("{} marker(s) off, factor {found:.2}", moved.len()),
            &outcomes,
        );
        assert!(found > 1.3, "{found}");
    }
}

#[test]
fn suspicion_ends_with_frames_that_fit_and_not_with_a_pause() {
    let wrong = |detections: &mut Vec<Detection>| detections[4].u_px += 30.0;
    let mut flight = Flight::new(SIGMA_PX, &[], 5);
    for frame in 0..59 {
        let outcome = flight.next(|detections, _| wrong(detections));
        assert!(!is_suspect(&outcome), "{frame}");
    }
    for _ in 0..20 {
        flight.next(|detections, _| wrong(detections));
    }
    assert!(is_suspect(&flight.next(|detections, _| wrong(detections))));
    // A minute later, and without the marker: the others agree.
    flight.frame += 60 * RATE_HZ;
    let without = flight.next(|detections, _| {
        detections.remove(4);
    });
    assert_eq!(without.code(), OutcomeCode::Ok);
    let outcomes = flight.pass(20);
    assert!(is_suspect(&outcomes[0]), "a pause mends nothing");
    // One that is refused for its residuals is among them.
    let last = outcomes.iter().rposition(is_suspect).expect("the first");
    println!("over after {last} good frames");
    assert!((40..200).contains(&last), "{last}");
    let suspected = share(&outcomes[..last], is_suspect);
    assert!(suspected > 0.95, "{suspected}");

    flight.pass(3);
    for _ in 0..100 {
        flight.next(|detections, _| wrong(detections));
    }
    assert!(flight.pipeline.suspect_markers().next().is_some());
    flight.pipeline.reset();
    assert!(!is_suspect(&flight.next(|detections, _| wrong(detections))));
}

#[test]
fn short_glint_on_a_marker_is_a_wrong_detection() {
    let mut flight = Flight::new(SIGMA_PX, &[], 6);
    for _ in 0..10 {
        let mut outcomes = flight.pass(8);
        for _ in 0..2 * RATE_HZ {
            outcomes.push(flight.next(|detections, _| detections[1].v_px -= 25.0));
        }
        assert!(!outcomes.iter().any(is_suspect));
    }
}
