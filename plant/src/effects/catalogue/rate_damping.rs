//! The air resists rotations.

use super::{bearing_friction, inertia_error, translational_lift};
use crate::effects::condition::FlightCondition;
use crate::effects::kind::{Action, Confounder, EffectKind, Quantity, Values};
use crate::rotor::Wrench;
use diagnostics::unit::ROTARY_DAMPING;
use nalgebra::Vector3;

pub static EFFECT: EffectKind = EffectKind {
    name: "rate-damping",
    summary: "the air resists every rotation, by a torque that grows with the rate",
    equation: "tau = -(d_x w_x, d_y w_y, d_z w_z)",
    source: "Faessler, Franchi and Scaramuzza, Differential flatness of quadrotor dynamics subject to rotor drag for \
             accurate tracking of high-speed trajectories, IEEE RA-L 3(2), 2018, eq. 4: the term B w; the derivatives \
             L_p, M_q and N_r of Padfield, Helicopter Flight Dynamics, 2nd ed., 2007, chapter 4",
    validity: "rotor speeds near those of hover. The torque represents the thrust that rotors lose while a \
               rotation raises them, and the flapping of stiff blades. The drag of a fast turn grows with \
               the square of the rate and is left out",
    parameters: Parameters::SPECS,
    actions: &[Action::Wrench(damp)],
    needs: &[Quantity::Torque, Quantity::RotorSpeed],
    confounded_with: &[
        Confounder {
            effect: &inertia_error::EFFECT,
            experiment: "fly fast steps of torque and long turns at a steady rate: inertia counts at the steps, damping \
                         while the rate stays",
        },
        Confounder {
            effect: &translational_lift::EFFECT,
            experiment: "climb and descend: rotors that lose thrust in a climb damp roll and pitch, and the climb shows \
                         by how much",
        },
        Confounder { effect: &bearing_friction::EFFECT, experiment: "fly freely, without the rig" },
    ],
    ..EffectKind::PLAIN
};

/// Source of the nominal values about x and y.
const CLIMB: &str =
    "the Hummingbird's k_z of translational-lift: 4 k_z w l^2 with w = 400 rad/s and l^2 = 0.0145 m^2";

effect_parameters! {
    struct Parameters {
        /// d_x: torque per rate about body x
        x: ROTARY_DAMPING, min: 0.0, max: 0.5, neutral: Some(0.0), nominal: 5e-3, source: CLIMB;
        /// d_y: torque per rate about body y
        y: ROTARY_DAMPING, min: 0.0, max: 0.5, neutral: Some(0.0), nominal: 5e-3, source: CLIMB;
        /// d_z: torque per rate about body z
        z: ROTARY_DAMPING, min: 0.0, max: 0.5, neutral: Some(0.0), nominal: 1e-3, source: "tuned, no source";
    }
}

fn damp(values: &Values, condition: &FlightCondition) -> Wrench {
    let Parameters { x, y, z } = values.into();
    let w_B_rad_s = condition.angular_velocity_B_rad_s;
    Wrench { force_B_N: Vector3::zeros(), torque_B_N_m: -w_B_rad_s.component_mul(&Vector3::new(x, y, z)) }
}
