//! Multi-step prediction: of a flight whose model is true the errors are those of the sampling alone.
use crate::simulated;
use identify::accelerations::{Accelerations, accelerations};
use identify::steps_ahead::{Between, StepsAhead, errors};
use plant::Airframe;
use simulated::{Plan, effect, fly, vehicle_file};
use vehicles::Vehicle;

const POSITION: usize = 0;
const ATTITUDE: usize = 2;

/// A flight of 8 s, its motion sampled at 100 Hz and its rotor speeds at 1 kHz, without noise.
fn flight(has_rotor_speeds: bool) -> (Vehicle, flights::Flight) {
    let declared = Vehicle::load(&vehicle_file("hummingbird.toml")).unwrap();
    let mut plan = Plan { duration_s: 8.0, ..Plan::of(Vec::new(), 5_100) };
    plan.sensors.noise = 0.0;
    plan.sensors.pose_ticks = 10;
    plan.sensors.has_rotor_speeds = has_rotor_speeds;
    let flight = fly(&declared, &plan, flights::Role::Test);
    (declared, flight)
}

fn of(airframe: &Airframe, flight: &flights::Flight, between: Between) -> StepsAhead {
    errors(flight, airframe, 50, between).unwrap()
}

#[test]
fn the_true_model_predicts_half_a_second_and_persistence_does_not() {
    for has_rotor_speeds in [true, false] {
        let (vehicle, flight) = flight(has_rotor_speeds);
        let ahead = of(&Airframe::new(vehicle), &flight, Between::Lines);
        assert_eq!((ahead.model.len(), ahead.persistence.len()), (50, 50));
        assert!((ahead.period_s - 0.01).abs() < 1e-9, "{}", ahead.period_s);
        assert!(ahead.windows > 600, "{} windows, {} left out", ahead.windows, ahead.left_out);
        let (model, persistence) = (ahead.model[49], ahead.persistence[49]);
        // The velocity at a window's start is derived from the positions.
        assert!(model[POSITION] < 0.01 && model[ATTITUDE] < 0.1, "{has_rotor_speeds}: {model:?}");
        assert!(persistence[POSITION] > 0.2 && persistence[ATTITUDE] > 5.0, "{persistence:?}");
    }
}

#[test]
fn a_heavier_vehicle_than_the_model_sinks_away_by_half_of_the_missing_acceleration_times_time_squared() {
    let (vehicle, flight) = flight(true);
    let heavy = Airframe::with_effects(vehicle, vec![effect("mass-error", &[("error", 0.1)])]);
    let ahead = of(&heavy, &flight, Between::Lines);
    // A tenth more mass takes an eleventh of the specific force, which is about g.
    let expected_m = 0.5 * (9.81 / 11.0) * 0.25;
    let error_m = ahead.model[49][POSITION];
    assert!((error_m / expected_m - 1.0).abs() < 0.2, "{error_m} m, expected about {expected_m} m");
}

#[test]
fn rotors_held_between_their_samples_act_late() {
    let (vehicle, mut flight) = flight(true);
    let is_kept = |at: usize| at.is_multiple_of(10);
    let channel = std::mem::take(&mut flight.rotor_speed);
    for (at, (time_s, speeds)) in channel.time_s.iter().zip(&channel.values).enumerate() {
        if is_kept(at) {
            flight.rotor_speed.time_s.push(*time_s);
            flight.rotor_speed.values.push(*speeds);
        }
    }
    let airframe = Airframe::new(vehicle);
    let [lines, held] =
        [Between::Lines, Between::Held].map(|between| of(&airframe, &flight, between).model[49]);
    assert!(held[ATTITUDE] > 2.0 * lines[ATTITUDE], "held {held:?}, on lines {lines:?}");
}

#[test]
fn what_a_flight_lacks_is_said() {
    let (vehicle, flight) = flight(false);
    let airframe = Airframe::new(vehicle);
    let silent = flights::Flight { command: flights::Channel::default(), ..flight.clone() };
    let error = errors(&silent, &airframe, 50, Between::Lines).unwrap_err();
    assert_eq!(error, "it has neither rotor speeds nor commands");
    let error = errors(&flight, &airframe, 5_000, Between::Lines).unwrap_err();
    assert_eq!(error, "it has 800 samples, at least 5001 are needed");
}

