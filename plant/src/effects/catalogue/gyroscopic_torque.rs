//! Another angular momentum of the rotors than the declared one.

use crate::effects::kind::{Action, EffectKind, Quantity, Values};
use diagnostics::unit::RATIO;
use vehicles::Vehicle;

pub static EFFECT: EffectKind = EffectKind {
    name: "gyroscopic-torque",
    summary: "the rotors have more or less angular momentum than declared",
    equation: "J_r (1 + e) in -w x (h z) and -h' z with h = sum s_i J_r w_i, both of the declared model",
    source: "Euler's equation for body and rotors together; thesis eq. 3.11 is its first term",
    validity: "also scales the reaction to spinning up, which comes from the same angular momentum",
    parameters: Parameters::SPECS,
    actions: &[Action::Vehicle(scale)],
    needs: &[Quantity::Torque],
    ..EffectKind::PLAIN
};

effect_parameters! {
    struct Parameters {
        /// e: relative deviation of the rotors' moment of inertia; -1 takes both torques away
        scale_error: RATIO, min: -1.0, max: 4.0, neutral: Some(0.0), nominal: 0.5,
            source: "uncertainty of the Hummingbird's rotor inertia, vehicles/hummingbird.toml";
    }
}

fn scale(values: &Values, vehicle: &mut Vehicle) {
    vehicle.rotor_inertia_kg_m2 *= 1.0 + Parameters::from(values).scale_error;
}
