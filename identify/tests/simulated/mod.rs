//! Flights of a vehicle whose truth is known, flown in this process: the plant's own physics under a small tracking
//! controller, seen by sensors with white noise.
#![allow(non_snake_case, reason = "a trailing _W or _B names the frame a vector is written in, N the newton")]
#![allow(dead_code, reason = "each test binary uses a part of it")]

use bus::random::Stream;
use controllers::allocation::{Allocation, RotorSet, Wrench};
use flights::{Channel, Flight, Role};
use nalgebra::{UnitQuaternion, Vector3};
use plant::effects::{Effect, find};
use plant::{Airframe, Backend, FreeFlight, NewtonEuler, RigidBody};
use rand_distr::{Distribution, StandardNormal};
use std::path::{Path, PathBuf};
use vehicles::Vehicle;

const TICK_S: f64 = 0.001;
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
    /// Whether the rotors' speeds are logged.
    pub has_rotor_speeds: bool,
    /// How late the pose is stamped.
    pub pose_delay_s: f64,
    /// Bias of the accelerometer.
    pub accelerometer_bias_m_s2: [f64; 3],
}

impl Default for Sensors {
    fn default() -> Self {
        Self {
            noise: 1.0,
            pose_ticks: 5,
            imu_ticks: 1,
            has_rotor_speeds: false,
            pose_delay_s: 0.0,
            accelerometer_bias_m_s2: [0.0; 3],
        }
    }
}

/// A flight to simulate.
#[derive(Debug, Clone)]
pub struct Plan {
    /// What is true beyond the declared vehicle.
    pub truth: Vec<Effect>,
    /// The sensors.
    pub sensors: Sensors,
    /// Which course and which noise.
    pub seed: u64,
    /// Length.
    pub duration_s: f64,
    /// Height about which it flies.
    pub height_m: f64,
}

impl Plan {
    pub fn of(truth: Vec<Effect>, seed: u64) -> Self {
        Self { truth, sensors: Sensors::default(), seed, duration_s: 30.0, height_m: 3.0 }
    }
}

pub fn vehicle_file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../vehicles").join(name)
}

/// The effect `name` with these parameters, the others neutral or typical.
pub fn effect(name: &str, parameters: &[(&str, f64)]) -> Effect {
    let kind = find(name).expect("a known effect");
    let given = |name: &str| parameters.iter().find(|(own, _)| *own == name).map(|(_, value)| *value);
    kind.with(|spec| given(spec.name).or(spec.neutral).unwrap_or(spec.typical))
}

/// The smooth course of a seed: sums of sines in all axes, up to about 3 m/s.
struct Course {
    axes: [[(f64, f64, f64); 3]; 4],
    height_m: f64,
}

