//! Names as rcl makes them: expanded first, remapped then, absolute at the end.
//!
//! ros2-client gets absolute names only: it turns a relative name in the root namespace into
//! `//name`, and knows neither `~` nor remaps.

#[cfg(feature = "client")]
use ros2_client::{Name, NodeName};
use ros2args::{RemapRule, Ros2ArgsError};

#[cfg(feature = "client")]
use crate::text::line;
use crate::text::quoted;

/// A node's own name with the rules that rename its topics.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NodeNames {
    namespace: String,
    base_name: String,
    rules: Vec<RemapRule>,
}

/// Why a name cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NamesError {
    /// A node name, namespace or topic name that ROS does not allow.
    #[error("{0}")]
    Invalid(Ros2ArgsError),
    /// Allowed by ROS, but not by the client library.
    #[cfg(feature = "client")]
    #[error("{} cannot be used as a name: {}", quoted(name), line(reason))]
    Unsupported {
        /// The expanded name.
        name: String,
        /// The client library's error.
        reason: String,
    },
    /// A remap of an unknown name that begins with two underscores.
    #[error(
        "cannot remap {}: of the names with two underscores only __node, __name and __ns exist",
        quoted(from)
    )]
    UnknownSpecial {
        /// Left side of the rule.
        from: String,
    },
}

impl From<Ros2ArgsError> for NamesError {
    fn from(error: Ros2ArgsError) -> Self {
        Self::Invalid(error)
    }
}

impl NodeNames {
    /// Returns the names of a node that calls itself `default_name` in `/` unless a rule says otherwise.
    ///
    /// # Errors
    /// [`NamesError`] when the node's name, its namespace or a rule is malformed.
    pub fn new(default_name: &str, rules: &[RemapRule]) -> Result<Self, NamesError> {
        if let Some(rule) = rules.iter().find(|rule| is_unknown_special(rule)) {
            return Err(NamesError::UnknownSpecial {
                from: rule.from.clone(),
            });
        }
        let renamed = |node: &str, specials: &[&str]| {
            rules
                .iter()
                .find(|rule| specials.contains(&rule.from.as_str()) && rule.applies_to_node(node))
                .map(|rule| rule.to.clone())
        };
        // The order is rcl's: rules for the namespace are looked up under the new name.
        let base_name =
            renamed(default_name, &["__node", "__name"]).unwrap_or_else(|| default_name.to_owned());
        let namespace = renamed(&base_name, &["__ns"]).unwrap_or_else(|| "/".to_owned());
        ros2args::validate_node_name(&base_name)?;
        ros2args::validate_namespace(&namespace)?;
        let names = Self {
            namespace,
            base_name,
            rules: rules.to_vec(),
        };
        // The parameter services live under the node's name, and their creation panics on a name
        // that the client library does not take.
        #[cfg(feature = "client")]
        names.client_name(&format!("{}/get_parameters", names.fully_qualified()))?;
        for rule in names.topic_rules() {
            names.expand(topic_side(&rule.from))?;
            names.expand(topic_side(&rule.to))?;
        }
        Ok(names)
    }

    /// The node's name without its namespace.
    #[must_use]
    pub fn base_name(&self) -> &str {
        &self.base_name
    }

    /// The node's namespace; `/` is the root.
    #[must_use]
    pub fn namespace(&self) -> &str {
        &self.namespace
    }

    /// Returns the node's absolute name.
    #[must_use]
    pub fn fully_qualified(&self) -> String {
        ros2args::build_node_fqn(&self.namespace, &self.base_name)
    }

    /// Returns the absolute name of a topic (relative, `~/private` or absolute), remapped.
    ///
    /// # Errors
    /// [`NamesError::Invalid`] when it is no valid topic name.
    pub fn topic(&self, name: &str) -> Result<String, NamesError> {
        let expanded = self.expand(name)?;
        for rule in self.topic_rules() {
            if self.expand(topic_side(&rule.from))? == expanded {
                return self.expand(topic_side(&rule.to));
            }
        }
        Ok(expanded)
    }

    #[cfg(feature = "client")]
    /// Returns [`Self::topic`] in the client library's type.
    ///
    /// # Errors
    /// As [`Self::topic`], and [`NamesError::Unsupported`] where the client library is stricter than ROS.
    pub fn client_topic(&self, name: &str) -> Result<Name, NamesError> {
        self.client_name(&self.topic(name)?)
    }

    #[cfg(feature = "client")]
    /// Returns the node's name in the client library's type.
    ///
    /// # Errors
    /// [`NamesError::Unsupported`] where the client library is stricter than ROS.
    pub fn client_node(&self) -> Result<NodeName, NamesError> {
        NodeName::new(&self.namespace, &self.base_name).map_err(|error| NamesError::Unsupported {
            name: self.fully_qualified(),
            reason: error.to_string(),
        })
    }

