//! What all controllers share: what they are told, what they remember, what they answer; and the node that runs
//! any of them on the bus.
//!
//! All remember the same fixed-layout [`ControllerState`], so any of them can take over from any other in
//! flight. A law finds its own memory there as it left it; another's memory it does not understand, and sets
//! its own so that it goes on from the wrench that was asked for last.
#![allow(
    non_snake_case,
    reason = "a trailing _W or _B names the frame a vector is written in, _N the newton"
)]

use crate::allocation::{Allocated, Allocation, Wrench};
use crate::pid_law::PidState;
use crate::set_points::SetPoint;
use bus::messages::{
    AttitudeEstimate, ControlStatus, MotorCommand, Reference, SetPoint as SetPointMessage, StateEstimate,
    WallEstimate,
};
use bus::{BusError, Input, Node, Output, Tick};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use vehicles::Vehicle;

/// The vehicle's motion as its estimators believe it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// Position of the centre of mass in the world, m.
    pub position_W_m: Vector3<f64>,
    /// Velocity of the centre of mass in the world, m/s.
    pub velocity_W_m_s: Vector3<f64>,
    /// Attitude, body to world.
    pub attitude_WB: UnitQuaternion<f64>,
    /// Angular rate of the body against the world, body axes, rad/s.
    pub angular_velocity_B_rad_s: Vector3<f64>,
}

/// What a controller is told at a tick.
#[derive(Debug, Clone, Copy)]
pub struct Told<'a> {
    /// The vehicle's motion.
    pub motion: Motion,
    /// What the pilot asks for; the default where no pilot is wired.
    pub set_point: SetPoint,
    /// Where the trajectory is; zero where none is wired.
    pub reference: &'a Reference,
    /// What the range finders see; zero where none are wired.
    pub walls: &'a WallEstimate,
    /// Simulation time.
    pub time_ns: u64,
}

/// What a controller answers: the wrench to make, and what it reports beside it.
#[derive(Debug, Clone, Copy, Default)]
pub struct Demand {
    /// The wrench.
    pub wrench: Wrench,
    /// What the inner loops hold.
    pub set_point: SetPoint,
    /// What the outer loop asks for: velocity along the heading's level x and y, m/s.
    pub velocity_m_s: [f64; 2],
}

/// A control law at one period, with all that does not change during a run.
pub trait Controller {
    /// Number of the law in a [`ControllerState`], one for each law.
    const LAW: u32;

