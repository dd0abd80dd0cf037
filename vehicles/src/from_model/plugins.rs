//! Plugins of Gazebo that drive rotors: `libgazebo_motor_model`, `gz-sim-multicopter-motor-model-system`.

use diagnostics::parameter::Bounds;
use diagnostics::{Diagnostic, ParameterError};
use roxmltree::Node;

use super::model::Motor;
use super::xml::{Source, child, start_of, text_of};
use crate::bounds;

/// Thrust by speed squared: the lightest vehicle at the largest rotor speed has the least.
const THRUST: Bounds = Bounds { min: 1e-16, ..bounds::THRUST_COEFFICIENT };
/// Torque by thrust.
const MOMENT: Bounds =
    Bounds { min: 1e-6, max: 10.0, unit: "m", why: "a rotor of 32 m that takes 17 MW has 2.2 m" };
/// Largest speed of a rotor.
const SPEED_MAX: Bounds = Bounds { min: 1.0, ..bounds::ROTOR_SPEED };
/// Ratio of the speed of a rotor to that of its joint.
const SLOWDOWN: Bounds = Bounds {
    min: 1.0,
    max: 1000.0,
    unit: "",
    why: "joints turn slower than rotors so that the simulator can follow",
};

/// Reads all plugins of motors within `top`.
///
/// # Errors
/// If a number is not one or not within its bounds, or a direction is neither `cw` nor `ccw`.
pub fn read(source: Source, top: Node) -> Result<Vec<Motor>, Diagnostic> {
    let plugins = top.descendants().filter(|node| node.tag_name().name() == "plugin");
    plugins.filter(|node| is_motor(*node)).map(|node| motor(source, node)).collect()
}

fn is_motor(plugin: Node) -> bool {
    let words = ["filename", "name"].map(|key| plugin.attribute(key).unwrap_or_default().to_lowercase());
    let is_one = |word: &String| {
        let word = word.replace(['-', '_'], "");
        word.contains("gazebomotormodel") || word.contains("multicoptermotormodel")
    };
    words.iter().any(is_one)
}

fn motor(source: Source, node: Node) -> Result<Motor, Diagnostic> {
    let bounded = |name: &str, bounds: &Bounds| bounded(source, node, name, bounds);
    let name =
        |key: &str| text_of(node, key).map(|text| text.rsplit("::").next().unwrap_or_default().to_owned());
    let number_of_command = index(source, node, "motorNumber")?;
    Ok(Motor {
        joint: name("jointName"),
        link: name("linkName"),
        spin: spin(source, node)?,
        thrust_coefficient: bounded("motorConstant", &THRUST)?,
        moment_m: bounded("momentConstant", &MOMENT)?,
        speed_max_rad_s: bounded("maxRotVelocity", &SPEED_MAX)?,
        lag_up_s: bounded("timeConstantUp", &bounds::TIME_CONSTANT)?,
        lag_down_s: bounded("timeConstantDown", &bounds::TIME_CONSTANT)?,
        slowdown: bounded("rotorVelocitySlowdownSim", &SLOWDOWN)?,
        number: number_of_command.or(index(source, node, "actuator_number")?),
        at: start_of(node),
    })
}

fn spin(source: Source, node: Node) -> Result<Option<f64>, Diagnostic> {
    match text_of(node, "turningDirection").as_deref() {
        Some("ccw") => Ok(Some(1.0)),
        Some("cw") => Ok(Some(-1.0)),
        Some(other) => {
            let error = ParameterError::value("turningDirection", "`ccw` or `cw`", format!("`{other}`"));
            Err(source.fault(start_of(child(node, "turningDirection").unwrap_or(node)), error))
        }
        None => Ok(None),
    }
}

/// A number within bounds, in SI; none without its element.
fn bounded(source: Source, plugin: Node, name: &str, bounds: &Bounds) -> Result<Option<f64>, Diagnostic> {
    let Some(node) = child(plugin, name) else { return Ok(None) };
    let number = source.number_of(node)?;
    bounds.check(name, number).map_err(|error| source.fault(start_of(node), error))?;
    Ok(Some(number))
}

/// The index of a command; none without its element.
fn index(source: Source, plugin: Node, name: &str) -> Result<Option<f64>, Diagnostic> {
    let Some(node) = child(plugin, name) else { return Ok(None) };
    let number = source.number_of(node)?;
    if number < 0.0 || number.fract() != 0.0 {
        let error = ParameterError::value(name, "a whole number of at least 0", number);
        return Err(source.fault(start_of(node), error));
    }
    Ok(Some(number))
}
