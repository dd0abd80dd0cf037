//! The LQR controller node: a trajectory's reference to four motor commands.

use crate::airframe::ControlledVehicle;
use crate::controller;
use crate::lqr_gains::LqrGains;
use crate::lqr_law::LqrLaw;
use crate::rehearsal;
use bus::kind::{Inputs, NodeKind, PortSpec};
use bus::messages::{AttitudeEstimate, ControlStatus, MotorCommand, Reference, StateEstimate};
use bus::{BusError, Message, Node};
use diagnostics::ParameterError;
use serde::Deserialize;
use std::path::PathBuf;

/// The LQR controller, for manifests.
pub const KIND: NodeKind = NodeKind {
    name: "lqr",
    summary: "linear-quadratic regulator about hover, its gains computed at the start from the vehicle file",
    inputs: Inputs::Ports(&[
        PortSpec::required("reference", Reference::SCHEMA),
        PortSpec::required("estimate", StateEstimate::SCHEMA),
        PortSpec::optional("attitude", AttitudeEstimate::SCHEMA),
    ]),
    outputs: &[
        PortSpec::required("command", MotorCommand::SCHEMA),
        PortSpec::optional("status", ControlStatus::SCHEMA),
    ],
    check: |parameters, run| {
        let (law, craft) = build(&diagnostics::read(parameters)?, run.period_s())?;
        rehearsal::check(&law, &craft, run)
    },
    run,
};

/// Parameters of the LQR controller.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Parameters {
    /// Vehicle file.
    vehicle: PathBuf,
    /// Weights file; the built-in weights where absent.
    gains: Option<PathBuf>,
}

fn build(parameters: &Parameters, period_s: f64) -> Result<(LqrLaw, ControlledVehicle), ParameterError> {
    let craft = ControlledVehicle::load(&parameters.vehicle)?;
    let gains = LqrGains::load(parameters.gains.as_deref())
        .map_err(|error| ParameterError::conflict("gains", error))?;
    Ok((LqrLaw::new(gains, &craft, period_s)?, craft))
}

fn run() -> Result<(), BusError> {
    let node = Node::join()?;
    let (law, craft) = build(&node.parameters()?, node.period_s()).map_err(|error| node.error(error))?;
    controller::run(node, &law, &craft)
}
