//! The candidates of a search: which parameters an effect brings, and whether flights can show it.

use crate::data::prepared::{Equation, Prepared};
use crate::model::flight_wind::FLIGHT_WIND;
use crate::model::parameter::Parameters;
use flights::Flight;
use plant::effects::{EffectKind, FitAs, Quantity, WIND};

/// Need of effects that show in torques, or in the time at which commands act.
pub const FAST_COMMANDS: &str =
    "motor commands, or rotor speeds, that are logged faster than the motors follow";

/// Need of effects that show in torques, where those are not compared.
const COMPARED_TORQUES: &str = "torques that are compared: flights without `torques = false`";

/// An effect, or the part of one that makes sense alone: one weak rotor, the bias of one sensor.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// The effect.
    pub kind: &'static EffectKind,
    /// The parameters that it frees.
    pub free: Vec<usize>,
}

impl Candidate {
    /// True if it resembles most trims: a torque that is the same at any thrust.
    pub fn is_trim(&self) -> bool {
        self.kind.steady_state && self.kind.turns_steadily
    }

    /// True if each of its parameters is one of `others`. The wind of all flights also counts as part of the winds of flights, which are level.
    pub fn is_in(&self, others: &[Candidate]) -> bool {
        let are_winds = |other: &Candidate| *self.kind == WIND && *other.kind == FLIGHT_WIND;
        others.iter().any(are_winds)
            || self.free.iter().all(|at| others.iter().any(|other| other.free.contains(at)))
    }

    /// The parameters of those `accepted` that stay beside it (see [`with`]), without its own.
    pub fn beside(&self, accepted: &[Candidate]) -> Vec<usize> {
        let stay = accepted.iter().filter(|other| !other.is_in(std::slice::from_ref(self)));
        let free = stay.flat_map(|other| other.free.iter().copied());
        free.filter(|at| !self.free.contains(at)).collect()
    }
}

/// The candidates `accepted` and `one`, which takes the place of those that have no other parameters than it.
pub fn with(accepted: &[Candidate], one: &Candidate) -> Vec<Candidate> {
    let others = accepted.iter().filter(|other| !other.is_in(std::slice::from_ref(one)));
    others.chain([one]).cloned().collect()
}

/// The parameters of candidates.
pub fn free_parameters(candidates: &[Candidate]) -> Vec<usize> {
    candidates.iter().flat_map(|candidate| candidate.free.clone()).collect()
}

/// An effect, or the part of one that belongs to one sensor, that these flights cannot show, and what they would need.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Unidentifiable {
    /// The effect.
    pub effect: &'static str,
    /// Quantity or condition that is missing.
    pub needs: &'static str,
}

/// The candidates that `flights` can show, and those that they cannot.
pub fn candidates(parameters: &Parameters, flights: &[&Prepared]) -> (Vec<Candidate>, Vec<Unidentifiable>) {
    let (mut seen, mut unidentifiable) = (Vec::new(), Vec::new());
    for kind in parameters.effects() {
        match missing(kind, flights) {
            Some(needs) => unidentifiable.push(Unidentifiable { effect: kind.name, needs }),
            None => seen.extend(parts(parameters, kind)),
        }
    }
    seen.extend(wind_of_each_flight(parameters));
    // Parts of an effect may lack the same.
    unidentifiable.dedup();
    (seen, unidentifiable)
}

/// The candidate of one level wind for each flight: the mean, and the deviations. `None` where no flight has a number.
pub fn wind_of_each_flight(parameters: &Parameters) -> Option<Candidate> {
    let deviations = parameters.of_name(FLIGHT_WIND.name);
    let is_known = !deviations.is_empty();
    let free = || [parameters.level_wind().to_vec(), deviations].concat();
    is_known.then(|| Candidate { kind: &FLIGHT_WIND, free: free() })
}

