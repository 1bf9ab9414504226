//! Parameter values, each checked against its line in the table.

use std::collections::BTreeMap;

use super::check::checked;
use super::table::{ParameterSpec, TABLE};
use super::{ParameterError, ParameterValue};

/// One checked value for every parameter of the table.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameters {
    values: BTreeMap<&'static str, ParameterValue>,
}

impl Default for Parameters {
    /// Returns the table's defaults.
    fn default() -> Self {
        Self {
            values: TABLE
                .iter()
                .map(|spec| (spec.name, spec.default()))
                .collect(),
        }
    }
}

impl Parameters {
    /// Sets a parameter before the node runs.
    ///
    /// # Errors
    /// [`ParameterError`] when the table has no such parameter, or does not allow the value.
    pub fn set(&mut self, name: &str, value: ParameterValue) -> Result<(), ParameterError> {
        let (name, value) = checked(name, value)?;
        self.values.insert(name, value);
        Ok(())
    }

    /// Checks a change of a parameter while the node runs.
    ///
    /// # Errors
    /// As [`Self::set`], and [`ParameterError::ReadOnly`] when another value is given to a parameter
    /// that is fixed by then.
    pub fn check_change(&self, name: &str, value: ParameterValue) -> Result<(), ParameterError> {
        let (name, value) = checked(name, value)?;
        let fixed = ParameterSpec::find(name).is_some_and(|spec| spec.read_only);
        if fixed && self.values.get(name) != Some(&value) {
            return Err(ParameterError::ReadOnly { name });
        }
        Ok(())
    }

    /// All parameters in alphabetical order.
    pub fn iter(&self) -> impl Iterator<Item = (&'static str, &ParameterValue)> {
        self.values.iter().map(|(name, value)| (*name, value))
    }

    /// Returns a parameter's value.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<&ParameterValue> {
        self.values.get(name)
    }

    pub(super) fn bool(&self, name: &str) -> bool {
        matches!(self.get(name), Some(ParameterValue::Bool(true)))
    }

    pub(super) fn double(&self, name: &str) -> f64 {
        match self.get(name) {
            Some(ParameterValue::Double(value)) => *value,
            other => unreachable_kind(name, other),
        }
    }

    pub(super) fn integer(&self, name: &str) -> i64 {
        match self.get(name) {
            Some(ParameterValue::Integer(value)) => *value,
            other => unreachable_kind(name, other),
        }
    }

    pub(super) fn count(&self, name: &str) -> usize {
        usize::try_from(self.integer(name)).unwrap_or(0)
    }

    pub(super) fn text(&self, name: &str) -> &str {
        match self.get(name) {
            Some(ParameterValue::String(value)) => value,
            other => unreachable_kind(name, other),
        }
    }
}

/// Every name that this floor asks for is in the table with its type, which a test walks through.
#[expect(
    clippy::panic,
    reason = "a wrong name here is a mistake in this file, found by its test"
)]
fn unreachable_kind(name: &str, found: Option<&ParameterValue>) -> ! {
    panic!("parameter {name:?} is not of the expected type: {found:?}")
}

#[cfg(test)]
mod tests {
    use super::ParameterValue::{Bool, Double, Integer, String};
    use super::*;
    use crate::config::TABLE;

    fn set(name: &str, value: ParameterValue) -> Result<ParameterValue, ParameterError> {
        let mut parameters = Parameters::default();
        parameters.set(name, value)?;
        Ok(parameters.get(name).cloned().expect("it was just set"))
    }

    #[test]
    fn every_default_is_allowed_by_its_own_range() {
        for spec in TABLE {
            assert_eq!(
                set(spec.name, spec.default()),
                Ok(spec.default()),
                "{}",
                spec.name
            );
        }
    }

    #[test]
    fn whole_number_is_taken_for_a_double_and_not_the_other_way_round() {
        assert_eq!(set("pixel_sigma_px", Integer(1)), Ok(Double(1.0)));
        let refused = set("max_outliers", Double(1.0)).expect_err("1.0 is not a count");
        assert_eq!(
            refused.to_string(),
            r#"parameter "max_outliers" takes an integer, got 1.0 (double)"#
        );
    }

    #[test]
    fn bounds_belong_to_the_range_and_values_beyond_are_refused() {
        for (name, value) in [
            ("max_outliers", Integer(2)),
            ("min_points", Integer(3)),
            ("max_ambiguity", Integer(0)),
            ("trust_probability", Double(0.5)),
            ("nominal_yaw_deg", Double(-180.0)),
        ] {
            assert!(set(name, value).is_ok(), "{name}");
        }
        for (name, value) in [
            ("max_outliers", Integer(3)),
            ("max_outliers", Integer(-1)),
            ("min_points", Integer(2)),
            ("max_ambiguity", Double(1.01)),
            ("trust_probability", Integer(1)),
            ("pixel_sigma_px", Double(0.0)),
            ("nominal_yaw_deg", Double(180.1)),
        ] {
            let refused = set(name, value);
            assert!(
                matches!(refused, Err(ParameterError::OutOfRange { .. })),
                "{name}: {refused:?}"
            );
        }
    }

    #[test]
    fn nan_and_infinity_are_refused() {
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let refused = set("pixel_sigma_px", Double(value));
            assert!(
                matches!(refused, Err(ParameterError::NotFinite { .. })),
                "{refused:?}"
            );
        }
    }

    #[test]
    fn words_and_texts_are_checked() {
        let refused = set("initialisation", String("magic".into())).expect_err("no such word");
        assert_eq!(
            refused.to_string(),
            r#"parameter "initialisation" must be one of nominal, dlt, previous, global, got "magic""#
        );
        assert!(set("marker_map", String("  ".into())).is_err());
        for frame in ["", "/tanker", "a b"] {
            assert!(
                set("tanker_frame_id", String(frame.into())).is_err(),
                "{frame:?}"
            );
        }
        assert!(set("rectified", String("yes".into())).is_err());
    }

    #[test]
    fn unknown_parameter_is_named_with_the_one_that_was_meant() {
        let refused = set("pixel_sigma", Double(1.0)).expect_err("the suffix is missing");
        assert_eq!(
            refused.to_string(),
            r#"unknown parameter "pixel_sigma", did you mean "pixel_sigma_px"?"#
        );
        let refused = set("exposure_time", Double(1.0)).expect_err("nothing like it");
        assert_eq!(refused.to_string(), r#"unknown parameter "exposure_time""#);
    }

    #[test]
    fn read_only_parameters_keep_their_value_once_the_node_runs() {
        let parameters = Parameters::default();
        let change = parameters.check_change("marker_map", String("fin6".into()));
        assert_eq!(change, Err(ParameterError::ReadOnly { name: "marker_map" }));
        assert_eq!(
            parameters.check_change("marker_map", String("paper".into())),
            Ok(())
        );
        assert_eq!(parameters.check_change("rectified", Bool(true)), Ok(()));
    }
}
