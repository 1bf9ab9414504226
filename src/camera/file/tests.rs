//! Calibration files: what is read, assumed and refused.

use super::*;

const PAPER: &str = include_str!("../../../config/cameras/paper.yaml");

/// The shipped file without its comments, so that lines are counted from `image_width`, with one line replaced.
fn with(line: &str, replacement: &str) -> String {
    let lines: Vec<&str> = PAPER
        .lines()
        .filter(|line| !line.starts_with('#'))
        .collect();
    let text = lines.join("\n") + "\n";
    assert!(text.contains(line), "{line}");
    text.replacen(line, replacement, 1)
}

fn refusal(line: &str, replacement: &str) -> String {
    CameraInfo::from_yaml(&with(line, replacement), "c.yaml")
        .expect_err("this file is wrong")
        .to_string()
}

#[test]
fn the_papers_camera_is_read_as_it_stands() {
    let (info, warnings) = CameraInfo::from_yaml(PAPER, "paper.yaml").expect("a good file");
    let expected = CameraInfo {
        height: 412,
        width: 508,
        distortion_model: "plumb_bob".to_owned(),
        d: vec![0.0; 5],
        k: [571.0, 0.0, 254.0, 0.0, 571.0, 206.0, 0.0, 0.0, 1.0],
        r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        p: [
            571.0, 0.0, 254.0, 0.0, 0.0, 571.0, 206.0, 0.0, 0.0, 0.0, 1.0, 0.0,
        ],
        ..CameraInfo::default()
    };
    assert_eq!((info, warnings), (expected, Vec::new()));
}

#[test]
fn matrices_of_another_size_are_refused_at_their_line() {
    assert_eq!(
        refusal("camera_matrix:\n  rows: 3", "camera_matrix:\n  rows: 2"),
        "c.yaml:5:9: camera_matrix must have 3 x 3 entries, but is declared as 2 x 3"
    );
    assert_eq!(
        refusal("cols: 4", "cols: 3"),
        "c.yaml:19:9: projection_matrix must have 3 x 4 entries, but is declared as 3 x 3"
    );
    assert_eq!(
        refusal(
            "[571.0, 0.0, 254.0, 0.0, 571.0, 206.0, 0.0, 0.0, 1.0]",
            "[571.0, 0.0, 254.0]"
        ),
        "c.yaml:7:9: data of camera_matrix must hold 9 numbers, got 3"
    );
    assert_eq!(
        refusal("cols: 5", "cols: 4"),
        "c.yaml:12:9: data of distortion_coefficients must hold 4 numbers, got 5"
    );
    assert_eq!(
        refusal("rows: 1", "rows: 2"),
        "c.yaml:12:9: data of distortion_coefficients must hold 10 numbers, got 5"
    );
}

#[test]
fn entries_that_are_not_finite_are_refused_at_their_place() {
    assert_eq!(
        refusal(
            "[571.0, 0.0, 254.0, 0.0, 571.0",
            "[571.0, 0.0, .nan, 0.0, 571.0"
        ),
        "c.yaml:7:22: data[2] of camera_matrix must be finite, got NaN"
    );
}

#[test]
fn another_shape_is_refused_at_its_line() {
    let slips = [
        ("image_width: 508", "image_width: -508", 1),
        ("image_width: 508", "image_width: 508.5", 1),
        ("image_width: 508", "image_width: 508\nimage_width: 508", 2),
        ("  rows: 1\n", "", 11),
    ];
    for (line, replacement, at) in slips {
        let error = refusal(line, replacement);
        assert!(
            error.starts_with(&format!("c.yaml:{at}:")),
            "{replacement}: {error}"
        );
    }
}

#[test]
fn the_name_may_be_left_out_and_the_size_may_not() {
    assert!(CameraInfo::from_yaml(&with("camera_name: paper\n", ""), "c.yaml").is_ok());
    assert!(refusal("image_width: 508\n", "").contains("image_width"));
    assert!(refusal("image_height: 412", "image_heigth: 412").contains("image_height"));
}

#[test]
fn what_ros_itself_assumes_or_passes_over_is_read_with_a_warning() {
    let read = |text: &str| {
        let (info, warnings) = CameraInfo::from_yaml(text, "c.yaml").expect("ROS reads it");
        let words: Vec<String> = warnings.iter().map(ToString::to_string).collect();
        (info, words.join("; "))
    };
    let (info, warnings) = read(&with("distortion_model: plumb_bob\n", ""));
    assert_eq!(info.distortion_model, "plumb_bob");
    assert_eq!(warnings, "c.yaml: no distortion_model, plumb_bob assumed");
    let (_, warnings) = read(&with(
        "camera_name: paper",
        "camera_name: paper\nfov: 2\nage: 3",
    ));
    assert_eq!(
        warnings,
        "c.yaml: keys not in the format are ignored: \"age\", \"fov\""
    );
}

#[test]
fn coefficients_may_stand_in_a_column() {
    let column = with("rows: 1\n  cols: 5", "rows: 5\n  cols: 1");
    let (info, _) = CameraInfo::from_yaml(&column, "c.yaml").expect("ROS reads it");
    assert_eq!(info.d, [0.0; 5]);
}

#[test]
fn binning_and_region_are_read() {
    let region = "binning_x: 2\nbinning_y: 4\nroi:\n  x_offset: 8\n  y_offset: 4\n  height: 200\n  width: 300\n  \
                  do_rectify: true\n";
    let (info, warnings) =
        CameraInfo::from_yaml(&format!("{PAPER}{region}"), "c.yaml").expect("ROS writes it");
    assert_eq!((info.binning_x, info.binning_y), (2, 4));
    let roi = info.roi;
    assert_eq!(
        (
            roi.x_offset,
            roi.y_offset,
            roi.width,
            roi.height,
            roi.do_rectify
        ),
        (8, 4, 300, 200, true)
    );
    assert_eq!(warnings, []);
}

#[test]
fn opencvs_directive_is_skipped_and_two_cameras_in_a_file_are_refused_in_a_users_words() {
    let opencv = format!("%YAML:1.0\n{PAPER}");
    assert!(CameraInfo::from_yaml(&opencv, "c.yaml").is_ok());
    assert!(CameraInfo::from_yaml(&format!("%YAML:1.0\n---\n{PAPER}"), "c.yaml").is_ok());
    let two = format!("{PAPER}---\n{PAPER}");
    let error = CameraInfo::from_yaml(&two, "c.yaml").expect_err("which camera?");
    assert!(
        error
            .to_string()
            .ends_with(": expected one document, got a second one after `---`"),
        "{error}"
    );
}
