//! The launcher's end of the control socket: takes requests in threads of its own, so that the launcher only looks.

use crate::ctl::protocol::{Answer, Request, SOCKET};
use anyhow::{Context, Result};
use std::io::{BufRead, BufReader, Write};
use std::net::Shutdown;
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Weak};
use std::thread::JoinHandle;
use std::time::Duration;

/// Longest time for which a client that does not read may block the launcher.
const WRITE_TIMEOUT: Duration = Duration::from_millis(100);
/// Time between two attempts to let a client in.
const PAUSE: Duration = Duration::from_millis(100);
/// Requests of one client that may wait for their answers; its next ones are not read before.
const MAX_WAITING: usize = 64;
/// Time between two checks whether a client has fewer of them.
const WAIT: Duration = Duration::from_millis(1);

/// The open socket of a run; dropping it closes it, and ends the threads that serve it.
pub struct Server<'a> {
    requests: &'a Receiver<Asked>,
    listener: Arc<Listener>,
    thread: Option<JoinHandle<()>>,
}

struct Listener {
    socket: UnixListener,
    is_closed: AtomicBool,
}

/// A client, and the thread that reads its requests. The stream belongs to that thread and to the answers that are
/// due, so that it closes behind the last of them.
type Client = (Weak<UnixStream>, JoinHandle<()>);

/// A request, and the place of its answer.
pub type Asked = (Request, Reply);

/// The place of one answer; dropping it without an answer sends the client the message that the run has ended.
#[derive(Debug)]
pub struct Reply(Option<Place>);

#[derive(Debug)]
enum Place {
    /// A client of the socket.
    Stream(Arc<UnixStream>),
    /// A thread of this process.
    Thread(Sender<Answer>),
}

/// Steers a run from another thread of its launcher's process.
///
/// ```
/// use runtime::ctl::protocol::{Answer, Request};
/// use runtime::{host::Host, launcher::Launcher};
/// let launcher = Launcher::new(Host::Threads);
/// let remote = launcher.remote();
/// drop(launcher);
/// let Answer::Refused { reason, .. } = remote.ask(Request::Pause) else { panic!("it flies") };
/// assert_eq!(reason, "the run ended first");
/// ```
#[derive(Clone, Debug)]
pub struct Remote(Sender<Asked>);

impl Remote {
    /// A remote whose requests come out at the other end of `sender`.
    pub(crate) fn new(sender: Sender<Asked>) -> Self {
        Self(sender)
    }

    /// Sends a request to the run, and waits for its answer, which may take as long as the action. A run that has not
    /// begun answers once it flies; one that has ended refuses.
    #[must_use]
    pub fn ask(&self, request: Request) -> Answer {
        let (sender, answer) = channel();
        // A reply that is not taken is dropped, and dropping it answers.
        drop(self.0.send((request, Reply(Some(Place::Thread(sender))))));
        answer.recv().unwrap_or_else(|_| ended())
    }
}

fn ended() -> Answer {
    Answer::refused("the run ended first")
}

