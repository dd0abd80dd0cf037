//! Launching a run: starts its processes, watches them, and takes everything down again.
#![allow(clippy::disallowed_methods, reason = "the launcher watches host time; it simulates nothing")]

use crate::graph::Graph;
use crate::manifest::Manifest;
use crate::program::Executable;
use crate::progress::Progress;
use crate::run_dir::RunDir;
use anyhow::{Context, Result, bail};
use bus::NODE_VARIABLE;
use bus::control::{Control, Phase};
use bus::plan::Plan;
use bus::process::{LAUNCHER_VARIABLE, RUN_VARIABLE};
use std::fs::File;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

const POLL: Duration = Duration::from_millis(5);
/// How long a run may stand still before it is given up. A tick takes microseconds.
const STALL: Duration = Duration::from_secs(20);
/// How long processes have to leave by themselves after an abort.
const GRACE: Duration = Duration::from_secs(2);
/// Lines of a failed process's own words that are shown.
const LOG_LINES: usize = 20;

/// What is known about a run when it is over.
#[derive(Debug)]
pub struct Outcome {
    /// Ticks that every node completed.
    pub ticks: u32,
    /// Whether the run was stopped before its end.
    pub was_stopped: bool,
    /// Host time from the first grant to the last completed tick.
    pub host_s: f64,
    /// Deadlines missed (paced runs).
    pub missed_deadlines: u32,
    /// Per process: name, processor share of one core, deadlines at which it was late.
    pub processes: Vec<(String, f64, u32)>,
}

/// Flies `graph` and records to `recording`; returns when every process is gone.
///
/// # Errors
/// If a process fails, stalls, or cannot be started; the error holds its last words.
pub fn fly(manifest: &Manifest, graph: &mut Graph, recording: &Path, quiet: bool) -> Result<Outcome> {
    let interrupts = count_interrupts()?;
    let run_dir = RunDir::create()?;
    prepare(manifest, graph, recording, &run_dir)?;
    graph.plan.run_id = run_dir.run_id().to_owned();
    graph.plan.store(run_dir.path())?;
    let control = Control::create(&graph.plan)?;
    let mut processes = Processes::start(manifest, graph, run_dir.path())?;
    let progress = Progress::new(&graph.plan, quiet);
    let was_stopped = watch(&mut processes, &control, &graph.plan, &interrupts, &progress)?;
    progress.finish(&control);
    Ok(outcome(&graph.plan, &control, was_stopped))
}

/// Counts Ctrl-C and SIGTERM from now on instead of dying of them.
fn count_interrupts() -> Result<Arc<AtomicUsize>> {
    let count = Arc::new(AtomicUsize::new(0));
    let seen = count.clone();
    ctrlc::set_handler(move || {
        seen.fetch_add(1, Ordering::SeqCst);
    })
    .context("cannot handle Ctrl-C")?;
    Ok(count)
}

/// Puts the files that recorders attach into the run directory and tells the recorders.
fn prepare(manifest: &Manifest, graph: &mut Graph, recording: &Path, run_dir: &RunDir) -> Result<()> {
    let manifest_copy = run_dir.path().join("manifest.toml");
    std::fs::write(&manifest_copy, &manifest.recorded_text).context("cannot write the manifest's copy")?;
    let name = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let mut attachments = vec![(name(&manifest.path), manifest_copy)];
    attachments.extend(graph.vehicles.iter().map(|path| (name(path), path.clone())));
    let attachments: Vec<_> =
        attachments.iter().map(|(name, path)| serde_json::json!({ "name": name, "path": path })).collect();
    for (program, node) in graph.programs.iter().zip(&mut graph.plan.nodes) {
        if program.is_recorder() {
            node.parameters = serde_json::json!({ "path": recording, "attachments": attachments });
        }
    }
    Ok(())
}

/// The processes of a run; dropping them kills those that still live.
struct Processes {
    running: Vec<Process>,
}

struct Process {
    name: String,
    log: PathBuf,
    child: Child,
    end: Option<ExitStatus>,
}

impl Processes {
    fn start(manifest: &Manifest, graph: &Graph, run_dir: &Path) -> Result<Self> {
        let this_binary = std::env::current_exe().context("cannot find this binary")?;
        let mut processes = Self { running: Vec::new() };
        let mut clock = Command::new(&this_binary);
        clock.args(["node", "clock"]);
        let mut commands = vec![("clock".to_owned(), clock)];
        for (program, node) in graph.programs.iter().zip(&graph.plan.nodes) {
            let mut command = match &program.executable {
                Executable::Kind(kind) => {
                    let mut command = Command::new(&this_binary);
                    command.args(["node", kind.name]);
                    command
                }
                Executable::Command(words) => {
                    let mut command = Command::new(executable(manifest, &words[0]));
                    command.args(&words[1..]);
                    command
                }
            };
            command.env(NODE_VARIABLE, &node.name);
            commands.push((node.name.clone(), command));
        }
        shuffle(&mut commands, manifest.content.run.start_order_seed);
        for (name, command) in commands {
            processes.running.push(Process::start(name, command, run_dir)?);
        }
        Ok(processes)
    }

