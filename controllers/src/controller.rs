//! What all controllers share: what they are told, what they remember, what they answer; and the node that runs
//! any of them on the bus.
//!
//! All remember the same fixed-layout [`ControllerState`], so any of them can take over from any other in
//! flight. A law finds its own memory there as it left it. Of another's it takes what means the same to all,
//! the integrators, and sets the rest by what is measured. What was asked for last and the successor does not
//! ask for is added to its demand and fades out ([`HANDOVER_TIME_CONSTANT_S`]), so that no take-over makes the
//! demanded wrench jump.
#![allow(
    non_snake_case,
    reason = "a trailing _W or _B names the frame a vector is written in, _N the newton"
)]

use crate::allocation::{Allocated, Allocation, AllocationError, RotorSet, Wrench};
use crate::pid_law::{PidState, PidVehicle};
use crate::set_points::SetPoint;
use bus::messages::{
    AttitudeEstimate, ControlStatus, MotorCommand, Reference, SetPoint as SetPointMessage, StateEstimate,
    WallEstimate,
};
use bus::{BusError, Input, Node, Output, Tick};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use std::path::Path;
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

/// A vehicle, and how its rotors are reached.
#[derive(Debug, Clone)]
pub struct Airframe {
    /// The vehicle.
    pub vehicle: Vehicle,
    /// The allocation to its rotors.
    pub allocation: Allocation,
}

impl Airframe {
    /// The vehicle of the file at `path`.
    ///
    /// # Errors
    /// The file is refused, or four such rotors cannot be allocated to.
    pub fn load(path: &Path) -> Result<Self, String> {
        let vehicle = Vehicle::load(path).map_err(|error| error.to_string())?;
        Self::new(vehicle).map_err(|error| error.to_string())
    }

    /// `vehicle` with its allocation.
    ///
    /// # Errors
    /// Four such rotors cannot be allocated to.
    pub fn new(vehicle: Vehicle) -> Result<Self, AllocationError> {
        let allocation = Allocation::new(&RotorSet::from(&vehicle))?;
        Ok(Self { vehicle, allocation })
    }

    /// What a law has to know of it.
    #[must_use]
    pub fn known(&self) -> PidVehicle {
        PidVehicle::new(&self.vehicle, &self.allocation)
    }
}

/// Refuses a parameter that is not finite.
///
/// # Errors
/// It is not; the text names its key.
pub(crate) fn finite(key: &str, value: f64) -> Result<(), String> {
    if value.is_finite() { Ok(()) } else { Err(format!("`{key}` must be a finite number, found {value}")) }
}

/// Refuses a parameter that is not a finite number above zero.
///
/// # Errors
/// It is not; the text names its key.
pub(crate) fn positive(key: &str, value: f64, unit: &str) -> Result<(), String> {
    if value.is_finite() && value > 0.0 {
        return Ok(());
    }
    Err(format!("`{key}` must be a finite number above 0 {unit}, found {value}"))
}

