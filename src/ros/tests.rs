//! The node's parameters at the start, against the shipped file.

use std::path::{Path, PathBuf};

use super::arguments::Arguments;
use super::node::effective_parameters;
use super::parameter_file;
use crate::config::{ParameterValue, TABLE};

fn arguments(arguments: &[&str]) -> Arguments {
    let all: Vec<String> = ["--ros-args"]
        .iter()
        .chain(arguments)
        .map(|&text| text.to_owned())
        .collect();
    Arguments::split(&all)
        .expect("the test's arguments are well formed")
        .0
}

fn shipped_file() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("config/tanker_pose.yaml")
}

#[test]
fn shipped_parameter_file_lists_the_table_and_its_defaults() {
    let sections = parameter_file::read(&shipped_file()).expect("the shipped file is valid");
    assert_eq!(sections[0].pattern, "/**");
    let section = &sections[0].parameters;
    let mut listed: Vec<&str> = section.iter().map(|p| p.name.as_str()).collect();
    listed.sort_unstable();
    let mut table: Vec<&str> = TABLE.iter().map(|spec| spec.name).collect();
    table.sort_unstable();
    assert_eq!(listed, table);
    for parameter in section {
        let spec = TABLE
            .iter()
            .find(|spec| spec.name == parameter.name)
            .expect("just compared");
        assert_eq!(parameter.value, Some(spec.default()), "{}", parameter.name);
    }
}

#[test]
fn arguments_override_files_and_files_override_defaults() {
    let path = shipped_file();
    let path = path.to_str().expect("the path is text");
    let given = arguments(&[
        "-r",
        "__ns:=/uav1",
        "-p",
        "max_outliers:=1",
        "--params-file",
        path,
        "-p",
        "pixel_sigma_px:=1",
    ]);
    let (names, start) = effective_parameters(&given).expect("valid");
    assert_eq!(names.fully_qualified(), "/uav1/tanker_pose");
    let found = start.parameters;
    assert_eq!(found.get("max_outliers"), Some(&ParameterValue::Integer(1)));
    assert_eq!(
        found.get("pixel_sigma_px"),
        Some(&ParameterValue::Double(1.0))
    );
    assert_eq!(found.get("min_points"), Some(&ParameterValue::Integer(5)));
}
