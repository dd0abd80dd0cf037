//! Properties of a model that its vehicle file does not show, or that are unlikely.

use super::model::{Freedom, Motor};
use super::parts::{GRAVITY_M_S2, Parts};
use super::rotors::Rotor;
use super::text::{digits, plain};
use std::collections::BTreeSet;

/// Notes on a model whose rotors have the coefficient `thrust` in N/(rad/s)^2 and turn at most at `speed_max` in rad/s.
pub fn of(parts: &Parts, thrust: f64, speed_max: f64) -> Vec<String> {
    let mut notes = parts.model.notes.clone();
    notes.extend(movable(parts));
    notes.extend(bodiless(parts));
    notes.extend(lags(&parts.rotors));
    notes.extend(directions(&parts.rotors));
    let weight = parts.body.mass_kg * GRAVITY_M_S2;
    let count = parts.rotors.len();
    let most = count as f64 * thrust * speed_max * speed_max;
    if most <= weight {
        notes.push(format!(
            "the rotors push with at most {most:.3} N, the vehicle weighs {weight:.3} N: it cannot take off"
        ));
    }
    if count < 4 {
        notes.push(format!(
            "{count} rotors: controllers need four or more to choose thrust, roll, pitch and yaw independently"
        ));
    }
    notes
}

/// Share of the mass in the links of rotors above which the model probably lacks the mass of its body. Own choice:
/// propellers and the bells of motors are a tenth to a third of a multicopter.
const ROTOR_SHARE_MAX: f64 = 0.5;

/// A body that has next to no mass beside its rotors.
fn bodiless(parts: &Parts) -> Option<String> {
    let mass_of = |name: &str| {
        let link = parts.model.links.iter().find(|link| link.name == name)?;
        Some(link.inertial.as_ref()?.mass_kg)
    };
    let links: BTreeSet<&str> = parts.rotors.iter().map(|rotor| rotor.link.name.as_str()).collect();
    let rotors_kg: f64 = links.into_iter().filter_map(mass_of).sum();
    let all_kg = parts.body.mass_kg;
    (rotors_kg > ROTOR_SHARE_MAX * all_kg).then(|| {
        format!(
            "the links of the rotors have {rotors_kg:.4} kg of the vehicle's {all_kg:.4} kg: the body probably lacks its mass; \
             add <inertial> to its link"
        )
    })
}

/// Joints that move and carry no rotor.
fn movable(parts: &Parts) -> Vec<String> {
    let is_rotor = |name: &str| parts.rotors.iter().any(|rotor| rotor.joint.name == name);
    let joints = parts.model.joints.iter();
    let others = joints.filter(|joint| joint.freedom != Freedom::Fixed && !is_rotor(&joint.name));
    others
        .map(|joint| {
            let name = plain(&joint.name);
            format!(
                "joint {name} is movable but not a rotor; its link is treated as fixed at the joint's zero"
            )
        })
        .collect()
}

/// Motors that become faster at another rate than slower: a vehicle file has one lag.
fn lags(rotors: &[Rotor]) -> Option<String> {
    let two = |motor: &Motor| Some((motor.lag_up_s?, motor.lag_down_s?));
    let (up, down) = rotors.iter().filter_map(|rotor| two(rotor.motor?)).find(|(up, down)| up != down)?;
    let [up, down] = [up, down].map(|lag| digits(lag, lag));
    Some(format!(
        "timeConstantUp is {up} s and timeConstantDown {down} s; the vehicle file has one time constant: {up} s"
    ))
}

/// Directions with which thrusts cannot turn the vehicle about z, or not without tilting it.
fn directions(rotors: &[Rotor]) -> Option<String> {
    let mut ranked: Vec<(usize, f64)> =
        rotors.iter().filter_map(|rotor| Some((rotor.rank, rotor.motor?.spin?))).collect();
    ranked.sort_by_key(|(rank, _)| *rank);
    if ranked.iter().map(|(_, spin)| spin).sum::<f64>() != 0.0 {
        let count = ranked.iter().filter(|(_, spin)| *spin > 0.0).count();
        return Some(format!(
            "counter-clockwise rotors: {count}, clockwise rotors: {}; their drag turns the vehicle about z in hover",
            ranked.len() - count
        ));
    }
    // More rotors may have other pairs that turn the vehicle.
    let [first, _, third, _] = ranked[..] else { return None };
    (first.1 != third.1).then(|| {
        "rotors that are opposite to each other turn in different directions: the vehicle cannot turn about z without \
         tilting"
            .to_owned()
    })
}
