//! What an unquoted word means as a parameter: rcl's rules, which are those of C and of YAML 1.1.

use crate::parameters::ParameterValue;

const TRUE: [&str; 11] = [
    "y", "Y", "yes", "Yes", "YES", "true", "True", "TRUE", "on", "On", "ON",
];
const FALSE: [&str; 11] = [
    "n", "N", "no", "No", "NO", "false", "False", "FALSE", "off", "Off", "OFF",
];

/// Returns the value of an unquoted word: a bool, a whole number, a number, or else text.
///
/// `010` is 8 and `0x10` is 16, as for C's `strtol`; `~` and `null` are text. A number that no double holds is text, too
/// large or too near 0.
///
/// # Source
/// rcl, `rcl_yaml_param_parser`, as rclpy shows it. DIFFERENCE: C's hexadecimal fractions (`0x1p3`) are text here.
pub(super) fn plain(word: &str) -> ParameterValue {
    if TRUE.contains(&word) {
        return ParameterValue::Bool(true);
    }
    if FALSE.contains(&word) {
        return ParameterValue::Bool(false);
    }
    if let Some(whole) = whole_number(word) {
        return ParameterValue::Integer(whole);
    }
    number(word).map_or_else(
        || ParameterValue::String(word.to_owned()),
        ParameterValue::Double,
    )
}

fn whole_number(word: &str) -> Option<i64> {
    let (sign, digits) = match word.as_bytes().first()? {
        b'-' => ("-", &word[1..]),
        b'+' => ("", &word[1..]),
        _ => ("", word),
    };
    // `from_str_radix` would take a second sign.
    if !digits.starts_with(|first: char| first.is_ascii_digit()) {
        return None;
    }
    let hexadecimal = digits
        .strip_prefix("0x")
        .or_else(|| digits.strip_prefix("0X"));
    let (radix, digits) = match hexadecimal {
        Some(rest) => (16, rest),
        None if digits.len() > 1 && digits.starts_with('0') => (8, &digits[1..]),
        None => (10, digits),
    };
    if !digits.chars().all(|digit| digit.is_digit(radix)) {
        return None;
    }
    i64::from_str_radix(&format!("{sign}{digits}"), radix).ok()
}

fn number(word: &str) -> Option<f64> {
    let unsigned = word.strip_prefix(['+', '-']).unwrap_or(word);
    // YAML's own spellings have a dot before the word; a signed .nan is none of them.
    let spelt = match unsigned {
        ".inf" | ".Inf" | ".INF" => word.replacen('.', "", 1),
        ".nan" | ".NaN" | ".NAN" if word == unsigned => "nan".to_owned(),
        _ => word.to_owned(),
    };
    let value: f64 = spelt.parse().ok()?;
    let is_in_digits = word == spelt && unsigned.contains(|letter: char| letter.is_ascii_digit());
    let mantissa = unsigned.split(['e', 'E']).next().unwrap_or_default();
    let is_nought = !mantissa.contains(|letter: char| matches!(letter, '1'..='9'));
    let is_held = value.is_normal() || (value == 0.0 && is_nought);
    (is_held || !is_in_digits).then_some(value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ParameterValue::{Bool, Double, Integer, String};

    #[test]
    fn words_mean_what_they_mean_to_rcl() {
        for (word, value) in [
            ("yes", Bool(true)),
            ("OFF", Bool(false)),
            ("y", Bool(true)),
            ("010", Integer(8)),
            ("-010", Integer(-8)),
            ("0", Integer(0)),
            ("-0", Integer(0)),
            ("+1", Integer(1)),
            ("0x10", Integer(16)),
            ("9223372036854775807", Integer(i64::MAX)),
            ("-9223372036854775808", Integer(i64::MIN)),
            ("9223372036854775808", Double(9_223_372_036_854_775_808.0)),
            ("08", Double(8.0)),
            ("1.", Double(1.0)),
            ("-.5", Double(-0.5)),
            ("1E3", Double(1000.0)),
            ("-.inf", Double(f64::NEG_INFINITY)),
            ("infinity", Double(f64::INFINITY)),
            ("0e-400", Double(0.0)),
            ("-0.0", Double(-0.0)),
            ("2.2250738585072014e-308", Double(f64::MIN_POSITIVE)),
        ] {
            assert_eq!(plain(word), value, "{word}");
        }
        assert!(matches!(plain(".nan"), Double(value) if value.is_nan()));
        for word in [
            "tRue", "yEs", "0o10", "0b1", "0x", "1_000", "1e", "1e400", "1e-400", "-1e-310", "--1",
            "+-1", "~", "null", "12:30", "", ".", "0x-1", "-.nan", "+.NaN", ".iNf",
        ] {
            assert_eq!(plain(word), String(word.to_owned()), "{word}");
        }
    }
}
