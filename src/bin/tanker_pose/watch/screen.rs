//! A table that is drawn over itself on a terminal.

use std::io;

use console::{Style, Term, measure_text_width};

use super::table::Row;
use super::words::Tone;

const LABEL_WIDTH: usize = 13;
/// Narrower than this nothing can be read anyway.
const MIN_TEXT_WIDTH: usize = 20;

/// The terminal while a table stands on it.
pub struct Screen {
    term: Term,
    lines: usize,
    size: (u16, u16),
}

impl Screen {
    /// Returns the terminal on standard output, its cursor hidden; `None` without a terminal.
    pub fn open() -> Option<Self> {
        let term = Term::buffered_stdout();
        if !term.is_term() || console::is_dumb() {
            return None;
        }
        // Whatever cannot be written now will show when the table is.
        let _ = term.hide_cursor();
        let size = term.size();
        Some(Self {
            term,
            lines: 0,
            size,
        })
    }

    /// Draws the table where the last one stands.
    pub fn draw(&mut self, title: &str, rows: &[Row]) -> io::Result<()> {
        let size = self.term.size();
        if self.lines > 0 && size == self.size {
            self.term.clear_last_lines(self.lines)?;
        } else if self.lines > 0 {
            // Lines have been broken anew: where the last table begins is not known any more.
            self.term.clear_screen()?;
        }
        self.size = size;
        let (height, width) = (usize::from(size.0), usize::from(size.1));
        let mut lines = vec![Style::new().bold().apply_to(cut(title, width)).to_string()];
        for row in rows {
            let style = match row.tone {
                Tone::Good => Style::new().green(),
                Tone::Bad => Style::new().red().bold(),
                Tone::Plain => Style::new(),
            };
            let text_width = width.saturating_sub(LABEL_WIDTH).max(MIN_TEXT_WIDTH);
            for (k, text) in wrap(&row.text, text_width).iter().enumerate() {
                let label = if k == 0 { row.label } else { "" };
                let label = Style::new().dim().apply_to(format!("{label:LABEL_WIDTH$}"));
                lines.push(format!("{label}{}", style.apply_to(text)));
            }
        }
        // The line of the cursor is needed too.
        lines.truncate(height.saturating_sub(1).max(1));
        for line in &lines {
            self.term.write_line(line)?;
        }
        self.lines = lines.len();
        self.term.flush()
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        let _ = self.term.show_cursor().and_then(|()| self.term.flush());
    }
}

fn cut(text: &str, width: usize) -> String {
    console::truncate_str(text, width, "…").into_owned()
}

/// Returns the text in lines of at most this width, broken between words; spaces inside a line are kept.
fn wrap(text: &str, width: usize) -> Vec<String> {
    let mut lines = Vec::new();
    let mut rest = text;
    while measure_text_width(rest) > width {
        let mut used = 0;
        let fits = rest
            .char_indices()
            .take_while(|(_, c)| {
                used += measure_text_width(c.encode_utf8(&mut [0; 4]));
                used <= width
            })
            .last()
            .map_or(0, |(at, c)| at + c.len_utf8());
        let end = if rest[fits..].starts_with(' ') {
            fits
        } else {
            let space = rest[..fits].rfind(' ').filter(|end| *end > 0);
            space.unwrap_or(fits)
        };
        if end == 0 {
            break;
        }
        lines.push(rest[..end].trim_end().to_owned());
        rest = rest[end..].trim_start();
    }
    lines.push(rest.to_owned());
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_broken_between_words_and_inside_one_that_is_too_long() {
        assert_eq!(wrap("", 5), [""]);
        assert_eq!(wrap("one two", 7), ["one two"]);
        assert_eq!(wrap("one two three", 7), ["one two", "three"]);
        assert_eq!(wrap("abcdefghij kl", 4), ["abcd", "efgh", "ij", "kl"]);
        assert_eq!(wrap("äöüß äöüß", 4), ["äöüß", "äöüß"]);
        assert_eq!(wrap("a     b", 10), ["a     b"]);
    }

    #[test]
    fn no_line_is_wider_than_asked_for_and_nothing_but_spaces_is_lost() {
        let text =
            "expected at least 5 points, got 4: ids 1 2 3 4 | ±0.5 m, 日本語 in the frame_id";
        for width in 2..40 {
            let lines = wrap(text, width);
            assert!(
                lines.iter().all(|line| measure_text_width(line) <= width),
                "{lines:?}"
            );
            let bare = |text: &str| text.replace(' ', "");
            assert_eq!(bare(&lines.concat()), bare(text));
        }
    }
}
