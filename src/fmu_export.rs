//! A manifest as an FMU: all of it, or some of its processes, but one in whose place the importer of the FMU stands.

use crate::agent::{Actions, registry};
use anyhow::{Context, anyhow, bail};
use bus::component::Role;
use bus::plan::{NodePlan, Plan};
use bus::{Registration, initial};
use diagnostics::{Diagnostic, Error};
use fmu::Version;
use fmu::export::{Contents, Model, ModelVariable, Source};
use inputs::{InputFiles, sha256};
use runtime::graph::Graph;
use runtime::manifest::Manifest;
use std::collections::BTreeSet;
use std::io::Cursor;
use std::path::{Path, PathBuf};

/// Manifest of a vehicle on its own: the plant with an IMU and motion capture, as `manifests/sets/flight.toml` has them.
const VEHICLE: &str = include_str!("fmu_export/vehicle.toml");
/// Ports of an agent.
const PORTS: [&str; 3] = ["command", "set_point", "reference"];

/// Wishes for an FMU.
#[derive(Clone, Debug)]
pub struct Wishes<'w> {
    /// The process in whose place the importer stands.
    pub without: &'w str,
    /// Processes, vehicles and groups of the manifest that go into the FMU; all where empty.
    pub only: &'w [String],
    /// Topics that become outputs; where empty those that the process reads, and the states of plants.
    pub outputs: &'w [String],
    /// Version of the standard.
    pub version: Version,
    /// Values as `--set` has them.
    pub overrides: &'w [String],
}

/// An FMU that was made.
#[derive(Clone, Debug)]
pub struct Exported {
    /// The file.
    pub bytes: Vec<u8>,
    /// Contents.
    pub model: Model,
    /// Inputs that nothing is wired to, since their senders are left out: `PROCESS.INPUT`.
    pub cut: Vec<String>,
}

/// The FMU of the manifest or vehicle file at `path`, with the library `library` of `bindings/fmu-export`.
///
/// # Errors
/// The manifest has a problem, the process is not in it, a node needs a process of its own, or a topic is not there.
/// It also fails if the process sends messages that no importer can send, or a node lacks an input that `only` leaves out.
pub fn export(path: &Path, wishes: &Wishes<'_>, library: &[u8]) -> Result<Exported, Error> {
    let whole = Graph::build(&load(path, wishes.overrides)?)?;
    let replaced = node(&whole.plan, wishes.without)?;
    let kept = kept(&whole.plan, wishes)?;
    let sent = sent(&whole.plan, &kept);
    let outputs = outputs(&whole.plan, replaced, wishes.outputs, &sent)?;
    let agent = agent(&whole, replaced, &kept)?;
    let mut manifest = load(path, &[wishes.overrides, &[agent]].concat())?;
    let cut = match wishes.only {
        [] => Vec::new(),
        _ => manifest.retain(|name| kept.contains(name), |topic| sent.contains(topic)),
    };
    let graph = Graph::build(&manifest).map_err(|fault| explained(fault, &cut))?;
    let simulation = runtime::simulate(&manifest)?;
    let variables = variables(&graph.plan, simulation, wishes.without, &outputs)?;
    Ok(Exported { cut, ..write(&graph, path, wishes, variables, library)? })
}

/// Names of the nodes that go into the FMU, with the one in whose place the importer stands.
fn kept<'p>(plan: &'p Plan, wishes: &Wishes<'_>) -> anyhow::Result<BTreeSet<&'p str>> {
    let names = plan.nodes.iter().map(|node| node.name.as_str());
    if wishes.only.is_empty() {
        return Ok(names.collect());
    }
    let mut kept = BTreeSet::new();
    for asked in wishes.only {
        let group = plan.groups.iter().find(|group| group.name == *asked);
        let of_vehicle = format!("{asked}/");
        let meant = names.clone().enumerate().filter(|(node, name)| {
            name == asked || name.starts_with(&of_vehicle) || group.is_some_and(|group| group.has(*node))
        });
        let meant: Vec<&str> = meant.map(|(_, name)| name).collect();
        if meant.is_empty() {
            let names = names.collect::<Vec<_>>().join(", ");
            bail!("--only: there is no process, vehicle or group `{asked}`; the processes are {names}");
        }
        kept.extend(meant);
    }
    if !kept.contains(wishes.without) {
        bail!(
            "--only leaves out `{}`, in whose place the importer stands: name it there, or another process with --without",
            wishes.without
        );
    }
    Ok(kept)
}