/// Returns the first requirement of an effect that `flights` do not meet; `None` if they meet all.
fn missing(kind: &EffectKind, flights: &[&Prepared]) -> Option<&'static str> {
    let is_slow = flights.iter().any(|flight| flight.slow_period_s.is_some());
    if is_slow && needs_fast_commands(kind) {
        return Some(FAST_COMMANDS);
    }
    let has_no_torques = flights.iter().all(|flight| flight.flight.without_torques);
    if has_no_torques && (kind.turns_steadily || kind.needs.contains(&Quantity::Torque)) {
        return Some(COMPARED_TORQUES);
    }
    // Only the means of forces and torques are true where the attitude was assumed.
    if !kind.steady_state && flights.iter().any(|flight| flight.is_assumed()) {
        return Some("attitude and angular velocity that were measured, not assumed");
    }
    let is_unmet = |need: &&Quantity| !flights.iter().any(|flight| has(flight, **need));
    kind.needs.iter().find(is_unmet).map(|need| need.describe())
}

/// True for effects that show in torques, or in the time at which commands act: commands that are logged slower than the
/// motors follow show neither.
fn needs_fast_commands(kind: &EffectKind) -> bool {
    kind.needs.contains(&Quantity::Torque) || kind.is_delay || kind.changes_drive || kind.turns_steadily
}

/// True if a flight shows a quantity.
pub fn has(prepared: &Prepared, quantity: Quantity) -> bool {
    let flight = &*prepared.flight;
    let allows = |equation| prepared.offset_of(equation).is_some();
    let has_attitude = !flight.attitude.is_empty();
    match quantity {
        Quantity::Force => allows(Equation::SpecificForce) || allows(Equation::Acceleration),
        Quantity::Torque => allows(Equation::AngularAcceleration),
        Quantity::Airspeed => has_attitude && !(flight.position.is_empty() && flight.velocity.is_empty()),
        Quantity::Height => !flight.position.is_empty(),
        Quantity::Attitude => has_attitude,
        Quantity::Command => !flight.command.is_empty(),
        Quantity::Rig => !prepared.moves_freely,
        Quantity::TwoClocks => allows(Equation::Gyroscope) || !flight.command.is_empty(),
        Quantity::SpecificForce => allows(Equation::SpecificForce),
        Quantity::TwoRotations => allows(Equation::Gyroscope),
        Quantity::TwoDirections => has_attitude && has(prepared, Quantity::Force),
        Quantity::InertialUnit => !flight.angular_velocity.is_empty() || !flight.specific_force.is_empty(),
        Quantity::RotorSpeed => !flight.rotor_speed.is_empty(),
        Quantity::KnownRig => {
            flight.on_rig == Some(true) || !flight.rotor_speed.is_empty() || may_show_rig(flight)
        }
        Quantity::Pose => has_attitude || !flight.position.is_empty(),
    }
}

/// True if the flight has a clock besides those of commands and inertial unit: an attitude, or rotor speeds beside the commands.
pub fn has_third_clock(prepared: &Prepared) -> bool {
    !prepared.flight.attitude.is_empty() || prepared.offset_of(prepared.rotor_speed()).is_some()
}

/// True if the attitude of a flight does not contradict a rig. The translation of a held vehicle was left out before (`rig`); where there is one,
/// it did not show a rig.
fn may_show_rig(flight: &Flight) -> bool {
    let has_translation =
        !flight.position.is_empty() || !flight.velocity.is_empty() || !flight.specific_force.is_empty();
    !flight.attitude.is_empty() && !has_translation
}

