//! Another mass than the declared one.

use super::thrust_scale;
use crate::effects::kind::{Action, Confounder, EffectKind, Quantity, Values};
use diagnostics::unit::RATIO;
use vehicles::Vehicle;

pub static EFFECT: EffectKind = EffectKind {
    name: "mass-error",
    summary: "the vehicle is heavier or lighter than declared",
    equation: "m (1 + e)",
    source: "own (a deviation of the declared mass)",
    validity: "controllers that use the declared mass; inertia stays (see `inertia-error`)",
    parameters: Parameters::SPECS,
    actions: &[Action::Vehicle(weigh)],
    needs: &[Quantity::Force],
    steady_state: true,
    confounded_with: &[Confounder {
        effect: &thrust_scale::EFFECT,
        experiment: "weigh the vehicle; or fly with a known weight added: the relative error of the mass shrinks, that \
                     of thrust stays",
    }],
    ..EffectKind::PLAIN
};

effect_parameters! {
    struct Parameters {
        /// e: relative deviation of the mass
        error: RATIO, min: -0.5, max: 1.0, neutral: Some(0.0), nominal: 0.05, source: "tuned, no source";
    }
}

fn weigh(values: &Values, vehicle: &mut Vehicle) {
    vehicle.mass_kg *= 1.0 + Parameters::from(values).error;
}
