//! `tanker_pose simulate` as a process, heard by a node of the test's own over real DDS on loopback.

mod tools_support;

use std::process::Stdio;
use std::time::{Duration, Instant};

use serde_json::Value;
use tanker_pose::ros::messages::{CameraInfo, FeaturePointArray, Message, PoseStamped, Time};
use tanker_pose::ros::participant::{RosNode, Subscription, sensor_data};
use tools_support::{interrupt, json_lines, listener, tool};

/// Discovery on one host takes a fraction of a second; a loaded machine may take several.
const PATIENCE: Duration = Duration::from_secs(20);

/// What a subscriber heard, with the time at which each message was written.
struct Heard<M: Message> {
    subscription: Subscription<M>,
    messages: Vec<(M, Option<i64>)>,
}

impl<M: Message> Heard<M> {
    fn new(node: &mut RosNode, topic: &str) -> Self {
        Self {
            subscription: node
                .subscription(topic, &sensor_data(100))
                .expect("the name is valid"),
            messages: Vec::new(),
        }
    }

    fn take(&mut self) {
        while let Some((message, info)) = self.subscription.take().expect("well formed") {
            let written = info.source_timestamp().map(|t| t.to_nanos());
            self.messages.push((message, written));
        }
    }
}

/// The parser may be off in the last digit.
fn is_close(parsed: &Value, sent: f64) -> bool {
    parsed
        .as_f64()
        .is_some_and(|parsed| (parsed - sent).abs() < 1e-9)
}

#[test]
fn simulation_is_heard_camera_info_first_and_all_with_one_stamp() {
    let mut node = listener(3);
    let mut infos = Heard::<CameraInfo>::new(&mut node, "camera_info");
    let mut frames = Heard::<FeaturePointArray>::new(&mut node, "feature_points");
    let mut truths = Heard::<PoseStamped>::new(&mut node, "truth");
    let mut child = tool(3)
        .args(["simulate", "--duration-s", "2", "--rate-hz", "20"])
        .args(["--frame-id", "nose_camera", "--json"])
        .stdout(Stdio::piped())
        .spawn()
        .expect("the tool was just built");
    let deadline = Instant::now() + PATIENCE;
    while child.try_wait().expect("it is ours").is_none() && Instant::now() < deadline {
        infos.take();
        frames.take();
        truths.take();
        std::thread::sleep(Duration::from_millis(2));
    }
    let output = child.wait_with_output().expect("it is ours");
    assert_eq!(output.status.code(), Some(0));
    let sent = json_lines(&output.stdout);
    assert_eq!(sent.len(), 40);

    // Best effort may lose what was sent before this side had matched.
    assert!(frames.messages.len() >= 30, "{}", frames.messages.len());
    let mut latest = Time::default();
    for (frame, written) in &frames.messages {
        let stamp = frame.header.stamp;
        assert!((stamp.sec, stamp.nanosec) > (latest.sec, latest.nanosec));
        latest = stamp;
        assert_eq!(frame.header.frame_id, "nose_camera");
        let (info, info_written) = infos
            .messages
            .iter()
            .find(|(info, _)| info.header == frame.header)
            .expect("a camera info goes with each frame");
        assert_eq!((info.width, info.height), (508, 412));
        assert!(info_written <= written);
        let (truth, _) = truths
            .messages
            .iter()
            .find(|(truth, _)| truth.header == frame.header)
            .expect("the truth goes with each frame");
        assert!((10.0..70.0).contains(&truth.pose.position.z));
        let printed = sent
            .iter()
            .find(|line| {
                line["stamp"]["nanosec"] == stamp.nanosec && line["stamp"]["sec"] == stamp.sec
            })
            .expect("every frame is printed");
        assert!(is_close(&printed["points"][0]["u"], frame.points[0].u));
        assert!(is_close(
            &printed["truth"]["translation"][2],
            truth.pose.position.z
        ));
    }

    // It told that it left, so the graph does not remember it.
    let deadline = Instant::now() + Duration::from_secs(5);
    let publishers = || {
        node.publisher_count("feature_points")
            .expect("the name is valid")
    };
    while publishers() > 0 && Instant::now() < deadline {
        std::thread::sleep(Duration::from_millis(20));
    }
    assert_eq!(publishers(), 0);
    drop((infos, frames, truths));
    node.close();
}

