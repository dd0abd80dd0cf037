//! The tip path plane tilts away from the wind.

use super::rotor_drag;
use crate::effects::condition::FlightCondition;
use crate::effects::kind::{Action, Confounder, EffectKind, Quantity, Values};
use crate::rotor::Wrench;
use diagnostics::unit::{ROTARY_STIFFNESS, TILT};

pub static EFFECT: EffectKind = EffectKind {
    name: "blade-flapping",
    summary: "the advancing blade rises: the thrust tilts against the direction of flight, with a torque on \
              the hub",
    equation: "t_i = k (v_i - (v_i . a_i) a_i), F_i = -T_i t_i at the hub, tau_i = K_b t_i x a_i",
    source: "Hoffmann, Huang, Waslander and Tomlin, Quadrotor helicopter flight dynamics and control, AIAA \
             2007-6461: blade flapping; Mahony, Kumar and Corke, IEEE RAM 19(3), 2012",
    validity: "small tilts (below 0.1 rad); the lateral tilt, which is opposite for opposite senses of rotation, is \
               left out. Its force can hardly be told from rotor-drag near hover, its torque can",
    parameters: Parameters::SPECS,
    actions: &[Action::Wrench(flapping)],
    needs: &[Quantity::Airspeed, Quantity::Force],
    // The hub is twisted by the product of the two parameters, but the tilt is linear.
    guesses: &[&[0.3 * 5e-3, 0.3 * 0.2], &[5e-3, 0.2]],
    confounded_with: &[Confounder {
        effect: &rotor_drag::EFFECT,
        experiment: "fly the same speeds with a heavier load: flapping grows with thrust, rotor drag with rotor speed",
    }],
    ..EffectKind::PLAIN
};

effect_parameters! {
    struct Parameters {
        /// k: tilt of the thrust per velocity across the axis
        tilt_per_speed: TILT, min: 0.0, max: 0.05, neutral: Some(0.0), nominal: 5e-3, source: "tuned, no source";
        /// K_b: torque on the hub per tilt, of each rotor
        hub_stiffness: ROTARY_STIFFNESS, min: 0.0, max: 5.0, neutral: Some(0.0), nominal: 0.2,
            source: "tuned, no source";
    }
}

fn flapping(values: &Values, condition: &FlightCondition) -> Wrench {
    let Parameters { tilt_per_speed, hub_stiffness } = values.into();
    let mut sum = Wrench::default();
    for (i, rotor) in condition.vehicle.rotors.iter().enumerate() {
        let tilt_B_rad = condition.hub_airspeed_along_and_across(i).1 * tilt_per_speed;
        // A rotor that runs backwards for a moment has no thrust that could tilt.
        let force_B_N = tilt_B_rad * -condition.thrust_N(i).max(0.0);
        sum += Wrench::at(&rotor.position_m, force_B_N);
        // Flown forward (+x) the disc tips back, which twists the nose up: negative about y.
        sum.torque_B_N_m += tilt_B_rad.cross(&rotor.axis) * hub_stiffness;
    }
    sum
}
