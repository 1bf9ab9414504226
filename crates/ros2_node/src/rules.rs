//! One ROS argument's value: `node:name:=value`, `node:from:=to`, `logger:=level`, an enclave.
//!
//! The grammar is that of rcl's lexer, as rclpy shows it. It is checked for rules of other nodes, too: a rule that is for
//! no node, such as `/**:name:=value`, would be ignored silently.

use log::LevelFilter;
use ros2args::RemapRule;

use super::parameter_file;
use super::tokens::{is_token, is_word};
use crate::parameters::ParameterValue;
use crate::text::clip;

/// `-p node:name:=value`.
#[derive(Debug, Clone, PartialEq)]
pub struct Assignment {
    /// Base name of the node; `None`: every node.
    pub node: Option<String>,
    /// The parameter.
    pub name: String,
    /// None where something stands that no parameter can hold.
    pub value: Option<ParameterValue>,
}

/// Prefixes of a remap's left side that tell topics from services.
const SCHEMES: [&str; 2] = ["rostopic://", "rosservice://"];

/// Returns the assignment that `-p` has.
///
/// # Errors
/// What is wrong with it.
pub(super) fn assignment(argument: &str) -> Result<Assignment, String> {
    let (target, word) = sides(argument)?;
    let (node, name) = match target.split_once(':') {
        Some((node, name)) => (Some(node), name),
        None => (None, target),
    };
    check_node(node)?;
    if !is_parameter(name) {
        return Err(format!(
            "{:?} is not a parameter name: expected letters, digits, single _ and dots",
            clip(name)
        ));
    }
    Ok(Assignment {
        node: node.map(str::to_owned),
        name: name.to_owned(),
        value: parameter_file::value(word)?,
    })
}

/// Returns the rule that `-r` has; its left side keeps a scheme.
///
/// # Errors
/// What is wrong with it. What `__node` and `__ns` become, [`super::names`] checks.
pub(super) fn remap(argument: &str) -> Result<RemapRule, String> {
    let (target, to) = sides(argument)?;
    let has_scheme = |text: &str| SCHEMES.iter().any(|scheme| text.starts_with(scheme));
    let (node, from) = match target.split_once(':') {
        Some((node, from)) if !has_scheme(target) => (Some(node), from),
        _ => (None, target),
    };
    check_node(node)?;
    if !from.starts_with("__") {
        let name = SCHEMES
            .iter()
            .find_map(|scheme| from.strip_prefix(scheme))
            .unwrap_or(from);
        for side in [name, to] {
            if !is_topic(side) {
                return Err(format!(
                    "{:?} is not a name of a topic or service",
                    clip(side)
                ));
            }
        }
    }
    let (from, to) = (from.to_owned(), to.to_owned());
    Ok(match node {
        Some(node) => RemapRule::new_node_specific(node.to_owned(), from, to),
        None => RemapRule::new_global(from, to),
    })
}

/// Returns logger and level of `--log-level`; no logger: all of them; no level: it is `UNSET`.
///
/// # Errors
/// What is wrong with it.
pub(super) fn log_level(argument: &str) -> Result<(Option<&str>, Option<LevelFilter>), String> {
    let (logger, word) = match argument.split_once(":=") {
        Some(("", _)) => return Err("the logger's name is empty".to_owned()),
        Some((logger, word)) => (Some(logger), word),
        None => (None, argument),
    };
    let level = match word.to_ascii_lowercase().as_str() {
        "unset" => None,
        "debug" => Some(LevelFilter::Debug),
        "info" => Some(LevelFilter::Info),
        "warn" => Some(LevelFilter::Warn),
        // The `log` crate knows nothing above error.
        "error" | "fatal" => Some(LevelFilter::Error),
        _ => {
            let word = clip(word);
            return Err(format!(
                "expected debug, info, warn, error, fatal or unset, got {word:?}"
            ));
        }
    };
    Ok((logger, level))
}

/// Returns whether ROS takes this for an enclave: a path such as `/left/lidar`.
pub(super) fn is_enclave(path: &str) -> bool {
    let is_part = |part: &str| {
        !part.starts_with(|first: char| first.is_ascii_digit()) && is_word(part.as_bytes())
    };
    path == "/"
        || path
            .strip_prefix('/')
            .is_some_and(|path| path.split('/').all(is_part))
}

