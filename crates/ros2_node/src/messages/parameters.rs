//! `rcl_interfaces` and `rosgraph_msgs`: parameters on the wire, and the simulated clock.

use serde::{Deserialize, Serialize};

use super::Time;

/// `rosgraph_msgs/Clock`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Clock {
    /// The simulated time.
    pub clock: Time,
}

/// `rcl_interfaces/ParameterType`: what a [`WireValue`] holds; 0 is none.
pub mod parameter_type {
    /// True or false.
    pub const BOOL: u8 = 1;
    /// A whole number.
    pub const INTEGER: u8 = 2;
    /// Any other number.
    pub const DOUBLE: u8 = 3;
    /// Text.
    pub const STRING: u8 = 4;
}

/// `rcl_interfaces/ParameterValue`: the field that `kind` names is the value.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct WireValue {
    /// One of [`parameter_type`], or of the types of arrays beyond them.
    pub kind: u8,
    /// Value of a bool.
    pub bool_value: bool,
    /// Value of an integer.
    pub integer_value: i64,
    /// Value of a double.
    pub double_value: f64,
    /// Value of a string.
    pub string_value: String,
    /// Value of a byte array.
    pub byte_array_value: Vec<u8>,
    /// Value of an array of bools.
    pub bool_array_value: Vec<bool>,
    /// Value of an array of integers.
    pub integer_array_value: Vec<i64>,
    /// Value of an array of doubles.
    pub double_array_value: Vec<f64>,
    /// Value of an array of strings.
    pub string_array_value: Vec<String>,
}

/// `rcl_interfaces/Parameter`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct WireParameter {
    /// Its name.
    pub name: String,
    /// Its value.
    pub value: WireValue,
}

/// `rcl_interfaces/FloatingPointRange`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FloatingPointRange {
    /// Least value.
    pub from_value: f64,
    /// Greatest value.
    pub to_value: f64,
    /// Distance of allowed values; 0: all are.
    pub step: f64,
}

/// `rcl_interfaces/IntegerRange`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct IntegerRange {
    /// Least value.
    pub from_value: i64,
    /// Greatest value.
    pub to_value: i64,
    /// Distance of allowed values.
    pub step: u64,
}

/// `rcl_interfaces/ParameterDescriptor`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct ParameterDescriptor {
    /// The parameter.
    pub name: String,
    /// One of [`parameter_type`].
    pub kind: u8,
    /// Its description.
    pub description: String,
    /// Constraints beyond a range.
    pub additional_constraints: String,
    /// Whether it is fixed.
    pub read_only: bool,
    /// Whether it may change its type.
    pub dynamic_typing: bool,
    /// At most one.
    pub floating_point_range: Vec<FloatingPointRange>,
    /// At most one.
    pub integer_range: Vec<IntegerRange>,
}

/// `rcl_interfaces/SetParametersResult`.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct SetParametersResult {
    /// Whether the value holds now.
    pub successful: bool,
    /// Why not.
    pub reason: String,
}

/// `rcl_interfaces/ParameterEvent`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct ParameterEvent {
    /// When, in the node's time.
    pub stamp: Time,
    /// Absolute name of the node.
    pub node: String,
    /// New ones.
    pub new_parameters: Vec<WireParameter>,
    /// Changed ones.
    pub changed_parameters: Vec<WireParameter>,
    /// Deleted ones.
    pub deleted_parameters: Vec<WireParameter>,
}

/// Request of `DescribeParameters`, `GetParameters` and `GetParameterTypes`.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Names {
    /// Of the parameters in question.
    pub names: Vec<String>,
}

/// Request of `SetParameters` and `SetParametersAtomically`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Assignments {
    /// The values to be.
    pub parameters: Vec<WireParameter>,
}

/// Request of `ListParameters`.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct ListRequest {
    /// Names, or beginnings of names up to a dot; empty: all.
    pub prefixes: Vec<String>,
    /// How many parts of a name may follow the prefix; 0: any number.
    pub depth: u64,
}

/// Response of `ListParameters`.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct ListResult {
    /// The parameters.
    pub names: Vec<String>,
    /// The part before the last dot of their names, each once.
    pub prefixes: Vec<String>,
}