/// The topics that the nodes `kept` send.
fn sent<'p>(plan: &'p Plan, kept: &BTreeSet<&str>) -> BTreeSet<&'p str> {
    let senders = plan.nodes.iter().filter(|node| kept.contains(node.name.as_str()));
    let outputs = senders.flat_map(|node| &node.outputs);
    outputs.map(|output| plan.topics[output.topic].name.as_str()).collect()
}

/// A fault of a part of the manifest, in which the inputs `cut` have lost their senders.
fn explained(fault: Diagnostic, cut: &[String]) -> Diagnostic {
    if cut.is_empty() {
        return fault;
    }
    fault
        .help(format!("--only leaves out the senders of {}: name those that are needed, too", cut.join(", ")))
}

/// The manifest at `path`, or that of the vehicle file there.
fn load(path: &Path, overrides: &[String]) -> anyhow::Result<Manifest> {
    let text = InputFiles::default().text(path).with_context(|| format!("cannot read {}", path.display()))?;
    // A vehicle file has a body, or the one of its base; no manifest has either.
    let is_vehicle = text
        .parse::<toml::Table>()
        .is_ok_and(|table| table.contains_key("body") || table.contains_key("base"));
    if !is_vehicle {
        return Ok(Manifest::load(path, overrides, registry())?);
    }
    let vehicle = vehicles::Vehicle::load(path)?;
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let hover = format!("{:?}", vec![vehicle.hover_command(); vehicle.rotors.len()]);
    let text = VEHICLE.replace("HOVER", &hover).replace("\"VEHICLE\"", &toml::Value::from(name).to_string());
    Ok(Manifest::parse(text, &path.with_file_name("vehicle-as-fmu.toml"), overrides, registry())?)
}

fn node<'p>(plan: &'p Plan, name: &str) -> anyhow::Result<&'p NodePlan> {
    let found = plan.nodes.iter().find(|node| node.name == name);
    found.ok_or_else(|| {
        let names: Vec<&str> = plan.nodes.iter().map(|node| node.name.as_str()).collect();
        anyhow!(
            "there is no process `{name}` to leave out; there are {}: name one with --without",
            names.join(", ")
        )
    })
}

/// The topics that become outputs: the requested ones, else those that the process reads with the states of plants,
/// else all; of those that are `sent`.
fn outputs(
    plan: &Plan,
    replaced: &NodePlan,
    asked: &[String],
    sent: &BTreeSet<&str>,
) -> anyhow::Result<Vec<String>> {
    let all = plan.topics.iter().enumerate().filter(|(_, topic)| sent.contains(topic.name.as_str()));
    for asked in asked {
        if !sent.contains(asked.as_str()) {
            let names: Vec<&str> = all.map(|(_, topic)| topic.name.as_str()).collect();
            bail!("there is no topic {asked}; there are {}", names.join(", "));
        }
    }
    if !asked.is_empty() {
        return Ok(asked.to_vec());
    }
    let is_own = |topic: usize| replaced.outputs.iter().any(|output| output.topic == topic);
    if replaced.inputs.is_empty() {
        return Ok(all.filter(|(topic, _)| !is_own(*topic)).map(|(_, topic)| topic.name.clone()).collect());
    }
    let read = replaced.inputs.iter().map(|input| &plan.topics[input.topic].name);
    let read = read.filter(|name| sent.contains(name.as_str()));
    let states = all.filter(|(_, topic)| topic.type_name.ends_with("/PlantState"));
    let mut outputs: Vec<String> = read.chain(states.map(|(_, topic)| &topic.name)).cloned().collect();
    let mut seen = BTreeSet::new();
    outputs.retain(|topic| seen.insert(topic.clone()));
    Ok(outputs)
}

