//! What each lint finds, in maps made wrong on purpose and in right ones.

use std::rc::Rc;

use clap::Parser;
use nalgebra::{Matrix3, Point3, Vector3};
use tanker_pose::camera::CameraInfo;
use tanker_pose::simulation::{Approach, ApproachSettings};
use tanker_pose::target::{Marker, MarkerMap};

use super::axes::Hypothesis;
use super::finding::{Finding, Severity};
use super::recording::{Frame, Recording, Sight};
use super::situation::Situation;
use super::{Arguments, Checked, PAPER_CAMERA, shape, situation};

const BUDGET_EXAMPLE: &str = include_str!("../../../../config/tankers/budget_example.yaml");

#[derive(Parser)]
struct Line {
    #[command(flatten)]
    check: Arguments,
}

fn paper_camera() -> CameraInfo {
    let (info, _) = CameraInfo::from_yaml(PAPER_CAMERA, "paper.yaml").expect("shipped");
    info
}

fn shipped(name: &str) -> MarkerMap {
    match name {
        "budget_example" => MarkerMap::from_yaml(BUDGET_EXAMPLE, "example").expect("shipped"),
        name => MarkerMap::shipped(name).expect("shipped"),
    }
}

/// The situation of a map with these options.
fn of(map: MarkerMap, options: &[&str]) -> Situation {
    let words = ["check", "--marker-map", "paper", "--steps", "8"];
    let line = Line::parse_from(words.iter().chain(options));
    situation(&line.check, map, paper_camera()).expect("sound options")
}

/// The map with every marker moved.
fn moved(map: &MarkerMap, place: impl Fn(u32, Point3<f64>) -> Point3<f64>) -> MarkerMap {
    let markers: Vec<Marker> = map
        .markers()
        .iter()
        .map(|marker| Marker::from((marker.id, place(marker.id, marker.marker_in_tanker))))
        .collect();
    MarkerMap::new("moved", &markers).expect("still a map")
}

/// Sixty frames of an approach to the true tanker, 40 m to 15 m away, half a pixel of noise.
fn recording(truth: &MarkerMap, seed: u64) -> Recording {
    let sight = Rc::new(Sight::new(paper_camera(), false).expect("shipped"));
    let settings = ApproachSettings {
        start_range_m: 40.0,
        duration_s: 4.0,
        rate_hz: 15.0,
        seed,
        ..ApproachSettings::default()
    };
    let approach = Approach::new(settings, sight.camera.clone(), truth.clone());
    let frames = (0..approach.frame_count()).map(|index| Frame {
        sight: Rc::clone(&sight),
        detections: approach.frame(index).detections,
    });
    Recording {
        frames: frames.collect(),
        lines: 60,
        unusable: 0,
        first_reason: None,
    }
}

/// What is found in a map against a recording of the true tanker.
fn against(map: MarkerMap, truth: &MarkerMap, seed: u64) -> Vec<Finding> {
    let situation = of(map, &[]);
    let recording = recording(truth, seed);
    Checked::new(&situation, Some(&recording), 0.1, Vec::new()).findings
}

fn errors(findings: &[Finding]) -> Vec<&Finding> {
    let errors = findings.iter();
    errors
        .filter(|finding| finding.severity == Severity::Error)
        .collect()
}

fn of_code<'a>(findings: &'a [Finding], code: &str) -> Option<&'a Finding> {
    findings.iter().find(|finding| finding.code == code)
}

#[test]
fn shipped_maps_have_no_error_alone_or_against_recordings_of_themselves() {
    for name in ["paper", "fin6", "budget_example"] {
        let situation = of(shipped(name), &[]);
        let alone = Checked::new(&situation, None, 0.1, Vec::new());
        assert!(errors(&alone.findings).is_empty(), "{:?}", alone.findings);
        for seed in 1..=5 {
            let findings = against(shipped(name), &shipped(name), seed);
            assert!(errors(&findings).is_empty(), "{name}, {seed}: {findings:?}");
            assert_eq!(of_code(&findings, "misplaced"), None, "{name}, {seed}");
        }
    }
}

#[test]
fn coordinates_in_other_units_are_named() {
    let scaled = |factor: f64| moved(&shipped("paper"), |_, place| place * factor);
    for (factor, word) in [(100.0, "in cm?"), (0.001, "in km?"), (1.0 / 0.3048, "")] {
        let (_, findings) = shape::lint(&scaled(factor));
        match of_code(&findings, "units") {
            Some(finding) => {
                assert_eq!(finding.severity, Severity::Error);
                assert!(
                    !word.is_empty() && finding.advice.contains(word),
                    "{finding}"
                );
            }
            // 47 m between the wing tips may well be a tanker.
            None => assert_eq!(word, ""),
        }
    }
    // Millimetres are too far for a map at all.
    let text = "name: mm\nmarkers:\n  - {id: 1, x: 3700, y: -7130, z: 700}\n  - {id: 2, x: 3700, y: 7130, z: 700}\n  - {id: 3, x: 0, y: 0, z: 0}\n";
    let error = MarkerMap::from_yaml(text, "mm.yaml").expect_err("7 km are no tanker");
    let finding = shape::of_refusal(&error).expect("because of its coordinates");
    assert_eq!((finding.code, finding.severity), ("units", Severity::Error));
    assert!(finding.advice.contains("in mm?"), "{finding}");
}

