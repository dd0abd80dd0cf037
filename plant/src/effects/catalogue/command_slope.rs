//! Another slope of the command map than the declared one.

use super::{battery_sag, inertia_error, thrust_scale};
use crate::effects::kind::{Action, Confounder, EffectKind, Quantity, Stage, Values};
use diagnostics::unit::RATIO;
use vehicles::Vehicle;

pub static EFFECT: EffectKind = EffectKind {
    name: "command-slope",
    summary: "the slope from command to rotor speed, about the speed of hover, differs from the declared \
              one",
    equation: "w_target = w + e (w - w_h), w by the declared command map, w_h of hover",
    source: "own (a deviation of the declared map; with thrust-scale, any line from command to speed)",
    validity: "the map stays a line; speeds that would turn below zero are zero",
    parameters: Parameters::SPECS,
    actions: &[Action::Vehicle(turn)],
    needs: &[Quantity::Command, Quantity::Force],
    stage: Stage::Rotors,
    changes_drive: true,
    confounded_with: &[
        Confounder { effect: &inertia_error::EFFECT, experiment: CLIMB },
        Confounder { effect: &thrust_scale::EFFECT, experiment: CLIMB },
        Confounder {
            effect: &battery_sag::EFFECT,
            experiment: "log the voltage, and climb and sink with a full battery",
        },
    ],
    ..EffectKind::PLAIN
};

effect_parameters! {
    struct Parameters {
        /// e: relative deviation of the slope
        error: RATIO, min: -0.8, max: 2.0, neutral: Some(0.0), nominal: 0.2, source: "tuned, no source";
    }
}

const CLIMB: &str = "log rotor speeds; or climb and sink with strong changes of thrust. The slope changes \
                     them, an inertia does not";

fn turn(values: &Values, vehicle: &mut Vehicle) {
    let Parameters { error } = values.into();
    let hover_rad_s = vehicle.hover_speed_rad_s();
    if !hover_rad_s.is_finite() {
        return;
    }
    let map = &mut vehicle.command;
    let turned = |speed_rad_s: f64| speed_rad_s + error * (speed_rad_s - hover_rad_s);
    let [low_rad_s, high_rad_s] = [map.speed_at_min_rad_s, map.speed_at_max_rad_s].map(turned);
    if high_rad_s <= 0.0 {
        return;
    }
    // The line goes on to standstill, and commands below ask for no speed.
    if low_rad_s < 0.0 {
        map.min += (map.max - map.min) * -low_rad_s / (high_rad_s - low_rad_s);
    }
    (map.speed_at_min_rad_s, map.speed_at_max_rad_s) = (low_rad_s.max(0.0), high_rad_s);
}
