//! A folder of its own for each test, launches under a watchdog, and what a run left behind.
#![allow(clippy::disallowed_methods, reason = "a watchdog measures host time")]

use bus::lockstep::SupervisorView;
use bus::plan::Plan;
use rustix::process::{Pid, Signal, kill_process};
use std::cell::RefCell;
use std::fs::{self, File};
use std::io::{BufRead, BufReader, Write};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

pub const HUMMINGBUS: &str = env!("CARGO_BIN_EXE_hummingbus");
/// A deadlock's end: no launch here needs a tenth of it on an idle machine.
const WATCHDOG: Duration = Duration::from_secs(300);
const POLL: Duration = Duration::from_millis(2);
/// Arguments of a run that no test outlasts.
pub const ENDLESS: [&str; 4] = ["--pace", "realtime", "--set", "run.duration_s=4000000"];

/// A path in this repository.
pub fn repository(path: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path).to_string_lossy().into_owned()
}

/// Returns the path of the recording of a broken run, which must not have taken the place of `recording` itself.
#[track_caller]
pub fn partial(recording: &str) -> String {
    assert!(!Path::new(recording).exists(), "a broken run has put its recording into its place");
    format!("{}.partial.mcap", recording.strip_suffix(".mcap").unwrap())
}

/// A test's own folder, with a folder for temporary files that marks every process launched from it.
pub struct Place {
    folder: tempfile::TempDir,
    launchers: RefCell<Vec<u32>>,
}

impl Place {
    pub fn new() -> Self {
        let place = Self { folder: tempfile::tempdir().unwrap(), launchers: RefCell::default() };
        fs::create_dir(place.temporary()).unwrap();
        place
    }

    /// The path of a file of this test.
    pub fn path(&self, name: &str) -> String {
        self.folder.path().join(name).to_string_lossy().into_owned()
    }

