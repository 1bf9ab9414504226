//! The declaration of a parameter: name, type, default, range and description.

use super::ParameterValue;

/// The allowed values of a parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// True or false.
    Bool {
        /// Value unless set.
        default: bool,
    },
    /// A whole number within bounds.
    Integer {
        /// Value unless set.
        default: i64,
        /// Least value.
        min: i64,
        /// Greatest value.
        max: i64,
    },
    /// A finite number within bounds; a whole number is taken as one.
    Double {
        /// Value unless set.
        default: f64,
        /// Least value.
        min: f64,
        /// Greatest value.
        max: f64,
    },
    /// One of a few words.
    Choice {
        /// Value unless set.
        default: &'static str,
        /// All of the words.
        allowed: &'static [&'static str],
    },
    /// Text that is not empty.
    Text {
        /// Value unless set.
        default: &'static str,
    },
    /// The name of a tf2 frame.
    FrameId {
        /// Value unless set.
        default: &'static str,
    },
}

/// The requirement on a frame id.
pub(super) const FRAME_ID: &str =
    "be a tf2 frame: not empty, without white space, not beginning with a slash, at most 255 bytes";
/// The requirement on any other text.
pub(super) const TEXT: &str = "not be empty";

impl Kind {
    /// Returns the allowed values, for display.
    #[must_use]
    pub fn allowed(&self) -> String {
        match self {
            Self::Bool { .. } => "a bool".to_owned(),
            Self::Integer { min, max, .. } => format!("an integer from {min} to {max}"),
            Self::Double { min, max, .. } => format!("a number from {min:?} to {max:?}"),
            Self::Choice { allowed, .. } => format!("one of {}", allowed.join(", ")),
            Self::Text { .. } => format!("text that must {TEXT}"),
            Self::FrameId { .. } => format!("text that must {FRAME_ID}"),
        }
    }
}

/// As every ROS node has it: whether its time comes from `/clock`.
pub const USE_SIM_TIME: ParameterSpec = ParameterSpec::bool(
    "use_sim_time",
    false,
    "take the time from /clock, as in a simulation",
);

/// One parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ParameterSpec {
    /// Its name.
    pub name: &'static str,
    /// Its allowed values.
    pub kind: Kind,
    /// Unit of its values; empty without one.
    pub unit: &'static str,
    /// Whether it is fixed once the node runs.
    pub read_only: bool,
    /// Its description.
    pub description: &'static str,
}

impl ParameterSpec {
    /// Returns a parameter that is true or false.
    #[must_use]
    pub const fn bool(name: &'static str, default: bool, description: &'static str) -> Self {
        Self::new(name, Kind::Bool { default }, description)
    }

    /// Returns a parameter that is a whole number within these bounds.
    #[must_use]
    pub const fn integer(
        name: &'static str,
        default: i64,
        [min, max]: [i64; 2],
        description: &'static str,
    ) -> Self {
        Self::new(name, Kind::Integer { default, min, max }, description)
    }

    /// Returns a parameter that is a finite number within these bounds.
    #[must_use]
    pub const fn double(
        name: &'static str,
        default: f64,
        [min, max]: [f64; 2],
        description: &'static str,
    ) -> Self {
        Self::new(name, Kind::Double { default, min, max }, description)
    }

    /// Returns a parameter that is one of these words.
    #[must_use]
    pub const fn choice(
        name: &'static str,
        default: &'static str,
        allowed: &'static [&'static str],
        description: &'static str,
    ) -> Self {
        Self::new(name, Kind::Choice { default, allowed }, description)
    }

    /// Returns a parameter that is text.
    #[must_use]
    pub const fn text(
        name: &'static str,
        default: &'static str,
        description: &'static str,
    ) -> Self {
        Self::new(name, Kind::Text { default }, description)
    }

    /// Returns a parameter that is the name of a tf2 frame.
    #[must_use]
    pub const fn frame_id(
        name: &'static str,
        default: &'static str,
        description: &'static str,
    ) -> Self {
        Self::new(name, Kind::FrameId { default }, description)
    }

    const fn new(name: &'static str, kind: Kind, description: &'static str) -> Self {
        Self {
            name,
            kind,
            unit: "",
            read_only: false,
            description,
        }
    }

    /// Returns this parameter, fixed once the node runs.
    #[must_use]
    pub const fn read_only(mut self) -> Self {
        self.read_only = true;
        self
    }

    /// Returns its unit, if it has one, and what it does.
    #[must_use]
    pub fn unit_and_description(&self) -> String {
        match self.unit {
            "" => self.description.to_owned(),
            unit => format!("{unit}, {}", self.description),
        }
    }

    /// Returns the value that holds unless another is set.
    #[must_use]
    pub fn default(&self) -> ParameterValue {
        match self.kind {
            Kind::Bool { default } => ParameterValue::Bool(default),
            Kind::Integer { default, .. } => ParameterValue::Integer(default),
            Kind::Double { default, .. } => ParameterValue::Double(default),
            Kind::Choice { default, .. } | Kind::Text { default } | Kind::FrameId { default } => {
                ParameterValue::String(default.to_owned())
            }
        }
    }
}
