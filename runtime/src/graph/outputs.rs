//! Outputs: which topics a run has, of which type, from whom and how often.

use super::processes::{DeclaredNode, period_ticks, sample_ticks};
use crate::manifest::{Manifest, OutputSetting, Process};
use crate::program::Executable;
use bus::Registration;
use bus::plan::{OutputPlan, TopicPlan};
use bus::ports::{Inputs, PortSpec};
use bus::sample_ticks::SampleTicks;
use bus::schema::Schema;
use diagnostics::{Diagnostic, did_you_mean};
use std::collections::BTreeMap;
use std::ops::Range;
use toml::Spanned;

/// An output on its way to a topic.
pub struct Published {
    /// Index of the node that sends it.
    pub node: usize,
    /// Its topic in the plan.
    pub topic: TopicPlan,
    /// The topic whose messages it forwards, if it does; its type is that of the forwarded messages.
    forwards: Option<String>,
    /// The port's name in the node.
    pub port: String,
    /// Place of the port in the manifest; that of the node if the manifest does not name the port.
    pub span: Range<usize>,
}

/// Refuses outputs of `declared` that cannot be.
pub fn require_outputs(declared: &DeclaredNode<'_>) -> Result<(), Diagnostic> {
    published_by(0, declared).map(drop)
}

