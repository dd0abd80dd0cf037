//! Friction of a gimbal, about each axis by itself.

use super::bearing_friction::{self, SMOOTHING_RAD_S};
use crate::effects::condition::FlightCondition;
use crate::effects::kind::{Action, Confounder, EffectKind, Quantity, Values};
use crate::rotor::Wrench;
use diagnostics::unit::{ROTARY_DAMPING, TORQUE};
use nalgebra::Vector3;

pub static EFFECT: EffectKind = EffectKind {
    name: "gimbal-friction",
    summary: "the bearings of a gimbal brake the rotation about each axis by itself",
    equation: "tau_i = -(c_i / sqrt(w_i^2 + w_0^2) + b_i) w_i about each axis i of the body, with w_0 = 0.05 rad/s",
    source: "Coulomb and viscous friction, smoothed about standstill: Armstrong-Helouvry, Dupont and Canudas de Wit, \
             A survey of models, analysis tools and compensation methods for the control of machines \
             with friction, Automatica 30(7), 1994",
    validity: "axes of the gimbal that lie along those of the body: a small tilt; no stiction: below w_0 the bearings creep",
    parameters: Parameters::SPECS,
    actions: &[Action::Wrench(brake)],
    needs: &[Quantity::Torque, Quantity::Rig, Quantity::KnownRig],
    confounded_with: &[Confounder {
        effect: &bearing_friction::EFFECT,
        experiment: "turn about two axes at once: a ball joint then brakes each of them less than alone, a gimbal does not",
    }],
    ..EffectKind::PLAIN
};

/// Source of each nominal value.
const TUNED: &str = "tuned, no source";

effect_parameters! {
    struct Parameters {
        /// c_x: torque about body x at any rate well above w_0
        coulomb_x: TORQUE, min: 0.0, max: 0.5, neutral: Some(0.0), nominal: 0.01, source: TUNED;
        /// c_y: torque about body y at any rate well above w_0
        coulomb_y: TORQUE, min: 0.0, max: 0.5, neutral: Some(0.0), nominal: 0.01, source: TUNED;
        /// c_z: torque about body z at any rate well above w_0
        coulomb_z: TORQUE, min: 0.0, max: 0.5, neutral: Some(0.0), nominal: 0.01, source: TUNED;
        /// b_x: torque per rate about body x
        viscous_x: ROTARY_DAMPING, min: 0.0, max: 0.5, neutral: Some(0.0), nominal: 0.005, source: TUNED;
        /// b_y: torque per rate about body y
        viscous_y: ROTARY_DAMPING, min: 0.0, max: 0.5, neutral: Some(0.0), nominal: 0.005, source: TUNED;
        /// b_z: torque per rate about body z
        viscous_z: ROTARY_DAMPING, min: 0.0, max: 0.5, neutral: Some(0.0), nominal: 0.005, source: TUNED;
    }
}

fn brake(values: &Values, condition: &FlightCondition) -> Wrench {
    let Parameters { coulomb_x, coulomb_y, coulomb_z, viscous_x, viscous_y, viscous_z } = values.into();
    let about = |w: f64, coulomb: f64, viscous: f64| {
        -(coulomb / (w * w + SMOOTHING_RAD_S * SMOOTHING_RAD_S).sqrt() + viscous) * w
    };
    let w = condition.angular_velocity_B_rad_s;
    let torque_B_N_m = Vector3::new(
        about(w.x, coulomb_x, viscous_x),
        about(w.y, coulomb_y, viscous_y),
        about(w.z, coulomb_z, viscous_z),
    );
    Wrench { force_B_N: Vector3::zeros(), torque_B_N_m }
}
