//! The traffic node: gathers where the vehicles of a run are into one sample, for those that share a room.

use crate::backend::TRAFFIC_MAX;
use bus::kind::{Inputs, NodeKind, PortSpec, RunContext, read_parameters};
use bus::messages::{PlantState, Traffic};
use bus::{BusError, Input, Message, Node, Tick};
use serde::Deserialize;

/// The traffic, for manifests.
pub const KIND: NodeKind = NodeKind {
    name: "traffic",
    summary: "gathers the states of up to 16 plants",
    inputs: Inputs::Many(PlantState::SCHEMA),
    outputs: &[PortSpec::required("traffic", Traffic::SCHEMA)],
    check,
    run,
};

/// It has no parameters.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Parameters {}

fn check(parameters: &serde_json::Value, run: &RunContext<'_>) -> Result<(), String> {
    let Parameters {} = read_parameters(parameters)?;
    let inputs = run.ports;
    if inputs.len() <= TRAFFIC_MAX {
        Ok(())
    } else {
        Err(format!("{} inputs, expected at most {TRAFFIC_MAX} vehicles", inputs.len()))
    }
}

fn run() -> Result<(), BusError> {
    let mut node = Node::join()?;
    let states = node.every_input::<PlantState>();
    let output = node.output::<Traffic>("traffic")?;
    node.run(|tick| {
        let traffic = gathered(tick, &states);
        tick.write(output, traffic)
    })
}

#[allow(clippy::cast_possible_truncation, reason = "at most TRAFFIC_MAX")]
fn gathered(tick: &Tick<'_>, states: &[Input<PlantState>]) -> Traffic {
    let mut traffic = Traffic { count: states.len() as u32, ..Default::default() };
    for (number, state) in states.iter().enumerate() {
        let state = tick.get(*state);
        traffic.position[number] = state.position;
        traffic.velocity[number] = state.velocity;
    }
    traffic
}
