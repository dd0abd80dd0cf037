//! Thrust against the air that flows through a rotor, with the induced velocity of momentum theory.

use super::translational_lift;
use crate::arms::rotor_radius_m;
use crate::effects::condition::FlightCondition;
use crate::effects::kind::{Action, Confounder, EffectKind, Quantity, Values};
use diagnostics::unit::{LENGTH, ROTOR_DRAG};
use std::f64::consts::PI;
use vehicles::Vehicle;

pub static EFFECT: EffectKind = EffectKind {
    name: "rotor-inflow",
    summary: "air that flows down through a rotor costs thrust; in forward flight the rotor induces less of \
              this flow",
    equation: "dT_i = b |w_i| (u_i - n_i - v_i . a_i), n_i (|v_i - (v_i . a_i) a_i|^2 + (n_i + v_i . a_i)^2)^(1/2) = u_i^2, \
               u_i^2 = T_i / (2 rho pi R^2), rho = 1.225 kg/m^3",
    source: "Glauert, A general theory of the autogyro, ARC R&M 1111, 1926: the induced velocity n_i; Leishman, \
             Principles of Helicopter Aerodynamics, 2nd ed., 2006, chapter 3: by blade elements, thrust falls linearly \
             with the inflow; b = rho a s pi R^3 / 4 for untwisted blades of lift slope a and solidity s",
    validity: "one induced velocity over the disc, that of the thrust T_i. A descent faster than 1.5 u_i has the induced \
               velocity of one at 1.5 u_i: vortex ring and windmill are left out, and so are the wakes of other rotors",
    parameters: Parameters::SPECS,
    actions: &[Action::Thrust(change_N)],
    needs: &[Quantity::Airspeed, Quantity::Force],
    scale_to: Some(scale_to),
    confounded_with: &[Confounder {
        effect: &translational_lift::EFFECT,
        experiment: "climb, descend and fly level at up to the induced velocity of hover: with rotor-inflow a climb costs \
                     up to twice as much thrust in fast flight as in hover, and level flight gains ever less",
    }],
    ..EffectKind::PLAIN
};

effect_parameters! {
    struct Parameters {
        /// b: thrust lost per rotor speed and velocity of the air through the disc, of each rotor
        inflow_coefficient: ROTOR_DRAG, min: 0.0, max: 1e-2, neutral: Some(0.0), nominal: 4.64e-4,
            source: "twice the Hummingbird's k_z of translational-lift: a slow climb lowers the induced velocity by half of it";
        /// R: radius of the rotors
        rotor_radius: LENGTH, min: 0.01, max: 1.0, neutral: None, nominal: 0.1016,
            source: "Hummingbird: propellers of 8 inch, thesis Table 2.1";
    }
}

/// Density of the air in the standard atmosphere at sea level.
const AIR_KG_M3: f64 = 1.225;
/// A rotor whose hover would induce less is at rest.
const REST_M_S: f64 = 1e-3;
/// Fastest descent that momentum theory is asked about, in induced velocities of hover. Below 1.8 of them its equation has one solution.
const DESCENT_MAX: f64 = 1.5;
/// Steps of Newton's method. Five reach the rounding of f64 wherever one solution exists.
const STEPS: usize = 5;

fn change_N(values: &Values, condition: &FlightCondition, rotor: usize) -> f64 {
    let Parameters { inflow_coefficient, rotor_radius: radius_m } = values.into();
    let (along_m_s, across_B_m_s) = condition.hub_airspeed_along_and_across(rotor);
    let disc_m2 = PI * radius_m * radius_m;
    let hover_m_s = (condition.thrust_N(rotor).max(0.0) / (2.0 * AIR_KG_M3 * disc_m2)).sqrt();
    let induced_m_s = induced_m_s(hover_m_s, along_m_s, across_B_m_s.norm());
    let speed_rad_s = condition.rotor_speeds_rad_s[rotor].abs();
    inflow_coefficient * speed_rad_s * (hover_m_s - induced_m_s - along_m_s)
}

/// Induced velocity of a rotor that would induce `hover_m_s` in hover, and moves so fast along its axis and across it.
///
/// In units of hover's, it is the y with y^2 (across^2 + (along + y)^2) = 1.
fn induced_m_s(hover_m_s: f64, along_m_s: f64, across_m_s: f64) -> f64 {
    if hover_m_s < REST_M_S {
        return 0.0;
    }
    let along = (along_m_s / hover_m_s).max(-DESCENT_MAX);
    let across = across_m_s / hover_m_s;
    // Both are above the solution, from where the steps fall to it: that without motion across, and that of fast motion across.
    let axial = 2.0 / (along + (along * along + 4.0).sqrt());
    let mut induced = axial.min(1.0 / across);
    for _ in 0..STEPS {
        let through = along + induced;
        let squared = across * across + through * through;
        let slope = 2.0 * induced * (squared + induced * through);
        induced -= (induced * induced * squared - 1.0) / slope;
    }
    hover_m_s * induced
}

fn scale_to(vehicle: &Vehicle, values: &mut Values) {
    let mut parameters = Parameters::from(&*values);
    parameters.rotor_radius = rotor_radius_m(vehicle, parameters.rotor_radius);
    *values = parameters.into();
}
