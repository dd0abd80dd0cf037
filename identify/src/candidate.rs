//! The candidates of a selection: which parameters an effect brings, and where their fit starts.

use crate::parameter::{Parameters, SENSOR_BIAS, SENSOR_DELAY};
use crate::prepared::{Equation, Prepared};

/// An effect, or the part of one that makes sense alone: one weak rotor, the bias of one sensor.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// The effect.
    pub effect: &'static str,
    /// The parameters that it adds.
    pub which: Vec<usize>,
    /// Points from which its fit may start, each a value for each of `which`. Where there are none, the effect is
    /// close enough to linear that the declared values are a start.
    pub starts: Vec<Vec<f64>>,
}

/// An effect that these flights cannot show, and what they would need.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Unseen {
    /// The effect.
    pub effect: &'static str,
    /// What is missing.
    pub needs: &'static str,
}

/// The candidates that `flights` can show, and those that they cannot.
#[must_use]
pub fn candidates(parameters: &Parameters, flights: &[&Prepared]) -> (Vec<Candidate>, Vec<Unseen>) {
    let (mut seen, mut unseen) = (Vec::new(), Vec::new());
    let is_assumed = flights.iter().any(|flight| flight.is_assumed());
    for effect in parameters.effects() {
        if is_assumed && !OF_MEANS.contains(&effect) {
            unseen.push(Unseen {
                effect,
                needs: "attitude and angular velocity that were measured, not assumed",
            });
            continue;
        }
        match needs(effect).iter().find(|(_, is_met)| !flights.iter().any(|flight| is_met(flight))) {
            Some((needs, _)) => unseen.push(Unseen { effect, needs }),
            None => seen.extend(parts(parameters, effect)),
        }
    }
    (seen, unseen)
}

/// What the means of a flight show, where its attitude was assumed and only the means of forces and torques are true.
const OF_MEANS: [&str; 3] = ["thrust-scale", "mass-error", "com-offset"];

type Need = (&'static str, fn(&Prepared) -> bool);

const FORCES: Need = ("position, velocity or specific force: something that shows forces", |flight| {
    flight.offset_of(Equation::SpecificForce).is_some() || flight.offset_of(Equation::Acceleration).is_some()
});
const TORQUES: Need = ("attitude or angular velocity: something that shows torques", |flight| {
    flight.offset_of(Equation::AngularAcceleration).is_some()
});
const AIRSPEED: Need =
    ("position or velocity, together with attitude: the velocity through the air", |flight| {
        let has_velocity = !flight.flight.position.is_empty() || !flight.flight.velocity.is_empty();
        has_velocity && !flight.flight.attitude.is_empty()
    });
const HEIGHT: Need = ("position: the height above the ground", |flight| !flight.flight.position.is_empty());
const ATTITUDE: Need = ("attitude", |flight| !flight.flight.attitude.is_empty());
const COMMANDS: Need = ("motor commands", |flight| !flight.flight.command.is_empty());
const TWO_CLOCKS: Need = ("gyroscope and attitude, or else commands, to be late against", |flight| {
    flight.offset_of(Equation::Gyroscope).is_some() || !flight.flight.command.is_empty()
});

const HELD: Need = ("a rig: these flights move freely", |flight| !flight.moves_freely());

/// What has to be measured for an effect to show.
fn needs(effect: &str) -> &'static [Need] {
    match effect {
        "rotor-drag" | "parasitic-drag" | "translational-lift" | "blade-flapping" | "wind" => {
            &[AIRSPEED, FORCES]
        }
        "ground-effect" => &[HEIGHT, FORCES],
        "command-delay" | "motor-lag" | "battery-sag" => &[COMMANDS],
        "mass-error" => &[FORCES],
        "com-offset" | "inertia-error" | "gyroscopic-torque" => &[TORQUES],
        "bearing-friction" => &[TORQUES, HELD],
        "rig-pendulum" => &[TORQUES, ATTITUDE, HELD],
        SENSOR_DELAY => &[TWO_CLOCKS],
        _ => &[],
    }
}

/// The whole effect, or its parts where a part makes sense alone.
fn parts(parameters: &Parameters, effect: &'static str) -> Vec<Candidate> {
    let which = parameters.of_name(effect);
    let candidate = |which: Vec<usize>| {
        let starts = starts(parameters, &which);
        Candidate { effect, which, starts }
    };
    match effect {
        "weak-rotor" | SENSOR_DELAY => which.into_iter().map(|one| candidate(vec![one])).collect(),
        SENSOR_BIAS => {
            let sensor = |prefix: &str| {
                let is_of = |at: &usize| parameters.all[*at].name.starts_with(prefix);
                candidate(which.iter().copied().filter(is_of).collect())
            };
            ["accelerometer", "gyroscope", "attitude"].map(sensor).to_vec()
        }
        _ => vec![candidate(which)],
    }
}

/// Where the fit of effects that are far from linear starts.
fn starts(parameters: &Parameters, which: &[usize]) -> Vec<Vec<f64>> {
    let first = &parameters.all[which[0]];
    let within = |value: &f64| (first.lower..=first.upper).contains(value);
    let grid = |values: &[f64]| values.iter().copied().filter(within).map(|value| vec![value]).collect();
    match first.effect {
        "command-delay" => grid(&[0.005, 0.015, 0.03, 0.06, 0.1, 0.15, 0.2, 0.3]),
        SENSOR_DELAY => grid(&[-0.1, -0.05, -0.02, 0.01, 0.03, 0.06, 0.1, 0.15, 0.2]),
        "motor-lag" => [-0.5, -0.2, 0.3, 1.0, 2.5].map(|slowness| vec![slowness, 0.0]).to_vec(),
        "battery-sag" => vec![vec![0.03, 1.0, 0.1], vec![0.1, 1.0, 0.3], vec![0.01, 0.5, 0.5]],
        _ => Vec::new(),
    }
}
