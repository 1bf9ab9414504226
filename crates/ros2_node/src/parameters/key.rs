//! Typed keys, by which a program reads its parameters.

use super::check::check;
use super::spec::{Kind, ParameterSpec};
use super::{ParameterError, ParameterValue};

/// A parameter's declaration, with the type in which its value is read.
///
/// [`declare_parameters!`](crate::declare_parameters) makes them: a declaration is one of the functions of this module,
/// such as [`double`], and what its name and doc comment add.
#[derive(Debug)]
pub struct Key<T> {
    spec: ParameterSpec,
    /// The value in its type; `None` for one that the declaration does not allow.
    pub(super) read: fn(&ParameterValue) -> Option<T>,
}

// Derived ones would ask the same of `T`.
impl<T> Clone for Key<T> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<T> Copy for Key<T> {}

/// An enum whose values have names; see [`words!`](crate::words).
pub trait Words: Copy + 'static {
    /// All names; the first is the default.
    const WORDS: &'static [&'static str];
    /// What each of them means, in the same order.
    const VALUES: &'static [Self];

    /// Returns the value with this name.
    #[must_use]
    fn from_word(word: &str) -> Option<Self> {
        let at = Self::WORDS.iter().position(|known| *known == word)?;
        Self::VALUES.get(at).copied()
    }
}

/// Gives the values of an enum their names, the default first; the type is then one for [`one_of`](crate::parameters::one_of).
///
/// ```
/// #[derive(Clone, Copy, PartialEq, Debug)]
/// enum Mode { Fast, Careful }
///
/// ros2_node::words! { Mode: "fast" => Mode::Fast, "careful" => Mode::Careful }
///
/// use ros2_node::parameters::Words;
/// assert_eq!(Mode::from_word("careful"), Some(Mode::Careful));
/// assert_eq!(Mode::from_word("reckless"), None);
/// ```
#[macro_export]
macro_rules! words {
    ($type:ty: $($word:literal => $value:expr),+ $(,)?) => {
        impl $crate::parameters::Words for $type {
            const WORDS: &'static [&'static str] = &[$($word),+];
            const VALUES: &'static [Self] = &[$($value),+];
        }
    };
}

/// Returns the declaration of a switch.
#[must_use]
pub const fn switch(default: bool) -> Key<bool> {
    Key::of(Kind::Bool { default }, |value| match value {
        ParameterValue::Bool(value) => Some(*value),
        _ => None,
    })
}

/// Returns the declaration of a whole number within these bounds.
#[must_use]
pub const fn integer(default: i64, [min, max]: [i64; 2]) -> Key<i64> {
    Key::of(Kind::Integer { default, min, max }, |value| match value {
        ParameterValue::Integer(value) => Some(*value),
        _ => None,
    })
}

/// Returns the declaration of how many there are of something, within these bounds.
#[must_use]
pub const fn count<T: From<u16>>(default: u16, [min, max]: [u16; 2]) -> Key<T> {
    let kind = Kind::Integer {
        default: default as i64,
        min: min as i64,
        max: max as i64,
    };
    Key::of(kind, |value| match value {
        ParameterValue::Integer(value) => u16::try_from(*value).ok().map(T::from),
        _ => None,
    })
}

/// Returns the declaration of a finite number within these bounds.
#[must_use]
pub const fn double(default: f64, [min, max]: [f64; 2]) -> Key<f64> {
    Key::of(Kind::Double { default, min, max }, |value| match value {
        ParameterValue::Double(value) => Some(*value),
        _ => None,
    })
}

/// Returns the declaration of one of an enum's names; the first is the default.
#[must_use]
pub const fn one_of<T: Words>() -> Key<T> {
    let kind = Kind::Choice {
        default: T::WORDS[0],
        allowed: T::WORDS,
    };
    Key::of(kind, |value| match value {
        ParameterValue::String(word) => T::from_word(word),
        _ => None,
    })
}

/// Returns the declaration of a text.
#[must_use]
pub const fn text(default: &'static str) -> Key<String> {
    Key::of(Kind::Text { default }, |value| match value {
        ParameterValue::String(text) => Some(text.clone()),
        _ => None,
    })
}

