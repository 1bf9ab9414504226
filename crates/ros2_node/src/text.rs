//! Text from outside in messages for people: on one line, never longer than one.
//!
//! Every word that others chose (a `frame_id`, a name, a value, a type, a label) goes through [`clip`], or [`quoted`] or
//! [`list`], which use it, before it stands in a status, a log line, a report or an answer: a word of a megabyte would
//! stall a reliable topic for all of its subscribers, and one with a line break would forge a line of the log. What
//! leaves the node is cut by [`line()`] once more, so that a place that forgets this costs no more than a long line.

use std::borrow::Cow;

/// bytes; a longer `frame_id`, which would have to be passed on bit for bit, is refused. The names of
/// files on Linux have the same limit.
pub const MAX_NAME_BYTES: usize = 255;
/// Characters of a foreign word, and members of a foreign list, that a message shows.
const SHOWN: usize = 60;
const LISTED: usize = 12;
/// Characters of a path: its end is what people look for.
const PATH_SHOWN: usize = 255;
/// Characters of a whole message; the longest of ours are a fifth of that.
const LINE: usize = 4000;

/// Returns a word as messages show it: cut where it is long, without control characters.
#[must_use]
pub fn clip(word: &str) -> String {
    cut(word, SHOWN)
}

/// Returns a word as messages show it, in double quotes.
#[must_use]
pub fn quoted(word: &str) -> String {
    format!("\"{}\"", clip(word))
}

/// Returns a name as answers carry it that have a field for it: as it came, unless it is too long for a name.
#[must_use]
pub fn echoed(name: String) -> String {
    if name.len() <= MAX_NAME_BYTES {
        name
    } else {
        clip(&name)
    }
}

/// Returns a path as messages show it, in double quotes.
#[must_use]
pub fn path(path: &std::path::Path) -> String {
    format!("\"{}\"", cut(&path.to_string_lossy(), PATH_SHOWN))
}

/// Returns a whole message, cut where it is longer than any of ours is.
#[must_use]
pub fn line(message: &str) -> Cow<'_, str> {
    match message.char_indices().nth(LINE) {
        Some((end, _)) => format!("{}… ({} bytes)", &message[..end], message.len()).into(),
        None => message.into(),
    }
}

fn cut(word: &str, most: usize) -> String {
    let end = word.char_indices().nth(most).map(|(end, _)| end);
    let mut text = String::new();
    for character in word[..end.unwrap_or(word.len())].chars() {
        match character {
            // `escape_debug` would set a backslash before these, though they harm no line.
            '\'' | '"' | '\\' => text.push(character),
            other => text.extend(other.escape_debug()),
        }
    }
    if end.is_some() {
        return format!("{text}… ({} bytes)", word.len());
    }
    text
}

/// Returns the members joined by commas, the first ones of many, each cut where it is long.
#[must_use]
pub fn list<T: std::fmt::Debug>(members: &[T]) -> String {
    let shown: Vec<String> = members
        .iter()
        .take(LISTED)
        .map(|member| clip(&format!("{member:?}")))
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
    fn long_words_are_cut_between_characters_and_short_ones_are_not() {
        assert_eq!(clip("lidar"), "lidar");
        assert_eq!(quoted("it's C:\\a"), "\"it's C:\\a\"");
        let found = clip(&"ä".repeat(1_000_000));
        let is_cut = found.starts_with("ää") && found.ends_with("… (2000000 bytes)");
        assert!(is_cut && found.len() < 200, "{found}");
        assert_eq!(echoed("a\n".to_owned()), "a\n");
        assert_eq!(echoed("ä".repeat(1_000_000)), found);
        assert!(list(&["ä".repeat(1_000_000)]).len() < 200);
        let message = "ä".repeat(1_000_000);
        assert!(line(&message).len() < 3 * LINE);
        assert_eq!(line("short"), "short");
    }

    #[test]
    fn a_word_never_makes_a_line_of_its_own() {
        let found = clip("lidar\n[ERROR] [1.0] [other]: \u{1b}[31m\u{202e}\r\0");
        assert!(!found.contains(char::is_control), "{found}");
        assert!(!found.contains('\u{202e}'), "{found}");
        // The worst that can come of the longest word, in bytes.
        assert!(clip(&"\u{202e}".repeat(1000)).len() < 600);
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
