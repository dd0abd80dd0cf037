//! What a test rig adds to a vehicle that turns about its bearing.
#![allow(non_snake_case, reason = "a trailing _B names the frame a vector is written in, N the newton")]

use super::situation::Situation;
use super::{Action, EffectKind, ParameterSpec, Values};
use crate::rotor::Wrench;
use diagnostics::unit::{INERTIA, ROTARY_DAMPING, STATIC_MOMENT, TORQUE};
use nalgebra::Vector3;
use vehicles::Vehicle;

/// Below this speed dry friction is taken as viscous, so that it has no jump: tuned, no source.
const SMOOTHING_RAD_S: f64 = 0.05;

/// A body that swings about a bearing beside its centre of mass.
pub static RIG_PENDULUM: EffectKind = EffectKind {
    name: "rig-pendulum",
    summary: "a vehicle on a bearing beside its centre of mass swings as a pendulum, and turns more slowly",
    equation: "tau = g S (z x up), J_xx + A and J_yy + A; S = sum m l, A = sum m l^2 over all masses at l below the \
               bearing",
    source: "the physical pendulum of any text on mechanics",
    validity: "for flights on a rig, seen without it: the position is held by the bearing, whose force is not part of \
               this. A scene with a rig has the pendulum by its joints already",
    parameters: &[
        ParameterSpec {
            name: "static_moment",
            meaning: "S: positive where the masses hang below the bearing",
            dimension: STATIC_MOMENT,
            lower: -0.5,
            upper: 0.5,
            neutral: Some(0.0),
            typical: 0.01,
            typical_source: "tuned, no source: 0.5 kg hanging 2 cm below the bearing",
        },
        ParameterSpec {
            name: "added_inertia",
            meaning: "A: moment of inertia about the bearing beyond that about the centre of mass",
            dimension: INERTIA,
            lower: 0.0,
            upper: 0.1,
            neutral: Some(0.0),
            typical: 2e-4,
            typical_source: "tuned, no source: 0.5 kg at 2 cm",
        },
    ],
    actions: &[Action::Vehicle(added_inertia), Action::Wrench(pendulum)],
};

/// Friction of the bearing.
pub static BEARING_FRICTION: EffectKind = EffectKind {
    name: "bearing-friction",
    summary: "the bearing brakes every rotation, by a constant torque and by one that grows with the rate",
    equation: "tau = -(c / sqrt(|w|^2 + w_0^2) + b) w with w_0 = 0.05 rad/s",
    source: "Coulomb and viscous friction, smoothed about standstill: Armstrong-Helouvry, Dupont and Canudas de Wit, \
             A survey of models, analysis tools and compensation methods for the control of machines \
             with friction, Automatica 30(7), 1994",
    validity: "the same about every axis, as in a ball joint; no stiction: below w_0 the bearing creeps",
    parameters: &[
        ParameterSpec {
            name: "coulomb",
            meaning: "c: torque at any rate well above w_0",
            dimension: TORQUE,
            lower: 0.0,
            upper: 0.5,
            neutral: Some(0.0),
            typical: 0.01,
            typical_source: "tuned, no source",
        },
        ParameterSpec {
            name: "viscous",
            meaning: "b: torque per rate",
            dimension: ROTARY_DAMPING,
            lower: 0.0,
            upper: 0.5,
            neutral: Some(0.0),
            typical: 0.005,
            typical_source: "tuned, no source",
        },
    ],
    actions: &[Action::Wrench(bearing_friction)],
};

fn added_inertia(&[_, inertia_kg_m2, ..]: &Values, vehicle: &mut Vehicle) {
    vehicle.inertia_kg_m2[(0, 0)] += inertia_kg_m2;
    vehicle.inertia_kg_m2[(1, 1)] += inertia_kg_m2;
}

fn pendulum(&[moment_kg_m, ..]: &Values, situation: &Situation) -> Wrench {
    let torque_B_N_m = Vector3::z().cross(&situation.up_B) * (moment_kg_m * situation.vehicle.gravity_m_s2);
    Wrench { force_B_N: Vector3::zeros(), torque_B_N_m }
}

fn bearing_friction(&[coulomb_N_m, viscous_N_m_s, ..]: &Values, situation: &Situation) -> Wrench {
    let w = situation.angular_velocity_B_rad_s;
    let smooth_rad_s = (w.norm_squared() + SMOOTHING_RAD_S * SMOOTHING_RAD_S).sqrt();
    Wrench { force_B_N: Vector3::zeros(), torque_B_N_m: w * -(coulomb_N_m / smooth_rad_s + viscous_N_m_s) }
}
