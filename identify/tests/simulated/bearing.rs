//! A vehicle that a bearing holds at a point, integrated independently of the plant: by the angular momentum in the world, with
//! dry friction as impulses that at most stop the rotation.
#![allow(non_snake_case, reason = "a trailing _W or _B names the frame a vector is written in, N the newton")]

use super::{Sensors, Sticks, empty, padded, push, stirred_by};
use component::random::Stream;
use controllers::allocation::Allocation;
use flights::{Flight, FlightSet, Role};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use plant::PerRotor;
use vehicles::{MotorModel, Vehicle};

/// Step of the integration.
const STEP_S: f64 = 1e-4;
/// Steps from one sample of the log to the next.
const STEPS_PER_TICK: usize = 10;
const TICK_S: f64 = 1e-3;

/// Friction of the bearing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Friction {
    /// A ball joint: opposite to the vector of the angular velocity. Coulomb torque in N*m, viscous in N*m*s/rad.
    Ball(f64, f64),
    /// A gimbal: about each axis of the body by itself. Coulomb torques in N*m, viscous ones in N*m*s/rad.
    Gimbal([f64; 3], [f64; 3]),
}

/// A vehicle on its bearing, and the log of its flight.
#[derive(Debug, Clone, Copy)]
pub struct Bearing {
    /// Thrust of all rotors as a multiple of the declared.
    pub thrust: f64,
    /// Moments of inertia about the bearing as multiples of the declared.
    pub inertia: [f64; 3],
    /// Mass times its depth below the bearing, kg*m.
    pub static_moment_kg_m: f64,
    pub friction: Friction,
    /// Tracked point, seen from the bearing; `None` if no position is logged.
    pub marker_B_m: Option<[f64; 3]>,
    /// Accelerometer, seen from the bearing; `None` if no specific force is logged.
    pub accelerometer_B_m: Option<[f64; 3]>,
    pub sensors: Sensors,
    /// Size of the pilot's kicks as a multiple of the plant's flights on a rig.
    pub kicks: f64,
    pub seed: u64,
    pub duration_s: f64,
}

impl Bearing {
    /// The declared vehicle on a bearing without friction; attitude, gyroscope and commands are logged.
    pub fn plain(seed: u64, duration_s: f64) -> Self {
        Self {
            thrust: 1.0,
            inertia: [1.0; 3],
            static_moment_kg_m: 0.0,
            friction: Friction::Ball(0.0, 0.0),
            marker_B_m: None,
            accelerometer_B_m: None,
            sensors: Sensors::default(),
            kicks: 1.0,
            seed,
            duration_s,
        }
    }

    /// The same with a position and an accelerometer in the log.
    pub fn tracked(self) -> Self {
        Self { marker_B_m: Some([0.0, 0.0, 0.05]), accelerometer_B_m: Some([0.01, 0.0, 0.02]), ..self }
    }

    /// A flight to fit on and one to test on, of the vehicle that `file` declares.
    pub fn flights(&self, file: &str) -> FlightSet {
        let vehicle = Vehicle::load(&super::vehicle_file(file)).expect("a vehicle file");
        let test = Self { seed: self.seed + 100_000, ..*self };
        FlightSet {
            vehicle: super::vehicle_file(file),
            flights: vec![self.flight(&vehicle, Role::Fit), test.flight(&vehicle, Role::Test)],
            next_flight: Default::default(),
            files: Default::default(),
        }
    }

    /// Flies it with a pilot who knows the declared vehicle only.
    pub fn flight(&self, declared: &Vehicle, role: Role) -> Flight {
        let allocation = Allocation::new(declared).expect("a multirotor");
        let sticks = Sticks::of_seed(self.seed, self.duration_s, self.kicks);
        let mut body = Body::at_rest(self, declared);
        let mut commands = PerRotor::filled(declared.rotors.len(), declared.hover_command());
        let mut log = Log::of(self, declared);
        for tick in 0..(self.duration_s / TICK_S) as usize {
            let time_s = tick as f64 * TICK_S;
            log.sample(self, tick, &body, &commands);
            let targets =
                PerRotor::from_fn(commands.len(), |i| declared.commanded_speed_rad_s(i, commands[i]));
            (0..STEPS_PER_TICK).for_each(|_| body.advance(self, declared, &targets));
            if tick % 2 == 0 {
                let turn = (body.attitude_WB, body.rates_B_rad_s);
                commands = stirred_by(declared, &allocation, &sticks, turn, time_s);
            }
        }
        log.flight.role = role;
        log.flight
    }
}

