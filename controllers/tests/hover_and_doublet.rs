//! The thesis's first scenario (Figs 5.1–5.5) in a closed loop: hover from 1.0 to 1.5 m at 2 s, then a roll
//! doublet of ±10° at 6 s. A noisy IMU and the complementary filter are between plant and law.

use component::messages::AttitudeEstimate;
use controllers::airframe::ControlledVehicle;
use controllers::control::{HoverMotion, Integrals};
use controllers::pid::PidLaw;
use controllers::pid_gains::PidGains;
use controllers::set_points::{Schedule, SetPoint, SetPointEntry};
use nalgebra::Vector3;
use plant::{NewtonEuler, RigidBody, State};
use sensors::complementary::{Complementary, ComplementaryParams};
use sensors::imu_model::{ImuModel, ImuParams, ImuReading};
use vehicles::{MotorModel, Vehicle};

const PERIOD_S: f64 = 1e-3;

const SCENARIO: &str = r#"
    [[set_points]]
    kind = "step"
    channel = "altitude"
    at_s = 2.0
    to = 1.5
    unit = "m"
    [[set_points]]
    kind = "doublet"
    channel = "roll"
    at_s = 6.0
    amplitude = 10.0
    duration_s = 1.0
    unit = "deg"
"#;
const END_TICK: u64 = 12_000;

#[derive(serde::Deserialize)]
struct Scenario {
    set_points: Vec<SetPointEntry>,
}

/// The truth at every tick.
#[derive(Default)]
struct Flight {
    altitudes_m: Vec<f64>,
    rolls_deg: Vec<f64>,
    pitches_deg: Vec<f64>,
    yaws_deg: Vec<f64>,
}

/// Settings in which flights differ.
#[derive(Clone, Copy, Default)]
struct Setup {
    gains: PidGains,
    filter: ComplementaryParams,
    imu: ImuParams,
    seed: u64,
}

fn vehicle() -> Vehicle {
    Vehicle::parse(vehicles::reference::HUMMINGBIRD, "hummingbird.toml").unwrap()
}

fn schedule() -> Schedule {
    let scenario: Scenario = toml::from_str(SCENARIO).unwrap();
    let initial = SetPoint { altitude_m: 1.0, ..SetPoint::default() };
    Schedule::new(&scenario.set_points, &initial, 1000).unwrap()
}

fn imu_truth(plant: &NewtonEuler, state: &State) -> ImuReading {
    ImuReading {
        specific_force_B_m_s2: plant.accelerations(state).specific_force_B_m_s2,
        angular_velocity_B_rad_s: state.body.angular_velocity_B_rad_s,
    }
}

fn measurement(body: &RigidBody, estimate: &AttitudeEstimate) -> HoverMotion {
    HoverMotion {
        altitude_m: body.position_W_m.z,
        climb_rate_m_s: body.velocity_W_m_s.z,
        roll_rad: estimate.roll,
        pitch_rad: estimate.pitch,
        yaw_rad: estimate.yaw,
        angular_velocity_B_rad_s: <[f64; 3]>::from(estimate.angular_velocity).into(),
    }
}

/// Flies `flown` with a law that believes in the Hummingbird's file. Order at tick k: state k, IMU k,
/// estimate k, law k, and its command acts until k+1.
fn fly(flown: Vehicle, setup: &Setup) -> Flight {
    let (believed, schedule) = (vehicle(), schedule());
    let believed = ControlledVehicle::new(believed).unwrap();
    let law = PidLaw { gains: setup.gains, vehicle: believed.hover_model(), period_s: PERIOD_S };
    let imu = ImuModel::new(setup.imu, 1.0 / PERIOD_S).unwrap();
    let filter = Complementary::with_period(setup.filter, PERIOD_S).unwrap();
    let plant = NewtonEuler::new(flown, 1);

    let mut state = plant.start(RigidBody::level_at(Vector3::z()), plant.vehicle().hover_command());
    let (mut imu_state, mut filter_state) = (imu.initial_state(setup.seed, "imu"), Default::default());
    let mut law_state = Integrals::default();
    let mut flight = Flight::default();
    for tick in 0..END_TICK {
        flight.log(&state.body);
        let reading = imu.read(&mut imu_state, &imu_truth(&plant, &state));
        let estimate = filter.update(&mut filter_state, &reading);
        let wrench = law.wrench(&mut law_state, &schedule.at(tick), &measurement(&state.body, &estimate));
        let speeds_rad_s = believed.allocation.allocate(&wrench).speeds_rad_s;
        plant.step(&mut state, &speeds_rad_s.map(|speed| believed.vehicle.command.command(speed)), PERIOD_S);
    }
    flight
}

impl Flight {
    fn log(&mut self, body: &RigidBody) {
        let (roll_rad, pitch_rad, yaw_rad) = body.attitude_WB.euler_angles();
        self.altitudes_m.push(body.position_W_m.z);
        self.rolls_deg.push(roll_rad.to_degrees());
        self.pitches_deg.push(pitch_rad.to_degrees());
        self.yaws_deg.push(yaw_rad.to_degrees());
    }

