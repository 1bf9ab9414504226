//! `tanker_pose demo` as a process, over real DDS on loopback.

mod tools_support;

use std::process::Stdio;
use std::time::{Duration, Instant};

use serde_json::Value;
use tools_support::{interrupt, tool};

#[test]
fn short_demo_gives_every_frame_an_outcome_and_honest_statistics() {
    let output = tool(0)
        .args(["demo", "--duration-s", "4", "--json"])
        .output()
        .expect("the tool was just built");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{said}");
    let summary: Value = serde_json::from_slice(&output.stdout).expect("one JSON object");

    let count = |pointer: &str| summary.pointer(pointer).and_then(Value::as_u64);
    let number = |pointer: &str| summary.pointer(pointer).and_then(Value::as_f64);
    assert_eq!(count("/sent"), Some(120), "{summary}");
    assert_eq!(count("/missing"), Some(0), "{summary}");
    assert_eq!(
        count("/estimates")
            .zip(count("/refusals"))
            .map(|(e, r)| e + r),
        Some(120),
        "{summary}"
    );
    assert_eq!(count("/injected/frames"), Some(15), "{summary}");
    assert_eq!(count("/injected/taken_for_good"), Some(0), "{summary}");
    assert_eq!(count("/injected/refused"), Some(10), "{summary}");
    // The seed is fixed, so this is no matter of luck.
    let nees = number("/nees/mean").expect("there are estimates");
    let low = number("/nees/expected_interval_95/0").expect("there are estimates");
    let high = number("/nees/expected_interval_95/1").expect("there are estimates");
    assert!(low < nees && nees < high, "{summary}");
    let ahead_m = |bin: usize| number(&format!("/accuracy/{bin}/position_rmse_m/2"));
    assert!(
        ahead_m(0) > ahead_m(1) && ahead_m(1) > ahead_m(2),
        "{summary}"
    );
    assert!(ahead_m(0) < Some(0.5), "{summary}");
    let latency = number("/latency_ms/p50").expect("there are estimates");
    assert!(latency > 0.0 && latency < 100.0, "{summary}");
}

#[test]
fn demo_in_a_drawn_world_is_honest_about_it() {
    let output = tool(5)
        .args(["demo", "--duration-s", "4", "--json", "--draw-tanker"])
        .args(["--marker-map", "config/tankers/budget_example.yaml"])
        .args(["--focal-length-sigma", "0.003", "--jitter-px", "0.3"])
        .args(["--principal-point-sigma-px", "2", "--k1-sigma", "0.01"])
        .output()
        .expect("the tool was just built");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{said}");
    let summary: Value = serde_json::from_slice(&output.stdout).expect("one JSON object");
    assert_eq!(summary["missing"], Value::from(0));
    assert_eq!(summary["injected"]["taken_for_good"], Value::from(0));
    let nees = &summary["nees"];
    assert_eq!(nees["one_draw"], Value::Bool(true));
    let number = |value: &Value| value.as_f64().expect("there are estimates");
    let interval = &nees["expected_interval_95"];
    let (low, high) = (number(&interval[0]), number(&interval[1]));
    assert!((1.2..1.3).contains(&low) && (14.0..15.0).contains(&high));
    // Without the budget it would be some hundreds.
    let mean = number(&nees["mean"]);
    assert!(low < mean && mean < high, "{summary}");
}

#[test]
fn demo_ends_in_good_order_when_interrupted() {
    let child = tool(1)
        .args(["demo", "--json"])
        .stdout(Stdio::piped())
        .spawn()
        .expect("the tool was just built");
    std::thread::sleep(Duration::from_secs(2));
    interrupt(&child);
    let began = Instant::now();
    let output = child.wait_with_output().expect("it is ours");
    assert_eq!(output.status.code(), Some(0));
    assert!(began.elapsed() < Duration::from_secs(3));
    let summary: Value = serde_json::from_slice(&output.stdout).expect("one JSON object");
    assert_eq!(summary["interrupted"], Value::Bool(true));
    assert_eq!(summary["missing"], Value::from(0));
}

#[test]
fn a_map_with_fewer_markers_than_the_node_needs_is_refused_at_once() {
    let path = std::env::temp_dir().join(format!("four_{}.yaml", std::process::id()));
    let corners = [(0, 0, 0), (4, 0, 0), (0, 3, 0), (0, 0, 2)];
    let lines: Vec<String> = corners
        .iter()
        .zip(1..)
        .map(|((x, y, z), id)| format!("  - {{id: {id}, x: {x}, y: {y}, z: {z}}}\n"))
        .collect();
    std::fs::write(&path, format!("name: four\nmarkers:\n{}", lines.concat()))
        .expect("the directory for such files exists");
    let output = tool(4)
        .arg("demo")
        .arg("--marker-map")
        .arg(&path)
        .output()
        .expect("the tool was just built");
    std::fs::remove_file(&path).expect("just written");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("\"four\" has 4 markers"), "{said}");
    assert!(said.contains("needs 5"), "{said}");
}

#[test]
fn demo_does_not_fly_where_a_camera_already_publishes() {
    let mut other = tool(2)
        .args(["simulate", "--loop", "--wait-s", "0", "--json"])
        .stdout(Stdio::null())
        .spawn()
        .expect("the tool was just built");
    std::thread::sleep(Duration::from_secs(1));
    let output = tool(2)
        .arg("demo")
        .output()
        .expect("the tool was just built");
    interrupt(&other);
    other.wait().expect("it is ours");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("feature_points"), "{said}");
    assert!(said.contains("--domain-id"), "{said}");
}
