//! Friction of the bearing.

use crate::effects::condition::FlightCondition;
use crate::effects::kind::{Action, EffectKind, Quantity, Values};
use crate::rotor::Wrench;
use diagnostics::unit::{ROTARY_DAMPING, TORQUE};
use nalgebra::Vector3;

pub static EFFECT: EffectKind = EffectKind {
    name: "bearing-friction",
    summary: "the bearing brakes every rotation, by a constant torque and by one that grows with the rate",
    equation: "tau = -(c / sqrt(|w|^2 + w_0^2) + b) w with w_0 = 0.05 rad/s",
    source: "Coulomb and viscous friction, smoothed about standstill: Armstrong-Helouvry, Dupont and Canudas de Wit, \
             A survey of models, analysis tools and compensation methods for the control of machines \
             with friction, Automatica 30(7), 1994",
    validity: "the same about every axis, as in a ball joint; no stiction: below w_0 the bearing creeps",
    parameters: Parameters::SPECS,
    actions: &[Action::Wrench(brake)],
    needs: &[Quantity::Torque, Quantity::Rig, Quantity::KnownRig],
    ..EffectKind::PLAIN
};

effect_parameters! {
    struct Parameters {
        /// c: torque at any rate well above w_0
        coulomb: TORQUE, min: 0.0, max: 0.5, neutral: Some(0.0), nominal: 0.01, source: "tuned, no source";
        /// b: torque per rate
        viscous: ROTARY_DAMPING, min: 0.0, max: 0.5, neutral: Some(0.0), nominal: 0.005, source: "tuned, no source";
    }
}

/// Below this speed dry friction is taken as viscous, so that it has no jump: tuned, no source.
pub(super) const SMOOTHING_RAD_S: f64 = 0.05;

fn brake(values: &Values, condition: &FlightCondition) -> Wrench {
    let Parameters { coulomb, viscous } = values.into();
    let w = condition.angular_velocity_B_rad_s;
    let smooth_rad_s = (w.norm_squared() + SMOOTHING_RAD_S * SMOOTHING_RAD_S).sqrt();
    Wrench { force_B_N: Vector3::zeros(), torque_B_N_m: w * -(coulomb / smooth_rad_s + viscous) }
}