/// The setting that puts an agent into the place of `replaced`, with the same topics.
fn agent(graph: &Graph, replaced: &NodePlan, kept: &BTreeSet<&str>) -> anyhow::Result<String> {
    let (plan, name) = (&graph.plan, &replaced.name);
    if replaced.computing_time.is_some() {
        bail!(
            "`{name}` has a `computing_time`, which an importer has not: leave the key out, and let the importer wait as long"
        );
    }
    let mut outputs = Vec::new();
    for output in &replaced.outputs {
        let (port, topic) = (&output.port, &plan.topics[output.topic]);
        if !PORTS.contains(&port.as_str()) {
            if !is_read(graph, kept, output.topic) {
                continue;
            }
            bail!(
                "`{name}` sends `{port}` ({}), which an importer cannot; it can send {}: leave another process out",
                topic.type_name,
                PORTS.join(", ")
            );
        }
        let every = topic.ticks.period().map(|ticks| format!(", every_ticks = {ticks}")).unwrap_or_default();
        outputs.push(format!("{port} = {{ topic = {:?}{every} }}", topic.name));
    }
    if outputs.is_empty() {
        bail!("`{name}` sends nothing that another process reads: leave out one that others listen to");
    }
    let (period, outputs) = (replaced.period_ticks, outputs.join(", "));
    Ok(format!("process.{name}={{ kind = \"agent\", period_ticks = {period}, outputs = {{ {outputs} }} }}"))
}

/// True if one of the nodes `kept` reads `topic` that is no recorder and no judge.
fn is_read(graph: &Graph, kept: &BTreeSet<&str>, topic: usize) -> bool {
    let mut nodes = graph.plan.nodes.iter().zip(graph.components());
    nodes.any(|(node, component)| {
        kept.contains(node.name.as_str())
            && component.is_none_or(|component| component.role == Role::Compute)
            && node.inputs.iter().any(|input| input.topic == topic)
    })
}

/// Variables of the simulation: inputs from the outputs of the agent, outputs from the topics, with their values
/// before the first step.
fn variables(
    plan: &Plan,
    mut simulation: bus::Simulation,
    agent: &str,
    outputs: &[String],
) -> anyhow::Result<Vec<ModelVariable>> {
    let mut all = Vec::new();
    let mut actions = Actions::new();
    for output in &node(plan, agent)?.outputs {
        let schema = registry().message(&plan.topics[output.topic].type_name);
        let schema =
            schema.ok_or_else(|| anyhow!("{} is of an unknown type", plan.topics[output.topic].name))?;
        let readers =
            plan.nodes.iter().flat_map(|node| &node.inputs).filter(|input| input.topic == output.topic);
        let value = readers.filter_map(|input| input.initial.as_ref()).next();
        let value = value.cloned().unwrap_or_else(|| serde_json::json!({}));
        let message = initial::message(schema, &value)?;
        actions
            .entry(agent.to_owned())
            .or_default()
            .set(&output.port, &message)
            .map_err(|reason| anyhow!(reason))?;
        let prefix = format!("{}.{}", agent.replace('/', "."), output.port);
        let fields = ModelVariable::all(&prefix, &Source::Port(output.port.clone()), schema, &message);
        if fields.is_empty() {
            bail!(
                "nothing says how many values `{agent}` sends on `{}`: give the input that reads it an `initial` value",
                output.port
            );
        }
        all.extend(fields);
    }
    simulation.step_last(agent)?;
    simulation.begin_step_given(&actions)?;
    for topic in outputs {
        let (type_name, message) = simulation.newest_bytes(topic)?;
        let schema = registry()
            .message(type_name)
            .ok_or_else(|| anyhow!("{topic} carries {type_name}, which is no built-in message"))?;
        let message = message.ok_or_else(|| {
            anyhow!(
                "{topic} depends on what `{agent}` sends in the same tick, so that the FMU has no value of it before a step; \
                 name other topics with --output"
            )
        })?;
        let prefix = topic.trim_start_matches('/').replace('/', ".");
        all.extend(ModelVariable::all(&prefix, &Source::Topic(topic.clone()), schema, message));
    }
    Ok(all)
}

