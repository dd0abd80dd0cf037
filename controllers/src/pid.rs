//! The PID controller node: altitude, roll, pitch and yaw to four motor commands.
//!
//! Roll, pitch, yaw and rates come from the attitude estimate. Altitude and climb rate come from the
//! plant's true state, as the thesis takes them from its simulator (§4.4): a stand-in until a run has an
//! altimeter.
#![allow(non_snake_case, reason = "a trailing _B names the frame a vector is written in")]

use crate::allocation::{Allocation, RotorSet};
use crate::pid_gains::PidGains;
use crate::pid_law::{Measurement, PidLaw, PidState, PidVehicle};
use crate::set_points;
use bus::kind::{Inputs, NodeKind, PortSpec, read_parameters};
use bus::messages::{AttitudeEstimate, MotorCommand, PlantState, SetPoint};
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
        PortSpec::required("attitude", AttitudeEstimate::SCHEMA),
        PortSpec::required("altitude", PlantState::SCHEMA),
    ]),
    outputs: &[PortSpec::required("command", MotorCommand::SCHEMA)],
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
    let mut node = Node::join()?;
    let set_point = node.input::<SetPoint>("set_point")?;
    let attitude = node.input::<AttitudeEstimate>("attitude")?;
    let altitude = node.input::<PlantState>("altitude")?;
    let output = node.output::<MotorCommand>("command")?;
    let (law, allocation, vehicle) =
        build(&node.parameters()?, node.period_s()).map_err(|error| node.error(error))?;
    node.run_with_state(PidState::default(), |tick, memory| {
        let measured = measurement(tick.get(attitude), tick.get(altitude));
        let set_point = asked(tick.get(set_point));
        if let Some(last) = tick.predecessor(output) {
            let speeds_rad_s = last.command.map(|command| vehicle.command.speed(command));
            *memory = law.tracking(&allocation.wrench(&speeds_rad_s), &set_point, &measured);
        }
        let wrench = law.step(memory, &set_point, &measured);
        let allocated = allocation.allocate(&wrench);
        let command = allocated.speeds_rad_s.map(|speed| vehicle.command.command(speed));
        tick.write(output, MotorCommand { command, ..Default::default() })
    })
}

fn measurement(attitude: &AttitudeEstimate, truth: &PlantState) -> Measurement {
    Measurement {
        altitude_m: truth.position.z,
        climb_rate_m_s: truth.velocity.z,
        roll_rad: attitude.roll,
        pitch_rad: attitude.pitch,
        yaw_rad: attitude.yaw,
        angular_velocity_B_rad_s: <[f64; 3]>::from(attitude.angular_velocity).into(),
    }
}

fn asked(message: &SetPoint) -> set_points::SetPoint {
    set_points::SetPoint {
        altitude_m: message.altitude,
        roll_rad: message.roll,
        pitch_rad: message.pitch,
        yaw_rad: message.yaw,
    }
}
