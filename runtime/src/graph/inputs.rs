//! Inputs: the readers of each topic, their delays, and the order in which a node waits for its inputs.

use super::outputs::{Published, require_known_ports};
use super::processes::DeclaredNode;
use crate::manifest::{Conditions, InputSetting, Manifest};
use crate::placement;
use crate::program::Program;
use bus::plan::{InputPlan, NodePlan, TopicPlan};
use bus::ports::{Inputs, PortSpec};
use diagnostics::{Diagnostic, did_you_mean, nearest};
use std::ops::Range;
use toml::Spanned;

/// The nodes of a run with what they publish, in the order of the topics.
pub struct Senders<'a, 'm> {
    /// The nodes.
    pub declared_nodes: &'a [DeclaredNode<'m>],
    /// Their outputs.
    pub published: &'a [Published],
}

impl Senders<'_, '_> {
    /// Error at the output behind `topic`, if the manifest states its type: the input `reader` of a built-in kind reads `expected`.
    /// `None` if the type is known to be right, or the sender has another output of the expected type, which is meant then.
    fn misstated(&self, topic: usize, expected: &str, reader: &str) -> Option<Diagnostic> {
        let output = &self.published[topic];
        let DeclaredNode { manifest, name, program, .. } = &self.declared_nodes[output.node];
        let is_meant = |other: &&Published| other.node == output.node && other.topic.type_name == expected;
        if program.component().is_some() || self.published.iter().any(|other| is_meant(&other)) {
            return None;
        }
        let (port, found) = (&output.port, &output.topic.type_name);
        let message = format!(
            "output `{port}` of `{}` is stated as {found}, {reader} reads {expected}",
            name.get_ref()
        );
        let help = match manifest.registry().message(found) {
            Some(_) => format!("state type = \"{expected}\", or wire another topic to the input"),
            None => misspelt_type(manifest, found),
        };
        let [_, at] = manifest.sources.inside(&output.span, &["type"]);
        Some(manifest.problem(&at, message, help))
    }
}

/// Advice for a message type that no built-in kind has.
fn misspelt_type(manifest: &Manifest, found: &str) -> String {
    let short = |name: &'static str| name.rsplit('/').next().unwrap_or(name);
    let known: Vec<&'static str> =
        manifest.registry().messages().iter().map(|schema| schema.type_name).collect();
    let written = found.rsplit('/').next().unwrap_or(found);
    let meant = nearest(written, known.iter().map(|name| short(name)));
    match meant.and_then(|meant| known.iter().find(|name| short(name) == meant)) {
        Some(meant) => format!("did you mean `{meant}`?"),
        None => "`hummingbus schema` lists the types".to_owned(),
    }
}

/// The inputs of `declared`, wired to `topics`.
///
/// # Errors
/// A port or topic that is not there, or does not fit.
pub fn inputs(
    declared: &DeclaredNode<'_>,
    topics: &[TopicPlan],
    senders: &Senders<'_, '_>,
) -> Result<Vec<InputPlan>, Diagnostic> {
    let DeclaredNode { manifest, name, process, program, .. } = declared;
    if declared.is_unchecked {
        return Ok(Vec::new());
    }
    match program.component().map(|kind| &kind.inputs) {
        Some(Inputs::Any) if process.inputs.is_empty() => {
            let port = |(topic, plan): (usize, &TopicPlan)| InputPlan {
                port: plan.name.clone(),
                topic,
                delay_ticks: 0,
                initial: None,
            };
            let judged = program.is_judge().then(|| manifest.content.conditions());
            let judged = judged.as_ref().map(Conditions::topics);
            let is_read = |(_, plan): &(usize, &TopicPlan)| {
                judged.as_ref().is_none_or(|judged| judged.contains(plan.name.as_str()))
            };
            return Ok(topics.iter().enumerate().filter(is_read).map(port).collect());
        }
        Some(Inputs::Many(schema)) if process.inputs.is_empty() => {
            let message = format!("process `{}` has no input", name.get_ref());
            let help =
                format!("name topics of {} under inputs, such as inputs.h1 = \"/…\"", schema.type_name);
            return Err(manifest.problem(&name.span(), message, help));
        }
        Some(Inputs::Ports(ports)) => require_ports(declared, ports)?,
        _ => {}
    }
    // A process with a gap may send what nobody seems to publish.
    let has_gaps = !manifest.repairs.processes.is_empty();
    let is_judged =
        |setting: &InputSetting| !has_gaps || topics.iter().any(|topic| topic.name == setting.topic);
    let judged = process.inputs.iter().filter(|(_, setting)| is_judged(setting));
    judged.map(|(port, setting)| input(declared, port, setting, topics, senders)).collect()
}

