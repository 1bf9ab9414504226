//! `tanker_pose solve`, run as a program: one answer a line, in order, whatever comes.

mod support;

use std::io::{BufRead, BufReader, Write};
use std::process::{Command, Stdio};

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector6};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};
use support::random_refuelling_scene;
use tanker_pose::estimation::Observation;
use tanker_pose::geometry::{PoseCovariance, pose_error};

/// Runs the tool on these lines; writes and reads at once, as a pipe needs.
fn solve(options: &[&str], lines: Vec<String>) -> Vec<Value> {
    let mut child = Command::new(env!("CARGO_BIN_EXE_tanker_pose"))
        .arg("solve")
        .args(options)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("the tool starts");
    let mut input = child.stdin.take().expect("piped");
    let writer = std::thread::spawn(move || {
        for line in lines {
            writeln!(input, "{line}").expect("the tool reads to the end");
        }
    });
    let output = BufReader::new(child.stdout.take().expect("piped"));
    let answers = output
        .lines()
        .map(|line| serde_json::from_str(&line.expect("UTF-8")).expect("JSON"))
        .collect();
    writer.join().expect("all lines written");
    assert!(child.wait().expect("the tool ends").success());
    answers
}

fn camera() -> Value {
    json!({"width": 508, "height": 412, "distortion_model": "plumb_bob", "d": [0.0, 0.0, 0.0, 0.0, 0.0],
           "k": [571.0, 0.0, 254.0, 0.0, 571.0, 206.0, 0.0, 0.0, 1.0]})
}

fn point(seen: &Observation) -> Value {
    let p = seen.marker_in_tanker;
    json!({"id": seen.id, "x": p.x, "y": p.y, "z": p.z, "u": seen.pixel.u, "v": seen.pixel.v, "sigma": seen.sigma_px})
}

fn frame(id: usize, observations: &[Observation]) -> Value {
    json!({"id": id, "camera": camera(), "points": observations.iter().map(point).collect::<Vec<_>>()})
}

fn numbers<const N: usize>(answer: &Value, field: &str) -> [f64; N] {
    let values: Vec<f64> = serde_json::from_value(answer[field].clone()).expect(field);
    values.try_into().expect("the length of the contract")
}

fn pose(answer: &Value) -> Isometry3<f64> {
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_row_slice(&numbers::<9>(
        answer, "rotation",
    )));
    let [x, y, z] = numbers::<3>(answer, "translation");
    Isometry3::from_parts(
        Translation3::new(x, y, z),
        UnitQuaternion::from_rotation_matrix(&rotation),
    )
}

#[test]
fn a_hundred_thousand_frames_through_one_process_are_consistent() {
    const FRAMES: usize = 100_000;
    let mut random = ChaCha8Rng::seed_from_u64(40);
    let mut truths = Vec::with_capacity(FRAMES);
    let lines = (0..FRAMES)
        .map(|id| {
            let scene = random_refuelling_scene(&mut random, 12.0, 40.0);
            truths.push(*scene.truth_camera_from_tanker());
            frame(id, &scene.noisy_observations(0.5, &mut random)).to_string()
        })
        .collect();
    // Without exclusion, at the edge either, and with rivals allowed, so that the share of trusted frames is that of the chi-squared test.
    let answers = solve(
        &[
            "--max-outliers",
            "0",
            "--max-ambiguity",
            "1",
            "--edge-margin-px",
            "0",
        ],
        lines,
    );
    assert_eq!(answers.len(), FRAMES);
    let (mut trusted, mut nees_sum) = (0, 0.0);
    for (id, (answer, truth)) in answers.iter().zip(&truths).enumerate() {
        assert_eq!(
            answer["id"],
            json!(id),
            "answers stand in the order of the frames"
        );
        if answer["outcome"] == "ok" {
            trusted += 1;
            let covariance = PoseCovariance(nalgebra::Matrix6::from_row_slice(&numbers::<36>(
                answer,
                "covariance",
            )));
            let error: Vector6<f64> = pose_error(truth, &pose(answer));
            nees_sum += covariance
                .mahalanobis_squared(&error)
                .expect("positive definite");
        } else {
            assert_eq!(answer["outcome"], "not_trusted");
            assert!(
                answer.get("rotation").is_none(),
                "a doubtful pose is not given away"
            );
        }
    }
    let share = f64::from(trusted) / FRAMES as f64;
    let mean_nees = nees_sum / f64::from(trusted);
    println!("trusted {:.3} %, mean NEES {mean_nees:.3}", 100.0 * share);
    // 99.9 % pass the test by design: four standard errors of a share among 100,000.
    assert!((share - 0.999).abs() < 4.0e-4, "share {share}");
    // Six standard errors: sqrt(12 / 100,000) = 0.011.
    assert!((mean_nees - 6.0).abs() < 0.066, "mean NEES {mean_nees}");
}

