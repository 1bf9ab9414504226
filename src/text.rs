//! Text from outside in messages for people: never longer than a line.

/// Characters of a foreign word, and members of a foreign list, that a message shows.
const SHOWN: usize = 60;
const LISTED: usize = 12;

/// Returns the text, cut where it is longer than a message should be.
pub(crate) fn clip(text: &str) -> String {
    match text.char_indices().nth(SHOWN) {
        Some((end, _)) => format!("{}… ({} bytes)", &text[..end], text.len()),
        None => text.to_owned(),
    }
}

/// Returns the members joined by commas, the first ones of many.
pub(crate) fn list<T: std::fmt::Debug>(members: &[T]) -> String {
    let shown: Vec<String> = members
        .iter()
        .take(LISTED)
        .map(|member| format!("{member:?}"))
        .collect();
    let rest = members.len().saturating_sub(LISTED);
    let more = if rest > 0 {
        format!(" and {rest} more")
    } else {
        String::new()
    };
    format!("{}{more}", shown.join(", "))
}

/// Returns a number with three significant digits: residuals and depths go from nanometres to kilometres.
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

    #[test]
    fn long_text_is_cut_between_characters_and_short_text_is_not() {
        assert_eq!(clip("camera"), "camera");
        let long = "ä".repeat(1_000_000);
        assert!(clip(&long).starts_with("ää") && clip(&long).len() < 200);
    }

    #[test]
    fn long_lists_name_their_first_members() {
        assert_eq!(list(&[1, 2]), "1, 2");
        assert_eq!(
            list(&vec![7; 100]),
            format!("{} and 88 more", ["7"; 12].join(", "))
        );
    }
}
