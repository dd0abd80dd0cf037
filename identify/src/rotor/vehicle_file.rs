//! The result as the tables `[rotor]`, `[motor]` and `[command]` of a vehicle file.

use vehicles::{MotorModel, Uncertainty};

use super::coefficient::Coefficient;
use super::command_map::CommandLine;
use super::dynamics::{Dynamics, Order};
use super::report::RotorReport;
use super::stand::VehicleFile;
use crate::statistics::Estimate;

/// The text of `rotor.toml`. What the stand does not tell comes from `vehicle`, and is left out without one.
pub fn text(report: &RotorReport, vehicle: Option<&VehicleFile>) -> String {
    let head = format!(
        "# Tables of a vehicle file, identified from a thrust stand: {}.\n\
         # An uncertainty is one standard deviation; rotor.json has intervals, scores and findings.\n",
        report.name.replace('\n', " ")
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
    let uncertainty = if known { format!("{:e}", estimate.sigma) } else { "\"too few blocks\"".to_owned() };
    let interval = format!("95 % interval {:.4e} to {:.4e}", estimate.low, estimate.high);
    parameter(name, estimate.value, unit, &format!("{source}; {interval}"), &uncertainty)
}

/// A line with what the vehicle file has, or a comment that there is none.
fn taken(vehicle: Option<&VehicleFile>, table: &str, name: &str, unit: &str, value: f64) -> String {
    let Some(file) = vehicle else { return format!("# {name}: the stand does not tell\n") };
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
    let statics = report.statics.as_ref();
    let of = |value: fn(&vehicles::Vehicle) -> f64| vehicle.map_or(f64::NAN, |file| value(&file.vehicle));
    let line = |name: &str, unit: &str, law: &str, found: Option<&Coefficient>, other: f64| match found {
        Some(found) => identified(name, &found.value, unit, &fitted_on(report, law, found)),
        None => taken(vehicle, "rotor", name, unit, other),
    };
    let thrust = statics.and_then(|statics| statics.thrust.as_ref());
    let torque = statics.and_then(|statics| statics.torque.as_ref());
    let inertia = of(|vehicle| vehicle.rotor_inertia_kg_m2);
    [
        "[rotor]\n".to_owned(),
        line("thrust_coefficient", "N/(rad/s)^2", "T = c_T w^2", thrust, of(|fit| fit.thrust_coefficient)),
        line("torque_coefficient", "N*m/(rad/s)^2", "Q = c_Q w^2", torque, of(|fit| fit.torque_coefficient)),
        taken(vehicle, "rotor", "inertia", "kg*m^2", inertia),
    ]
    .concat()
}

fn fitted_on(report: &RotorReport, law: &str, found: &Coefficient) -> String {
    let held_out =
        found.held_out.map_or(String::new(), |score| format!(", held-out R^2 {:.4}", score.r_squared));
    format!("{}: {law} on {} plateaus{held_out}", report.name, found.plateaus)
}

fn motor(report: &RotorReport, vehicle: Option<&VehicleFile>) -> String {
    let Some(dynamics) = &report.dynamics else { return taken_motor(vehicle) };
    let source = format!("{}: {} steps of the command", report.name, dynamics.first.steps);
    let order = match dynamics.comparison.preferred {
        Order::First => first_order(dynamics, &source),
        Order::Second => second_order(dynamics, &source),
    };
    format!("[motor]\n# {}\n{order}", dynamics.comparison.reason)
}

fn first_order(dynamics: &Dynamics, source: &str) -> String {
    let time = dynamics.first.time_constant_s.iter();
    let line = time.map(|time| identified("time_constant", time, "s", source)).collect::<String>();
    format!("model = \"first-order\"\n{line}")
}

fn second_order(dynamics: &Dynamics, source: &str) -> String {
    let frequency = dynamics.second.natural_frequency_rad_s.iter();
    let damping = dynamics.second.damping_ratio.iter();
    let lines = frequency.map(|known| identified("natural_frequency", known, "rad/s", source));
    let more = damping.map(|known| identified("damping_ratio", known, "1", source));
    format!("model = \"second-order\"\n{}", lines.chain(more).collect::<String>())
}

fn taken_motor(vehicle: Option<&VehicleFile>) -> String {
    let Some(file) = vehicle else { return "# [motor]: the stand does not tell\n".to_owned() };
    let line = |name: &str, unit: &str, value: f64| taken(vehicle, "motor", name, unit, value);
    match file.vehicle.motor {
        MotorModel::FirstOrder { time_constant_s } => {
            format!("[motor]\nmodel = \"first-order\"\n{}", line("time_constant", "s", time_constant_s))
        }
        MotorModel::SecondOrder { natural_frequency_rad_s, damping_ratio } => format!(
            "[motor]\nmodel = \"second-order\"\n{}{}",
            line("natural_frequency", "rad/s", natural_frequency_rad_s),
            line("damping_ratio", "1", damping_ratio)
        ),
    }
}

fn command(report: &RotorReport, vehicle: Option<&VehicleFile>) -> String {
    let found = report.dynamics.as_ref().and_then(|dynamics| dynamics.command.as_ref());
    match (found, vehicle) {
        (Some(found), _) => identified_command(report, found),
        (None, Some(file)) => taken_command(file),
        (None, None) => "# [command]: the stand does not tell\n".to_owned(),
    }
}

fn identified_command(report: &RotorReport, found: &CommandLine) -> String {
    let ends =
        format!("{}: the smallest and the largest command that was held, in the log's unit", report.name);
    let line = format!("{}: line through the steady speeds", report.name);
    // A line can leave the axis below; a vehicle file has no negative speed.
    let low = Estimate { value: found.speed_at_min_rad_s.value.max(0.0), ..found.speed_at_min_rad_s };
    let source = toml::Value::from(format!("{}: it stood still at 0", report.name));
    let off = if found.zero_is_off {
        format!("zero_is_off = {{ value = true, source = {source} }}\n")
    } else {
        String::new()
    };
    [
        "[command]\n".to_owned(),
        parameter("min", found.min, "1", &ends, "0"),
        parameter("max", found.max, "1", &ends, "0"),
        identified("speed_at_min", &low, "rad/s", &line),
        identified("speed_at_max", &found.speed_at_max_rad_s, "rad/s", &line),
        off,
    ]
    .concat()
}

fn taken_command(file: &VehicleFile) -> String {
    let map = &file.vehicle.command;
    let line = |name: &str, unit: &str, value: f64| taken(Some(file), "command", name, unit, value);
    let source = toml::Value::from(format!("taken over from {}", file.name));
    [
        "[command]\n".to_owned(),
        line("min", "1", map.min),
        line("max", "1", map.max),
        line("speed_at_min", "rad/s", map.speed_at_min_rad_s),
        line("speed_at_max", "rad/s", map.speed_at_max_rad_s),
        format!("zero_is_off = {{ value = {}, source = {source} }}\n", map.zero_is_off),
    ]
    .concat()
}
