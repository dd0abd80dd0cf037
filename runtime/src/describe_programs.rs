//! Ports of a manifest's programs: each program is asked for them, so that a check finds the errors of a run.
//!
//! Each `command` that takes part in the ticks is started once, in a temporary run directory, and ends where it would connect
//! ([`bus::description`]).

use crate::graph::Graph;
use crate::host_world::store_files;
use crate::manifest::Manifest;
use crate::process_log;
use crate::program::{HOW_TO_JOIN, Program};
use crate::role::Role;
use crate::run_dir::shared_memory_of;
use crate::spawn::{Started, start};
use anyhow::Context;
use bus::announcement::Announcement;
use bus::description::{DESCRIBE_VARIABLE, Description};
use bus::host_time::monotonic_ns;
use bus::plan::{NodePlan, Plan};
use bus::ports::Inputs;
use diagnostics::{Diagnostic, Error};
use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Child, ExitStatus};
use std::time::Duration;
use toml::Spanned;

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
pub fn check_programs(manifest: &Manifest, graph: &Graph, exe: &Path) -> Result<Vec<Diagnostic>, Error> {
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
                    let side =
                        || Side::of_port(&program.plan.name, "sends", &output.port, message.clone(), false);
                    messages.entry(output.topic).or_insert_with(side);
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

/// A message as one side of a topic has it.
struct Side {
    /// The process and its port, for people.
    who: String,
    message: Announcement,
    /// True if the message is part of the program that holds the components.
    is_built_in: bool,
}

impl Side {
    fn of_port(process: &str, verb: &str, port: &str, message: Announcement, is_built_in: bool) -> Self {
        Self { who: format!("process `{process}` {verb} its port `{port}`"), message, is_built_in }
    }
}

/// Messages of the topics that components send or read by their types, by the numbers of the topics.
fn known_messages(manifest: &Manifest, graph: &Graph) -> BTreeMap<usize, Side> {
    let of_components = graph.plan.nodes.iter().zip(&graph.programs);
    let of_components = of_components.filter_map(|(node, program)| Some((node, program.component()?)));
    let ports = of_components.flat_map(|(node, component)| {
        let is_typed = matches!(component.inputs, Inputs::Ports(_) | Inputs::Many(_));
        let read = node.inputs.iter().filter(move |_| is_typed);
        let read = read.map(move |input| (node, input.topic, "reads", &input.port));
        read.chain(node.outputs.iter().map(move |output| (node, output.topic, "sends", &output.port)))
    });
    let sides = ports.filter_map(|(node, topic, verb, port)| {
        let schema = manifest.registry().message(&graph.plan.topics[topic].type_name)?;
        Some((topic, Side::of_port(&node.name, verb, port, Announcement::of(schema), true)))
    });
    sides.collect()
}

/// Answer of a program.
enum Answer {
    Described(Description),
    /// It has declared nothing, but may fly.
    Silent(Box<Diagnostic>),
}

fn ask(manifest: &Manifest, exe: &Path, run_dir: &Path, asked: Asked<'_>) -> anyhow::Result<Answer> {
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
        Some(status) => {
            let no_part = format!("{HOW_TO_JOIN}; a program that takes no part is `lockstep = false`");
            let (said, help) = match said.is_empty() {
                false => (format!("\n  {said}"), "correct the manifest or the program as its output says"),
                true => (String::new(), &*no_part),
            };
            let message = format!("{who} would not take part in a run: it ended with {status}{said}");
            let at = named_parameter(&message).unwrap_or_default().to_owned();
            Err(problem(manifest, &plan.name, &at, message, help).into())
        }
        None => {
            let message = format!("{who} did not report its ports within {} s", PATIENCE.as_secs());
            let help = "a program that joins by this version of hummingbus answers; its ports are compared when a run begins";
            Ok(Answer::Silent(Box::new(problem(manifest, &plan.name, "", message, help))))
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
    messages: &BTreeMap<usize, Side>,
) -> anyhow::Result<()> {
    let inputs = asked.plan.inputs.iter().zip(&description.inputs);
    let inputs =
        inputs.filter_map(|(input, message)| Some((input.topic, &input.port, message.as_ref()?, "reads")));
    let outputs = asked.plan.outputs.iter().zip(&description.outputs);
    let outputs = outputs.map(|(output, message)| (output.topic, &output.port, message, "sends"));
    for (topic, port, declared, verb) in inputs.chain(outputs) {
        let other = messages.get(&topic);
        let Some(other) = other.filter(|other| other.message.layout_hash != declared.layout_hash) else {
            continue;
        };
        let topic = &graph.plan.topics[topic].name;
        let message = format!(
            "layout mismatch on topic {topic}: process `{}` {verb} its port `{port}` as\n{}\nand {} as\n{}",
            asked.plan.name, declared.layout, other.who, other.message.layout
        );
        let help = if other.is_built_in {
            "rebuild the program against this version of hummingbus, whose message `hummingbus schema` prints"
        } else {
            "rebuild the program that has the older message"
        };
        return Err(problem(manifest, &asked.plan.name, "", message, help).into());
    }
    Ok(())
}

/// The first parameter that a text of a program names, as in "`parameters.inputs.z` is in `m`".
fn named_parameter(text: &str) -> Option<&str> {
    let mut words = text.split(|c: char| c.is_whitespace() || "`\"',;:()".contains(c));
    let parameter = words.find_map(|word| word.strip_prefix("parameters."))?;
    Some(parameter.trim_end_matches('.'))
}

/// A problem of process `name` at its `parameter`; without one, at its program; of the manifest as a whole where a set or a swap
/// names the process.
fn problem(manifest: &Manifest, name: &str, parameter: &str, message: String, help: &str) -> Diagnostic {
    let mut processes = manifest.content.process.iter();
    let Some((process, settings)) = processes.find(|(process, _)| process.get_ref() == name) else {
        return Diagnostic::in_file(manifest.path.display().to_string(), message).help(help);
    };
    let path: Vec<&str> = parameter.split('.').collect();
    let of_parameter = settings.parameters.keys().find(|key| key.get_ref() == path[0]).map(Spanned::span);
    let of_parameter = of_parameter.map(|at| {
        let [key, _] = manifest.inside(&at, &path[1..], &format!("process.{name}.parameters"));
        key
    });
    let of_program =
        settings.command.as_ref().map(Spanned::span).or(settings.kind.as_ref().map(Spanned::span));
    manifest.problem(&of_parameter.or(of_program).unwrap_or_else(|| process.span()), message, help)
}

#[cfg(test)]
mod tests {
    use super::named_parameter;

    #[test]
    fn a_parameter_is_found_in_the_words_of_a_program() {
        let found = named_parameter("error: `parameters.inputs.positio`: the FMU has no variable `positio`");
        assert_eq!(found, Some("inputs.positio"));
        assert_eq!(named_parameter("parameters.extra is not read; it has no others."), Some("extra"));
        assert_eq!(named_parameter("give parameters.state_bytes, at least 48."), Some("state_bytes"));
        assert_eq!(named_parameter("it ended with exit code 1"), None);
    }
}
