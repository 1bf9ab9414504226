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

#[cfg(test)]
mod tests {
    use super::*;

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
