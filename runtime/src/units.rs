//! Units of fields, and conversions between those of one quantity.

/// Units that stand for the same quantity: name, quantity, factor to the quantity's SI unit.
const UNITS: [(&str, &str, f64); 22] = [
    ("m", "length", 1.0),
    ("cm", "length", 0.01),
    ("mm", "length", 0.001),
    ("rad", "angle", 1.0),
    ("deg", "angle", std::f64::consts::PI / 180.0),
    ("rad/s", "angular rate", 1.0),
    ("deg/s", "angular rate", std::f64::consts::PI / 180.0),
    ("rpm", "angular rate", std::f64::consts::PI / 30.0),
    ("m/s", "velocity", 1.0),
    ("m/s^2", "acceleration", 1.0),
    ("m/s^3", "jerk", 1.0),
    ("N", "force", 1.0),
    ("N*m", "torque", 1.0),
    ("V", "voltage", 1.0),
    ("A", "current", 1.0),
    ("T", "magnetic flux density", 1.0),
    ("Pa", "pressure", 1.0),
    ("hPa", "pressure", 100.0),
    ("s", "time", 1.0),
    ("ns", "time", 1e-9),
    ("1", "number", 1.0),
    ("count", "count", 1.0),
];

/// The factor that turns a number in `from` into one in `to`.
///
/// # Errors
/// If the units are not of one quantity.
pub fn conversion(from: &str, to: &str) -> Result<f64, String> {
    if from == to {
        return Ok(1.0);
    }
    let find = |unit: &str| UNITS.iter().find(|(name, ..)| *name == unit);
    match (find(from), find(to)) {
        (Some((_, quantity, a)), Some((_, other, b))) if quantity == other => Ok(a / b),
        (Some((_, quantity, _)), _) => {
            let fitting = UNITS.iter().filter(|(_, other, _)| other == quantity).map(|(name, ..)| *name);
            Err(format!(
                "`{to}` is not a unit of {quantity}; expected {}",
                fitting.collect::<Vec<_>>().join(" or ")
            ))
        }
        (None, _) => Err(format!("the field's unit is `{from}`, which cannot be converted to `{to}`")),
    }
}
