//! The client's end of the control socket.
#![allow(clippy::disallowed_methods, reason = "waiting for a run to come up takes host time")]

use crate::ctl::protocol::{Answer, Request};
use crate::ctl::server::{is_own_user, socket_path};
use crate::program::WATCHDOG;
use crate::run_dir::{LiveRun, is_own_alive, live_runs};
use anyhow::{Context, anyhow, bail};
use bus::plan::Plan;
use bus::user_file;
use diagnostics::Error;
use std::io::{BufRead, BufReader, ErrorKind, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::{Duration, Instant};

/// Longest time from the registration of a run to its socket.
const START: Duration = Duration::from_secs(5);
const POLL: Duration = Duration::from_millis(5);

/// True if a run of this user is alive.
#[must_use]
pub fn is_any_alive() -> bool {
    !live_runs().is_empty()
}

/// Waits until a run is alive that was started in this folder and on this terminal, at most `patience`.
pub fn await_own(patience: Duration) {
    let start = Instant::now();
    while !is_own_alive() && start.elapsed() < patience {
        std::thread::sleep(POLL);
    }
}

/// The backup of `process` on which a swap of `run` waits, with the time that it has. None if its program has connected to the run.
#[must_use]
pub fn awaited_backup(run: &LiveRun, process: &str) -> Option<String> {
    let run_dir = &run.entry.run_dir;
    let plan = Plan::load(run_dir).ok()?;
    let node = plan.nodes.iter().position(|node| node.name == process)?;
    let generation = newest_backup(run_dir, node)?;
    let named = format!(
        "`{process}.{generation}` to join ({} s at most, or its `watchdog_ms_host`)",
        WATCHDOG.as_secs()
    );
    (!bus::claim::is_made(run_dir, process, generation)).then_some(named)
}

/// Generation of the newest backup of `node` that was started, by the plans in `run_dir`.
fn newest_backup(run_dir: &Path, node: usize) -> Option<u32> {
    let prefix = format!("node-{node}.");
    let generation = |name: &str| name.strip_prefix(&prefix)?.strip_suffix(".json")?.parse().ok();
    let files = std::fs::read_dir(run_dir).ok()?.flatten();
    files.filter_map(|file| generation(file.file_name().to_str()?)).max()
}

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

#[cfg(test)]
mod tests {
    use super::newest_backup;

    #[test]
    fn the_newest_backup_is_the_one_of_the_node_with_the_highest_generation() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["node-1.2.json", "node-1.10.json", "node-11.20.json", "node-1.x.json", "plan.json"] {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        let newest = |node| newest_backup(folder.path(), node);
        assert_eq!([newest(1), newest(11), newest(2)], [Some(10), Some(20), None]);
    }
}
