//! The result as the tables `[rotor]`, `[motor]` and `[command]` of a vehicle file.

use vehicles::{MotorModel, Uncertainty};

use super::coefficient::Coefficient;
use super::command_map::CommandLine;
use super::dynamics::{Dynamics, Order};
use super::flown::{Figure, FlownCoefficient, FlownCoefficients, FlownMotor};
use super::report::RotorReport;
use super::stand::VehicleFile;
use super::statics::Statics;
use crate::numbers::digits::{quantity, rounded, to_six_digits};
use crate::numbers::statistics::Estimate;

/// The text of `rotor.toml`. Values that the stand does not give come from `vehicle`, and are left out without one.
pub fn text(report: &RotorReport, vehicle: Option<&VehicleFile>) -> String {
    let is_stand = report.statics.is_some() || report.dynamics.is_some();
    let origin = match (is_stand, report.flights.is_some()) {
        (true, true) => "a thrust stand and flights",
        (false, true) => "flights",
        _ => "a thrust stand",
    };
    let head = format!(
        "# Tables of a vehicle file, identified from {origin}: {}.\n\
         # An uncertainty is one standard deviation; rotor.json has intervals, scores and findings.\n",
        diagnostics::printable_line(&report.name)
    );
    [head, rotor(report, vehicle), motor(report, vehicle), command(report, vehicle)].join("\n")
}

/// One parameter's line.
fn parameter(name: &str, value: f64, unit: &str, source: &str, uncertainty: &str) -> String {
    let source = toml::Value::from(source);
    format!(
        "{name} = {{ value = {value:e}, unit = \"{unit}\", source = {source}, uncertainty = {uncertainty} }}\n"
    )
}

/// An estimate's line.
fn identified(name: &str, estimate: &Estimate, unit: &str, source: &str) -> String {
    let known = estimate.sigma.is_finite();
    let uncertainty =
        if known { format!("{:e}", to_six_digits(estimate.sigma)) } else { "\"too few blocks\"".to_owned() };
    let interval = format!("95 % interval {} to {}", rounded(estimate.low), quantity(estimate.high, unit));
    let value = to_six_digits(estimate.value);
    parameter(name, value, unit, &format!("{source}; {interval}"), &uncertainty)
}

/// A line with the value of the vehicle file, or a comment that it has none.
fn taken(vehicle: Option<&VehicleFile>, table: &str, name: &str, unit: &str, value: f64) -> String {
    let Some(file) = vehicle else { return format!("# {name}: not identified\n") };
    let key = format!("{table}.{name}");
    let provenance = file.vehicle.provenance.iter().find(|known| known.key == key);
    let source = provenance.map_or("", |known| known.source.as_str());
    let uncertainty = match provenance.map(|known| &known.uncertainty) {
        Some(Uncertainty::OneSigma(sigma)) => format!("{sigma:e}"),
        Some(Uncertainty::Said(text)) => toml::Value::from(text.as_str()).to_string(),
        None => "\"not stated\"".to_owned(),
    };
    parameter(name, value, unit, &format!("taken over from {}: {source}", file.name), &uncertainty)
}

