//! Configuration files: what is accepted keeps its promises, and reads the same when it is written again.

use std::fmt::Write as _;
use std::path::Path;

use nalgebra::{Matrix3, Vector3};
use ros2_node::arguments::{Arguments, ParameterSource};
use ros2_node::parameter_file::{self, FileParameter, Section};
use ros2_node::parameters::ParameterValue;
use tanker_pose::answering::start::effective_parameters;
use tanker_pose::camera::{CalibrationBudget, Camera, CameraInfo};
use tanker_pose::config::{self, Configuration};
use tanker_pose::frames::flu_from_optical;
use tanker_pose::refuelling::RefuellingSetup;
use tanker_pose::target::MarkerMap;

use super::messages::{paper_camera, seen_by};
use super::{promises, scratch};

/// The text of an input that is some; an error of the source "f.yaml" is one line that names it.
fn text(bytes: &[u8]) -> Option<&str> {
    std::str::from_utf8(bytes).ok()
}

/// An error names its file, in one line that is not the file again.
fn told<E: std::fmt::Display>(error: &E) {
    let words = error.to_string();
    assert!(words.contains("f.yaml"), "{words}");
    assert!(!words.contains(char::is_control), "{words:?}");
    assert!(words.len() < 4096, "{} bytes: {words}", words.len());
}

/// Returns a word in YAML's double quotes.
pub fn quoted(word: &str) -> String {
    let mut quoted = String::from("\"");
    for letter in word.chars() {
        if letter.is_ascii_alphanumeric() || " _-./".contains(letter) {
            quoted.push(letter);
        } else {
            let _ = write!(quoted, "\\U{:08x}", u32::from(letter));
        }
    }
    quoted + "\""
}

/// A section of a parameter file, and how values compare: NaN is itself.
pub fn same(a: Option<&ParameterValue>, b: Option<&ParameterValue>) -> bool {
    match (a, b) {
        (Some(ParameterValue::Double(a)), Some(ParameterValue::Double(b))) => {
            a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan())
        }
        (a, b) => a == b,
    }
}

/// Returns a value as parameter files have it.
pub fn scalar(value: Option<&ParameterValue>) -> String {
    match value {
        None => "[]".to_owned(),
        Some(ParameterValue::Bool(value)) => value.to_string(),
        Some(ParameterValue::Integer(value)) => value.to_string(),
        Some(ParameterValue::Double(value)) if value.is_nan() => ".nan".to_owned(),
        Some(ParameterValue::Double(value)) if value.is_infinite() => {
            let sign = if *value < 0.0 { "-" } else { "" };
            format!("{sign}.inf")
        }
        Some(ParameterValue::Double(value)) => format!("{value:?}"),
        Some(ParameterValue::String(word)) => quoted(word),
    }
}

/// A file of parameters, read alone and for this node.
pub fn parameter_file(bytes: &[u8]) {
    let Some(text) = text(bytes) else { return };
    let sections = match parameter_file::parse(text, Path::new("f.yaml")) {
        Ok(sections) => sections,
        Err(error) => return told(&error),
    };
    let mut written = String::new();
    for section in &sections {
        assert!(section.pattern.starts_with('/'));
        let _ = writeln!(written, "{}:\n  ros__parameters:", quoted(&section.written));
        for FileParameter { name, value, .. } in &section.parameters {
            let _ = writeln!(written, "    {}: {}", quoted(name), scalar(value.as_ref()));
        }
    }
    let again = parameter_file::parse(&written, Path::new("f.yaml")).expect("a parameter file");
    assert_eq!(again.len(), sections.len(), "{written}");
    for (a, b) in sections.iter().zip(&again) {
        same_section(a, b, &written);
    }
    start(bytes);
}

fn same_section(a: &Section, b: &Section, written: &str) {
    assert_eq!(
        (&a.pattern, a.parameters.len()),
        (&b.pattern, b.parameters.len()),
        "{written}"
    );
    for (a, b) in a.parameters.iter().zip(&b.parameters) {
        assert_eq!(a.name, b.name, "{written}");
        assert!(same(a.value.as_ref(), b.value.as_ref()), "{a:?} {b:?}");
    }
}

/// Starts a node with these parameters; a frame is answered.
fn start(bytes: &[u8]) {
    let arguments = Arguments {
        parameters: vec![ParameterSource::File(scratch::file("f.yaml", bytes))],
        ..Arguments::default()
    };
    let start = match effective_parameters(&arguments) {
        Ok((_, start)) => start,
        Err(error) => return told(&error),
    };
    if config::check_together(&start.parameters).is_ok() {
        let settings = Configuration::from(&start.parameters).settings;
        seen_by(&paper_camera(), settings);
    }
}

/// A marker map.
pub fn marker_map(bytes: &[u8]) {
    let Some(text) = text(bytes) else { return };
    let map = match MarkerMap::from_yaml(text, "f.yaml") {
        Ok(map) => map,
        Err(error) => return told(&error),
    };
    promises::map(&map);
    let same = MarkerMap::new(map.name(), map.markers()).expect("checked markers");
    assert_eq!(same.markers(), map.markers());
    // The corners of tags have ids and sigmas that single markers may not have.
    let has_tags = map
        .markers()
        .iter()
        .any(|marker| map.tag_of_corner(marker.id).is_some());
    if !has_tags {
        let written = written_map(&map);
        let again = MarkerMap::from_yaml(&written, "f.yaml");
        assert_eq!(again.as_ref(), Ok(&map), "{written}");
    }
}

