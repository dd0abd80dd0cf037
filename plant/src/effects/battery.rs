//! The battery: its voltage falls with charge and current, and the motors with it.
#![allow(non_snake_case, reason = "units stand last in names: _V, _A")]

use super::{Action, Advance, EffectKind, ParameterSpec, Values};
use crate::rotor;
use diagnostics::unit::{CHARGE, RATIO, RESISTANCE, VOLTAGE};
use vehicles::Vehicle;

/// The battery at an instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Battery {
    /// Voltage at the terminals.
    pub voltage_V: f64,
    /// Current drawn.
    pub current_A: f64,
    /// What is left of the capacity, 0 to 1.
    pub charge: f64,
}

/// Sagging voltage.
pub static BATTERY_SAG: EffectKind = EffectKind {
    name: "battery-sag",
    summary: "the battery's voltage falls as it empties and under load, and the speed that a command asks for with it",
    equation: "w_target U / U_0 with U = U_0 - D (1 - q) - R I, U I = sum c_Q |w_i|^3 / eta, \
               q = 1 - q_0 - (charge drawn) / C",
    source: "equivalent circuit of a voltage and a resistance: Plett, Battery Management Systems I, 2015, chapter 2; a brushed or \
             open-loop motor's speed follows its voltage. The charge's line from full to empty is own",
    validity: "between a full and an empty battery, where the discharge curve is near a line; no recovery after load; \
               a controller of rotor speed, which holds the speed until its headroom is gone, needs no sag",
    parameters: &[
        ParameterSpec {
            name: "internal_resistance",
            meaning: "R: of the pack with its leads",
            dimension: RESISTANCE,
            lower: 0.0,
            upper: 1.0,
            neutral: Some(0.0),
            typical: 0.06,
            typical_source: "tuned, no source: three cells of 15 mohm and leads",
        },
        ParameterSpec {
            name: "discharge_drop",
            meaning: "D: open-circuit voltage of the full battery less that of the empty one",
            dimension: VOLTAGE,
            lower: 0.0,
            upper: 10.0,
            neutral: Some(0.0),
            typical: 2.1,
            typical_source: "tuned, no source: three lithium-polymer cells from 4.2 V to 3.5 V",
        },
        ParameterSpec {
            name: "discharged",
            meaning: "q_0: part of the charge that is gone at the start",
            dimension: RATIO,
            lower: 0.0,
            upper: 1.0,
            neutral: Some(0.0),
            typical: 0.2,
            typical_source: "tuned, no source",
        },
        ParameterSpec {
            name: "nominal_voltage",
            meaning: "U_0: open-circuit voltage of the full battery, at which the declared command map holds",
            dimension: VOLTAGE,
            lower: 1.0,
            upper: 60.0,
            neutral: None,
            typical: 12.6,
            typical_source: "three lithium-polymer cells of 4.2 V",
        },
        ParameterSpec {
            name: "capacity",
            meaning: "C",
            dimension: CHARGE,
            lower: 100.0,
            upper: 1e6,
            neutral: None,
            typical: 7560.0,
            typical_source: "Hummingbird: 2100 mAh, thesis Table 2.1",
        },
        ParameterSpec {
            name: "efficiency",
            meaning: "eta: power on the rotor shafts by power from the battery",
            dimension: RATIO,
            lower: 0.1,
            upper: 1.0,
            neutral: None,
            typical: 0.7,
            typical_source: "tuned, no source",
        },
    ],
    actions: &[Action::Tick(advance)],
};

/// The battery when `drawn_C` has been drawn since the start and the rotors turn at `speeds_rad_s`.
pub(crate) fn at(values: &Values, drawn_C: f64, vehicle: &Vehicle, speeds_rad_s: &[f64; 4]) -> Battery {
    let &[resistance_ohm, drop_V, discharged, nominal_V, capacity_C, efficiency] = values;
    let charge = (1.0 - discharged - drawn_C / capacity_C).max(0.0);
    let power_W = shaft_power_W(vehicle, speeds_rad_s) / efficiency;
    // A drop larger than the voltage itself leaves an empty battery, not a negative one.
    let open_V = (nominal_V - drop_V * (1.0 - charge)).max(0.0);
    let current_A = current_A(open_V, resistance_ohm, power_W);
    Battery { voltage_V: open_V - resistance_ohm * current_A, current_A, charge }
}

fn shaft_power_W(vehicle: &Vehicle, speeds_rad_s: &[f64; 4]) -> f64 {
    speeds_rad_s.iter().map(|speed| (rotor::drag_torque_N_m(vehicle, *speed) * speed).abs()).sum()
}

/// The smaller root of U I = P with U = U_oc - R I, in the form that holds for R = 0 too. Beyond the power that
/// the battery has, it gives what it can: half of its voltage at the terminals.
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

fn advance(values: &Values, advance: &mut Advance) {
    let situation = &advance.situation;
    let drawn_C = &mut advance.remembered.lag[0];
    let battery = at(values, *drawn_C, situation.vehicle, &situation.rotor_speeds_rad_s);
    *drawn_C += battery.current_A * advance.dt_s;
    let share = battery.voltage_V / values[3];
    advance.drive.targets_rad_s = advance.drive.targets_rad_s.map(|target| target * share);
}
