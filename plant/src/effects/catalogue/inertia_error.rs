//! Another inertia than the declared one.

use super::thrust_scale;
use crate::effects::kind::{Action, Confounder, EffectKind, Quantity, Values};
use diagnostics::unit::RATIO;
use nalgebra::{Matrix3, Vector3};
use vehicles::Vehicle;

pub static EFFECT: EffectKind = EffectKind {
    name: "inertia-error",
    summary: "the moments of inertia are larger or smaller than declared",
    equation: "S J S with S = diag(sqrt(1 + e_xx), sqrt(1 + e_yy), sqrt(1 + e_zz)), so that J_xx (1 + e_xx)",
    source: "own (deviations of the declared tensor, which keep it positive definite)",
    validity: "rigid bodies: a tensor with one moment larger than the sum of the other two is refused",
    parameters: Parameters::SPECS,
    actions: &[Action::Vehicle(stretch)],
    needs: &[Quantity::Torque],
    confounded_with: &[Confounder {
        effect: &thrust_scale::EFFECT,
        experiment: "fly freely with a position or an accelerometer, which show thrust by itself. On a rig, \
                     hang a known weight at a known arm: its torque shows the inertia",
    }],
    require: Some(require_rigid),
    ..EffectKind::PLAIN
};

/// Source of each nominal value.
const PUBLISHED: &str = "tuned, no source: published Hummingbirds differ by 50 %";

effect_parameters! {
    struct Parameters {
        /// e_xx: relative deviation about body x
        error_xx: RATIO, min: -0.5, max: 9.0, neutral: Some(0.0), nominal: 0.1, source: PUBLISHED;
        /// e_yy: relative deviation about body y
        error_yy: RATIO, min: -0.5, max: 9.0, neutral: Some(0.0), nominal: 0.1, source: PUBLISHED;
        /// e_zz: relative deviation about body z
        error_zz: RATIO, min: -0.5, max: 9.0, neutral: Some(0.0), nominal: 0.1, source: PUBLISHED;
    }
}

fn stretch(values: &Values, vehicle: &mut Vehicle) {
    let Parameters { error_xx, error_yy, error_zz } = values.into();
    let roots = Vector3::new(error_xx, error_yy, error_zz).map(|error| (1.0 + error).sqrt());
    let scale = Matrix3::from_diagonal(&roots);
    vehicle.inertia_kg_m2 = scale * vehicle.inertia_kg_m2 * scale;
}

fn require_rigid(vehicle: &Vehicle) -> Result<(), &'static str> {
    let expected =
        "deviations that leave no principal moment of inertia larger than the sum of the other two";
    if vehicles::is_rigid(&vehicle.inertia_kg_m2) { Ok(()) } else { Err(expected) }
}
