//! More thrust near the ground.

use super::{mass_error, thrust_scale};
use crate::effects::condition::FlightCondition;
use crate::effects::kind::{Action, Confounder, EffectKind, Quantity, Values};
use diagnostics::unit::{LENGTH, RATIO};
use vehicles::Vehicle;

pub static EFFECT: EffectKind = EffectKind {
    name: "ground-effect",
    summary: "a rotor near the ground has more thrust, since the ground slows its downwash",
    equation: "dT_i = T_i (1 / (1 - s (R / 4 z_i)^2) - 1), z_i the height of hub i, taken as R / 2 below that",
    source: "Cheeseman and Bennett, The effect of the ground on a helicopter rotor in forward flight, ARC R&M 3021, \
             1955, its hovering case; s as the coefficient of Sanchez-Cuevas, Heredia and Ollero, Int. J. of Aerospace \
             Engineering 2017, 1823056",
    validity: "hover above z = R / 2. The loss of the effect in forward flight, the fountain between \
               rotors, and objects other than the ground are left out",
    parameters: Parameters::SPECS,
    actions: &[Action::Thrust(gain_N)],
    needs: &[Quantity::Height, Quantity::Force],
    scale_to: Some(scale_to),
    confounded_with: &[
        Confounder { effect: &mass_error::EFFECT, experiment: HEIGHTS },
        Confounder { effect: &thrust_scale::EFFECT, experiment: HEIGHTS },
    ],
    ..EffectKind::PLAIN
};

effect_parameters! {
    struct Parameters {
        /// s: 1 for a single rotor
        strength: RATIO, min: 0.0, max: 3.0, neutral: Some(0.0), nominal: 1.0, source: "Cheeseman and Bennett 1955";
        /// R: radius of the rotors
        rotor_radius: LENGTH, min: 0.01, max: 1.0, neutral: None, nominal: 0.1016,
            source: "Hummingbird: propellers of 8 inch, thesis Table 2.1";
    }
}

const HEIGHTS: &str = "hover at several heights from one to ten rotor radii";

fn gain_N(values: &Values, condition: &FlightCondition, rotor: usize) -> f64 {
    let Parameters { strength, rotor_radius: radius_m } = values.into();
    let height_m = condition.hub_height_m(rotor).max(radius_m / 2.0);
    let ratio = radius_m / (4.0 * height_m);
    condition.thrust_N(rotor) * (1.0 / (1.0 - strength * ratio * ratio) - 1.0)
}

/// A rotor is at most half as wide as the way to the next one.
fn scale_to(vehicle: &Vehicle, values: &mut Values) {
    let mut parameters = Parameters::from(&*values);
    let [first, second, ..] = &vehicle.rotors[..] else { return };
    let apart_m = (first.position_m - second.position_m).norm();
    if !(0.3..0.5).contains(&(parameters.rotor_radius / apart_m)) {
        parameters.rotor_radius = 0.35 * apart_m;
    }
    *values = parameters.into();
}
