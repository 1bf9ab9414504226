//! Numbers and words in messages.

pub(crate) use ros2_node::text::{MAX_NAME_BYTES, clip, list, quoted};
#[cfg(any(feature = "ros", feature = "bags"))]
pub(crate) use ros2_node::text::{echoed, line, path};

/// Returns a number with three significant digits: residuals and depths range from nanometres to kilometres.
pub(crate) fn digits(value: f64) -> String {
    let size = value.abs();
    match size {
        0.0 => "0".to_owned(),
        1e-3..1e5 => {
            let decimals = if size >= 100.0 {
                0
            } else if size >= 10.0 {
                1
            } else if size >= 1.0 {
                2
            } else if size >= 0.1 {
                3
            } else {
                5
            };
            format!("{value:.decimals$}")
        }
        _ => format!("{value:.2e}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_three_significant_digits_at_every_size() {
        for (value, expected) in [
            (0.0, "0"),
            (-0.0, "0"),
            (-0.000_4, "-4.00e-4"),
            (0.001_234, "0.00123"),
            (0.512_34, "0.512"),
            (-7.894, "-7.89"),
            (45.04, "45.0"),
            (1234.5, "1234"),
            (2.0e7, "2.00e7"),
            (f64::NAN, "NaN"),
        ] {
            assert_eq!(digits(value), expected);
        }
    }
}