/// State of the integration.
struct Body {
    attitude_WB: UnitQuaternion<f64>,
    /// Angular momentum of body and rotors about the bearing.
    momentum_W: Vector3<f64>,
    rates_B_rad_s: Vector3<f64>,
    /// Rate of change of the rates over the last step.
    turning_B_rad_s2: Vector3<f64>,
    inertia: Matrix3<f64>,
    speeds_rad_s: PerRotor<f64>,
    spin_ups_rad_s2: PerRotor<f64>,
}

impl Body {
    fn at_rest(bearing: &Bearing, declared: &Vehicle) -> Self {
        let moments = declared.inertia_kg_m2.diagonal().component_mul(&Vector3::from(bearing.inertia));
        let speeds_rad_s = PerRotor::filled(declared.rotors.len(), declared.hover_speed_rad_s());
        let rest = Vector3::zeros();
        Self {
            attitude_WB: UnitQuaternion::identity(),
            momentum_W: rotors_momentum(declared, &speeds_rad_s),
            rates_B_rad_s: rest,
            turning_B_rad_s2: rest,
            inertia: Matrix3::from_diagonal(&moments),
            spin_ups_rad_s2: speeds_rad_s.map(|_| 0.0),
            speeds_rad_s,
        }
    }

    fn advance(&mut self, bearing: &Bearing, declared: &Vehicle, targets_rad_s: &PerRotor<f64>) {
        self.spin(declared, targets_rad_s);
        let torque_B =
            self.torque_of_air_B_N_m(bearing, declared) + self.torque_of_weight_B_N_m(bearing, declared);
        self.momentum_W += self.attitude_WB * torque_B * STEP_S;
        let of_rotors = rotors_momentum(declared, &self.speeds_rad_s);
        let of_body = self.attitude_WB.inverse() * self.momentum_W - of_rotors;
        let free_rad_s = Vector3::from_fn(|i, _| of_body[i] / self.inertia[(i, i)]);
        let braked_rad_s = self.braked(bearing.friction, free_rad_s);
        self.turning_B_rad_s2 = (braked_rad_s - self.rates_B_rad_s) / STEP_S;
        self.rates_B_rad_s = braked_rad_s;
        self.momentum_W = self.attitude_WB * (self.inertia * braked_rad_s + of_rotors);
        self.attitude_WB *= UnitQuaternion::from_scaled_axis(braked_rad_s * STEP_S);
    }

    fn spin(&mut self, declared: &Vehicle, targets_rad_s: &PerRotor<f64>) {
        for rotor in 0..self.speeds_rad_s.len() {
            let missing_rad_s = targets_rad_s[rotor] - self.speeds_rad_s[rotor];
            let spin_up = &mut self.spin_ups_rad_s2[rotor];
            match declared.motor {
                MotorModel::FirstOrder { time_constant_s } => *spin_up = missing_rad_s / time_constant_s,
                MotorModel::SecondOrder { natural_frequency_rad_s: wn, damping_ratio: zeta } => {
                    *spin_up += STEP_S * (wn * wn * missing_rad_s - 2.0 * zeta * wn * *spin_up);
                }
            }
            self.speeds_rad_s[rotor] += STEP_S * self.spin_ups_rad_s2[rotor];
        }
    }

    /// Torque of thrusts and drags; all rotors stand upright.
    fn torque_of_air_B_N_m(&self, bearing: &Bearing, declared: &Vehicle) -> Vector3<f64> {
        let mut torque = Vector3::zeros();
        for (rotor, speed_rad_s) in declared.rotors.iter().zip(&self.speeds_rad_s) {
            let thrust_N = bearing.thrust * declared.thrust_coefficient * speed_rad_s * speed_rad_s;
            torque.x += rotor.position_m.y * thrust_N;
            torque.y -= rotor.position_m.x * thrust_N;
            torque.z -= rotor.spin * declared.torque_coefficient * speed_rad_s * speed_rad_s;
        }
        torque
    }

    /// A weight below the bearing pulls its arm downwards.
    fn torque_of_weight_B_N_m(&self, bearing: &Bearing, declared: &Vehicle) -> Vector3<f64> {
        let arm_times_mass_B = -bearing.static_moment_kg_m * Vector3::z();
        let down_B = self.attitude_WB.inverse() * -Vector3::z();
        arm_times_mass_B.cross(&(declared.gravity_m_s2 * down_B))
    }

