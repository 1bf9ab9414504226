//! The ROS environment variables, checked: ros2-client itself reads none of them.

use std::net::Ipv4Addr;

use super::distribution;

/// The highest domain whose ports fit below 65536; `RustDDS` wraps silently above it.
pub const MAX_DOMAIN_ID: u16 = 232;

/// The range of discovery.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum DiscoveryRange {
    /// All interfaces, by multicast.
    #[default]
    Subnet,
    /// This host only.
    Localhost,
}

impl DiscoveryRange {
    /// Returns the only addresses that may be used; `None` where all may.
    #[must_use]
    pub const fn only_address(self) -> Option<Ipv4Addr> {
        match self {
            Self::Subnet => None,
            Self::Localhost => Some(Ipv4Addr::LOCALHOST),
        }
    }
}

/// How a reply names the request that it answers: what DDS leaves open.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ServiceMapping {
    /// Beside the data, as `rmw_fastrtps` and `rmw_connextdds` do.
    #[default]
    Beside,
    /// In front of the data, as `rmw_cyclonedds` does.
    InFront,
}

/// The checked environment.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Environment {
    /// DDS domain, at most [`MAX_DOMAIN_ID`].
    pub domain_id: u16,
    /// The range of discovery.
    pub discovery_range: DiscoveryRange,
    /// The convention of the clients of services.
    pub service_mapping: ServiceMapping,
    /// Settings that are understood but cannot be honoured, for the log.
    pub warnings: Vec<String>,
}

/// Why the environment cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum EnvironmentError {
    /// No number, or beyond the ports that UDP has.
    #[error(
        "ROS_DOMAIN_ID is {value:?}: expected a whole number from 0 to {MAX_DOMAIN_ID} \
         (the ports of higher domains do not exist)"
    )]
    DomainId {
        /// The value of the variable.
        value: String,
    },
    /// Not one of the two values.
    #[error("ROS_LOCALHOST_ONLY is {value:?}: expected 0 or 1")]
    LocalhostOnly {
        /// The value of the variable.
        value: String,
    },
    /// Not one of the names that ROS knows.
    #[error(
        "ROS_AUTOMATIC_DISCOVERY_RANGE is {value:?}: expected SUBNET, LOCALHOST or SYSTEM_DEFAULT"
    )]
    DiscoveryRange {
        /// The value of the variable.
        value: String,
    },
    /// Discovery switched off altogether.
    #[error(
        "ROS_AUTOMATIC_DISCOVERY_RANGE is OFF: without discovery this node could neither receive \
         others nor be heard; use LOCALHOST to stay on this host"
    )]
    DiscoveryOff,
    /// Security demanded, which this build does not have.
    #[error(
        "ROS_SECURITY_STRATEGY is Enforce, and this node is built without DDS security: \
         refusing to talk in the clear"
    )]
    SecurityEnforced,
    /// Not text.
    #[error("{name} is not valid UTF-8")]
    NotUtf8 {
        /// The variable.
        name: &'static str,
    },
}

impl Environment {
    /// Returns the settings of this process's environment.
    ///
    /// # Errors
    /// [`EnvironmentError`] names the variable, its value, and what was expected.
    pub fn from_process() -> Result<Self, EnvironmentError> {
        Self::from_lookup(|name| match std::env::var(name) {
            Ok(value) => Ok(Some(value)),
            Err(std::env::VarError::NotPresent) => Ok(None),
            Err(std::env::VarError::NotUnicode(_)) => Err(EnvironmentError::NotUtf8 { name }),
        })
    }