/// Returns all outputs of `declared_nodes`, each with its topic; refuses two on one topic.
pub fn publish_all(declared_nodes: &[DeclaredNode<'_>]) -> Result<Vec<Published>, Diagnostic> {
    let mut all: Vec<Published> = Vec::new();
    for (node, declared) in declared_nodes.iter().enumerate().filter(|(_, declared)| !declared.is_unchecked) {
        for output in published_by(node, declared)? {
            let (topic, port, name) = (&output.topic.name, &output.port, declared.name.get_ref());
            if let Some(other) = all.iter().find(|other| other.topic.name == *topic) {
                let other = declared_nodes[other.node].name.get_ref();
                let message = format!("two publishers on topic {topic}: `{other}` and `{name}`");
                let help = format!(
                    "give one of them another topic: [process.{name}.outputs] {port} = {{ topic = \"/…\" }}"
                );
                return Err(declared.manifest.problem(&output.span, message, help));
            }
            all.push(output);
        }
    }
    for (node, declared) in declared_nodes.iter().enumerate().filter(|(_, declared)| declared.is_unchecked) {
        publish_unchecked(node, declared, &mut all);
    }
    resolve_forwarded(declared_nodes, &mut all)?;
    Ok(all)
}

/// Adds the topics that an unchecked node may send: those that it states, and those that others expect of it.
fn publish_unchecked(node: usize, declared: &DeclaredNode<'_>, all: &mut Vec<Published>) {
    let DeclaredNode { manifest, name, process, .. } = declared;
    let prefix = format!("/{}/", name.get_ref());
    // A name with capital letters is itself the fault.
    let is_own = |topic: &&str| topic.to_lowercase().starts_with(&prefix.to_lowercase());
    let stated = process.outputs.iter().map(|(port, setting)| {
        let topic = setting.topic.clone().unwrap_or_else(|| format!("{prefix}{}", port.get_ref()));
        (topic, setting.type_name.clone().unwrap_or_default())
    });
    let inputs = manifest.content.process.values().flat_map(|process| process.inputs.values());
    let conditions = manifest.content.conditions();
    let expected = inputs.map(|input| input.topic.as_str()).chain(conditions.topics());
    let expected = expected.filter(is_own);
    let expected = expected.map(|topic| (topic.to_owned(), String::new()));
    for (name, type_name) in stated.chain(expected) {
        if all.iter().all(|known| known.topic.name != name) {
            let topic = TopicPlan { name, type_name, ticks: SampleTicks::every(1) };
            let (port, span) = (topic.name.replacen(&prefix, "", 1), declared.name.span());
            all.push(Published { node, topic, forwards: None, port, span });
        }
    }
}

/// Gives the outputs that forward a topic its type.
fn resolve_forwarded(declared_nodes: &[DeclaredNode<'_>], all: &mut [Published]) -> Result<(), Diagnostic> {
    // A forwarded message may be forwarded again: each pass finds the type of one sender more.
    for _ in 0..all.len() {
        for index in 0..all.len() {
            let Some(forwards) = &all[index].forwards else { continue };
            let source =
                all.iter().find(|output| output.topic.name == *forwards && output.forwards.is_none());
            let Some(type_name) = source.map(|source| source.topic.type_name.clone()) else { continue };
            let output = &mut all[index];
            let declared = &declared_nodes[output.node];
            if !type_name.is_empty() {
                require_forwardable(declared, output, &type_name)?;
            }
            output.topic.type_name = type_name;
            output.forwards = None;
        }
    }
    let Some(unknown) = all.iter().find(|output| output.forwards.is_some()) else { return Ok(()) };
    let forwards = unknown.forwards.as_deref().unwrap_or_default();
    let declared = &declared_nodes[unknown.node];
    let who = format!("input `{}` of `{}`", unknown.port, declared.name.get_ref());
    let is_published = all.iter().any(|output| output.topic.name == forwards);
    let (message, help) = if is_published {
        (
            format!("{who}: {forwards} is forwarded in a circle"),
            "wire a topic that a process makes itself".to_owned(),
        )
    } else {
        let known = all.iter().map(|output| output.topic.name.as_str());
        (format!("{who}: nobody publishes {forwards}"), did_you_mean(forwards, known, "the topics are"))
    };
    Err(declared.manifest.problem(&unknown.span, message, help))
}

/// Refuses to forward messages that the process cannot carry, or under another type.
fn require_forwardable(
    declared: &DeclaredNode<'_>,
    output: &Published,
    type_name: &str,
) -> Result<(), Diagnostic> {
    let Published { port, topic, span, .. } = output;
    let who = format!("output `{port}` of `{}`", declared.name.get_ref());
    let at = |message: String, help: &str| Err(declared.manifest.problem(span, message, help));
    if !topic.type_name.is_empty() && topic.type_name != type_name {
        let message =
            format!("{who} is stated as {}, its input `{port}` carries {type_name}", topic.type_name);
        return at(message, "leave `type` out: an output that forwards a topic has its type");
    }
    let Some(schema) = declared.manifest.registry().message(type_name) else {
        let message = format!("{who} forwards {type_name}, which no built-in kind knows");
        return at(message, "wire a topic of a message that `hummingbus schema` lists");
    };
    let Some(Inputs::Forwarded { bytes_max }) = declared.program.component().map(|kind| kind.inputs) else {
        return Ok(());
    };
    if schema.has_text() || schema.size > bytes_max {
        let why =
            if schema.has_text() { "has text".to_owned() } else { format!("has {} bytes", schema.size) };
        let message = format!("{who} forwards {type_name}, which {why}");
        return at(message, &format!("wire a topic of a message of numbers with at most {bytes_max} bytes"));
    }
    Ok(())
}

fn published_by(node: usize, declared: &DeclaredNode<'_>) -> Result<Vec<Published>, Diagnostic> {
    let DeclaredNode { manifest, name, process, program, .. } = declared;
    let period = period_ticks(manifest, process, program.component())?;
    let ticks = sample_ticks(manifest, process, program.component(), period);
    let outputs: Vec<(&str, Carries)> = match &program.executable {
        Executable::Component(kind) => {
            let forwarded = forwarded_ports(declared, kind)?;
            let names =
                kind.outputs.iter().map(|port| port.name).chain(forwarded.iter().map(|(port, _)| *port));
            require_known_ports(declared, "output", names, &process.outputs)?;
            let is_on = |port: &&PortSpec| port.required || setting(process, port.name).is_some();
            let declared_ports = kind.outputs.iter().filter(is_on);
            let known = declared_ports.map(|port| (port.name, Carries::Known(port.schema)));
            known
                .chain(forwarded.into_iter().map(|(port, topic)| (port, Carries::Forwarded(topic))))
                .collect()
        }
        Executable::Program(_) | Executable::Command(_) => {
            process.outputs.keys().map(|port| (port.get_ref().as_str(), Carries::Stated)).collect()
        }
    };
    let published = outputs.into_iter().map(|(port, carries)| {
        let forwards = if let Carries::Forwarded(topic) = &carries { Some(topic.clone()) } else { None };
        let (topic, span) = topic(manifest, name, (period, ticks), port, &carries, setting(process, port))?;
        Ok(Published { node, port: port.to_owned(), span, topic, forwards })
    });
    published.collect()
}

/// Source of an output's message type.
enum Carries {
    /// The kind.
    Known(&'static Schema),
    /// The topic that is forwarded.
    Forwarded(String),
    /// The manifest.
    Stated,
}

/// The inputs of a kind that forwards them, and their topics.
fn forwarded_ports<'a>(
    declared: &DeclaredNode<'a>,
    kind: &Registration,
) -> Result<Vec<(&'a str, String)>, Diagnostic> {
    let Inputs::Forwarded { .. } = kind.inputs else { return Ok(Vec::new()) };
    let DeclaredNode { manifest, name, process, .. } = declared;
    if process.inputs.is_empty() {
        let message = format!("process `{}` has no input", name.get_ref());
        let help = "name what it forwards under inputs, such as inputs.set_point = { topic = \"/pilot/set_point\", \
                    delay_ticks = 1, initial = {} }";
        return Err(manifest.problem(&name.span(), message, help));
    }
    if let Some(port) =
        process.inputs.keys().find(|port| kind.outputs.iter().any(|output| output.name == port.get_ref()))
    {
        let message =
            format!("input `{}` of `{}` is called like an output of its own", port.get_ref(), name.get_ref());
        return Err(manifest.problem(&port.span(), message, "call it otherwise: its output has its name"));
    }
    Ok(process.inputs.iter().map(|(port, input)| (port.get_ref().as_str(), input.topic.clone())).collect())
}

type Stated<'a> = (&'a Spanned<String>, &'a OutputSetting);

fn setting<'a>(process: &'a Process, port: &str) -> Option<Stated<'a>> {
    process.outputs.iter().find(|(name, _)| name.get_ref() == port)
}

