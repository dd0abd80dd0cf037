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
    is_per_rotor: true,
    ..EffectKind::PLAIN
};

/// Source of each nominal value.
const CHIPPED: &str = "tuned, no source: a chipped propeller";

effect_parameters! {
    #[allow(dead_code, reason = "its values are read by the number of the rotor")]
    struct Parameters {
        /// l_1: part of the thrust that the first rotor of the vehicle file lacks
        loss_1: RATIO, min: 0.0, max: 1.0, neutral: Some(0.0), nominal: 0.1, source: CHIPPED;
        /// l_2: the same of the second rotor
        loss_2: RATIO, min: 0.0, max: 1.0, neutral: Some(0.0), nominal: 0.1, source: CHIPPED;
        /// l_3: the same of the third rotor
        loss_3: RATIO, min: 0.0, max: 1.0, neutral: Some(0.0), nominal: 0.1, source: CHIPPED;
        /// l_4: the same of the fourth rotor
        loss_4: RATIO, min: 0.0, max: 1.0, neutral: Some(0.0), nominal: 0.1, source: CHIPPED;
        /// l_5: the same of the fifth rotor
        loss_5: RATIO, min: 0.0, max: 1.0, neutral: Some(0.0), nominal: 0.1, source: CHIPPED;
        /// l_6: the same of the sixth rotor
        loss_6: RATIO, min: 0.0, max: 1.0, neutral: Some(0.0), nominal: 0.1, source: CHIPPED;
        /// l_7: the same of the seventh rotor
        loss_7: RATIO, min: 0.0, max: 1.0, neutral: Some(0.0), nominal: 0.1, source: CHIPPED;
        /// l_8: the same of the eighth rotor
        loss_8: RATIO, min: 0.0, max: 1.0, neutral: Some(0.0), nominal: 0.1, source: CHIPPED;
        /// l_9: the same of the ninth rotor
        loss_9: RATIO, min: 0.0, max: 1.0, neutral: Some(0.0), nominal: 0.1, source: CHIPPED;
        /// l_10: the same of the tenth rotor
        loss_10: RATIO, min: 0.0, max: 1.0, neutral: Some(0.0), nominal: 0.1, source: CHIPPED;
        /// l_11: the same of the eleventh rotor
        loss_11: RATIO, min: 0.0, max: 1.0, neutral: Some(0.0), nominal: 0.1, source: CHIPPED;
        /// l_12: the same of the twelfth rotor
        loss_12: RATIO, min: 0.0, max: 1.0, neutral: Some(0.0), nominal: 0.1, source: CHIPPED;
    }
}

fn loss_N(values: &Values, condition: &FlightCondition, rotor: usize) -> f64 {
    // The parameters are in the order of the rotors.
    -values[rotor] * condition.thrust_N(rotor)
}
