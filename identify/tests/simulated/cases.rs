//! Cases whose answer is known: the truth, the result of an identification, and its judgement.
#![allow(non_snake_case, reason = "N is the newton")]

use super::{Plan, Sensors, fly, vehicle_file};
use flights::{Flight, FlightSet, Role};
use identify::report::Report;
use identify::run::{HORIZONS_S, identify, problem};
use identify::steps::{
    ACCELEROMETER_BIAS, GYROSCOPE_BIAS, Measured, POSE_DELAY, Parameters, Problem, SENSOR_BIAS, SENSOR_DELAY,
};
use identify::{Lateness, SensorErrors};
use plant::effects::{Effect, entry, find};
use vehicles::Vehicle;

/// An effect with less than this true gain on the test flights need not be found.
pub const MATTERS: f64 = 0.01;
/// Delay that a vehicle in free flight may have and still fly.
pub const FREE_DELAY_S: f64 = 0.02;

/// Names of the effects that are candidates without rotor speeds; the others are in `torques_of_the_air`, and the drag torque of the rotors
/// is in `yaw_gain`.
pub const EFFECTS: [&str; 20] = [
    "rotor-drag",
    "parasitic-drag",
    "translational-lift",
    "blade-flapping",
    "ground-effect",
    "wind",
    "motor-lag",
    "command-delay",
    "battery-sag",
    "weak-rotor",
    "com-offset",
    "mass-error",
    "thrust-scale",
    "inertia-error",
    "gyroscopic-torque",
    "rig-pendulum",
    "bearing-friction",
    SENSOR_DELAY,
    SENSOR_BIAS,
    "gimbal-friction",
];

/// Effects of a rig.
const ON_RIG: [&str; 3] = ["rig-pendulum", "bearing-friction", "gimbal-friction"];

/// Pairs of effects that act together.
pub const PAIRS: [[&str; 2]; 12] = [
    ["rotor-drag", "mass-error"],
    ["parasitic-drag", "motor-lag"],
    ["command-delay", "motor-lag"],
    ["battery-sag", "rotor-drag"],
    ["com-offset", "weak-rotor"],
    ["inertia-error", "command-delay"],
    ["thrust-scale", "translational-lift"],
    ["blade-flapping", "rotor-drag"],
    ["ground-effect", "mass-error"],
    [SENSOR_BIAS, "rotor-drag"],
    [SENSOR_DELAY, "command-delay"],
    ["rig-pendulum", "bearing-friction"],
];

/// A vehicle file, the truth beyond it, and the plan of its flights.
#[derive(Debug, Clone)]
pub struct Case {
    /// The declared vehicle.
    pub vehicle: &'static str,
    /// Plan of its flights; the truth holds the undeclared effects only.
    pub plan: Plan,
}

/// Verdict on a case.
#[derive(Debug, Clone)]
pub struct Judgement {
    /// The undeclared effects, each with the part of the test flights' squared error that only it takes away.
    pub true_gains: Vec<(&'static str, f64)>,
    /// Effects that were named.
    pub named: Vec<&'static str>,
    /// Effects that the report says would do as well as those named.
    pub confused_with: Vec<&'static str>,
    /// True values of the named effects' parameters, and whether the 95 % interval holds each.
    pub intervals: Vec<(String, bool)>,
    /// Held-out prediction error after, in units of the true model's: the greatest over channels and horizons.
    pub of_floor: f64,
    /// The whole report.
    pub report: Report,
}

impl Judgement {
    /// Effects that matter and were not named.
    pub fn missed(&self) -> Vec<&'static str> {
        let matters = self.true_gains.iter().filter(|(_, gain)| *gain > MATTERS);
        matters.map(|(name, _)| *name).filter(|name| !self.named.contains(name)).collect()
    }

