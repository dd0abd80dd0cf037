//! The geometric controller node: a trajectory's reference to four motor commands.

use crate::allocation::{Allocation, RotorSet};
use crate::controller;
use crate::geometric_gains::GeometricGains;
use crate::geometric_law::GeometricLaw;
use bus::kind::{Inputs, NodeKind, PortSpec, read_parameters};
use bus::messages::{AttitudeEstimate, ControlStatus, MotorCommand, Reference, StateEstimate};
use bus::{BusError, Message, Node};
use serde::Deserialize;
use std::path::PathBuf;
use vehicles::Vehicle;

/// The geometric controller, for manifests.
pub const KIND: NodeKind = NodeKind {
    name: "geometric",
    summary: "tracking on SE(3) (Lee, Leok, McClamroch 2010) with jerk and snap fed forward",
    inputs: Inputs::Ports(&[
        PortSpec::required("reference", Reference::SCHEMA),
        PortSpec::required("estimate", StateEstimate::SCHEMA),
        PortSpec::optional("attitude", AttitudeEstimate::SCHEMA),
    ]),
    outputs: &[
        PortSpec::required("command", MotorCommand::SCHEMA),
        PortSpec::optional("status", ControlStatus::SCHEMA),
    ],
    check: |parameters, _| build(&read_parameters(parameters)?, 1e-3).map(|_| ()),
    run,
};

/// Parameters of the geometric controller.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Parameters {
    /// Vehicle file.
    vehicle: PathBuf,
    /// Gains file; the built-in gains where absent.
    gains: Option<PathBuf>,
}

fn build(parameters: &Parameters, period_s: f64) -> Result<(GeometricLaw, Allocation, Vehicle), String> {
    let vehicle = Vehicle::load(&parameters.vehicle).map_err(|error| error.to_string())?;
    let allocation = Allocation::new(&RotorSet::from(&vehicle)).map_err(|error| error.to_string())?;
    let gains = GeometricGains::load(parameters.gains.as_deref()).map_err(|error| error.to_string())?;
    Ok((GeometricLaw::new(gains, &vehicle, &allocation, period_s), allocation, vehicle))
}

fn run() -> Result<(), BusError> {
    let node = Node::join()?;
    let (law, allocation, vehicle) =
        build(&node.parameters()?, node.period_s()).map_err(|error| node.error(error))?;
    controller::run(node, &law, &allocation, &vehicle)
}