impl<'a> Server<'a> {
    /// Opens the socket in `run_dir`, which only this user may enter. Its requests come out with those of `remote`.
    ///
    /// # Errors
    /// If the socket cannot be made.
    pub fn start(run_dir: &Path, remote: Remote, requests: &'a Receiver<Asked>) -> Result<Self> {
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

/// True if this user, or root, is at the other end of `stream`.
pub fn is_own_user(stream: &UnixStream) -> bool {
    let peer = rustix::net::sockopt::socket_peercred(stream);
    peer.is_ok_and(|peer| peer.uid.is_root() || peer.uid.as_raw() == bus::process::user_id())
}

/// The socket's path through the open run directory: a socket's own path may have 107 bytes only.
pub fn socket_path(run_dir: &std::fs::File) -> PathBuf {
    use std::os::fd::AsRawFd;
    Path::new("/proc/self/fd").join(run_dir.as_raw_fd().to_string()).join(SOCKET)
}

impl Listener {
    /// Reads the requests of the client at the other end of `stream`, until it leaves, does not take an answer, or
    /// the socket is closed.
    fn read_requests(&self, stream: &Arc<UnixStream>, sender: &Sender<Asked>) {
        let _ = stream.set_write_timeout(Some(WRITE_TIMEOUT));
        for line in BufReader::new(&**stream).lines() {
            let Ok(line) = line else { return };
            let reply = Reply(Some(Place::Stream(stream.clone())));
            let is_heard = match serde_json::from_str(&line) {
                // The launcher that no longer takes requests drops the reply, and so answers the client.
                Ok(request) => {
                    drop(sender.send((request, reply)));
                    true
                }
                Err(error) => reply.send(&Answer::refused(format!("this is no request: {error}"))),
            };
            while Arc::strong_count(stream) > MAX_WAITING && !self.is_closed() {
                std::thread::sleep(WAIT);
            }
            if !is_heard || self.is_closed() {
                return;
            }
        }
    }

    fn is_closed(&self) -> bool {
        self.is_closed.load(Ordering::SeqCst)
    }

    /// Lets clients in until the socket is closed, and then disconnects the present ones.
    fn serve(self: &Arc<Self>, remote: &Remote) {
        let mut clients: Vec<Client> = Vec::new();
        for stream in self.socket.incoming() {
            if self.is_closed() {
                break;
            }
            clients.retain(|(stream, thread)| stream.strong_count() > 0 || !thread.is_finished());
            match stream.and_then(|stream| self.client(stream, remote)) {
                Ok(client) => clients.extend(client),
                // Out of file descriptors, most likely: clients wait until there are some again.
                Err(_) => std::thread::sleep(PAUSE),
            }
        }
        for (stream, thread) in clients {
            if let Some(stream) = stream.upgrade() {
                // Answers still get through, but wait no more for a client that does not read.
                let _ = stream.set_nonblocking(true);
                let _ = stream.shutdown(Shutdown::Read);
            }
            let _ = thread.join();
        }
    }

    /// Starts a thread that reads the requests of the client at the other end of `stream`.
    fn client(self: &Arc<Self>, stream: UnixStream, remote: &Remote) -> std::io::Result<Option<Client>> {
        // The run directory is closed to other users, except root.
        if !is_own_user(&stream) {
            return Ok(None);
        }
        let stream = Arc::new(stream);
        let (client, listener, sender) = (Arc::downgrade(&stream), self.clone(), remote.0.clone());
        let thread = thread().spawn(move || listener.read_requests(&stream, &sender))?;
        Ok(Some((client, thread)))
    }
}

fn thread() -> std::thread::Builder {
    std::thread::Builder::new().name("control".to_owned())
}

impl Drop for Server<'_> {
    fn drop(&mut self) {
        self.listener.is_closed.store(true, Ordering::SeqCst);
        // A thread that waits for a client returns with an error.
        let _ = rustix::net::shutdown(&self.listener.socket, rustix::net::Shutdown::Both);
        self.thread.take().map(JoinHandle::join);
    }
}

impl Reply {
    /// Answers; whether the client took it. One that has gone away, or does not read, does not.
    pub fn send(mut self, answer: &Answer) -> bool {
        self.answer(answer)
    }

