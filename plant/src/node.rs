//! The plant node: steps the vehicle from tick to tick under the motor command of the tick before.
//!
//! At tick k it moves the state from k − 1 to k under the command stamped k − 1, then publishes it. With a
//! `measured` input it is set to the measured state at the start of each window, after publishing: what it
//! publishes at that tick is the end of the window before.
#![allow(non_snake_case, reason = "a trailing _W or _B names the frame a vector is written in")]

use crate::airframe::{Airframe, Drive};
use crate::newton_euler::NewtonEuler;
use crate::state::{RigidBody, State};
use bus::kind::{Inputs, NodeKind, PortSpec, read_parameters};
use bus::messages::{
    BodyTransform, MeasuredState, MotorCommand, Orientation, PlantState, Point, Pose, PoseStamped, Quaternion,
};
use bus::{BusError, Message, Node, Output, Tick};
use nalgebra::{UnitQuaternion, Vector3};
use serde::Deserialize;
use std::path::PathBuf;
use vehicles::{Vehicle, VehicleError};

/// The plant, for manifests.
pub const KIND: NodeKind = NodeKind {
    name: "plant",
    summary: "flies the vehicle of a vehicle file (Newton-Euler, free flight)",
    inputs: Inputs::Ports(&[
        PortSpec::required("command", MotorCommand::SCHEMA),
        PortSpec::optional("measured", MeasuredState::SCHEMA),
    ]),
    outputs: &[
        PortSpec::required("state", PlantState::SCHEMA),
        PortSpec::optional("pose", PoseStamped::SCHEMA),
        PortSpec::optional("tf", BodyTransform::SCHEMA),
    ],
    check,
    run,
};

/// Parameters of the plant.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Parameters {
    /// Vehicle file.
    vehicle: PathBuf,
    /// Position of the centre of mass at tick 0, in the world.
    #[serde(default)]
    initial_position_m: [f64; 3],
    /// Integration steps per tick.
    #[serde(default = "one")]
    substeps: u32,
    /// With a `measured` input: time between two settings to the measured state.
    window_s: Option<f64>,
}

fn one() -> u32 {
    1
}

fn check(parameters: &serde_json::Value, inputs: &[&str]) -> Result<(), String> {
    let parameters: Parameters = read_parameters(parameters)?;
    if parameters.substeps == 0 {
        return Err("`substeps` is 0, expected at least 1".to_owned());
    }
    if parameters.window_s.is_some_and(|window_s| !(window_s > 0.0 && window_s.is_finite())) {
        return Err("`window_s` must be a positive number of seconds".to_owned());
    }
    match (inputs.contains(&"measured"), parameters.window_s) {
        (true, None) => return Err("the input `measured` needs the parameter `window_s`".to_owned()),
        (false, Some(_)) => return Err("the parameter `window_s` needs the input `measured`".to_owned()),
        _ => {}
    }
    airframe(&parameters).map(|_| ()).map_err(|error| error.to_string())
}

fn airframe(parameters: &Parameters) -> Result<Airframe, VehicleError> {
    Airframe::from_files(Vehicle::load(&parameters.vehicle)?, &[])
}

