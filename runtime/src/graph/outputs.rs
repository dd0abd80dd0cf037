//! Outputs: which topics a run has, of which type, from whom and how often.

use super::processes::{DeclaredNode, period_ticks};
use crate::manifest::{Manifest, OutputSetting, Process};
use crate::program::Executable;
use bus::plan::{OutputPlan, TopicPlan};
use bus::ports::PortSpec;
use bus::schema::Schema;
use diagnostics::{Diagnostic, did_you_mean};
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
pub fn publish_all(
    manifest: &Manifest,
    declared_nodes: &[DeclaredNode<'_>],
) -> Result<Vec<Published>, Diagnostic> {
    let mut all: Vec<Published> = Vec::new();
    for (node, declared) in declared_nodes.iter().enumerate() {
        for output in published_by(manifest, node, declared)? {
            if let Some(other) = all.iter().find(|other| other.topic.name == output.topic.name) {
                let message = format!(
                    "two publishers on topic {}: `{}` and `{}`",
                    output.topic.name,
                    declared_nodes[other.node].name.get_ref(),
                    declared.name.get_ref()
                );
                let help = format!(
                    "give one of them another topic: [process.{}.outputs] {} = {{ topic = \"/…\" }}",
                    declared.name.get_ref(),
                    output.port
                );
                return Err(manifest.problem(&output.span, message, help));
            }
            all.push(output);
        }
    }
    Ok(all)
}

fn published_by(
    manifest: &Manifest,
    node: usize,
    declared: &DeclaredNode<'_>,
) -> Result<Vec<Published>, Diagnostic> {
    let DeclaredNode { name, process, program } = declared;
    let period = period_ticks(manifest, process)?;
    let declared: Vec<(&str, Option<&'static Schema>)> = match &program.executable {
        Executable::Component(kind) => {
            let names = process.outputs.keys().map(|port| (port.get_ref().as_str(), port.span()));
            require_known_ports(manifest, "output", name, kind.outputs, names)?;
            let is_on = |port: &&PortSpec| port.required || setting(process, port.name).is_some();
            kind.outputs.iter().filter(is_on).map(|port| (port.name, Some(port.schema))).collect()
        }
        Executable::Command(_) => {
            process.outputs.keys().map(|port| (port.get_ref().as_str(), None)).collect()
        }
    };
    let published = declared.into_iter().map(|(port, schema)| {
        let (span, setting) = setting(process, port).map_or((name.span(), None), |(s, o)| (s, Some(o)));
        let type_name = type_name(manifest, &span, port, schema, setting)?;
        let period_ticks = output_period(manifest, &span, port, period, setting)?;
        let topic = setting.and_then(|setting| setting.topic.clone());
        let topic = topic.unwrap_or_else(|| format!("/{}/{port}", name.get_ref()));
        require_topic_name(manifest, &span, &topic)?;
        let topic = TopicPlan { name: topic, type_name, period_ticks };
        Ok(Published { node, port: port.to_owned(), span, topic })
    });
    published.collect()
}

fn setting<'a>(process: &'a Process, port: &str) -> Option<(Range<usize>, &'a OutputSetting)> {
    let mut outputs = process.outputs.iter();
    outputs.find(|(name, _)| name.get_ref() == port).map(|(name, setting)| (name.span(), setting))
}

fn type_name(
    manifest: &Manifest,
    span: &Range<usize>,
    port: &str,
    schema: Option<&'static Schema>,
    setting: Option<&OutputSetting>,
) -> Result<String, Diagnostic> {
    let stated = setting.and_then(|setting| setting.type_name.as_deref());
    match (schema.map(|schema| schema.type_name), stated) {
        (Some(known), Some(stated)) if known != stated => {
            let message = format!("output `{port}` is stated as {stated}, the kind publishes {known}");
            Err(manifest.problem(span, message, "leave `type` out: a built-in kind knows it"))
        }
        (Some(name), _) | (None, Some(name)) => Ok(name.to_owned()),
        (None, None) => Err(manifest.problem(
            span,
            format!("output `{port}` of a command has no `type`"),
            "add type = \"hummingbus_msgs/msg/MotorCommand\", for example; `hummingbus schema` lists the types",
        )),
    }
}

fn output_period(
    manifest: &Manifest,
    span: &Range<usize>,
    port: &str,
    node_period: u32,
    setting: Option<&OutputSetting>,
) -> Result<u32, Diagnostic> {
    match setting.and_then(|setting| setting.every_ticks) {
        None => Ok(node_period),
        Some(every) if every > 0 && every.is_multiple_of(node_period) => Ok(every),
        Some(every) => Err(manifest.problem(
            span,
            format!("output `{port}` is due every {every} ticks, its process runs every {node_period}"),
            "`every_ticks` must be a multiple of the process's `period_ticks`",
        )),
    }
}

fn require_topic_name(manifest: &Manifest, span: &Range<usize>, topic: &str) -> Result<(), Diagnostic> {
    let fits = |c: char| c.is_ascii_alphanumeric() || "/_-".contains(c);
    if topic.starts_with('/') && topic.len() > 1 && topic.len() <= 200 && topic.chars().all(fits) {
        return Ok(());
    }
    let help = "a topic starts with `/` and has letters, digits, `_`, `-` and `/`";
    Err(manifest.problem(span, format!("`{topic}` cannot name a topic"), help))
}

pub fn require_known_ports(
    manifest: &Manifest,
    direction: &str,
    process: &Spanned<String>,
    ports: &[PortSpec],
    used: impl Iterator<Item = (impl AsRef<str>, Range<usize>)>,
) -> Result<(), Diagnostic> {
    for (name, span) in used {
        let name = name.as_ref();
        if ports.iter().all(|port| port.name != name) {
            let known = ports.iter().map(|port| port.name);
            let message = format!("process `{}` has no {direction} `{name}`", process.get_ref());
            return Err(manifest.problem(&span, message, did_you_mean(name, known, "it has")));
        }
    }
    Ok(())
}

/// The outputs of node `node`.
pub fn outputs(published: &[Published], node: usize) -> Vec<OutputPlan> {
    let topics = published.iter().enumerate().filter(|(_, output)| output.node == node);
    topics.map(|(topic, output)| OutputPlan { port: output.port.clone(), topic }).collect()
}
