//! The launcher's end of the control socket: takes requests in threads of its own, so that the launcher only looks.

use crate::ctl::protocol::{Answer, Request, SOCKET};
use anyhow::{Context, Result};
use std::io::{BufRead, BufReader, Write};
use std::net::Shutdown;
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

/// How long a client that does not read may hold the launcher up.
const WRITE_TIMEOUT: Duration = Duration::from_millis(100);
/// Between two attempts to let a client in.
const PAUSE: Duration = Duration::from_millis(100);

/// The open socket of a run; dropping it closes it, and ends the threads that serve it.
pub struct Server {
    requests: Receiver<Asked>,
    listener: Arc<Listener>,
    thread: Option<JoinHandle<()>>,
}

struct Listener {
    socket: UnixListener,
    is_closed: AtomicBool,
}

/// A client, and the thread that reads what it asks.
type Client = (UnixStream, JoinHandle<()>);

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
        let socket = UnixListener::bind(socket_path(&folder)).context("cannot open the control socket")?;
        let listener = Arc::new(Listener { socket, is_closed: AtomicBool::new(false) });
        let accepting = listener.clone();
        let thread = thread().spawn(move || accepting.serve(&remote)).context("cannot start a thread")?;
        Ok(Self { requests, listener, thread: Some(thread) })
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

impl Listener {
    /// Lets clients in until the socket is closed, and then has those that are there leave.
    fn serve(&self, remote: &Remote) {
        let mut clients: Vec<Client> = Vec::new();
        for stream in self.socket.incoming() {
            if self.is_closed.load(Ordering::SeqCst) {
                break;
            }
            clients.retain(|(_, thread)| !thread.is_finished());
            match stream.and_then(|stream| client(stream, remote)) {
                Ok(client) => clients.extend(client),
                // Out of file descriptors, most likely: clients wait until there are some again.
                Err(_) => std::thread::sleep(PAUSE),
            }
        }
        for (stream, thread) in clients {
            // It reads what was asked before, and then the end; answers still get through.
            let _ = stream.shutdown(Shutdown::Read);
            let _ = thread.join();
        }
    }
}

/// Has a thread read what the client at the other end of `stream` asks.
fn client(stream: UnixStream, remote: &Remote) -> std::io::Result<Option<Client>> {
    // Nobody else gets through the run directory; root does everywhere.
    if !is_own_user(&stream) {
        return Ok(None);
    }
    let (requests, sender) = (stream.try_clone()?, remote.0.clone());
    let thread = thread().spawn(move || read_requests(&requests, &sender))?;
    Ok(Some((stream, thread)))
}

fn thread() -> std::thread::Builder {
    std::thread::Builder::new().name("control".to_owned())
}

impl Drop for Server {
    fn drop(&mut self) {
        self.listener.is_closed.store(true, Ordering::SeqCst);
        // Who waits for a client returns with an error.
        let _ = rustix::net::shutdown(&self.listener.socket, rustix::net::Shutdown::Both);
        self.thread.take().map(JoinHandle::join);
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

#[cfg(test)]
mod tests {
    use super::{Remote, Server, socket_path};
    use bus::user_file::open_folder;
    use std::io::Read as _;
    use std::os::unix::net::UnixStream;
    use std::sync::mpsc::channel;

    fn threads() -> usize {
        let tasks = std::fs::read_dir("/proc/self/task").unwrap().flatten();
        let names = tasks.filter_map(|task| std::fs::read_to_string(task.path().join("comm")).ok());
        names.filter(|name| name.trim() == "control").count()
    }

    #[test]
    fn a_socket_that_closes_ends_its_threads_whatever_its_clients_do() {
        let folder = tempfile::tempdir().unwrap();
        let (sender, requests) = channel();
        let server = Server::start(folder.path(), Remote::new(sender), requests).unwrap();
        let connect = || {
            let opened = open_folder(folder.path()).unwrap();
            UnixStream::connect(socket_path(&opened))
        };
        let mut clients: Vec<_> = (0..3).map(|_| connect().unwrap()).collect();
        // One that says nothing, one that has gone, and one that is served.
        drop(clients.pop());
        std::io::Write::write_all(&mut clients[0], b"{\"request\":\"status\"}\n").unwrap();
        while server.poll().is_none() {
            std::thread::yield_now();
        }
        assert!(threads() > 0);
        drop(server);
        assert_eq!(threads(), 0);
        let mut rest = String::new();
        clients[0].read_to_string(&mut rest).unwrap();
        assert!(rest.contains("the run ended first"), "{rest}");
        assert!(connect().is_err());
    }
}
