//! Error of the thrust coefficient, the same for each rotor.

use crate::effects::kind::{Action, EffectKind, Values};
use diagnostics::unit::RATIO;
use vehicles::Vehicle;

pub static EFFECT: EffectKind = EffectKind {
    name: "thrust-scale",
    summary: "all rotors have more or less thrust than declared",
    equation: "c_T (1 + e)",
    source: "own (a deviation of the declared coefficient)",
    validity: "the drag torque stays",
    parameters: Parameters::SPECS,
    actions: &[Action::Vehicle(scale)],
    steady_state: true,
    ..EffectKind::PLAIN
};

effect_parameters! {
    struct Parameters {
        /// e: relative deviation of the thrust coefficient
        error: RATIO, min: -0.5, max: 1.0, neutral: Some(0.0), nominal: -0.05, source: "tuned, no source";
    }
}

fn scale(values: &Values, vehicle: &mut Vehicle) {
    vehicle.thrust_coefficient *= 1.0 + Parameters::from(values).error;
}
