//! A centre of mass that is not amid the rotors.

use super::weak_rotor;
use crate::effects::kind::{Action, Confounder, EffectKind, Quantity, Values};
use diagnostics::unit::LENGTH;
use nalgebra::Vector3;
use vehicles::Vehicle;

pub static EFFECT: EffectKind = EffectKind {
    name: "com-offset",
    summary: "the centre of mass is not where it is declared, so that equal thrusts turn the vehicle",
    equation: "r_i - d for the hub of each rotor, d = (x, y, z)",
    source: "rigid-body mechanics: torques are taken about the centre of mass, which gravity acts on",
    validity: "offsets that are small against the arms. The inertia stays as declared: m d^2 is not \
               subtracted. The pose of the vehicle is that of the centre of mass, so that sensors move with \
               it. z acts only if a force in the plane of the rotors acts too, such as rotor-drag",
    parameters: Parameters::SPECS,
    actions: &[Action::Vehicle(shift)],
    needs: &[Quantity::Torque],
    steady_state: true,
    turns_steadily: true,
    confounded_with: &[Confounder {
        effect: &weak_rotor::EFFECT,
        experiment: "turn the propellers round by one motor: a weak rotor moves with them, the centre of mass does not",
    }],
    ..EffectKind::PLAIN
};

/// Source of each nominal value.
const STRAPPED: &str = "tuned, no source: a battery that is not strapped in the middle";

effect_parameters! {
    struct Parameters {
        /// d_x: how far the centre of mass is in front of the declared one
        x: LENGTH, min: -0.1, max: 0.1, neutral: Some(0.0), nominal: 0.005, source: STRAPPED;
        /// d_y: how far it is left of it
        y: LENGTH, min: -0.1, max: 0.1, neutral: Some(0.0), nominal: 0.005, source: STRAPPED;
        /// d_z: how far it is above it
        z: LENGTH, min: -0.1, max: 0.1, neutral: Some(0.0), nominal: 0.005, source: STRAPPED;
    }
}

fn shift(values: &Values, vehicle: &mut Vehicle) {
    let Parameters { x, y, z } = values.into();
    for rotor in &mut vehicle.rotors {
        rotor.position_m -= Vector3::new(x, y, z);
    }
}
