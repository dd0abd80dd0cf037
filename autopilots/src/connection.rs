//! A firmware that connects to this process by TCP over the loopback, and speaks in messages of a byte stream.

use crate::process::{Firmware, Scratch, is_silence};
use std::io::{self, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::process::Command;
use std::time::Duration;

/// Time between two looks at the firmware while it is waited for.
const LOOK: Duration = Duration::from_millis(20);
/// Reads without the awaited message that count as silence: a firmware may send others without an end.
const READS_MAX: usize = 10_000;
/// Bytes of a read.
const CHUNK: usize = 4096;

/// A firmware that runs, and its connection.
#[derive(Debug)]
pub struct Connection {
    // The order of the fields is the order of their end: the port is held until the firmware that knows it has ended.
    firmware: Firmware,
    stream: TcpStream,
    _listener: TcpListener,
    /// Bytes that are received and not yet read.
    buffer: Vec<u8>,
    limit: Duration,
}

impl Connection {
    /// Starts `command`, which connects to `listener` within `connects_within`; what is sent is taken within `limit`.
    ///
    /// # Errors
    /// It does not start, or ends, or does not connect.
    pub fn start(
        scratch: Scratch,
        command: Command,
        listener: TcpListener,
        connects_within: Duration,
        limit: Duration,
    ) -> Result<Self, String> {
        let name = scratch.name();
        let mut firmware = Firmware::start(scratch, command)?;
        let stream = accepted(&mut firmware, &listener, connects_within)?;
        let prepared = stream
            .set_nonblocking(false)
            .and_then(|()| stream.set_nodelay(true))
            .and_then(|()| stream.set_read_timeout(Some(LOOK)))
            .and_then(|()| stream.set_write_timeout(Some(limit)));
        prepared.map_err(|error| format!("no connection to {name}: {error}"))?;
        Ok(Self { firmware, stream, _listener: listener, buffer: Vec::new(), limit })
    }

    /// Sends `bytes`.
    ///
    /// # Errors
    /// The firmware has ended, or takes nothing.
    pub fn send(&mut self, bytes: &[u8]) -> Result<(), String> {
        let sent = self.stream.write_all(bytes);
        sent.map_err(|error| self.firmware.failed(&error, self.limit))
    }

    /// Waits for the next message that `read` finds in the bytes received so far and removes from them; `None` if there is none
    /// within `limit`.
    ///
    /// # Errors
    /// The firmware has ended, or `read` refuses a message.
    pub fn receive<T>(
        &mut self,
        limit: Duration,
        mut read: impl FnMut(&mut Vec<u8>) -> Result<Option<T>, String>,
    ) -> Result<Option<T>, String> {
        let mut looks = limit.as_micros().div_ceil(LOOK.as_micros());
        for _ in 0..READS_MAX {
            let found = read(&mut self.buffer).map_err(|words| self.firmware.complaint(&words))?;
            if found.is_some() || looks == 0 {
                return Ok(found);
            }
            if !self.has_more()? {
                looks -= 1;
            }
        }
        Ok(None)
    }

    /// Waits for bytes; false if none came within [`LOOK`].
    fn has_more(&mut self) -> Result<bool, String> {
        let mut chunk = [0; CHUNK];
        let received = match self.stream.read(&mut chunk) {
            Ok(0) => Err(io::ErrorKind::UnexpectedEof.into()),
            received => received,
        };
        match received {
            Ok(length) => self.buffer.extend_from_slice(&chunk[..length]),
            // A process that was stopped and goes on (SIGSTOP, SIGCONT).
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) if is_silence(&error) => return self.firmware.ended().map_or(Ok(false), Err),
            Err(error) => return Err(self.firmware.failed(&error, self.limit)),
        }
        Ok(true)
    }

    /// The firmware.
    #[must_use]
    pub fn firmware(&self) -> &Firmware {
        &self.firmware
    }
}

/// The firmware's connection.
fn accepted(firmware: &mut Firmware, listener: &TcpListener, within: Duration) -> Result<TcpStream, String> {
    let no_connection = |error: io::Error| format!("no connection to the firmware: {error}");
    listener.set_nonblocking(true).map_err(no_connection)?;
    for _ in 0..within.as_micros().div_ceil(LOOK.as_micros()) {
        match listener.accept() {
            Ok((stream, _)) => return Ok(stream),
            Err(error) if is_silence(&error) => {}
            Err(error) => return Err(no_connection(error)),
        }
        if let Some(words) = firmware.ended() {
            return Err(words);
        }
        std::thread::sleep(LOOK);
    }
    let port = listener.local_addr().map_err(no_connection)?.port();
    let seconds = within.as_secs_f64();
    Err(firmware.complaint(&format!("it has not connected to the port {port} within {seconds} s")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::Ipv4Addr;

    /// A firmware that sleeps, and the connection that this test has made in its place.
    fn sleeping() -> (Connection, TcpStream) {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        let other = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
        let limit = Duration::from_millis(100);
        (Connection::start(scratch(), command(), listener, limit, limit).unwrap(), other)
    }

    fn scratch() -> Scratch {
        Scratch::new("sleep").unwrap()
    }

    fn command() -> Command {
        let mut command = scratch().command("/bin/sleep".as_ref()).unwrap();
        command.arg("60").current_dir("/");
        command
    }

    /// Two bytes that belong together.
    fn pair(bytes: &mut Vec<u8>) -> Result<Option<[u8; 2]>, String> {
        if bytes.first() == Some(&b'!') {
            return Err("it fails".to_owned());
        }
        Ok((bytes.len() >= 2).then(|| [bytes.remove(0), bytes.remove(0)]))
    }

    #[test]
    fn messages_are_found_in_pieces_and_in_heaps() {
        let (mut connection, mut other) = sleeping();
        let limit = Duration::from_millis(100);
        other.write_all(b"a").unwrap();
        assert_eq!(connection.receive(limit, pair).unwrap(), None, "a half of a message");
        other.write_all(b"bcdef").unwrap();
        let found: Vec<_> = (0..4).map(|_| connection.receive(limit, pair).unwrap()).collect();
        assert_eq!(found, [Some(*b"ab"), Some(*b"cd"), Some(*b"ef"), None]);
        connection.send(b"answer").unwrap();
        let mut bytes = [0; 6];
        other.read_exact(&mut bytes).unwrap();
        assert_eq!(&bytes, b"answer");
        other.write_all(b"!").unwrap();
        let error = connection.receive(limit, pair).unwrap_err();
        assert!(error.starts_with("it fails; sleep printed nothing"), "{error}");
    }

    #[test]
    fn a_firmware_that_never_connects_is_told() {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        let port = listener.local_addr().unwrap().port();
        let limit = Duration::from_millis(50);
        let error = Connection::start(scratch(), command(), listener, limit, limit).unwrap_err();
        assert!(error.contains(&format!("connected to the port {port} within 0.05 s")), "{error}");
    }
}