/// Refuses inputs that are none of `ports`, and the lack of one that is required.
fn require_ports(declared: &DeclaredNode<'_>, ports: &[PortSpec]) -> Result<(), Diagnostic> {
    let DeclaredNode { manifest, name, process, .. } = declared;
    require_known_ports(declared, "input", ports.iter().map(|port| port.name), &process.inputs)?;
    let is_wired = |port: &PortSpec| process.inputs.keys().any(|wired| wired.get_ref() == port.name);
    let Some(missing) = ports.iter().find(|port| port.required && !is_wired(port)) else { return Ok(()) };
    let (process, input, type_name) = (name.get_ref(), missing.name, missing.schema.type_name);
    let message = format!("process `{process}` has no publisher for its input `{input}`");
    let help = format!("add [process.{process}.inputs] {input} = \"/…\", a topic of {type_name}");
    Err(manifest.problem(&name.span(), message, help))
}

fn input(
    declared: &DeclaredNode<'_>,
    port: &Spanned<String>,
    setting: &InputSetting,
    topics: &[TopicPlan],
    senders: &Senders<'_, '_>,
) -> Result<InputPlan, Diagnostic> {
    let DeclaredNode { manifest, name, program, .. } = declared;
    let who = format!("input `{}` of `{}`", port.get_ref(), name.get_ref());
    let at = |parts: &[&str], what: String, help: String| {
        manifest.problem(&place(declared, port, parts), format!("{who}{what}"), help)
    };
    let Some(topic) = topics.iter().position(|topic| topic.name == setting.topic) else {
        let known = topics.iter().map(|topic| topic.name.as_str());
        let help = did_you_mean(&setting.topic, known, "the topics are");
        return Err(at(&["topic"], format!(": nobody publishes {}", setting.topic), help));
    };
    let found = &topics[topic].type_name;
    // The topic of an unchecked node has no type.
    let differs = |expected: &&str| !found.is_empty() && expected != found;
    if let Some(expected) = expected_type(program, port.get_ref()).filter(differs) {
        if let Some(error) = senders.misstated(topic, expected, &who) {
            return Err(error);
        }
        let help = format!("wire a topic of {expected}");
        return Err(at(&["topic"], format!(" reads {expected}, {} carries {found}", setting.topic), help));
    }
    let parts = ["delay_ticks", "initial"];
    let is_set = manifest.sources.is_override(place(declared, port, &parts).start);
    let set = is_set.then(|| format!("{}={}", set_key(declared, port), setting.topic));
    if let Some((what, help)) = bad_delay(program, setting, set.as_deref()) {
        return Err(at(&parts, format!(" {what}"), help));
    }
    if let (Some(schema), Some(initial)) = (manifest.registry().message(found), &setting.initial) {
        let told = bus::initial::sample(schema, initial);
        told.map_err(|reason| {
            at(&["initial"], format!(": initial value: {reason}"), format!("give fields of {found}"))
        })?;
    }
    let (port, delay_ticks) = (port.get_ref().clone(), setting.delay_ticks);
    Ok(InputPlan { port, topic, delay_ticks, initial: setting.initial.clone() })
}

/// Key of the input `port` of `declared`, as `--set` takes it.
fn set_key(declared: &DeclaredNode<'_>, port: &Spanned<String>) -> String {
    format!("process.{}.inputs.{}", declared.name.get_ref(), port.get_ref())
}

