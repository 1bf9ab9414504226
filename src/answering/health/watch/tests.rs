//! Faults over simulated seconds.

use super::*;

/// A watch with its own seconds.
struct Scene {
    watch: Watch,
    graph: Graph,
    clock: Option<ClockSilence>,
    now: Instant,
}

impl Scene {
    fn new() -> Self {
        let now = Instant::now();
        Self {
            watch: Watch::new("/points".into(), "/camera".into(), now),
            graph: Graph::default(),
            clock: None,
            now,
        }
    }

    fn publishers(&mut self, topic: &str, count: usize) {
        self.graph.heard.insert(topic.to_owned(), count);
    }

    /// Lets seconds pass, in each of which these arrive.
    fn pass(&mut self, seconds: u64, detections: bool, camera: bool) -> Vec<Fault> {
        for _ in 0..seconds {
            self.now += Duration::from_secs(1);
            if detections {
                self.watch.on_detections(self.now);
            }
            if camera {
                self.watch.on_camera_info(self.now);
            }
            let second = Second {
                graph: &self.graph,
                clock_jump: None,
                system_clock: None,
                clock_silence: self.clock,
                dropped: Vec::new(),
            };
            self.watch.on_second(second, self.now);
        }
        self.watch.faults.iter().map(|(fault, _)| fault).collect()
    }
}

#[test]
fn silence_is_a_fault_when_somebody_could_speak_and_ends_with_a_word() {
    let mut scene = Scene::new();
    assert_eq!(scene.pass(60, false, false), [], "nobody is there");
    scene.publishers("/points", 1);
    assert_eq!(scene.pass(5, false, false), []);
    assert_eq!(scene.pass(1, false, false), [Fault::SilentPublisher]);
    assert_eq!(scene.pass(1, true, false), []);
    assert_eq!(scene.pass(5, false, false), [Fault::SilentPublisher]);
    scene.publishers("/points", 0);
    assert_eq!(scene.pass(1, false, false), [Fault::NoDetections]);
}

#[test]
fn camera_without_detections_is_a_fault() {
    let mut scene = Scene::new();
    assert_eq!(scene.pass(4, false, true), []);
    assert_eq!(scene.pass(1, false, true), [Fault::NoDetections]);
    assert_eq!(scene.pass(1, true, true), []);
}

#[test]
fn steady_camera_info_gets_stale_and_a_latched_one_does_not() {
    let mut scene = Scene::new();
    assert_eq!(scene.pass(2, true, true), []);
    assert_eq!(scene.pass(60, true, false), [], "it may be sent once");
    assert_eq!(scene.pass(3, true, true), []);
    assert_eq!(scene.pass(4, true, false), []);
    assert_eq!(scene.pass(1, true, false), [Fault::StaleCameraInfo]);
    assert_eq!(scene.pass(1, true, true), []);
}

#[test]
fn simulated_time_that_never_comes_or_stops_is_a_fault_until_it_comes() {
    let mut scene = Scene::new();
    for ever in [false, true] {
        let since = scene.now;
        scene.clock = Some(ClockSilence { since, ever });
        assert_eq!(scene.pass(4, false, false), []);
        assert_eq!(scene.pass(1, false, false), [Fault::NoClock]);
        let since = scene.now;
        scene.clock = Some(ClockSilence { since, ever: true });
        assert_eq!(scene.pass(1, false, false), []);
    }
    scene.clock = None;
    assert_eq!(
        scene.pass(60, false, false),
        [],
        "time is the system's again"
    );
}

#[test]
fn camera_that_begins_anew_may_send_once() {
    let mut scene = Scene::new();
    scene.publishers("/camera", 1);
    assert_eq!(scene.pass(5, true, true), []);
    scene.publishers("/camera", 0);
    assert_eq!(scene.pass(4, true, false), []);
    assert_eq!(scene.pass(1, true, false), [Fault::StaleCameraInfo], "gone");
    scene.publishers("/camera", 1);
    assert_eq!(scene.pass(1, true, true), []);
    assert_eq!(scene.pass(60, true, false), [], "it may be latched now");
    assert_eq!(scene.pass(3, true, true), []);
    assert_eq!(scene.pass(5, true, false), [Fault::StaleCameraInfo]);
}

#[test]
fn camera_that_comes_a_moment_after_the_detections_is_no_fault() {
    let mut scene = Scene::new();
    scene
        .watch
        .on_refusal(Fault::NoCameraInfo, "no camera", scene.now);
    assert_eq!(scene.pass(1, true, false), []);
    assert_eq!(scene.pass(60, true, true), []);
}

#[test]
fn refusals_for_the_surroundings_last_until_they_are_answered() {
    let mut scene = Scene::new();
    let (watch, now) = (&mut scene.watch, scene.now);
    watch.on_refusal(Fault::NoCameraInfo, "no camera", now);
    watch.on_refusal(Fault::FrameMismatch, "frames", now);
    assert_eq!(scene.pass(1, true, false), [Fault::FrameMismatch]);
    let both = [Fault::NoCameraInfo, Fault::FrameMismatch];
    assert_eq!(scene.pass(1, true, false), both, "a camera may come late");
    assert_eq!(scene.pass(2, true, true), [Fault::FrameMismatch]);
    assert_eq!(scene.pass(1, true, true), [Fault::FrameMismatch]);
    scene.watch.on_image(Time { sec: 7, nanosec: 0 }, scene.now);
    assert_eq!(scene.pass(1, true, true), []);
}

#[test]
fn attitudes_that_cannot_be_used_are_a_fault_of_each_aircraft_and_end_with_good_samples() {
    let mut scene = Scene::new();
    for of in ["receiver", "tanker"] {
        let error: Option<&dyn fmt::Display> = Some(&"on its back");
        scene.watch.on_attitude_taken(of, error, scene.now);
    }
    let both = [Fault::UnusableAttitude, Fault::UnusableAttitude];
    assert_eq!(scene.pass(1, false, false), both);
    scene.watch.on_attitude_taken("tanker", None, scene.now);
    assert_eq!(scene.pass(2, false, false), [Fault::UnusableAttitude]);
    let (_, words) = scene.watch.faults.iter().next().expect("one is left");
    assert_eq!(
        words,
        "samples of the receiver's attitude are not used: on its back"
    );
}

#[test]
fn contradiction_of_attitudes_is_a_fault_until_they_agree_that_names_what_is_held_back() {
    let mut scene = Scene::new();
    let found: Option<&dyn fmt::Display> = Some(&"60° apart");
    scene.watch.on_attitudes_compared(found, scene.now);
    assert_eq!(scene.pass(1, false, false), [Fault::AttitudeContradiction]);
    let (_, words) = scene.watch.faults.iter().next().expect("a fault");
    assert!(
        words.contains("60° apart; outputs in local axes are held back"),
        "{words}"
    );
    scene.watch.on_attitudes_compared(None, scene.now);
    assert_eq!(scene.pass(2, false, false), []);
}