    #[cfg(feature = "client")]
    #[expect(clippy::unused_self, reason = "reads better next to `client_topic`")]
    fn client_name(&self, absolute: &str) -> Result<Name, NamesError> {
        Name::parse(absolute).map_err(|error| NamesError::Unsupported {
            name: absolute.to_owned(),
            reason: error.to_string(),
        })
    }

    fn expand(&self, name: &str) -> Result<String, NamesError> {
        Ok(ros2args::expand_topic_name(
            &self.namespace,
            &self.base_name,
            name,
        )?)
    }

    fn topic_rules(&self) -> impl Iterator<Item = &RemapRule> {
        self.rules.iter().filter(|rule| {
            let is_for_topics =
                !rule.from.starts_with("__") && !rule.from.starts_with("rosservice://");
            is_for_topics && rule.applies_to_node(&self.base_name)
        })
    }
}

fn topic_side(side: &str) -> &str {
    side.strip_prefix("rostopic://").unwrap_or(side)
}

fn is_unknown_special(rule: &RemapRule) -> bool {
    rule.from.starts_with("__") && !["__node", "__name", "__ns"].contains(&rule.from.as_str())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rule(text: &str) -> RemapRule {
        crate::rules::remap(text).expect("the rule is well formed")
    }

    fn names(rules: &[&str]) -> NodeNames {
        let rules: Vec<_> = rules.iter().map(|text| rule(text)).collect();
        NodeNames::new("sensor_driver", &rules).expect("the rules are valid")
    }

    #[test]
    fn relative_private_and_absolute_names_expand_as_in_rcl() {
        let names = names(&["__ns:=/uav1", "__node:=driver"]);
        assert_eq!(names.fully_qualified(), "/uav1/driver");
        assert_eq!(names.topic("scan").expect("valid"), "/uav1/scan");
        assert_eq!(names.topic("~/scan").expect("valid"), "/uav1/driver/scan");
        assert_eq!(names.topic("/tf").expect("valid"), "/tf");
    }

    #[test]
    fn root_namespace_gives_one_slash() {
        assert_eq!(names(&[]).topic("scan").expect("valid"), "/scan");
    }

    #[test]
    fn namespaced_remap_applies_to_relative_topic() {
        let names = names(&[
            "__ns:=/uav1",
            "scan:=filtered/scan",
            "lidar_info:=/lidar/lidar_info",
        ]);
        assert_eq!(names.topic("scan").expect("valid"), "/uav1/filtered/scan");
        assert_eq!(
            names.topic("lidar_info").expect("valid"),
            "/lidar/lidar_info"
        );
    }

    #[test]
    fn remap_matches_expanded_names_not_texts() {
        let names = names(&["__ns:=/uav1", "/uav1/scan:=a", "/tf:=tf"]);
        assert_eq!(names.topic("scan").expect("valid"), "/uav1/a");
        assert_eq!(names.topic("/tf").expect("valid"), "/uav1/tf");
    }

    #[test]
    fn first_matching_rule_wins_and_is_not_applied_twice() {
        let names = names(&["scan:=status", "scan:=other", "status:=scan"]);
        assert_eq!(names.topic("scan").expect("valid"), "/status");
        assert_eq!(names.topic("status").expect("valid"), "/scan");
    }

    #[test]
    fn rules_for_another_node_do_not_apply() {
        let names = names(&[
            "other:scan:=a",
            "other:__node:=b",
            "sensor_driver:status:=c",
        ]);
        assert_eq!(names.base_name(), "sensor_driver");
        assert_eq!(names.topic("scan").expect("valid"), "/scan");
        assert_eq!(names.topic("status").expect("valid"), "/c");
    }

    #[test]
    fn rostopic_rules_rename_topics_and_rosservice_rules_do_not() {
        let names = names(&[
            "rostopic://scan:=a",
            "rosservice://status:=b",
            "sensor_driver:rostopic://~/points:=c",
            "other:rostopic://status:=d",
        ]);
        assert_eq!(names.topic("scan").expect("valid"), "/a");
        assert_eq!(names.topic("status").expect("valid"), "/status");
        assert_eq!(names.topic("~/points").expect("valid"), "/c");
    }

    #[test]
    fn malformed_names_are_refused_with_a_reason() {
        for wrong in [
            "__ns:=uav1",
            "__ns:=/uav1/",
            "__node:=a/b",
            "__node:=1a",
            "__foo:=b",
        ] {
            let refused = NodeNames::new("sensor_driver", &[rule(wrong)]);
            assert!(refused.is_err(), "{wrong}");
        }
        // Two underscores in a row are allowed by ROS, and would make the client library panic later.
        let doubled = NodeNames::new("sensor_driver", &[rule("__node:=a__b")]);
        assert_eq!(doubled.is_err(), cfg!(feature = "client"));
    }
}
