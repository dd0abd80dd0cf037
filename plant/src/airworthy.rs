//! Checks of a vehicle before a run: `check` refuses a vehicle that cannot fly, and reports odd values.

use crate::backend::Backend;
use crate::newton_euler::NewtonEuler;
use crate::state::{PerRotor, RigidBody, State};
use component::context::NodeContext;
use diagnostics::digits;
use diagnostics::parameter::{ParameterError, refuse};
use diagnostics::unit::MASS;
use vehicles::{CommandMap, MotorModel, Provenance, Vehicle};

/// Below this thrust to weight a vehicle hovers and has next to nothing left to climb, tilt or brake with: at
/// 1.2 a tilt of 34° is possible. Tuned, no source; multirotors are built with 2 and more.
const LIFT_ODD: f64 = 1.2;

/// From here on a thrust to weight on Earth is odd, and from there on none: racing quadrotors reach 15. Tuned, no source.
const LIFT_HIGH: f64 = 50.0;
const LIFT_MAX: f64 = 1000.0;
/// Standard gravity, m/s² (ISO 80000-3): rotors are as strong as they are wherever they fly.
const GRAVITY_M_S2: f64 = 9.806_65;

/// The classic Runge-Kutta method of fourth order diverges if a pole times the step leaves a region. This reaches to
/// 2.785 on the real axis and 2.828 on the imaginary one (Hairer and Wanner, Solving Ordinary Differential Equations II,
/// 1996, section IV.2); the circle of 2.5 about 0 lies within it on the left.
pub(crate) const POLE_STEPS_MAX: f64 = 2.5;
/// A step as long as half a time constant errs by 0.02 % of the motion. Tuned, no source.
const POLE_STEPS_ODD: f64 = 0.5;

/// Steps of a rehearsal, less where a tick has many.
const REHEARSAL_STEPS: u32 = 300;

/// Refuses steps of `span_s` in which the motors' lag cannot be integrated, and warns of coarse ones.
///
/// # Errors
/// The lag, the step, and advice.
pub(crate) fn check_steps(
    vehicle: &Vehicle,
    span_s: f64,
    run: &NodeContext<'_>,
) -> Result<(), ParameterError> {
    let product = fastest_pole_rad_s(&vehicle.motor) * span_s;
    let message = |limit: f64, beyond: &str| {
        format!(
            "`vehicle` \"{}\" has motors whose fastest pole, {:.4} rad/s, times a step of {} s is {product:.4}, \
             expected below {limit}; raise `substeps` or run.rate_hz, or correct `[motor]` of the file: beyond it the \
             {beyond}",
            vehicle.name,
            product / span_s,
            digits(span_s)
        )
    };
    refuse(product > POLE_STEPS_MAX, "vehicle", || message(POLE_STEPS_MAX, "integration diverges"))?;
    if product > POLE_STEPS_ODD {
        run.warn("vehicle", message(POLE_STEPS_ODD, "motion is coarse"));
    }
    Ok(())
}

/// Warns of the numbers of the vehicle that have no source.
pub(crate) fn tell_unsourced(vehicle: &Vehicle, run: &NodeContext<'_>) {
    let unsourced: Vec<_> = vehicle.provenance.iter().filter(|number| !number.has_source()).collect();
    if !unsourced.is_empty() {
        let (count, all) = (unsourced.len(), vehicle.provenance.len());
        let message = format!("has no source for {count} of {all} numbers: {}", places(&unsourced));
        run.warn("vehicle", format!("`vehicle` \"{}\" {message}", vehicle.name));
    }
}

/// Refuses rotors with more inertia than the vehicle that they are part of: the moments of a vehicle file include them, at
/// rest.
///
/// # Errors
/// Both moments, and the keys that they come from.
pub(crate) fn check_rotor_inertia(vehicle: &Vehicle) -> Result<(), ParameterError> {
    let (count, whole_kg_m2) = (vehicle.rotors.len() as f64, vehicle.inertia_kg_m2[(2, 2)]);
    let rotors_kg_m2 = count * vehicle.rotor_inertia_kg_m2;
    refuse(rotors_kg_m2 > whole_kg_m2, "vehicle", || {
        let stated = vehicle.provenance.iter();
        let stated =
            stated.filter(|number| ["body.inertia_zz", "rotor.inertia"].contains(&number.key.as_str()));
        format!(
            "`vehicle` \"{}\" has {count} rotors of {:e} kg*m^2, expected at most {:e}: together they cannot have more than \
             the whole vehicle about its vertical axis, {whole_kg_m2:e}, which includes them; look at {}",
            vehicle.name,
            vehicle.rotor_inertia_kg_m2,
            whole_kg_m2 / count,
            places(&stated.collect::<Vec<_>>())
        )
    })
}

