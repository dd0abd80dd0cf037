//! A firmware that speaks over a stream: a socket at its standard input.

use crate::process::{Firmware, Scratch};
use std::io::{Read, Write};
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::process::Command;
use std::time::Duration;

/// A firmware that runs, and this side of the socket.
#[derive(Debug)]
pub struct Stream {
    firmware: Firmware,
    socket: UnixStream,
    limit: Duration,
}

impl Stream {
    /// Starts `command`; each of its answers is waited for as long as `limit`.
    ///
    /// # Errors
    /// It does not start.
    pub fn start(scratch: Scratch, mut command: Command, limit: Duration) -> Result<Self, String> {
        let pair = UnixStream::pair().and_then(|(socket, other)| {
            socket.set_read_timeout(Some(limit))?;
            socket.set_write_timeout(Some(limit))?;
            Ok((socket, other))
        });
        let (socket, other) = pair.map_err(|error| format!("no socket to {}: {error}", scratch.name()))?;
        command.stdin(OwnedFd::from(other));
        // The command goes with its end of the socket: so the end of the firmware ends the reading.
        let firmware = Firmware::start(scratch, command)?;
        Ok(Self { firmware, socket, limit })
    }

    /// Sets the time that an answer may take.
    ///
    /// # Errors
    /// The socket refuses it.
    pub fn limit(&mut self, limit: Duration) -> Result<(), String> {
        let set = self.socket.set_read_timeout(Some(limit));
        set.and_then(|()| self.socket.set_write_timeout(Some(limit)))
            .map_err(|error| format!("no time limit for the firmware: {error}"))?;
        self.limit = limit;
        Ok(())
    }

    /// Sends `bytes`.
    ///
    /// # Errors
    /// The firmware has ended, or takes nothing.
    pub fn send(&mut self, bytes: &[u8]) -> Result<(), String> {
        let sent = self.socket.write_all(bytes);
        sent.map_err(|error| self.firmware.failed(&error, self.limit))
    }

    /// Fills `bytes` with what the firmware answers.
    ///
    /// # Errors
    /// The firmware has ended, or does not answer.
    pub fn receive(&mut self, bytes: &mut [u8]) -> Result<(), String> {
        let received = self.socket.read_exact(bytes);
        received.map_err(|error| self.firmware.failed(&error, self.limit))
    }

    /// The firmware.
    #[must_use]
    pub fn firmware(&self) -> &Firmware {
        &self.firmware
    }
}
