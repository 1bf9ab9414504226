//! The node as a process: what it says and how it ends. No peer is needed; loopback is.

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// From the signal to the end of the process; about 10 ms unloaded.
const LEAVES_WITHIN: Duration = Duration::from_secs(1);

/// The node on loopback in a domain that nothing else of this test run uses.
fn node(domain_offset: u32) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_tanker_pose_node"));
    let domain = 10 + 10 * domain_offset + std::process::id() % 10;
    command
        .env("ROS_DOMAIN_ID", domain.to_string())
        .env("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        .env_remove("ROS_LOCALHOST_ONLY")
        .env_remove("RUST_LOG");
    command
}

fn run(arguments: &[&str]) -> (Option<i32>, String) {
    let output: Output = node(0)
        .args(arguments)
        .output()
        .expect("the node was just built");
    (
        output.status.code(),
        String::from_utf8_lossy(&output.stderr).into_owned(),
    )
}

#[test]
fn help_and_version_end_well() {
    for argument in ["--help", "-h", "--version", "-V"] {
        assert_eq!(run(&[argument]).0, Some(0), "{argument}");
    }
}

#[test]
fn command_line_that_is_not_understood_ends_with_2_and_is_quoted() {
    for wrong in [
        &["tanker.yaml"][..],
        &["--ros-args", "--bogus"],
        &["--ros-args", "-p", "a"],
    ] {
        let (code, said) = run(wrong);
        assert_eq!(code, Some(2), "{wrong:?}: {said}");
        assert!(said.contains(wrong[wrong.len() - 1]), "{wrong:?}: {said}");
    }
}

#[test]
fn wrong_start_values_end_with_1_and_name_the_culprit() {
    for (wrong, culprit) in [
        (&["-p", "pixel_sigma:=1"][..], "pixel_sigma_px"),
        (&["-p", "max_outliers:=9"], "max_outliers"),
        (
            &["-p", "marker_map:=/nonexistent/map.yaml"],
            "/nonexistent/map.yaml",
        ),
        (
            &["--params-file", "/nonexistent/p.yaml"],
            "/nonexistent/p.yaml",
        ),
        (&["-r", "__ns:=no_slash"], "no_slash"),
    ] {
        let (code, said) = run(&[&["--ros-args"], wrong].concat());
        assert_eq!(code, Some(1), "{wrong:?}: {said}");
        assert!(said.contains(culprit), "{wrong:?}: {said}");
        assert!(!said.contains("panicked"), "{wrong:?}: {said}");
    }
}

#[test]
fn unknown_parameter_in_a_file_is_named_with_file_and_line() {
    let path = std::env::temp_dir().join(format!("unknown_parameter_{}.yaml", std::process::id()));
    std::fs::write(
        &path,
        "tanker_pose:\n  ros__parameters:\n    min_points: 4\n    max_outlier: 1\n",
    )
    .expect("the temporary directory is writable");
    let path_text = path.to_str().expect("the path is text");
    let (code, said) = run(&["--ros-args", "--params-file", path_text]);
    std::fs::remove_file(&path).expect("it was just written");
    assert_eq!(code, Some(1), "{said}");
    for part in [
        path_text,
        "line 4",
        "max_outlier",
        "did you mean \"max_outliers\"",
    ] {
        assert!(said.contains(part), "{part}: {said}");
    }
}

#[test]
fn wrong_environment_ends_with_1_and_names_the_variable() {
    for (variable, value) in [
        ("ROS_DOMAIN_ID", "233"),
        ("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF"),
        ("ROS_LOCALHOST_ONLY", "maybe"),
    ] {
        let output = node(0)
            .env(variable, value)
            .output()
            .expect("the node was just built");
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(said.contains(variable), "{said}");
    }
}

#[test]
fn interrupt_and_termination_end_the_node_well_within_a_second() {
    for (offset, signal) in [(1, "INT"), (2, "TERM")] {
        let mut child = node(offset)
            .args(["--ros-args", "-r", "__ns:=/uav1"])
            .stderr(Stdio::piped())
            .spawn()
            .expect("the node was just built");
        let mut lines = BufReader::new(child.stderr.take().expect("it is piped")).lines();
        let listening = lines
            .by_ref()
            .map_while(Result::ok)
            .find(|line| line.contains("listening"));
        assert!(listening.is_some_and(|line| line.contains("/uav1/feature_points")));

        let began = Instant::now();
        send(signal, &child);
        let status = child.wait().expect("it is ours");
        let rest: Vec<String> = lines.map_while(Result::ok).collect();
        assert_eq!(status.code(), Some(0), "{signal}: {rest:?}");
        assert!(
            began.elapsed() < LEAVES_WITHIN,
            "{signal}: {:?}",
            began.elapsed()
        );
        assert!(
            !rest.iter().any(|line| line.contains("ERROR")),
            "{signal}: {rest:?}"
        );
    }
}

fn send(signal: &str, child: &Child) {
    let sent = Command::new("kill")
        .args(["-s", signal, &child.id().to_string()])
        .status();
    assert!(sent.expect("kill is part of the system").success());
}
