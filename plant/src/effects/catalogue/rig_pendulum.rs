//! A body that swings about a bearing beside its centre of mass.

use super::{inertia_error, thrust_scale};
use crate::effects::condition::FlightCondition;
use crate::effects::kind::{Action, Confounder, EffectKind, Quantity, Values};
use crate::rotor::Wrench;
use diagnostics::unit::{INERTIA, STATIC_MOMENT};
use nalgebra::Vector3;
use vehicles::Vehicle;

pub static EFFECT: EffectKind = EffectKind {
    name: "rig-pendulum",
    summary: "a vehicle on a bearing beside its centre of mass swings as a pendulum, and turns more slowly",
    equation: "tau = g S (z x up), J_xx + A and J_yy + A; S = sum m l, A = sum m l^2 over all masses at l below the \
               bearing",
    source: "the physical pendulum of any text on mechanics",
    validity: "flights on a rig, simulated without it: the bearing holds the position, and its force is not \
               part of the effect. A scene with a rig already has the pendulum by its joints",
    parameters: Parameters::SPECS,
    actions: &[Action::Vehicle(slow), Action::Wrench(swing)],
    needs: &[Quantity::Torque, Quantity::Attitude, Quantity::Rig],
    confounded_with: &[
        Confounder {
            effect: &thrust_scale::EFFECT,
            experiment: "hang a known weight at a known arm on the rig: its torque shows by how much thrust and inertia differ",
        },
        Confounder {
            effect: &inertia_error::EFFECT,
            experiment: "fly freely, without the rig: the added inertia of the rig is gone, an error of the vehicle's stays",
        },
    ],
    ..EffectKind::PLAIN
};

effect_parameters! {
    struct Parameters {
        /// S: positive where the masses hang below the bearing
        static_moment: STATIC_MOMENT, min: -0.5, max: 0.5, neutral: Some(0.0), nominal: 0.01,
            source: "tuned, no source: 0.5 kg hanging 2 cm below the bearing";
        /// A: moment of inertia about the bearing beyond that about the centre of mass
        added_inertia: INERTIA, min: 0.0, max: 0.1, neutral: Some(0.0), nominal: 2e-4,
            source: "tuned, no source: 0.5 kg at 2 cm";
    }
}

fn slow(values: &Values, vehicle: &mut Vehicle) {
    let Parameters { added_inertia, .. } = values.into();
    vehicle.inertia_kg_m2[(0, 0)] += added_inertia;
    vehicle.inertia_kg_m2[(1, 1)] += added_inertia;
}

fn swing(values: &Values, condition: &FlightCondition) -> Wrench {
    let Parameters { static_moment, .. } = values.into();
    let torque_B_N_m = Vector3::z().cross(&condition.up_B) * (static_moment * condition.vehicle.gravity_m_s2);
    Wrench { force_B_N: Vector3::zeros(), torque_B_N_m }
}
