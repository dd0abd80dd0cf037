//! Rotors that give less than they should.

use crate::effects::condition::FlightCondition;
use crate::effects::kind::{Action, EffectKind, FitAs, Values};
use diagnostics::unit::RATIO;

pub static EFFECT: EffectKind = EffectKind {
    name: "weak-rotor",
    summary: "single rotors have less thrust at the same speed",
    equation: "dT_i = -l_i T_i",
    source: "own (a definition)",
    validity: "the rotor's drag torque stays, as for a damaged blade",
    parameters: Parameters::SPECS,
    actions: &[Action::Thrust(loss_N)],
    fit_as: FitAs::EachParameter,
    turns_steadily: true,
    ..EffectKind::PLAIN
};

/// Where each nominal value is from.
const CHIPPED: &str = "tuned, no source: a chipped propeller";

effect_parameters! {
    struct Parameters {
        /// l_1: part of the thrust that the first rotor of the vehicle file lacks
        loss_1: RATIO, min: 0.0, max: 1.0, neutral: Some(0.0), nominal: 0.1, source: CHIPPED;
        /// l_2: the same of the second rotor
        loss_2: RATIO, min: 0.0, max: 1.0, neutral: Some(0.0), nominal: 0.1, source: CHIPPED;
        /// l_3: the same of the third rotor
        loss_3: RATIO, min: 0.0, max: 1.0, neutral: Some(0.0), nominal: 0.1, source: CHIPPED;
        /// l_4: the same of the fourth rotor
        loss_4: RATIO, min: 0.0, max: 1.0, neutral: Some(0.0), nominal: 0.1, source: CHIPPED;
    }
}

fn loss_N(values: &Values, condition: &FlightCondition, rotor: usize) -> f64 {
    let Parameters { loss_1, loss_2, loss_3, loss_4 } = values.into();
    let loss = [loss_1, loss_2, loss_3, loss_4].get(rotor).copied().unwrap_or_default();
    -loss * condition.thrust_N(rotor)
}
