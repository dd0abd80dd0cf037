//! Ports of a manifest's programs: each program is asked for them, so that a check finds the errors of a run.
//!
//! Each `command` that takes part in the ticks is started once, in a temporary run directory, and ends where it would connect
//! ([`bus::description`]). All of them are started at once, as in a run, so that one patience bounds the wait for those that hang.

use crate::graph::Graph;
use crate::host_world::store_files;
use crate::manifest::Manifest;
use crate::process_log;
use crate::program::{HOW_TO_JOIN, Program, advice_on};
use crate::role::Role;
use crate::run_dir::shared_memory_of;
use crate::spawn::{self, start};
use anyhow::Context;
use bus::announcement::Announcement;
use bus::description::{DESCRIBE_VARIABLE, Description};
use bus::host_time::monotonic_ns;
use bus::plan::{NodePlan, Plan};
use bus::ports::Inputs;
use diagnostics::{Diagnostic, Error};
use std::collections::BTreeMap;
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Child, ExitStatus};
use std::time::Duration;
use toml::Spanned;

const POLL: Duration = Duration::from_millis(2);

/// A program that takes, or may take, a node's part.
#[derive(Clone, Copy)]
struct Asked<'g> {
    node: usize,
    generation: u32,
    plan: &'g NodePlan,
    program: &'g Program,
}

/// A program that was asked. It ends here at the latest, with what it has started itself.
struct Started<'g> {
    asked: Asked<'g>,
    child: Child,
    log: PathBuf,
}

impl Drop for Started<'_> {
    fn drop(&mut self) {
        bus::process::kill_group(self.child.id());
        let _ = self.child.wait();
    }
}

/// Starts the programs that `graph`, the checked `manifest`, names as a `command`, and those of `exe`, the binary
/// with the kinds of the manifest. Compares their declarations with the manifest and with each other.
///
/// # Errors
/// The problem of the first program that would not fly, or the reason why none can be started. A program without an answer is
/// waited for as long as a run waits for it: its `watchdog_ms_host`, from the last answer of another one on.
pub fn check_programs(manifest: &Manifest, graph: &Graph, exe: &Path) -> Result<(), Error> {
    let asked = asked(graph);
    if asked.is_empty() {
        return Ok(());
    }
    let folder = tempfile::Builder::new().prefix("hummingbus-check-").tempdir();
    let folder = folder.context("cannot make a folder for temporary files")?;
    let run_dir = folder.path();
    let plan =
        Plan { run_id: format!("{:x}-{:x}", std::process::id(), monotonic_ns()), ..graph.plan.clone() };
    plan.store(run_dir)?;
    // Dropped before the folder: memory of a program that has joined instead of describing itself.
    let _shared_memory = SharedMemory(&plan.run_id);
    let started: anyhow::Result<Vec<_>> =
        asked.into_iter().map(|asked| begin(graph, exe, run_dir, asked)).collect();
    let (mut messages, mut described) = (known_messages(manifest, graph), Vec::new());
    let mut last_answer_ns = monotonic_ns();
    for program in started? {
        let asked = program.asked;
        let description = answer(manifest, run_dir, program, last_answer_ns)?;
        last_answer_ns = monotonic_ns();
        for (output, message) in asked.plan.outputs.iter().zip(&description.outputs) {
            let side = || Side::of_port(&asked.plan.name, "sends", &output.port, message.clone(), false);
            messages.entry(output.topic).or_insert_with(side);
        }
        described.push((asked, description));
    }
    for (program, description) in &described {
        compare(manifest, graph, *program, description, &messages)?;
    }
    Ok(())
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
    process: String,
    /// The process and its port, for people.
    who: String,
    message: Announcement,
    /// True if the message is part of the program that holds the components.
    is_built_in: bool,
}