#[test]
fn interrupted_simulation_ends_in_good_order() {
    let child = tool(4)
        .args(["simulate", "--loop", "--wait-s", "0", "--rate-hz", "100"])
        .args(["--ros-args", "-r", "__ns:=/uav1"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the tool was just built");
    std::thread::sleep(Duration::from_millis(1500));
    interrupt(&child);
    let began = Instant::now();
    let output = child.wait_with_output().expect("it is ours");
    assert!(began.elapsed() < Duration::from_secs(1));
    let said = String::from_utf8_lossy(&output.stdout);
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert!(said.contains("/uav1/tanker_simulation"), "{said}");
    assert!(said.contains("/uav1/feature_points"), "{said}");
    assert!(said.trim_end().ends_with("frames published"), "{said}");
    assert_eq!(String::from_utf8_lossy(&output.stderr), "");
}

/// Pixels and truth, without the stamps.
fn simulated(offset: u32, arguments: &[&str]) -> Vec<(Value, Value, Value)> {
    let output = tool(offset)
        .args([
            "simulate",
            "--wait-s",
            "0",
            "--duration-s",
            "0.5",
            "--rate-hz",
            "100",
            "--json",
        ])
        .args(arguments)
        .output()
        .expect("the tool was just built");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{said}");
    json_lines(&output.stdout)
        .into_iter()
        .map(|mut line| {
            let mut part = |name: &str| line[name].take();
            (part("points"), part("truth"), part("gross_error_id"))
        })
        .collect()
}

#[test]
fn same_seed_publishes_the_same_pixels() {
    let faults = ["--gross-error-every", "5"];
    let first = simulated(5, &[&["--seed", "7"][..], &faults].concat());
    let again = simulated(5, &[&["--seed", "7"][..], &faults].concat());
    let other = simulated(5, &[&["--seed", "8"][..], &faults].concat());
    assert_eq!(first.len(), 50);
    assert_eq!(first, again);
    assert_ne!(first, other);
    let moved = first.iter().filter(|(_, _, id)| id.is_number()).count();
    assert_eq!(moved, 10);
}

#[test]
fn markers_outside_the_image_of_a_distorted_camera_are_not_sent() {
    let yaml = std::fs::read_to_string(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/config/cameras/paper.yaml"
    ))
    .expect("it is shipped")
    .replace(
        "[0.0, 0.0, 0.0, 0.0, 0.0]",
        "[-0.3, 0.1, 0.001, -0.001, 0.0]",
    );
    let path = std::env::temp_dir().join(format!("distorted_{}.yaml", std::process::id()));
    std::fs::write(&path, yaml).expect("the temporary directory is writable");
    let path_text = path.to_str().expect("the path is text");
    let near = [
        "--start-range-m",
        "12",
        "--end-range-m",
        "6",
        "--camera",
        path_text,
    ];
    let frames = simulated(6, &near);
    std::fs::remove_file(&path).expect("it was just written");

    let points: Vec<&Value> = frames
        .iter()
        .flat_map(|(points, _, _)| points.as_array().into_iter().flatten())
        .collect();
    assert!(!points.is_empty());
    assert!(
        points.len() < 6 * frames.len(),
        "six markers need more distance"
    );
    let inside = |point: &&Value, axis: &str, size: f64| {
        point[axis]
            .as_f64()
            .is_some_and(|value| (-0.5..size - 0.5).contains(&value))
    };
    assert!(
        points
            .iter()
            .all(|point| inside(point, "u", 508.0) && inside(point, "v", 412.0))
    );
    assert_ne!(frames, simulated(6, &near[..4]), "distortion moves pixels");
}

#[test]
fn wrong_options_are_refused_by_name() {
    for (arguments, culprit) in [
        (&["simulate", "--rate-hz", "0"][..], "--rate-hz"),
        (
            &["simulate", "--marker-map", "/nonexistent.yaml"],
            "/nonexistent.yaml",
        ),
        (
            &["simulate", "--draw-tanker"],
            "expected a marker map with `sigma` or `flex`",
        ),
        (
            &["simulate", "--camera", "/nonexistent.yaml"],
            "/nonexistent.yaml",
        ),
        (
            &["simulate", "--duration-s", "0.01", "--rate-hz", "1"],
            "at least one frame",
        ),
        (&["simulate", "--ros-args", "-r", "nonsense"], "nonsense"),
        (
            &["simulate", "--duration-s", "-1"],
            "expected a number from 0.001",
        ),
        (
            &["simulate", "--ros-args", "-p", "sigma_px:=1"],
            "no parameter \"sigma_px\"",
        ),
        (
            &[
                "simulate",
                "--ros-args",
                "--params-file",
                "/nonexistent.yaml",
            ],
            "/nonexistent.yaml",
        ),
        (&["demo", "--domain-id", "233"], "--domain-id"),
        (&["demo", "--sigma-px", "-0.5"], "expected a number from 0"),
    ] {
        let output = tool(7)
            .args(arguments)
            .output()
            .expect("the tool was just built");
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(!output.status.success(), "{arguments:?}");
        assert!(said.contains(culprit), "{arguments:?}: {said}");
        assert!(!said.contains("panicked"), "{said}");
    }
}