    /// Returns the settings of the variables found by `lookup`; an empty variable counts as unset.
    ///
    /// # Errors
    /// As [`Self::from_process`].
    pub fn from_lookup(
        lookup: impl Fn(&'static str) -> Result<Option<String>, EnvironmentError>,
    ) -> Result<Self, EnvironmentError> {
        let get = |name| -> Result<Option<String>, EnvironmentError> {
            Ok(lookup(name)?.filter(|value| !value.is_empty()))
        };
        let domain_id = get("ROS_DOMAIN_ID")?.map_or(Ok(0), |value| parse_domain(&value))?;
        let mut warnings = Vec::new();
        let asked_range = match get("ROS_AUTOMATIC_DISCOVERY_RANGE")?.as_deref() {
            None | Some("SUBNET" | "SYSTEM_DEFAULT") => DiscoveryRange::Subnet,
            Some("LOCALHOST") => DiscoveryRange::Localhost,
            Some("OFF") => return Err(EnvironmentError::DiscoveryOff),
            Some(other) => {
                return Err(EnvironmentError::DiscoveryRange {
                    value: other.to_owned(),
                });
            }
        };
        // As in rcl: the older variable, when it is on, overrules the newer one.
        let discovery_range = match get("ROS_LOCALHOST_ONLY")?.as_deref() {
            None | Some("0") => asked_range,
            Some("1") => DiscoveryRange::Localhost,
            Some(other) => {
                return Err(EnvironmentError::LocalhostOnly {
                    value: other.to_owned(),
                });
            }
        };
        // Not to choose a middleware, which is part of this program, but whom it talks to.
        let mut service_mapping = ServiceMapping::default();
        match get("RMW_IMPLEMENTATION")?.as_deref() {
            None
            | Some("rmw_fastrtps_cpp" | "rmw_fastrtps_dynamic_cpp" | "rmw_connextdds") => {}
            Some("rmw_cyclonedds_cpp") => service_mapping = ServiceMapping::InFront,
            Some("rmw_zenoh_cpp") => warnings.push(
                "RMW_IMPLEMENTATION is rmw_zenoh_cpp, but this node talks DDS: nodes on Zenoh and this one \
                 do not hear each other"
                    .to_owned(),
            ),
            Some(other) => warnings.push(format!(
                "RMW_IMPLEMENTATION is {other}, which is unknown here: topics reach it if it is DDS, services \
                 answer as for rmw_fastrtps_cpp"
            )),
        }
        if get("ROS_SECURITY_ENABLE")?.as_deref() == Some("true") {
            if get("ROS_SECURITY_STRATEGY")?.as_deref() == Some("Enforce") {
                return Err(EnvironmentError::SecurityEnforced);
            }
            warnings.push(
                "ROS_SECURITY_ENABLE is true, but this node is built without DDS security: \
                 it talks in the clear"
                    .to_owned(),
            );
        }
        if let Some(peers) = get("ROS_STATIC_PEERS")? {
            warnings.push(format!(
                "ROS_STATIC_PEERS ({peers}) is not supported and has no effect"
            ));
        }
        if let Some(ros_distro) = get("ROS_DISTRO")? {
            warnings.extend(distribution::mismatch(&ros_distro));
        }
        Ok(Self {
            domain_id,
            discovery_range,
            service_mapping,
            warnings,
        })
    }
}

fn parse_domain(value: &str) -> Result<u16, EnvironmentError> {
    value
        .parse()
        .ok()
        .filter(|domain| *domain <= MAX_DOMAIN_ID)
        .ok_or_else(|| EnvironmentError::DomainId {
            value: value.to_owned(),
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn environment(variables: &[(&str, &str)]) -> Result<Environment, EnvironmentError> {
        Environment::from_lookup(|name| {
            Ok(variables
                .iter()
                .find(|(known, _)| *known == name)
                .map(|(_, value)| (*value).to_owned()))
        })
    }

    #[test]
    fn an_empty_environment_is_domain_zero_on_the_subnet() {
        let found = environment(&[("ROS_DOMAIN_ID", "")]).expect("an empty variable is unset");
        assert_eq!(found, Environment::default());
    }

    #[test]
    fn domains_up_to_232_are_taken_and_233_is_refused() {
        let highest = environment(&[("ROS_DOMAIN_ID", "232")]).expect("232 is the last domain");
        assert_eq!(highest.domain_id, 232);
        for wrong in ["233", "-1", "seven", "1.0", "70000"] {
            assert_eq!(
                environment(&[("ROS_DOMAIN_ID", wrong)]),
                Err(EnvironmentError::DomainId {
                    value: wrong.to_owned()
                })
            );
        }
    }

    #[test]
    fn both_ways_of_asking_for_this_host_only_are_heard() {
        for asked in [
            ("ROS_LOCALHOST_ONLY", "1"),
            ("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST"),
        ] {
            let found = environment(&[asked]).expect("both are documented values");
            assert_eq!(
                found.discovery_range,
                DiscoveryRange::Localhost,
                "{asked:?}"
            );
        }
    }

    #[test]
    fn requests_are_named_as_the_clients_middleware_does_and_others_are_warned_of() {
        let of = |name| environment(&[("RMW_IMPLEMENTATION", name)]).expect("no name is an error");
        for (name, mapping, warnings) in [
            ("rmw_fastrtps_cpp", ServiceMapping::Beside, 0),
            ("rmw_cyclonedds_cpp", ServiceMapping::InFront, 0),
            ("rmw_zenoh_cpp", ServiceMapping::Beside, 1),
            ("rmw_smoke_signals", ServiceMapping::Beside, 1),
        ] {
            let found = of(name);
            assert_eq!(found.service_mapping, mapping, "{name}");
            assert_eq!(found.warnings.len(), warnings, "{:?}", found.warnings);
        }
    }

    #[test]
    fn unknown_values_are_refused_and_named() {
        let wrong = environment(&[("ROS_AUTOMATIC_DISCOVERY_RANGE", "MOON")]);
        assert_eq!(
            wrong,
            Err(EnvironmentError::DiscoveryRange {
                value: "MOON".to_owned()
            })
        );
        let wrong = environment(&[("ROS_LOCALHOST_ONLY", "yes")]);
        assert_eq!(
            wrong,
            Err(EnvironmentError::LocalhostOnly {
                value: "yes".to_owned()
            })
        );
        let off = environment(&[("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")]);
        assert_eq!(off, Err(EnvironmentError::DiscoveryOff));
    }

    #[test]
    fn a_distribution_of_the_other_wire_format_is_warned_of() {
        let other = if cfg!(feature = "humble") {
            "jazzy"
        } else {
            "humble"
        };
        let found = environment(&[("ROS_DISTRO", other)]).expect("it goes on with a warning");
        assert_eq!(
            found.warnings,
            [distribution::mismatch(other).expect("other")]
        );
        let own = environment(&[("ROS_DISTRO", distribution::built_for())]).expect("its own");
        assert_eq!(own, Environment::default());
    }

    #[test]
    fn enforced_security_is_refused_and_permissive_security_warned_of() {
        let enabled = ("ROS_SECURITY_ENABLE", "true");
        let enforced = environment(&[enabled, ("ROS_SECURITY_STRATEGY", "Enforce")]);
        assert_eq!(enforced, Err(EnvironmentError::SecurityEnforced));
        let permissive = environment(&[enabled]).expect("permissive goes on without security");
        assert_eq!(permissive.warnings.len(), 1);
    }
}