/// The topic of the output `port` of a node, and the place that declares it. The node computes every `period`
/// ticks and has something new at `ticks`.
fn topic(
    manifest: &Manifest,
    node: &Spanned<String>,
    (period, ticks): (u32, SampleTicks),
    port: &str,
    carries: &Carries,
    stated: Option<Stated<'_>>,
) -> Result<(TopicPlan, Range<usize>), Diagnostic> {
    let span = stated.map_or_else(|| node.span(), |(name, _)| name.span());
    let at = |message: String, help: &str| Err(manifest.problem(&span, message, help));
    let OutputSetting { topic, every_ticks, type_name } =
        stated.map(|(_, setting)| setting.clone()).unwrap_or_default();
    let type_name = match (carries, type_name) {
        (Carries::Known(schema), Some(stated)) if schema.type_name != stated => {
            let known = schema.type_name;
            let message = format!("output `{port}` is stated as {stated}, the kind publishes {known}");
            return at(message, "leave `type` out: a built-in kind knows it");
        }
        (Carries::Known(schema), _) => schema.type_name.to_owned(),
        // Nothing yet: it follows from the topic.
        (Carries::Forwarded(_), stated) => stated.unwrap_or_default(),
        (Carries::Stated, Some(stated)) => stated,
        (Carries::Stated, None) => {
            let help = "add type = \"hummingbus_msgs/msg/MotorCommand\", for example; `hummingbus schema` lists the types";
            return at(format!("output `{port}` of `{}` has no `type`", node.get_ref()), help);
        }
    };
    let ticks = match every_ticks {
        None => ticks,
        Some(every) if every > 0 && every.is_multiple_of(period) => SampleTicks::every(every),
        Some(every) => return Err(unequal_periods(manifest, (node, period), (port, every), &span)),
    };
    let name = topic.unwrap_or_else(|| format!("/{}/{port}", node.get_ref()));
    let fits = |c: char| c.is_ascii_alphanumeric() || "/_-".contains(c);
    if !(name.starts_with('/') && (2..=200).contains(&name.len()) && name.chars().all(fits)) {
        let help = "a topic starts with `/` and has letters, digits, `_`, `-` and `/`";
        return at(format!("`{name}` cannot name a topic"), help);
    }
    Ok((TopicPlan { name, type_name, ticks }, span))
}

