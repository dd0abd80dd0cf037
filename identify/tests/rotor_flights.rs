//! Rotors from flights whose truth is known: intervals hold it, and figures that a log cannot tell are said to be so.

use crate::simulated;
use crate::skipped;
use std::path::Path;

use flights::{Channel, Flight, FlightSet, Role};
use identify::rotor::{self, Figure, FlownMotor, Found, Order};
use rand_chacha::ChaCha8Rng;
use rand_core::SeedableRng;
use simulated::{Plan, effect, fly, vehicle_file};
use vehicles::{MotorModel, ROTORS_MAX, Vehicle};

fn declared() -> Vehicle {
    Vehicle::load(&vehicle_file("hummingbird.toml")).unwrap()
}

/// The declared vehicle with other rotors, motors and commands.
fn true_vehicle(motor: MotorModel) -> Vehicle {
    let mut vehicle = declared();
    vehicle.thrust_coefficient *= 0.92;
    vehicle.torque_coefficient *= 1.2;
    vehicle.motor = motor;
    vehicle.command.speed_at_min_rad_s = 60.0;
    vehicle.command.speed_at_max_rad_s = 1010.0;
    vehicle
}

fn set(flights: Vec<Flight>) -> FlightSet {
    let vehicle = vehicle_file("hummingbird.toml");
    FlightSet { vehicle, flights, next_flight: Default::default(), files: Default::default() }
}

fn holds(figure: &Figure, truth: f64) -> bool {
    figure.determined().is_some_and(|estimate| estimate.low <= truth && truth <= estimate.high)
}

/// Random numbers of a case.
struct Draws(ChaCha8Rng);

impl Draws {
    fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    fn normal(&mut self) -> f64 {
        component::random::normal(&mut self.0)
    }
}

/// Motors whose commands, speeds and voltage are logged; they carry nothing.
#[derive(Debug, Clone, Copy)]
struct Bench {
    seed: u64,
    time_constant_s: f64,
    delay_s: f64,
    power: f64,
    command_period_s: f64,
}

const LOW: f64 = 90.0;
const HIGH: f64 = 950.0;
const REFERENCE_V: f64 = 11.4;
const TICK_S: f64 = 0.0005;

impl Bench {
    fn of(seed: u64) -> Self {
        Self { seed, time_constant_s: 0.035, delay_s: 0.013, power: 1.0, command_period_s: 0.004 }
    }

    /// A flight of 20 s: slow commands with steps, noise of 2 rad/s that a second of it remembers, a battery that sags.
    fn flight(&self, name: &str, role: Role) -> Flight {
        let mut draws = Draws::new(self.seed.wrapping_mul(31).wrapping_add(name.len() as u64));
        let mut flight = Flight::new(name, name, role);
        let every = |period_s: f64| (period_s / TICK_S).round() as usize;
        let (mut speeds, mut slow, mut command) = ([400.0; 4], [0.0; 4], [70.0; 4]);
        let late = every(self.delay_s);
        let mut sent: Vec<[f64; 4]> = Vec::new();
        for tick in 0..40_000 {
            let time_s = tick as f64 * TICK_S;
            if tick % every(0.12) == 0 {
                command = std::array::from_fn(|_| (75.0 + 22.0 * draws.normal()).clamp(5.0, 195.0));
            }
            sent.push(command);
            if tick % every(self.command_period_s) == 0 {
                push(&mut flight.command, time_s, &command);
            }
            let voltage_v = 12.3 - 0.09 * time_s + 0.02 * libm::sin(time_s);
            let heard = sent[tick.saturating_sub(late)];
            let gain = libm::pow(voltage_v / REFERENCE_V, self.power);
            if tick % every(0.01) == 0 {
                slow = slow.map(|slow| 0.99 * slow + 0.14 * draws.normal());
                let seen: [f64; 4] = std::array::from_fn(|i| speeds[i] + slow[i] + 1.5 * draws.normal());
                push(&mut flight.rotor_speed, time_s, &seen);
            }
            if tick % every(0.1) == 0 {
                flight.battery_voltage.time_s.push(time_s);
                flight.battery_voltage.values.push([voltage_v + 0.01 * draws.normal()]);
            }
            for (speed, command) in speeds.iter_mut().zip(heard) {
                let target = (LOW + (HIGH - LOW) * (command - 1.0) / 199.0) * gain;
                *speed = target + (*speed - target) * libm::exp(-TICK_S / self.time_constant_s);
            }
        }
        flight
    }

    fn found(&self) -> Found {
        let flights = vec![self.flight("fit", Role::Fit), self.flight("tested", Role::Test)];
        rotor::run_flights(&set(flights)).unwrap()
    }

    fn motor(&self) -> FlownMotor {
        self.found().report.flights.unwrap().motor.unwrap()
    }
}

fn push(channel: &mut Channel<ROTORS_MAX>, time_s: f64, values: &[f64; 4]) {
    channel.time_s.push(time_s);
    channel.values.push(std::array::from_fn(|i| values.get(i).copied().unwrap_or_default()));
}

#[test]
fn map_lag_delay_and_voltage_lie_in_their_intervals() {
    let mut inside = [0; 5];
    let seeds = skipped::first(8, "seeds", 0..12);
    let cases = seeds.len() as u64;
    for seed in seeds {
        let bench = Bench::of(seed);
        let motor = bench.motor();
        let gain = libm::pow(motor.reference_voltage_v.unwrap() / REFERENCE_V, bench.power);
        let lag = &motor.first;
        let all = [
            (&motor.common.speed_at_min, LOW * gain),
            (&motor.common.speed_at_max, HIGH * gain),
            (lag.time_constant.as_ref().unwrap(), bench.time_constant_s),
            (&lag.delay, bench.delay_s),
            (&motor.common.voltage_power, bench.power),
        ];
        for (count, (figure, truth)) in inside.iter_mut().zip(all) {
            *count += u64::from(holds(figure, truth));
        }
        assert_eq!(motor.comparison.preferred, Order::First);
        assert!(motor.held_out[0].fitted < 0.2 * motor.held_out[0].declared, "{:?}", motor.held_out);
    }
    assert!(inside.iter().all(|count| *count >= cases - cases / 4), "{inside:?} of {cases}");
}

