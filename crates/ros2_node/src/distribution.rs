//! The ROS 2 distributions that this build talks with, chosen by a feature of the crate.
//!
//! The wire protocol of distributions differs in one place: up to Humble the announcements that name nodes and their
//! endpoints hold identifiers of 24 bytes, since Iron of 16. Topics, services and messages are the same on the wire.

use ros2_client::{COMPILED_ROS_DISTRO, RosDistro};

#[cfg(all(
    feature = "humble",
    any(feature = "jazzy", feature = "kilted", feature = "lyrical")
))]
compile_error!(
    "humble and later distributions name nodes differently on the wire: choose one, \
     as in `cargo build --no-default-features --features humble`"
);
#[cfg(not(any(
    feature = "humble",
    feature = "jazzy",
    feature = "kilted",
    feature = "lyrical"
)))]
compile_error!(
    "no ROS 2 distribution is chosen: add `--features jazzy`, or humble, kilted or lyrical"
);

/// Names of distributions up to Humble, as `ROS_DISTRO` has them.
const BEFORE_IRON: [&str; 7] = [
    "bouncy", "crystal", "dashing", "eloquent", "foxy", "galactic", "humble",
];

/// Returns the name of the distribution that this build is made for.
#[must_use]
pub const fn built_for() -> &'static str {
    COMPILED_ROS_DISTRO.as_str()
}

/// Returns a warning when `ROS_DISTRO` names a distribution whose nodes cannot find this one by its name.
/// Names not known here are taken for later ones.
#[must_use]
pub fn mismatch(ros_distro: &str) -> Option<String> {
    let is_old = BEFORE_IRON.contains(&ros_distro);
    let built_old = COMPILED_ROS_DISTRO < RosDistro::Iron;
    if is_old == built_old {
        return None;
    }
    let feature = if is_old { "humble" } else { "jazzy" };
    Some(format!(
        "ROS_DISTRO is {}, but this build is for {}: topics work, but nodes do not see each other by \
         name; build with --no-default-features --features {feature}",
        crate::text::quoted(ros_distro),
        built_for()
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn identifiers_have_the_length_of_the_chosen_distribution() {
        let length = if cfg!(feature = "humble") { 24 } else { 16 };
        assert_eq!(size_of::<ros2_client::Gid>(), length);
    }

    #[test]
    fn the_newest_chosen_distribution_is_the_one_built_for() {
        let expected = if cfg!(feature = "lyrical") {
            "lyrical"
        } else if cfg!(feature = "kilted") {
            "kilted"
        } else if cfg!(feature = "jazzy") {
            "jazzy"
        } else {
            "humble"
        };
        assert_eq!(built_for(), expected);
        assert_eq!(mismatch(expected), None);
    }

    #[test]
    fn only_distributions_of_the_other_format_are_warned_of() {
        let old = cfg!(feature = "humble");
        for same_as_humble in ["humble", "galactic", "foxy"] {
            assert_eq!(mismatch(same_as_humble).is_some(), !old, "{same_as_humble}");
        }
        for later in [
            "iron",
            "jazzy",
            "kilted",
            "lyrical",
            "rolling",
            "of the future",
        ] {
            let warning = mismatch(later);
            assert_eq!(warning.is_some(), old, "{later}");
            if let Some(warning) = warning {
                assert!(warning.contains(later) && warning.contains("--features jazzy"));
            }
        }
    }
}