    fn answer(&mut self, answer: &Answer) -> bool {
        match self.0.take() {
            None => true,
            Some(Place::Thread(sender)) => sender.send(answer.clone()).is_ok(),
            Some(Place::Stream(stream)) => {
                let line = serde_json::to_string(answer);
                let is_taken = line.is_ok_and(|line| writeln!(&*stream, "{line}").is_ok());
                if !is_taken {
                    // Its other answers are not waited for.
                    let _ = stream.shutdown(Shutdown::Both);
                }
                is_taken
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
#[allow(clippy::disallowed_methods, reason = "waiting for threads and clients takes host time")]
mod tests {
    use super::{Answer, Asked, Remote, Server, socket_path};
    use bus::user_file::open_folder;
    use std::io::{Read as _, Write as _};
    use std::net::Shutdown;
    use std::os::unix::net::UnixStream;
    use std::path::Path;
    use std::sync::mpsc::channel;
    use std::sync::{Mutex, PoisonError};
    use std::time::{Duration, Instant};

    const STATUS: &str = "{\"request\":\"status\"}\n";

    fn threads() -> usize {
        let tasks = std::fs::read_dir("/proc/self/task").unwrap().flatten();
        let names = tasks.filter_map(|task| std::fs::read_to_string(task.path().join("comm")).ok());
        names.filter(|name| name.trim() == "control").count()
    }

    /// Runs `test` with a server in a folder; one at a time, since a test counts the threads of this process.
    fn with_server(test: impl FnOnce(Server<'_>, &Path)) {
        static ALONE: Mutex<()> = Mutex::new(());
        let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
        let folder = tempfile::tempdir().unwrap();
        let (sender, requests) = channel();
        test(Server::start(folder.path(), Remote::new(sender), &requests).unwrap(), folder.path());
    }

    /// A client that fails rather than waits without end.
    fn connect(folder: &Path) -> std::io::Result<UnixStream> {
        let opened = open_folder(folder).unwrap();
        let client = UnixStream::connect(socket_path(&opened))?;
        client.set_read_timeout(Some(Duration::from_secs(10)))?;
        client.set_write_timeout(Some(Duration::from_secs(1)))?;
        Ok(client)
    }

    /// First result of `look`, or `None` after ten seconds.
    fn await_some<T>(look: impl Fn() -> Option<T>) -> Option<T> {
        let deadline = Instant::now() + Duration::from_secs(10);
        loop {
            let found = look();
            if found.is_some() || Instant::now() > deadline {
                return found;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    fn next(server: &Server) -> Asked {
        await_some(|| server.poll()).expect("a request comes")
    }

    #[test]
    fn a_socket_that_closes_ends_its_threads_whatever_its_clients_do() {
        with_server(|server, folder| {
            let mut clients: Vec<_> = (0..3).map(|_| connect(folder).unwrap()).collect();
            // One that says nothing, one that has gone, and one that is served.
            drop(clients.pop());
            clients[0].write_all(STATUS.as_bytes()).unwrap();
            drop(next(&server));
            assert!(threads() > 0);
            drop(server);
            // A thread that was joined may stand there for a moment.
            await_some(|| (threads() == 0).then_some(()));
            assert_eq!(threads(), 0);
            let mut rest = String::new();
            clients[0].read_to_string(&mut rest).unwrap();
            assert!(rest.contains("the run ended first"), "{rest}");
            assert!(connect(folder).is_err());
        });
    }

    #[test]
    fn a_client_that_floods_and_does_not_read_does_not_hold_up_the_end() {
        for line in ["no request\n", STATUS] {
            with_server(|server, folder| {
                let mut client = connect(folder).unwrap();
                let lines = line.repeat(1000);
                let deadline = Instant::now() + Duration::from_secs(10);
                // Until it is shut out, or nothing more is read.
                while client.write_all(lines.as_bytes()).is_ok() {
                    assert!(Instant::now() < deadline, "all that is written is read: {line}");
                }
                let start = Instant::now();
                drop(server);
                assert!(start.elapsed() < Duration::from_secs(1), "{line}: {:?}", start.elapsed());
            });
        }
    }

    /// The server may close while the flood is still being read.
    #[test]
    fn a_flood_that_is_being_read_does_not_hold_up_the_end() {
        with_server(|server, folder| {
            let mut client = connect(folder).unwrap();
            let mut answers = client.try_clone().unwrap();
            let writer = std::thread::spawn(move || while client.write_all(&[b'\n'; 4096]).is_ok() {});
            answers.read_exact(&mut [0; 1000]).unwrap();
            let start = Instant::now();
            drop(server);
            assert!(start.elapsed() < Duration::from_secs(1), "{:?}", start.elapsed());
            drop(answers);
            writer.join().unwrap();
        });
    }

    #[test]
    fn a_client_meets_the_end_of_file_behind_its_last_answer() {
        with_server(|server, folder| {
            let mut client = connect(folder).unwrap();
            client.write_all(STATUS.as_bytes()).unwrap();
            client.shutdown(Shutdown::Write).unwrap();
            let (_, reply) = next(&server);
            assert!(reply.send(&Answer::refused("not now")));
            let mut answers = String::new();
            client.read_to_string(&mut answers).unwrap();
            assert!(answers.contains("not now") && answers.lines().count() == 1, "{answers}");

            let mut client = connect(folder).unwrap();
            client.write_all(b"\xff\n").unwrap();
            assert_eq!(
                client.read(&mut [0; 100]).unwrap(),
                0,
                "a line that is no text ends the conversation"
            );
        });
    }
}