    /// Effects that were named and are not true.
    pub fn invented(&self) -> Vec<&'static str> {
        let is_true = |name: &str| self.true_gains.iter().any(|(gained, _)| *gained == name);
        self.named.iter().copied().filter(|name| !is_true(name)).collect()
    }

    /// True if every missed effect is one that the report itself names as confounded.
    pub fn is_declared_swap(&self) -> bool {
        let missed = self.missed();
        !missed.is_empty() && missed.iter().all(|name| self.confused_with.contains(name))
    }
}

/// The effect `name`, so many times as strong as it is plausible.
pub fn scaled(name: &str, strength: f64) -> Effect {
    let kind = find(name).expect("a known effect");
    kind.with(|spec| {
        let Some(neutral) = spec.neutral else { return spec.nominal };
        let plausible = match (name, spec.name) {
            ("command-delay", _) => FREE_DELAY_S,
            // Four rotors alike would be a thrust scale.
            ("weak-rotor", "loss_1" | "loss_3" | "loss_4") => neutral,
            _ => spec.nominal,
        };
        (neutral + strength * (plausible - neutral)).clamp(spec.min, spec.max)
    })
}

impl Case {
    /// A case without undeclared effects.
    pub fn null(seed: u64, duration_s: f64) -> Self {
        Self { vehicle: "hummingbird.toml", plan: Plan { duration_s, ..Plan::of(Vec::new(), seed) } }
    }

    /// A case with these effects, each so many times as strong as plausible, flown so that they can show.
    pub fn of(names: &[&'static str], strength: f64, seed: u64, duration_s: f64) -> Self {
        let mut case = Self::null(seed, duration_s);
        for name in names {
            match *name {
                SENSOR_DELAY => case.plan.sensors.pose_delay_s = 0.02 * strength,
                SENSOR_BIAS => {
                    case.plan.sensors.accelerometer_bias_m_s2 = [0.2, -0.15, 0.3].map(|x| x * strength);
                    case.plan.sensors.gyroscope_bias_rad_s = [0.02, -0.01, 0.015].map(|x| x * strength);
                }
                _ => case.plan.truth.push(scaled(name, strength)),
            }
        }
        if names.contains(&"ground-effect") {
            case.plan.height_m = 0.5;
        }
        if names.contains(&"wind") {
            case.vehicle = "hummingbird-drag.toml";
        }
        case.plan.is_on_rig = names.iter().any(|name| ON_RIG.contains(name));
        case
    }

    /// The same case with so many times the noise.
    pub fn with_noise(mut self, noise: f64) -> Self {
        self.plan.sensors.noise = noise;
        self
    }

    /// The declared vehicle and its effects.
    pub fn declared(&self) -> (Vehicle, Vec<Effect>) {
        let vehicle = Vehicle::load(&vehicle_file(self.vehicle)).expect("a vehicle file");
        let effects = entry::resolve(&vehicle.effects).expect("its effects");
        (vehicle, effects)
    }

    /// A flight to fit on and one to test on.
    pub fn flights(&self) -> FlightSet {
        let (vehicle, mut all) = self.declared();
        all.extend(&self.plan.truth);
        let with = |seed, role| fly(&vehicle, &Plan { truth: all.clone(), seed, ..self.plan.clone() }, role);
        let flights = vec![with(self.plan.seed, Role::Fit), with(self.plan.seed + 100_000, Role::Test)];
        FlightSet {
            vehicle: vehicle_file(self.vehicle),
            flights,
            next_flight: Default::default(),
            files: Default::default(),
        }
    }

    /// Names of the true and undeclared effects.
    pub fn effects(&self) -> Vec<&'static str> {
        let Sensors { pose_delay_s, accelerometer_bias_m_s2, .. } = self.plan.sensors;
        let mut names: Vec<&'static str> = self.plan.truth.iter().map(|effect| effect.kind.name).collect();
        names.extend((pose_delay_s != 0.0).then_some(SENSOR_DELAY));
        names.extend((accelerometer_bias_m_s2 != [0.0; 3]).then_some(SENSOR_BIAS));
        names
    }

