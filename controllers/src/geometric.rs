//! The geometric controller node: a trajectory's reference to four motor commands.

use crate::airframe::ControlledVehicle;
use crate::controller;
use crate::geometric_gains::GeometricGains;
use crate::geometric_law::GeometricLaw;
use crate::rehearsal;
use bus::kind::{Inputs, NodeKind, PortSpec};
use bus::messages::{AttitudeEstimate, ControlStatus, MotorCommand, Reference, StateEstimate};
use bus::{BusError, Message, Node};
use diagnostics::ParameterError;
use serde::Deserialize;
use std::path::PathBuf;

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
    check: |parameters, run| {
        let (law, craft) = build(&diagnostics::read(parameters)?, run.period_s())?;
        rehearsal::check(&law, &craft, run)
    },
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

fn build(
    parameters: &Parameters,
    period_s: f64,
) -> Result<(GeometricLaw, ControlledVehicle), ParameterError> {
    let craft = ControlledVehicle::load(&parameters.vehicle)?;
    let gains = GeometricGains::load(parameters.gains.as_deref())
        .map_err(|error| ParameterError::conflict("gains", error))?;
    Ok((GeometricLaw::new(gains, &craft, period_s), craft))
}

fn run() -> Result<(), BusError> {
    let node = Node::join()?;
    let (law, craft) = build(&node.parameters()?, node.period_s()).map_err(|error| node.error(error))?;
    controller::run(node, &law, &craft)
}
