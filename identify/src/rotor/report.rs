//! The result, and its summary on one screen.

use std::fmt;

use serde::Serialize;

use super::agreement::Agreement;
use super::coefficient::Coefficient;
use super::dynamics::{Dynamics, Fitted, Order};
use super::error::RotorError;
use super::flown::Flown;
use super::flown_report;
use super::plateau;
use super::score::Score;
use super::statics::Statics;
use crate::numbers::statistics::Estimate;

/// Everything that a stand and flights told.
#[derive(Debug, Clone, Serialize)]
pub struct RotorReport {
    /// Name of the measured object.
    pub name: String,
    /// Thrust and torque; absent without static logs.
    pub statics: Option<Statics>,
    /// The motor; absent without dynamic logs.
    pub dynamics: Option<Dynamics>,
    /// Figures from flights; absent without a flights file.
    pub flights: Option<Flown>,
    /// Values that stand and flights both determine; none without both.
    pub agreement: Vec<Agreement>,
}

impl RotorReport {
    /// Returns all figures as JSON, behind the name of the writer; an unknown end of an interval is `null`.
    pub(super) fn json(&self) -> Result<String, RotorError> {
        let mut all = serde_json::Map::from_iter([("writer".to_owned(), "hummingbus".into())]);
        all.extend(serde_json::to_value(self)?.as_object().cloned().unwrap_or_default());
        Ok(serde_json::to_string_pretty(&all)?)
    }
}

impl fmt::Display for RotorReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.name)?;
        if let Some(statics) = &self.statics {
            write_statics(f, statics)?;
        }
        if let Some(dynamics) = &self.dynamics {
            write_dynamics(f, dynamics)?;
        }
        if let Some(flown) = &self.flights {
            flown_report::write(f, flown)?;
        }
        if self.flights.is_some() && (self.statics.is_some() || self.dynamics.is_some()) {
            flown_report::write_agreement(f, &self.agreement)?;
        }
        let statics = self.statics.iter().flat_map(|statics| &statics.findings);
        let dynamics = self.dynamics.iter().flat_map(|dynamics| &dynamics.findings);
        let flights = self.flights.iter().flat_map(flown_report::findings);
        writeln!(f, "about the data")?;
        statics.chain(dynamics).chain(flights).try_for_each(|finding| writeln!(f, "  - {finding}"))
    }
}

fn write_statics(f: &mut fmt::Formatter<'_>, statics: &Statics) -> fmt::Result {
    let (slowest, fastest) = statics.speeds_rad_s;
    writeln!(f, "static, {slowest:.0} to {fastest:.0} rad/s, intervals of 95 %")?;
    for (name, unit, coefficient) in [("c_T", "N", &statics.thrust), ("c_Q", "N*m", &statics.torque)] {
        if let Some(coefficient) = coefficient {
            write_coefficient(f, name, unit, coefficient)?;
        }
    }
    if let Some(check) = &statics.plausibility {
        let merit = check.figure_of_merit.map(|merit| format!(", figure of merit {merit:.2}"));
        writeln!(f, "  thrust number {:.3}{}", check.thrust_number, merit.unwrap_or_default())?;
    }
    Ok(())
}

fn write_coefficient(
    f: &mut fmt::Formatter<'_>,
    name: &str,
    unit: &str,
    coefficient: &Coefficient,
) -> fmt::Result {
    let Estimate { value, low, high, .. } = coefficient.value;
    write!(f, "  {name} = {value:.4e} {unit}/(rad/s)^2 ({low:.4e} to {high:.4e})")?;
    write!(f, ", {} plateaus", coefficient.plateaus)?;
    write_held_out(f, coefficient.held_out, |rms| format!("{rms:.2e} {unit}"))
}

fn write_held_out(
    f: &mut fmt::Formatter<'_>,
    score: Option<Score>,
    size: impl Fn(f64) -> String,
) -> fmt::Result {
    match score {
        Some(Score { rms, r_squared, segments }) => {
            writeln!(f, "; held out {segments}: RMS {}, R^2 {r_squared:.4}", size(rms))
        }
        None => writeln!(f, "; none held out"),
    }
}

fn write_dynamics(f: &mut fmt::Formatter<'_>, dynamics: &Dynamics) -> fmt::Result {
    writeln!(f, "motor")?;
    write_motor(f, &dynamics.first)?;
    write_motor(f, &dynamics.second)?;
    let preferred = if dynamics.comparison.preferred == Order::First { "first" } else { "second" };
    writeln!(f, "  preferred: {preferred} order; {}", dynamics.comparison.reason)?;
    write_time(f, "rising steps", dynamics.rising_s, &own_times(dynamics, 1.0))?;
    write_time(f, "falling steps", dynamics.falling_s, &own_times(dynamics, -1.0))?;
    write_time(f, "first order on the other clock", dynamics.other_clock_s, "")?;
    let Some(command) = &dynamics.command else { return Ok(()) };
    writeln!(
        f,
        "  command {} to {}: {:.0} to {:.0} rad/s{}",
        command.min,
        command.max,
        command.speed_at_min_rad_s.value,
        command.speed_at_max_rad_s.value,
        command.held_out.map(|score| format!("; held out: RMS {:.0} rad/s", score.rms)).unwrap_or_default()
    )
}

/// The time constants of single steps of a direction, smallest and largest.
fn own_times(dynamics: &Dynamics, sign: f64) -> String {
    let alike = dynamics.steps.iter().filter(|step| step.height_rad_s * sign > 0.0);
    let times: Vec<f64> = alike.map(|step| 1e3 * step.time_constant_s).collect();
    if times.is_empty() {
        return "no steps".to_owned();
    }
    let (low, high) = plateau::range(&times);
    format!("{} steps, alone {low:.0} to {high:.0} ms", times.len())
}

fn write_time(f: &mut fmt::Formatter<'_>, name: &str, time: Option<Estimate>, more: &str) -> fmt::Result {
    let time = time.map_or("too few for an interval".to_owned(), milliseconds);
    writeln!(f, "  {name}: {time}{}{more}", if more.is_empty() { "" } else { "; " })
}

fn milliseconds(time: Estimate) -> String {
    format!("{:.1} ms ({:.1} to {:.1})", 1e3 * time.value, 1e3 * time.low, 1e3 * time.high)
}

fn write_motor(f: &mut fmt::Formatter<'_>, motor: &Fitted) -> fmt::Result {
    match (motor.time_constant_s, motor.natural_frequency_rad_s, motor.damping_ratio) {
        (Some(time), ..) => write!(f, "  first order: {}", milliseconds(time))?,
        (None, Some(wn), Some(zeta)) => write!(
            f,
            "  second order: w_n {:.2} rad/s ({:.2} to {:.2}), zeta {:.3} ({:.3} to {:.3})",
            wn.value, wn.low, wn.high, zeta.value, zeta.low, zeta.high
        )?,
        _ => write!(f, "  second order: its parameters cannot be told")?,
    }
    write!(f, ", {} steps", motor.steps)?;
    write_held_out(f, motor.held_out, |rms| format!("{rms:.2} rad/s"))
}
