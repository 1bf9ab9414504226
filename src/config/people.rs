//! The declarations as text: the shipped parameter file, and the tables of a page.

use ros2_node::parameters;

use super::SECTIONS;

const FILE_HEADER: &str = "\
# The node's parameters, and their only list: an unknown one stops the node with its name and line.
# The values here are the defaults. `(fixed)`: cannot be changed while the node runs.
# Written by `tanker_pose parameters --yaml` from the declarations in src/config/table.rs.
";

/// Returns the content of `config/tanker_pose.yaml`.
#[must_use]
pub fn parameter_file() -> String {
    FILE_HEADER.to_owned() + &parameters::parameter_file(SECTIONS)
}

/// Returns the tables of `docs/parameters.md`.
#[must_use]
pub fn parameter_tables() -> String {
    parameters::markdown_tables(SECTIONS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shipped_parameter_file_is_as_declared() {
        let shipped = include_str!("../../config/tanker_pose.yaml");
        let again = "cargo run -- parameters --yaml > /tmp/p.yaml && mv /tmp/p.yaml config/tanker_pose.yaml";
        assert_eq!(shipped, parameter_file(), "write it again: {again}");
    }

    #[test]
    fn page_about_parameters_has_the_tables_as_declared() {
        let page = include_str!("../../docs/parameters.md");
        let (_, after) = page
            .split_once("<!-- tanker_pose parameters --markdown -->\n\n")
            .expect("the page marks where the tables begin");
        let (tables, _) = after
            .split_once("<!-- end -->")
            .expect("the page marks where the tables end");
        assert_eq!(
            tables,
            parameter_tables(),
            "replace them by that command's output"
        );
    }
}
