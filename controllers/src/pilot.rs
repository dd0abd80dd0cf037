//! The pilot node: publishes the set points of a schedule.

use crate::set_points::{Schedule, SetPoint as Values, SetPointEntry};
use bus::kind::{Inputs, NodeKind, PortSpec, read_parameters};
use bus::messages::SetPoint;
use bus::{BusError, Message, Node};
use serde::Deserialize;

/// The pilot, for manifests.
pub const KIND: NodeKind = NodeKind {
    name: "pilot",
    summary: "set points from the manifest: steps, ramps and doublets",
    inputs: Inputs::Ports(&[]),
    outputs: &[PortSpec::required("set_point", SetPoint::SCHEMA)],
    check: |parameters, _| schedule(&read_parameters(parameters)?, 1000).map(|_| ()),
    run,
};

/// Parameters of the pilot.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Parameters {
    /// Altitude until the first entry changes it; the angles start at zero.
    initial_altitude_m: f64,
    /// The schedule.
    #[serde(default)]
    set_points: Vec<SetPointEntry>,
}

fn schedule(parameters: &Parameters, rate_hz: u32) -> Result<Schedule, String> {
    let initial = Values { altitude_m: parameters.initial_altitude_m, ..Values::default() };
    Schedule::new(&parameters.set_points, &initial, rate_hz).map_err(|error| error.to_string())
}

fn run() -> Result<(), BusError> {
    let mut node = Node::join()?;
    let output = node.output::<SetPoint>("set_point")?;
    let schedule = schedule(&node.parameters()?, node.rate_hz()).map_err(|error| node.error(error))?;
    node.run(|tick| {
        let asked = schedule.at(u64::from(tick.number()));
        tick.write(
            output,
            SetPoint {
                altitude: asked.altitude_m,
                roll: asked.roll_rad,
                pitch: asked.pitch_rad,
                yaw: asked.yaw_rad,
                ..Default::default()
            },
        )
    })
}
