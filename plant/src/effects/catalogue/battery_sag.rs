//! Sagging voltage.

use super::{mass_error, thrust_scale};
use crate::actuation::Battery;
use crate::airframe_state::EffectState;
use crate::effects::kind::{Action, Advance, Confounder, EffectKind, Quantity, Stage, Values, VoltageLaw};
use crate::rotor;
use diagnostics::unit::{CHARGE, RATIO, RESISTANCE, VOLTAGE};
use vehicles::Vehicle;

pub static EFFECT: EffectKind = EffectKind {
    name: "battery-sag",
    summary: "the battery's voltage falls with its charge and under load, and the commanded rotor speed \
              falls with it",
    equation: "w_target (U / U_0)^p with U = U_0 - D (1 - q) - R I, U I = sum c_Q |w_i|^3 / eta, \
               q = 1 - q_0 - (charge drawn) / C; a measured voltage takes the place of U",
    source: "equivalent circuit of a voltage and a resistance: Plett, Battery Management Systems I, 2015, chapter 2; a brushed or \
             open-loop motor's speed follows its voltage. The charge's line from full to empty is own",
    validity: "the range between a full and an empty battery in which the discharge curve is near a line. \
               No recovery after load. A controller of rotor speed, or a firmware that raises the command as \
               the voltage falls, holds the speed until its headroom is gone: p = 0",
    parameters: Parameters::SPECS,
    actions: &[Action::Tick(sag), Action::Battery(battery)],
    needs: &[Quantity::Command],
    stage: Stage::Rotors,
    is_linear: false,
    guesses: &[&[0.03, 1.0, 0.1, 1.0], &[0.1, 1.0, 0.3, 1.0], &[0.01, 0.5, 0.5, 1.0]],
    scale_to: Some(scale_to),
    voltage_law: Some(VoltageLaw { exponent: 6, nominal: 3, full_V }),
    confounded_with: &[
        Confounder { effect: &thrust_scale::EFFECT, experiment: DISCHARGE },
        Confounder { effect: &mass_error::EFFECT, experiment: DISCHARGE },
    ],
    ..EffectKind::PLAIN
};

effect_parameters! {
    struct Parameters {
        /// R: of the pack with its leads
        internal_resistance: RESISTANCE, min: 0.0, max: 1.0, neutral: Some(0.0), nominal: 0.06,
            source: "tuned, no source: three cells of 15 mohm and leads";
        /// D: open-circuit voltage of the full battery less that of the empty one
        discharge_drop: VOLTAGE, min: 0.0, max: 10.0, neutral: Some(0.0), nominal: 2.1,
            source: "tuned, no source: three lithium-polymer cells from 4.2 V to 3.5 V";
        /// q_0: part of the charge that is gone at the start
        discharged: RATIO, min: 0.0, max: 1.0, neutral: Some(0.0), nominal: 0.2, source: "tuned, no source";
        /// U_0: open-circuit voltage of the full battery, at which the declared command map holds
        nominal_voltage: VOLTAGE, min: 1.0, max: 60.0, neutral: None, nominal: 12.6,
            source: "three lithium-polymer cells of 4.2 V";
        /// C
        capacity: CHARGE, min: 100.0, max: 1e6, neutral: None, nominal: 7560.0,
            source: "Hummingbird: 2100 mAh, thesis Table 2.1";
        /// eta: power on the rotor shafts by power from the battery
        efficiency: RATIO, min: 0.1, max: 1.0, neutral: None, nominal: 0.7, source: "tuned, no source";
        /// p: about 1 where nothing corrects the motors for the voltage, 0 where the drive holds their speeds
        exponent: RATIO, min: -0.5, max: 2.0, neutral: Some(1.0), nominal: 1.0,
            source: "the speed of a direct-current motor without load is proportional to its voltage";
    }
}

const DISCHARGE: &str = "log the voltage, and fly from a full battery until it is nearly empty";

/// A lighter vehicle flies on one lithium-polymer cell, as a Crazyflie 2.1 does (Bitcraze: 250 mAh).
const SMALL_KG: f64 = 0.1;

fn scale_to(vehicle: &Vehicle, values: &mut Values) {
    if vehicle.mass_kg < SMALL_KG {
        *values = Parameters { nominal_voltage: 4.2, capacity: 900.0, ..(&*values).into() }.into();
    }
}

/// Voltage of a full cell, and the most that one cell is charged to (high-voltage lithium-polymer).
const CELL_FULL_V: f64 = 4.2;
const CELL_MOST_V: f64 = 4.35;

/// Open-circuit voltage of a full battery of lithium-polymer cells of which `greatest_V` was measured: it has as many cells as that takes.
fn full_V(greatest_V: f64) -> f64 {
    CELL_FULL_V * (greatest_V / CELL_MOST_V).ceil().max(1.0)
}

fn sag(values: &Values, advance: &mut Advance) {
    let condition = &advance.condition;
    let battery = battery(values, advance.state, condition.vehicle, &condition.rotor_speeds_rad_s);
    advance.state.numbers[0] += battery.current_A * advance.dt_s;
    let Parameters { nominal_voltage, exponent, .. } = values.into();
    let share = advance.measured_voltage_V.unwrap_or(battery.voltage_V) / nominal_voltage;
    let factor = power(share, exponent);
    advance.actuation.targets_rad_s = advance.actuation.targets_rad_s.map(|target| target * factor);
}

/// `share` to the power of `exponent`. A proportional speed is not rounded, and a battery without voltage turns no motor.
#[allow(clippy::float_cmp, reason = "a stated exponent of 1 is 1")]
fn power(share: f64, exponent: f64) -> f64 {
    if exponent == 1.0 || share <= 0.0 { share } else { libm::pow(share, exponent) }
}

/// The battery when the charge drawn since the start is the first of the effect's numbers, in coulomb.
fn battery(values: &Values, state: &EffectState, vehicle: &Vehicle, speeds_rad_s: &[f64]) -> Battery {
    let parameters = Parameters::from(values);
    let charge = (1.0 - parameters.discharged - state.numbers[0] / parameters.capacity).max(0.0);
    let power_W = shaft_power_W(vehicle, speeds_rad_s) / parameters.efficiency;
    // A drop larger than the voltage itself leaves an empty battery, not a negative one.
    let open_V = (parameters.nominal_voltage - parameters.discharge_drop * (1.0 - charge)).max(0.0);
    let current_A = current_A(open_V, parameters.internal_resistance, power_W);
    Battery { voltage_V: open_V - parameters.internal_resistance * current_A, current_A, charge }
}

fn shaft_power_W(vehicle: &Vehicle, speeds_rad_s: &[f64]) -> f64 {
    let each = vehicle.rotors.iter().zip(speeds_rad_s);
    each.map(|(place, speed)| (rotor::drag_torque_N_m(vehicle, place, *speed) * speed).abs()).sum()
}

/// The smaller root of U I = P with U = U_oc - R I, in the form that holds for R = 0 too. Beyond its greatest power
/// the battery gives that: half of its voltage at the terminals.
fn current_A(open_V: f64, resistance_ohm: f64, power_W: f64) -> f64 {
    if open_V == 0.0 {
        return 0.0;
    }
    let headroom_V2 = open_V * open_V - 4.0 * resistance_ohm * power_W;
    if headroom_V2 < 0.0 {
        return open_V / (2.0 * resistance_ohm);
    }
    2.0 * power_W / (open_V + headroom_V2.sqrt())
}
