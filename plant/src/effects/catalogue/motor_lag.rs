//! Another motor lag than the declared one.

use super::command_delay;
use crate::effects::kind::{Action, Confounder, EffectKind, Quantity, Stage, Values};
use diagnostics::unit::RATIO;
use vehicles::{MotorModel, Vehicle};

pub static EFFECT: EffectKind = EffectKind {
    name: "motor-lag",
    summary: "the motors follow more slowly or faster than declared",
    equation: "first order: tau (1 + e); second order: w_n / (1 + e), zeta (1 + e_z)",
    source: "own (deviations of the declared motor)",
    validity: "the order stays the declared one; e_z does nothing at first order",
    parameters: Parameters::SPECS,
    actions: &[Action::Vehicle(lag)],
    needs: &[Quantity::Command],
    stage: Stage::Rotors,
    changes_drive: true,
    is_linear: false,
    guesses: &[&[-0.5, 0.0], &[-0.2, 0.0], &[0.3, 0.0], &[1.0, 0.0], &[2.5, 0.0]],
    confounded_with: &[Confounder {
        effect: &command_delay::EFFECT,
        experiment: "log rotor speeds, or command steps on a thrust stand at 1 kHz: a delay waits, a lag starts at once",
    }],
    ..EffectKind::PLAIN
};

effect_parameters! {
    struct Parameters {
        /// e: relative deviation of the time constant
        slowness: RATIO, min: -0.9, max: 4.0, neutral: Some(0.0), nominal: 0.3, source: "tuned, no source";
        /// e_z: relative deviation of the damping ratio
        damping_error: RATIO, min: -0.8, max: 3.0, neutral: Some(0.0), nominal: -0.2, source: "tuned, no source";
    }
}

fn lag(values: &Values, vehicle: &mut Vehicle) {
    let Parameters { slowness, damping_error } = values.into();
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
