//! The PID controller node: altitude, roll, pitch and yaw to four motor commands.

use crate::allocation::{Allocation, RotorSet, Wrench};
use crate::controller::{self, Controller, ControllerState, Demand, Told};
use crate::pid_gains::PidGains;
use crate::pid_law::{Measurement, PidLaw, PidVehicle};
use bus::kind::{Inputs, NodeKind, PortSpec, read_parameters};
use bus::messages::{AttitudeEstimate, ControlStatus, MotorCommand, SetPoint, StateEstimate};
use bus::{BusError, Message, Node};
use serde::Deserialize;
use std::path::PathBuf;
use vehicles::Vehicle;

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
    check: |parameters, _| build(&read_parameters(parameters)?, 1.0).map(|_| ()),
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
    gains: PidGains,
}

fn build(parameters: &Parameters, period_s: f64) -> Result<(PidLaw, Allocation, Vehicle), String> {
    let vehicle = Vehicle::load(&parameters.vehicle).map_err(|error| error.to_string())?;
    let allocation = Allocation::new(&RotorSet::from(&vehicle)).map_err(|error| error.to_string())?;
    let law = PidLaw { gains: parameters.gains, vehicle: PidVehicle::new(&vehicle, &allocation), period_s };
    Ok((law, allocation, vehicle))
}

fn run() -> Result<(), BusError> {
    let node = Node::join()?;
    let (law, allocation, vehicle) =
        build(&node.parameters()?, node.period_s()).map_err(|error| node.error(error))?;
    controller::run(node, &law, &allocation, &vehicle)
}

impl Controller for PidLaw {
    const LAW: u32 = 1;

    fn step(&self, memory: &mut ControllerState, told: &Told<'_>) -> Demand {
        let wrench = PidLaw::step(self, &mut memory.integrals, &told.set_point, &Measurement::from(told));
        Demand { wrench, set_point: told.set_point, ..Demand::default() }
    }

    fn tracking(&self, memory: &ControllerState, wrench: &Wrench, told: &Told<'_>) -> ControllerState {
        let integrals = PidLaw::tracking(self, wrench, &told.set_point, &Measurement::from(told));
        ControllerState { integrals, ..*memory }
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
