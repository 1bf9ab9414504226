//! Declarations as documents: a parameter file with comments, and tables for a page.

use super::spec::{Kind, ParameterSpec};
use super::value::ParameterValue;

/// Parameters under one title.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Section {
    /// Their title.
    pub title: &'static str,
    /// Their declarations.
    pub parameters: &'static [ParameterSpec],
}

/// Where a parameter file's comments begin and its lines end.
const COMMENT_COLUMN: usize = 37;
const LINE_LENGTH: usize = 120;

/// Returns a parameter file for any node, with every parameter at its default, and comments with the rest.
///
/// `(fixed)` marks what is read-only once the node runs.
#[must_use]
pub fn parameter_file(sections: &[Section]) -> String {
    let mut file = "/**:\n  ros__parameters:\n".to_owned();
    for (i, section) in sections.iter().enumerate() {
        if i > 0 {
            file.push('\n');
        }
        file.push_str("    # ");
        file.push_str(section.title);
        file.push('\n');
        for spec in section.parameters {
            push_with_comment(&mut file, spec);
        }
    }
    file
}

fn push_with_comment(file: &mut String, spec: &ParameterSpec) {
    let value = format!("    {}: {} ", spec.name, yaml_value(&spec.default()));
    let column = COMMENT_COLUMN.max(value.chars().count());
    let fixed = if spec.read_only { "(fixed) " } else { "" };
    let facts = match (spec.unit, range(&spec.kind)) {
        ("", None) => String::new(),
        (unit, None) => format!("{unit}; "),
        ("", Some(range)) => format!("{range}; "),
        (unit, Some(range)) => format!("{unit}, {range}; "),
    };
    let text = format!("{fixed}{facts}{}", spec.description);
    let mut line = format!("{value:column$}#");
    let mut rest = text.split(' ').peekable();
    while let Some(word) = rest.next() {
        line.push(' ');
        line.push_str(word);
        let next = rest.peek().map_or(0, |word| word.chars().count() + 1);
        if line.chars().count() + next > LINE_LENGTH {
            file.push_str(&line);
            file.push('\n');
            // Deeper, so that it reads as one comment.
            line = format!("{:COMMENT_COLUMN$}#  ", "");
        }
    }
    file.push_str(&line);
    file.push('\n');
}

/// Returns a table in Markdown for each section, under its title.
#[must_use]
pub fn markdown_tables(sections: &[Section]) -> String {
    let mut page = String::new();
    for section in sections {
        page.push_str("### ");
        page.push_str(section.title);
        page.push_str("\n\n| parameter | default | range | unit | fixed | |\n| --- | --- | --- | --- | --- | --- |\n");
        for spec in section.parameters {
            let cells = [
                format!("`{}`", spec.name),
                format!("`{}`", yaml_value(&spec.default())),
                range(&spec.kind).unwrap_or_default().replace('|', "\\|"),
                spec.unit.to_owned(),
                if spec.read_only { "fixed" } else { "" }.to_owned(),
                spec.description.replace('|', "\\|"),
            ];
            page.push_str("| ");
            page.push_str(&cells.join(" | "));
            page.push_str(" |\n");
        }
        page.push('\n');
    }
    page
}

fn range(kind: &Kind) -> Option<String> {
    match kind {
        Kind::Integer { min, max, .. } => Some(format!("{min} to {max}")),
        Kind::Double { min, max, .. } => Some(format!("{min} to {max}")),
        Kind::Choice { allowed, .. } => Some(allowed.join(" | ")),
        Kind::Bool { .. } | Kind::Text { .. } | Kind::FrameId { .. } => None,
    }
}

fn yaml_value(value: &ParameterValue) -> String {
    match value {
        ParameterValue::Bool(value) => value.to_string(),
        ParameterValue::Integer(value) => value.to_string(),
        ParameterValue::Double(value) => {
            let text = format!("{value:?}");
            // Without a dot, YAML 1.1 (PyYAML, which `ros2 param load` uses) takes 1e-7 for a word.
            match text.split_once('e') {
                Some((digits, exponent)) if !digits.contains('.') => {
                    format!("{digits}.0e{exponent}")
                }
                _ => text,
            }
        }
        // A word such as `tanker` is text in YAML, too; anything else needs quotes to be sure.
        ParameterValue::String(text) if is_plain_word(text) => text.clone(),
        ParameterValue::String(text) => format!("'{}'", text.replace('\'', "''")),
    }
}

/// Returns whether a text is a word that no rule of YAML or of rcl takes for anything but text.
fn is_plain_word(text: &str) -> bool {
    const BOOLS: [&str; 8] = ["y", "n", "yes", "no", "on", "off", "true", "false"];
    const NUMBERS: [&str; 2] = ["nan", "inf"];
    text.starts_with(|letter: char| letter.is_ascii_lowercase())
        && text
            .chars()
            .all(|letter| letter.is_ascii_lowercase() || letter == '_' || letter.is_ascii_digit())
        && ![BOOLS.as_slice(), &NUMBERS, &["null"]]
            .concat()
            .contains(&text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::sample::SECTIONS;

    #[test]
    fn a_file_shows_each_default_with_what_else_is_declared() {
        let expected = "/**:
  ros__parameters:
    # Measurements
    rate_hz: 10.0                    # Hz, 0.5 to 1000; how often it measures
    retries: 1                       # 0 to 2; attempts after a failed one, which is the most that the sensor takes
    min_samples: 5                   # 3 to 100; fewer give no measurement
    mode: fast                       # fast | careful; how it measures

    # Connection
    device: '/dev/ttyS0'             # (fixed) where it is connected
    calibration: none                # (fixed) a file, or none
    frame_id: sensor                 # frame of its measurements
    filtered: false                  # smooth the measurements
";
        assert_eq!(parameter_file(SECTIONS), expected);
    }

    #[test]
    fn long_comments_are_wrapped_below_where_they_begin() {
        let spec = ParameterSpec {
            name: "x",
            kind: Kind::Bool { default: true },
            unit: "",
            read_only: false,
            description: "a b c d e f g h i j k l m n o p q r s t u v w x y z a b c d e f g h i j k l m n o p q r s t u v w",
        };
        let mut file = String::new();
        push_with_comment(&mut file, &spec);
        let lines: Vec<&str> = file.lines().collect();
        assert_eq!(lines.len(), 2);
        assert!(lines[0].len() <= LINE_LENGTH && lines[0].len() > LINE_LENGTH - 2);
        assert_eq!(lines[1].find("#   "), Some(COMMENT_COLUMN));
    }

    #[test]
    fn a_page_has_a_table_for_each_section() {
        let page = markdown_tables(SECTIONS);
        assert!(
            page.starts_with("### Measurements\n\n| parameter |"),
            "{page}"
        );
        let mode = r"| `mode` | `fast` | fast \| careful |  |  | how it measures |";
        let device = "| `device` | `'/dev/ttyS0'` |  |  | fixed | where it is connected |";
        let rate = "| `rate_hz` | `10.0` | 0.5 to 1000 | Hz |  | how often it measures |";
        for line in [mode, device, rate] {
            assert!(page.lines().any(|found| found == line), "{line}\n{page}");
        }
    }

    #[test]
    fn words_that_yaml_takes_for_something_else_are_quoted() {
        for (text, shown) in [
            ("tanker", "tanker"),
            ("yes", "'yes'"),
            ("null", "'null'"),
            ("8", "'8'"),
            ("a b's", "'a b''s'"),
            ("", "''"),
        ] {
            assert_eq!(yaml_value(&ParameterValue::String(text.into())), shown);
        }
    }
}
