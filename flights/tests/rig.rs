//! Signs in a flight of a rig that holds its vehicle.

use flights::{Channel, Flight, Hold, Role, hold};
use nalgebra::{UnitQuaternion, Vector3};

const GRAVITY_M_S2: f64 = 9.81;
const STEP_S: f64 = 0.005;

/// A vehicle that leans to and fro about `lean_rad` while it turns about the vertical. It has its free
/// acceleration and the accelerometer's readings in free flight.
struct Motion {
    attitudes: Vec<UnitQuaternion<f64>>,
    places: Vec<Vector3<f64>>,
    forces: Vec<Vector3<f64>>,
}

fn motion(size_rad: f64, lean_rad: f64) -> Motion {
    let (mut place, mut velocity) = (Vector3::new(0.0, 0.0, 2.0), Vector3::zeros());
    let mut motion = Motion { attitudes: Vec::new(), places: Vec::new(), forces: Vec::new() };
    for step in 0..6000 {
        let time_s = STEP_S * f64::from(step);
        let roll = size_rad * libm::sin(2.1 * time_s) + 0.5 * size_rad * libm::sin(5.3 * time_s);
        let pitch = size_rad * libm::sin(1.7 * time_s + 1.0) + 0.4 * size_rad * libm::cos(6.1 * time_s);
        let yaw = 0.4 * time_s;
        let steady = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), lean_rad);
        let attitude = steady * UnitQuaternion::from_euler_angles(roll, pitch, yaw);
        let thrust = GRAVITY_M_S2 / (attitude * Vector3::z()).z;
        // The wind carries what the steady lean asks for.
        let wind = Vector3::x() * (GRAVITY_M_S2 * libm::tan(lean_rad));
        let acceleration = attitude * Vector3::z() * thrust - GRAVITY_M_S2 * Vector3::z() - wind;
        velocity += acceleration * STEP_S;
        place += velocity * STEP_S;
        motion.attitudes.push(attitude);
        motion.places.push(place);
        motion.forces.push(attitude.inverse() * (acceleration + GRAVITY_M_S2 * Vector3::z()));
    }
    motion
}

fn channel<T, const N: usize>(of: &[T], value: impl Fn(&T) -> [f64; N]) -> Channel<N> {
    let time_s = (0..of.len()).map(|step| STEP_S * step as f64).collect();
    Channel { time_s, values: of.iter().map(value).collect() }
}

fn turning(motion: &Motion) -> Flight {
    let mut flight = Flight::new("", "", Role::Fit);
    flight.attitude = channel(&motion.attitudes, |q| [q.w, q.i, q.j, q.k]);
    flight
}

fn found(flight: &Flight) -> Hold {
    hold(flight, GRAVITY_M_S2)
}

fn is_held(flight: &Flight) -> bool {
    matches!(found(flight), Hold::Held(_))
}

#[test]
fn a_point_of_a_held_vehicle_stays_or_turns_with_it() {
    let motion = motion(0.1, 0.0);
    let mut flight = turning(&motion);
    for lever_m in [0.0, 0.05, -0.05, 0.15, -0.15] {
        let lever = Vector3::new(0.02, 0.0, lever_m);
        flight.position = channel(&motion.attitudes, |q| (Vector3::new(1.0, 2.0, 1.0) + q * lever).into());
        assert!(is_held(&flight), "{lever_m}: {:?}", found(&flight));
    }
    flight.position = Channel::default();
    flight.velocity = channel(&motion.attitudes, |_| [0.001, 0.0, 0.0]);
    assert!(is_held(&flight), "{:?}", found(&flight));
}

#[test]
fn a_free_vehicle_accelerates_as_it_leans() {
    let motion = motion(0.1, 0.0);
    let mut flight = turning(&motion);
    flight.position = channel(&motion.places, |place| (*place).into());
    assert_eq!(found(&flight), Hold::Free);
    // A position in another unit is no held vehicle.
    for unit in [1e-3, 1e-2] {
        flight.position = channel(&motion.places, |place| (place * unit).into());
        assert_eq!(found(&flight), Hold::Unknown, "{unit}");
    }
}

#[test]
fn a_bearing_bears_the_gravity_that_the_accelerometer_reads() {
    let motion = motion(0.1, 0.0);
    let mut flight = turning(&motion);
    flight.specific_force =
        channel(&motion.attitudes, |q| (q.inverse() * Vector3::z() * GRAVITY_M_S2).into());
    assert!(is_held(&flight), "{:?}", found(&flight));
    flight.specific_force = channel(&motion.forces, |force| (*force).into());
    assert_eq!(found(&flight), Hold::Free);
    // A position that froze in free flight is a fault, no rig.
    flight.position = channel(&motion.places, |_| [1.0, 2.0, 1.5]);
    assert_eq!(found(&flight), Hold::Free);
}

/// In a steady wind a vehicle leans and stays, and its accelerometer reads gravity: a small motion then shows nothing.
#[test]
fn a_vehicle_that_hovers_in_a_wind_is_not_held() {
    let motion = motion(0.01, 0.15);
    let mut flight = turning(&motion);
    flight.specific_force = channel(&motion.forces, |force| (*force).into());
    assert_eq!(found(&flight), Hold::Unknown);
    flight.position = channel(&motion.places, |place| (*place).into());
    assert_eq!(found(&flight), Hold::Unknown);
}

#[test]
fn a_declaration_counts_before_the_channels_and_an_assumed_attitude_shows_nothing() {
    let motion = motion(0.1, 0.0);
    let mut flight = turning(&motion);
    flight.position = channel(&motion.places, |place| (*place).into());
    flight.on_rig = Some(true);
    assert!(is_held(&flight));
    flight.position = channel(&motion.places, |_| [1.0, 2.0, 1.5]);
    flight.on_rig = Some(false);
    assert_eq!(found(&flight), Hold::Free);
    flight.on_rig = None;
    flight.assumed.push("attitude: level".to_owned());
    assert_eq!(found(&flight), Hold::Unknown);
    assert_eq!(found(&Flight::new("", "", Role::Fit)), Hold::Unknown);
}

/// Without an attitude the accelerometer shows free flight: it feels what the commands make. A bearing bears the weight.
#[test]
fn a_vehicle_whose_specific_force_follows_its_commands_flies() {
    let motion = motion(0.1, 0.0);
    let mut flight = Flight::new("", "", Role::Fit);
    let thrust =
        |step: usize| 1.0 + 0.15 * libm::sin(0.01 * step as f64) + 0.1 * libm::cos(0.023 * step as f64);
    let steps: Vec<usize> = (0..motion.forces.len()).collect();
    flight.command = channel(&steps, |step| {
        std::array::from_fn(|rotor| if rotor < 4 { 100.0 * thrust(*step) } else { 0.0 })
    });
    assert_eq!(found(&flight), Hold::Unknown);
    // Rotors follow their commands late.
    flight.specific_force =
        channel(&steps, |step| [0.3, -0.2, GRAVITY_M_S2 * thrust(step.saturating_sub(12))]);
    assert_eq!(found(&flight), Hold::Free);
    flight.specific_force = channel(&steps, |step| [0.3, 0.2 * libm::sin(0.3 * *step as f64), GRAVITY_M_S2]);
    assert_eq!(found(&flight), Hold::Unknown);
    // On a rig that turns about a point, what is felt follows the rates, not the total of the rotors.
    let turning = |step: usize| libm::sin(0.037 * step as f64).powi(2);
    flight.specific_force = channel(&steps, |step| [0.0, 0.0, GRAVITY_M_S2 + 2.0 * turning(*step)]);
    assert_eq!(found(&flight), Hold::Unknown);
}
