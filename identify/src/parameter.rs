//! What identification may change: the parameters of all candidate effects, in one list.
//!
//! Effects of the plant's catalogue carry their bounds and neutral values with them. Two more are no physics of the
//! vehicle but of its sensors: `sensor-delay` and `sensor-bias`. Random effects are no candidates, for they have no
//! course that a fit could follow: what they leave is reported as unexplained.

use plant::effects::{CATALOGUE, Effect, EffectKind};
use vehicles::Vehicle;

/// The delay of sensors, as an effect.
pub const SENSOR_DELAY: &str = "sensor-delay";
/// The bias of sensors, as an effect.
pub const SENSOR_BIAS: &str = "sensor-bias";
/// Effects without a course that a fit could follow.
const RANDOM: [&str; 2] = ["ground-turbulence", "turbulence"];

/// What has to be computed anew when a parameter changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// The measured channels on the grid, and all that follows from them.
    Tracks,
    /// The rotor speeds that follow from the commands, and the accelerations.
    Rotors,
    /// The accelerations.
    Body,
    /// What sensors read.
    Reading,
}

/// What a parameter belongs to.
#[derive(Debug, Clone, Copy)]
pub enum Owner {
    /// Parameter `.1` of an effect of the plant.
    Plant(&'static EffectKind, usize),
    /// A sensor.
    Sensor(SensorParameter),
}

/// The parameters of sensors.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SensorParameter {
    /// Lateness of position, velocity and attitude.
    PoseDelay,
    /// Lateness of gyroscope and accelerometer.
    ImuDelay,
    /// Bias of an axis of the accelerometer.
    Accelerometer(usize),
    /// Bias of an axis of the gyroscope.
    Gyroscope(usize),
    /// Rotation of the measured attitude against the body about an axis of the body.
    Attitude(usize),
}

/// One number that may be fitted.
#[derive(Debug, Clone)]
pub struct Parameter {
    /// The effect.
    pub effect: &'static str,
    /// Its name within the effect.
    pub name: &'static str,
    /// Unit of the SI.
    pub unit: &'static str,
    /// Least value.
    pub lower: f64,
    /// Greatest value.
    pub upper: f64,
    /// The value of the declared model.
    pub declared: f64,
    /// How far a plausible value is from none.
    pub plausible: f64,
    /// A change that is small and yet well above rounding.
    pub step: f64,
    /// What it belongs to.
    pub owner: Owner,
}

/// All parameters, and which belong to one effect.
#[derive(Debug, Clone)]
pub struct Parameters {
    /// The parameters.
    pub all: Vec<Parameter>,
    /// The values that fixed parameters of the plant's effects have: one set for each effect of the catalogue.
    fixed: Vec<Effect>,
    /// Effects that the declared vehicle has.
    declared: Vec<&'static str>,
}

impl Parameters {
    /// The parameters of all candidates for `vehicle`, which has the effects `declared`. Parameters without a neutral
    /// value are not fitted: they are those of `declared`, or fit the vehicle's size.
    #[must_use]
    pub fn of(vehicle: &Vehicle, declared: &[Effect]) -> Self {
        let fixed: Vec<Effect> =
            CATALOGUE.into_iter().map(|kind| reference(kind, vehicle, declared)).collect();
        let mut all = Vec::new();
        for effect in fixed.iter().filter(|effect| !RANDOM.contains(&effect.kind.name)) {
            all.extend(of_effect(effect));
        }
        all.extend(of_sensors());
        Self { all, fixed, declared: declared.iter().map(|effect| effect.kind.name).collect() }
    }

    /// The declared values.
    #[must_use]
    pub fn declared(&self) -> Vec<f64> {
        self.all.iter().map(|parameter| parameter.declared).collect()
    }

    /// The candidate effects, in the order of the catalogue, those of sensors last.
    #[must_use]
    pub fn effects(&self) -> Vec<&'static str> {
        let mut names: Vec<&'static str> = self.all.iter().map(|parameter| parameter.effect).collect();
        names.dedup();
        names
    }

    /// The numbers of the parameters of `effect`.
    #[must_use]
    pub fn of_name(&self, effect: &str) -> Vec<usize> {
        (0..self.all.len()).filter(|i| self.all[*i].effect == effect).collect()
    }

    /// The value of a sensor's parameter.
    #[must_use]
    pub fn sensor(&self, values: &[f64], wanted: SensorParameter) -> f64 {
        let is_it = |parameter: &&Parameter| matches!(parameter.owner, Owner::Sensor(own) if own == wanted);
        let at = self.all.iter().position(|parameter| is_it(&parameter));
        at.map_or(0.0, |at| values[at])
    }

    /// The plant's effects under `values`, in the order of the catalogue: those that were declared and those whose
    /// values are not neutral.
    #[must_use]
    pub fn effects_under(&self, values: &[f64]) -> Vec<Effect> {
        let mut effects = self.fixed.clone();
        let mut is_in: Vec<bool> =
            effects.iter().map(|effect| self.declared.contains(&effect.kind.name)).collect();
        for (parameter, value) in self.all.iter().zip(values) {
            let Owner::Plant(kind, index) = parameter.owner else { continue };
            if let Some(at) = effects.iter().position(|effect| effect.kind.name == kind.name) {
                effects[at].values[index] = *value;
                #[allow(clippy::float_cmp, reason = "an untouched value is the declared one, bit for bit")]
                let is_changed = *value != parameter.declared;
                is_in[at] |= is_changed;
            }
        }
        effects.into_iter().zip(is_in).filter(|(_, is_in)| *is_in).map(|(effect, _)| effect).collect()
    }
}

