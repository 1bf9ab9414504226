//! Words that rcl's lexer takes for names.

pub(super) fn is_token(word: &str) -> bool {
    let begins_well = !word.starts_with(|first: char| first.is_ascii_digit());
    begins_well && !word.contains("__") && is_word(word.as_bytes())
}

pub(super) fn is_word(letters: &[u8]) -> bool {
    let is_letter = |letter: &u8| letter.is_ascii_alphanumeric() || *letter == b'_';
    !letters.is_empty() && letters.iter().all(is_letter)
}

/// Returns whether ROS takes this for a node in a parameter file: names between slashes, of which each may be `*` or `**`.
pub(super) fn is_node_pattern(written: &str) -> bool {
    let is_part = |part: &str| {
        let is_name = !part.starts_with(|first: char| first.is_ascii_digit());
        matches!(part, "*" | "**") || (is_name && is_word(part.as_bytes()))
    };
    written
        .strip_prefix('/')
        .unwrap_or(written)
        .split('/')
        .all(is_part)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_are_checked_part_by_part() {
        for good in ["n", "/n", "/**", "*/n", "/a/**/n", "__n"] {
            assert!(is_node_pattern(good), "{good}");
        }
        for wrong in [
            "", "/", "n/", "//n", "a//n", "n*", "***", "1n", "a b", "~/n",
        ] {
            assert!(!is_node_pattern(wrong), "{wrong}");
        }
    }
}
