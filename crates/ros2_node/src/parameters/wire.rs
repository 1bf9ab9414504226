//! Values and descriptions of parameters as messages, and values back.

use crate::messages::{
    FloatingPointRange, IntegerRange, ParameterDescriptor, WireParameter, WireValue, parameter_type,
};
use crate::parameters::{Kind, ParameterValue};

/// Returns a value as the wire has it.
pub fn value_message(value: &ParameterValue) -> WireValue {
    let mut message = WireValue {
        kind: type_of(value),
        ..WireValue::default()
    };
    match value {
        ParameterValue::Bool(value) => message.bool_value = *value,
        ParameterValue::Integer(value) => message.integer_value = *value,
        ParameterValue::Double(value) => message.double_value = *value,
        ParameterValue::String(value) => message.string_value.clone_from(value),
    }
    message
}

/// Returns a parameter as the wire has it.
pub fn parameter_message(name: &str, value: &ParameterValue) -> WireParameter {
    WireParameter {
        name: name.to_owned(),
        value: value_message(value),
    }
}

/// Returns the value in a message; `None` where it holds nothing, or a list.
pub fn plain_value(message: &WireValue) -> Option<ParameterValue> {
    match message.kind {
        parameter_type::BOOL => Some(ParameterValue::Bool(message.bool_value)),
        parameter_type::INTEGER => Some(ParameterValue::Integer(message.integer_value)),
        parameter_type::DOUBLE => Some(ParameterValue::Double(message.double_value)),
        parameter_type::STRING => Some(ParameterValue::String(message.string_value.clone())),
        _ => None,
    }
}

/// Returns the number of a value's type.
pub const fn type_of(value: &ParameterValue) -> u8 {
    match value {
        ParameterValue::Bool(_) => parameter_type::BOOL,
        ParameterValue::Integer(_) => parameter_type::INTEGER,
        ParameterValue::Double(_) => parameter_type::DOUBLE,
        ParameterValue::String(_) => parameter_type::STRING,
    }
}

/// Returns the description of a parameter for tools.
pub fn descriptor(
    name: &str,
    value: &ParameterValue,
    kind: &Kind,
    description: &str,
    read_only: bool,
) -> ParameterDescriptor {
    let mut message = ParameterDescriptor {
        name: name.to_owned(),
        kind: type_of(value),
        description: description.to_owned(),
        read_only,
        ..ParameterDescriptor::default()
    };
    match *kind {
        Kind::Bool { .. } => {}
        Kind::Integer { min, max, .. } => message.integer_range.push(IntegerRange {
            from_value: min,
            to_value: max,
            step: 1,
        }),
        Kind::Double { min, max, .. } => message.floating_point_range.push(FloatingPointRange {
            from_value: min,
            to_value: max,
            step: 0.0,
        }),
        Kind::Choice { .. } | Kind::Text { .. } | Kind::FrameId { .. } => {
            message.additional_constraints = kind.allowed();
        }
    }
    message
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_returns_from_its_message() {
        for value in [
            ParameterValue::Bool(true),
            ParameterValue::Integer(-3),
            ParameterValue::Double(0.5),
            ParameterValue::String("fin6".into()),
        ] {
            assert_eq!(plain_value(&value_message(&value)), Some(value));
        }
    }

    #[test]
    fn nothing_and_lists_are_no_values() {
        for kind in [0, 5, 9, 255] {
            let message = WireValue {
                kind,
                ..WireValue::default()
            };
            assert_eq!(plain_value(&message), None, "{kind}");
        }
    }
}
