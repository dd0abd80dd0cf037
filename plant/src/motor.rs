//! The lag between the commanded and the actual rotor speed, with unit gain at rest (thesis section 4.2).

use vehicles::MotorModel;

use crate::state::{RotorRates, RotorState};

/// Rates of change of a rotor whose motor is asked for `target_rad_s`.
pub(crate) fn rates(model: &MotorModel, rotor: &RotorState, target_rad_s: f64) -> RotorRates {
    let missing_rad_s = target_rad_s - rotor.speed_rad_s;
    match *model {
        MotorModel::SecondOrder { natural_frequency_rad_s: wn, damping_ratio: zeta } => RotorRates {
            acceleration_rad_s2: rotor.acceleration_rad_s2,
            jerk_rad_s3: wn * wn * missing_rad_s - 2.0 * zeta * wn * rotor.acceleration_rad_s2,
        },
        MotorModel::FirstOrder { time_constant_s } => {
            RotorRates { acceleration_rad_s2: missing_rad_s / time_constant_s, jerk_rad_s3: 0.0 }
        }
    }
}

/// The target at which `rotor` goes on with its acceleration.
pub(crate) fn target_of(model: &MotorModel, rotor: &RotorState) -> f64 {
    let ahead_s = match *model {
        MotorModel::SecondOrder { natural_frequency_rad_s: wn, damping_ratio: zeta } => 2.0 * zeta / wn,
        MotorModel::FirstOrder { time_constant_s } => time_constant_s,
    };
    rotor.speed_rad_s + ahead_s * rotor.acceleration_rad_s2
}

/// The rotor after `span_s` towards `target_rad_s`: one classic Runge-Kutta step of fourth order.
pub(crate) fn moved(model: &MotorModel, rotor: &RotorState, target_rad_s: f64, span_s: f64) -> RotorState {
    let k1 = rates(model, rotor, target_rad_s);
    let k2 = rates(model, &rotor.moved(&k1, span_s / 2.0), target_rad_s);
    let k3 = rates(model, &rotor.moved(&k2, span_s / 2.0), target_rad_s);
    let k4 = rates(model, &rotor.moved(&k3, span_s), target_rad_s);
    let sum = k1.plus(&k2, 2.0).plus(&k3, 2.0).plus(&k4, 1.0);
    rotor.moved(&sum, span_s / 6.0)
}

/// The rotor with an acceleration that fits its speed and target. A second-order motor carries its
/// acceleration as a state; a first-order one has none, and only shows it.
pub(crate) fn settled(model: &MotorModel, rotor: &RotorState, target_rad_s: f64) -> RotorState {
    RotorState { acceleration_rad_s2: rates(model, rotor, target_rad_s).acceleration_rad_s2, ..*rotor }
}
