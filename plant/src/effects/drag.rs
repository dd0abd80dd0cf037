//! Drag: of the rotors, linear in the speed of the air, and of the body, quadratic in it.
#![allow(non_snake_case, reason = "a trailing _B names the frame a vector is written in, N the newton")]

use super::situation::Situation;
use super::{Action, EffectKind, ParameterSpec, Values};
use crate::rotor::Wrench;
use diagnostics::unit::{DYNAMIC_DRAG, ROTOR_DRAG as ROTOR_DRAG_UNITS};
use nalgebra::Vector3;

/// Induced drag and blade profile drag, lumped.
pub static ROTOR_DRAG: EffectKind = EffectKind {
    name: "rotor-drag",
    summary: "the air that crosses a spinning rotor drags at its hub, linear in both speeds",
    equation: "F_i = -c |w_i| (v_i - (v_i . z) z) at the hub of rotor i, v_i its velocity through the air",
    source: "Martin and Salaun, The true role of accelerometer feedback in quadrotor control, ICRA 2010; \
             Mahony, Kumar and Corke, Multirotor aerial vehicles, IEEE RAM 19(3), 2012",
    validity: "advance ratios below 0.1 (the Hummingbird: 4 m/s); along the rotor's axis nothing acts",
    parameters: &[ParameterSpec {
        name: "coefficient",
        meaning: "c: force per rotor speed and velocity, of each rotor",
        dimension: ROTOR_DRAG_UNITS,
        lower: 0.0,
        upper: 1e-3,
        neutral: Some(0.0),
        typical: 8.06428e-5,
        typical_source: "Hummingbird in RotorS, rotors_description/urdf/hummingbird.xacro",
    }],
    actions: &[Action::Wrench(rotor_drag)],
};

/// The drag of fuselage and arms.
pub static PARASITIC_DRAG: EffectKind = EffectKind {
    name: "parasitic-drag",
    summary: "the air drags at fuselage and arms, quadratic in its speed",
    equation: "F = -|v| (c_xy v_x, c_xy v_y, c_z v_z) at the centre of mass, v the velocity through the air",
    source: "Folk, Paulos and Kumar, RotorPy, arXiv 2306.04485: aerodynamic wrenches",
    validity: "a body alike in front and at its sides; no torque: pressure centre and centre of mass coincide",
    parameters: &[
        ParameterSpec {
            name: "coefficient_xy",
            meaning: "c_xy: force per velocity squared along body x and y",
            dimension: DYNAMIC_DRAG,
            lower: 0.0,
            upper: 0.1,
            neutral: Some(0.0),
            typical: 0.5e-2,
            typical_source: "Hummingbird in RotorPy, rotorpy/vehicles/hummingbird_params.py",
        },
        ParameterSpec {
            name: "coefficient_z",
            meaning: "c_z: force per velocity squared along body z",
            dimension: DYNAMIC_DRAG,
            lower: 0.0,
            upper: 0.1,
            neutral: Some(0.0),
            typical: 1e-2,
            typical_source: "Hummingbird in RotorPy, rotorpy/vehicles/hummingbird_params.py",
        },
    ],
    actions: &[Action::Wrench(parasitic_drag)],
};

fn rotor_drag(&[coefficient, ..]: &Values, situation: &Situation) -> Wrench {
    let mut sum = Wrench::default();
    for (i, rotor) in situation.vehicle.rotors.iter().enumerate() {
        let v_B_m_s = situation.hub_airspeed_B_m_s(i);
        let in_plane_B_m_s = Vector3::new(v_B_m_s.x, v_B_m_s.y, 0.0);
        let force_B_N = in_plane_B_m_s * (-coefficient * situation.rotor_speeds_rad_s[i].abs());
        sum += Wrench::at(&rotor.position_m, force_B_N);
    }
    sum
}

fn parasitic_drag(&[xy, z, ..]: &Values, situation: &Situation) -> Wrench {
    let v_B_m_s = situation.airspeed_B_m_s;
    let force_B_N = v_B_m_s.component_mul(&Vector3::new(xy, xy, z)) * -v_B_m_s.norm();
    Wrench { force_B_N, torque_B_N_m: Vector3::zeros() }
}