fn fastest_pole_rad_s(motor: &MotorModel) -> f64 {
    match *motor {
        MotorModel::FirstOrder { time_constant_s } => time_constant_s.recip(),
        MotorModel::SecondOrder { natural_frequency_rad_s, damping_ratio } => {
            let beyond = (damping_ratio * damping_ratio - 1.0).max(0.0).sqrt();
            natural_frequency_rad_s * (damping_ratio.max(1.0) + beyond)
        }
    }
}

/// Refuses a vehicle that its rotors cannot carry, or cannot let down.
///
/// # Errors
/// Both forces, and the keys that they come from.
pub(crate) fn check_lift(vehicle: &Vehicle, run: &NodeContext<'_>) -> Result<(), ParameterError> {
    let map = &vehicle.command;
    let (least_N, most_N) = (lift_N(vehicle, least_rad_s(map)), lift_N(vehicle, map.speed_at_max_rad_s));
    let weight_N = vehicle.mass_kg * vehicle.gravity_m_s2;
    if weight_N == 0.0 {
        return Ok(());
    }
    let ratio = most_N / weight_N;
    let on_earth = most_N / (vehicle.mass_kg * GRAVITY_M_S2);
    let message = |what: String| {
        format!(
            "`vehicle` \"{}\" {what}: its rotors lift {} N to {} N and it weighs {} N{}, a thrust to weight of {}; look at {}",
            vehicle.name,
            digits(least_N),
            digits(most_N),
            digits(weight_N),
            mass_of_file(vehicle),
            digits(ratio),
            places_of_lift(vehicle)
        )
    };
    refuse(ratio < 1.0, "vehicle", || {
        message("cannot fly, expected a thrust to weight of 1 or more".into())
    })?;
    refuse(on_earth > LIFT_MAX, "vehicle", || {
        message(format!("is no vehicle that flies, expected a thrust to weight on Earth below {LIFT_MAX}"))
    })?;
    refuse(least_N > weight_N, "command.speed_at_min", || {
        message("cannot come down, expected less lift than weight at `command.speed_at_min`".into())
    })?;
    if ratio < LIFT_ODD {
        let odd = format!("can hardly climb or tilt, below a thrust to weight of {LIFT_ODD}");
        run.warn("vehicle", message(odd));
    } else if on_earth > LIFT_HIGH {
        let odd =
            format!("is stronger than any that flies, above a thrust to weight on Earth of {LIFT_HIGH}");
        run.warn("vehicle", message(odd));
    }
    Ok(())
}

/// A motor that a command of 0 switches off turns as slowly as one likes.
fn least_rad_s(map: &CommandMap) -> f64 {
    if map.zero_is_off { 0.0 } else { map.speed_at_min_rad_s }
}

fn lift_N(vehicle: &Vehicle, speed_rad_s: f64) -> f64 {
    let upwards: f64 = vehicle.working_rotors().map(|rotor| rotor.axis.z).sum();
    upwards * vehicle.thrust_coefficient * speed_rad_s * speed_rad_s
}

/// The mass as the file has it, in words; empty for a vehicle that is not of a file.
fn mass_of_file(vehicle: &Vehicle) -> String {
    let stated = vehicle.provenance.iter().rev().find(|number| number.key == "body.mass");
    let in_its_unit = |number: &Provenance| {
        let factor = MASS.factor(&number.unit)?;
        Some(format!(" with {} {}, the unit of the file", digits(vehicle.mass_kg / factor), number.unit))
    };
    stated.and_then(in_its_unit).unwrap_or_default()
}

/// The keys that lift and weight come from, with their lines.
fn places_of_lift(vehicle: &Vehicle) -> String {
    let keys = ["body.mass", "body.gravity", "rotor.thrust_coefficient", "command.speed_at_max"];
    let stated = vehicle.provenance.iter().filter(|number| keys.contains(&number.key.as_str()));
    places(&stated.collect::<Vec<_>>())
}

/// The lines of the files in which these numbers are.
pub(crate) fn places(numbers: &[&Provenance]) -> String {
    let place = |number: &&Provenance| format!("{}:{}: `{}`", number.file, number.line, number.key);
    numbers.iter().map(place).collect::<Vec<_>>().join(", ")
}