/// The whole effect, or its parts where a part makes sense alone.
fn parts(parameters: &Parameters, kind: &'static EffectKind) -> Vec<Candidate> {
    let free: Vec<usize> = (0..parameters.all.len()).filter(|at| parameters.all[*at].kind == kind).collect();
    match kind.fit_as {
        FitAs::Whole => vec![Candidate { kind, free }],
        FitAs::EachParameter => free.into_iter().map(|one| Candidate { kind, free: vec![one] }).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::prepared::{Propulsion, box_s};
    use crate::test_flights::{flown, hummingbird};
    use flights::Channel;
    use vehicles::ROTORS_MAX;

    /// A vehicle that stays in place, leans too little to show a rig, and logs all channels but the accelerometer.
    fn all_channels() -> Flight {
        let flight = flown([5.0, 0.01], |_| [0.0, 0.0, 2.0], |t| [0.01 * libm::sin(3.0 * t), 0.0, 0.0]);
        let mut commands = [0.0; ROTORS_MAX];
        commands[..4].fill(hummingbird().hover_command());
        let time_s = flight.rotor_speed.time_s.clone();
        Flight { command: Channel { values: vec![commands; time_s.len()], time_s }, ..flight }
    }

    /// The same with gyroscope and commands alone.
    fn gyroscope_and_commands() -> Flight {
        let mut flight = all_channels();
        (flight.position, flight.velocity) = (Channel::default(), Channel::default());
        (flight.attitude, flight.rotor_speed) = (Channel::default(), Channel::default());
        flight
    }

    fn prepared(flight: &Flight) -> Prepared<'_> {
        let propulsion = Propulsion::of(&hummingbird());
        Prepared::new(flight, box_s(flight), &propulsion).expect("a usable flight")
    }

    /// Requirements of the parts of an effect that a flight does not meet.
    fn needs(effect: &str, flight: &Flight) -> Vec<&'static str> {
        let parameters = Parameters::of(&hummingbird(), &[]);
        let (_, unidentifiable) = candidates(&parameters, &[&prepared(flight)]);
        unidentifiable.into_iter().filter(|one| one.effect == effect).map(|one| one.needs).collect()
    }

    #[test]
    fn a_candidate_takes_the_place_of_those_that_it_holds() {
        let of = |free: &[usize]| Candidate { kind: &FLIGHT_WIND, free: free.to_vec() };
        let (drag, wind, winds) = (of(&[1]), of(&[2, 3]), of(&[2, 3, 4, 5]));
        let accepted = [drag.clone(), wind.clone()];
        assert_eq!(with(&accepted, &winds), [drag.clone(), winds.clone()]);
        assert!(wind.is_in(&[drag.clone(), winds.clone()]) && !winds.is_in(&accepted));
        assert_eq!(winds.beside(&accepted), [1]);
        assert_eq!(with(&accepted, &of(&[6])), [drag.clone(), wind, of(&[6])]);
        let common = Candidate { kind: &WIND, free: vec![2, 3, 7] };
        let accepted = [drag.clone(), common.clone()];
        assert_eq!(with(&accepted, &winds), [drag, winds.clone()]);
        assert_eq!(
            winds.beside(&accepted),
            [1],
            "a vertical wind of all flights is not fitted beside level ones"
        );
        assert!(common.is_in(&[winds]));
    }

    /// Commands and an inertial unit alone show only the sum of both delays.
    #[test]
    fn attitude_and_rotor_speeds_are_a_third_clock() {
        let (all, alone) = (all_channels(), gyroscope_and_commands());
        let turned = Flight { attitude: all.attitude.clone(), ..alone.clone() };
        let spinning = Flight { rotor_speed: all.rotor_speed.clone(), ..alone.clone() };
        let has_clock = |flight: &Flight| has_third_clock(&prepared(flight));
        assert_eq!([&alone, &turned, &spinning].map(has_clock), [false, true, true]);
    }

    /// A friction that follows from commands alone is a candidate only on a rig that is declared or shows.
    #[test]
    fn frictions_of_a_rig_take_a_rig_or_rotor_speeds() {
        let (all, alone) = (all_channels(), gyroscope_and_commands());
        let turned = Flight { attitude: all.attitude.clone(), ..alone.clone() };
        let placed = Flight { position: all.position.clone(), ..turned.clone() };
        let spinning = Flight { rotor_speed: all.rotor_speed.clone(), ..placed.clone() };
        let held = Flight { on_rig: Some(true), ..alone.clone() };
        for effect in ["gimbal-friction", "bearing-friction"] {
            for unknown in [&alone, &placed] {
                assert_eq!(needs(effect, unknown), [Quantity::KnownRig.describe()], "{effect}");
            }
            for known in [&turned, &spinning, &held] {
                assert!(needs(effect, known).is_empty(), "{effect}");
            }
        }
    }
}