    /// The first process that ended badly since the last look.
    fn find_failure(&mut self) -> Result<Option<&Process>> {
        for process in &mut self.running {
            if process.end.is_none() {
                process.end = process.child.try_wait().context("cannot watch a process")?;
            }
        }
        Ok(self.running.iter().find(|process| process.end.is_some_and(|end| !end.success())))
    }

    /// A node whose process ended well before the run did: one that never joined, or left on its way.
    fn find_deserter(&self, control: &Control, plan: &Plan) -> Option<usize> {
        let has_ended =
            |name: &str| self.running.iter().any(|process| process.name == name && process.end.is_some());
        (0..plan.nodes.len()).find(|&node| !control.has_completed(node) && has_ended(&plan.nodes[node].name))
    }

    fn all_ended(&self) -> bool {
        self.running.iter().all(|process| process.end.is_some())
    }
}

impl Drop for Processes {
    fn drop(&mut self) {
        for process in self.running.iter_mut().filter(|process| process.end.is_none()) {
            // The whole group, since a command may have started processes of its own.
            bus::process::kill_group(process.child.id());
            let _ = process.child.kill();
            let _ = process.child.wait();
        }
    }
}

impl Process {
    fn start(name: String, mut command: Command, run_dir: &Path) -> Result<Self> {
        let log = run_dir.join(format!("{name}.log"));
        let file = File::create(&log).with_context(|| format!("cannot create {}", log.display()))?;
        let output = file.try_clone().context("cannot share a log file")?;
        command
            .env(RUN_VARIABLE, run_dir)
            .env(LAUNCHER_VARIABLE, std::process::id().to_string())
            .stdin(Stdio::null())
            .stdout(output)
            .stderr(file)
            // A group of its own: Ctrl-C in the terminal reaches the launcher alone, which stops the run
            // at a tick boundary.
            .process_group(0);
        let child = command.spawn().with_context(|| {
            format!("process `{name}`: cannot start {}", command.get_program().to_string_lossy())
        })?;
        Ok(Self { name, log, child, end: None })
    }

    /// How the process ended, with the last lines it wrote.
    fn post_mortem(&self) -> String {
        let end = match self.end {
            Some(end) => match (end.code(), end.signal()) {
                (Some(code), _) => format!("ended with exit code {code}"),
                (None, Some(signal)) => format!("was killed by {}", bus::process::signal_name(signal)),
                (None, None) => "ended".to_owned(),
            },
            None => "is still running".to_owned(),
        };
        let words = std::fs::read_to_string(&self.log).unwrap_or_default();
        let lines: Vec<&str> = words.lines().collect();
        // What a panic says stands in front of its backtrace.
        let last = lines.len().saturating_sub(LOG_LINES);
        let start = lines.iter().position(|line| line.contains("panicked at")).unwrap_or(last);
        let words =
            lines[start..].iter().take(LOG_LINES).map(|line| format!("\n  {line}")).collect::<String>();
        format!("process `{}` {end}{words}", self.name)
    }
}

/// A command with a path is relative to the manifest; a bare name is looked up in PATH.
fn executable(manifest: &Manifest, program: &str) -> PathBuf {
    let path = Path::new(program);
    if path.is_absolute() || !program.contains('/') {
        return path.to_owned();
    }
    let folder = manifest.path.parent().unwrap_or(Path::new(""));
    std::path::absolute(folder.join(path)).unwrap_or_else(|_| path.to_owned())
}

/// Fisher-Yates with the bus's own generator: the same seed gives the same order.
fn shuffle<T>(items: &mut [T], seed: Option<u64>) {
    use rand_core::Rng;
    let Some(seed) = seed else { return };
    let mut random = bus::random::stream(seed, "start-order");
    for last in (1..items.len()).rev() {
        let pick = random.next_u64() % (last as u64 + 1);
        items.swap(last, usize::try_from(pick).unwrap_or(last));
    }
}

/// Watches until all processes have ended; true if the run was stopped on the way.
fn watch(
    processes: &mut Processes,
    control: &Control,
    plan: &Plan,
    interrupts: &AtomicUsize,
    progress: &Progress,
) -> Result<bool> {
    let mut last_change = (0, Instant::now());
    loop {
        if let Some(failed) = processes.find_failure()? {
            let tick = ticks_of(&failed.name, control, plan);
            let silent = silent_topics(&failed.name, plan);
            let words = format!("{}\nThe run was aborted at tick {tick}{silent}", failed.post_mortem());
            take_down(processes, control)?;
            bail!(words);
        }
        if let Some(node) = processes.find_deserter(control, plan) {
            let name = &plan.nodes[node].name;
            let tick = ticks_of(&plan.nodes[node].name, control, plan);
            let silent = silent_topics(name, plan);
            take_down(processes, control)?;
            bail!(
                "process `{name}` ended with exit code 0 before the run did; it was aborted at tick {tick}{silent}"
            );
        }
        if processes.all_ended() {
            // A stop that was asked for after the last grant changed nothing.
            return Ok(control.end_tick() < plan.duration_ticks);
        }
        match interrupts.load(Ordering::SeqCst) {
            0 => {}
            1 => control.request_stop(),
            _ => {
                take_down(processes, control)?;
                bail!("interrupted twice: the run was aborted at tick {}", control.completed_ticks());
            }
        }
        let ticks = control.completed_ticks();
        if ticks != last_change.0 {
            last_change = (ticks, Instant::now());
        } else if last_change.1.elapsed() > STALL.max(2 * deadline(plan)) {
            let words = describe_stall(control, plan, last_change.1.elapsed());
            take_down(processes, control)?;
            bail!(words);
        }
        progress.show(control);
        std::thread::sleep(POLL);
    }
}

