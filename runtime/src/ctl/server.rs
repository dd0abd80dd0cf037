//! The launcher's end of the control socket: takes requests in threads of its own, so that the launcher only looks.

use crate::ctl::protocol::{Answer, Request, SOCKET};
use anyhow::{Context, Result};
use std::io::{BufRead, BufReader, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Duration;

/// How long a client that does not read may hold the launcher up.
const WRITE_TIMEOUT: Duration = Duration::from_millis(100);
/// Between two attempts to let a client in.
const PAUSE: Duration = Duration::from_millis(100);

/// The open socket of a run.
pub struct Server {
    requests: Receiver<(Request, Reply)>,
}

/// The place of one answer; dropping it without an answer tells the client that the run has ended.
#[derive(Debug)]
pub struct Reply {
    stream: Option<UnixStream>,
}

impl Server {
    /// Opens the socket in `run_dir`, which only this user may enter.
    ///
    /// # Errors
    /// If the socket cannot be made.
    pub fn start(run_dir: &Path) -> Result<Self> {
        let folder = bus::user_file::open_folder(run_dir).context("cannot open the run directory")?;
        let listener = UnixListener::bind(socket_path(&folder)).context("cannot open the control socket")?;
        let (sender, requests) = channel();
        // Both kinds of thread end with the process.
        std::thread::spawn(move || {
            for stream in listener.incoming() {
                let Ok(stream) = stream else {
                    // Out of file descriptors, most likely: clients wait until there are some again.
                    std::thread::sleep(PAUSE);
                    continue;
                };
                // Nobody else gets through the run directory; root does everywhere.
                if !is_own_user(&stream) {
                    continue;
                }
                let sender = sender.clone();
                std::thread::spawn(move || read_requests(&stream, &sender));
            }
        });
        Ok(Self { requests })
    }

    /// The next request, if one has come.
    pub fn poll(&self) -> Option<(Request, Reply)> {
        self.requests.try_recv().ok()
    }
}

/// Whether this user, or root, is at the other end of `stream`.
pub fn is_own_user(stream: &UnixStream) -> bool {
    let peer = rustix::net::sockopt::socket_peercred(stream);
    peer.is_ok_and(|peer| peer.uid.is_root() || peer.uid.as_raw() == bus::process::user_id())
}

/// The socket's path through the open run directory: a socket's own path may have 107 bytes only.
pub fn socket_path(run_dir: &std::fs::File) -> PathBuf {
    use std::os::fd::AsRawFd;
    Path::new("/proc/self/fd").join(run_dir.as_raw_fd().to_string()).join(SOCKET)
}

fn read_requests(stream: &UnixStream, sender: &Sender<(Request, Reply)>) {
    let _ = stream.set_write_timeout(Some(WRITE_TIMEOUT));
    for line in BufReader::new(stream).lines() {
        let (Ok(line), Ok(answers)) = (line, stream.try_clone()) else { return };
        let reply = Reply { stream: Some(answers) };
        match serde_json::from_str(&line) {
            // The launcher that no longer takes requests drops the reply, and so tells the client.
            Ok(request) => drop(sender.send((request, reply))),
            Err(error) => reply.send(&Answer::refused(format!("this is no request: {error}"))),
        }
    }
}

impl Reply {
    /// Answers. A client that has gone away does not hear it.
    pub fn send(mut self, answer: &Answer) {
        write_answer(self.stream.take(), answer);
    }
}

impl Drop for Reply {
    fn drop(&mut self) {
        write_answer(self.stream.take(), &Answer::refused("the run ended first"));
    }
}

fn write_answer(stream: Option<UnixStream>, answer: &Answer) {
    let (Some(mut stream), Ok(mut line)) = (stream, serde_json::to_string(answer)) else { return };
    line.push('\n');
    let _ = stream.write_all(line.as_bytes());
}
