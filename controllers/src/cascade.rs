//! The cascade controller node: the onboard structure of the AscTec, from sticks to four motor commands.

use crate::airframe::ControlledVehicle;
use crate::cascade_gains::CascadeGains;
use crate::cascade_law::CascadeLaw;
use crate::controller;
use crate::rehearsal;
use bus::kind::{Inputs, NodeKind, PortSpec};
use bus::messages::{AttitudeEstimate, ControlStatus, MotorCommand, SetPoint, StateEstimate};
use bus::{BusError, Message, Node};
use diagnostics::ParameterError;
use serde::Deserialize;
use std::path::PathBuf;

/// The cascade controller, for manifests.
pub const KIND: NodeKind = NodeKind {
    name: "cascade",
    summary: "command filter, attitude loop around rate loop, altitude PID, control allocation",
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

/// Parameters of the cascade controller.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Parameters {
    /// Vehicle file.
    vehicle: PathBuf,
    /// Gains file; the built-in `controllers/gains/cascade.toml` where there is none.
    gains: Option<PathBuf>,
}

fn build(parameters: &Parameters, period_s: f64) -> Result<(CascadeLaw, ControlledVehicle), ParameterError> {
    let craft = ControlledVehicle::load(&parameters.vehicle)?;
    let gains = CascadeGains::load(parameters.gains.as_deref())
        .map_err(|error| ParameterError::conflict("gains", error))?;
    Ok((CascadeLaw { gains, vehicle: craft.hover_model(), period_s }, craft))
}

fn run() -> Result<(), BusError> {
    let node = Node::join()?;
    let (law, craft) = build(&node.parameters()?, node.period_s()).map_err(|error| node.error(error))?;
    controller::run(node, &law, &craft)
}