fn written_map(map: &MarkerMap) -> String {
    let mut written = format!("name: {}\nmarkers:\n", quoted(map.name()));
    let budget = map.budget();
    for marker in map.markers() {
        let p = marker.marker_in_tanker;
        let _ = write!(
            written,
            "- {{id: {}, x: {:?}, y: {:?}, z: {:?}",
            marker.id, p.x, p.y, p.z
        );
        let of_survey = budget
            .survey_sigma_m
            .iter()
            .find(|(id, _)| *id == marker.id);
        if let Some((_, sigma_m)) = of_survey {
            let _ = write!(written, ", sigma: {sigma_m:?}");
        }
        let _ = writeln!(written, "}}");
    }
    let heading = if budget.flex.is_empty() {
        ""
    } else {
        "flex:\n"
    };
    written.push_str(heading);
    for flex in &budget.flex {
        let (name, sigma) = (quoted(&flex.name), flex.sigma_m);
        let _ = writeln!(written, "- name: {name}\n  sigma: {sigma:?}");
        if let Some(time_s) = flex.time_constant_s {
            let _ = writeln!(written, "  time_constant_s: {time_s:?}");
        }
        let _ = writeln!(written, "  shape:");
        for (id, s) in &flex.shape {
            let _ = writeln!(
                written,
                "  - {{id: {id}, x: {:?}, y: {:?}, z: {:?}}}",
                s.x, s.y, s.z
            );
        }
    }
    let heading = if map.points().is_empty() {
        ""
    } else {
        "points:\n"
    };
    written.push_str(heading);
    for point in map.points() {
        let (name, p) = (quoted(&point.name), point.point_in_tanker);
        let _ = writeln!(
            written,
            "- {{name: {name}, x: {:?}, y: {:?}, z: {:?}}}",
            p.x, p.y, p.z
        );
    }
    written
}

/// A calibration file.
pub fn camera_file(bytes: &[u8]) {
    let Some(text) = text(bytes) else { return };
    let (info, warnings) = match CameraInfo::from_yaml(text, "f.yaml") {
        Ok(read) => read,
        Err(error) => return told(&error),
    };
    warnings.iter().for_each(told);
    promises::camera(&info);
    let written = written_camera(&info);
    let (again, warnings) = CameraInfo::from_yaml(&written, "f.yaml").expect("a camera file");
    assert_eq!(again, info, "{written}");
    assert!(warnings.is_empty(), "{written}");
}

fn written_camera(info: &CameraInfo) -> String {
    let matrix = |name: &str, rows: usize, columns: usize, data: &[f64]| {
        format!("{name}: {{rows: {rows}, cols: {columns}, data: {data:?}}}\n")
    };
    let roi = &info.roi;
    [
        format!(
            "image_width: {}\nimage_height: {}\n",
            info.width, info.height
        ),
        format!("distortion_model: {}\n", quoted(&info.distortion_model)),
        matrix("distortion_coefficients", 1, info.d.len(), &info.d),
        matrix("camera_matrix", 3, 3, &info.k),
        matrix("rectification_matrix", 3, 3, &info.r),
        matrix("projection_matrix", 3, 4, &info.p),
        format!(
            "binning_x: {}\nbinning_y: {}\n",
            info.binning_x, info.binning_y
        ),
        format!(
            "roi: {{x_offset: {}, y_offset: {}, height: {}, width: {}, do_rectify: {}}}\n",
            roi.x_offset, roi.y_offset, roi.height, roi.width, roi.do_rectify
        ),
    ]
    .concat()
}

/// What a calibration may have wrong.
pub fn calibration_budget(bytes: &[u8]) {
    let Some(text) = text(bytes) else { return };
    let budget = match CalibrationBudget::from_yaml(text, "f.yaml") {
        Ok(budget) => budget,
        Err(error) => return told(&error),
    };
    assert!(!budget.in_words().contains(char::is_control));
    let info = paper_camera();
    let camera = Camera::from_info(&info, false).expect("the paper's camera");
    let Ok(changes) = budget.changes(&info, &camera) else {
        return;
    };
    for (name, change) in changes {
        assert!(!name.is_empty());
        assert!(
            change.iter().all(|value| value.is_finite()),
            "{name}: {change}"
        );
    }
}

/// The geometry of refuelling and its envelope.
pub fn refuelling_setup(bytes: &[u8]) {
    let Some(text) = text(bytes) else { return };
    let setup = match RefuellingSetup::from_yaml(text, "f.yaml") {
        Ok(setup) => setup,
        Err(error) => return told(&error),
    };
    assert_eq!(setup.geometry(&flu_from_optical()).check(), Ok(()));
    if let Some(limits_m) = setup.alert_limit_m {
        assert!(
            limits_m
                .iter()
                .all(|limit_m| limit_m.is_finite() && *limit_m > 0.0)
        );
    }
    for (ahead_m, sigma_m) in [(0.0, 1e-3), (0.2, 0.1), (10.0, 3.0)] {
        let covariance = Matrix3::identity() * (sigma_m * sigma_m);
        let found = setup
            .envelope
            .assess(&Vector3::new(ahead_m, 0.1, -0.1), &covariance);
        let all = [found.outside, found.pre_contact, found.contact];
        assert!(
            all.iter().all(|share| (0.0..=1.0).contains(share)),
            "{all:?}"
        );
        assert!((all.iter().sum::<f64>() - 1.0).abs() < 1e-6, "{all:?}");
    }
}
