//! Plugins of Gazebo that drive rotors: `libgazebo_motor_model`, `gz-sim-multicopter-motor-model-system`.

use diagnostics::{Diagnostic, ParameterError};
use roxmltree::Node;

use super::model::Motor;
use super::xml::{Source, child, start_of, text_of};

/// Reads all plugins of motors within `top`.
///
/// # Errors
/// If a number is not one, is not positive where it has to be, or a direction is neither `cw` nor `ccw`.
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
    let positive = |name: &str| number(source, node, name, false);
    let name =
        |key: &str| text_of(node, key).map(|text| text.rsplit("::").next().unwrap_or_default().to_owned());
    let number_of_command = number(source, node, "motorNumber", true)?;
    Ok(Motor {
        joint: name("jointName"),
        link: name("linkName"),
        spin: spin(source, node)?,
        thrust_coefficient: positive("motorConstant")?,
        moment_m: positive("momentConstant")?,
        speed_max_rad_s: positive("maxRotVelocity")?,
        lag_up_s: positive("timeConstantUp")?,
        lag_down_s: positive("timeConstantDown")?,
        number: number_of_command.or(number(source, node, "actuator_number", true)?),
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

fn number(source: Source, plugin: Node, name: &str, can_be_0: bool) -> Result<Option<f64>, Diagnostic> {
    let Some(node) = child(plugin, name) else { return Ok(None) };
    let number = source.number_of(node)?;
    if number < 0.0 || (number == 0.0 && !can_be_0) {
        let expected = if can_be_0 { "a number of at least 0" } else { "a number above 0" };
        return Err(source.fault(start_of(node), ParameterError::value(name, expected, number)));
    }
    Ok(Some(number))
}