    /// The rates after the friction of a step: its impulse at most stops them.
    fn braked(&self, friction: Friction, rates_rad_s: Vector3<f64>) -> Vector3<f64> {
        let moments = self.inertia.diagonal();
        let slower = |rate: f64, loss: f64| rate.signum() * (rate.abs() - loss).max(0.0);
        match friction {
            Friction::Gimbal(dry, viscous) => Vector3::from_fn(|i, _| {
                let torque_N_m = dry[i] + viscous[i] * rates_rad_s[i].abs();
                slower(rates_rad_s[i], torque_N_m * STEP_S / moments[i])
            }),
            Friction::Ball(dry, viscous) => {
                let rate = rates_rad_s.norm();
                let against =
                    rates_rad_s.try_normalize(0.0).unwrap_or_default() * ((dry + viscous * rate) * STEP_S);
                let change = against.component_div(&moments);
                // It stops where the impulse would turn the rotation round.
                if change.dot(&rates_rad_s) >= rate * rate { Vector3::zeros() } else { rates_rad_s - change }
            }
        }
    }
}

/// Angular momentum of the spinning rotors in B.
fn rotors_momentum(declared: &Vehicle, speeds_rad_s: &PerRotor<f64>) -> Vector3<f64> {
    let one = |(rotor, speed): (&vehicles::Rotor, &f64)| rotor.spin * declared.rotor_inertia_kg_m2 * speed;
    Vector3::z() * declared.rotors.iter().zip(speeds_rad_s).map(one).sum::<f64>()
}

struct Log {
    flight: Flight,
    random: Stream,
    gravity_m_s2: f64,
}

impl Log {
    fn of(bearing: &Bearing, declared: &Vehicle) -> Self {
        let mut flight = empty();
        flight.name = format!("bearing {}", bearing.seed);
        flight.rotors = declared.rotors.len();
        let random = component::random::stream(bearing.seed, "sensors of a bearing");
        Self { flight, random, gravity_m_s2: declared.gravity_m_s2 }
    }

    fn noisy(&mut self, value: Vector3<f64>, deviation: f64) -> [f64; 3] {
        value.map(|value| value + deviation * component::random::normal(&mut self.random)).into()
    }

    fn sample(&mut self, bearing: &Bearing, tick: usize, body: &Body, commands: &PerRotor<f64>) {
        let (time_s, noise, sensors) = (tick as f64 * TICK_S, bearing.sensors.noise, bearing.sensors);
        push(&mut self.flight.command, time_s, padded(commands));
        if tick.is_multiple_of(sensors.imu_ticks) && tick > 0 {
            let rates = self.noisy(body.rates_B_rad_s, 0.005 * noise);
            push(&mut self.flight.angular_velocity, time_s, rates);
            if let Some(arm_B_m) = bearing.accelerometer_B_m {
                let force =
                    self.noisy(specific_force_B(body, arm_B_m.into(), self.gravity_m_s2), 0.05 * noise);
                push(&mut self.flight.specific_force, time_s, force);
            }
        }
        if tick.is_multiple_of(sensors.pose_ticks) {
            let turn = self.noisy(Vector3::zeros(), 0.001 * noise);
            let q = body.attitude_WB * UnitQuaternion::from_scaled_axis(turn.into());
            push(&mut self.flight.attitude, time_s, [q.w, q.i, q.j, q.k]);
            if let Some(arm_B_m) = bearing.marker_B_m {
                let place_W_m = Vector3::new(0.4, -0.2, 1.5) + body.attitude_WB * Vector3::from(arm_B_m);
                let place = self.noisy(place_W_m, 0.0005 * noise);
                push(&mut self.flight.position, time_s, place);
            }
        }
        if sensors.has_rotor_speeds {
            let speeds =
                body.speeds_rad_s.map(|speed| speed + noise * component::random::normal(&mut self.random));
            push(&mut self.flight.rotor_speed, time_s, padded(&speeds));
        }
    }
}

/// Reading of an accelerometer at `arm_B_m` from the bearing, which bears the weight.
fn specific_force_B(body: &Body, arm_B_m: Vector3<f64>, gravity_m_s2: f64) -> Vector3<f64> {
    let (rates, turning) = (body.rates_B_rad_s, body.turning_B_rad_s2);
    let borne = body.attitude_WB.inverse() * Vector3::z() * gravity_m_s2;
    borne + turning.cross(&arm_B_m) + rates.cross(&rates.cross(&arm_B_m))
}