#[test]
fn accelerations_of_the_true_model_are_those_that_were_measured() {
    let (vehicle, flight) = flight(true);
    let predicted = accelerations(&flight, &Airframe::new(vehicle.clone())).unwrap();
    assert_eq!(predicted.time_s.len(), predicted.specific_force_B_m_s2.len());
    let force = &flight.specific_force;
    let measured = |time_s: f64| {
        let next = force.time_s.partition_point(|other| *other < time_s).min(force.values.len() - 1);
        force.values[next]
    };
    // In the middle of the flight, where the derived velocity has samples on both sides.
    let middle = || (100..predicted.time_s.len() - 100).step_by(7);
    for at in middle() {
        for (axis, found) in predicted.specific_force_B_m_s2[at].iter().enumerate() {
            let wanted = measured(predicted.time_s[at])[axis];
            assert!(
                (found - wanted).abs() < 0.2,
                "{} s, axis {axis}: {found}, measured {wanted}",
                predicted.time_s[at]
            );
        }
    }
    let rates = &flight.angular_velocity;
    for at in middle() {
        let next = rates.time_s.partition_point(|other| *other < predicted.time_s[at]);
        let (before, behind) = (next - 3, next + 3);
        for (axis, found) in predicted.angular_acceleration_B_rad_s2[at].iter().enumerate() {
            let slope = (rates.values[behind][axis] - rates.values[before][axis])
                / (rates.time_s[behind] - rates.time_s[before]);
            assert!(
                (found - slope).abs() < 0.5,
                "{} s, axis {axis}: {found}, measured {slope}",
                predicted.time_s[at]
            );
        }
    }
    let heavy = Airframe::with_effects(vehicle, vec![effect("mass-error", &[("error", 0.1)])]);
    let of_heavy = accelerations(&flight, &heavy).unwrap();
    for at in middle() {
        let [light, heavy] = [&predicted, &of_heavy].map(|of| of.specific_force_B_m_s2[at][2]);
        assert!((heavy - light / 1.1).abs() < 1e-9, "{heavy} of {light}");
    }
}

/// Mean difference of the thrust over the mass in the middle of a flight, in m/s²; that of `late` is taken `by` samples later.
fn mean_apart(early: &Accelerations, late: &Accelerations, by: usize) -> f64 {
    let middle = || (100..early.time_s.len() - 100).step_by(7);
    let apart =
        |at: usize| (early.specific_force_B_m_s2[at][2] - late.specific_force_B_m_s2[at + by][2]).abs();
    middle().map(apart).sum::<f64>() / middle().count() as f64
}

#[test]
fn accelerations_without_rotor_speeds_follow_from_the_commands() {
    let (vehicle, flight) = flight(true);
    let commanded = flights::Flight { rotor_speed: flights::Channel::default(), ..flight.clone() };
    let airframe = Airframe::new(vehicle.clone());
    let [measured, followed] = [&flight, &commanded].map(|flight| accelerations(flight, &airframe).unwrap());
    assert_eq!(measured.time_s, followed.time_s);
    let apart = mean_apart(&measured, &followed, 0);
    assert!(apart < 0.01, "{apart} m/s^2");
    let delay = vec![effect("command-delay", &[("delay", 0.05)])];
    let delayed = accelerations(&commanded, &Airframe::with_effects(vehicle, delay)).unwrap();
    let (at_once, shifted) = (mean_apart(&followed, &delayed, 0), mean_apart(&followed, &delayed, 5));
    assert!(shifted < 0.1 * at_once, "{shifted} m/s^2 at 0.05 s later, {at_once} m/s^2 at the same time");
}

#[test]
fn accelerations_need_rotor_speeds_or_commands() {
    let (vehicle, flight) = flight(false);
    let silent = flights::Flight { command: flights::Channel::default(), ..flight };
    let error = accelerations(&silent, &Airframe::new(vehicle)).unwrap_err();
    assert_eq!(error, "it has neither rotor speeds nor commands");
}
