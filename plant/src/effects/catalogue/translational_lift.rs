//! Thrust against vertical and horizontal speed.

use crate::effects::condition::FlightCondition;
use crate::effects::kind::{Action, EffectKind, Quantity, Values};
use diagnostics::unit::{DYNAMIC_DRAG, ROTOR_DRAG};

pub static EFFECT: EffectKind = EffectKind {
    name: "translational-lift",
    summary: "a rotor loses thrust in a climb and gains thrust in sideways flight",
    equation: "dT_i = -k_z |w_i| (v_i . a_i) + k_h |v_i - (v_i . a_i) a_i|^2, v_i the hub's velocity through the air",
    source: "Svacha, Mohta and Kumar, Improving quadrotor trajectory tracking by compensating for aerodynamic \
             effects, ICUAS 2017: thrust model; blade element theory as in Leishman, Principles of Helicopter \
             Aerodynamics",
    validity: "first terms of an expansion about hover: climb and descent well below the induced velocity \
               (the Hummingbird: 5 m/s), no vortex ring. Independent of the thrust itself",
    parameters: Parameters::SPECS,
    actions: &[Action::Thrust(lift_N)],
    needs: &[Quantity::Airspeed, Quantity::Force],
    ..EffectKind::PLAIN
};

effect_parameters! {
    struct Parameters {
        /// k_z: thrust lost per rotor speed and velocity along the axis, of each rotor
        climb_coefficient: ROTOR_DRAG, min: 0.0, max: 2e-3, neutral: Some(0.0), nominal: 2.32e-4,
            source: "Hummingbird in RotorPy, rotorpy/vehicles/hummingbird_params.py, k_z";
        /// k_h: thrust gained per velocity squared across the axis, of each rotor
        translational_coefficient: DYNAMIC_DRAG, min: 0.0, max: 0.05, neutral: Some(0.0), nominal: 3e-3,
            source: "tuned, no source: 2 % more thrust than in hover at 3 m/s";
    }
}

fn lift_N(values: &Values, condition: &FlightCondition, rotor: usize) -> f64 {
    let Parameters { climb_coefficient: climb, translational_coefficient: across } = values.into();
    let (along_m_s, across_B_m_s) = condition.hub_airspeed_along_and_across(rotor);
    let speed_rad_s = condition.rotor_speeds_rad_s[rotor].abs();
    across * across_B_m_s.norm_squared() - climb * speed_rad_s * along_m_s
}
