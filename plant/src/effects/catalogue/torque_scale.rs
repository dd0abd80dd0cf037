//! Error of the torque coefficient, the same for each rotor.

use super::inertia_error;
use crate::effects::kind::{Action, Confounder, EffectKind, Quantity, Values};
use diagnostics::unit::RATIO;
use vehicles::Vehicle;

pub static EFFECT: EffectKind = EffectKind {
    name: "torque-scale",
    summary: "all rotors have more or less drag torque than declared, so that the vehicle yaws faster or more slowly",
    equation: "c_Q (1 + e)",
    source: "own (a deviation of the declared coefficient)",
    validity: "the thrust stays; a modelled battery gives the power of the changed torque",
    parameters: Parameters::SPECS,
    actions: &[Action::Vehicle(scale)],
    needs: &[Quantity::Torque],
    confounded_with: &[Confounder {
        effect: &inertia_error::EFFECT,
        experiment: "hang the vehicle by two strings and time its swing about z, which gives that moment of inertia; or \
                     measure the torque of one rotor on a thrust stand",
    }],
    ..EffectKind::PLAIN
};

effect_parameters! {
    struct Parameters {
        /// e: relative deviation of the torque coefficient
        error: RATIO, min: -0.8, max: 4.0, neutral: Some(0.0), nominal: 0.2,
            source: "tuned, no source: c_Q by c_T of small propellers differs by as much from one to the next";
    }
}

fn scale(values: &Values, vehicle: &mut Vehicle) {
    vehicle.torque_coefficient *= 1.0 + Parameters::from(values).error;
}