impl Course {
    fn of(seed: u64, height_m: f64) -> Self {
        let mut random = bus::random::stream(seed, "course");
        let mut uniform = move || {
            let normal: f64 = StandardNormal.sample(&mut random);
            0.5 + normal.clamp(-2.0, 2.0) / 4.0
        };
        let vertical_m = [0.7_f64.min(0.25 * height_m), 0.4_f64.min(0.12 * height_m), 0.15_f64.min(0.05 * height_m)];
        let amplitudes = [[1.6, 0.8, 0.3], [1.6, 0.8, 0.3], vertical_m, [0.8, 0.4, 0.1]];
        let axes = amplitudes.map(|amplitudes| {
            let frequencies = [0.8, 1.7, 3.1];
            std::array::from_fn(|i| {
                (amplitudes[i], frequencies[i] * (0.8 + 0.4 * uniform()), 6.3 * uniform())
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
                    0 => angle.sin() - phase.sin(),
                    1 => w * angle.cos() * rate,
                    _ => w * angle.cos() * growth - w * w * angle.sin() * rate * rate,
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
    let memory = airframe.memory(plan.seed, "plant", TICK_S);
    let course = Course::of(plan.seed, plan.height_m);
    let start = RigidBody::level_at(course.at(0.0).0[0]);
    let mut plant = FreeFlight::new(NewtonEuler::flying(airframe, 1), start, memory);
    let allocation = Allocation::new(&RotorSet::from(declared)).expect("a quadrotor");
    let mut commands = [declared.hover_command(); 4];
    plant.settle_rotors(&commands);
    let mut log = Log::new(plan);
    for tick in 0..(plan.duration_s / TICK_S) as usize {
        let time_s = tick as f64 * TICK_S;
        log.sample(tick, &plant, &commands);
        plant.step(&commands, TICK_S, &[]);
        if tick % 2 == 0 {
            commands = controlled(declared, &allocation, &course, plant.state(), time_s);
        }
    }
    log.flight(plan, role)
}

fn controlled(
    vehicle: &Vehicle,
    allocation: &Allocation,
    course: &Course,
    state: &plant::State,
    time_s: f64,
) -> [f64; 4] {
    let ([position, velocity, acceleration], heading) = course.at(time_s);
    let body = &state.body;
    let wanted = acceleration
        + 6.0 * (position - body.position_W_m)
        + 4.0 * (velocity - body.velocity_W_m_s)
        + Vector3::z() * vehicle.gravity_m_s2;
    let up = body.attitude_WB * Vector3::z();
    let thrust_N = vehicle.mass_kg * wanted.dot(&up);
    let z = wanted.normalize();
    let y = z.cross(&Vector3::new(heading.cos(), heading.sin(), 0.0)).normalize();
    let rotation = nalgebra::Rotation3::from_basis_unchecked(&[y.cross(&z), y, z]);
    let error = body.attitude_WB.inverse() * UnitQuaternion::from_rotation_matrix(&rotation);
    let torque = vehicle.inertia_kg_m2
        * (100.0 * error.scaled_axis() - 18.0 * body.angular_velocity_B_rad_s);
    let wrench = Wrench { thrust_N, torque_B_N_m: torque };
    allocation.allocate(&wrench).speeds_rad_s.map(|speed| vehicle.command.command(speed))
}

struct Log {
    random: Stream,
    sensors: Sensors,
    flight: Flight,
}

impl Log {
    fn new(plan: &Plan) -> Self {
        let random = bus::random::stream(plan.seed, "sensors");
        Self { random, sensors: plan.sensors, flight: empty() }
    }

    fn noisy(&mut self, value: [f64; 3], deviation: f64) -> [f64; 3] {
        value.map(|value| {
            let normal: f64 = StandardNormal.sample(&mut self.random);
            value + self.sensors.noise * deviation * normal
        })
    }

    fn sample(&mut self, tick: usize, plant: &FreeFlight, commands: &[f64; 4]) {
        let time_s = tick as f64 * TICK_S;
        let body = plant.state().body;
        push(&mut self.flight.command, time_s, *commands);
        if tick % self.sensors.imu_ticks == 0 && tick > 0 {
            let motion = plant.motion();
            let bias = Vector3::from(self.sensors.accelerometer_bias_m_s2);
            let force = self.noisy((motion.specific_force_B_m_s2 + bias).into(), 0.05);
            let rates = self.noisy(body.angular_velocity_B_rad_s.into(), 0.005);
            push(&mut self.flight.specific_force, time_s, force);
            push(&mut self.flight.angular_velocity, time_s, rates);
        }
        if tick % self.sensors.pose_ticks == 0 {
            let stamp_s = time_s + self.sensors.pose_delay_s;
            let position = self.noisy(body.position_W_m.into(), 0.0005);
            let turn = self.noisy([0.0; 3], 0.001);
            let q = body.attitude_WB * UnitQuaternion::from_scaled_axis(Vector3::from(turn));
            push(&mut self.flight.position, stamp_s, position);
            let q = [q.w, q.i, q.j, q.k];
            let last = self.flight.attitude.values.last().copied().unwrap_or(q);
            let is_turned = q.iter().zip(&last).map(|(a, b)| a * b).sum::<f64>() < 0.0;
            push(&mut self.flight.attitude, stamp_s, if is_turned { q.map(|x| -x) } else { q });
        }
        if self.sensors.has_rotor_speeds {
            let speeds = plant.state().rotors.map(|rotor| {
                let normal: f64 = StandardNormal.sample(&mut self.random);
                rotor.speed_rad_s + self.sensors.noise * normal
            });
            push(&mut self.flight.rotor_speed, time_s, speeds);
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
    Flight {
        name: String::new(),
        file: PathBuf::new(),
        role: Role::Fit,
        command: Channel::default(),
        rotor_speed: Channel::default(),
        position: Channel::default(),
        velocity: Channel::default(),
        attitude: Channel::default(),
        angular_velocity: Channel::default(),
        specific_force: Channel::default(),
        battery_voltage: Channel::default(),
        assumed: Vec::new(),
        notes: Vec::new(),
    }
}