/// Error of an output that is due at other ticks than its process computes; where a `--set` states one of the periods, it is to
/// blame, else the output at `span`.
fn unequal_periods(
    manifest: &Manifest,
    (node, period): (&Spanned<String>, u32),
    (port, every): (&str, u32),
    span: &Range<usize>,
) -> Diagnostic {
    let node = node.get_ref();
    let rate = |ticks: u32| rate_text(*manifest.content.run.rate_hz.get_ref(), ticks);
    let message = format!(
        "output `{port}` is due every {every} ticks ({}), its process runs every {period} ({})",
        rate(every),
        rate(period)
    );
    let below = (every / period).max(1) * period;
    let help = format!(
        "`every_ticks` must be a multiple of the process's `period_ticks`: {below} ({}) or {} ({}), for example",
        rate(below),
        below + period,
        rate(below + period)
    );
    let keys = [format!("process.{node}.outputs.{port}.every_ticks"), format!("process.{node}.period_ticks")];
    let set = keys.iter().find_map(|key| manifest.sources.set_at(key));
    let in_file = || {
        let [_, at] = manifest.sources.inside(span, &["every_ticks"]);
        at
    };
    manifest.problem(&set.unwrap_or_else(in_file), message, help)
}

/// Rate of a period of `ticks`, with three digits behind the point at most.
pub fn rate_text(rate_hz: u32, ticks: u32) -> String {
    if ticks == 0 {
        return "never".to_owned();
    }
    format!("{} Hz", (f64::from(rate_hz) * 1e3 / f64::from(ticks)).round() / 1e3)
}

/// Refuses ports in use that are none of `ports`.
pub fn require_known_ports<'n, T>(
    declared: &DeclaredNode<'_>,
    direction: &str,
    ports: impl Iterator<Item = &'n str> + Clone,
    used: &BTreeMap<Spanned<String>, T>,
) -> Result<(), Diagnostic> {
    let is_unknown = |name: &&Spanned<String>| ports.clone().all(|port| port != name.get_ref());
    let Some(unknown) = used.keys().find(is_unknown) else { return Ok(()) };
    let DeclaredNode { manifest, name, program, .. } = declared;
    let (kind, port) = (program.kind().unwrap_or_default(), unknown.get_ref());
    let message = format!("process `{}`: kind `{kind}` has no {direction} `{port}`", name.get_ref());
    let mut help = did_you_mean(port, ports, "it has");
    if let Some(changed) = change_of_kind(declared, unknown) {
        help +=
            &format!("; {changed} keeps the {direction}s: write those of `{kind}` as {direction}s = {{ … }}");
    }
    Err(manifest.problem(&unknown.span(), message, help))
}

/// Name of the text that changes the kind of `declared` alone, where the `port` stays that of the kind before; `None` if the same
/// table states both.
fn change_of_kind(declared: &DeclaredNode<'_>, port: &Spanned<String>) -> Option<String> {
    let DeclaredNode { manifest, name, process, .. } = declared;
    if manifest.sources.argument(&port.span()).is_some() {
        return None;
    }
    let kind = process.kind.as_ref()?;
    if let Some(argument) = manifest.sources.argument(&kind.span()) {
        return Some(argument);
    }
    let is_other =
        |before: &Process| before.kind.as_ref().is_none_or(|before| before.get_ref() != kind.get_ref());
    let is_kept =
        |before: &Process| is_other(before) && before.inputs.keys().any(|input| input.span() == port.span());
    let is_of_before = declared.is_backup() && manifest.content.process.values().any(is_kept);
    is_of_before.then(|| format!("the backup of `{}`", name.get_ref()))
}

/// The outputs of node `node`.
pub fn outputs(published: &[Published], node: usize) -> Vec<OutputPlan> {
    let topics = published.iter().enumerate().filter(|(_, output)| output.node == node);
    topics.map(|(topic, output)| OutputPlan { port: output.port.clone(), topic }).collect()
}