fn sides(argument: &str) -> Result<(&str, &str), String> {
    let (left, right) = argument.split_once(":=").ok_or("it has no :=")?;
    if right.is_empty() {
        return Err("expected a value after :=".to_owned());
    }
    Ok((left, right))
}

fn check_node(node: Option<&str>) -> Result<(), String> {
    match node.filter(|node| !is_token(node)) {
        None => Ok(()),
        Some(node) => Err(format!(
            "{:?} is not a node's name without its namespace",
            clip(node)
        )),
    }
}

/// rcl's lexer takes slashes anywhere in a parameter's name (`qos_overrides./scan.publisher.depth`), and dots between.
fn is_parameter(name: &str) -> bool {
    let ends_with_dot = name.starts_with('.') || name.ends_with('.') || name.contains("..");
    let is_part = |part: &str| part.is_empty() || is_token(part);
    !name.is_empty() && !ends_with_dot && name.split(['.', '/']).all(is_part)
}

fn is_topic(name: &str) -> bool {
    name.strip_prefix("~/")
        .or_else(|| name.strip_prefix('/'))
        .unwrap_or(name)
        .split('/')
        .all(is_token)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_assignment_may_name_a_node_without_its_namespace() {
        let found = assignment("lidar:lens.k1:=0x10").expect("well formed");
        let expected = Assignment {
            node: Some("lidar".to_owned()),
            name: "lens.k1".to_owned(),
            value: Some(ParameterValue::Integer(16)),
        };
        assert_eq!(found, expected);
        for name in ["a", "qos_overrides./scan.publisher.depth", "/a", "a_b.c_1"] {
            assert!(assignment(&format!("{name}:=1")).is_ok(), "{name}");
        }
    }

    #[test]
    fn a_rule_that_is_for_nobody_is_refused() {
        for target in ["/**:a", "*:a", "/lidar:a", "1a:a", "a-b:a", "~:a", ":a"] {
            assert!(assignment(&format!("{target}:=1")).is_err(), "{target}");
            assert!(remap(&format!("{target}:=b")).is_err(), "{target}");
        }
    }

    #[test]
    fn names_that_ros_does_not_know_are_refused() {
        for name in ["", "a b", "a-b", "1a", ".a", "a.", "a..b", "a__b", "é", "*"] {
            assert!(assignment(&format!("n:{name}:=1")).is_err(), "{name}");
        }
        for name in ["", "~", "a//b", "a/", "/", "1a", "a*", "{node}", "a b"] {
            assert!(remap(&format!("{name}:=b")).is_err(), "{name}");
            assert!(remap(&format!("a:={name}")).is_err(), "{name}");
        }
        assert!(remap("a:=rostopic://b").is_err());
        assert!(assignment("a:={b: 1}").is_err());
    }

    #[test]
    fn a_remap_keeps_node_scheme_and_special_names_apart() {
        for (argument, node, from) in [
            ("a:=b", None, "a"),
            ("n:~/a:=/b/c", Some("n"), "~/a"),
            ("rostopic://a:=b", None, "rostopic://a"),
            ("n:rosservice:///a:=b", Some("n"), "rosservice:///a"),
            ("n:__ns:=/b", Some("n"), "__ns"),
        ] {
            let rule = remap(argument).expect(argument);
            assert_eq!(
                (rule.node_name.as_deref(), &*rule.from),
                (node, from),
                "{argument}"
            );
        }
    }

    #[test]
    fn levels_are_words_of_ros() {
        assert_eq!(log_level("WaRn"), Ok((None, Some(LevelFilter::Warn))));
        assert_eq!(log_level("a.b:=UNSET"), Ok((Some("a.b"), None)));
        for wrong in ["", "warning", ":=debug", "a:=", "a:=b:=debug", "10"] {
            assert!(log_level(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn enclaves_are_checked_part_by_part() {
        assert!(is_enclave("/") && is_enclave("/left/lidar_1"));
        for wrong in ["", "a", "/a/", "//a", "/1", "/a-b", "/*"] {
            assert!(!is_enclave(wrong), "{wrong}");
        }
    }
}