/// What stands for nothing, where a text is optional.
const NONE: &str = "none";

/// Returns the declaration of a text that is `none` unless there is one.
#[must_use]
pub const fn optional_text() -> Key<Option<String>> {
    Key::of(Kind::Text { default: NONE }, |value| match value {
        ParameterValue::String(text) => Some((text != NONE).then(|| text.clone())),
        _ => None,
    })
}

/// Returns the declaration of the name of a tf2 frame.
#[must_use]
pub const fn frame_id(default: &'static str) -> Key<String> {
    Key::of(Kind::FrameId { default }, |value| match value {
        ParameterValue::String(text) => Some(text.clone()),
        _ => None,
    })
}

impl<T> Key<T> {
    const fn of(kind: Kind, read: fn(&ParameterValue) -> Option<T>) -> Self {
        let spec = ParameterSpec {
            name: "",
            kind,
            unit: "",
            read_only: false,
            description: "",
        };
        Self { spec, read }
    }

    /// Returns this declaration with a unit.
    #[must_use]
    pub const fn unit(mut self, unit: &'static str) -> Self {
        self.spec.unit = unit;
        self
    }

    /// Returns this declaration, fixed once the node runs.
    #[must_use]
    pub const fn fixed(mut self) -> Self {
        self.spec.read_only = true;
        self
    }

    /// Returns this declaration under a name, with what it does.
    #[must_use]
    pub const fn named(mut self, name: &'static str, description: &'static str) -> Self {
        self.spec.name = name;
        self.spec.description = description.trim_ascii();
        self
    }

    /// Returns the line of the table.
    #[must_use]
    pub const fn spec(&self) -> ParameterSpec {
        self.spec
    }

    /// Returns the parameter's name.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        self.spec.name
    }

    /// Returns a value in the parameter's type.
    ///
    /// # Errors
    /// [`ParameterError`] when the declaration does not allow it.
    pub fn check(&self, value: ParameterValue) -> Result<T, ParameterError> {
        let value = check(&self.spec, value)?;
        Ok(self.must_read(&value))
    }

    /// Returns the value that holds unless another is set.
    #[must_use]
    pub fn default(&self) -> T {
        self.must_read(&self.spec.default())
    }

    #[expect(
        clippy::panic,
        reason = "the functions above read whatever their own kind allows; tests of a table read all defaults"
    )]
    pub(super) fn must_read(&self, value: &ParameterValue) -> T {
        (self.read)(value)
            .unwrap_or_else(|| panic!("parameter {:?} cannot be read from {value}", self.spec.name))
    }
}

