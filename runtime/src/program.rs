//! Programs that the supervisor starts: the executable of a node, its settings on the host, and the action at its
//! end.

use crate::registry::NodeProgram;
use bus::Registration;
use bus::component::{Role, Transfer};
use bus::plan::{NodePlan, Plan};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Duration;

/// Longest time that a run may stand still because of one process, if the manifest does not state another. A tick
/// takes microseconds.
pub const WATCHDOG: Duration = Duration::from_secs(20);

/// Advice on a program that does not join a run.
pub(crate) const HOW_TO_JOIN: &str = "to join, a program calls `bus::run_process` in Rust, `hummingbus::Node` in C++ or \
                                      `hummingbus.run_node` in Python";

/// Advice on a program in Python, from the `lines` that it wrote last: it could not import `hummingbus`. `None` for any other end.
pub(crate) fn advice_on(lines: &[String]) -> Option<&'static str> {
    let module = lines.last()?.strip_prefix("ModuleNotFoundError: No module named 'hummingbus")?;
    module.starts_with(['\'', '.']).then_some(
        "hummingbus is not installed in the Python that starts this program: install it there with `pip install`, as \
         docs/python.md says, or let `command` begin with the Python that has it, such as \"venv/bin/python\"",
    )
}

/// An executable behind a node.
#[derive(Clone, Debug)]
pub enum Executable {
    /// A component that this binary brings.
    Component(&'static Registration),
    /// A kind of this binary that is a program of its own.
    Program(&'static NodeProgram),
    /// Another executable and its arguments.
    Command(Vec<String>),
}

/// Action when a process ends before the run does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum OnExit {
    /// The run is aborted.
    #[default]
    Stop,
    /// Another process is started in its place, and the clock holds the tick until it has joined.
    Restart,
    /// A process that shadows it from the start is promoted.
    Standby,
    /// The run goes on without it: for sidecars, which send nothing.
    Ignore,
}

/// Condition for a sidecar to count as ready: tick 0 waits for it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Readiness {
    /// Once it was started.
    #[default]
    Started,
    /// The sidecar reports it: it sends `READY=1` to the socket named by `NOTIFY_SOCKET`, as sd_notify(3) does.
    Notify,
}

/// A process to start.
#[derive(Clone, Debug)]
pub struct Program {
    /// Its executable.
    pub executable: Executable,
    /// First word of its command as the manifest states it: the word in `executable` is a path of this host. Empty for a kind.
    pub first_word: String,
    /// Environment variables beside the launcher's own.
    pub environment: BTreeMap<String, String>,
    /// Working directory; the launcher's where absent.
    pub working_directory: Option<PathBuf>,
    /// Niceness, -20 to 19.
    pub nice: Option<i32>,
    /// Priority under SCHED_FIFO, 1 to 99.
    pub realtime_priority: Option<i32>,
    /// Action at its end.
    pub on_exit: OnExit,
    /// Longest time that the run may stand still because of it.
    pub watchdog: Duration,
    /// Condition for a sidecar to count as ready.
    pub ready: Readiness,
    /// Sidecars that have to become ready before it starts.
    pub after: Vec<String>,
    /// File for its standard output and error; in the run directory where absent.
    pub log: Option<PathBuf>,
}

impl Program {
    /// The program of a process that cannot be started: a check goes on with it.
    pub(crate) fn unknown() -> Self {
        Self {
            executable: Executable::Command(Vec::new()),
            first_word: String::new(),
            environment: BTreeMap::new(),
            working_directory: None,
            nice: None,
            realtime_priority: None,
            on_exit: OnExit::Stop,
            watchdog: WATCHDOG,
            ready: Readiness::Started,
            after: Vec::new(),
            log: None,
        }
    }

