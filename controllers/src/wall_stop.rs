//! The wall-stop controller node: flies along the heading and stops before the wall ahead.

use crate::airframe::ControlledVehicle;
use crate::controller;
use crate::rehearsal;
use crate::velocity_law::VelocityLoop;
use crate::wall_stop_law::{WallStopGains, WallStopLaw};
use bus::kind::{Inputs, NodeKind, PortSpec};
use bus::messages::{AttitudeEstimate, ControlStatus, MotorCommand, WallEstimate};
use bus::{BusError, Message, Node};
use diagnostics::parameter::{ParameterError, finite, positive, positive_up_to};
use serde::Deserialize;
use std::path::PathBuf;

/// The wall-stop controller, for manifests.
pub const KIND: NodeKind = NodeKind {
    name: "wall-stop",
    summary: "flies towards a wall and stops before it, by range finders",
    inputs: Inputs::Ports(&[
        PortSpec::required("walls", WallEstimate::SCHEMA),
        PortSpec::required("attitude", AttitudeEstimate::SCHEMA),
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

/// Parameters of the wall-stop controller.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Parameters {
    /// Vehicle file.
    vehicle: PathBuf,
    /// Gains file; the built-in `controllers/gains/wall-stop.toml` where there is none.
    gains: Option<PathBuf>,
    /// Height above what is below.
    altitude_m: f64,
    /// Speed towards the wall.
    #[serde(default = "default_cruise_speed_m_s")]
    cruise_speed_m_s: f64,
    /// Distance from the wall at which it stops.
    #[serde(default = "default_distance_m")]
    distance_m: f64,
    /// Yaw.
    #[serde(default)]
    heading_rad: f64,
}

/// Tuned, no source: the thesis does not say how fast it flies.
fn default_cruise_speed_m_s() -> f64 {
    1.0
}

/// Thesis §5.5.
fn default_distance_m() -> f64 {
    3.0
}

/// Beyond this the sensors' reach of 7.65 m (thesis §5.5) leaves too little to brake in.
const DISTANCE_MAX_M: f64 = 5.0;
/// Where no wall is in sight, the estimate's distance is the sensors' reach, and the approach to a wall there
/// keeps the speed below this in any case.
const SPEED_MAX_M_S: f64 = 3.0;

fn build(parameters: &Parameters, period_s: f64) -> Result<(WallStopLaw, ControlledVehicle), ParameterError> {
    positive("altitude_m", parameters.altitude_m)?;
    finite("heading_rad", parameters.heading_rad)?;
    positive_up_to("cruise_speed_m_s", parameters.cruise_speed_m_s, SPEED_MAX_M_S, "m/s")?;
    positive_up_to("distance_m", parameters.distance_m, DISTANCE_MAX_M, "m")?;
    let craft = ControlledVehicle::load(&parameters.vehicle)?;
    let gains = WallStopGains::load(parameters.gains.as_deref())
        .map_err(|error| ParameterError::conflict("gains", error))?;
    let law = WallStopLaw {
        velocity: VelocityLoop::new(&gains.loops, craft.hover_model(), period_s),
        gains,
        cruise_speed_m_s: parameters.cruise_speed_m_s,
        distance_m: parameters.distance_m,
        altitude_m: parameters.altitude_m,
        heading_rad: parameters.heading_rad,
    };
    Ok((law, craft))
}

fn run() -> Result<(), BusError> {
    let node = Node::join()?;
    let (law, craft) = build(&node.parameters()?, node.period_s()).map_err(|error| node.error(error))?;
    controller::run(node, &law, &craft)
}
