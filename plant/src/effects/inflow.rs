//! What the air that flows through and across a rotor does to its thrust.
#![allow(non_snake_case, reason = "a trailing _B names the frame a vector is written in, N the newton")]

use super::situation::Situation;
use super::{Action, EffectKind, ParameterSpec, Values};
use crate::rotor::Wrench;
use diagnostics::unit::{DYNAMIC_DRAG, ROTARY_STIFFNESS, ROTOR_DRAG, TILT};
use nalgebra::Vector3;

/// Thrust against vertical and horizontal speed.
pub static TRANSLATIONAL_LIFT: EffectKind = EffectKind {
    name: "translational-lift",
    summary: "a rotor that climbs loses thrust, one that is flown sideways gains some",
    equation: "dT_i = -k_z |w_i| v_iz + k_h (v_ix^2 + v_iy^2), v_i the hub's velocity through the air",
    source: "Svacha, Mohta and Kumar, Improving quadrotor trajectory tracking by compensating for aerodynamic \
             effects, ICUAS 2017: thrust model; blade element theory as in Leishman, Principles of Helicopter \
             Aerodynamics",
    validity: "first terms of an expansion about hover: climb and descent well below the induced velocity (the \
               Hummingbird: 5 m/s), no vortex ring; independent of the thrust itself",
    parameters: &[
        ParameterSpec {
            name: "climb_coefficient",
            meaning: "k_z: thrust lost per rotor speed and velocity along the axis, of each rotor",
            dimension: ROTOR_DRAG,
            lower: 0.0,
            upper: 2e-3,
            neutral: Some(0.0),
            typical: 2.32e-4,
            typical_source: "Hummingbird in RotorPy, rotorpy/vehicles/hummingbird_params.py, k_z",
        },
        ParameterSpec {
            name: "translational_coefficient",
            meaning: "k_h: thrust gained per velocity squared across the axis, of each rotor",
            dimension: DYNAMIC_DRAG,
            lower: 0.0,
            upper: 0.05,
            neutral: Some(0.0),
            typical: 3e-3,
            typical_source: "tuned, no source: 2 % more thrust than in hover at 3 m/s",
        },
    ],
    actions: &[Action::Thrust(translational_lift)],
};

/// The tip path plane tilts away from the wind.
pub static BLADE_FLAPPING: EffectKind = EffectKind {
    name: "blade-flapping",
    summary: "the advancing blade rises: the thrust tilts away from where the rotor is flown, and twists the hub",
    equation: "a_i = k (v_ix, v_iy), F_i = -T_i a_i at the hub, tau_i = K_b (a_iy, -a_ix, 0)",
    source: "Hoffmann, Huang, Waslander and Tomlin, Quadrotor helicopter flight dynamics and control, AIAA \
             2007-6461: blade flapping; Mahony, Kumar and Corke, IEEE RAM 19(3), 2012",
    validity: "small tilts (below 0.1 rad); the lateral tilt, which is opposite for opposite senses of rotation, is \
               left out. Its force can hardly be told from rotor-drag near hover, its torque can",
    parameters: &[
        ParameterSpec {
            name: "tilt_per_speed",
            meaning: "k: tilt of the thrust per velocity across the axis",
            dimension: TILT,
            lower: 0.0,
            upper: 0.05,
            neutral: Some(0.0),
            typical: 5e-3,
            typical_source: "tuned, no source",
        },
        ParameterSpec {
            name: "hub_stiffness",
            meaning: "K_b: torque on the hub per tilt, of each rotor",
            dimension: ROTARY_STIFFNESS,
            lower: 0.0,
            upper: 5.0,
            neutral: Some(0.0),
            typical: 0.2,
            typical_source: "tuned, no source",
        },
    ],
    actions: &[Action::Wrench(blade_flapping)],
};

fn translational_lift(&[climb, across, ..]: &Values, situation: &Situation, rotor: usize) -> f64 {
    let v_B_m_s = situation.hub_airspeed_B_m_s(rotor);
    let speed_rad_s = situation.rotor_speeds_rad_s[rotor].abs();
    across * v_B_m_s.xy().norm_squared() - climb * speed_rad_s * v_B_m_s.z
}

fn blade_flapping(&[tilt_per_speed, stiffness, ..]: &Values, situation: &Situation) -> Wrench {
    let mut sum = Wrench::default();
    for (i, rotor) in situation.vehicle.rotors.iter().enumerate() {
        let tilt_B_rad = situation.hub_airspeed_B_m_s(i).xy() * tilt_per_speed;
        // A rotor that runs backwards for a moment has no thrust that could tilt.
        let force_B_N = Vector3::new(tilt_B_rad.x, tilt_B_rad.y, 0.0) * -situation.thrust_N(i).max(0.0);
        sum += Wrench::at(&rotor.position_m, force_B_N);
        // Flown forward (+x) the disc tips back, which twists the nose up: negative about y.
        sum.torque_B_N_m += Vector3::new(tilt_B_rad.y, -tilt_B_rad.x, 0.0) * stiffness;
    }
    sum
}
