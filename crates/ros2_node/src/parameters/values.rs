//! Parameter values, each checked against its line in the table.

use std::collections::BTreeMap;

use super::check::{check, nearest_name};
use super::spec::ParameterSpec;
use super::{Key, ParameterError, ParameterValue};

/// One checked value for every parameter of a table.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameters {
    table: &'static [ParameterSpec],
    values: BTreeMap<&'static str, ParameterValue>,
}

impl Parameters {
    /// Returns the table's defaults.
    #[must_use]
    pub fn new(table: &'static [ParameterSpec]) -> Self {
        Self {
            table,
            values: table
                .iter()
                .map(|spec| (spec.name, spec.default()))
                .collect(),
        }
    }

    /// Returns the table's line for the parameter with this name.
    #[must_use]
    pub fn spec(&self, name: &str) -> Option<&'static ParameterSpec> {
        self.table.iter().find(|spec| spec.name == name)
    }

    /// Returns the parameter that was perhaps meant: the nearest, if a third of its letters at most differ.
    #[must_use]
    pub fn nearest_name(&self, name: &str) -> Option<&'static str> {
        nearest_name(self.table, name)
    }

    /// Sets a parameter before the node runs.
    ///
    /// # Errors
    /// [`ParameterError`] when the table has no such parameter, or does not allow the value.
    pub fn set(&mut self, name: &str, value: ParameterValue) -> Result<(), ParameterError> {
        let spec = self.known(name)?;
        self.values.insert(spec.name, check(spec, value)?);
        Ok(())
    }

    /// Checks a change of a parameter while the node runs.
    ///
    /// # Errors
    /// As [`Self::set`], and [`ParameterError::ReadOnly`] when another value is given to a parameter
    /// that is fixed by then.
    pub fn check_change(&self, name: &str, value: ParameterValue) -> Result<(), ParameterError> {
        let spec = self.known(name)?;
        let value = check(spec, value)?;
        if spec.read_only && self.values.get(spec.name) != Some(&value) {
            return Err(ParameterError::ReadOnly { name: spec.name });
        }
        Ok(())
    }

    fn known(&self, name: &str) -> Result<&'static ParameterSpec, ParameterError> {
        self.spec(name).ok_or_else(|| ParameterError::Unknown {
            name: name.to_owned(),
            suggestion: self.nearest_name(name),
        })
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

    /// Returns the value of a parameter in its own type.
    ///
    /// # Panics
    /// When the key is that of another table, which is a mistake in the program.
    #[must_use]
    pub fn value<T>(&self, key: &Key<T>) -> T {
        match self.get(key.name()) {
            Some(value) => key.must_read(value),
            None => unreachable_kind(key.name(), None),
        }
    }

    /// Returns the value of a parameter that holds true or false.
    ///
    /// # Panics
    /// When the table has no such parameter of that type, which is a mistake in the program.
    #[must_use]
    pub fn bool(&self, name: &str) -> bool {
        match self.get(name) {
            Some(ParameterValue::Bool(value)) => *value,
            other => unreachable_kind(name, other),
        }
    }

    /// Returns the value of a parameter that holds a number.
    ///
    /// # Panics
    /// When the table has no such parameter of that type, which is a mistake in the program.
    #[must_use]
    pub fn double(&self, name: &str) -> f64 {
        match self.get(name) {
            Some(ParameterValue::Double(value)) => *value,
            other => unreachable_kind(name, other),
        }
    }

    /// Returns the value of a parameter that holds a whole number.
    ///
    /// # Panics
    /// When the table has no such parameter of that type, which is a mistake in the program.
    #[must_use]
    pub fn integer(&self, name: &str) -> i64 {
        match self.get(name) {
            Some(ParameterValue::Integer(value)) => *value,
            other => unreachable_kind(name, other),
        }
    }

    /// Returns the value of a parameter that holds a whole number, 0 for a negative one.
    ///
    /// # Panics
    /// When the table has no such parameter of that type, which is a mistake in the program.
    #[must_use]
    pub fn count(&self, name: &str) -> usize {
        usize::try_from(self.integer(name)).unwrap_or(0)
    }

    /// Returns the value of a parameter that holds text.
    ///
    /// # Panics
    /// When the table has no such parameter of that type, which is a mistake in the program.
    #[must_use]
    pub fn text(&self, name: &str) -> &str {
        match self.get(name) {
            Some(ParameterValue::String(value)) => value,
            other => unreachable_kind(name, other),
        }
    }
}

