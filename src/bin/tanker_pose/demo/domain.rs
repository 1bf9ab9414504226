//! A DDS domain of the demo's own.

use std::net::{Ipv4Addr, UdpSocket};

use tanker_pose::ros::environment::{DiscoveryRange, Environment};

use super::error::DemoError;

/// Domains whose ports are not ephemeral, above those that users choose.
const FIRST: u16 = 50;
const COUNT: u16 = 50;

/// Returns the environment of both nodes: loopback only, in the chosen domain, or in that of
/// `ROS_DOMAIN_ID`, or in one that is free on this host.
pub fn environment(domain_id: Option<u16>) -> Result<Environment, DemoError> {
    let asked = Environment::from_process()?;
    let is_set = std::env::var_os("ROS_DOMAIN_ID").is_some_and(|value| !value.is_empty());
    let domain_id = match domain_id {
        Some(domain_id) => domain_id,
        None if is_set => asked.domain_id,
        None => free_domain(std::process::id())?,
    };
    Ok(Environment {
        domain_id,
        discovery_range: DiscoveryRange::Localhost,
        ..asked
    })
}

/// Returns a domain whose first participant's port is free. The search begins where `salt` says, so
/// that two demos that start at the same moment do not choose the same.
fn free_domain(salt: u32) -> Result<u16, DemoError> {
    let start = u16::try_from(salt % u32::from(COUNT)).unwrap_or(0);
    (0..COUNT)
        .map(|k| FIRST + (start + k) % COUNT)
        .find(|&domain_id| is_free(domain_id))
        .ok_or(DemoError::NoFreeDomain {
            first: FIRST,
            last: FIRST + COUNT - 1,
        })
}

/// RTPS 2.3, 9.6.1.1: the first participant of a host listens for others at this port.
fn is_free(domain_id: u16) -> bool {
    UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 7400 + 250 * domain_id + 10)).is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_domain_in_use_is_passed_over() {
        let domain_id = free_domain(7).expect("not all of fifty are in use");
        let taken = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 7400 + 250 * domain_id + 10));
        let next = free_domain(7).expect("not all of fifty are in use");
        assert!(taken.is_ok());
        assert_ne!(next, domain_id);
    }
}
