//! The candidates of a selection: which parameters an effect brings, and where their fit starts.

use crate::parameter::{Owner, Parameter, Parameters, SENSOR_BIAS, SENSOR_DELAY, SensorParameter};
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

/// An effect, or the part of one that belongs to one sensor, that these flights cannot show, and what they would need.
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
        let is_unmet = |need: &&Need| !flights.iter().any(|flight| need.1(flight));
        if let Some((needs, _)) = needs(effect).iter().find(is_unmet) {
            unseen.push(Unseen { effect, needs });
            continue;
        }
        for part in parts(parameters, effect) {
            match need_of_part(&parameters.all[part.which[0]]).filter(|need| is_unmet(&need)) {
                Some((needs, _)) => unseen.push(Unseen { effect, needs }),
                None => seen.push(part),
            }
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

const BIASED_FORCE: Need =
    ("specific force, for the accelerometer's", |flight| flight.offset_of(Equation::SpecificForce).is_some());
const BIASED_RATES: Need = ("attitude and angular velocity, for the gyroscope's", |flight| {
    flight.offset_of(Equation::Gyroscope).is_some()
});
const BIASED_ATTITUDE: Need =
    ("attitude with position, velocity or specific force, for the attitude's", |flight| {
        !flight.flight.attitude.is_empty() && FORCES.1(flight)
    });
const INERTIAL: Need = ("an inertial unit, for its own", |flight| {
    !flight.flight.angular_velocity.is_empty() || !flight.flight.specific_force.is_empty()
});
const POSE: Need = ("attitude or position, for the pose's", |flight| {
    !flight.flight.attitude.is_empty() || !flight.flight.position.is_empty()
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

/// What else has to be measured for one sensor's part of an effect.
fn need_of_part(parameter: &Parameter) -> Option<Need> {
    match parameter.owner {
        Owner::Sensor(SensorParameter::Accelerometer(_)) => Some(BIASED_FORCE),
        Owner::Sensor(SensorParameter::Gyroscope(_)) => Some(BIASED_RATES),
        Owner::Sensor(SensorParameter::Attitude(_)) => Some(BIASED_ATTITUDE),
        Owner::Sensor(SensorParameter::ImuDelay) => Some(INERTIAL),
        Owner::Sensor(SensorParameter::PoseDelay) => Some(POSE),
        Owner::Plant(..) => None,
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
        // The hub is twisted by the product of the two.
        "blade-flapping" => [0.3, 1.0]
            .map(|part| which.iter().map(|at| part * parameters.all[*at].plausible).collect())
            .to_vec(),
        "battery-sag" => vec![vec![0.03, 1.0, 0.1], vec![0.1, 1.0, 0.3], vec![0.01, 0.5, 0.5]],
        _ => Vec::new(),
    }
}
