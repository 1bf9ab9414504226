//! `tanker_pose check`, run as a program: what it prints, draws and returns.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::{Value, json};
use tanker_pose::simulation::{Approach, ApproachSettings, paper_camera};
use tanker_pose::target::MarkerMap;

/// A directory for one test's files.
fn directory(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR"))
        .join("check")
        .join(name);
    if path.exists() {
        std::fs::remove_dir_all(&path).expect("an old run can be removed");
    }
    std::fs::create_dir_all(&path).expect("a directory of the build");
    path
}

fn check(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tanker_pose"))
        .arg("check")
        .args(arguments)
        .output()
        .expect("the tool starts")
}

fn code(output: &Output) -> i32 {
    output.status.code().expect("it ended by itself")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).expect("UTF-8")
}

fn path(path: &Path) -> &str {
    path.to_str().expect("UTF-8")
}

/// A map's YAML, with one marker moved.
fn yaml(map: &MarkerMap, wrong: u32, dz_m: f64, factor: f64) -> String {
    let markers = map.markers().iter().map(|marker| {
        let p = factor * marker.marker_in_tanker.coords;
        let dz_m = if marker.id == wrong { dz_m } else { 0.0 };
        format!(
            "  - {{id: {}, x: {:?}, y: {:?}, z: {:?}}}\n",
            marker.id,
            p.x,
            p.y,
            p.z + dz_m
        )
    });
    format!("name: test\nmarkers:\n{}", markers.collect::<String>())
}

/// A recording of the paper's tanker, as `solve` reads it.
fn recording(map: &MarkerMap) -> String {
    let settings = ApproachSettings {
        start_range_m: 40.0,
        duration_s: 4.0,
        rate_hz: 15.0,
        ..ApproachSettings::default()
    };
    let approach = Approach::new(settings, paper_camera(), map.clone());
    let lines = (0..approach.frame_count()).map(|index| {
        let points = approach.frame(index).detections.into_iter();
        let points = points.map(
            |seen| json!({"id": seen.id, "u": seen.u_px, "v": seen.v_px, "sigma": seen.sigma_px}),
        );
        let camera = json!({"width": 508, "height": 412, "k": [571, 0, 254, 0, 571, 206, 0, 0, 1]});
        json!({"id": index, "camera": camera, "points": points.collect::<Vec<_>>()}).to_string()
            + "\n"
    });
    lines.collect()
}

#[test]
fn the_papers_map_is_reported_as_tables_json_and_a_plot() {
    let out = directory("paper");
    let output = check(&["--marker-map", "paper", "--json", "--output", path(&out)]);
    // Its wing tips leave the image long before contact.
    assert_eq!(code(&output), 1);
    let report: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let stations = report["stations"].as_array().expect("stations");
    assert_eq!(stations.len(), 20);
    assert_eq!(stations[0]["range_m"], 60.0);
    assert_eq!(
        stations[0]["points"][0]["protection_level_m"]
            .as_array()
            .expect("levels")
            .len(),
        3
    );
    assert_eq!(
        stations[0]["without"].as_array().expect("each one").len(),
        6
    );
    let severities: Vec<&Value> = report["findings"]
        .as_array()
        .expect("findings")
        .iter()
        .map(|f| &f["severity"])
        .collect();
    assert!(!severities.contains(&&json!("error")), "{severities:?}");
    let file = report["files"][0].as_str().expect("a plot");
    let svg = std::fs::read_to_string(file).expect("it was written");
    assert!(svg.starts_with("<svg") && svg.contains("protection level vertical"));

    let tables = text(&check(&["--marker-map", "paper"]).stdout);
    for words in [
        "the paper's is assumed",
        "Point \"markers_mean\"",
        "With one beacon lost",
        "Good enough?",
        "one more beacon helps most",
        "No plots were written",
    ] {
        assert!(tables.contains(words), "{words}: {tables}");
    }
}

#[test]
fn exit_codes_tell_fine_from_findings_from_unreadable() {
    let example = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/config/tankers/budget_example.yaml"
    );
    let near = ["--marker-map", example, "--from-m", "25", "--to-m", "15"];
    let fine = check(&[&near[..], &["--required-m", "3"]].concat());
    assert_eq!(code(&fine), 0, "{}", text(&fine.stdout));
    let found = check(&[
        "--marker-map",
        example,
        "--to-m",
        "15",
        "--required-m",
        "0.01",
    ]);
    assert_eq!(code(&found), 1);
    for arguments in [
        &["--marker-map", "/nowhere.yaml"][..],
        &["--marker-map", "paper", "--camera", "/nowhere.yaml"],
        &["--marker-map", "paper", "--recording", "/nowhere.jsonl"],
        &["--marker-map", "paper", "--refuelling", "/nowhere.yaml"],
        &["--marker-map", "paper", "--from-m", "4"],
        &["--marker-map", "paper", "--to-m", "-4"],
    ] {
        let output = check(arguments);
        assert_eq!(code(&output), 2, "{arguments:?}");
        assert!(output.stdout.is_empty() && !output.stderr.is_empty());
    }
}

#[test]
fn a_map_in_millimetres_is_a_finding() {
    let file = directory("mm").join("mm.yaml");
    let map = MarkerMap::shipped("paper").expect("shipped");
    std::fs::write(&file, yaml(&map, 0, 0.0, 1000.0)).expect("written");
    let output = check(&["--marker-map", path(&file)]);
    assert_eq!(code(&output), 1);
    assert!(text(&output.stdout).contains("coordinates in mm?"));
}

#[test]
fn a_recording_names_the_beacon_that_is_30_cm_off() {
    let out = directory("recording");
    let map = MarkerMap::shipped("paper").expect("shipped");
    let (wrong, lines) = (out.join("wrong.yaml"), out.join("frames.jsonl"));
    std::fs::write(&wrong, yaml(&map, 4, 0.3, 1.0)).expect("written");
    std::fs::write(&lines, recording(&map)).expect("written");
    let of = |map: &str| check(&["--marker-map", map, "--recording", path(&lines)]);
    let output = of(path(&wrong));
    assert_eq!(code(&output), 1);
    let report = text(&output.stdout);
    assert!(
        report.contains("error: misplaced: marker 4 is 30 cm away")
            || report.contains("error: misplaced: marker 4 is 29 cm away")
            || report.contains("error: misplaced: marker 4 is 31 cm away"),
        "{report}"
    );
    assert!(report.contains("that of the recording's first frame"));
    let report = text(&of("paper").stdout);
    assert!(
        report.contains("60 of 60 frames fit") && !report.contains("error:"),
        "{report}"
    );
}
