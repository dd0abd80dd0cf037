//! A torque that grows with the speed through the air.

use super::{blade_flapping, com_offset, wind};
use crate::effects::condition::FlightCondition;
use crate::effects::kind::{Action, Confounder, EffectKind, Quantity, Values};
use crate::rotor::Wrench;
use diagnostics::unit::VELOCITY_TORQUE;
use nalgebra::Vector3;

pub static EFFECT: EffectKind = EffectKind {
    name: "velocity-torque",
    summary: "a torque that grows with the airspeed: in forward flight the nose rises",
    equation: "tau = (k_x v_y, -k_y v_x, 0), v the velocity of the centre of mass through the air",
    source: "Faessler, Franchi and Scaramuzza, Differential flatness of quadrotor dynamics subject to rotor drag for \
             accurate tracking of high-speed trajectories, IEEE RA-L 3(2), 2018, eq. 4: the term A R^T v; the \
             derivatives L_v and M_u of Padfield, Helicopter Flight Dynamics, 2nd ed., 2007, chapter 4",
    validity: "rotor speeds near those of hover and small advance ratios. The torque represents the drag of \
               hubs above the centre of mass, stiff blades that flap, and inflow that grows from front to \
               rear. It is negative for hubs far below the centre of mass",
    parameters: Parameters::SPECS,
    actions: &[Action::Wrench(turn)],
    needs: &[Quantity::Airspeed, Quantity::Torque, Quantity::RotorSpeed],
    confounded_with: &[
        Confounder {
            effect: &blade_flapping::EFFECT,
            experiment: "fly the same speeds with a heavier load. The force of flapping grows with thrust, \
                         and a torque without that force is no flapping",
        },
        Confounder {
            effect: &com_offset::EFFECT,
            experiment: "measure the height of the centre of mass below the hubs: hang the vehicle by one arm, then by \
                         another",
        },
        Confounder {
            effect: &wind::EFFECT,
            experiment: "fly the same course in both directions, or turn by half a circle while hovering: the wind's \
                         torque turns with the vehicle",
        },
    ],
    ..EffectKind::PLAIN
};

/// Source of the nominal values.
const AS_FLAPPING: &str = "tuned, no source: four rotors with the nominal values of blade-flapping";

effect_parameters! {
    struct Parameters {
        /// k_x: torque about body x per velocity along body y
        roll: VELOCITY_TORQUE, min: -0.5, max: 0.5, neutral: Some(0.0), nominal: 4e-3, source: AS_FLAPPING;
        /// k_y: torque about body y per velocity against body x
        pitch: VELOCITY_TORQUE, min: -0.5, max: 0.5, neutral: Some(0.0), nominal: 4e-3, source: AS_FLAPPING;
    }
}

fn turn(values: &Values, condition: &FlightCondition) -> Wrench {
    let Parameters { roll, pitch } = values.into();
    let v_B_m_s = condition.airspeed_B_m_s;
    Wrench {
        force_B_N: Vector3::zeros(),
        torque_B_N_m: Vector3::new(roll * v_B_m_s.y, -pitch * v_B_m_s.x, 0.0),
    }
}
