//! Flights of vehicles that a rig holds at a point: the bearing takes all forces, so that position, velocity and specific force
//! say nothing about the vehicle.

use flights::{Channel, Flight, FlightSet, Hold, hold};
use plant::effects::{Effect, Quantity};
use vehicles::Vehicle;

/// No rig lets a vehicle go further to the side.
const RIG_M: f64 = 0.3;

/// True if the vehicle accelerates as it leans, or moves further to the side than any rig allows.
pub fn moves_freely(flight: &Flight, gravity_m_s2: f64) -> bool {
    let positions = &flight.position.values;
    let is_wide = |axis: usize| {
        let of_axis = || positions.iter().map(|position| position[axis]);
        of_axis().fold(f64::MIN, f64::max) - of_axis().fold(f64::MAX, f64::min) > RIG_M
    };
    match hold(flight, gravity_m_s2) {
        Hold::Free => true,
        Hold::Held(_) => false,
        Hold::Unknown => is_wide(0) || is_wide(1),
    }
}

/// The flights of `set` without the translation of those that a rig holds, which are marked as held; `None` if nothing changes. Where a flight
/// itself does not show if it is held, `declared` effects of a rig do.
pub fn without_translation(set: &FlightSet, vehicle: &Vehicle, declared: &[Effect]) -> Option<FlightSet> {
    let is_declared = declared.iter().any(|effect| effect.kind.needs.contains(&Quantity::Rig));
    let reason = |flight: &Flight| match hold(flight, vehicle.gravity_m_s2) {
        Hold::Held(reason) => Some(reason),
        Hold::Unknown if is_declared => Some("the vehicle file declares effects of a rig".to_owned()),
        Hold::Free | Hold::Unknown => None,
    };
    let is_open = |flight: &Flight| flight.on_rig.is_none() || !translation(flight).is_empty();
    let held = |flight: &Flight| reason(flight).filter(|_| is_open(flight));
    let reasons: Vec<Option<String>> = set.flights.iter().map(held).collect();
    if reasons.iter().all(Option::is_none) {
        return None;
    }
    let mut left = set.clone();
    for (flight, reason) in left.flights.iter_mut().zip(reasons) {
        reason.into_iter().for_each(|reason| leave_out_translation(flight, &reason));
    }
    Some(left)
}

/// Names of the channels of the translation that a flight has.
fn translation(flight: &Flight) -> Vec<&'static str> {
    let channels = [
        ("position", &flight.position),
        ("velocity", &flight.velocity),
        ("specific_force", &flight.specific_force),
    ];
    channels.into_iter().filter(|(_, channel)| !channel.is_empty()).map(|(name, _)| name).collect()
}

fn leave_out_translation(flight: &mut Flight, reason: &str) {
    let names = translation(flight).join(", ");
    if !names.is_empty() {
        flight.notes.push(format!("{names}: left out, as a rig holds the vehicle: {reason}"));
    }
    flight.on_rig = Some(true);
    flight.position = Channel::default();
    flight.velocity = Channel::default();
    flight.specific_force = Channel::default();
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_flights::{flown, hummingbird};
    use plant::effects::find;

    /// A gyroscope alone does not show a rig, and there is nothing to leave out.
    #[test]
    fn a_declared_effect_of_a_rig_declares_the_rig() {
        let flight = flown([2.0, 0.01], |_| [0.0, 0.0, 2.0], |_| [0.0; 3]);
        let flight = Flight {
            position: Channel::default(),
            velocity: Channel::default(),
            attitude: Channel::default(),
            ..flight
        };
        let set = FlightSet {
            vehicle: "hummingbird.toml".into(),
            flights: vec![flight],
            next_flight: Default::default(),
            files: Default::default(),
        };
        assert!(without_translation(&set, &hummingbird(), &[]).is_none());
        let declared = [find("bearing-friction").expect("a known effect").neutral()];
        let marked = without_translation(&set, &hummingbird(), &declared).expect("a rig that is declared");
        assert_eq!(marked.flights[0].on_rig, Some(true));
        assert!(marked.flights[0].notes.is_empty(), "{:?}", marked.flights[0].notes);
    }
}
