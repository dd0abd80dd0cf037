//! The PID controller node: altitude, roll, pitch and yaw to four motor commands.

use crate::airframe::ControlledVehicle;
use crate::controller;
use crate::pid_gains::GivenGains;
use crate::pid_law::PidLaw;
use crate::rehearsal;
use bus::kind::{Inputs, NodeKind, PortSpec};
use bus::messages::{AttitudeEstimate, ControlStatus, MotorCommand, SetPoint, StateEstimate};
use bus::{BusError, Message, Node};
use diagnostics::ParameterError;
use serde::Deserialize;
use std::path::PathBuf;

/// The PID controller, for manifests.
pub const KIND: NodeKind = NodeKind {
    name: "pid",
    summary: "altitude, roll, pitch and yaw PID of the thesis with control allocation",
    inputs: Inputs::Ports(&[
        PortSpec::required("set_point", SetPoint::SCHEMA),
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

/// Parameters of the PID controller.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Parameters {
    /// Vehicle file.
    vehicle: PathBuf,
    /// Gains and limits.
    #[serde(default)]
    gains: GivenGains,
}

fn build(parameters: &Parameters, period_s: f64) -> Result<(PidLaw, ControlledVehicle), ParameterError> {
    let craft = ControlledVehicle::load(&parameters.vehicle)?;
    let gains = parameters.gains.gains()?;
    Ok((PidLaw { gains, vehicle: craft.hover_model(), period_s }, craft))
}

fn run() -> Result<(), BusError> {
    let node = Node::join()?;
    let (law, craft) = build(&node.parameters()?, node.period_s()).map_err(|error| node.error(error))?;
    controller::run(node, &law, &craft)
}
