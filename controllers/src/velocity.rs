//! The velocity controller node: a velocity command to four motor commands.

use crate::airframe::ControlledVehicle;
use crate::controller;
use crate::rehearsal;
use crate::velocity_law::{LoopsGains, VelocityLaw, VelocityLoop, VelocitySetPoint};
use bus::kind::{Inputs, NodeKind, PortSpec};
use bus::messages::{AttitudeEstimate, ControlStatus, MotorCommand, Reference, StateEstimate};
use bus::{BusError, Message, Node};
use diagnostics::parameter::{ParameterError, all, finite};
use serde::Deserialize;
use std::path::PathBuf;

/// The velocity controller, for manifests.
pub const KIND: NodeKind = NodeKind {
    name: "velocity",
    summary: "velocity PD around the cascade's inner loops",
    inputs: Inputs::Ports(&[
        PortSpec::required("estimate", StateEstimate::SCHEMA),
        PortSpec::optional("attitude", AttitudeEstimate::SCHEMA),
        PortSpec::optional("reference", Reference::SCHEMA),
    ]),
    outputs: &[
        PortSpec::required("command", MotorCommand::SCHEMA),
        PortSpec::optional("status", ControlStatus::SCHEMA),
    ],
    check: |parameters, run| {
        let parameters: Parameters = diagnostics::read(parameters)?;
        parameters.check(run.has("reference"))?;
        let (law, craft) = build(&parameters, run.period_s())?;
        rehearsal::check(&law, &craft, run)
    },
    run,
};

/// Parameters of the velocity controller.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Parameters {
    /// Vehicle file.
    vehicle: PathBuf,
    /// Gains file; the built-in `controllers/gains/velocity.toml` where there is none.
    gains: Option<PathBuf>,
    /// Velocity along the heading's level axes, without a reference.
    velocity_m_s: Option<[f64; 2]>,
    /// Height, without a reference.
    altitude_m: Option<f64>,
    /// Yaw, without a reference.
    yaw_rad: Option<f64>,
}

impl Parameters {
    /// The velocity is given by a reference or by parameters, never by both.
    fn check(&self, has_reference: bool) -> Result<(), ParameterError> {
        let given = [
            ("velocity_m_s", self.velocity_m_s.is_some()),
            ("altitude_m", self.altitude_m.is_some()),
            ("yaw_rad", self.yaw_rad.is_some()),
        ];
        match given.into_iter().find(|(_, is_given)| *is_given) {
            Some((key, _)) if has_reference => Err(ParameterError::conflict(
                "reference",
                format!("`{key}` is given, and so is the input `reference`; leave one of them out"),
            )),
            _ if !has_reference && self.altitude_m.is_none() => Err(ParameterError::conflict(
                "altitude_m",
                "missing field `altitude_m`: without \
                the input `reference` a velocity controller needs `altitude_m` and `velocity_m_s`",
            )),
            _ => Ok(()),
        }
    }

    fn constant(&self) -> Result<Option<VelocitySetPoint>, ParameterError> {
        let Some(altitude_m) = self.altitude_m else { return Ok(None) };
        let constant = VelocitySetPoint {
            velocity_m_s: self.velocity_m_s.unwrap_or_default(),
            altitude_m,
            yaw_rad: self.yaw_rad.unwrap_or_default(),
            ..VelocitySetPoint::default()
        };
        finite("altitude_m", altitude_m)?;
        finite("yaw_rad", constant.yaw_rad)?;
        all(finite, "velocity_m_s", &constant.velocity_m_s)?;
        Ok(Some(constant))
    }
}

fn build(parameters: &Parameters, period_s: f64) -> Result<(VelocityLaw, ControlledVehicle), ParameterError> {
    let craft = ControlledVehicle::load(&parameters.vehicle)?;
    let gains = LoopsGains::load(parameters.gains.as_deref())
        .map_err(|error| ParameterError::conflict("gains", error))?;
    let velocity = VelocityLoop::new(&gains, craft.hover_model(), period_s);
    Ok((VelocityLaw { velocity, constant: parameters.constant()? }, craft))
}

fn run() -> Result<(), BusError> {
    let node = Node::join()?;
    let (law, craft) = build(&node.parameters()?, node.period_s()).map_err(|error| node.error(error))?;
    controller::run(node, &law, &craft)
}
