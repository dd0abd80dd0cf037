//! Ports of a manifest's programs: each program is asked for them, so that a check finds the errors of a run.
//!
//! Each `command` that takes part in the ticks is started once, in a temporary run directory, and ends where it would connect
//! ([`bus::description`]).

use crate::graph::Graph;
use crate::host_world::store_files;
use crate::manifest::Manifest;
use crate::process_log;
use crate::program::Program;
use crate::role::Role;
use crate::run_dir::shared_memory_of;
use crate::spawn::{Started, start};
use anyhow::{Context, Result};
use bus::announcement::Announcement;
use bus::description::{DESCRIBE_VARIABLE, Description};
use bus::host_time::monotonic_ns;
use bus::plan::{NodePlan, Plan};
use bus::ports::Inputs;
use diagnostics::Diagnostic;
use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Child, ExitStatus};
use std::time::Duration;

/// Time that a program has to describe itself.
const PATIENCE: Duration = Duration::from_secs(20);
const POLL: Duration = Duration::from_millis(2);

/// A program that takes, or may take, a node's part.
#[derive(Clone, Copy)]
struct Asked<'g> {
    node: usize,
    generation: u32,
    plan: &'g NodePlan,
    program: &'g Program,
}

/// Starts the programs that `graph`, the checked `manifest`, names as a `command`, and those of `exe`, the binary
/// with the kinds of the manifest. Compares their declarations with the manifest and with each other. Returns
/// warnings of the programs without a declaration.
///
/// # Errors
/// The problem of the first program that would not fly, or the reason why none can be started.
pub fn check_programs(manifest: &Manifest, graph: &Graph, exe: &Path) -> Result<Vec<Diagnostic>> {
    let asked = asked(graph);
    if asked.is_empty() {
        return Ok(Vec::new());
    }
    let folder = tempfile::Builder::new().prefix("hummingbus-check-").tempdir();
    let folder = folder.context("cannot make a folder for temporary files")?;
    let run_dir = folder.path();
    let plan =
        Plan { run_id: format!("{:x}-{:x}", std::process::id(), monotonic_ns()), ..graph.plan.clone() };
    plan.store(run_dir)?;
    let (mut messages, mut warnings, mut described) =
        (known_messages(manifest, graph), Vec::new(), Vec::new());
    // Dropped before the folder: memory of a program that has joined instead of describing itself.
    let _shared_memory = SharedMemory(&plan.run_id);
    for program in asked {
        store_files(&graph.files, run_dir, program.plan)?;
        if program.generation > 0 {
            program.plan.store_backup(run_dir, program.node, program.generation)?;
        }
        match ask(manifest, exe, run_dir, program)? {
            Answer::Described(description) => {
                for (output, message) in program.plan.outputs.iter().zip(&description.outputs) {
                    messages.entry(output.topic).or_insert_with(|| message.clone());
                }
                described.push((program, description));
            }
            Answer::Silent(warning) => warnings.push(*warning),
        }
    }
    for (program, description) in &described {
        compare(manifest, graph, *program, description, &messages)?;
    }
    Ok(warnings)
}

/// Shared memory that a program of an older version may leave: such a program joins as if there were a run.
struct SharedMemory<'p>(&'p str);

impl Drop for SharedMemory<'_> {
    fn drop(&mut self) {
        shared_memory_of(self.0).iter().for_each(|path| drop(std::fs::remove_file(path)));
    }
}

/// The programs of `graph` that are not components, with those that take their places.
fn asked(graph: &Graph) -> Vec<Asked<'_>> {
    let first = graph.plan.nodes.iter().zip(&graph.programs).enumerate();
    let first = first.map(|(node, (plan, program))| Asked { node, generation: 0, plan, program });
    let mut generations: BTreeMap<usize, u32> = BTreeMap::new();
    let backups = graph.backups.iter().map(|backup| {
        let generation = generations.entry(backup.node).or_default();
        *generation += 1;
        Asked { node: backup.node, generation: *generation, plan: &backup.plan, program: &backup.program }
    });
    first.chain(backups).filter(|asked| asked.program.component().is_none()).collect()
}

