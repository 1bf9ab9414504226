//! Files of a calibration's error budget: the causes that follow, and the errors of invalid ones.

use super::*;

fn camera(model: &str, d: &[f64], binning: u32) -> (CameraInfo, Camera) {
    let info = CameraInfo {
        width: 1280,
        height: 960,
        distortion_model: model.to_owned(),
        d: d.to_vec(),
        k: [900.0, 0.0, 640.0, 0.0, 800.0, 480.0, 0.0, 0.0, 1.0],
        binning_x: binning,
        binning_y: binning,
        ..CameraInfo::default()
    };
    let camera = Camera::from_info(&info, false).expect("a usual lens");
    (info, camera)
}

fn changes(text: &str, model: &str, d: &[f64]) -> Vec<(String, CalibrationChange)> {
    let (info, camera) = camera(model, d, 1);
    let budget = CalibrationBudget::from_yaml(text, "c.yaml").expect("a good file");
    budget.changes(&info, &camera).expect("the same lens")
}

fn refusal(text: &str) -> String {
    let refused = CalibrationBudget::from_yaml(text, "c.yaml");
    refused.expect_err("this file is wrong").to_string()
}

#[test]
fn sigmas_are_one_cause_each_and_those_of_zero_none() {
    let found = changes("sigmas: {fy: 1.6, cx: 2, k3: 0.5, k1: 0}\n", "", &[]);
    let names: Vec<&str> = found.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["fy", "cx", "k3"]);
    for ((_, change), (place, value)) in found.iter().zip([(1, 0.002), (2, 2.0), (8, 0.5)]) {
        let mut expected = CalibrationChange::zeros();
        expected[place] = value;
        assert!((change - expected).norm() < 1e-15, "{change}");
    }
}

#[test]
fn a_covariance_is_that_of_its_causes() {
    let text = "covariance:
  parameters: [fx, k1, cx, fy]
  data:
    - [4, 0.012, 0, 3.9]
    - [0.012, 0.0001, 0, 0.011]
    - [0, 0, 1, 0]
    - [3.9, 0.011, 0, 4]
";
    let found = changes(text, "plumb_bob", &[-0.2, 0.05, 0.0, 0.0, 0.0]);
    let sum = found.iter().fold(
        nalgebra::SMatrix::<f64, 12, 12>::zeros(),
        |sum, (_, change)| sum + change * change.transpose(),
    );
    let places = [(0, 1.0 / 900.0), (4, 1.0), (2, 1.0), (1, 1.0 / 800.0)];
    let rows = [
        [4.0, 0.012, 0.0, 3.9],
        [0.012, 1e-4, 0.0, 0.011],
        [0.0, 0.0, 1.0, 0.0],
        [3.9, 0.011, 0.0, 4.0],
    ];
    for (row, (i, by)) in rows.iter().zip(places) {
        for (value, (j, with)) in row.iter().zip(places) {
            let off = (sum[(i, j)] - value * by * with).abs();
            assert!(off < 1e-12, "{i} {j}: {off}");
        }
    }
    // The principal point, which nothing else goes with, is a cause by itself: jitter joins it.
    let alone = found.iter().find(|(name, _)| name == "cx").expect("there");
    assert_eq!(alone.1.iter().filter(|value| **value != 0.0).count(), 1);
}

#[test]
fn a_singular_covariance_has_fewer_causes() {
    let text = "covariance: {parameters: [fx, fy], data: [[1, 1], [1, 1]]}\n";
    assert_eq!(changes(text, "", &[]).len(), 1);
}

#[test]
fn coefficients_stand_where_the_lens_has_them_and_binned_pixels_are_larger() {
    let found = changes("sigmas: {k3: 0.5}\n", "equidistant", &[0.0; 4]);
    assert!((found[0].1[FIRST_COEFFICIENT + 2] - 0.5).abs() < 1e-15);
    let (info, fisheye) = camera("equidistant", &[0.0; 4], 2);
    let budget = CalibrationBudget::from_yaml("sigmas: {p1: 0.001}\n", "c.yaml");
    let refused = budget.expect("a good file").changes(&info, &fisheye);
    assert_eq!(refused, Err(CameraError::BudgetOfOtherLens { name: "p1" }));
    let budget = CalibrationBudget::from_yaml("sigmas: {cx: 2, fx: 9}\n", "c.yaml");
    let found = budget.expect("a good file").changes(&info, &fisheye);
    let found = found.expect("the same lens");
    let [focal, centre] = [&found[0], &found[1]];
    assert!((focal.1[0] - 0.01).abs() < 1e-15 && (centre.1[2] - 1.0).abs() < 1e-15);
}

#[test]
fn every_slip_is_refused_at_its_line() {
    let of = |parameters: &str, data: &str| {
        format!("covariance:\n  parameters: {parameters}\n  data: {data}\n")
    };
    let slips = [
        (
            "{}\n".to_owned(),
            "c.yaml: expected either sigmas or covariance",
        ),
        (
            format!("sigmas: {{fx: 1}}\n{}", of("[fx]", "[[1]]")),
            "c.yaml: expected either sigmas or covariance",
        ),
        ("sigmas: {f: 1}\n".to_owned(), "unknown key \"f\""),
        (
            "sigmas:\n  fx: -1\n".to_owned(),
            "c.yaml:2:7: the sigma of fx must be 0, or 1e-12 to 100, got -1",
        ),
        (
            "sigmas: {cy: .nan}\n".to_owned(),
            "the sigma of cy must be 0, or 1e-12 to 100, got NaN",
        ),
        (
            of("[fx, f]", "[[1]]"),
            "c.yaml:2:20: expected one of fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6, got \"f\"",
        ),
        (of("[fx, fx]", "[[1]]"), "c.yaml:2:20: fx is listed twice"),
        (
            of("[fx, fy]", "[[1, 0]]"),
            "c.yaml:3:9: data must be 2 rows of 2 numbers, one for each parameter, got 1 rows",
        ),
        (
            of("[fx, fy]", "[[1, 0], [1]]"),
            "c.yaml:3:18: data must be 2 rows of 2 numbers, one for each parameter, got a row of 1",
        ),
        (
            of("[fx, fy]", "[[1, 0], [0, -1]]"),
            "the sigma of fy must be 0, or 1e-12 to 100, got NaN",
        ),
        (
            of("[fx, k1]", "[[1, 0.1], [0.2, 1]]"),
            "data must be symmetric, but has 0.1 for fx with k1 and 0.2 for k1 with fx",
        ),
        (
            of("[fx, k1]", "[[1, 2], [2, 1]]"),
            "c.yaml:3:9: data must be positive semidefinite, but has the eigenvalue -1.000",
        ),
        (
            of("[fx, k1]", "[[1, .nan], [.nan, 1]]"),
            "data must be symmetric",
        ),
        (
            of("[fx, k1]", "[[1, 0.1], [0.1, 0]]"),
            "data must be positive semidefinite",
        ),
    ];
    for (text, expected) in slips {
        let found = refusal(&text);
        assert!(found.contains(expected), "{text}: {found}");
    }
}

#[test]
fn sigmas_whose_squares_vanish_are_refused_and_never_become_nan() {
    for text in [
        "sigmas: {fx: 1.2, fy: 5e-324}\n",
        "covariance: {parameters: [fx, fy], data: [[5e-324, 0], [0, 1]]}\n",
    ] {
        let error = CalibrationBudget::from_yaml(text, "b.yaml").expect_err("no sigma");
        assert!(
            error.to_string().contains("must be 0, or 1e-12 to 100"),
            "{error}"
        );
    }
}