/// Refuses a parameter that is not above zero and at most `max`.
///
/// # Errors
/// It is not; the text names its key.
pub(crate) fn positive_up_to(key: &str, value: f64, max: f64, unit: &str) -> Result<(), String> {
    if value > 0.0 && value <= max {
        return Ok(());
    }
    Err(format!("`{key}` must be above 0 and at most {max} {unit}, found {value}"))
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

    /// The greatest angular acceleration that it asks for against a body rate, 1/s: with the period it tells whether
    /// the loop can be closed at all. 0 where the law is made for its period.
    fn rate_gain_1_s(&self) -> f64 {
        0.0
    }

    /// The demand now; advances the memory by one period. Touches neither `law` nor what was demanded.
    fn step(&self, memory: &mut ControllerState, told: &Told<'_>) -> Demand;

    /// The memory before the first tick of a run.
    fn fresh(&self, _told: &Told<'_>) -> ControllerState {
        ControllerState::default()
    }

    /// The memory with which the law goes on after another that asked for `wrench`. `memory` is the other
    /// law's, or the default where only its last command is known. It need not ask for `wrench`, whose rest
    /// [`Flown::advance`] makes up for, and an integrator should not take that up: it would keep amid a
    /// manoeuvre what is gone a moment later.
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
    /// What the integrators of altitude and attitude ask for; every law goes on from another's. Zero under `lqr` and
    /// `geometric`, whose observer holds the lift in `position_integral`.
    pub integrals: PidState,
    /// Acceleration that the integrators of position or velocity ask for; of laws by range finders, whose world
    /// is the room, along the heading's axes.
    #[field(unit = "m/s^2", frame = "world")]
    pub position_integral: [f64; 3],
    /// The command filter's roll, pitch and yaw.
    #[field(unit = "rad", frame = "world")]
    pub attitude_command: [f64; 3],
    /// Their rates of change.
    #[field(unit = "rad/s", frame = "world")]
    pub attitude_command_rate: [f64; 3],
    /// Body rates behind the filter of the rate loop's derivative.
    #[field(unit = "rad/s", frame = "body")]
    pub rate_filtered: [f64; 3],
    /// Velocity behind the filter of the velocity loop's derivative, along the heading's level x and y.
    #[field(unit = "m/s")]
    pub velocity_filtered: [f64; 2],
    /// Altitude that the guidance holds.
    #[field(unit = "m", frame = "world")]
    pub altitude_hold: f64,
    /// Velocity that the guidance asks for, along the heading's level x and y.
    #[field(unit = "m/s")]
    pub velocity_command: [f64; 2],
    /// Thrust that the rotors are foreseen to make; of `lqr` and `geometric` alone, as the next four.
    #[field(unit = "N", frame = "body")]
    pub thrust_made: f64,
    /// Its rate of change.
    #[field(unit = "N/s", frame = "body")]
    pub thrust_made_rate: f64,
    /// Torque that they are foreseen to make.
    #[field(unit = "N*m", frame = "body")]
    pub torque_made: [f64; 3],
    /// Its rate of change.
    #[field(unit = "N*m/s", frame = "body")]
    pub torque_made_rate: [f64; 3],
    /// Velocity that was foreseen for now, against which disturbances show.
    #[field(unit = "m/s", frame = "world")]
    pub velocity_foreseen: [f64; 3],
    /// Distances from the walls at the heading's -x and -y, where the guidance knows its room.
    #[field(unit = "m")]
    pub room_position: [f64; 2],
    /// What is left of the predecessor's thrust that this law does not ask for itself.
    #[field(unit = "N", frame = "body")]
    pub handed_thrust: f64,
    /// The same of its torque.
    #[field(unit = "N*m", frame = "body")]
    pub handed_torque: [f64; 3],
}

/// With which time constant the part of a predecessor's wrench fades that its successor does not ask for, s.
/// Tuned, no source: about that of the Hummingbird's motors, which would smooth a jump likewise.
pub const HANDOVER_TIME_CONSTANT_S: f64 = 0.1;

/// The most of a predecessor's acceleration that fades, m/s². Tuned, no source: what is more is a fault that
/// is not to be prolonged.
const HANDED_ACCELERATION_MAX_M_S2: f64 = 3.0;

/// The same of its angular acceleration, rad/s². Tuned, no source.
const HANDED_ACCELERATION_MAX_RAD_S2: f64 = 10.0;

/// A law with what a take-over has to know beside it.
#[derive(Debug, Clone, Copy)]
pub struct Flown<'a, C> {
    /// The law.
    pub law: &'a C,
    /// The vehicle that is flown.
    pub vehicle: &'a Vehicle,
    /// Time between two ticks of the law, s.
    pub period_s: f64,
}

