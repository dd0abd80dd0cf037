//! The place of a run's nodes: processes of their own, threads of this process, or the thread that flies the run.

use crate::program::{Executable, Program};
use anyhow::{Context, Result, anyhow, bail};
use bus::lockstep::SupervisorView;
use bus::place::Place;
use bus::{BusError, Join, Registration};
use std::any::Any;
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::ExitStatus;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

/// Time that threads have to notice that they are to end.
pub(crate) const GRACE: Duration = Duration::from_secs(2);
const POLL: Duration = Duration::from_millis(1);
/// Stack of a node's thread: as large as that of the main thread of a process.
const STACK_BYTES: usize = 8 << 20;

/// Host of the instances of a run's nodes.
///
/// Nodes on threads meet the faults of processes: one that panics or returns an error ends the run with its message,
/// or is replaced if its manifest says so. One that hangs is given up by its watchdog. A thread cannot be killed: it
/// is left behind, sends nothing more, and ends at its next wait.
///
/// ```
/// use runtime::host::Host;
/// let of_another_binary = Host::Exe("target/release/hummingbus".into());
/// assert_ne!(of_another_binary, Host::this_binary());
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Host {
    /// Each component is a process that executes this binary with the arguments `node KIND`.
    Exe(PathBuf),
    /// Each component is a thread of this process, which the run otherwise leaves unchanged. A `command` is refused,
    /// and so are settings that only a process of its own can have (`nice`, `cpu`, …).
    Threads,
    /// The thread that flies the run steps all components one after the other, the recorder too. There is no shared
    /// memory and no clock service. Everything that threads refuse is refused, and so are changes of processes in
    /// flight: swaps, standbys, restarts, requests.
    InProcess,
}

impl Host {
    /// This program's own binary, even after its file has been replaced: for programs that pass the arguments
    /// `node KIND` to [`crate::node()`].
    #[must_use]
    pub fn this_binary() -> Self {
        Self::Exe("/proc/self/exe".into())
    }

    /// Refuses a host on which the kernel does not report processes.
    pub(crate) fn require_proc() -> Result<()> {
        if Path::new("/proc/self/fd").is_dir() {
            return Ok(());
        }
        bail!(
            "/proc is not there, and a run needs it, to start its processes, to watch them and to be steered; mount it: \
             mount -t proc proc /proc"
        )
    }

    /// Refuses settings of `program`, the process `name`, that it cannot have here.
    pub(crate) fn require(&self, name: &str, program: &Program) -> Result<()> {
        if matches!(self, Self::Exe(_)) {
            return Ok(());
        }
        let asked = [
            ("command", matches!(program.executable, Executable::Command(_))),
            ("kind", matches!(program.executable, Executable::Program(_))),
            ("environment", !program.environment.is_empty()),
            ("working_directory", program.working_directory.is_some()),
            ("nice", program.nice.is_some()),
            ("realtime_priority", program.realtime_priority.is_some()),
            ("log", program.log.is_some()),
        ];
        match asked.into_iter().find(|(_, is_asked)| *is_asked) {
            None => Ok(()),
            Some((key, _)) => Err(needs_process(&format!("process `{name}`: `{key}`"))),
        }
    }
}

/// The reason why a run whose nodes live in this process cannot have `what`.
pub(crate) fn needs_process(what: &str) -> anyhow::Error {
    anyhow!(
        "{what} needs a process of its own, and the nodes of this run share one: those of `run --in-process`, `campaign` and `tune` do; \
         leave it out, or fly it with `hummingbus run` (in Rust: with Host::Exe, which executes a binary for each node)"
    )
}

/// The message of a panic that was caught.
pub(crate) fn panic_message(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("without a message")
}

/// End of an instance.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum End {
    /// Its code returned, as a process with this exit code.
    Exited(i32),
    /// A signal killed its process.
    Signalled(i32),
    /// Its thread failed or panicked, with this message.
    Failed(String),
    /// The launcher ended its thread.
    Cancelled,
}

/// Words about an instance that ended with an exit code, which follows them.
pub(crate) const EXITED: &str = "ended with exit code";

impl End {
    /// True if the instance ended without an error.
    pub fn success(&self) -> bool {
        *self == Self::Exited(0)
    }

    /// Description of an end before that of the run.
    pub fn message(&self) -> String {
        match self {
            Self::Exited(0) => "ended with exit code 0 before the run did".to_owned(),
            Self::Exited(code) => format!("{EXITED} {code}"),
            Self::Signalled(signal) => format!(
                "was killed by {}{}",
                bus::process::signal_name(*signal),
                bus::room::signal_message(*signal)
            ),
            Self::Failed(message) => format!("failed: {message}"),
            Self::Cancelled => "was ended".to_owned(),
        }
    }
}

impl From<ExitStatus> for End {
    fn from(status: ExitStatus) -> Self {
        // One of the two is there: it has ended.
        status.code().map_or_else(|| Self::Signalled(status.signal().unwrap_or_default()), Self::Exited)
    }
}

/// Part of a run that a thread takes.
#[derive(Clone, Copy)]
pub(crate) enum ThreadPart {
    /// The clock service.
    Clock,
    /// A node.
    Node(&'static Registration),
    /// A group of nodes.
    Group,
}

/// An instance on a thread.
#[derive(Debug)]
pub(crate) struct Thread {
    handle: Option<JoinHandle<Result<(), BusError>>>,
    is_cancelled: Arc<AtomicBool>,
    control: Arc<SupervisorView>,
}

impl Thread {
    /// Starts `part` of a run on a thread of this process; `components` are those of the run.
    pub fn start(
        part: ThreadPart,
        components: &'static [Registration],
        join: Join,
        control: Arc<SupervisorView>,
    ) -> Result<Self> {
        let is_cancelled = Arc::new(AtomicBool::new(false));
        let name = join.node.clone();
        let join = Join { place: Place::Thread(is_cancelled.clone()), ..join };
        let thread = std::thread::Builder::new().name(name.clone()).stack_size(STACK_BYTES);
        let handle = thread.spawn(move || match part {
            ThreadPart::Clock => bus::clock::run(join),
            ThreadPart::Node(component) => bus::run_component(component, join, components),
            ThreadPart::Group => bus::group::run(&join, components),
        });
        let handle = handle.with_context(|| format!("process `{name}`: cannot start a thread"))?;
        Ok(Self { handle: Some(handle), is_cancelled, control })
    }

    /// End of the instance, if it has ended.
    pub fn end(&mut self) -> Option<End> {
        let handle = self.handle.take_if(|handle| handle.is_finished())?;
        Some(match handle.join() {
            Ok(Ok(()) | Err(BusError::Aborted)) => End::Exited(0),
            Ok(Err(error)) => End::Failed(error.to_string()),
            Err(panic) => End::Failed(format!("it panicked: {}", panic_message(&*panic))),
        })
    }

    /// Ends it at its next wait, which returns at once.
    pub fn cancel(&self) {
        self.is_cancelled.store(true, Ordering::SeqCst);
        self.control.set_epoch(self.control.epoch());
    }

    /// Waits for the end of a cancelled thread for as long as there is patience. One that computes without an end
    /// cannot be ended: it is left behind, and sends nothing any more.
    pub fn join(&mut self, patience: &mut Duration) -> End {
        loop {
            match self.end() {
                Some(End::Failed(message)) => return End::Failed(message),
                Some(_) => return End::Cancelled,
                None if patience.is_zero() => return End::Cancelled,
                None => {}
            }
            std::thread::sleep(POLL);
            *patience = patience.saturating_sub(POLL);
        }
    }
}