#[test]
fn x_aft_is_named_against_a_recording() {
    for name in ["paper", "fin6", "budget_example"] {
        let truth = shipped(name);
        let aft = moved(&truth, |_, p| Point3::new(-p.x, -p.y, p.z));
        let findings = against(aft, &truth, 3);
        let finding = of_code(&findings, "axes").expect("an error about axes");
        assert_eq!(finding.severity, Severity::Error);
        assert!(
            finding
                .found
                .starts_with("x of the map points aft and y right"),
            "{finding}"
        );
        assert!(finding.advice.contains("(-x, -y, z)"), "{finding}");
    }
}

#[test]
fn axes_of_aircraft_are_named_against_a_recording() {
    let truth = shipped("paper");
    let frd = moved(&truth, |_, p| Point3::new(p.x, -p.y, -p.z));
    let findings = against(frd, &truth, 4);
    let finding = of_code(&findings, "axes").expect("an error about axes");
    assert!(
        finding
            .found
            .starts_with("y of the map points right and z down"),
        "{finding}"
    );
}

#[test]
fn left_and_right_exchanged_are_named_against_a_recording() {
    for name in ["paper", "fin6", "budget_example"] {
        let truth = shipped(name);
        let mirrored = moved(&truth, |_, p| Point3::new(p.x, -p.y, p.z));
        let findings = against(mirrored, &truth, 5);
        let finding = of_code(&findings, "left_right").expect("an error about left and right");
        assert_eq!(finding.severity, Severity::Error);
    }
}

#[test]
fn one_beacon_30_cm_off_is_named_with_its_offset() {
    let truth = shipped("paper");
    let shifts = [
        Vector3::new(0.0, 0.0, 0.3),
        Vector3::new(0.0, -0.3, 0.0),
        Vector3::new(0.0, 0.2, 0.22),
    ];
    for marker in truth.markers() {
        for (seed, shift) in (10..).zip(shifts) {
            let wrong = moved(&truth, |id, place| {
                place
                    + if id == marker.id {
                        shift
                    } else {
                        Vector3::zeros()
                    }
            });
            let situation = of(wrong, &[]);
            let recording = recording(&truth, seed);
            let checked = Checked::new(&situation, Some(&recording), 0.1, Vec::new());
            let finding = of_code(&checked.findings, "misplaced").expect("it is found");
            let name = format!("marker {} is", marker.id);
            assert!(finding.found.starts_with(&name), "{shift:?}: {finding}");
            assert_eq!(finding.severity, Severity::Error);
            let outcome = checked.outcome.expect("with a recording");
            // From the map's place to the true one.
            let error = outcome.offsets[0].shift_m + shift;
            for axis in 0..3 {
                // 18 draws of 3 axes: 4.5 sigmas are exceeded with 4e-4.
                let sigma_m = outcome.offsets[0].sigma_m[axis];
                assert!(error[axis].abs() < 4.5 * sigma_m, "{axis}: {finding}");
            }
        }
    }
}

#[test]
fn exchanged_axes_show_in_the_symmetry_of_the_map() {
    let truth = shipped("paper");
    let lying = moved(&truth, |_, p| Point3::new(p.x, p.z, p.y));
    let (_, findings) = shape::lint(&lying);
    let finding = of_code(&findings, "axes").expect("a warning about axes");
    assert!(
        finding.advice.contains("z and y are exchanged"),
        "{finding}"
    );
    let (shape, findings) = shape::lint(&truth);
    assert_eq!(shape.mirrors[1], Some(vec![(1, 2), (3, 4)]));
    assert!(findings.is_empty(), "{findings:?}");
}

#[test]
fn a_flat_map_is_named() {
    let flat = moved(&shipped("budget_example"), |_, p| {
        Point3::new(p.x, p.y, 0.01 * p.z)
    });
    let (shape, findings) = shape::lint(&flat);
    assert!(shape.spreads[2] < 0.01, "{:?}", shape.spreads);
    assert!(of_code(&findings, "flat").is_some());
}

#[test]
fn causes_add_up_to_the_variance_of_every_point() {
    let options = [
        "--focal-length-sigma",
        "0.003",
        "--principal-point-sigma-px",
        "2",
        "--jitter-px",
        "0.3",
    ];
    let situation = of(shipped("budget_example"), &options);
    let stations = super::along::stations(&situation);
    for view in stations
        .iter()
        .filter_map(|station| station.view.as_ref().ok())
    {
        for point in &view.points {
            for axis in 0..3 {
                let sum: f64 = point
                    .shares
                    .iter()
                    .map(|share| share.variance_m2[axis])
                    .sum();
                let ratio = sum / point.sigma_m[axis].powi(2);
                // Where the estimate is widened for its curvature, the sum is a little less.
                assert!((0.95..1.000_001).contains(&ratio), "{ratio}");
            }
        }
    }
}

#[test]
fn one_more_beacon_lowers_the_level() {
    let situation = of(shipped("budget_example"), &["--to-m", "15"]);
    let more = super::more::best(&situation).expect("some place helps");
    assert!((more.range_m - 15.0).abs() < 1e-9);
    assert!(
        more.new_level_m < more.level_m,
        "{} {}",
        more.new_level_m,
        more.level_m
    );
    assert!(
        (more.survey_m - 0.01).abs() < 1e-12,
        "surveyed as the others"
    );
}

#[test]
fn every_signed_exchange_of_axes_is_tried_once_the_map_as_it_is_first() {
    let all = Hypothesis::all();
    assert_eq!(all.len(), 48);
    assert!(all[0].is_as_given());
    for (index, one) in all.iter().enumerate() {
        assert!(
            (one.true_from_map * one.true_from_map.transpose() - Matrix3::identity()).amax()
                < 1e-15
        );
        assert!(!all[..index].contains(one));
    }
}