/// Messages of the topics that components send or read by their types, by the numbers of the topics.
fn known_messages(manifest: &Manifest, graph: &Graph) -> BTreeMap<usize, Announcement> {
    let of_components = graph.plan.nodes.iter().zip(&graph.programs);
    let of_components = of_components.filter_map(|(node, program)| Some((node, program.component()?)));
    let topics = of_components.flat_map(|(node, component)| {
        let is_typed = matches!(component.inputs, Inputs::Ports(_) | Inputs::Many(_));
        let read = node.inputs.iter().filter(move |_| is_typed).map(|input| input.topic);
        read.chain(node.outputs.iter().map(|output| output.topic))
    });
    let announced = topics.filter_map(|topic| {
        let schema = manifest.registry().message(&graph.plan.topics[topic].type_name)?;
        Some((topic, Announcement::of(schema)))
    });
    announced.collect()
}

/// Answer of a program.
enum Answer {
    Described(Description),
    /// It has declared nothing, but may fly.
    Silent(Box<Diagnostic>),
}

fn ask(manifest: &Manifest, exe: &Path, run_dir: &Path, asked: Asked<'_>) -> Result<Answer> {
    let Asked { node, generation, plan, program } = asked;
    // The place where the manifest has the output of its runs is not for that of a check.
    let mut program = Program { log: None, ..program.clone() };
    program.environment.insert(DESCRIBE_VARIABLE.to_owned(), "1".to_owned());
    let role = Role::Node { node, generation };
    let (mut child, log) = start(exe, run_dir, &plan.name, role, Started::One(&program), None)?;
    let ended = wait(&mut child);
    // Also what it has started itself.
    bus::process::kill_group(child.id());
    if let Some(description) = Description::load(run_dir, node, generation)? {
        return Ok(Answer::Described(description));
    }
    let who = format!("process `{}`", plan.name);
    let said = process_log::last_words(&log).join("\n  ");
    match ended {
        Some(status) if !status.success() => {
            let message = format!("{who} would not take part in a run: it ended with {status}\n  {said}");
            Err(problem(
                manifest,
                &plan.name,
                message,
                "correct the manifest or the program as its output says",
            )
            .into())
        }
        ended => {
            let why = if ended.is_some() { "it exited with code 0" } else { "it was stopped after 20 s" };
            let message = format!("{who} did not report its ports: {why}");
            let help = "a program that joins by this version of hummingbus answers; its ports are compared when a run begins";
            Ok(Answer::Silent(Box::new(problem(manifest, &plan.name, message, help))))
        }
    }
}

/// The end of a process; `None` if it went on, and was killed.
fn wait(child: &mut Child) -> Option<ExitStatus> {
    let end_ns = monotonic_ns() + PATIENCE.as_nanos() as u64;
    while monotonic_ns() < end_ns {
        if let Ok(Some(status)) = child.try_wait() {
            return Some(status);
        }
        std::thread::sleep(POLL);
    }
    bus::process::kill_group(child.id());
    let _ = child.wait();
    None
}

/// Requires that the inputs and outputs of `asked` have the layouts of the others on the same topics.
fn compare(
    manifest: &Manifest,
    graph: &Graph,
    asked: Asked<'_>,
    description: &Description,
    messages: &BTreeMap<usize, Announcement>,
) -> Result<()> {
    let inputs = asked.plan.inputs.iter().zip(&description.inputs);
    let inputs =
        inputs.filter_map(|(input, message)| Some((input.topic, &input.port, message.as_ref()?, "reads")));
    let outputs = asked.plan.outputs.iter().zip(&description.outputs);
    let outputs = outputs.map(|(output, message)| (output.topic, &output.port, message, "sends"));
    for (topic, port, declared, verb) in inputs.chain(outputs) {
        let Some(sent) = messages.get(&topic).filter(|sent| sent.layout_hash != declared.layout_hash) else {
            continue;
        };
        let topic = &graph.plan.topics[topic].name;
        let message = format!(
            "layout mismatch on topic {topic}: process `{}` {verb} its port `{port}` as\n{}\nand the other side has\n{}",
            asked.plan.name, declared.layout, sent.layout
        );
        let help = "build the program anew with the message of the other side, or the other side with that of the program";
        return Err(problem(manifest, &asked.plan.name, message, help).into());
    }
    Ok(())
}

/// A problem of the `command` of process `name`; of the manifest as a whole where a set or a swap names it.
fn problem(manifest: &Manifest, name: &str, message: String, help: &str) -> Diagnostic {
    let mut processes = manifest.content.process.iter();
    let process = processes.find(|(process, _)| process.get_ref() == name).map(|(_, process)| process);
    match process.and_then(|process| process.command.as_ref()) {
        Some(command) => manifest.problem(&command.span(), message, help),
        None => Diagnostic::in_file(manifest.path.display().to_string(), message).help(help),
    }
}