impl Side {
    fn of_port(process: &str, verb: &str, port: &str, message: Announcement, is_built_in: bool) -> Self {
        let who = format!("process `{process}` {verb} its port `{port}`");
        Self { process: process.to_owned(), who, message, is_built_in }
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

/// Starts a program in `run_dir` and asks it for its ports.
fn begin<'g>(graph: &Graph, exe: &Path, run_dir: &Path, asked: Asked<'g>) -> anyhow::Result<Started<'g>> {
    let Asked { node, generation, plan, program } = asked;
    store_files(&graph.files, run_dir, plan)?;
    if generation > 0 {
        plan.store_backup(run_dir, node, generation)?;
    }
    // The place where the manifest has the output of its runs is not for that of a check.
    let mut program = Program { log: None, ..program.clone() };
    program.environment.insert(DESCRIBE_VARIABLE.to_owned(), "1".to_owned());
    let role = Role::Node { node, generation };
    let (child, log) = start(exe, run_dir, &plan.name, role, spawn::Started::One(&program), None)?;
    Ok(Started { asked, child, log })
}

/// The declarations of `started`, which has its patience from `since_ns` on.
fn answer(
    manifest: &Manifest,
    run_dir: &Path,
    mut started: Started<'_>,
    since_ns: u64,
) -> anyhow::Result<Description> {
    let Asked { node, generation, plan, program } = started.asked;
    let patience_ns = u64::try_from(program.watchdog.as_nanos()).unwrap_or(u64::MAX);
    let ended = wait(&mut started.child, since_ns.saturating_add(patience_ns));
    if let Some(description) = Description::load(run_dir, node, generation)? {
        return Ok(description);
    }
    let words = process_log::last_words(&started.log);
    let said = words.join("\n  ");
    let fault = match ended {
        Some(status) => format!("it ended with {status}"),
        None => format!("it did not report its ports within {} ms", program.watchdog.as_millis()),
    };
    let help = advice(program, ended, &words);
    let said = if said.is_empty() { said } else { format!("\n  {said}") };
    let message = format!("process `{}` would not take part in a run: {fault}{said}", plan.name);
    let at = named_parameter(&message).unwrap_or_default().to_owned();
    Err(problem(manifest, &plan.name, &at, message, &help).into())
}

/// Advice on `program`, which did not report its ports: its end, if it has ended, and the lines that it wrote last.
fn advice(program: &Program, ended: Option<ExitStatus>, words: &[String]) -> String {
    let how = format!("{HOW_TO_JOIN}; a program that takes no part is `lockstep = false`");
    let Some(status) = ended else {
        return format!("{how}; one that needs longer to start has a longer `watchdog_ms_host`");
    };
    if words.iter().any(|line| !line.is_empty()) {
        let advice = advice_on(words);
        return advice.unwrap_or("its output says what to change in the manifest or the program").to_owned();
    }
    match (status.signal(), program.kind()) {
        (Some(_), Some(kind)) => format!(
            "`{kind}` crashed in the library that it loads, as it would in a run: export the library anew, or report the crash to \
             the makers of its tool"
        ),
        (Some(_), None) => {
            "the program crashed before it had declared its ports: start it in a debugger".to_owned()
        }
        (None, _) => how,
    }
}

/// The end of a process; `None` if it goes on at `end_ns`.
fn wait(child: &mut Child, end_ns: u64) -> Option<ExitStatus> {
    loop {
        if let Ok(Some(status)) = child.try_wait() {
            return Some(status);
        }
        if monotonic_ns() >= end_ns {
            return None;
        }
        std::thread::sleep(POLL);
    }
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
        let name = &asked.plan.name;
        let help = if other.is_built_in {
            format!(
                "rebuild the program of `{name}` against this version of hummingbus, whose message `hummingbus schema` prints"
            )
        } else {
            format!(
                "rebuild the program of `{name}` or that of `{}`: the one with the older message",
                other.process
            )
        };
        return Err(problem(manifest, name, "", message, &help).into());
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