    fn roll_max_deg(&self, ticks: std::ops::Range<usize>) -> f64 {
        self.rolls_deg[ticks].iter().copied().fold(f64::NEG_INFINITY, f64::max)
    }

    fn roll_min_deg(&self, ticks: std::ops::Range<usize>) -> f64 {
        self.rolls_deg[ticks].iter().copied().fold(f64::INFINITY, f64::min)
    }
}

/// The greatest size among `values`.
fn peak(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |peak, value| value.abs().max(peak))
}

fn altitude_error_m(flight: &Flight, ticks: std::ops::Range<usize>) -> f64 {
    flight.altitudes_m[ticks].iter().fold(0.0, |peak, altitude_m| (altitude_m - 1.5).abs().max(peak))
}

/// The figures of a flight, shown by `cargo test -- --nocapture`.
fn report(name: &str, flight: &Flight) {
    println!(
        "{name}: altitude error {:.4} m from 5 s, {:.4} m in the doublet, overshoot {:.4} m; roll {:.2}, {:.2}, \
         {:.2} deg in the pulses and after, {:.2} from 9 s; pitch {:.2}, yaw {:.2} deg",
        altitude_error_m(flight, 5000..6000),
        altitude_error_m(flight, 6000..12_000),
        flight.altitudes_m.iter().copied().fold(0.0, f64::max) - 1.5,
        flight.roll_max_deg(6000..7000),
        flight.roll_min_deg(7000..8000),
        flight.roll_max_deg(8000..12_000),
        peak(&flight.rolls_deg[9000..]),
        peak(&flight.pitches_deg),
        peak(&flight.yaws_deg),
    );
}

/// The scenario's bounds. The altitude is within 2 % 3 s after the step. Roll reaches 10° (at least 9°) with
/// less than 25 % of overshoot, and is within 1° one second after the doublet.
#[track_caller]
fn assert_flown(name: &str, flight: &Flight) {
    report(name, flight);
    assert!(altitude_error_m(flight, 5000..12_000) < 0.02 * 1.5, "{name}: altitude 3 s after the step");
    assert!((9.0..12.5).contains(&flight.roll_max_deg(6000..7000)), "{name}: first pulse");
    assert!((-12.5..-9.0).contains(&flight.roll_min_deg(7000..8000)), "{name}: second pulse");
    assert!(peak(&flight.rolls_deg[9000..]) < 1.0, "{name}: roll 1 s after the doublet");
}

#[test]
fn the_scenario_is_flown_within_its_bounds_whatever_the_seed() {
    for seed in 0..10 {
        let flight = fly(vehicle(), &Setup { seed, ..Setup::default() });
        assert_flown(&format!("seed {seed}"), &flight);
        assert!(flight.roll_max_deg(8000..12_000) < 2.5, "overshoot of the return to level");
        assert!(peak(&flight.pitches_deg) < 1.0 && peak(&flight.yaws_deg) < 1.0, "the axes at rest");
    }
}

/// The margin: the law believes in the file while the vehicle flown is another.
#[test]
fn the_scenario_is_flown_by_vehicles_that_differ_from_their_file() {
    let heavier = Vehicle { mass_kg: 1.05 * vehicle().mass_kg, ..vehicle() };
    let larger = Vehicle { inertia_kg_m2: 1.15 * vehicle().inertia_kg_m2, ..vehicle() };
    let smaller = Vehicle { inertia_kg_m2: 0.85 * vehicle().inertia_kg_m2, ..vehicle() };
    let motor = MotorModel::SecondOrder { natural_frequency_rad_s: 0.9 * 15.08, damping_ratio: 0.603 };
    let slower = Vehicle { motor, ..vehicle() };
    let weaker = Vehicle { thrust_coefficient: 0.95 * vehicle().thrust_coefficient, ..vehicle() };
    let variants = [
        ("heavier", heavier),
        ("larger", larger),
        ("smaller", smaller),
        ("slower", slower),
        ("weaker", weaker),
    ];
    for (name, flown) in variants {
        assert_flown(name, &fly(flown, &Setup::default()));
    }
}

/// Reason for our own gains: those of the thesis overshoot a reversal by more than a quarter of it.
#[test]
fn the_gains_of_the_thesis_overshoot_the_doublet() {
    let flight = fly(vehicle(), &Setup { gains: PidGains::thesis(), ..Setup::default() });
    report("thesis's gains", &flight);
    assert!(flight.roll_min_deg(7000..8000) < -12.5);
}

/// Reason for our own time constant: with the thesis's weight at 1 kHz the roll is not felt and runs away.
#[test]
fn the_filter_of_the_thesis_loses_the_doublet() {
    let filter = ComplementaryParams { time_constant_s: 0.049, ..ComplementaryParams::default() };
    let flight = fly(vehicle(), &Setup { filter, ..Setup::default() });
    report("thesis's filter", &flight);
    assert!(flight.roll_max_deg(6000..7000) > 12.5);
}

#[test]
fn a_flight_is_a_function_of_its_seed() {
    let rolls = |seed| fly(vehicle(), &Setup { seed, ..Setup::default() }).rolls_deg;
    assert_eq!(rolls(1), rolls(1));
    assert_ne!(rolls(1), rolls(2));
}
