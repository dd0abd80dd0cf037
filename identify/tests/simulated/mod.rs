//! Flights of a vehicle whose truth is known, flown in this process: the plant's own physics under a small tracking
//! controller, seen by sensors with white noise.
#![allow(non_snake_case, reason = "a trailing _W or _B names the frame a vector is written in, N the newton")]
#![allow(dead_code, reason = "each test binary uses a part of it")]

use component::random::Stream;
use controllers::allocation::{Allocation, RotorWrench};
use flights::{Channel, Flight, Role};
use nalgebra::{UnitQuaternion, Vector3};
use plant::effects::{Effect, find};
use plant::{Airframe, Backend, FreeFlight, NewtonEuler, PerRotor, RigidBody};
use std::path::{Path, PathBuf};
use vehicles::{MotorModel, ROTORS_MAX, Vehicle};

pub mod bearing;
pub mod cases;
pub mod feedback;
pub mod rigs;

const TICK_S: f64 = 0.001;
/// A vehicle further away than this has got out of control: its flight does not compare with any other.
const FAR_M: f64 = 12.0;
/// Ticks from one sample of the battery's voltage to the next.
const VOLTAGE_TICKS: usize = 20;
/// Over this time a course comes up to speed.
const RUN_UP_S: f64 = 3.0;

/// Standard deviations of white noise, as multiples of good sensors'.
#[derive(Debug, Clone, Copy)]
pub struct Sensors {
    /// Times the noise of good sensors.
    pub noise: f64,
    /// Ticks from one sample of the pose to the next.
    pub pose_ticks: usize,
    /// Ticks from one sample of the inertial unit to the next.
    pub imu_ticks: usize,
    /// True if the rotors' speeds are logged.
    pub has_rotor_speeds: bool,
    /// True if the voltage of the battery is logged, of a truth that has one.
    pub has_voltage: bool,
    /// Delay of the pose's stamps.
    pub pose_delay_s: f64,
    /// Bias of the accelerometer.
    pub accelerometer_bias_m_s2: [f64; 3],
    /// Bias of the gyroscope.
    pub gyroscope_bias_rad_s: [f64; 3],
}

impl Default for Sensors {
    fn default() -> Self {
        Self {
            noise: 1.0,
            pose_ticks: 5,
            imu_ticks: 1,
            has_rotor_speeds: false,
            has_voltage: false,
            pose_delay_s: 0.0,
            accelerometer_bias_m_s2: [0.0; 3],
            gyroscope_bias_rad_s: [0.0; 3],
        }
    }
}

/// A flight to simulate.
#[derive(Debug, Clone)]
pub struct Plan {
    /// Effects that are true beyond the declared vehicle.
    pub truth: Vec<Effect>,
    /// The sensors.
    pub sensors: Sensors,
    /// Seed of the course and of the noise.
    pub seed: u64,
    /// Length.
    pub duration_s: f64,
    /// Height about which it flies.
    pub height_m: f64,
    /// True if a bearing holds its position: then neither position nor specific force is logged.
    pub is_on_rig: bool,
    /// True if it only drifts about a hover.
    pub is_calm: bool,
    /// Ticks from one command to the next.
    pub control_ticks: usize,
    /// Gains of the attitude's controller as multiples of a careful pilot's.
    pub stiffness: f64,
}

impl Plan {
    pub fn of(truth: Vec<Effect>, seed: u64) -> Self {
        let (sensors, duration_s, height_m) = (Sensors::default(), 30.0, 3.0);
        Self {
            truth,
            sensors,
            seed,
            duration_s,
            height_m,
            is_on_rig: false,
            is_calm: false,
            control_ticks: 2,
            stiffness: 1.0,
        }
    }
}

pub fn vehicle_file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../vehicles").join(name)
}

/// The effect `name` with these parameters, the others neutral or typical.
pub fn effect(name: &str, parameters: &[(&str, f64)]) -> Effect {
    let kind = find(name).expect("a known effect");
    let given = |name: &str| parameters.iter().find(|(known, _)| *known == name).map(|(_, value)| *value);
    kind.with(|spec| given(spec.name).or(spec.neutral).unwrap_or(spec.nominal))
}

/// The smooth course of a seed: sums of sines in all axes, up to about 3 m/s.
struct Course {
    axes: [[(f64, f64, f64); 3]; 4],
    height_m: f64,
}