/// Flights of `truth` with the effects of the air, the last of them held out; `noise` times that of good sensors.
fn flown(truth: &Vehicle, seed: u64, noise: f64) -> Vec<Flight> {
    let effects = vec![effect("rotor-drag", &[]), effect("translational-lift", &[])];
    let mut plan = Plan::of(effects, seed);
    plan.sensors.has_rotor_speeds = true;
    plan.sensors.noise = noise;
    plan.sensors.accelerometer_bias_m_s2 = [0.0, 0.0, 0.3];
    let one = |(at, role): (u64, Role)| fly(truth, &Plan { seed: 10 * at + seed, ..plan.clone() }, role);
    [(0_u64, Role::Fit), (1, Role::Fit), (2, Role::Test)].map(one).to_vec()
}

#[test]
fn flights_give_map_motor_and_coefficients() {
    let truth = true_vehicle(MotorModel::SecondOrder { natural_frequency_rad_s: 20.0, damping_ratio: 0.7 });
    let inertia = truth.rotor_inertia_kg_m2 / truth.inertia_kg_m2[(2, 2)];
    let mut misses = Vec::new();
    let seeds = [1, 2, 3];
    for seed in seeds {
        let report = rotor::run_flights(&set(flown(&truth, seed, 1.0))).unwrap().report;
        let flown = report.flights.as_ref().unwrap();
        let motor = flown.motor.as_ref().unwrap();
        let coefficients = flown.coefficients.as_ref().unwrap();
        let mut all = vec![
            ("least speed", &motor.common.speed_at_min, 60.0),
            ("greatest speed", &motor.common.speed_at_max, 1010.0),
            ("natural frequency", motor.second.natural_frequency.as_ref().unwrap(), 20.0),
            ("damping", motor.second.damping_ratio.as_ref().unwrap(), 0.7),
            ("delay", &motor.second.delay, 0.0),
            ("c_T", &coefficients.thrust.coefficient, truth.thrust_coefficient),
            ("c_Q", &coefficients.torque.coefficient, truth.torque_coefficient),
            ("rotor inertia", &coefficients.rotor_inertia_per_inertia, inertia),
        ];
        all.extend(
            coefficients
                .thrust
                .rotors
                .iter()
                .map(|(_, figure)| ("c_T of one", figure, truth.thrust_coefficient)),
        );
        all.extend(
            coefficients
                .torque
                .rotors
                .iter()
                .map(|(_, figure)| ("c_Q of one", figure, truth.torque_coefficient)),
        );
        let missed = all.iter().filter(|(_, figure, truth)| !holds(figure, *truth));
        misses
            .extend(missed.map(|(name, figure, truth)| format!("seed {seed}, {name}: {truth:e} {figure:?}")));
        assert_eq!(motor.comparison.preferred, Order::Second, "{report}");
        let held_out =
            motor.held_out.iter().chain(&coefficients.thrust.held_out).chain(&coefficients.torque.held_out);
        assert_eq!(held_out.clone().count(), 3, "{report}");
        assert!(held_out.clone().all(|error| error.fitted < error.declared), "{report}");
        let thrust = coefficients.thrust.coefficient.estimate.unwrap();
        assert!(thrust.high - thrust.low < 0.02 * thrust.value, "{report}");
    }
    // Of 48 intervals of 95 % two or three miss.
    assert!(misses.len() <= 5, "{misses:#?}");
}

/// The figures of a flights file of measured flights, `None` where there is no data.
fn measured(name: &str) -> Option<Found> {
    skipped::variable_or_skip("HUMMINGBUS_DATA", "the folder of measured flights")?;
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../flights/{name}.toml"));
    Some(rotor::run(&path).unwrap())
}

/// Rotor speeds without commands: thrust by the mass, with what is left out said in a sentence.
#[test]
fn a_brushless_crazyflie_has_its_published_thrust() {
    let Some(found) = measured("nanodrone") else { return };
    let flown = found.report.flights.as_ref().unwrap();
    assert!(
        flown.motor.is_none() && flown.findings.iter().any(|text| text.contains("`command` is not logged"))
    );
    let thrust = flown.coefficients.as_ref().unwrap().thrust.coefficient.determined().unwrap();
    assert!(thrust.low < 3.78e-8 && thrust.high > 3.69e-8, "{}", found.report);
}

/// A controller that holds the yaw hides the torque: the interval of c_Q holds 0, and the vehicle file keeps its value.
#[test]
fn an_agile_quadrotor_has_a_thrust_and_no_torque() {
    let Some(found) = measured("neurobem") else { return };
    let flown = found.report.flights.as_ref().unwrap();
    let coefficients = flown.coefficients.as_ref().unwrap();
    let thrust = coefficients.thrust.coefficient.determined().unwrap();
    // The weight over the squares of a hover's speeds is 1.55e-6.
    assert!((1.45e-6..1.6e-6).contains(&thrust.value), "{}", found.report);
    assert!(coefficients.torque.coefficient.determined().is_none(), "{}", found.report);
    assert!(found.tables.contains("torque_coefficient = { value = 2e-8"), "{}", found.tables);
}