fn write(
    graph: &Graph,
    path: &Path,
    wishes: &Wishes<'_>,
    variables: Vec<ModelVariable>,
    library: &[u8],
) -> anyhow::Result<Exported> {
    let is_stepped = |component: &&'static Registration| component.role == Role::Compute;
    let members = graph.components().enumerate();
    let members =
        members.filter_map(|(node, component)| Some((node, component.filter(is_stepped)?.name.to_owned())));
    let plan = portable(&graph.plan);
    if i32::try_from(plan.seed).is_err() {
        bail!("the seed {} is not one of 32 bits, which an FMU can have: set run.seed", plan.seed);
    }
    let folder = tempfile::tempdir().context("cannot make a folder for temporary files")?;
    plan.store(folder.path())?;
    for node in &graph.plan.nodes {
        graph
            .files
            .store(&folder.path().join(Plan::INPUTS), &node.files)
            .context("cannot write the files of the run")?;
    }
    let mut model = Model {
        name: identifier(path),
        token: String::new(),
        tick_s: plan.tick_s(),
        duration_s: f64::from(plan.duration_ticks) * plan.tick_s(),
        seed: plan.seed,
        agent: wishes.without.to_owned(),
        members: members.collect(),
        variables,
    };
    let contents = serde_json::to_vec(&(&model, &plan)).context("cannot write the model")?;
    model.token = format!("{{{}}}", &sha256(&contents)[..32]);
    let mut bytes = Cursor::new(Vec::new());
    let version = wishes.version;
    fmu::export::write(Contents { model: &model, version, run_dir: folder.path(), library }, &mut bytes)?;
    Ok(Exported { bytes: bytes.into_inner(), model, cut: Vec::new() })
}

/// The plan without references to this machine. Paths begin at `/fmu` instead of the folder that all files
/// lie in. No node has a core, and the memory of the run has no name.
fn portable(plan: &Plan) -> Plan {
    let mut plan = Plan { run_id: "fmu".to_owned(), clock_cpu: None, ..plan.clone() };
    let paths: Vec<PathBuf> =
        plan.nodes.iter().flat_map(|node| node.files.iter().map(|file| file.path.clone())).collect();
    let root = common_folder(&paths);
    let moved = |path: &Path| path.strip_prefix(&root).ok().map(|rest| Path::new("/fmu").join(rest));
    for node in &mut plan.nodes {
        node.cpu = None;
        for file in &mut node.files {
            if let Some(path) = moved(&file.path) {
                file.path = path;
            }
        }
        each_text(&mut node.parameters, &mut |text| {
            if paths.iter().any(|path| path == Path::new(text.as_str()))
                && let Some(path) = moved(Path::new(text.as_str()))
            {
                *text = path.to_string_lossy().into_owned();
            }
        });
    }
    plan
}

/// The deepest folder that all `paths` lie in.
fn common_folder(paths: &[PathBuf]) -> PathBuf {
    let mut folders = paths.iter().filter_map(|path| path.parent());
    let Some(first) = folders.next() else { return PathBuf::from("/") };
    folders.fold(first.to_owned(), |common, folder| {
        common.ancestors().find(|ancestor| folder.starts_with(ancestor)).unwrap_or(Path::new("/")).to_owned()
    })
}

/// Calls `change` on each text in `value`.
fn each_text(value: &mut serde_json::Value, change: &mut dyn FnMut(&mut String)) {
    match value {
        serde_json::Value::String(text) => change(text),
        serde_json::Value::Array(values) => values.iter_mut().for_each(|value| each_text(value, change)),
        serde_json::Value::Object(table) => table.values_mut().for_each(|value| each_text(value, change)),
        _ => {}
    }
}

/// The name of the file at `path` as the name of a library: letters, digits and `_`.
fn identifier(path: &Path) -> String {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let name: String = stem.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    if name.starts_with(|c: char| c.is_ascii_alphabetic()) { name } else { format!("model_{name}") }
}