    /// Writes a file of this test and returns its path.
    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) -> String {
        let path = self.path(name);
        fs::write(&path, content).unwrap();
        path
    }

    fn temporary(&self) -> PathBuf {
        self.folder.path().join("tmp")
    }

    /// Starts `hummingbus` with `args`.
    pub fn start(&self, args: &[&str]) -> Launch<'_> {
        self.start_with(args, &[])
    }

    /// Starts `hummingbus` with `args`, a run at real time that lasts until it is ended, however loaded the machine is.
    pub fn start_endless(&self, args: &[&str]) -> Launch<'_> {
        self.start(&[args, &ENDLESS].concat())
    }

    /// Starts `hummingbus` with `args` and more environment variables.
    pub fn start_with(&self, args: &[&str], variables: &[(&str, &str)]) -> Launch<'_> {
        let mut command = Command::new(HUMMINGBUS);
        command.args(args).envs(variables.iter().copied());
        self.launch(command)
    }

    /// Starts `command`, which is or becomes a `hummingbus`, as one of this folder.
    pub fn launch(&self, mut command: Command) -> Launch<'_> {
        let output = tempfile::NamedTempFile::new_in(self.folder.path()).unwrap().into_temp_path();
        let error = tempfile::NamedTempFile::new_in(self.folder.path()).unwrap().into_temp_path();
        let child = self
            .mark(&mut command)
            .stdin(Stdio::null())
            .stdout(File::create(&output).unwrap())
            .stderr(File::create(&error).unwrap())
            .spawn()
            .unwrap();
        self.launchers.borrow_mut().push(child.id());
        let args: Vec<_> = command.get_args().map(|word| word.to_string_lossy()).collect();
        Launch { place: self, child, args: args.join(" "), output, error, status: None }
    }

    /// Gives `command` the environment of this test, by which its processes are known.
    pub fn mark<'a>(&self, command: &'a mut Command) -> &'a mut Command {
        command.env("TMPDIR", self.temporary()).env("RUST_BACKTRACE", "0").env_remove("HUMMINGBUS_DATA")
    }

    /// Runs `hummingbus` with `args` to its end; it must leave nothing behind.
    pub fn call(&self, args: &[&str]) -> Ended {
        self.start(args).end()
    }

    /// The processes launched from this folder that live: their ids, with the names of their nodes.
    pub fn processes(&self) -> Vec<(Pid, String)> {
        let mark = format!("TMPDIR={}", self.temporary().display());
        let entries = fs::read_dir("/proc").unwrap().flatten();
        entries.filter_map(|entry| marked_process(&entry.path(), &mark)).collect()
    }

    /// The process of node `node`, once it has come up.
    pub fn process_of(&self, node: &str) -> Pid {
        poll(&format!("no process of node {node}"), || {
            self.processes().into_iter().find(|(_, name)| name == node).map(|(pid, _)| pid)
        })
    }

    /// The process of a generation of node `node`, once it has come up; it may have been stopped or be on its way out.
    pub fn process_of_generation(&self, node: &str, generation: u32) -> Pid {
        let mark = format!("HUMMINGBUS_GENERATION={generation}");
        poll(&format!("no process {generation} of node {node}"), || {
            let of_node = self.processes().into_iter().filter(|(_, name)| name == node);
            of_node.map(|(pid, _)| pid).find(|pid| environment(*pid).contains(&mark))
        })
    }

    /// The process of the clock service, once it has come up.
    pub fn clock(&self) -> Pid {
        self.process_of_kind("clock")
    }

    /// The process of the run's only group, once it has come up.
    pub fn group(&self) -> Pid {
        self.process_of_kind("group")
    }

    fn process_of_kind(&self, kind: &str) -> Pid {
        let end = format!("\0node\0{kind}\0");
        let is_meant = |pid: &Pid| {
            let args = fs::read(format!("/proc/{}/cmdline", pid.as_raw_nonzero())).unwrap_or_default();
            args.ends_with(end.as_bytes())
        };
        poll(&format!("no {kind}"), || self.processes().into_iter().map(|(pid, _)| pid).find(is_meant))
    }

    /// Waits until no process launched from this folder lives.
    pub fn await_no_process(&self) {
        poll("processes that outlive their run", || self.processes().is_empty().then_some(()));
    }

    /// The name of the run that is up.
    pub fn run_id(&self) -> String {
        let run_dirs = self.run_dirs();
        let [run_dir] = &run_dirs[..] else { panic!("not one run but {run_dirs:?}") };
        run_dir.file_name().unwrap().to_string_lossy().splitn(3, '-').last().unwrap().to_owned()
    }

    /// Everything that the runs of this folder left outside of their recordings.
    pub fn left(&self) -> Vec<String> {
        self.launchers.borrow().iter().flat_map(|&launcher| self.left_behind(launcher)).collect()
    }

    /// The directories of the runs that are up.
    pub fn run_dirs(&self) -> Vec<PathBuf> {
        entries(&self.temporary())
    }

    /// Returns the processes and files that the runs of `launcher` left, and all entries for temporary files.
    pub fn left_behind(&self, launcher: u32) -> Vec<String> {
        let processes = self.processes().into_iter().map(|(pid, node)| format!("process {pid:?} ({node})"));
        let files = entries(&self.temporary()).into_iter().chain(shared_memory(launcher));
        processes.chain(files.map(|path| path.display().to_string())).collect()
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        // After a kill nobody else removes these.
        let files = self.launchers.get_mut().iter().flat_map(|&launcher| shared_memory(launcher));
        files.for_each(|path| drop(fs::remove_file(path)));
    }
}

fn environment(pid: Pid) -> Vec<String> {
    let text = fs::read(format!("/proc/{}/environ", pid.as_raw_nonzero())).unwrap_or_default();
    text.split(|&byte| byte == 0).map(|variable| String::from_utf8_lossy(variable).into_owned()).collect()
}

fn marked_process(process: &Path, mark: &str) -> Option<(Pid, String)> {
    let pid = process.file_name()?.to_str()?.parse().ok().and_then(Pid::from_raw)?;
    let variables = environment(pid);
    variables.iter().any(|variable| variable == mark).then(|| {
        let node = variables.iter().find_map(|variable| variable.strip_prefix("HUMMINGBUS_NODE="));
        (pid, node.unwrap_or_default().to_owned())
    })
}

/// The shared-memory files of the runs of a launcher; a run's name starts with its launcher's id.
fn shared_memory(launcher: u32) -> Vec<PathBuf> {
    let prefix = format!("/dev/shm/hb_{launcher:x}-");
    let files = entries(Path::new("/dev/shm"));
    files.into_iter().filter(|path| path.to_string_lossy().starts_with(&prefix)).collect()
}

fn entries(folder: &Path) -> Vec<PathBuf> {
    fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path()).collect()
}

