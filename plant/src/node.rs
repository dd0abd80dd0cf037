//! The plant node: steps the vehicle from tick to tick under the motor command of the tick before.
//!
//! At tick k it moves the state from k − 1 to k under the command stamped k − 1, then publishes it. With a
//! `measured` input it is set to the measured state at the start of each window, after publishing: what it
//! publishes at that tick is the end of the window before.
#![allow(non_snake_case, reason = "a trailing _W names the frame a vector is written in")]

use crate::others::Others;
use crate::output::Outputs;
use crate::parameters::{self, Parameters};
use crate::state::RigidBody;
use bus::kind::{Inputs, NodeKind, PortSpec};
use bus::messages::{
    Battery, BodyTransform, Contact, MeasuredState, MotorCommand, PlantState, PoseStamped, Traffic,
};
use bus::{BusError, Message, Node};
use nalgebra::{UnitQuaternion, Vector3};

/// The plant, for manifests.
pub const KIND: NodeKind = NodeKind {
    name: "plant",
    summary: "flies the vehicle of a vehicle file, freely or in a scene",
    inputs: Inputs::Ports(&[
        PortSpec::required("command", MotorCommand::SCHEMA),
        PortSpec::optional("measured", MeasuredState::SCHEMA),
        PortSpec::optional("traffic", Traffic::SCHEMA),
    ]),
    outputs: &[
        PortSpec::required("state", PlantState::SCHEMA),
        PortSpec::optional("pose", PoseStamped::SCHEMA),
        PortSpec::optional("tf", BodyTransform::SCHEMA),
        PortSpec::optional("contact", Contact::SCHEMA),
        PortSpec::optional("battery", Battery::SCHEMA),
    ],
    check: parameters::check,
    run,
};

fn run() -> Result<(), BusError> {
    let mut node = Node::join()?;
    let parameters: Parameters = node.parameters()?;
    let backend = parameters.backend(node.seed(), node.name(), node.tick_s());
    let mut backend = backend.map_err(|error| node.error(error))?;
    let command = node.input::<MotorCommand>("command")?;
    let measured = node.optional_input::<MeasuredState>("measured");
    let traffic = node.optional_input::<Traffic>("traffic");
    let outputs = Outputs::declare(&mut node)?;
    let dt_s = node.tick_s();
    let window_ticks =
        parameters.window_s.map(|window_s| parameters::window_ticks(window_s, dt_s)).transpose();
    let window_ticks = window_ticks.map_err(|error| node.error(error))?.unwrap_or(u32::MAX);
    if node.period_s() != dt_s {
        // It would apply a command before it was computed.
        return Err(node.error("a plant runs at every tick; leave `period_ticks` out"));
    }
    let mut others = Others::new();
    node.run(|tick| {
        let number = tick.number();
        let window = measured.filter(|_| number.is_multiple_of(window_ticks));
        let commands = tick.get(command).command;
        if number > 0 {
            let before_ns = tick.time_ns() / u64::from(number) * u64::from(number - 1);
            let own_W_m = backend.state().body.position_W_m;
            let seen =
                traffic.map(|traffic| others.seen(tick.get(traffic), &own_W_m, before_ns)).transpose()?;
            backend.step(&commands, dt_s, seen.unwrap_or_default());
        } else {
            // The input's initial value: the rotors turn steadily at it when the run starts.
            backend.settle_rotors(&commands);
            if let Some(measured) = window {
                backend.set_body(&body(tick.get(measured)));
            }
        }
        outputs.publish(tick, &*backend).map_err(|error| error.to_string())?;
        if let Some(measured) = window {
            backend.set_body(&body(tick.get(measured)));
        }
        Ok::<_, String>(())
    })
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