#[test]
fn malformed_lines_are_answered_in_place_and_the_rest_is_solved() {
    let mut random = ChaCha8Rng::seed_from_u64(41);
    let scene = random_refuelling_scene(&mut random, 15.0, 16.0);
    let good = scene.noisy_observations(0.5, &mut random);
    let changed = |change: &dyn Fn(&mut Value)| {
        let mut value = frame(9, &good);
        change(&mut value);
        value.to_string()
    };
    let cases: Vec<(String, &str, &str)> = vec![
        (frame(9, &good).to_string(), "ok", ""),
        ("this is not JSON".into(), "malformed", "line 2"),
        (String::new(), "malformed", "line 3"),
        ("[]".into(), "malformed", "line 4"),
        (r#"{"id": 9}"#.into(), "malformed", "points"),
        (
            changed(&|v| v["camera"]["k"] = json!([1.0, 2.0])),
            "malformed",
            "length 2",
        ),
        (
            changed(&|v| v["points"][0]["sigm"] = json!(1.0)),
            "malformed",
            "sigm",
        ),
        (
            changed(&|v| v["points"][0]["x"] = json!(1e300)),
            "malformed",
            "within 1000 m",
        ),
        (
            changed(&|v| {
                v["points"][0].as_object_mut().map(|p| p.remove("z"));
            }),
            "malformed",
            "x, y, z",
        ),
        (
            changed(&|v| v["camera"]["k"][0] = json!(0.0)),
            "invalid_camera_info",
            "0",
        ),
        (
            changed(&|v| {
                v["camera"]["distortion_model"] = json!("fov");
                v["camera"]["d"] = json!([0.9]);
            }),
            "invalid_camera_info",
            "fov",
        ),
        (
            changed(&|v| v["points"][0]["id"] = json!(3)),
            "duplicate_id",
            "id 3",
        ),
        (
            changed(&|v| v["points"][0]["sigma"] = json!(-1.0)),
            "invalid_sigma",
            "-1",
        ),
        (
            changed(&|v| v["points"][0]["u"] = json!(1e9)),
            "outside_image",
            "508",
        ),
        (
            changed(&|v| v["points"] = json!([])),
            "too_few_points",
            "got 0",
        ),
        (
            changed(&|v| {
                v["points"][0]["u"] = json!(300.0);
                v["points"][3]["u"] = json!(20.0);
            }),
            "not_trusted",
            "chi-squared",
        ),
        (
            changed(&|v| {
                for p in v["points"].as_array_mut().into_iter().flatten() {
                    p["y"] = json!(0.0);
                    p["z"] = json!(0.0);
                }
            }),
            "degenerate_geometry",
            "one line",
        ),
        (frame(9, &good).to_string(), "ok", ""),
    ];
    let answers = solve(&[], cases.iter().map(|(line, ..)| line.clone()).collect());
    assert_eq!(answers.len(), cases.len());
    for ((line, outcome, words), answer) in cases.iter().zip(&answers) {
        assert_eq!(answer["outcome"], *outcome, "{line}\n{answer}");
        let message = answer["message"].as_str().expect("text");
        assert!(message.contains(words), "{line}\n{message}");
        assert_eq!(message.is_empty(), *outcome == "ok");
    }
}

#[test]
fn a_line_without_a_camera_names_the_option_that_brings_one() {
    let answers = solve(&[], vec![r#"{"id": 9, "points": []}"#.to_owned()]);
    let message = answers[0]["message"].as_str().expect("text");
    assert!(
        message.ends_with("expected a camera, or a file by --camera"),
        "{message}"
    );
}

#[test]
fn every_option_of_the_contract_is_taken() {
    let mut random = ChaCha8Rng::seed_from_u64(42);
    let scene = random_refuelling_scene(&mut random, 15.0, 16.0);
    let line = frame(1, &scene.noisy_observations(0.5, &mut random));
    let mut without_coordinates = line.clone();
    for point in without_coordinates["points"]
        .as_array_mut()
        .into_iter()
        .flatten()
    {
        let point = point.as_object_mut().expect("an object");
        for axis in ["x", "y", "z"] {
            point.remove(axis);
        }
    }
    let with_map = solve(
        &["--marker-map", "paper"],
        vec![without_coordinates.to_string()],
    );
    assert_eq!(with_map[0]["outcome"], "ok");
    for start in ["nominal", "dlt", "previous", "global"] {
        for refinement in ["maximum_likelihood", "none"] {
            let answers = solve(
                &["--initialisation", start, "--refinement", refinement],
                vec![line.to_string()],
            );
            assert_eq!(
                answers[0]["outcome"], "ok",
                "{start} {refinement}: {}",
                answers[0]
            );
            let distance = pose_error(&pose(&with_map[0]), &pose(&answers[0])).norm();
            assert!(
                distance < 0.2,
                "{start} {refinement} is elsewhere by {distance}"
            );
        }
    }
}

#[test]
fn the_cameras_mount_turns_the_nominal_attitude_as_in_the_node() {
    let mut random = ChaCha8Rng::seed_from_u64(44);
    let scene = random_refuelling_scene(&mut random, 15.0, 16.0);
    let line = frame(1, &scene.noisy_observations(0.5, &mut random)).to_string();
    // Tanker and camera turned alike are where they were; one of them alone is the wrong way round.
    let together = [
        "--nominal-yaw-deg",
        "-170",
        "--camera-mount-yaw-deg",
        "-170",
    ];
    let apart = ["--camera-mount-yaw-deg", "-170"];
    let solved = |options: &[&str]| solve(options, vec![line.clone()]).remove(0);

    let (plain, turned) = (solved(&[]), solved(&together));

    assert_eq!(plain["outcome"], "ok");
    let distance = pose_error(&pose(&plain), &pose(&turned)).norm();
    assert!(distance < 1e-6, "elsewhere by {distance}");
    assert_ne!(solved(&apart)["outcome"], "ok");
}

#[test]
fn a_wrong_point_is_left_out_and_named() {
    let mut random = ChaCha8Rng::seed_from_u64(43);
    let scene = random_refuelling_scene(&mut random, 15.0, 16.0);
    let mut seen = scene.noisy_observations(0.5, &mut random);
    seen[2].pixel.u += 40.0;
    let line = frame(1, &seen).to_string();
    let answer = &solve(&["--max-outliers", "1"], vec![line.clone()])[0];
    assert_eq!(answer["outcome"], "ok", "{answer}");
    assert_eq!(answer["rejected_ids"], json!([3]));
    assert_eq!(answer["used_ids"], json!([1, 2, 4, 5, 6]));
    let answer = &solve(&["--max-outliers", "0"], vec![line])[0];
    assert_eq!(answer["outcome"], "not_trusted", "{answer}");
}

/// A map with a budget: wider covariance, the modes' amplitudes, and what dominates.
#[test]
fn a_budget_widens_the_covariance_and_names_what_dominates() {
    let map = "name: kite
sigma: 0.02
markers:
  - {id: 1, x: 3.7, y: -7.13, z: 0.7}
  - {id: 2, x: 3.7, y: 7.13, z: 0.7}
  - {id: 3, x: 7.79, y: -2.689, z: 0.7}
  - {id: 4, x: 7.79, y: 2.689, z: 0.7}
  - {id: 5, x: 7.96, y: 0.0, z: 3.189}
  - {id: 6, x: 0.0, y: 0.0, z: 0.0}
flex:
  - name: wing_bending
    sigma: 0.3
    shape: [{id: 1, z: 1}, {id: 2, z: 1}, {id: 3, z: 0.142}, {id: 4, z: 0.142}]
";
    let path = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("budget_kite.yaml");
    std::fs::write(&path, map).expect("a file");
    let scene = tanker_pose::simulation::paper_scene();
    let points: Vec<Value> = scene
        .exact_observations()
        .iter()
        .map(|seen| json!({"id": seen.id, "u": seen.pixel.u, "v": seen.pixel.v}))
        .collect();
    let line = json!({"id": 1, "camera": camera(), "points": points}).to_string();
    let path = path.to_str().expect("a plain path");
    let exact = solve(&["--marker-map", "paper"], vec![line.clone()]);
    let with_budget = solve(
        &[
            "--marker-map",
            path,
            "--focal-length-sigma",
            "0.003",
            "--principal-point-sigma-px",
            "3",
            "--k1-sigma",
            "0.02",
            "--jitter-px",
            "0.5",
        ],
        vec![line],
    );
    let variance = |answer: &Value| answer["covariance"][0].as_f64().expect("a pose");
    assert!(variance(&with_budget[0]) > 10.0 * variance(&exact[0]));
    assert!(exact[0].get("modes").is_none());
    let modes = with_budget[0]["modes"].as_object().expect("modes");
    let names: Vec<&str> = modes.keys().map(String::as_str).collect();
    let expected = [
        "distortion_0",
        "focal_length",
        "jitter_u",
        "jitter_v",
        "principal_point_u",
        "principal_point_v",
        "wing_bending",
    ];
    assert_eq!(names, expected);
    // Exact pixels: nothing was bent.
    assert!(
        modes
            .values()
            .all(|value| value.as_f64().is_some_and(|a| a.abs() < 1e-6))
    );
    let dominant = with_budget[0]["dominant_cause"].as_str().expect("a name");
    assert!(dominant.starts_with("principal_point"), "{dominant}");
}

#[test]
fn certificate_is_told_only_where_it_is_asked_for() {
    let points: Vec<Value> = tanker_pose::simulation::paper_scene()
        .exact_observations()
        .iter()
        .map(|seen| json!({"id": seen.id, "u": seen.pixel.u, "v": seen.pixel.v}))
        .collect();
    let line = json!({"id": 1, "camera": camera(), "points": points}).to_string();
    let plain = solve(&["--marker-map", "paper"], vec![line.clone()]);
    assert!(plain[0].get("certificate").is_none());
    assert!(plain[0].get("runner_up_gap").is_none());
    for option in ["--certify", "--require-certificate"] {
        let answers = solve(&["--marker-map", "paper", option], vec![line.clone()]);
        assert_eq!(answers[0]["outcome"], "ok");
        assert_eq!(answers[0]["certificate"], "certified");
        // The mirrored tanker fits far worse.
        assert!(answers[0]["runner_up_gap"].is_null());
        assert_eq!(answers[0]["covariance"], plain[0]["covariance"]);
    }
}
