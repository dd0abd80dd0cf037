//! The air resists a turn about the vertical axis.

use crate::effects::condition::FlightCondition;
use crate::effects::kind::{Action, EffectKind, Quantity, Values};
use crate::rotor::Wrench;
use diagnostics::unit::ROTARY_DAMPING;
use nalgebra::Vector3;

pub static EFFECT: EffectKind = EffectKind {
    name: "yaw-damping",
    summary: "a torque against the yaw rate",
    equation: "tau_z = -k w_z",
    source: "own",
    validity: "small rates: the drag of a fast turn grows with its square",
    parameters: Parameters::SPECS,
    actions: &[Action::Wrench(wrench)],
    needs: &[Quantity::Torque],
    ..EffectKind::PLAIN
};

effect_parameters! {
    struct Parameters {
        /// k: torque per yaw rate
        damping: ROTARY_DAMPING, min: 0.0, max: 1.0, neutral: Some(0.0), nominal: 1e-4, source: "tuned, no source";
    }
}

fn wrench(values: &Values, condition: &FlightCondition) -> Wrench {
    let torque_N_m = -Parameters::from(values).damping * condition.angular_velocity_B_rad_s.z;
    Wrench { force_B_N: Vector3::zeros(), torque_B_N_m: Vector3::z() * torque_N_m }
}