/// Declares a node's parameters, each once: name, type, default, range, unit, whether it is fixed, and words.
///
/// A doc comment is the description that tools show. From the declarations come
///
/// - `TABLE`, what [`Parameters`](crate::parameters::Parameters) are checked against,
/// - `SECTIONS`, the same for [files and pages](crate::parameters::Section),
/// - `KEYS`, with a typed [`Key`](crate::parameters::Key) for each parameter,
/// - `Values`, with a typed field for each: made of the checked parameters with `Values::from`.
///
/// ```
/// use ros2_node::parameters::{ParameterValue, Parameters, double, text};
///
/// ros2_node::declare_parameters! {
///     "Measurements" {
///         /// how often it measures
///         rate_hz: f64 = double(10.0, [0.1, 100.0]).unit("Hz");
///         /// where it is connected
///         device: String = text("/dev/ttyS0").fixed();
///     }
/// }
///
/// let mut parameters = Parameters::new(TABLE);
/// parameters.set("rate_hz", ParameterValue::Integer(20)).expect("20 is allowed");
/// let values = Values::from(&parameters);
/// assert_eq!((values.rate_hz, values.device.as_str()), (20.0, "/dev/ttyS0"));
/// assert_eq!(KEYS.rate_hz.default(), 10.0);
///
/// let refused = parameters.set(KEYS.rate_hz.name(), ParameterValue::Double(0.0)).unwrap_err();
/// assert_eq!(refused.to_string(), r#"parameter "rate_hz" must be from 0.1 to 100.0, got 0.0"#);
/// ```
#[macro_export]
macro_rules! declare_parameters {
    ($(
        $section:literal {
            $( $(#[doc = $description:literal])+ $name:ident: $type:ty = $declaration:expr; )+
        }
    )+) => {
        /// A typed key for each parameter.
        #[derive(Debug)]
        pub struct Keys {
            $($( $(#[doc = $description])+ pub $name: $crate::parameters::Key<$type>, )+)+
        }

        /// The typed keys.
        pub const KEYS: Keys = Keys {
            $($( $name: $declaration.named(stringify!($name), concat!($($description),+)), )+)+
        };

        /// All parameters.
        pub const TABLE: &[$crate::parameters::ParameterSpec] = &[$($( KEYS.$name.spec(), )+)+];

        /// All parameters, in sections.
        pub const SECTIONS: &[$crate::parameters::Section] = &[$(
            $crate::parameters::Section {
                title: $section,
                parameters: &[$( KEYS.$name.spec(), )+],
            },
        )+];

        /// The value of each parameter.
        #[derive(Debug, Clone, PartialEq)]
        #[allow(
            clippy::struct_excessive_bools,
            reason = "parameters are independent switches, and this table may have few"
        )]
        pub(crate) struct Values {
            $($( $(#[doc = $description])+ pub(crate) $name: $type, )+)+
        }

        impl From<&$crate::parameters::Parameters> for Values {
            fn from(parameters: &$crate::parameters::Parameters) -> Self {
                Self {
                    $($( $name: parameters.value(&KEYS.$name), )+)+
                }
            }
        }
    };
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::Parameters;
    use crate::parameters::sample::{KEYS, Mode, TABLE, Values};

    #[test]
    fn values_come_in_the_types_of_their_parameters() {
        let values = Values::from(&Parameters::new(TABLE));
        let expected = Values {
            rate_hz: 10.0,
            retries: 1,
            min_samples: 5,
            mode: Mode::Fast,
            device: "/dev/ttyS0".to_owned(),
            calibration: None,
            frame_id: "sensor".to_owned(),
            filtered: false,
        };
        assert_eq!(values, expected);
    }

    #[test]
    fn changed_values_reach_their_fields_and_no_others() {
        use ParameterValue::{Bool, Double, Integer, String};
        let mut parameters = Parameters::new(TABLE);
        for (name, value) in [
            ("rate_hz", Double(20.0)),
            ("retries", Integer(2)),
            ("min_samples", Integer(100)),
            ("mode", String("careful".into())),
            ("device", String("/dev/ttyS1".into())),
            ("calibration", String("a.yaml".into())),
            ("frame_id", String("other".into())),
            ("filtered", Bool(true)),
        ] {
            parameters.set(name, value).expect("allowed");
        }
        let expected = Values {
            rate_hz: 20.0,
            retries: 2,
            min_samples: 100,
            mode: Mode::Careful,
            device: "/dev/ttyS1".to_owned(),
            calibration: Some("a.yaml".to_owned()),
            frame_id: "other".to_owned(),
            filtered: true,
        };
        assert_eq!(Values::from(&parameters), expected);
    }

    #[test]
    fn a_key_checks_what_the_table_checks() {
        let checked = KEYS.mode.check(ParameterValue::String("careful".into()));
        assert_eq!(checked, Ok(Mode::Careful));
        let refused = KEYS.min_samples.check(ParameterValue::Integer(101));
        assert!(matches!(refused, Err(ParameterError::OutOfRange { .. })));
    }

    #[test]
    fn descriptions_are_the_doc_comments_and_the_table_has_them() {
        assert_eq!(KEYS.rate_hz.name(), "rate_hz");
        let retries = TABLE[1];
        assert_eq!((retries.name, retries.unit), ("retries", ""));
        assert_eq!(
            retries.description,
            "attempts after a failed one, which is the most that the sensor takes"
        );
        assert!(KEYS.device.spec().read_only && !KEYS.mode.spec().read_only);
    }

    #[test]
    fn every_word_has_its_own_value() {
        let values: Vec<Option<Mode>> = Mode::WORDS
            .iter()
            .map(|word| Mode::from_word(word))
            .collect();
        assert_eq!(values, [Some(Mode::Fast), Some(Mode::Careful)]);
        assert_eq!(Mode::from_word("Fast"), None);
    }
}
