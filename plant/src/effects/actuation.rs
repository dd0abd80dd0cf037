//! Between the motor command and the thrust: delay, lag, weak rotors.
#![allow(non_snake_case, reason = "units stand last in names, N is the newton")]

use super::situation::Situation;
use super::{Action, EffectKind, ParameterSpec, Values};
use diagnostics::unit::{RATIO, TIME};
use vehicles::{MotorModel, Vehicle};

/// Dead time.
pub static COMMAND_DELAY: EffectKind = EffectKind {
    name: "command-delay",
    summary: "motor commands act later",
    equation: "u(t) = u_commanded(t - d), linear between ticks; before the first command the first one held",
    source: "own (a definition)",
    validity: "the same for all motors; adds to the delay of the manifest's edges",
    parameters: &[ParameterSpec {
        name: "delay",
        meaning: "d",
        dimension: TIME,
        lower: 0.0,
        upper: 0.5,
        neutral: Some(0.0),
        typical: 0.15,
        typical_source: "thesis section 5.4: unexplained delay of about 150 ms",
    }],
    actions: &[Action::Delay(command_delay)],
};

/// Another motor lag than the declared one.
pub static MOTOR_LAG: EffectKind = EffectKind {
    name: "motor-lag",
    summary: "the motors follow more slowly or faster than declared",
    equation: "first order: tau (1 + e); second order: w_n / (1 + e), zeta (1 + e_z)",
    source: "own (deviations of the declared motor)",
    validity: "the order stays the declared one; e_z does nothing at first order",
    parameters: &[
        ParameterSpec {
            name: "slowness",
            meaning: "e: relative deviation of the time constant",
            dimension: RATIO,
            lower: -0.9,
            upper: 4.0,
            neutral: Some(0.0),
            typical: 0.3,
            typical_source: "tuned, no source",
        },
        ParameterSpec {
            name: "damping_error",
            meaning: "e_z: relative deviation of the damping ratio",
            dimension: RATIO,
            lower: -0.8,
            upper: 3.0,
            neutral: Some(0.0),
            typical: -0.2,
            typical_source: "tuned, no source",
        },
    ],
    actions: &[Action::Vehicle(motor_lag)],
};

const fn loss(name: &'static str, meaning: &'static str) -> ParameterSpec {
    ParameterSpec {
        name,
        meaning,
        dimension: RATIO,
        lower: 0.0,
        upper: 1.0,
        neutral: Some(0.0),
        typical: 0.1,
        typical_source: "tuned, no source: a chipped propeller",
    }
}

/// Rotors that give less than they should.
pub static WEAK_ROTOR: EffectKind = EffectKind {
    name: "weak-rotor",
    summary: "single rotors have less thrust at the same speed",
    equation: "dT_i = -l_i T_i",
    source: "own (a definition)",
    validity: "the rotor's drag torque stays, as for a damaged blade",
    parameters: &[
        loss("loss_1", "l_1: part of the thrust that the first rotor of the vehicle file lacks"),
        loss("loss_2", "l_2: the same of the second rotor"),
        loss("loss_3", "l_3: the same of the third rotor"),
        loss("loss_4", "l_4: the same of the fourth rotor"),
    ],
    actions: &[Action::Thrust(weak_rotor)],
};

/// All rotors alike.
pub static THRUST_SCALE: EffectKind = EffectKind {
    name: "thrust-scale",
    summary: "all rotors have more or less thrust than declared",
    equation: "c_T (1 + e)",
    source: "own (a deviation of the declared coefficient)",
    validity: "the drag torque stays",
    parameters: &[ParameterSpec {
        name: "error",
        meaning: "e: relative deviation of the thrust coefficient",
        dimension: RATIO,
        lower: -0.5,
        upper: 1.0,
        neutral: Some(0.0),
        typical: -0.05,
        typical_source: "tuned, no source",
    }],
    actions: &[Action::Vehicle(thrust_scale)],
};

fn command_delay(&[delay_s, ..]: &Values) -> f64 {
    delay_s
}

fn motor_lag(&[slowness, damping_error, ..]: &Values, vehicle: &mut Vehicle) {
    vehicle.motor = match vehicle.motor {
        MotorModel::FirstOrder { time_constant_s } => {
            MotorModel::FirstOrder { time_constant_s: time_constant_s * (1.0 + slowness) }
        }
        MotorModel::SecondOrder { natural_frequency_rad_s, damping_ratio } => MotorModel::SecondOrder {
            natural_frequency_rad_s: natural_frequency_rad_s / (1.0 + slowness),
            damping_ratio: damping_ratio * (1.0 + damping_error),
        },
    };
}

fn weak_rotor(losses: &Values, situation: &Situation, rotor: usize) -> f64 {
    -losses[rotor] * situation.thrust_N(rotor)
}

fn thrust_scale(&[error, ..]: &Values, vehicle: &mut Vehicle) {
    vehicle.thrust_coefficient *= 1.0 + error;
}