impl Course {
    fn of(plan: &Plan) -> Self {
        let height_m = plan.height_m;
        let mut random = component::random::stream(plan.seed, "course");
        let mut uniform = move || {
            let normal = component::random::normal(&mut random);
            0.5 + normal.clamp(-2.0, 2.0) / 4.0
        };
        // Near the ground it stays clear of it.
        let room_m = if height_m < 1.0 { 0.7 * height_m } else { height_m };
        let vertical_m =
            [0.7_f64.min(0.25 * room_m), 0.4_f64.min(0.12 * room_m), 0.15_f64.min(0.05 * room_m)];
        let amplitudes = [[1.6, 0.8, 0.3], [1.6, 0.8, 0.3], vertical_m, [0.8, 0.4, 0.1]];
        let share = if plan.is_calm { 0.02 } else { 1.0 };
        let axes = amplitudes.map(|amplitudes| {
            let frequencies = [0.7, 1.5, 2.4];
            std::array::from_fn(|i| {
                (share * amplitudes[i], frequencies[i] * (0.8 + 0.4 * uniform()), 6.3 * uniform())
            })
        });
        Self { axes, height_m }
    }

    /// Position, velocity and acceleration, and the heading.
    fn at(&self, time_s: f64) -> ([Vector3<f64>; 3], f64) {
        // The course begins at rest: its own time runs up to speed.
        let (tau_s, rate, growth) = if time_s < RUN_UP_S {
            (time_s * time_s / (2.0 * RUN_UP_S), time_s / RUN_UP_S, 1.0 / RUN_UP_S)
        } else {
            (time_s - RUN_UP_S / 2.0, 1.0, 0.0)
        };
        let part = |axis: usize, order: i32| -> f64 {
            let one = |(size, w, phase): &(f64, f64, f64)| {
                let angle = w * tau_s + phase;
                size * match order {
                    0 => libm::sin(angle) - libm::sin(*phase),
                    1 => w * libm::cos(angle) * rate,
                    _ => w * libm::cos(angle) * growth - w * w * libm::sin(angle) * rate * rate,
                }
            };
            self.axes[axis].iter().map(one).sum::<f64>()
        };
        let vector = |order| Vector3::new(part(0, order), part(1, order), part(2, order));
        let mut position = vector(0);
        position.z += self.height_m;
        ([position, vector(1), vector(2)], part(3, 0))
    }
}

/// Flies the plan with a controller that knows the declared vehicle only.
pub fn fly(declared: &Vehicle, plan: &Plan, role: Role) -> Flight {
    let airframe = Airframe::with_effects(declared.clone(), plan.truth.clone());
    let effects = airframe.initial_state(plan.seed, "plant", TICK_S);
    let course = Course::of(plan);
    let sticks = Sticks::of(plan);
    let start = RigidBody::level_at(course.at(0.0).0[0]);
    let mut plant = FreeFlight::new(NewtonEuler::flying(airframe, 1), start, effects);
    let allocation = Allocation::new(declared).expect("a multirotor");
    let rotors = declared.rotors.len();
    let mut commands = PerRotor::filled(rotors, declared.hover_command());
    plant.settle_rotors(&commands);
    let slow_rad_s = PerRotor::filled(rotors, declared.hover_speed_rad_s());
    let period_s = plan.control_ticks as f64 * TICK_S;
    let mut pilot = Pilot {
        allocation,
        slow_rad_s,
        leaned: Vector3::zeros(),
        sunk: 0.0,
        period_s,
        stiffness: plan.stiffness,
        lead_s: lead_s(declared),
    };
    let mut log = Log::new(plan);
    log.flight.rotors = rotors;
    for tick in 0..(plan.duration_s / TICK_S) as usize {
        let time_s = tick as f64 * TICK_S;
        log.sample(tick, &plant, &commands);
        plant.step(&commands, TICK_S, &[]);
        if plan.is_on_rig {
            hold(&mut plant, start.position_W_m);
        }
        let position_W_m = plant.state().body.position_W_m;
        let is_near = position_W_m.xy().norm() < FAR_M && (0.0..FAR_M).contains(&position_W_m.z);
        assert!(is_near, "seed {} got away at {time_s} s", plan.seed);
        if tick % plan.control_ticks == 0 {
            commands = if plan.is_on_rig {
                stirred(declared, &pilot.allocation, &sticks, plant.state(), time_s)
            } else {
                pilot.commands(declared, &course, plant.state(), time_s)
            };
        }
    }
    log.flight(plan, role)
}

/// Holds the vehicle as the bearing of a rig does: it turns, but does not move.
fn hold(plant: &mut FreeFlight, position_W_m: Vector3<f64>) {
    let body = RigidBody { position_W_m, velocity_W_m_s: Vector3::zeros(), ..plant.state().body };
    plant.set_body(&body);
}

/// Time for which a pilot on a rig holds the sticks before moving them.
const STICK_S: f64 = 0.3;

