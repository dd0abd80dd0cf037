//! Drag of the rotors, linear in the speed of the air.

use crate::effects::condition::FlightCondition;
use crate::effects::kind::{Action, EffectKind, Quantity, Values};
use crate::rotor::Wrench;
use diagnostics::unit::ROTOR_DRAG;

pub static EFFECT: EffectKind = EffectKind {
    name: "rotor-drag",
    summary: "drag at the hub of a spinning rotor, linear in the rotor speed and in the speed across the \
              rotor",
    equation: "F_i = -c |w_i| (v_i - (v_i . a_i) a_i) at the hub of rotor i, v_i its velocity through the air",
    source: "Martin and Salaun, The true role of accelerometer feedback in quadrotor control, ICRA 2010; \
             Mahony, Kumar and Corke, Multirotor aerial vehicles, IEEE RAM 19(3), 2012",
    validity: "advance ratios below 0.1 (the Hummingbird: 4 m/s); along the rotor's axis nothing acts",
    parameters: Parameters::SPECS,
    actions: &[Action::Wrench(drag)],
    needs: &[Quantity::Airspeed, Quantity::Force],
    ..EffectKind::PLAIN
};

effect_parameters! {
    struct Parameters {
        /// c: force per rotor speed and velocity, of each rotor
        coefficient: ROTOR_DRAG, min: 0.0, max: 1e-3, neutral: Some(0.0), nominal: 8.06428e-5,
            source: "Hummingbird in RotorS, rotors_description/urdf/hummingbird.xacro";
    }
}

fn drag(values: &Values, condition: &FlightCondition) -> Wrench {
    let Parameters { coefficient } = values.into();
    let mut sum = Wrench::default();
    for (i, rotor) in condition.vehicle.rotors.iter().enumerate() {
        let (_, across_B_m_s) = condition.hub_airspeed_along_and_across(i);
        let force_B_N = across_B_m_s * (-coefficient * condition.rotor_speeds_rad_s[i].abs());
        sum += Wrench::at(&rotor.position_m, force_B_N);
    }
    sum
}
