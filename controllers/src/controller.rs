//! The node that runs any law on the bus.
#![allow(
    non_snake_case,
    reason = "a trailing _W or _B names the frame a vector is written in, _N the newton"
)]

use crate::airframe::ControlledVehicle;
use crate::allocation::{Allocated, RotorWrench};
use crate::bumpless::BumplessTransfer;
use crate::control::{ControlInput, ControlOutput, MotionEstimate};
use crate::controller_state::ControllerState;
use crate::law::Law;
use crate::set_points::SetPoint;
use bus::messages::{
    AttitudeEstimate, ControlStatus, MotorCommand, Reference, SetPoint as SetPointMessage, StateEstimate,
    WallEstimate,
};
use bus::{BusError, Input, Node, Output, Tick};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// Runs `law` on the bus, its demand allocated to the rotors of `craft`.
///
/// # Errors
/// As [`Node::run_with_state`].
pub fn run<L: Law>(mut node: Node, law: &L, craft: &ControlledVehicle) -> Result<(), BusError> {
    let inputs = Wired::declare(&mut node);
    let command = node.output::<MotorCommand>("command")?;
    let status = node.optional_output::<ControlStatus>("status")?;
    let transfer = BumplessTransfer::to::<L>(&craft.vehicle, node.period_s());
    node.run_with_state(ControllerState::default(), |tick, state| {
        let output = transfer.step(law, state, &inputs.read(tick), last_wrench(tick, command, craft));
        if let Some(what) = output.not_finite() {
            // The allocation and the command map would make a command of it all the same.
            return Err(format!("the law asks for {what}: its output `command` is not sent"));
        }
        let allocated = craft.allocation.allocate(&output.wrench);
        let counts = allocated.speeds_rad_s.map(|speed| craft.vehicle.command.command(speed));
        let report = report(&output, &allocated);
        tick.write(command, MotorCommand { command: counts, ..Default::default() })
            .and_then(|()| status.map_or(Ok(()), |status| tick.write(status, report)))
            .map_err(|error| error.to_string())
    })
}

/// The wrench of the predecessor's last command, where no state was handed over.
fn last_wrench(
    tick: &Tick<'_>,
    command: Output<MotorCommand>,
    craft: &ControlledVehicle,
) -> Option<RotorWrench> {
    let last = tick.predecessor(command)?;
    Some(craft.allocation.wrench(&last.command.map(|command| craft.vehicle.command.speed(command))))
}

fn report(output: &ControlOutput, allocated: &Allocated) -> ControlStatus {
    let asked = &output.set_point;
    ControlStatus {
        altitude_set_point: asked.altitude_m,
        attitude_set_point: [asked.roll_rad, asked.pitch_rad, asked.yaw_rad],
        velocity_set_point: output.velocity_m_s,
        thrust: output.wrench.thrust_N,
        torque: <[f64; 3]>::from(output.wrench.torque_B_N_m).into(),
        thrust_error: allocated.thrust_error_N,
        roll_pitch_part: allocated.roll_pitch_part,
        yaw_part: allocated.yaw_part,
        saturated: u32::from(allocated.is_saturated()),
        state: output.phase,
        laps: output.laps,
        ..Default::default()
    }
}

/// The inputs of a controller; its kind says which of the optional ones it needs.
struct Wired {
    estimate: Option<Input<StateEstimate>>,
    attitude: Option<Input<AttitudeEstimate>>,
    set_point: Option<Input<SetPointMessage>>,
    reference: Option<Input<Reference>>,
    walls: Option<Input<WallEstimate>>,
}

/// What an input says that is not wired.
static NO_REFERENCE: std::sync::LazyLock<Reference> = std::sync::LazyLock::new(Reference::default);
static NO_ESTIMATE: std::sync::LazyLock<StateEstimate> = std::sync::LazyLock::new(StateEstimate::default);
static NO_WALLS: std::sync::LazyLock<WallEstimate> = std::sync::LazyLock::new(WallEstimate::default);

impl Wired {
    fn declare(node: &mut Node) -> Self {
        Self {
            estimate: node.optional_input("estimate"),
            attitude: node.optional_input("attitude"),
            set_point: node.optional_input("set_point"),
            reference: node.optional_input("reference"),
            walls: node.optional_input("walls"),
        }
    }

    fn read<'a>(&self, tick: &'a Tick<'_>) -> ControlInput<'a> {
        let estimate = self.estimate.map_or(&*NO_ESTIMATE, |estimate| tick.get(estimate));
        ControlInput {
            motion: motion(estimate, self.attitude.map(|attitude| tick.get(attitude))),
            set_point: self.set_point.map_or_else(SetPoint::default, |input| set_point(tick.get(input))),
            reference: self.reference.map_or(&NO_REFERENCE, |input| tick.get(input)),
            walls: self.walls.map_or(&NO_WALLS, |input| tick.get(input)),
            time_ns: tick.time_ns(),
        }
    }
}

/// The motion by `estimate`; attitude and rates by `attitude` where that is wired.
fn motion(estimate: &StateEstimate, attitude: Option<&AttitudeEstimate>) -> MotionEstimate {
    let vector = |v: bus::messages::Vector3| Vector3::from(<[f64; 3]>::from(v));
    let quaternion = attitude.map_or(estimate.attitude, |attitude| attitude.attitude);
    let rates = attitude.map_or(estimate.angular_velocity, |attitude| attitude.angular_velocity);
    let q = quaternion;
    MotionEstimate {
        position_W_m: vector(estimate.position),
        velocity_W_m_s: vector(estimate.velocity),
        attitude_WB: UnitQuaternion::new_unchecked(Quaternion::new(q.w, q.x, q.y, q.z)),
        angular_velocity_B_rad_s: vector(rates),
    }
}

fn set_point(message: &SetPointMessage) -> SetPoint {
    SetPoint {
        altitude_m: message.altitude,
        roll_rad: message.roll,
        pitch_rad: message.pitch,
        yaw_rad: message.yaw,
    }
}
