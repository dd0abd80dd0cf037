//! Settings that a process of a run makes for itself: to die with its launcher, to stay on its core.

use crate::error::BusError;
use rustix::process::{Signal, getppid, set_parent_process_death_signal};
use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};
use std::io;
use std::os::unix::process::CommandExt;
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

/// The environment variable with the process number of the launcher.
pub const LAUNCHER_VARIABLE: &str = "HUMMINGBUS_LAUNCHER_PID";

/// The environment variable that names the run directory.
pub const RUN_VARIABLE: &str = "HUMMINGBUS_RUN";

/// Makes this process one of a run: it dies with its launcher, and a request to end ends the run at a tick boundary.
pub(crate) fn join_run() {
    die_with_parent();
    note_signals();
}

static IS_TERMINATED: OnceLock<Arc<AtomicBool>> = OnceLock::new();

/// Makes SIGTERM and SIGINT end the run at a tick boundary from now on: a process that died at once would take the
/// recording's end with it.
fn note_signals() {
    let flag = IS_TERMINATED.get_or_init(Arc::default);
    for signal in STOP_SIGNALS {
        let _ = signal_hook::flag::register(signal, flag.clone());
    }
    mask_stop_signals(libc::SIG_UNBLOCK);
}

/// The signals that ask a process to end.
const STOP_SIGNALS: [libc::c_int; 2] = [libc::SIGTERM, libc::SIGINT];

/// Blocks SIGTERM and SIGINT until the process that `command` starts joins the run: before that it could not note
/// them, and would die of a signal that is to stop the run in order.
pub fn hold_stop_signals(command: &mut Command) {
    let block = || {
        mask_stop_signals(libc::SIG_BLOCK);
        Ok(())
    };
    // SAFETY: between fork and exec the closure makes system calls only and touches no lock and no heap.
    unsafe { command.pre_exec(block) };
}

/// Unblocks SIGTERM and SIGINT, which the starter of this process may have blocked.
pub fn hear_stop_signals() {
    mask_stop_signals(libc::SIG_UNBLOCK);
}

fn mask_stop_signals(how: libc::c_int) {
    // SAFETY: the set lives across the calls, is initialised by the first one, and the calls keep no reference to it.
    unsafe {
        let mut set: libc::sigset_t = std::mem::zeroed();
        libc::sigemptyset(&raw mut set);
        STOP_SIGNALS.iter().for_each(|&signal| {
            libc::sigaddset(&raw mut set, signal);
        });
        libc::pthread_sigmask(how, &raw const set, std::ptr::null_mut());
    }
}

/// True if this process was asked to end.
pub(crate) fn is_terminated() -> bool {
    IS_TERMINATED.get().is_some_and(|flag| flag.load(Ordering::Relaxed))
}

/// Makes the kernel kill this process when its launcher dies, even by `kill -9`.
fn die_with_parent() {
    let _ = set_parent_process_death_signal(Some(Signal::KILL));
    // The launcher may have died before the line above; that signal would then never come.
    let launcher = std::env::var(LAUNCHER_VARIABLE).ok().and_then(|pid| pid.parse::<i32>().ok());
    let parent = getppid().map(|pid| pid.as_raw_nonzero().get());
    if launcher.is_some() && launcher != parent {
        use std::io::Write as _;
        let _ = writeln!(
            io::stderr(),
            "this node is not a child of its launcher: either the launcher has died, or a shell stands between \
             them; start the node with `exec`"
        );
        std::process::exit(1);
    }
}

/// Makes a write beyond the limit on the size of files an error with a reason. Without it the signal ends the process
/// silently.
/// Programs that this process starts still die of it: the kernel drops a handler when another program begins.
pub fn survive_file_limit() {
    // A process that ignored the signal gets such errors already, and so does every program that it starts.
    if is_ignored(libc::SIGXFSZ) {
        return;
    }
    static IS_REACHED: OnceLock<Arc<AtomicBool>> = OnceLock::new();
    let flag = IS_REACHED.get_or_init(Arc::default);
    let _ = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, flag.clone());
}

fn is_ignored(signal: libc::c_int) -> bool {
    let mut found = std::mem::MaybeUninit::<libc::sigaction>::uninit();
    // SAFETY: the call changes nothing and writes one `sigaction`, which is read only if it succeeded.
    let found = unsafe {
        (libc::sigaction(signal, std::ptr::null(), found.as_mut_ptr()) == 0).then(|| found.assume_init())
    };
    found.is_some_and(|found| found.sa_sigaction == libc::SIG_IGN)
}

