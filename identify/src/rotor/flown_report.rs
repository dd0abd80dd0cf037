//! The summary of flights on one screen, and of their agreement with a stand.

use std::fmt;

use super::agreement::Agreement;
use super::dynamics::Order;
use super::flown::{Figure, Flown, FlownCoefficient, FlownCoefficients, FlownMotor, HeldOut, LagFigures};
use crate::numbers::digits::rounded;
use crate::numbers::statistics::Estimate;
use diagnostics::unit::behind_number;

/// Writes what flights show.
pub fn write(f: &mut fmt::Formatter<'_>, flown: &Flown) -> fmt::Result {
    let named: Vec<String> = flown.flights.iter().map(|(name, role)| format!("{name} ({role})")).collect();
    writeln!(f, "flights: {}; intervals of 95 %", named.join(", "))?;
    if let Some(motor) = &flown.motor {
        write_motor(f, motor)?;
    }
    if let Some(coefficients) = &flown.coefficients {
        write_coefficients(f, coefficients)?;
    }
    Ok(())
}

/// Findings of flights about their data.
pub fn findings(flown: &Flown) -> impl Iterator<Item = &String> {
    let motor = flown.motor.iter().flat_map(|motor| &motor.findings);
    let coefficients = flown.coefficients.iter().flat_map(|coefficients| &coefficients.findings);
    flown.findings.iter().chain(motor).chain(coefficients)
}

fn write_motor(f: &mut fmt::Formatter<'_>, motor: &FlownMotor) -> fmt::Result {
    writeln!(f, "command map and motor, all rotors in common")?;
    let (min, max) = motor.command_range;
    let common = &motor.common;
    write_figure(f, &format!("speed at a command of {}", rounded(min)), &common.speed_at_min)?;
    write_figure(f, &format!("speed at a command of {}", rounded(max)), &common.speed_at_max)?;
    write_figure(f, "speed in the middle of the flown commands", &common.speed_in_flight)?;
    let at = motor.reference_voltage_v.map(|voltage| format!(", the speeds at {voltage:.2} V"));
    write_figure(f, &format!("power of the voltage{}", at.unwrap_or_default()), &common.voltage_power)?;
    write_lag(f, "first order", &motor.first)?;
    write_lag(f, "second order", &motor.second)?;
    let preferred = if motor.comparison.preferred == Order::First { "first" } else { "second" };
    writeln!(f, "  preferred: {preferred} order; {}", motor.comparison.reason)?;
    for rotor in &motor.rotors {
        let Some(alone) = &rotor.motor else {
            writeln!(f, "  rotor {}: too few commands with speeds", rotor.name)?;
            continue;
        };
        let (speed, late) = (&alone.speed_in_flight, &alone.lag.lateness);
        writeln!(f, "  rotor {}: speed in the middle {}, lateness {}", rotor.name, text(speed), text(late))?;
    }
    write_held_out(f, &motor.held_out)
}

fn write_lag(f: &mut fmt::Formatter<'_>, order: &str, lag: &LagFigures) -> fmt::Result {
    writeln!(f, "  {order}")?;
    let named = [
        ("time constant", &lag.time_constant),
        ("natural frequency", &lag.natural_frequency),
        ("damping ratio", &lag.damping_ratio),
    ];
    for (name, figure) in named {
        figure.iter().try_for_each(|figure| write_figure(f, &format!("  {name}"), figure))?;
    }
    write_figure(f, "  delay", &lag.delay)?;
    write_figure(f, "  lag and delay together", &lag.lateness)
}

fn write_coefficients(f: &mut fmt::Formatter<'_>, coefficients: &FlownCoefficients) -> fmt::Result {
    writeln!(f, "thrust and torque")?;
    write_coefficient(f, ["c_T / mass", "c_T"], &coefficients.thrust)?;
    write_coefficient(f, ["c_Q / I_zz", "c_Q"], &coefficients.torque)?;
    write_figure(f, "rotor inertia / I_zz", &coefficients.rotor_inertia_per_inertia)
}

fn write_coefficient(
    f: &mut fmt::Formatter<'_>,
    [specific, name]: [&str; 2],
    found: &FlownCoefficient,
) -> fmt::Result {
    write_figure(f, specific, &found.specific)?;
    write_figure(f, name, &found.coefficient)?;
    for (rotor, figure) in &found.rotors {
        write_figure(f, &format!("  {name} of {rotor}"), figure)?;
    }
    write_held_out(f, &found.held_out)
}

fn write_held_out(f: &mut fmt::Formatter<'_>, all: &[HeldOut]) -> fmt::Result {
    for HeldOut { flight, quantity, unit, declared, fitted } in all {
        let (declared, fitted) = (rounded(*declared), rounded(*fitted));
        writeln!(f, "  test flight {flight}: {quantity}, RMS error {declared} -> {fitted} {unit}")?;
    }
    Ok(())
}

fn write_figure(f: &mut fmt::Formatter<'_>, name: &str, figure: &Figure) -> fmt::Result {
    writeln!(f, "  {name}: {}", text(figure))
}

fn text(figure: &Figure) -> String {
    match (&figure.not_determined, &figure.estimate) {
        (None, Some(estimate)) => format!("{}{}", interval(estimate), behind_number(figure.unit)),
        (reason, estimate) => {
            let at =
                estimate.map(|estimate| format!(" ({}{})", interval(&estimate), behind_number(figure.unit)));
            format!("not determined: {}{}", reason.as_deref().unwrap_or("no data"), at.unwrap_or_default())
        }
    }
}

fn interval(estimate: &Estimate) -> String {
    format!("{} ({} to {})", rounded(estimate.value), rounded(estimate.low), rounded(estimate.high))
}

/// Writes whether stand and flights agree.
pub fn write_agreement(f: &mut fmt::Formatter<'_>, all: &[Agreement]) -> fmt::Result {
    if all.is_empty() {
        return writeln!(f, "stand and flights: no value is determined by both");
    }
    writeln!(f, "stand and flights")?;
    for Agreement { name, unit, stand, flights, agrees } in all {
        let verdict = if *agrees { "agree" } else { "differ beyond their intervals" };
        writeln!(
            f,
            "  {name}: {} and {}{}: they {verdict}",
            interval(stand),
            interval(flights),
            behind_number(unit)
        )?;
    }
    Ok(())
}