/// Looks until there is an answer, or the watchdog bites.
pub fn poll<T>(what: &str, mut look: impl FnMut() -> Option<T>) -> T {
    let start = Instant::now();
    loop {
        if let Some(answer) = look() {
            return answer;
        }
        assert!(start.elapsed() < WATCHDOG, "watchdog: {what}");
        thread::sleep(POLL);
    }
}

/// A launched `hummingbus`; dropping it kills it.
pub struct Launch<'a> {
    place: &'a Place,
    child: Child,
    args: String,
    output: tempfile::TempPath,
    error: tempfile::TempPath,
    status: Option<ExitStatus>,
}

impl Launch<'_> {
    /// The launcher's process id.
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Sends a signal to the launcher.
    pub fn signal(&self, signal: Signal) {
        kill_process(Pid::from_child(&self.child), signal).unwrap();
    }

    /// Waits until every node of the run has completed `ticks` ticks.
    pub fn await_ticks(&mut self, ticks: u32) {
        let start = Instant::now();
        while self.completed_ticks() < Some(ticks) {
            self.status = self.child.try_wait().unwrap();
            assert!(self.status.is_none(), "ended before tick {ticks}: {}", self.said());
            assert!(start.elapsed() < WATCHDOG, "watchdog: tick {ticks} was not reached: {}", self.said());
            thread::sleep(POLL);
        }
    }

    /// Holds the run at the boundary before `ticks` and waits until it is held there.
    pub fn hold_at(&mut self, ticks: u32) {
        let what = format!("the run was not held at tick {ticks}");
        poll(&what, || self.control().map(|control| control.set_hold_tick(ticks)));
        poll(&what, || self.control()?.held_at().filter(|&held| held == ticks));
    }

    /// Waits while the launcher answers `count` requests, one after the other. It answers in its looks at the run, so that it has looked
    /// about as often.
    pub fn await_looks(&self, count: usize) {
        let run_dirs = self.place.run_dirs();
        let socket = UnixStream::connect(run_dirs.first().expect("the run is up").join("ctl.sock")).unwrap();
        socket.set_read_timeout(Some(WATCHDOG)).unwrap();
        let mut answers = BufReader::new(&socket).lines();
        for _ in 0..count {
            writeln!(&socket, r#"{{"request":"status"}}"#).unwrap();
            answers.next().expect("the run has ended").unwrap();
        }
    }

    /// Waits until the launcher has asked the run to stop at its next boundary.
    pub fn await_stop_request(&self) {
        poll("no stop was requested", || self.control()?.is_stop_requested().then_some(()));
    }

    /// Waits until generation `generation` of node `node` computes.
    pub fn await_slot(&self, node: &str, generation: u32) {
        poll(&format!("{node}.{generation} did not join"), || {
            let plan = Plan::load(self.place.run_dirs().first()?).ok()?;
            let member = plan.slot(plan.node_index(node).ok()?, generation);
            (SupervisorView::open(&plan).ok()?.slot_state(member) == bus::lockstep::SlotState::Taken)
                .then_some(())
        });
    }

    /// Waits until the run has this many processes beside its launcher.
    pub fn await_process_count(&self, place: &Place, count: usize) {
        poll(&format!("{count} processes"), || {
            let nodes = place
                .processes()
                .into_iter()
                .filter(|(pid, _)| Some(*pid) != Pid::from_raw(self.id() as i32));
            (nodes.count() == count).then_some(())
        });
    }

    /// Lets a held run go on.
    pub fn release(&mut self) {
        self.control().expect("the run is up").set_hold_tick(u32::MAX);
    }

    fn control(&self) -> Option<SupervisorView> {
        SupervisorView::open(&Plan::load(self.place.run_dirs().first()?).ok()?).ok()
    }

    /// Returns the completed ticks by the run's own control segment; `None` while it is not there yet.
    fn completed_ticks(&self) -> Option<u32> {
        self.control().map(|control| control.completed_ticks())
    }

    /// Waits until the run has written `text` to standard error.
    pub fn await_said(&self, text: &str) {
        poll(&format!("{text:?} was not said: {}", self.said()), || {
            fs::read_to_string(&self.error).unwrap_or_default().contains(text).then_some(())
        });
    }

    /// Standard output so far.
    pub fn output(&self) -> String {
        fs::read_to_string(&self.output).unwrap_or_default()
    }

    /// Standard error so far.
    pub fn errors(&self) -> String {
        fs::read_to_string(&self.error).unwrap_or_default()
    }

    /// True if the launch has ended.
    pub fn has_ended(&mut self) -> bool {
        self.status = self.status.or_else(|| self.child.try_wait().unwrap());
        self.status.is_some()
    }

    /// Waits for the end; the launch must have left nothing behind.
    pub fn end(mut self) -> Ended {
        let status = self.wait();
        let (launcher, ended) = (self.id(), self.ended(status));
        let left = self.place.left_behind(launcher);
        assert!(left.is_empty(), "left behind: {left:#?}\n{}", self.said());
        ended
    }

    /// Waits for the end while other runs of the same folder may go on.
    pub fn end_among_others(mut self) -> Ended {
        let status = self.wait();
        self.ended(status)
    }

    /// Kills the launcher as `kill -9` does; what is left behind is looked at by the test.
    pub fn kill(mut self) {
        self.child.kill().unwrap();
        self.status = Some(self.child.wait().unwrap());
    }

    fn wait(&mut self) -> ExitStatus {
        let start = Instant::now();
        loop {
            if let Some(status) = self.child.try_wait().unwrap() {
                self.status = Some(status);
                return status;
            }
            assert!(
                start.elapsed() < WATCHDOG,
                "watchdog: still running after {WATCHDOG:?}: {}",
                self.said()
            );
            thread::sleep(POLL);
        }
    }

    fn ended(&self, status: ExitStatus) -> Ended {
        Ended {
            code: status.code(),
            output: fs::read_to_string(&self.output).unwrap(),
            error: fs::read_to_string(&self.error).unwrap(),
            args: self.args.clone(),
        }
    }

    fn said(&self) -> String {
        let read = |path: &Path| fs::read_to_string(path).unwrap_or_default();
        format!("hummingbus {}\n{}{}", self.args, read(&self.output), read(&self.error))
    }
}

