//! Announcement of a topic in the directory of a run, and the check of every reader.

use crate::error::BusError;
use crate::json_file;
use crate::plan::{InputPlan, NodePlan, Plan};
use crate::schema::Schema;
use std::path::{Path, PathBuf};

pub use ::component::announcement::Announcement;

/// Writes `announcement` to `path`.
pub(crate) fn store(path: &Path, announcement: &Announcement) -> Result<(), BusError> {
    json_file::store(path, announcement)
}

/// Reads the announcement at `path`.
pub(crate) fn load(path: &Path) -> Result<Announcement, BusError> {
    json_file::load(path, "the announcement of a message type")
}

/// Checks that `reader`, built with `schema`, reads the bytes of topic number `topic` of `plan` as they are meant.
pub(crate) fn check(
    announcement: &Announcement,
    schema: &Schema,
    plan: &Plan,
    topic: usize,
    reader: &Reader<'_>,
) -> Result<(), BusError> {
    if announcement.layout_hash == schema.layout_hash() {
        return Ok(());
    }
    let sender = &plan.nodes[plan.publisher(topic)];
    let output = sender.outputs.iter().find(|output| output.topic == topic);
    Err(BusError::LayoutMismatch {
        topic: plan.topics[topic].name.clone(),
        node: reader.node.to_owned(),
        port: reader.port.to_owned(),
        expected: schema.layout(),
        sender: sender.name.clone(),
        sender_port: output.map(|output| output.port.clone()).unwrap_or_default(),
        found: announcement.layout.clone(),
        advice: advice(reader, sender),
    })
}

/// Reader of a topic.
pub(crate) struct Reader<'a> {
    /// Its node.
    pub(crate) node: &'a str,
    /// Its port.
    pub(crate) port: &'a str,
    /// True if its program is part of this project.
    pub(crate) is_built_in: bool,
}

impl<'a> Reader<'a> {
    /// The reader `node` at its `input`.
    pub(crate) fn of(node: &'a NodePlan, input: &'a InputPlan) -> Self {
        Self { node: &node.name, port: &input.port, is_built_in: node.is_built_in }
    }
}

/// Advice on the program to rebuild: a user cannot rebuild a built-in component alone.
fn advice(reader: &Reader<'_>, sender: &NodePlan) -> String {
    let command = match (reader.is_built_in, sender.is_built_in) {
        (true, false) => sender.name.as_str(),
        (false, true) => reader.node,
        _ => {
            return format!(
                "Rebuild the program of node `{}` or that of `{}`: the one with the older message",
                sender.name, reader.node
            );
        }
    };
    format!(
        "Rebuild the program of node `{command}` with this version of hummingbus, whose messages `hummingbus schema` \
         prints"
    )
}

/// Path of the file that announces the type of topic number `topic`.
pub(crate) fn topic_path(run_dir: &Path, topic: usize) -> PathBuf {
    run_dir.join(format!("topic-{topic}.json"))
}
