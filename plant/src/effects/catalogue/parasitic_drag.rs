//! Drag of the body, quadratic in the speed of the air.

use super::rotor_drag;
use crate::arms::longest_arm_m;
use crate::effects::condition::FlightCondition;
use crate::effects::kind::{Action, Confounder, EffectKind, Quantity, Values};
use crate::rotor::Wrench;
use diagnostics::unit::DYNAMIC_DRAG;
use nalgebra::Vector3;
use vehicles::Vehicle;

pub static EFFECT: EffectKind = EffectKind {
    name: "parasitic-drag",
    summary: "drag of fuselage and arms, quadratic in the airspeed",
    equation: "F = -|v| (c_xy v_x, c_xy v_y, c_z v_z) at the centre of mass, v the velocity through the air",
    source: "Folk, Paulos and Kumar, RotorPy, arXiv 2306.04485: aerodynamic wrenches",
    validity: "a body alike in front and at its sides; no torque: pressure centre and centre of mass coincide",
    parameters: Parameters::SPECS,
    actions: &[Action::Wrench(drag)],
    needs: &[Quantity::Airspeed, Quantity::Force],
    plausible_max: Some(plausible_max),
    confounded_with: &[Confounder {
        effect: &rotor_drag::EFFECT,
        experiment: "fly at twice the speed: parasitic drag grows with its square",
    }],
    ..EffectKind::PLAIN
};

effect_parameters! {
    struct Parameters {
        /// c_xy: force per velocity squared along body x and y
        coefficient_xy: DYNAMIC_DRAG, min: 0.0, max: 1.0, neutral: Some(0.0), nominal: 0.5e-2,
            source: "Hummingbird in RotorPy, rotorpy/vehicles/hummingbird_params.py";
        /// c_z: force per velocity squared along body z
        coefficient_z: DYNAMIC_DRAG, min: 0.0, max: 1.0, neutral: Some(0.0), nominal: 1e-2,
            source: "Hummingbird in RotorPy, rotorpy/vehicles/hummingbird_params.py";
    }
}

/// Greatest plausible coefficient of a vehicle with arms of [`SMALL_ARM_M`]: twenty times that of the Hummingbird; tuned, no source.
const SMALL_MAX: f64 = 0.1;
/// The Hummingbird's arm.
const SMALL_ARM_M: f64 = 0.17;

/// The greatest plausible coefficient: the force grows with the area, the square of the arm's length.
fn plausible_max(vehicle: &Vehicle) -> f64 {
    SMALL_MAX * (longest_arm_m(vehicle) / SMALL_ARM_M).powi(2).max(1.0)
}

fn drag(values: &Values, condition: &FlightCondition) -> Wrench {
    let Parameters { coefficient_xy: xy, coefficient_z: z } = values.into();
    let v_B_m_s = condition.airspeed_B_m_s;
    let force_B_N = v_B_m_s.component_mul(&Vector3::new(xy, xy, z)) * -v_B_m_s.norm();
    Wrench { force_B_N, torque_B_N_m: Vector3::zeros() }
}
