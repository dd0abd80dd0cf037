//! The client's end of the control socket.
#![allow(clippy::disallowed_methods, reason = "waiting for a run to come up takes host time")]

use crate::ctl::protocol::{Answer, Request};
use crate::ctl::server::{is_own_user, socket_path};
use crate::run_dir::LiveRun;
use anyhow::{Context, anyhow, bail};
use bus::user_file;
use diagnostics::Error;
use std::io::{BufRead, BufReader, ErrorKind, Write};
use std::os::unix::net::UnixStream;
use std::time::{Duration, Instant};

/// Longest time from the registration of a run to its socket.
const START: Duration = Duration::from_secs(5);
const POLL: Duration = Duration::from_millis(5);

/// Sends `request` to `run`, and waits for its answer, which may take as long as the action.
///
/// # Errors
/// If the run has ended.
pub fn ask(run: &LiveRun, request: &Request) -> Result<Answer, Error> {
    Ok(answer(run, request)?)
}

fn answer(run: &LiveRun, request: &Request) -> anyhow::Result<Answer> {
    let run_id = &run.entry.run_id;
    let mut stream = connect(run).map_err(|error| refused(run, error))?;
    let mut line = serde_json::to_string(request)?;
    line.push('\n');
    stream.write_all(line.as_bytes()).with_context(|| format!("run {run_id} has ended"))?;
    let mut answer = String::new();
    BufReader::new(stream).read_line(&mut answer).with_context(|| format!("run {run_id} has ended"))?;
    if answer.is_empty() {
        bail!("run {run_id} ended before it answered");
    }
    serde_json::from_str(&answer)
        .with_context(|| format!("run {run_id} gave an answer of another version of hummingbus: {answer}"))
}

/// Reason why `run` takes no request.
fn refused(run: &LiveRun, error: std::io::Error) -> anyhow::Error {
    let run_id = &run.entry.run_id;
    if !run.is_live() {
        return anyhow!("run {run_id} has ended");
    }
    if error.kind() == ErrorKind::NotFound {
        return anyhow!(
            "run {run_id} takes no requests: it flies on one thread (--in-process); Ctrl-C in its terminal ends it"
        );
    }
    anyhow::Error::new(error).context(format!("cannot ask run {run_id}"))
}

/// Connects to `run`, which may just be starting.
fn connect(run: &LiveRun) -> std::io::Result<UnixStream> {
    let start = Instant::now();
    loop {
        let folder = user_file::open_folder(&run.entry.run_dir);
        let stream =
            folder.and_then(|folder| UnixStream::connect(socket_path(&folder))).and_then(of_own_user);
        if stream.is_ok() || !run.is_live() || start.elapsed() > START {
            return stream;
        }
        std::thread::sleep(POLL);
    }
}

/// `stream`, if this user is at its other end.
fn of_own_user(stream: UnixStream) -> std::io::Result<UnixStream> {
    if is_own_user(&stream) { Ok(stream) } else { Err(std::io::Error::other("another user answers there")) }
}