fn rotor(report: &RotorReport, vehicle: Option<&VehicleFile>) -> String {
    let of = |value: fn(&vehicles::Vehicle) -> f64| vehicle.map_or(f64::NAN, |file| value(&file.vehicle));
    let line = |name: &str, unit: &str, law: &str, found: Option<&Coefficient>, other: f64| {
        let flown = flown(report, if unit == "N/(rad/s)^2" { |all| &all.thrust } else { |all| &all.torque });
        match (found, flown) {
            (Some(found), _) => identified(name, &found.value, unit, &fitted_on(report, law, found)),
            (None, Some(flown)) => {
                identified(name, &flown, unit, &format!("{}: {law} in flight", report.name))
            }
            (None, None) => taken(vehicle, "rotor", name, unit, other),
        }
    };
    let found =
        |of: fn(&Statics) -> &Option<Coefficient>| report.statics.as_ref().and_then(|all| of(all).as_ref());
    let (thrust, torque) = (found(|all| &all.thrust), found(|all| &all.torque));
    [
        "[rotor]\n".to_owned(),
        line("thrust_coefficient", "N/(rad/s)^2", "T = c_T w^2", thrust, of(|fit| fit.thrust_coefficient)),
        line("torque_coefficient", "N*m/(rad/s)^2", "Q = c_Q w^2", torque, of(|fit| fit.torque_coefficient)),
        taken(vehicle, "rotor", "inertia", "kg*m^2", of(|vehicle| vehicle.rotor_inertia_kg_m2)),
    ]
    .concat()
}

/// A coefficient that flights determine.
fn flown(report: &RotorReport, of: fn(&FlownCoefficients) -> &FlownCoefficient) -> Option<Estimate> {
    of(report.flights.as_ref()?.coefficients.as_ref()?).coefficient.determined().copied()
}

fn fitted_on(report: &RotorReport, law: &str, found: &Coefficient) -> String {
    let held_out =
        found.held_out.map_or(String::new(), |score| format!(", held-out R^2 {:.4}", score.r_squared));
    format!("{}: {law} on {} plateaus{held_out}", report.name, found.plateaus)
}

fn motor(report: &RotorReport, vehicle: Option<&VehicleFile>) -> String {
    if let Some(Dynamics { first, second, comparison, .. }) = &report.dynamics {
        let source = format!("{}: {} steps of the command", report.name, first.steps);
        let line = |name: &str, unit: &str, found: Option<Estimate>| {
            found.map_or(String::new(), |found| identified(name, &found, unit, &source))
        };
        let order = match comparison.preferred {
            Order::First => first_order(line("time_constant", "s", first.time_constant_s)),
            Order::Second => second_order(
                line("natural_frequency", "rad/s", second.natural_frequency_rad_s),
                line("damping_ratio", "1", second.damping_ratio),
            ),
        };
        return format!("[motor]\n# {}\n{order}", comparison.reason);
    }
    if let Some(lines) = flown_motor(report) {
        return lines;
    }
    let Some(file) = vehicle else { return "# [motor]: not identified\n".to_owned() };
    let line = |name: &str, unit: &str, value: f64| taken(vehicle, "motor", name, unit, value);
    let order = match file.vehicle.motor {
        MotorModel::FirstOrder { time_constant_s } => {
            first_order(line("time_constant", "s", time_constant_s))
        }
        MotorModel::SecondOrder { natural_frequency_rad_s, damping_ratio } => second_order(
            line("natural_frequency", "rad/s", natural_frequency_rad_s),
            line("damping_ratio", "1", damping_ratio),
        ),
    };
    format!("[motor]\n{order}")
}

/// The motor of flights, if they determine it. A delay is an effect of the vehicle, which a comment gives.
fn flown_motor(report: &RotorReport) -> Option<String> {
    let motor = report.flights.as_ref()?.motor.as_ref()?;
    let lag = &motor.common.lag;
    let source = format!("{}: speeds under the commands of flights", report.name);
    let line = |name: &str, figure: &Option<Figure>| {
        let figure = figure.as_ref()?;
        Some(identified(name, figure.determined()?, figure.unit, &source))
    };
    let order = match motor.comparison.preferred {
        Order::First => first_order(line("time_constant", &lag.time_constant)?),
        Order::Second => second_order(
            line("natural_frequency", &lag.natural_frequency)?,
            line("damping_ratio", &lag.damping_ratio)?,
        ),
    };
    let delay = lag.delay.determined().map(|delay| {
        format!(
            "# from the command to the measured speed: a delay of {:.4} s (95 %: {:.4} to {:.4}); the effect command-delay has it\n",
            delay.value, delay.low, delay.high
        )
    });
    Some(format!("[motor]\n# {}\n{order}{}", motor.comparison.reason, delay.unwrap_or_default()))
}