    /// The component that this is, where the binary brings it.
    pub fn component(&self) -> Option<&'static Registration> {
        match self.executable {
            Executable::Component(component) => Some(component),
            Executable::Program(_) | Executable::Command(_) => None,
        }
    }

    /// The name of the kind that this is, where the binary brings it.
    pub fn kind(&self) -> Option<&'static str> {
        match self.executable {
            Executable::Component(component) => Some(component.name),
            Executable::Program(program) => Some(program.name),
            Executable::Command(_) => None,
        }
    }

    /// True if this writes the run's recording.
    pub fn is_recorder(&self) -> bool {
        self.has(Role::Record)
    }

    /// True if this evaluates the conditions of a run that is not recorded.
    pub fn is_judge(&self) -> bool {
        self.has(Role::Judge)
    }

    /// True if `other` starts the same: executable, environment and working directory are equal.
    pub fn is_same(&self, other: &Self) -> bool {
        let command = |program: &Self| match &program.executable {
            Executable::Command(command) => Some(command.clone()),
            Executable::Component(_) | Executable::Program(_) => None,
        };
        (self.kind(), command(self)) == (other.kind(), command(other))
            && self.environment == other.environment
            && self.working_directory == other.working_directory
    }

    fn has(&self, role: Role) -> bool {
        self.component().is_some_and(|component| component.role == role)
    }
}

/// A process that shadows a node, and takes over from it when its time comes.
#[derive(Clone, Debug)]
pub struct BackupSpec {
    /// Index of the node in the plan.
    pub node: usize,
    /// The tick from which on it computes.
    pub join_tick: u32,
    /// The tick from which on its outputs count; `None` for one that only shadows or stands by.
    pub take_over_tick: Option<u32>,
    /// True if it is promoted when the primary dies.
    pub is_standby: bool,
    /// Keys in which it differs from its process, as TOML, if a request in flight gave them.
    pub(crate) with: Option<String>,
    /// Program to start.
    pub(crate) program: Program,
    /// Plan that the backup reads about itself: the node's own, with the backup's parameters and inputs.
    pub plan: NodePlan,
}

impl BackupSpec {
    /// True if it never flies.
    pub(crate) fn is_shadow(&self) -> bool {
        self.take_over_tick.is_none() && !self.is_standby
    }

    /// True if it flies at `tick`.
    pub(crate) fn has_taken_over(&self, tick: u32) -> bool {
        self.take_over_tick.is_some_and(|at| at < tick)
    }
}

/// Origin of the process that flies a node.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Origin {
    /// The process that the manifest names for the checkpoint's tick.
    Plan,
    /// The first process of the node.
    First,
    /// The backup of the manifest's swap at this tick.
    Swap(u32),
    /// The node's standby.
    Standby,
    /// The backup of a swap that was requested in flight, with these keys, as TOML.
    Request(String),
}

impl Origin {
    /// Origin of `backup`.
    pub fn of(backup: &BackupSpec) -> Self {
        match (&backup.with, backup.take_over_tick) {
            (Some(with), _) => Self::Request(with.clone()),
            (None, Some(tick)) => Self::Swap(tick),
            (None, None) => Self::Standby,
        }
    }
}

/// Program that the manifest has fly at `tick` if node `node` begins as `program` and `backups` take over.
pub(crate) fn flying<'a>(
    node: usize,
    program: &'a Program,
    backups: &'a [BackupSpec],
    tick: u32,
) -> &'a Program {
    let swap = backups.iter().rfind(|backup| backup.node == node && backup.has_taken_over(tick));
    swap.map_or(program, |backup| &backup.program)
}

/// The node of `plan` that flies at `tick` and whose state is in another program, and that program: no checkpoint holds it.
pub(crate) fn unsaved<'a>(
    plan: &'a Plan,
    programs: &[Program],
    backups: &[BackupSpec],
    tick: u32,
) -> Option<(&'a str, &'static str)> {
    plan.nodes.iter().zip(programs).enumerate().find_map(|(node, (plan, program))| {
        match flying(node, program, backups, tick).component()?.transfer {
            Transfer::External(what) => Some((&*plan.name, what)),
            _ => None,
        }
    })
}

#[cfg(test)]
mod tests {
    use super::advice_on;

    #[test]
    fn only_a_program_without_the_package_gets_advice_on_it() {
        let advice = |line: &str| advice_on(&["import hummingbus as hb".to_owned(), line.to_owned()]);
        for module in ["hummingbus", "hummingbus._native"] {
            let advice = advice(&format!("ModuleNotFoundError: No module named '{module}'"));
            assert!(advice.is_some_and(|advice| advice.contains("pip install")), "{module}");
        }
        for line in ["ModuleNotFoundError: No module named 'hummingbus_tools'", "hummingbus", ""] {
            assert_eq!(advice(line), None, "{line}");
        }
        assert_eq!(advice_on(&[]), None);
    }
}
