//! The table against itself, and values against each other.

use super::*;

#[test]
fn every_default_is_allowed_by_its_own_range() {
    let mut parameters = Parameters::new(TABLE);
    for spec in TABLE {
        let name = spec.name;
        assert_eq!(parameters.set(name, spec.default()), Ok(()), "{name}");
    }
    assert_eq!(parameters, Parameters::new(TABLE));
}

#[test]
fn bounds_of_some_parameters_are_as_documented() {
    let mut parameters = Parameters::new(TABLE);
    for (name, value) in [
        ("max_outliers", ParameterValue::Integer(2)),
        ("min_points", ParameterValue::Integer(3)),
        ("max_ambiguity", ParameterValue::Integer(0)),
        ("trust_probability", ParameterValue::Double(0.5)),
        ("nominal_yaw_deg", ParameterValue::Double(-180.0)),
    ] {
        assert_eq!(parameters.set(name, value), Ok(()), "{name}");
    }
    for (name, value) in [
        ("max_outliers", ParameterValue::Integer(3)),
        ("min_points", ParameterValue::Integer(2)),
        ("max_ambiguity", ParameterValue::Double(1.01)),
        ("trust_probability", ParameterValue::Integer(1)),
        ("pixel_sigma_px", ParameterValue::Double(0.0)),
        ("nominal_yaw_deg", ParameterValue::Double(180.1)),
    ] {
        let refused = parameters.set(name, value);
        assert!(
            matches!(refused, Err(ParameterError::OutOfRange { .. })),
            "{name}: {refused:?}"
        );
    }
}

#[test]
fn the_track_cannot_be_switched_off_under_an_output_that_needs_it() {
    let mut parameters = Parameters::new(TABLE);
    let mut set = |name, value| {
        parameters.set(name, value).expect("allowed by itself");
        check_together(&parameters)
    };
    assert_eq!(set("track", ParameterValue::Bool(false)), Ok(()));
    let file = ParameterValue::String("a.yaml".into());
    assert_eq!(set("refuelling", file), Ok(()));
    let refused = set("publish_receptacle", ParameterValue::Bool(true)).expect_err("no track");
    let words = "publish_receptacle comes from the track";
    assert!(refused.to_string().contains(words), "{refused}");
    assert_eq!(set("track", ParameterValue::Bool(true)), Ok(()));
}

#[test]
fn a_calibration_has_its_sigmas_from_a_file_or_from_parameters() {
    let mut parameters = Parameters::new(TABLE);
    let mut set = |name, value| {
        parameters.set(name, value).expect("allowed by itself");
        check_together(&parameters)
    };
    let file = ParameterValue::String("c.yaml".into());
    assert_eq!(set("calibration_budget_file", file), Ok(()));
    assert_eq!(set("jitter_px", ParameterValue::Double(0.5)), Ok(()));
    for sigma in [
        "focal_length_sigma",
        "principal_point_sigma_px",
        "k1_sigma",
        "k2_sigma",
    ] {
        let refused = set(sigma, ParameterValue::Double(0.01)).expect_err("both");
        let words = format!("calibration_budget_file and {sigma} both state");
        assert!(refused.to_string().contains(&words), "{refused}");
        assert_eq!(set(sigma, ParameterValue::Double(0.0)), Ok(()));
    }
}

#[test]
fn a_reported_attitude_needs_that_of_the_receiver() {
    let mut parameters = Parameters::new(TABLE);
    let mut set = |name, value| {
        parameters.set(name, value).expect("allowed by itself");
        check_together(&parameters)
    };
    let sigma = ParameterValue::Double(2.0);
    let refused = set("reported_attitude_sigma_deg", sigma).expect_err("no attitude");
    let words = r#"reported_attitude_sigma_deg above 0 needs the parameter "attitude""#;
    assert!(refused.to_string().contains(words), "{refused}");
    for source in ["px4", "imu"] {
        let source = ParameterValue::String(source.into());
        assert_eq!(set("attitude", source), Ok(()));
    }
}

/// The compiler is silent about fields of `Values` that nothing reads: they come from a macro of another crate.
#[test]
fn every_parameter_is_used() {
    let sources = [
        include_str!("attitude.rs"),
        include_str!("configuration.rs"),
        include_str!("consumers.rs"),
    ];
    let used: Vec<&str> = sources
        .iter()
        .map(|source| source.split("#[cfg(test)]").next().unwrap_or_default())
        .flat_map(|code| code.split("values.").skip(1))
        .filter_map(|rest| {
            rest.split(|c: char| !c.is_alphanumeric() && c != '_')
                .next()
        })
        .collect();
    for spec in TABLE {
        assert!(used.contains(&spec.name), "{} is not used", spec.name);
    }
}