    /// The demand now; advances the memory by one period. Touches neither `law` nor what was demanded.
    fn step(&self, memory: &mut ControllerState, told: &Told<'_>) -> Demand;

    /// The memory with which the law asks for `wrench` as nearly as its limits allow. `memory` is another
    /// law's, or the default where only its last command is known.
    fn tracking(&self, memory: &ControllerState, wrench: &Wrench, told: &Told<'_>) -> ControllerState;
}

/// All that any controller remembers, as it is handed over.
#[derive(Debug, Clone, Copy, PartialEq, Default, bus::Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/ControllerState")]
pub struct ControllerState {
    /// The law whose memory this is; 0 before the first tick.
    #[field(unit = "1")]
    pub law: u32,
    /// State of its guidance.
    #[field(unit = "1")]
    pub state: u32,
    /// Laps flown.
    #[field(unit = "1")]
    pub laps: u32,
    /// Zero.
    #[field(unit = "")]
    pub pad0: u32,
    /// Simulation time at which the guidance's state was entered.
    #[field(unit = "ns")]
    pub since_ns: u64,
    /// Thrust that was demanded last.
    #[field(unit = "N", frame = "body")]
    pub thrust: f64,
    /// Torque that was demanded last.
    #[field(unit = "N*m", frame = "body")]
    pub torque: [f64; 3],
    /// What the integrators of altitude and attitude ask for.
    pub integrals: PidState,
    /// Acceleration that the integrators of position or velocity ask for.
    #[field(unit = "m/s^2", frame = "world")]
    pub position_integral: [f64; 3],
    /// The command filter's roll, pitch and yaw.
    #[field(unit = "rad", frame = "world")]
    pub attitude_command: [f64; 3],
    /// Their rates of change.
    #[field(unit = "rad/s", frame = "world")]
    pub attitude_command_rate: [f64; 3],
    /// Altitude that the guidance holds.
    #[field(unit = "m", frame = "world")]
    pub altitude_hold: f64,
    /// Velocity that the guidance asks for, along the heading's level x and y.
    #[field(unit = "m/s")]
    pub velocity_command: [f64; 2],
}

/// Runs `law` on the bus, its demand allocated to the rotors of `vehicle`.
///
/// # Errors
/// As [`Node::run_with_state`].
pub fn run<C: Controller>(
    mut node: Node,
    law: &C,
    allocation: &Allocation,
    vehicle: &Vehicle,
) -> Result<(), BusError> {
    let inputs = Wired::declare(&mut node)?;
    let command = node.output::<MotorCommand>("command")?;
    let status = node.optional_output::<ControlStatus>("status")?;
    node.run_with_state(ControllerState::default(), |tick, memory| {
        let told = inputs.told(tick);
        take_over(law, memory, &told, last_wrench(tick, command, allocation, vehicle));
        let demand = law.step(memory, &told);
        memory.law = C::LAW;
        memory.thrust = demand.wrench.thrust_N;
        memory.torque = demand.wrench.torque_B_N_m.into();
        let allocated = allocation.allocate(&demand.wrench);
        let counts = allocated.speeds_rad_s.map(|speed| vehicle.command.command(speed));
        let report = report(&demand, &allocated, memory);
        tick.write(command, MotorCommand { command: counts, ..Default::default() })?;
        status.map_or(Ok(()), |status| tick.write(status, report))
    })
}

/// Where this is the first tick after another law flew, goes on from what that one asked for.
fn take_over<C: Controller>(
    law: &C,
    memory: &mut ControllerState,
    told: &Told<'_>,
    last_wrench: Option<Wrench>,
) {
    let handed = Wrench { thrust_N: memory.thrust, torque_B_N_m: memory.torque.into() };
    let is_anothers = memory.law != 0 && memory.law != C::LAW;
    if let Some(wrench) = last_wrench.or_else(|| is_anothers.then_some(handed)) {
        *memory = law.tracking(memory, &wrench, told);
    }
}

/// The wrench of the predecessor's last command, where no state was handed over.
fn last_wrench(
    tick: &Tick<'_>,
    command: Output<MotorCommand>,
    allocation: &Allocation,
    vehicle: &Vehicle,
) -> Option<Wrench> {
    let last = tick.predecessor(command)?;
    Some(allocation.wrench(&last.command.map(|command| vehicle.command.speed(command))))
}

fn report(demand: &Demand, allocated: &Allocated, memory: &ControllerState) -> ControlStatus {
    let asked = &demand.set_point;
    ControlStatus {
        altitude_set_point: asked.altitude_m,
        attitude_set_point: [asked.roll_rad, asked.pitch_rad, asked.yaw_rad],
        velocity_set_point: demand.velocity_m_s,
        thrust: demand.wrench.thrust_N,
        torque: <[f64; 3]>::from(demand.wrench.torque_B_N_m).into(),
        thrust_error: allocated.thrust_error_N,
        roll_pitch_part: allocated.roll_pitch_part,
        yaw_part: allocated.yaw_part,
        saturated: u32::from(allocated.is_saturated()),
        state: memory.state,
        laps: memory.laps,
        ..Default::default()
    }
}

/// The inputs of a controller; which of the optional ones it needs, its kind says.
struct Wired {
    estimate: Input<StateEstimate>,
    attitude: Option<Input<AttitudeEstimate>>,
    set_point: Option<Input<SetPointMessage>>,
    reference: Option<Input<Reference>>,
    walls: Option<Input<WallEstimate>>,
}

/// What an input says that is not wired.
static NO_REFERENCE: std::sync::LazyLock<Reference> = std::sync::LazyLock::new(Reference::default);
static NO_WALLS: std::sync::LazyLock<WallEstimate> = std::sync::LazyLock::new(WallEstimate::default);

impl Wired {
    fn declare(node: &mut Node) -> Result<Self, BusError> {
        Ok(Self {
            estimate: node.input("estimate")?,
            attitude: node.optional_input("attitude"),
            set_point: node.optional_input("set_point"),
            reference: node.optional_input("reference"),
            walls: node.optional_input("walls"),
        })
    }

    fn told<'a>(&self, tick: &'a Tick<'_>) -> Told<'a> {
        Told {
            motion: motion(tick.get(self.estimate), self.attitude.map(|attitude| tick.get(attitude))),
            set_point: self.set_point.map_or_else(SetPoint::default, |input| asked(tick.get(input))),
            reference: self.reference.map_or(&NO_REFERENCE, |input| tick.get(input)),
            walls: self.walls.map_or(&NO_WALLS, |input| tick.get(input)),
            time_ns: tick.time_ns(),
        }
    }
}

/// The motion by `estimate`; attitude and rates by `attitude` where that is wired.
fn motion(estimate: &StateEstimate, attitude: Option<&AttitudeEstimate>) -> Motion {
    let vector = |v: bus::messages::Vector3| Vector3::from(<[f64; 3]>::from(v));
    let quaternion = attitude.map_or(estimate.attitude, |attitude| attitude.attitude);
    let rates = attitude.map_or(estimate.angular_velocity, |attitude| attitude.angular_velocity);
    let q = quaternion;
    Motion {
        position_W_m: vector(estimate.position),
        velocity_W_m_s: vector(estimate.velocity),
        attitude_WB: UnitQuaternion::new_unchecked(Quaternion::new(q.w, q.x, q.y, q.z)),
        angular_velocity_B_rad_s: vector(rates),
    }
}

fn asked(message: &SetPointMessage) -> SetPoint {
    SetPoint {
        altitude_m: message.altitude,
        roll_rad: message.roll,
        pitch_rad: message.pitch,
        yaw_rad: message.yaw,
    }
}