/// Flies `backend` for a moment with rotors at their fastest, at hover and at their slowest: a quantity that
/// overflows does so here, and not in flight. The backend is of no use afterwards.
///
/// # Errors
/// The quantity that is not a finite number, and the ticks after which.
pub(crate) fn rehearse(
    backend: &mut dyn Backend,
    model: &NewtonEuler,
    dt_s: f64,
) -> Result<(), ParameterError> {
    let (vehicle, ticks) = (model.vehicle(), (REHEARSAL_STEPS / model.substeps()).max(3));
    let (map, mut flown) = (&vehicle.command, 0);
    for command in [vehicle.hover_command(), map.max, map.min] {
        let commands = PerRotor::filled(vehicle.rotors.len(), command);
        backend.settle_rotors(&commands);
        for _ in 0..ticks {
            backend.step(&commands, dt_s, &[]);
            flown += 1;
            let odd = first_not_finite(backend);
            refuse(odd.is_some(), "vehicle", || {
                format!(
                    "`vehicle` \"{}\": its numbers lead to {} that is no number after {flown} ticks; no vehicle that \
                     flies has them together",
                    vehicle.name,
                    odd.unwrap_or_default()
                )
            })?;
        }
    }
    Ok(())
}

fn first_not_finite(backend: &dyn Backend) -> Option<&'static str> {
    let (State { body, rotors }, motion) = (backend.state(), backend.accelerations());
    let speeds_rad_s = rotors.map(|rotor| rotor.speed_rad_s);
    let found: [(&str, &[f64]); 7] = [
        ("a position", body.position_W_m.as_slice()),
        ("a velocity", body.velocity_W_m_s.as_slice()),
        ("an angular velocity", body.angular_velocity_B_rad_s.as_slice()),
        ("a specific force", motion.specific_force_B_m_s2.as_slice()),
        ("an angular acceleration", motion.angular_acceleration_B_rad_s2.as_slice()),
        ("an attitude", body.attitude_WB.coords.as_slice()),
        ("a rotor speed", &speeds_rad_s),
    ];
    if !backend.bodies().iter().all(RigidBody::is_finite) {
        return Some("the motion of a free body");
    }
    let mut found = found.into_iter();
    found.find_map(|(what, numbers)| numbers.iter().any(|number| !number.is_finite()).then_some(what))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Airframe, FreeFlight, NewtonEuler};
    use component::context::Warning;
    use nalgebra::Vector3;

    const PATH: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../vehicles/hummingbird.toml");

    fn hummingbird(change: impl Fn(&mut Vehicle)) -> Vehicle {
        let mut vehicle = Vehicle::load(PATH.as_ref()).unwrap();
        change(&mut vehicle);
        vehicle
    }

    fn lift(change: impl Fn(&mut Vehicle)) -> (Result<(), ParameterError>, Vec<Warning>) {
        let run = NodeContext::new("node", &[]);
        let outcome = check_lift(&hummingbird(change), &run);
        (outcome, run.into_warnings())
    }

    #[test]
    fn lift_and_weight_decide_what_flies() {
        assert_eq!(lift(|_| {}), (Ok(()), vec![]));
        assert_eq!(lift(|it| it.gravity_m_s2 = 0.0), (Ok(()), vec![]));
        // On an asteroid the rotors are as strong as on Earth.
        let off = |it: &mut Vehicle| it.command.speed_at_min_rad_s = 0.0;
        assert_eq!(lift(|it| (off(it), it.gravity_m_s2 = 0.005).1), (Ok(()), vec![]));
        let message = lift(|it| it.mass_kg = 480.0).0.unwrap_err().to_string();
        assert!(
            message.contains("thrust to weight of 0.0047") && message.contains("weighs 4708.8 N"),
            "{message}"
        );
        assert!(message.contains("hummingbird.toml:21: `body.mass`"), "{message}");
        // 4.785 as declared.
        let (outcome, warnings) = lift(|it| it.mass_kg *= 4.5);
        assert!(outcome.is_ok() && warnings[0].message.contains("can hardly climb"), "{warnings:?}");
        let (outcome, warnings) = lift(|it| it.mass_kg /= 20.0);
        assert!(outcome.is_err() && warnings.is_empty(), "at 1075 rpm it still rises");
        let message = outcome.unwrap_err().to_string();
        assert!(message.contains("cannot come down"), "{message}");
        let slow = |it: &mut Vehicle| it.command.speed_at_min_rad_s = 0.0;
        let strong = |factor: f64| lift(|it| (slow(it), it.mass_kg /= factor).1);
        assert!(strong(20.0).1[0].message.contains("stronger than any"));
        assert!(strong(1e4).0.unwrap_err().to_string().contains("no vehicle that flies"));
    }

    #[test]
    fn rotors_are_part_of_the_vehicle() {
        let checked = |inertia: f64| check_rotor_inertia(&hummingbird(|it| it.rotor_inertia_kg_m2 = inertia));
        assert_eq!(checked(3.1e-5), Ok(()));
        assert_eq!(checked(2.0e-3), Ok(()));
        let message = checked(10.0).unwrap_err().to_string();
        assert!(message.contains("has 4 rotors of 1e1 kg*m^2, expected at most 2.025e-3"), "{message}");
        assert!(message.contains("`body.inertia_zz`") && message.contains("`rotor.inertia`"), "{message}");
    }

    #[test]
    fn numbers_without_a_source_are_told_with_their_lines() {
        let told = |text: &str| {
            let run = NodeContext::new("node", &[]);
            tell_unsourced(&Vehicle::parse(text, "bird.toml").unwrap(), &run);
            run.into_warnings().into_iter().map(|warning| warning.message).collect::<Vec<_>>()
        };
        let text = vehicles::reference::HUMMINGBIRD;
        assert_eq!(told(text), [""; 0]);
        let mass = text.lines().find(|line| line.starts_with("mass = ")).unwrap();
        let messages = told(&text.replace(mass, r#"mass = { value = 0.5, unit = "kg", source = "none" }"#));
        let [message] = &messages[..] else { panic!("{messages:?}") };
        assert!(
            message.contains("no source for 1 of ") && message.contains("bird.toml:21: `body.mass`"),
            "{message}"
        );
    }

    #[test]
    fn motors_that_a_step_cannot_follow_are_refused_with_both() {
        let steps = |span_s: f64| {
            let run = NodeContext::new("node", &[]);
            let outcome = check_steps(&hummingbird(|_| {}), span_s, &run);
            (outcome, run.into_warnings())
        };
        assert_eq!(steps(1e-3), (Ok(()), vec![]));
        assert!(steps(0.1).1[0].message.contains("raise `substeps`"));
        let message = steps(0.2).0.unwrap_err().to_string();
        assert!(message.contains("15.0756 rad/s") && message.contains("expected below 2.5"), "{message}");
    }

    #[test]
    fn the_bound_on_steps_is_where_the_integration_leaves_its_target() {
        let swing = |span_s: f64| {
            let model = NewtonEuler::new(hummingbird(|_| {}), 1);
            let mut state = model.start(RigidBody::level_at(Vector3::z()), 76.0);
            (0..2000).for_each(|_| model.step(&mut state, &[80.0; 4], span_s));
            (state.rotors[0].speed_rad_s / model.steady(80.0).speed_rad_s - 1.0).abs()
        };
        let pole_rad_s = 15.075_567_228_888_18;
        assert!(swing(POLE_STEPS_MAX / pole_rad_s) < 1e-3);
        assert!(swing(3.5 / pole_rad_s).is_nan() || swing(3.5 / pole_rad_s) > 1e3);
    }

    #[test]
    fn a_vehicle_of_any_number_of_rotors_is_rehearsed_with_all_of_them() {
        for count in [1, 3, 6, 8, 12] {
            let vehicle = hummingbird(|it| it.rotors = vec![it.rotors[0].clone(); count]);
            let airframe = Airframe::new(vehicle);
            let effects = airframe.initial_state(0, "", 1e-3);
            let model = NewtonEuler::flying(airframe, 1);
            let mut backend = FreeFlight::new(model.clone(), RigidBody::level_at(Vector3::z()), effects);
            assert_eq!(rehearse(&mut backend, &model, 1e-3), Ok(()));
            assert_eq!(backend.state().rotors.len(), count);
        }
    }

    #[test]
    fn numbers_that_overflow_together_are_found_on_the_ground() {
        let rehearsed = |change: fn(&mut Vehicle)| {
            let airframe = Airframe::new(hummingbird(change));
            let effects = airframe.initial_state(0, "", 1e-3);
            let model = NewtonEuler::flying(airframe, 1);
            let mut backend = FreeFlight::new(model.clone(), RigidBody::level_at(Vector3::z()), effects);
            rehearse(&mut backend, &model, 1e-3)
        };
        assert_eq!(rehearsed(|_| {}), Ok(()));
        let message = rehearsed(|it| it.thrust_coefficient = 1e306).unwrap_err().to_string();
        assert!(message.contains("that is no number after"), "{message}");
    }
}