impl<C: Controller> Flown<'_, C> {
    /// One tick: takes over where another law flew before, asks, and remembers what it asked for.
    /// `last_wrench` is that of the predecessor's last command, where no state was handed over.
    pub fn advance(
        &self,
        memory: &mut ControllerState,
        told: &Told<'_>,
        last_wrench: Option<Wrench>,
    ) -> Demand {
        self.take_over(memory, told, last_wrench);
        let mut demand = self.law.step(memory, told);
        demand.wrench = self.with_handed(memory, &demand.wrench);
        memory.law = C::LAW;
        memory.thrust = demand.wrench.thrust_N;
        memory.torque = demand.wrench.torque_B_N_m.into();
        demand
    }

    /// Where this is the first tick after another law flew, goes on from what that one asked for.
    fn take_over(&self, memory: &mut ControllerState, told: &Told<'_>, last_wrench: Option<Wrench>) {
        let handed = Wrench { thrust_N: memory.thrust, torque_B_N_m: memory.torque.into() };
        let is_anothers = memory.law != 0 && memory.law != C::LAW;
        if let Some(wrench) = last_wrench.or_else(|| is_anothers.then_some(handed)) {
            *memory = self.law.tracking(memory, &wrench, told);
            let asked = self.law.step(&mut memory.clone(), told).wrench;
            self.hand_over(memory, &wrench, &asked);
        } else if memory.law == 0 {
            *memory = self.law.fresh(told);
        }
    }

    /// Notes what of `wrench` the law does not ask for itself, within what a sane law asks for.
    fn hand_over(&self, memory: &mut ControllerState, wrench: &Wrench, asked: &Wrench) {
        let thrust_max_N = self.vehicle.mass_kg * HANDED_ACCELERATION_MAX_M_S2;
        let torque_max_N_m = self.vehicle.inertia_kg_m2.diagonal() * HANDED_ACCELERATION_MAX_RAD_S2;
        let missing_B_N_m = wrench.torque_B_N_m - asked.torque_B_N_m;
        memory.handed_thrust = within(wrench.thrust_N - asked.thrust_N, thrust_max_N);
        memory.handed_torque = std::array::from_fn(|axis| within(missing_B_N_m[axis], torque_max_N_m[axis]));
    }

    /// `asked` with what is left of the predecessor's wrench, which fades by one period.
    fn with_handed(&self, memory: &mut ControllerState, asked: &Wrench) -> Wrench {
        let wrench = Wrench {
            thrust_N: asked.thrust_N + memory.handed_thrust,
            torque_B_N_m: asked.torque_B_N_m + Vector3::from(memory.handed_torque),
        };
        let left = libm::exp(-self.period_s / HANDOVER_TIME_CONSTANT_S);
        memory.handed_thrust *= left;
        memory.handed_torque = memory.handed_torque.map(|torque_N_m| torque_N_m * left);
        wrench
    }
}

impl ControllerState {
    /// The vertical acceleration that another law's integrators ask for, within ±`max_m_s2`; `None` where no
    /// state was handed over.
    pub(crate) fn handed_lift_m_s2(&self, max_m_s2: f64) -> Option<f64> {
        let lift_m_s2 = self.integrals.altitude_m_s2 + self.position_integral[2];
        (self.law != 0).then_some(within(lift_m_s2, max_m_s2))
    }
}

/// `value` cut to ±`max`; nothing of a value that is not a number.
pub(crate) fn within(value: f64, max: f64) -> f64 {
    if value.is_nan() { 0.0 } else { value.clamp(-max, max) }
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
    let inputs = Wired::declare(&mut node);
    let command = node.output::<MotorCommand>("command")?;
    let status = node.optional_output::<ControlStatus>("status")?;
    let flown = Flown { law, vehicle, period_s: node.period_s() };
    node.run_with_state(ControllerState::default(), |tick, memory| {
        let told = inputs.told(tick);
        let demand = flown.advance(memory, &told, last_wrench(tick, command, allocation, vehicle));
        if let Some(what) = demand.not_finite() {
            // The allocation and the command map would make a command of it all the same.
            return Err(format!("the law asks for {what}: its output `command` is not sent"));
        }
        let allocated = allocation.allocate(&demand.wrench);
        let counts = allocated.speeds_rad_s.map(|speed| vehicle.command.command(speed));
        let report = report(&demand, &allocated, memory);
        tick.write(command, MotorCommand { command: counts, ..Default::default() })
            .and_then(|()| status.map_or(Ok(()), |status| tick.write(status, report)))
            .map_err(|error| error.to_string())
    })
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

    fn told<'a>(&self, tick: &'a Tick<'_>) -> Told<'a> {
        let estimate = self.estimate.map_or(&*NO_ESTIMATE, |estimate| tick.get(estimate));
        Told {
            motion: motion(estimate, self.attitude.map(|attitude| tick.get(attitude))),
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
