//! Sections, values and errors of parameter files.

use super::*;

fn parsed(text: &str) -> Result<Vec<Section>, ParameterFileError> {
    parse(text, Path::new("test.yaml"))
}

const FILE: &str = "\
/**:
  ros__parameters: {everywhere: 1}
sensor_driver:
  ros__parameters:
    root_only: 2
/uav1/sensor_driver:
  ros__parameters:
    absolute: 3
uav1:
  sensor_driver:
    ros__parameters:
      nested: 4
/*/sensor_driver:
  ros__parameters:
    one_level: 5
";

#[test]
fn sections_have_absolute_names_and_names_nest_as_namespaces() {
    let found = parsed(FILE).expect("the text is a parameter file");
    let patterns: Vec<&str> = found.iter().map(|section| &*section.pattern).collect();
    assert_eq!(
        patterns,
        [
            "/**",
            "/sensor_driver",
            "/uav1/sensor_driver",
            "/uav1/sensor_driver",
            "/*/sensor_driver"
        ]
    );
    assert!(!found[0].names_one_node() && found[1].names_one_node());
}

#[test]
fn empty_files_and_sections_say_nothing() {
    assert_eq!(parsed("").expect("valid"), []);
    assert_eq!(parsed("sensor_driver:\n").expect("valid"), []);
    let found = parsed("sensor_driver:\n  ros__parameters:\n").expect("valid");
    assert_eq!(found[0].parameters, []);
}

#[test]
fn values_without_names_are_found_when_their_section_is_checked() {
    for values in ["[a, 1]", "3", "{'': 1}"] {
        let found = parsed(&format!("n:\n  ros__parameters: {values}\n")).expect("YAML");
        let error = found[0].check(Path::new("p.yaml")).expect_err(values);
        assert_eq!(
            error.to_string(),
            "parameter file \"p.yaml\", line 2: expected names with values under ros__parameters of \"/n\""
        );
    }
}

#[test]
fn a_section_that_no_node_can_have_is_refused_and_not_passed_over() {
    let text = |name| format!("{name}:\n  ros__parameters:\n    a: 1\n");
    for name in ["sensor_*", "/n/", "//n", "n m", "1n", "n.m"] {
        let error = parsed(&text(name)).expect_err(name);
        assert!(error.to_string().contains("is no node's name"), "{error}");
    }
    assert!(parsed("/a: {/n: {ros__parameters: {a: 1}}}").is_err());
    let error = parsed("ros__parameters: {a: 1}\n").expect_err("no name");
    assert!(error.to_string().contains("above it"), "{error}");
}

#[test]
fn other_nodes_sections_may_hold_anything() {
    let text = "other:\n  ros__parameters:\n    a: !mine [1, x, {b: 2}]\n    a: 2\n    ? [k]\n    : &x 1\n    c: *x\n";
    assert_eq!(parsed(text).expect("it is YAML")[0].pattern, "/other");
}

#[test]
fn a_second_document_is_refused_in_a_users_words() {
    let error = parsed(&format!("{FILE}---\n{FILE}")).expect_err("two");
    assert!(
        error
            .to_string()
            .ends_with("expected one document, got a second one after `---`"),
        "{error}"
    );
}

#[test]
fn nesting_has_a_limit() {
    let deep = "{a: ".repeat(100_000);
    assert!(parsed(&deep).is_err());
    assert!(parsed(&"[".repeat(100_000)).is_err());
}

#[test]
fn values_keep_their_types_and_lines_and_nested_keys_are_joined() {
    let text = "\
/**:
  ros__parameters:
    a: 1
    b: 1.0
    c: true
    d: '1'
    e: paper
    f:
      g: 1.0e-3
    h: [1, 2]
";
    let found = parsed(text).expect("valid").remove(0).parameters;
    let expected = [
        ("a", Some(ParameterValue::Integer(1)), 3),
        ("b", Some(ParameterValue::Double(1.0)), 4),
        ("c", Some(ParameterValue::Bool(true)), 5),
        ("d", Some(ParameterValue::String("1".into())), 6),
        ("e", Some(ParameterValue::String("paper".into())), 7),
        ("f.g", Some(ParameterValue::Double(1e-3)), 9),
        ("h", None, 10),
    ]
    .map(|(name, value, line)| FileParameter {
        name: name.to_owned(),
        value,
        line,
    });
    assert_eq!(found, expected);
}

#[test]
fn quotes_and_the_tag_of_text_make_text_and_blocks_do_not() {
    for (word, value) in [
        ("|-\n    3", Some(ParameterValue::Integer(3))),
        (">-\n    yes", Some(ParameterValue::Bool(true))),
        ("|\n    3", Some(ParameterValue::String("3\n".into()))),
        ("!!str 3", Some(ParameterValue::String("3".into()))),
        (
            "!<tag:yaml.org,2002:str> 3",
            Some(ParameterValue::String("3".into())),
        ),
        ("!str 3", Some(ParameterValue::Integer(3))),
        ("!!int 3.5", Some(ParameterValue::Double(3.5))),
        ("!!str", None),
        ("{}", None),
        ("[]", None),
    ] {
        let found = parsed(&format!(
            "n: {{ros__parameters: }}\nm:\n ros__parameters:\n  a: {word}\n"
        ));
        let found = found.expect(word).remove(1).parameters;
        assert_eq!(found[0].value, value, "{word}");
    }
}

#[test]
fn what_is_no_parameter_file_is_refused() {
    for text in [
        "a: 1",
        "- a",
        "just text",
        "/**:\n  ros__parameters: {a: 1",
        "a:\n b: 1\n  c: 2",
    ] {
        assert!(parsed(text).is_err(), "{text:?}");
    }
    let missing = read(Path::new("/nonexistent/p.yaml")).expect_err("there is none");
    assert!(
        missing.to_string().contains("/nonexistent/p.yaml"),
        "{missing}"
    );
}

#[test]
fn names_that_a_long_one_multiplies_are_refused_with_their_line() {
    // As long as YAML allows a key.
    let long = "a".repeat(1000);
    let names = |count: usize| {
        let mut text = format!("node:\n  ros__parameters:\n    {long}:\n");
        for number in 0..count {
            let line = format!("      b{number}: 1\n");
            text.push_str(&line);
        }
        text
    };
    assert_eq!(parsed(&names(15)).expect("few")[0].parameters.len(), 15);
    let error = parsed(&names(20_000)).expect_err("twenty megabytes of names");
    assert!(
        matches!(error, ParameterFileError::LongNames { line: 16_675, .. }),
        "{error}"
    );
}