impl Parameter {
    /// Whether it is a delay.
    #[must_use]
    pub fn is_delay(&self) -> bool {
        self.effect == "command-delay" || self.effect == SENSOR_DELAY
    }

    /// What changes with it.
    #[must_use]
    pub fn stage(&self) -> Stage {
        match self.owner {
            Owner::Sensor(SensorParameter::PoseDelay | SensorParameter::ImuDelay) => Stage::Tracks,
            Owner::Sensor(SensorParameter::Attitude(_)) => Stage::Body,
            Owner::Sensor(_) => Stage::Reading,
            Owner::Plant(kind, _) if ["command-delay", "motor-lag", "battery-sag"].contains(&kind.name) => {
                Stage::Rotors
            }
            Owner::Plant(..) => Stage::Body,
        }
    }
}

/// The effect as the declared model has it: declared, or neutral with fixed values that fit the vehicle.
fn reference(kind: &'static EffectKind, vehicle: &Vehicle, declared: &[Effect]) -> Effect {
    if let Some(effect) = declared.iter().find(|effect| effect.kind.name == kind.name) {
        return *effect;
    }
    kind.with(|spec| spec.neutral.unwrap_or_else(|| fitting(spec.name, spec.typical, vehicle)))
}

/// The typical values are a Hummingbird's. A rotor is at most half as wide as the way to the next one; what weighs less
/// than [`SMALL_KG`] flies on one lithium-polymer cell, as a Crazyflie 2.1 does (Bitcraze: 250 mAh).
fn fitting(name: &str, typical: f64, vehicle: &Vehicle) -> f64 {
    let apart_m = (vehicle.rotors[0].position_m - vehicle.rotors[1].position_m).norm();
    let is_small = vehicle.mass_kg < SMALL_KG;
    match name {
        "rotor_radius" if !(0.3..0.5).contains(&(typical / apart_m)) => 0.35 * apart_m,
        "nominal_voltage" if is_small => 4.2,
        "capacity" if is_small => 900.0,
        _ => typical,
    }
}

const SMALL_KG: f64 = 0.1;

fn of_effect(effect: &Effect) -> Vec<Parameter> {
    let specs = effect.kind.parameters.iter().enumerate();
    let fitted = specs.filter(|(_, spec)| spec.neutral.is_some());
    fitted
        .map(|(index, spec)| Parameter {
            effect: effect.kind.name,
            name: spec.name,
            unit: spec.unit(),
            lower: spec.lower,
            upper: spec.upper,
            declared: effect.values[index],
            plausible: plausible(spec.typical, spec.neutral),
            step: if effect.kind.name == "command-delay" {
                DELAY_STEP_S
            } else {
                plausible(spec.typical, spec.neutral) / 50.0
            },
            owner: Owner::Plant(effect.kind, index),
        })
        .collect()
}

/// The grid cannot see less.
const DELAY_STEP_S: f64 = 0.002;

fn plausible(typical: f64, neutral: Option<f64>) -> f64 {
    let reach = (typical - neutral.unwrap_or(0.0)).abs();
    if reach == 0.0 { 1.0 } else { reach }
}

fn of_sensors() -> Vec<Parameter> {
    use SensorParameter::{Accelerometer, Attitude, Gyroscope, ImuDelay, PoseDelay};
    let sensor = |effect, name, unit, bound: f64, step, own| Parameter {
        effect,
        name,
        unit,
        lower: -bound,
        upper: bound,
        declared: 0.0,
        plausible: 50.0 * step,
        step,
        owner: Owner::Sensor(own),
    };
    let bias = |name, unit, bound, step, own| sensor(SENSOR_BIAS, name, unit, bound, step, own);
    vec![
        sensor(SENSOR_DELAY, "pose", "s", 0.5, DELAY_STEP_S, PoseDelay),
        sensor(SENSOR_DELAY, "imu", "s", 0.5, DELAY_STEP_S, ImuDelay),
        bias("accelerometer_x", "m/s^2", 5.0, 0.01, Accelerometer(0)),
        bias("accelerometer_y", "m/s^2", 5.0, 0.01, Accelerometer(1)),
        bias("accelerometer_z", "m/s^2", 5.0, 0.01, Accelerometer(2)),
        bias("gyroscope_x", "rad/s", 1.0, 0.001, Gyroscope(0)),
        bias("gyroscope_y", "rad/s", 1.0, 0.001, Gyroscope(1)),
        bias("gyroscope_z", "rad/s", 1.0, 0.001, Gyroscope(2)),
        bias("attitude_x", "rad", 0.3, 0.001, Attitude(0)),
        bias("attitude_y", "rad", 0.3, 0.001, Attitude(1)),
    ]
}