/// Kicks of a pilot's sticks: torques and a part of the weight as thrust, held for [`STICK_S`] each.
struct Sticks(Vec<([f64; 3], f64)>);

impl Sticks {
    fn of(plan: &Plan) -> Self {
        Self::of_seed(plan.seed, plan.duration_s, 1.0)
    }

    /// Kicks `size` times as large as usual.
    fn of_seed(seed: u64, duration_s: f64, size: f64) -> Self {
        let mut random = component::random::stream(seed, "sticks");
        let mut normal = move || component::random::normal(&mut random);
        let count = (duration_s / STICK_S) as usize + 1;
        let one = |_| ([0.03, 0.03, 0.015].map(|torque| size * torque * normal()), 0.1 * normal());
        Self((0..count).map(one).collect())
    }
}

/// Commands of a pilot who kicks the vehicle on its rig about, and of a slow controller that levels it.
fn stirred(
    vehicle: &Vehicle,
    allocation: &Allocation,
    sticks: &Sticks,
    state: &plant::State,
    time_s: f64,
) -> PerRotor<f64> {
    let turn = (state.body.attitude_WB, state.body.angular_velocity_B_rad_s);
    stirred_by(vehicle, allocation, sticks, turn, time_s)
}

/// The same by attitude and angular velocity in B.
fn stirred_by(
    vehicle: &Vehicle,
    allocation: &Allocation,
    sticks: &Sticks,
    (attitude_WB, rates_B_rad_s): (UnitQuaternion<f64>, Vector3<f64>),
    time_s: f64,
) -> PerRotor<f64> {
    let (kick_N_m, lift) = sticks.0[(time_s / STICK_S) as usize];
    let levelling = vehicle.inertia_kg_m2 * (-2.0 * attitude_WB.scaled_axis() - 2.2 * rates_B_rad_s);
    let thrust_N = vehicle.mass_kg * vehicle.gravity_m_s2 * (1.0 + lift.clamp(-0.3, 0.3));
    let wrench = RotorWrench { thrust_N, torque_B_N_m: levelling + Vector3::from(kick_N_m) };
    allocation.allocate(&wrench).speeds_rad_s.map(|speed| vehicle.command.command(speed))
}

/// The values, and zeros behind the last rotor.
fn padded(values: &PerRotor<f64>) -> [f64; ROTORS_MAX] {
    std::array::from_fn(|rotor| values.get(rotor).copied().unwrap_or_default())
}

/// A tracking controller with careful gains: bounded for all truths of the cases.
struct Pilot {
    allocation: Allocation,
    /// Wanted speeds of the rotors, a moment ago.
    slow_rad_s: PerRotor<f64>,
    /// Integrals of the errors of attitude and height.
    leaned: Vector3<f64>,
    sunk: f64,
    period_s: f64,
    stiffness: f64,
    lead_s: f64,
}

/// Lead that takes the motors' lag back, over the slower part of it.
const LEAD_S: f64 = 0.08;
const LEAD_FILTER_S: f64 = 0.01;

/// The lead for motors as slow as the Hummingbird's, or as long as the lag of faster ones.
fn lead_s(vehicle: &Vehicle) -> f64 {
    match vehicle.motor {
        MotorModel::FirstOrder { time_constant_s } if time_constant_s < LEAD_S / 2.0 => time_constant_s,
        _ => LEAD_S,
    }
}
/// Most that errors of the course ask for sideways.
const ANSWER_MAX_M_S2: f64 = 4.0;

impl Pilot {
    fn commands(
        &mut self,
        vehicle: &Vehicle,
        course: &Course,
        state: &plant::State,
        time_s: f64,
    ) -> PerRotor<f64> {
        let ([position, velocity, acceleration], heading) = course.at(time_s);
        let body = &state.body;
        let (away, slip) = (position - body.position_W_m, velocity - body.velocity_W_m_s);
        self.sunk += self.period_s * away.z;
        let sideways = (1.2 * away.xy() + 2.0 * slip.xy()).cap_magnitude(ANSWER_MAX_M_S2);
        let upwards = vehicle.gravity_m_s2 + 5.0 * away.z + 4.0 * slip.z + 4.0 * self.sunk;
        let wanted = acceleration + sideways.push(upwards);
        let thrust_N = vehicle.mass_kg * wanted.dot(&(body.attitude_WB * Vector3::z()));
        let z = wanted.normalize();
        let y = z.cross(&Vector3::new(libm::cos(heading), libm::sin(heading), 0.0)).normalize();
        let rotation = nalgebra::Rotation3::from_basis_unchecked(&[y.cross(&z), y, z]);
        let error = body.attitude_WB.inverse() * UnitQuaternion::from_rotation_matrix(&rotation);
        self.leaned += self.period_s * error.scaled_axis();
        // A stiffer loop is damped alike.
        let (spring, damper) = (self.stiffness, self.stiffness.sqrt());
        let gains = (spring * Vector3::new(18.0, 18.0, 6.0), damper * Vector3::new(6.0, 6.0, 4.0));
        let turn = gains.0.component_mul(&error.scaled_axis())
            - gains.1.component_mul(&body.angular_velocity_B_rad_s)
            + 8.0 * self.leaned;
        let wrench = RotorWrench { thrust_N, torque_B_N_m: vehicle.inertia_kg_m2 * turn };
        self.hurried(self.allocation.allocate(&wrench).speeds_rad_s)
            .map(|speed| vehicle.command.command(speed))
    }