#[expect(
    clippy::panic,
    reason = "a wrong name is a mistake in the program that has the table, and not in what users give"
)]
fn unreachable_kind(name: &str, found: Option<&ParameterValue>) -> ! {
    panic!("parameter {name:?} is not of the expected type: {found:?}")
}

#[cfg(test)]
mod tests {
    use super::ParameterValue::{Bool, Double, Integer, String};
    use super::*;
    use crate::parameters::sample::SAMPLE;

    fn set(name: &str, value: ParameterValue) -> Result<ParameterValue, ParameterError> {
        let mut parameters = Parameters::new(SAMPLE);
        parameters.set(name, value)?;
        Ok(parameters.get(name).cloned().expect("it was just set"))
    }

    #[test]
    fn every_default_is_allowed_by_its_own_range() {
        for spec in SAMPLE {
            let name = spec.name;
            assert_eq!(set(name, spec.default()), Ok(spec.default()), "{name}");
        }
    }

    #[test]
    fn values_are_read_in_the_type_of_their_parameter() {
        let parameters = Parameters::new(SAMPLE);
        assert!((parameters.double("rate_hz") - 10.0).abs() < f64::EPSILON);
        assert_eq!(parameters.integer("retries"), 1);
        assert_eq!(parameters.count("min_samples"), 5);
        assert_eq!(parameters.text("mode"), "fast");
        assert!(!parameters.bool("filtered"));
    }

    #[test]
    fn whole_number_is_taken_for_a_double_and_not_the_other_way_round() {
        assert_eq!(set("rate_hz", Integer(1)), Ok(Double(1.0)));
        let refused = set("retries", Double(1.0)).expect_err("1.0 is not a count");
        assert_eq!(
            refused.to_string(),
            r#"parameter "retries" takes an integer, got 1.0 (double)"#
        );
    }

    #[test]
    fn bounds_belong_to_the_range_and_values_beyond_are_refused() {
        for (name, value) in [
            ("retries", Integer(0)),
            ("retries", Integer(2)),
            ("rate_hz", Double(0.5)),
            ("rate_hz", Integer(1000)),
        ] {
            assert!(set(name, value).is_ok(), "{name}");
        }
        for (name, value) in [
            ("retries", Integer(3)),
            ("retries", Integer(-1)),
            ("min_samples", Integer(2)),
            ("rate_hz", Double(0.49)),
            ("rate_hz", Integer(1001)),
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
            let refused = set("rate_hz", Double(value));
            assert!(
                matches!(refused, Err(ParameterError::NotFinite { .. })),
                "{refused:?}"
            );
        }
    }

    #[test]
    fn words_and_texts_are_checked() {
        let refused = set("mode", String("magic".into())).expect_err("no such word");
        assert_eq!(
            refused.to_string(),
            r#"parameter "mode" must be one of fast, careful, got "magic""#
        );
        assert!(set("device", String("  ".into())).is_err());
        for frame in ["", "/sensor", "a b"] {
            assert!(set("frame_id", String(frame.into())).is_err(), "{frame:?}");
        }
        assert!(set("filtered", String("yes".into())).is_err());
    }

    #[test]
    fn unknown_parameter_is_named_with_the_one_that_was_meant() {
        let refused = set("rates_hz", Double(1.0)).expect_err("one letter too many");
        assert_eq!(
            refused.to_string(),
            r#"unknown parameter "rates_hz", did you mean "rate_hz"?"#
        );
        let refused = set("exposure_time", Double(1.0)).expect_err("nothing like it");
        assert_eq!(refused.to_string(), r#"unknown parameter "exposure_time""#);
    }

    #[test]
    fn read_only_parameters_keep_their_value_once_the_node_runs() {
        let parameters = Parameters::new(SAMPLE);
        let change = parameters.check_change("device", String("/dev/ttyS1".into()));
        assert_eq!(change, Err(ParameterError::ReadOnly { name: "device" }));
        let same = parameters.check_change("device", String("/dev/ttyS0".into()));
        assert_eq!(same, Ok(()));
        assert_eq!(parameters.check_change("filtered", Bool(true)), Ok(()));
    }
}
