//! Dead time.

use crate::effects::kind::{Action, EffectKind, Quantity, Stage, Values};
use diagnostics::unit::TIME;

/// Motor commands act later.
pub static EFFECT: EffectKind = EffectKind {
    name: "command-delay",
    summary: "motor commands act later",
    equation: "u(t) = u_commanded(t - d), linear between ticks; before the first command the first one held",
    source: "own (a definition)",
    validity: "the same for all motors; adds to the delay of the manifest's edges",
    parameters: Parameters::SPECS,
    actions: &[Action::Delay(delay_s)],
    needs: &[Quantity::Command],
    stage: Stage::Rotors,
    is_delay: true,
    is_linear: false,
    guesses: &[&[0.005], &[0.015], &[0.03], &[0.06], &[0.1], &[0.15], &[0.2], &[0.3]],
    ..EffectKind::PLAIN
};

effect_parameters! {
    struct Parameters {
        /// d
        delay: TIME, min: 0.0, max: 0.5, neutral: Some(0.0), nominal: 0.15,
            source: "thesis section 5.4: unexplained delay of about 150 ms";
    }
}

fn delay_s(values: &Values) -> f64 {
    Parameters::from(values).delay
}