    /// The true values of all parameters.
    pub fn true_values(&self, parameters: &Parameters) -> Vec<f64> {
        let sensors = &self.plan.sensors;
        let value = |parameter: &identify::steps::Parameter| {
            if *parameter.kind == POSE_DELAY {
                sensors.pose_delay_s
            } else if *parameter.kind == ACCELEROMETER_BIAS {
                sensors.accelerometer_bias_m_s2[parameter.index]
            } else if *parameter.kind == GYROSCOPE_BIAS {
                sensors.gyroscope_bias_rad_s[parameter.index]
            } else {
                let effect = self.plan.truth.iter().find(|effect| effect.kind == parameter.kind);
                effect.map_or(parameter.baseline, |effect| effect.values[parameter.index])
            }
        };
        parameters.all.iter().map(value).collect()
    }

    /// Flies the case, identifies on it, and compares the result with the truth.
    pub fn judged(&self) -> Judgement {
        let set = self.flights();
        let report = identify(&set, &mut |_| ()).expect("flights to identify on").report;
        let (vehicle, declared) = self.declared();
        let (mut problem, _) = problem(&vehicle, &declared, &set).expect("flights to identify on");
        let values = self.true_values(&problem.model.parameters);
        let truth = problem.fitted(&values, &[]);
        problem.weigh(&truth, &[]);
        let true_gains =
            self.effects().iter().map(|name| (*name, self.true_gain(&problem, &values, name))).collect();
        Judgement {
            true_gains,
            named: report.verdict.clone(),
            confused_with: report.effects.values().flat_map(|effect| effect.confused_with.clone()).collect(),
            intervals: intervals(&problem.model.parameters, &values, &report),
            of_floor: self.of_floor(&problem, &values, &set, &report),
            report,
        }
    }

    /// Returns the part of the squared error that only the effect `name` takes away: the other true effects are
    /// fitted without it.
    fn true_gain(&self, problem: &Problem, values: &[f64], name: &str) -> f64 {
        let parameters = &problem.model.parameters;
        let mut without = values.to_vec();
        parameters.of_name(name).iter().for_each(|at| without[*at] = parameters.all[*at].baseline);
        let others: Vec<usize> = self
            .effects()
            .iter()
            .filter(|effect| **effect != name)
            .flat_map(|effect| parameters.of_name(effect))
            .collect();
        let cost = |values: &[f64]| problem.costs(&problem.test, values).iter().sum::<f64>();
        1.0 - cost(values) / cost(&problem.fitted(&without, &others).values)
    }

    fn of_floor(&self, problem: &Problem, values: &[f64], set: &FlightSet, report: &Report) -> f64 {
        let flight: &Flight =
            set.flights.iter().find(|flight| flight.role == Role::Test).expect("a test flight");
        let flight =
            &SensorErrors::of(&problem.model.parameters, values).taken_off(flight, &Lateness::default());
        let measured = Measured::of(flight).expect("motion");
        let mut worst = 0.0_f64;
        for horizon_s in HORIZONS_S {
            let truth = measured.predicted(flight, problem.model.airframe(values), horizon_s);
            let after = &report.held_out[&flight.name][&format!("{horizon_s}")];
            worst = after.iter().map(|(channel, change)| change.after / truth[channel]).fold(worst, f64::max);
        }
        worst
    }
}

/// For each parameter of each effect that is true and was named: whether its interval holds the truth.
fn intervals(parameters: &Parameters, values: &[f64], report: &Report) -> Vec<(String, bool)> {
    let mut found = Vec::new();
    for (effect, named) in report.effects.iter().filter(|(_, named)| named.accepted) {
        let at = |name: &str| {
            parameters
                .of_name(effect)
                .into_iter()
                .find(|at| parameters.all[*at].spec().name == name)
                .map(|at| values[at])
        };
        for (name, estimate) in &named.parameters {
            let truth = at(name).expect("a parameter of the effect");
            found.push((format!("{effect}.{name}"), estimate.low <= truth && truth <= estimate.high));
        }
    }
    found
}
