//! The PID controller node: altitude, roll, pitch and yaw to four motor commands.

use crate::allocation::Wrench;
use crate::controller::{self, Airframe, Controller, ControllerState, Demand, Told};
use crate::pid_gains::GivenGains;
use crate::pid_law::{Measurement, PidLaw};
use crate::rehearsal;
use bus::kind::{Inputs, NodeKind, PortSpec, read_parameters};
use bus::messages::{AttitudeEstimate, ControlStatus, MotorCommand, SetPoint, StateEstimate};
use bus::{BusError, Message, Node};
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
        let (law, airframe) = build(&read_parameters(parameters)?, run.period_s())?;
        rehearsal::check(&law, &airframe, run)
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

fn build(parameters: &Parameters, period_s: f64) -> Result<(PidLaw, Airframe), String> {
    let airframe = Airframe::load(&parameters.vehicle)?;
    let gains = parameters.gains.gains()?;
    Ok((PidLaw { gains, vehicle: airframe.known(), period_s }, airframe))
}

fn run() -> Result<(), BusError> {
    let node = Node::join()?;
    let (law, airframe) = build(&node.parameters()?, node.period_s()).map_err(|error| node.error(error))?;
    controller::run(node, &law, &airframe.allocation, &airframe.vehicle)
}

impl Controller for PidLaw {
    const LAW: u32 = 1;

    fn rate_gain_1_s(&self) -> f64 {
        let Self { gains, .. } = self;
        [gains.roll, gains.pitch, gains.yaw].iter().fold(0.0, |most, axis| axis.derivative_1_s.max(most))
    }

    fn step(&self, memory: &mut ControllerState, told: &Told<'_>) -> Demand {
        let wrench = PidLaw::step(self, &mut memory.integrals, &told.set_point, &Measurement::from(told));
        Demand { wrench, set_point: told.set_point, ..Demand::default() }
    }

    fn tracking(&self, memory: &ControllerState, wrench: &Wrench, told: &Told<'_>) -> ControllerState {
        let altitude_m = told.set_point.altitude_m;
        let integrals = self.taken_over(memory, wrench, altitude_m, &Measurement::from(told));
        ControllerState { integrals, ..ControllerState::default() }
    }
}

impl From<&Told<'_>> for Measurement {
    fn from(told: &Told<'_>) -> Self {
        let motion = &told.motion;
        let (roll_rad, pitch_rad, yaw_rad) = motion.attitude_WB.euler_angles();
        Self {
            altitude_m: motion.position_W_m.z,
            climb_rate_m_s: motion.velocity_W_m_s.z,
            roll_rad,
            pitch_rad,
            yaw_rad,
            angular_velocity_B_rad_s: motion.angular_velocity_B_rad_s,
        }
    }
}
