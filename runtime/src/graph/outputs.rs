//! Outputs: which topics a run has, of which type, from whom and how often.

use super::processes::{DeclaredNode, period_ticks};
use crate::manifest::{Manifest, OutputSetting, Process};
use crate::program::Executable;
use bus::plan::{OutputPlan, TopicPlan};
use bus::ports::PortSpec;
use bus::schema::Schema;
use diagnostics::{Diagnostic, did_you_mean};
use std::collections::BTreeMap;
use std::ops::Range;
use toml::Spanned;

/// An output on its way to a topic.
pub struct Published {
    /// Index of the node that sends it.
    pub node: usize,
    /// What it becomes in the plan.
    pub topic: TopicPlan,
    port: String,
    span: Range<usize>,
}

/// All outputs of `declared_nodes`, each with its topic; two on one topic are refused.
pub fn publish_all(declared_nodes: &[DeclaredNode<'_>]) -> Result<Vec<Published>, Diagnostic> {
    let mut all: Vec<Published> = Vec::new();
    for (node, declared) in declared_nodes.iter().enumerate() {
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
    Ok(all)
}

fn published_by(node: usize, declared: &DeclaredNode<'_>) -> Result<Vec<Published>, Diagnostic> {
    let DeclaredNode { manifest, name, process, program } = declared;
    let period = period_ticks(manifest, process)?;
    let outputs: Vec<(&str, Option<&'static Schema>)> = match &program.executable {
        Executable::Component(kind) => {
            require_known_ports(declared, "output", kind.outputs, &process.outputs)?;
            let is_on = |port: &&PortSpec| port.required || setting(process, port.name).is_some();
            kind.outputs.iter().filter(is_on).map(|port| (port.name, Some(port.schema))).collect()
        }
        Executable::Command(_) => {
            process.outputs.keys().map(|port| (port.get_ref().as_str(), None)).collect()
        }
    };
    let published = outputs.into_iter().map(|(port, schema)| {
        let (topic, span) = topic(manifest, name, period, port, schema, setting(process, port))?;
        Ok(Published { node, port: port.to_owned(), span, topic })
    });
    published.collect()
}

type Stated<'a> = (&'a Spanned<String>, &'a OutputSetting);

fn setting<'a>(process: &'a Process, port: &str) -> Option<Stated<'a>> {
    process.outputs.iter().find(|(name, _)| name.get_ref() == port)
}

/// The topic of the output `port` of a node that computes every `period` ticks, and the place that says so.
fn topic(
    manifest: &Manifest,
    node: &Spanned<String>,
    period: u32,
    port: &str,
    schema: Option<&'static Schema>,
    stated: Option<Stated<'_>>,
) -> Result<(TopicPlan, Range<usize>), Diagnostic> {
    let span = stated.map_or_else(|| node.span(), |(name, _)| name.span());
    let at = |message: String, help: &str| Err(manifest.problem(&span, message, help));
    let OutputSetting { topic, every_ticks, type_name } =
        stated.map(|(_, setting)| setting.clone()).unwrap_or_default();
    let type_name = match (schema.map(|schema| schema.type_name), type_name) {
        (Some(known), Some(stated)) if known != stated => {
            let message = format!("output `{port}` is stated as {stated}, the kind publishes {known}");
            return at(message, "leave `type` out: a built-in kind knows it");
        }
        (Some(known), _) => known.to_owned(),
        (None, Some(stated)) => stated,
        (None, None) => {
            let help = "add type = \"hummingbus_msgs/msg/MotorCommand\", for example; `hummingbus schema` lists the types";
            return at(format!("output `{port}` of a command has no `type`"), help);
        }
    };
    let period_ticks = every_ticks.unwrap_or(period);
    if period_ticks == 0 || !period_ticks.is_multiple_of(period) {
        let message =
            format!("output `{port}` is due every {period_ticks} ticks, its process runs every {period}");
        return at(message, "`every_ticks` must be a multiple of the process's `period_ticks`");
    }
    let name = topic.unwrap_or_else(|| format!("/{}/{port}", node.get_ref()));
    let fits = |c: char| c.is_ascii_alphanumeric() || "/_-".contains(c);
    if !(name.starts_with('/') && (2..=200).contains(&name.len()) && name.chars().all(fits)) {
        let help = "a topic starts with `/` and has letters, digits, `_`, `-` and `/`";
        return at(format!("`{name}` cannot name a topic"), help);
    }
    Ok((TopicPlan { name, type_name, period_ticks }, span))
}

/// Refuses ports in use that are none of `ports`.
pub fn require_known_ports<T>(
    declared: &DeclaredNode<'_>,
    direction: &str,
    ports: &[PortSpec],
    used: &BTreeMap<Spanned<String>, T>,
) -> Result<(), Diagnostic> {
    let is_unknown = |name: &&Spanned<String>| ports.iter().all(|port| port.name != name.get_ref());
    let Some(unknown) = used.keys().find(is_unknown) else { return Ok(()) };
    let help = did_you_mean(unknown.get_ref(), ports.iter().map(|port| port.name), "it has");
    let message = format!("process `{}` has no {direction} `{}`", declared.name.get_ref(), unknown.get_ref());
    Err(declared.manifest.problem(&unknown.span(), message, help))
}

/// The outputs of node `node`.
pub fn outputs(published: &[Published], node: usize) -> Vec<OutputPlan> {
    let topics = published.iter().enumerate().filter(|(_, output)| output.node == node);
    topics.map(|(topic, output)| OutputPlan { port: output.port.clone(), topic }).collect()
}