fn first_order(time_constant: String) -> String {
    format!("model = \"first-order\"\n{time_constant}")
}

fn second_order(natural_frequency: String, damping_ratio: String) -> String {
    format!("model = \"second-order\"\n{natural_frequency}{damping_ratio}")
}

fn command(report: &RotorReport, vehicle: Option<&VehicleFile>) -> String {
    let flown = report.flights.as_ref().and_then(|flown| flown.motor.as_ref());
    if let Some(lines) = flown.and_then(|motor| flown_command(&report.name, motor, vehicle)) {
        return lines;
    }
    let (lines, zero_is_off, source) =
        match (report.dynamics.as_ref().map(|dynamics| &dynamics.command), vehicle) {
            (Some(Some(found)), _) => {
                let lines = identified_command(&report.name, found);
                (lines, found.zero_is_off.then_some(true), format!("{}: it stood still at 0", report.name))
            }
            (_, Some(file)) => {
                let map = &file.vehicle.command;
                let line = |name: &str, unit: &str, value: f64| taken(vehicle, "command", name, unit, value);
                let lines = [
                    line("min", "1", map.min),
                    line("max", "1", map.max),
                    line("speed_at_min", "rad/s", map.speed_at_min_rad_s),
                    line("speed_at_max", "rad/s", map.speed_at_max_rad_s),
                ];
                (lines, Some(map.zero_is_off), format!("taken over from {}", file.name))
            }
            (_, None) => return "# [command]: not identified\n".to_owned(),
        };
    let source = toml::Value::from(source);
    let off = zero_is_off.map(|is_off| format!("zero_is_off = {{ value = {is_off}, source = {source} }}\n"));
    format!("[command]\n{}{}", lines.concat(), off.unwrap_or_default())
}

/// The command map of flights, over the range of the vehicle file's; `None` if they do not determine it.
fn flown_command(name: &str, motor: &FlownMotor, vehicle: Option<&VehicleFile>) -> Option<String> {
    let map = &vehicle?.vehicle.command;
    let common = &motor.common;
    let (low, high) = (common.speed_at_min.determined()?, common.speed_at_max.determined()?);
    // A line can leave the axis below; a vehicle file has no negative speed.
    let low = Estimate { value: low.value.max(0.0), ..*low };
    let at = motor.reference_voltage_v.map(|voltage| format!(" at {voltage:.2} V"));
    let source = format!("{name}: line through speeds and commands of flights{}", at.unwrap_or_default());
    let line = |name: &str, unit: &str, value: f64| taken(vehicle, "command", name, unit, value);
    let off = toml::Value::from(format!("taken over from {}", vehicle?.name));
    Some(
        [
            "[command]\n".to_owned(),
            line("min", "1", map.min),
            line("max", "1", map.max),
            identified("speed_at_min", &low, "rad/s", &source),
            identified("speed_at_max", high, "rad/s", &source),
            format!("zero_is_off = {{ value = {}, source = {off} }}\n", map.zero_is_off),
        ]
        .concat(),
    )
}

fn identified_command(name: &str, found: &CommandLine) -> [String; 4] {
    let ends = format!("{name}: the smallest and the largest command that was held, in the log's unit");
    let line = format!("{name}: line through the steady speeds");
    // A line can leave the axis below; a vehicle file has no negative speed.
    let low = Estimate { value: found.speed_at_min_rad_s.value.max(0.0), ..found.speed_at_min_rad_s };
    [
        parameter("min", found.min, "1", &ends, "0"),
        parameter("max", found.max, "1", &ends, "0"),
        identified("speed_at_min", &low, "rad/s", &line),
        identified("speed_at_max", &found.speed_at_max_rad_s, "rad/s", &line),
    ]
}
