//! A firmware that speaks by datagrams (UDP) over the loopback, with one peer: the first that sends to this socket.

use crate::process::{Firmware, Scratch, is_silence};
use std::io;
use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::process::Command;
use std::time::Duration;

/// Time between two looks at the firmware while an answer is waited for: the end of a process does not end the wait for a datagram.
const LOOK: Duration = Duration::from_millis(20);
/// Longest datagram that is told from longer ones.
const LENGTH_MAX: usize = 2048;

/// A socket of the loopback with a port of its own.
///
/// # Errors
/// There is none.
pub fn bound() -> io::Result<UdpSocket> {
    UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))
}

/// Ports of the loopback that are free, all different: for a firmware that is told its ports.
///
/// # Errors
/// There are none.
pub fn free_ports<const N: usize>() -> io::Result<[u16; N]> {
    // All of them are held until the last one is known.
    let mut sockets = Vec::new();
    let mut ports = [0; N];
    for port in &mut ports {
        let socket = bound()?;
        *port = socket.local_addr()?.port();
        sockets.push(socket);
    }
    Ok(ports)
}

/// A firmware that runs, and the socket to which it sends.
#[derive(Debug)]
pub struct Datagrams {
    firmware: Firmware,
    socket: UdpSocket,
    /// The firmware's address, from its first datagram on.
    peer: Option<SocketAddr>,
    limit: Duration,
}

impl Datagrams {
    /// Starts `command`, which sends to `socket`; each of its answers is waited for as long as `limit`.
    ///
    /// # Errors
    /// It does not start.
    pub fn start(
        scratch: Scratch,
        command: Command,
        socket: UdpSocket,
        limit: Duration,
    ) -> Result<Self, String> {
        let waits = socket.set_read_timeout(Some(limit.min(LOOK)));
        waits.map_err(|error| format!("no socket to {}: {error}", scratch.name()))?;
        Ok(Self { firmware: Firmware::start(scratch, command)?, socket, peer: None, limit })
    }

    /// Sends `bytes`.
    ///
    /// # Errors
    /// The firmware has ended, or has not sent yet.
    pub fn send(&mut self, bytes: &[u8]) -> Result<(), String> {
        let sent = self.socket.send(bytes);
        sent.map(|_| ()).map_err(|error| self.firmware.failed(&error, self.limit))
    }

    /// Waits for the firmware's next datagram that `read` takes; those for which it returns `None` are dropped.
    ///
    /// # Errors
    /// The firmware has ended, or does not answer, or `read` refuses a datagram.
    pub fn receive<T>(&mut self, read: impl Fn(&[u8]) -> Result<Option<T>, String>) -> Result<T, String> {
        let mut bytes = [0; LENGTH_MAX];
        let mut looks = self.limit.as_micros().div_ceil(LOOK.as_micros());
        while looks > 0 {
            // Only silence counts: datagrams that piled up while the run was paused are dropped in no time.
            match self.next(&mut bytes) {
                Ok(None) => {}
                Ok(Some(length)) => {
                    let taken = read(&bytes[..length]).map_err(|words| self.firmware.complaint(&words))?;
                    if let Some(taken) = taken {
                        return Ok(taken);
                    }
                }
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) if is_silence(&error) => {
                    looks -= 1;
                    if let Some(words) = self.firmware.ended() {
                        return Err(words);
                    }
                }
                Err(error) => return Err(self.firmware.failed(&error, self.limit)),
            }
        }
        Err(self.firmware.silence(self.limit))
    }

    /// Length of the next datagram; `None` if another process has sent it.
    fn next(&mut self, bytes: &mut [u8]) -> io::Result<Option<usize>> {
        let (length, sender) = self.socket.recv_from(bytes)?;
        let peer = match self.peer {
            Some(peer) => peer,
            None => {
                // From now on the system drops the datagrams of others. Those that are here already are dropped below.
                self.socket.connect(sender)?;
                *self.peer.insert(sender)
            }
        };
        Ok((sender == peer).then_some(length))
    }

    /// The firmware.
    #[must_use]
    pub fn firmware(&self) -> &Firmware {
        &self.firmware
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A firmware that sleeps, and the socket that it would send to.
    fn sleeping(limit: Duration) -> (Datagrams, SocketAddr) {
        let socket = bound().unwrap();
        let address = socket.local_addr().unwrap();
        let scratch = Scratch::new("sleep").unwrap();
        let mut command = scratch.command("/bin/sleep".as_ref()).unwrap();
        command.arg("60");
        (Datagrams::start(scratch, command, socket, limit).unwrap(), address)
    }

    fn any(bytes: &[u8]) -> Result<Option<Vec<u8>>, String> {
        Ok(Some(bytes.to_vec()))
    }

    #[test]
    fn datagrams_of_others_than_the_first_sender_are_dropped() {
        let (mut datagrams, address) = sleeping(Duration::from_millis(100));
        let [firmware, other] = [bound().unwrap(), bound().unwrap()];
        // The second one is here before the first one is read.
        firmware.send_to(b"first", address).unwrap();
        other.send_to(b"other", address).unwrap();
        assert_eq!(datagrams.receive(any).unwrap(), b"first");
        let _ = other.send_to(b"other", address);
        firmware.send_to(b"second", address).unwrap();
        assert_eq!(datagrams.receive(any).unwrap(), b"second");
        datagrams.send(b"answer").unwrap();
        let mut bytes = [0; 16];
        assert_eq!(firmware.recv(&mut bytes).unwrap(), 6);
        let error = datagrams.receive(any).unwrap_err();
        assert!(error.contains("sleep runs and gave no answer for 0.1 s"), "{error}");
    }

    #[test]
    fn what_is_refused_and_what_is_dropped() {
        let (mut datagrams, address) = sleeping(Duration::from_secs(5));
        let firmware = bound().unwrap();
        for bytes in [b"drop", b"drop", b"take", b"fail"] {
            firmware.send_to(bytes, address).unwrap();
        }
        let read = |bytes: &[u8]| match bytes {
            b"drop" => Ok(None),
            b"fail" => Err("it fails".to_owned()),
            _ => Ok(Some(())),
        };
        datagrams.receive(read).unwrap();
        let error = datagrams.receive(read).unwrap_err();
        assert!(error.starts_with("it fails; sleep printed nothing"), "{error}");
    }

    /// A firmware sends its last packet again every second while the run is paused.
    #[test]
    fn datagrams_that_piled_up_cost_no_time() {
        let (mut datagrams, address) = sleeping(Duration::from_millis(100));
        let firmware = bound().unwrap();
        for _ in 0..100 {
            firmware.send_to(b"drop", address).unwrap();
        }
        firmware.send_to(b"take", address).unwrap();
        datagrams.receive(|bytes| Ok((bytes == b"take").then_some(()))).unwrap();
    }

    #[test]
    fn free_ports_are_different() {
        let [first, second, third] = free_ports().unwrap();
        assert!(first != second && second != third && first != third, "{first} {second} {third}");
    }
}
