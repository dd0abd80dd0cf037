//! The firmware's remote control: datagrams of 16 pulses, little-endian, to a port of its own (`AP_RCProtocol_UDP.cpp`).
//!
//! The firmware reads this port, and does not wait for it, while it takes an answer. So the pulses of a tick are sent before the
//! answer: they are then there when the firmware looks for them. Since July 2025, the answer can hold up to 12 channels as well; all
//! versions have the port.

use crate::rest::pulse_us;
use bus::messages::RcChannels;
use std::net::{Ipv4Addr, SocketAddr, UdpSocket};

/// Channels of the datagram.
pub const CHANNELS: usize = 16;

/// The sender of the pulses.
#[derive(Debug)]
pub struct RemoteControl {
    socket: UdpSocket,
    to: SocketAddr,
}

impl RemoteControl {
    /// A sender to the port `port`, from `socket`.
    #[must_use]
    pub fn new(socket: UdpSocket, port: u16) -> Self {
        Self { socket, to: SocketAddr::from((Ipv4Addr::LOCALHOST, port)) }
    }

    /// Sends the channels; a firmware that has not opened its port yet does not get them.
    ///
    /// # Errors
    /// The system does not take the datagram.
    pub fn send(&self, rc: &RcChannels) -> Result<(), String> {
        let sent = self.socket.send_to(&datagram(rc), self.to);
        sent.map(|_| ()).map_err(|error| format!("no remote control to ardupilot: {error}"))
    }
}

/// The datagram of the channels.
fn datagram(rc: &RcChannels) -> [u8; 2 * CHANNELS] {
    let mut bytes = [0; 2 * CHANNELS];
    for (channel, bytes) in bytes.chunks_exact_mut(2).enumerate() {
        bytes.copy_from_slice(&pulse_us(rc, channel).to_le_bytes());
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::datagrams::bound;

    #[test]
    fn pulses_reach_the_port() {
        let rc =
            RcChannels { pulse: [1500.4, 1500.6, 900.0, 1100.0, 2000.0].into(), ..RcChannels::default() };
        let firmware = bound().unwrap();
        let port = firmware.local_addr().unwrap().port();
        RemoteControl::new(bound().unwrap(), port).send(&rc).unwrap();
        let mut bytes = [0; 64];
        let length = firmware.recv(&mut bytes).unwrap();
        let pulses: Vec<u16> =
            bytes[..length].chunks_exact(2).map(|bytes| u16::from_le_bytes([bytes[0], bytes[1]])).collect();
        assert_eq!(pulses.len(), 16);
        assert_eq!(pulses[..6], [1500, 1501, 900, 1100, 2000, 1000], "a switch that is not sent is off");
    }

    #[test]
    fn a_port_that_is_not_open_yet_is_no_failure() {
        let port = bound().unwrap().local_addr().unwrap().port();
        let remote_control = RemoteControl::new(bound().unwrap(), port);
        for _ in 0..3 {
            remote_control.send(&RcChannels::default()).unwrap();
        }
    }
}