impl Drop for Launch<'_> {
    fn drop(&mut self) {
        if self.status.is_none() {
            let _ = self.child.kill();
            let _ = self.child.wait();
        }
    }
}

/// A launch that has ended.
#[derive(Debug)]
pub struct Ended {
    pub code: Option<i32>,
    pub output: String,
    pub error: String,
    args: String,
}

impl Ended {
    /// Requires an exit code.
    #[track_caller]
    pub fn with_code(self, code: i32) -> Self {
        assert_eq!(self.code, Some(code), "{self}");
        self
    }

    /// Requires that the run went to its end, whatever its conditions came to; it may have warned that it is cut short.
    #[track_caller]
    pub fn flown(self) -> Self {
        assert!(matches!(self.code, Some(0 | 1)) && self.is_quiet(), "{self}");
        self
    }

    /// True if standard error holds nothing but warnings.
    pub fn is_quiet(&self) -> bool {
        let is_of_a_warning = |line: &str| line.starts_with("warning: ") || line.starts_with("  help: ");
        self.error.lines().all(is_of_a_warning)
    }

    /// Requires that standard error contains each of `parts`.
    #[track_caller]
    pub fn says(&self, parts: &[&str]) {
        parts.iter().for_each(|part| assert!(self.error.contains(part), "no {part:?} in\n{self}"));
    }

    /// Requires that standard output contains each of `parts`.
    #[track_caller]
    pub fn prints(&self, parts: &[&str]) {
        parts.iter().for_each(|part| assert!(self.output.contains(part), "no {part:?} in\n{self}"));
    }

    /// Standard output as JSON.
    #[track_caller]
    pub fn json(&self) -> serde_json::Value {
        serde_json::from_str(&self.output).unwrap_or_else(|error| panic!("{error} in\n{self}"))
    }
}

impl std::fmt::Display for Ended {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "hummingbus {}\nexit code {:?}\n{}{}", self.args, self.code, self.output, self.error)
    }
}

/// Threads that keep the cores busy while this lives.
pub struct Load {
    is_over: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

impl Load {
    /// Starts this many threads.
    pub fn of_threads(count: usize) -> Self {
        let is_over = Arc::new(AtomicBool::new(false));
        let start = |_| {
            let is_over = is_over.clone();
            thread::spawn(move || {
                while !is_over.load(Ordering::Relaxed) {
                    std::hint::spin_loop();
                }
            })
        };
        Self { threads: (0..count).map(start).collect(), is_over }
    }
}

impl Drop for Load {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Relaxed);
        self.threads.drain(..).for_each(|thread| drop(thread.join()));
    }
}
