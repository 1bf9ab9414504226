//! Leaving the graph so that peers notice at once.
//!
//! `RustDDS` announces its end without the key hash that Fast DDS looks the participant up by: the
//! node's name goes at once, but its endpoints stay in other nodes' graphs until the lease runs out,
//! tens of seconds later, and a restarted node is seen twice. One more announcement, with the hash,
//! closes the gap.

use std::net::{Ipv4Addr, SocketAddrV4, UdpSocket};

use super::environment::{DiscoveryRange, Environment};
use super::rtps::{self, Data, GuidBytes, Packet};

/// How many participants of this host get it by unicast.
const LOCAL_PARTICIPANTS: u16 = 120;
/// The group on which participants announce themselves (RTPS 2.3, 9.6.1.4.1).
const DISCOVERY_GROUP: Ipv4Addr = Ipv4Addr::new(239, 255, 0, 1);

/// All that must be known before the participant is gone to announce that it is gone.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Farewell {
    participant_guid: GuidBytes,
    domain_id: u16,
    range: DiscoveryRange,
}

impl Farewell {
    /// Returns the farewell of the participant with this GUID.
    #[must_use]
    pub fn new(participant_guid: GuidBytes, environment: &Environment) -> Self {
        Self {
            participant_guid,
            domain_id: environment.domain_id,
            range: environment.discovery_range,
        }
    }

    /// Announces the departure to other participants. To be called after the participant is dropped, or it would
    /// announce itself again. Best effort: a lost packet costs the others the wait for the lease.
    pub fn send(&self) {
        let packet = self.packet();
        let base = 7400 + 250 * u32::from(self.domain_id);
        if let Err(error) = send_to_this_host(&packet, base) {
            log::debug!("could not announce the departure on this host: {error}");
        }
        if self.range == DiscoveryRange::Subnet {
            for address in own_addresses() {
                if let Err(error) = send_to_group(&packet, base, address) {
                    log::debug!("could not announce the departure on {address}: {error}");
                }
            }
        }
    }

    /// Returns one RTPS message with the participant's dispose as SPDP carries it.
    fn packet(&self) -> Vec<u8> {
        Packet::from_participant(&self.participant_guid)
            .data(&Data {
                reader: [0, 1, 0, 0xc7],      // of SPDP
                writer: [0, 1, 0, 0xc2],      // of SPDP
                sequence_number: 0x7fff_ffff, // above all that were sent
                inline_qos: &[
                    (rtps::STATUS_INFO, &[0, 0, 0, 3]), // disposed, unregistered
                    (rtps::KEY_HASH, &self.participant_guid),
                ],
                payload: None,
            })
            .into_bytes()
    }
}

fn send_to_this_host(packet: &[u8], base: u32) -> std::io::Result<()> {
    let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))?;
    let ports = (0..LOCAL_PARTICIPANTS).map(|i| base + 10 + 2 * u32::from(i));
    for port in ports.filter_map(|port| u16::try_from(port).ok()) {
        socket.send_to(packet, SocketAddrV4::new(Ipv4Addr::LOCALHOST, port))?;
    }
    Ok(())
}

fn send_to_group(packet: &[u8], base: u32, from: Ipv4Addr) -> std::io::Result<()> {
    // Bound to an interface's address, Linux sends multicast out of that interface.
    let socket = UdpSocket::bind((from, 0))?;
    if let Ok(port) = u16::try_from(base) {
        socket.send_to(packet, SocketAddrV4::new(DISCOVERY_GROUP, port))?;
    }
    Ok(())
}

fn own_addresses() -> Vec<Ipv4Addr> {
    netdev::get_interfaces()
        .iter()
        .flat_map(|interface| interface.ipv4.iter().map(netdev::ipnet::Ipv4Net::addr))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn farewell_disposes_the_participant_by_its_key_hash() {
        let guid = *b"0123456789ab\0\0\x01\xc1";
        let packet = Farewell::new(guid, &Environment::default()).packet();

        assert_eq!(packet[..4], *b"RTPS");
        assert_eq!(packet[8..20], guid[..12]);
        let length = usize::from(u16::from_le_bytes([packet[22], packet[23]]));
        assert_eq!(
            packet.len(),
            24 + length,
            "the submessage ends with the packet"
        );
        let mut key_hash = vec![0x70, 0, 16, 0];
        key_hash.extend(guid);
        assert!(
            packet
                .windows(key_hash.len())
                .any(|window| window == key_hash)
        );
    }
}