/// Ticks that the process `name` completed; those of the whole run if it is the clock.
fn ticks_of(name: &str, control: &Control, plan: &Plan) -> u32 {
    let node = plan.nodes.iter().position(|node| node.name == name);
    node.map_or_else(|| control.completed_ticks(), |node| control.completed_by(node))
}

/// The topics on which nothing came any more once the process `name` had ended, in words.
fn silent_topics(name: &str, plan: &Plan) -> String {
    let outputs = plan.nodes.iter().filter(|node| node.name == name).flat_map(|node| &node.outputs);
    let topics: Vec<_> = outputs.map(|output| plan.topics[output.topic].name.as_str()).collect();
    if topics.is_empty() { String::new() } else { format!("; nothing more came on {}", topics.join(", ")) }
}

/// Host time in which a paced run must come forward: that of the slowest node's period.
fn deadline(plan: &Plan) -> Duration {
    let period_ticks = plan.nodes.iter().map(|node| node.period_ticks).max().unwrap_or(1);
    match plan.pace {
        bus::plan::Pace::Free => Duration::ZERO,
        bus::plan::Pace::Factor(factor) => {
            Duration::from_secs_f64((f64::from(period_ticks) * plan.tick_s() / factor).min(1e6))
        }
    }
}

/// Who has not come as far as the others, and what it waits for.
fn describe_stall(control: &Control, plan: &Plan, stood: Duration) -> String {
    let names = |phase| {
        let late = plan.nodes.iter().enumerate().filter(|(index, _)| !control.is_ready(*index, phase));
        late.map(|(_, node)| format!("`{}`", node.name)).collect::<Vec<_>>().join(", ")
    };
    let waiting = match control.phase() {
        Phase::Announcing => format!("waiting for {} to join", names(Phase::Connecting)),
        Phase::Connecting => format!("waiting for {} to connect", names(Phase::Running)),
        Phase::Running => describe_stuck(control, plan),
    };
    format!("the run stood still for {} s: {waiting}; it was aborted", stood.as_secs())
}

/// Who is awake and does not come on, and which topics the others sleep for.
fn describe_stuck(control: &Control, plan: &Plan) -> String {
    let nodes = 0..plan.nodes.len();
    let name = |node: usize| format!("`{}`", plan.nodes[node].name);
    let is_awake = |node: &usize| {
        control.awaited_topic(plan, *node).is_none()
            && !control.awaits_grant(*node)
            && !control.has_completed(*node)
    };
    let mut stuck: Vec<usize> = nodes.clone().filter(is_awake).collect();
    if stuck.is_empty() {
        stuck = control.slowest_nodes();
    }
    let tick = stuck.iter().map(|&node| control.completed_by(node)).min().unwrap_or(0);
    let waiting = nodes.filter_map(|node| {
        let topic = control.awaited_topic(plan, node)?;
        Some(format!("; {} waits for {}", name(node), plan.topics[topic].name))
    });
    let stuck: Vec<String> = stuck.into_iter().map(name).collect();
    format!("tick {tick} is not completed by {}{}", stuck.join(", "), waiting.collect::<String>())
}

fn take_down(processes: &mut Processes, control: &Control) -> Result<()> {
    control.abort();
    let start = Instant::now();
    while !processes.all_ended() && start.elapsed() < GRACE {
        processes.find_failure()?;
        std::thread::sleep(POLL);
    }
    Ok(())
}

fn outcome(plan: &Plan, control: &Control, was_stopped: bool) -> Outcome {
    let (start_ns, end_ns) = control.host_span_ns();
    let host_s = end_ns.saturating_sub(start_ns) as f64 * 1e-9;
    let share = |cpu_ns: u64| if host_s > 0.0 { cpu_ns as f64 * 1e-9 / host_s } else { 0.0 };
    let clock = ("clock".to_owned(), share(control.clock_cpu_ns()), 0);
    let nodes = plan.nodes.iter().enumerate();
    let nodes = nodes
        .map(|(index, node)| (node.name.clone(), share(control.cpu_ns(index)), control.late_count(index)));
    Outcome {
        ticks: control.completed_ticks(),
        was_stopped,
        host_s,
        missed_deadlines: control.missed_deadlines(),
        processes: std::iter::once(clock).chain(nodes).collect(),
    }
}