/// Keeps this process on one core. Where the machine has no such core, it stays where it is: placement
/// is a matter of speed, never of results.
pub fn stay_on(cpu: Option<usize>) {
    if let Some(cpu) = cpu.filter(|&cpu| cpu < CpuSet::MAX_CPU) {
        let mut set = CpuSet::new();
        set.set(cpu);
        let _ = sched_setaffinity(None, &set);
    }
}

/// Makes this process, when it is woken, wait its turn instead of interrupting the one that woke it.
///
/// On a core that the nodes of a loop share, an interrupted waker needs the core once more before it can
/// sleep; measured, a tick of the hover run takes 4.0 context switches this way and 5.7 without.
pub(crate) fn wait_for_turn() {
    // SAFETY: the call takes and returns numbers. A process that was given a real-time priority keeps it.
    if unsafe { libc::sched_getscheduler(0) } != libc::SCHED_OTHER {
        return;
    }
    let parameters = libc::sched_param { sched_priority: 0 };
    // SAFETY: the call reads one `sched_param` that lives across it. A refusal leaves the policy as it
    // was, which costs speed only.
    let _ = unsafe { libc::sched_setscheduler(0, libc::SCHED_BATCH, &raw const parameters) };
}

/// Gives process `pid` a niceness, -20 to 19.
///
/// # Errors
/// The system's answer, if it does not allow it.
pub fn set_nice(pid: u32, nice: i32) -> io::Result<()> {
    let pid = i32::try_from(pid).ok().and_then(rustix::process::Pid::from_raw);
    Ok(rustix::process::setpriority_process(pid, nice)?)
}

/// Gives process `pid` a priority under `SCHED_FIFO`, 1 to 99.
///
/// # Errors
/// The system's answer, if it does not allow it.
pub fn set_fifo(pid: u32, priority: i32) -> io::Result<()> {
    let parameters = libc::sched_param { sched_priority: priority };
    let pid = libc::pid_t::try_from(pid).map_err(io::Error::other)?;
    // SAFETY: the call reads one `sched_param` that lives across it.
    match unsafe { libc::sched_setscheduler(pid, libc::SCHED_FIFO, &raw const parameters) } {
        0 => Ok(()),
        _ => Err(io::Error::last_os_error()),
    }
}

/// Makes the kernel kill the program that `command` starts when this process dies: for executables that do not know
/// their launcher.
pub fn die_with_this_one(command: &mut Command) {
    let launcher = rustix::process::getpid();
    let bind = move || {
        set_parent_process_death_signal(Some(Signal::KILL))?;
        // The launcher may have died before the line above; that signal would then never come.
        if getppid() == Some(launcher) { Ok(()) } else { Err(io::ErrorKind::NotFound.into()) }
    };
    // SAFETY: between fork and exec the closure makes two system calls and touches no lock and no heap.
    unsafe { command.pre_exec(bind) };
}

/// Keeps all memory of this process, now and from now on, from being paged out.
///
/// # Errors
/// If the system does not allow this much; the error names the right.
pub(crate) fn lock_memory() -> Result<(), BusError> {
    let all = rustix::mm::MlockAllFlags::CURRENT | rustix::mm::MlockAllFlags::FUTURE;
    rustix::mm::mlockall(all).map_err(|error| BusError::Denied {
        action: "lock the memory of this process (run.lock_memory)",
        source: error.into(),
        advice: "give it the capability CAP_IPC_LOCK or raise the limit on locked memory (`ulimit -l`, \
                 `memlock` in limits.conf, `LimitMEMLOCK=` in systemd)",
    })
}

/// Kills every process of the group that process `leader` leads.
pub fn kill_group(leader: u32) {
    let group = i32::try_from(leader).ok().and_then(rustix::process::Pid::from_raw);
    if let Some(group) = group {
        let _ = rustix::process::kill_process_group(group, Signal::KILL);
    }
}

/// The cores this process may run on, in ascending order; empty if the system does not report them.
#[must_use]
pub fn allowed_cores() -> Vec<usize> {
    let set = sched_getaffinity(None).unwrap_or_else(|_| CpuSet::new());
    (0..CpuSet::MAX_CPU).filter(|&cpu| set.is_set(cpu)).collect()
}

/// The number of the user this process runs as.
#[must_use]
pub fn user_id() -> u32 {
    rustix::process::getuid().as_raw()
}

/// A signal as people know it, such as `signal 9 (SIGKILL)`.
#[must_use]
pub fn signal_name(signal: i32) -> String {
    let name = signal_hook::low_level::signal_name(signal);
    name.map_or_else(|| format!("signal {signal}"), |name| format!("signal {signal} ({name})"))
}