fn run() -> Result<(), BusError> {
    let mut node = Node::join()?;
    let parameters: Parameters = node.parameters()?;
    let airframe = airframe(&parameters).map_err(|error| node.error(error))?;
    let command = node.input::<MotorCommand>("command")?;
    let measured = node.optional_input::<MeasuredState>("measured");
    let outputs = Outputs {
        state: node.output("state")?,
        pose: node.optional_output("pose")?,
        tf: node.optional_output("tf")?,
    };
    let window_ticks = window_ticks(&node, parameters.window_s)?;
    let dt_s = node.tick_s();
    if node.period_s() != dt_s {
        // It would apply a command before it was computed.
        return Err(node.error("a plant runs at every tick; leave `period_ticks` out"));
    }
    let model = NewtonEuler::flying(airframe, parameters.substeps);
    let mut memory = model.airframe().memory(node.seed(), node.name(), dt_s);
    let body_at_start = RigidBody::level_at(Vector3::from(parameters.initial_position_m));
    let mut state = model.start(body_at_start, 0.0);
    node.run(|tick| {
        let window = measured.filter(|_| tick.number().is_multiple_of(window_ticks));
        let commands = tick.get(command).command;
        if tick.number() > 0 {
            let drive = model.airframe().begin_tick(&mut memory, &state, &commands, dt_s);
            model.advance(&mut state, &drive, dt_s);
        } else {
            // The input's initial value: the rotors turn steadily at it when the run starts.
            state.rotors = commands.map(|command| model.steady(command));
            state.body = window.map_or(state.body, |measured| body(tick.get(measured)));
        }
        outputs.publish(tick, &model, &memory.drive, &state)?;
        if let Some(measured) = window {
            state.body = body(tick.get(measured));
        }
        Ok::<_, BusError>(())
    })
}

#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "checked to be positive and short"
)]
fn window_ticks(node: &Node, window_s: Option<f64>) -> Result<u32, BusError> {
    let Some(window_s) = window_s else { return Ok(u32::MAX) };
    let ticks = window_s / node.tick_s();
    if (ticks - ticks.round()).abs() < 1e-6 && ticks.round() >= 1.0 {
        Ok(ticks.round() as u32)
    } else {
        Err(node.error(format!("`window_s` is {window_s}, which is not a whole number of ticks")))
    }
}

struct Outputs {
    state: Output<PlantState>,
    pose: Option<Output<PoseStamped>>,
    tf: Option<Output<BodyTransform>>,
}

impl Outputs {
    fn publish(
        &self,
        tick: &mut Tick<'_>,
        model: &NewtonEuler,
        drive: &Drive,
        state: &State,
    ) -> Result<(), BusError> {
        tick.write(self.state, message(model, drive, state))?;
        let position = point(&state.body.position_W_m);
        let orientation = orientation(&state.body.attitude_WB);
        if let Some(pose) = self.pose {
            let message = PoseStamped { pose: Pose { position, orientation }, ..Default::default() };
            tick.write(pose, message)?;
        }
        if let Some(tf) = self.tf {
            tick.write(tf, BodyTransform::new(position, orientation))?;
        }
        Ok(())
    }
}

fn message(model: &NewtonEuler, drive: &Drive, state: &State) -> PlantState {
    let vector = |v: Vector3<f64>| <[f64; 3]>::from(v).into();
    let [x, y, z, w] = state.body.attitude_WB.coords.into();
    PlantState {
        position: vector(state.body.position_W_m),
        velocity: vector(state.body.velocity_W_m_s),
        attitude: Quaternion { x, y, z, w },
        angular_velocity: vector(state.body.angular_velocity_B_rad_s),
        specific_force: vector(model.motion_under(drive, state).specific_force_B_m_s2),
        rotor_speed: state.rotors.map(|rotor| rotor.speed_rad_s),
        ..Default::default()
    }
}

fn point(v: &Vector3<f64>) -> Point {
    Point { x: v.x, y: v.y, z: v.z }
}

fn orientation(attitude_WB: &UnitQuaternion<f64>) -> Orientation {
    let [x, y, z, w] = attitude_WB.coords.into();
    Orientation { x, y, z, w }
}

fn body(measured: &MeasuredState) -> RigidBody {
    let vector = |v| Vector3::from(<[f64; 3]>::from(v));
    let q = measured.attitude;
    RigidBody {
        position_W_m: vector(measured.position),
        velocity_W_m_s: vector(measured.velocity),
        attitude_WB: UnitQuaternion::new_normalize(nalgebra::Quaternion::new(q.w, q.x, q.y, q.z)),
        angular_velocity_B_rad_s: vector(measured.angular_velocity),
    }
}