    fn hurried(&mut self, wanted_rad_s: PerRotor<f64>) -> PerRotor<f64> {
        let part = self.period_s / (self.period_s + LEAD_FILTER_S);
        PerRotor::from_fn(wanted_rad_s.len(), |i| {
            let rise = wanted_rad_s[i] - self.slow_rad_s[i];
            self.slow_rad_s[i] += part * rise;
            wanted_rad_s[i] + self.lead_s * part * rise / self.period_s
        })
    }
}

struct Log {
    random: Stream,
    sensors: Sensors,
    is_on_rig: bool,
    flight: Flight,
}

impl Log {
    fn new(plan: &Plan) -> Self {
        let random = component::random::stream(plan.seed, "sensors");
        Self { random, sensors: plan.sensors, is_on_rig: plan.is_on_rig, flight: empty() }
    }

    fn noisy(&mut self, value: [f64; 3], deviation: f64) -> [f64; 3] {
        value.map(|value| {
            let normal = component::random::normal(&mut self.random);
            value + self.sensors.noise * deviation * normal
        })
    }

    fn sample(&mut self, tick: usize, plant: &FreeFlight, commands: &PerRotor<f64>) {
        let time_s = tick as f64 * TICK_S;
        let body = plant.state().body;
        push(&mut self.flight.command, time_s, padded(commands));
        if tick.is_multiple_of(self.sensors.imu_ticks) && tick > 0 {
            let motion = plant.accelerations();
            let bias = Vector3::from(self.sensors.accelerometer_bias_m_s2);
            let force = self.noisy((motion.specific_force_B_m_s2 + bias).into(), 0.05);
            let drift = Vector3::from(self.sensors.gyroscope_bias_rad_s);
            let rates = self.noisy((body.angular_velocity_B_rad_s + drift).into(), 0.005);
            if !self.is_on_rig {
                push(&mut self.flight.specific_force, time_s, force);
            }
            push(&mut self.flight.angular_velocity, time_s, rates);
        }
        if tick.is_multiple_of(self.sensors.pose_ticks) {
            let stamp_s = time_s + self.sensors.pose_delay_s;
            let position = self.noisy(body.position_W_m.into(), 0.0005);
            let turn = self.noisy([0.0; 3], 0.001);
            let q = body.attitude_WB * UnitQuaternion::from_scaled_axis(Vector3::from(turn));
            if !self.is_on_rig {
                push(&mut self.flight.position, stamp_s, position);
            }
            let q = [q.w, q.i, q.j, q.k];
            let last = self.flight.attitude.values.last().copied().unwrap_or(q);
            let is_turned = q.iter().zip(&last).map(|(a, b)| a * b).sum::<f64>() < 0.0;
            push(&mut self.flight.attitude, stamp_s, if is_turned { q.map(|x| -x) } else { q });
        }
        if self.sensors.has_rotor_speeds {
            let speeds = plant.state().rotors.map(|rotor| {
                let normal = component::random::normal(&mut self.random);
                rotor.speed_rad_s + self.sensors.noise * normal
            });
            push(&mut self.flight.rotor_speed, time_s, padded(&speeds));
        }
        if self.sensors.has_voltage && tick.is_multiple_of(VOLTAGE_TICKS) {
            let battery = plant.battery().expect("a truth with a battery");
            let [voltage_V, _, _] = self.noisy([battery.voltage_V, 0.0, 0.0], 0.02);
            push(&mut self.flight.battery_voltage, time_s, [voltage_V]);
        }
    }

    fn flight(mut self, plan: &Plan, role: Role) -> Flight {
        self.flight.name = format!("seed {}", plan.seed);
        self.flight.role = role;
        self.flight
    }
}

fn push<const N: usize>(channel: &mut Channel<N>, time_s: f64, value: [f64; N]) {
    channel.time_s.push(time_s);
    channel.values.push(value);
}

/// A flight without any sample.
pub fn empty() -> Flight {
    Flight::new("", "", Role::Fit)
}
