//! The launcher's end of the control socket: takes requests in threads of its own, so that the launcher only looks.

use crate::ctl::protocol::{Answer, Request, SOCKET};
use anyhow::{Context, Result};
use std::fs::File;
use std::io::{BufRead, BufReader, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Duration;

/// How long a client that does not read may hold the launcher up.
const WRITE_TIMEOUT: Duration = Duration::from_millis(100);
/// Between two attempts to let a client in.
const PAUSE: Duration = Duration::from_millis(100);

/// The open socket of a run; dropping it closes it.
pub struct Server {
    requests: Receiver<Asked>,
    folder: File,
    is_closed: Arc<AtomicBool>,
}

/// A request, and where its answer goes.
pub type Asked = (Request, Reply);

/// The place of one answer; dropping it without an answer tells the client that the run has ended.
#[derive(Debug)]
pub struct Reply(Option<Place>);

#[derive(Debug)]
enum Place {
    /// A client of the socket.
    Stream(UnixStream),
    /// A thread of this process.
    Thread(Sender<Answer>),
}

/// Steers a run from another thread of its launcher's process.
#[derive(Clone, Debug)]
pub struct Remote(Sender<Asked>);

impl Remote {
    /// A remote whose requests come out at the other end of `sender`.
    pub(crate) fn new(sender: Sender<Asked>) -> Self {
        Self(sender)
    }

    /// Asks the run, and waits for its answer, which may take as long as what is asked. A run that has not begun
    /// answers once it flies; one that has ended refuses.
    #[must_use]
    pub fn ask(&self, request: Request) -> Answer {
        let (sender, answer) = channel();
        // A reply that nobody takes is dropped, and answers by that.
        drop(self.0.send((request, Reply(Some(Place::Thread(sender))))));
        answer.recv().unwrap_or_else(|_| ended())
    }
}

fn ended() -> Answer {
    Answer::refused("the run ended first")
}

impl Server {
    /// Opens the socket in `run_dir`, which only this user may enter. Its requests come out with those of `remote`.
    ///
    /// # Errors
    /// If the socket cannot be made.
    pub fn start(run_dir: &Path, remote: Remote, requests: Receiver<Asked>) -> Result<Self> {
        let folder = bus::user_file::open_folder(run_dir).context("cannot open the run directory")?;
        let listener = UnixListener::bind(socket_path(&folder)).context("cannot open the control socket")?;
        let is_closed = Arc::new(AtomicBool::new(false));
        let flag = is_closed.clone();
        // Those that serve a client end when it leaves.
        std::thread::spawn(move || {
            for stream in listener.incoming() {
                if flag.load(Ordering::SeqCst) {
                    return;
                }
                let Ok(stream) = stream else {
                    // Out of file descriptors, most likely: clients wait until there are some again.
                    std::thread::sleep(PAUSE);
                    continue;
                };
                // Nobody else gets through the run directory; root does everywhere.
                if !is_own_user(&stream) {
                    continue;
                }
                let sender = remote.0.clone();
                std::thread::spawn(move || read_requests(&stream, &sender));
            }
        });
        Ok(Self { requests, folder, is_closed })
    }

    /// The next request, if one has come.
    pub fn poll(&self) -> Option<Asked> {
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

fn read_requests(stream: &UnixStream, sender: &Sender<Asked>) {
    let _ = stream.set_write_timeout(Some(WRITE_TIMEOUT));
    for line in BufReader::new(stream).lines() {
        let (Ok(line), Ok(answers)) = (line, stream.try_clone()) else { return };
        let reply = Reply(Some(Place::Stream(answers)));
        match serde_json::from_str(&line) {
            // The launcher that no longer takes requests drops the reply, and so tells the client.
            Ok(request) => drop(sender.send((request, reply))),
            Err(error) => reply.send(&Answer::refused(format!("this is no request: {error}"))),
        }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.is_closed.store(true, Ordering::SeqCst);
        // The listener waits for somebody: this one has it look.
        let _ = UnixStream::connect(socket_path(&self.folder));
    }
}

impl Reply {
    /// Answers. A client that has gone away does not hear it.
    pub fn send(mut self, answer: &Answer) {
        self.answer(answer);
    }

    fn answer(&mut self, answer: &Answer) {
        match self.0.take() {
            None => {}
            Some(Place::Thread(sender)) => drop(sender.send(answer.clone())),
            Some(Place::Stream(mut stream)) => {
                if let Ok(line) = serde_json::to_string(answer) {
                    let _ = writeln!(stream, "{line}");
                }
            }
        }
    }
}

impl Drop for Reply {
    fn drop(&mut self) {
        self.answer(&ended());
    }
}