/// Place of the input `port` of `declared`: that of a value of `--set` which changes one of these `parts` of it, else its own.
fn place(declared: &DeclaredNode<'_>, port: &Spanned<String>, parts: &[&str]) -> Range<usize> {
    if declared.is_backup() {
        return port.span();
    }
    let key = set_key(declared, port);
    let set = parts.iter().find_map(|part| declared.manifest.sources.set_at(&format!("{key}.{part}")));
    set.unwrap_or_else(|| port.span())
}

/// Fault in the delay and the initial value of an input, and advice; `set` is the value of `--set` that states the whole input, if
/// one changes a part of it.
fn bad_delay(program: &Program, setting: &InputSetting, set: Option<&str>) -> Option<(String, String)> {
    let is_forwarded =
        program.component().is_some_and(|kind| matches!(kind.inputs, Inputs::Forwarded { .. }));
    let (what, help) = match (setting.delay_ticks, &setting.initial) {
        (0, _) if is_forwarded => (
            "is forwarded and has no delay",
            "write { topic = …, delay_ticks = 1, initial = { … } }: nothing is forwarded in no time, and until the first \
             message has come the output is the initial value",
        ),
        (0, None) | (1, Some(_)) => return None,
        (0, Some(_)) => {
            let what = "has an initial value but no delay".to_owned();
            // The file may state the other part, which `--set` alone cannot remove.
            let help = match set {
                Some(set) => {
                    format!("an input without delay has no initial value: set the whole input, {set}")
                }
                None => "add delay_ticks = 1, or leave the initial value out".to_owned(),
            };
            return Some((what, help));
        }
        (1, None) => (
            "is delayed and has no initial value",
            "state what it reads at tick 0, such as initial = { command = [1, 1, 1, 1] }",
        ),
        (delay, _) => {
            return Some((format!("has delay_ticks = {delay}"), "a delay is 0 or 1 tick".to_owned()));
        }
    };
    Some((what.to_owned(), help.to_owned()))
}

/// The type that a built-in node reads on `port`; `None` if it reads any.
fn expected_type(program: &Program, port: &str) -> Option<&'static str> {
    match program.component()?.inputs {
        Inputs::Ports(ports) => {
            Some(ports.iter().find(|spec| spec.name == port).map_or("", |spec| spec.schema.type_name))
        }
        Inputs::Many(schema) => Some(schema.type_name),
        Inputs::Any | Inputs::Forwarded { .. } => None,
    }
}

/// Refuses a cycle of edges without delay: at its first tick every node of it would wait for another.
pub fn require_no_cycle(
    declared_nodes: &[DeclaredNode<'_>],
    nodes: &[NodePlan],
    published: &[Published],
    changed: Option<usize>,
) -> Result<(), Diagnostic> {
    let Some(cycle) = placement::zero_delay_cycle(nodes, |topic| published[topic].node) else {
        return Ok(());
    };
    let path: Vec<&str> =
        cycle.iter().chain(cycle.first()).map(|&node| declared_nodes[node].name.get_ref().as_str()).collect();
    let blamed = &declared_nodes[changed.filter(|node| cycle.contains(node)).unwrap_or(cycle[0])];
    let message = format!("a cycle without delay: {}", path.join(" → "));
    let help =
        "give one input of the cycle delay_ticks = 1 and an initial value, usually the plant's command";
    Err(blamed.manifest.problem(&blamed.name.span(), message, help))
}

/// Puts each node's inputs in the order in which they are waited for: the one that arrives last first.
pub fn order_inputs(nodes: &mut [NodePlan], published: &[Published]) {
    let depths = placement::depths(nodes, |topic| published[topic].node);
    for node in nodes {
        node.inputs.sort_by_key(|input| {
            let producer_depth = if input.delay_ticks == 0 { depths[published[input.topic].node] } else { 0 };
            std::cmp::Reverse(producer_depth)
        });
    }
}
