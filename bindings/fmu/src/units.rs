//! Units of variables, which an FMU defines by base units, against the units of fields.
//!
//! Some tools write `rad` as a base unit, as the standard has it, and others leave it out: rad/s and 1/s are the same where both have
//! the factor 1 and neither counts turns.

/// Base units, in the order of their exponents.
pub const BASE_UNITS: [&str; 8] = ["kg", "m", "s", "A", "K", "mol", "cd", "rad"];
/// Exponents of the base units.
type Exponents = [i32; 8];
/// Place of rad among them.
const RAD: usize = 7;

/// A unit: `value in SI = factor · value + offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BaseUnit {
    /// Exponents of the base units.
    pub exponents: Exponents,
    /// Factor to SI.
    pub factor: f64,
    /// Offset to SI.
    pub offset: f64,
}

/// Conversion of a number of a message into one of a variable: `factor · number + offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conversion {
    /// Factor.
    pub factor: f64,
    /// Offset.
    pub offset: f64,
}

impl Conversion {
    /// Leaves a number as it is, bit for bit.
    pub const NONE: Self = Self { factor: 1.0, offset: 0.0 };

    /// True if it leaves numbers as they are.
    pub fn is_none(self) -> bool {
        self == Self::NONE
    }

    /// A number of a message in the variable's unit.
    pub fn to_variable(self, number: f64) -> f64 {
        if self.is_none() { number } else { self.factor * number + self.offset }
    }

    /// A number of a variable in the field's unit.
    pub fn to_field(self, number: f64) -> f64 {
        if self.is_none() { number } else { (number - self.offset) / self.factor }
    }
}

/// Symbols in the units of messages, with exponents and factor.
const SYMBOLS: [(&str, Exponents); 11] = [
    ("1", [0; 8]),
    ("rad", [0, 0, 0, 0, 0, 0, 0, 1]),
    ("m", [0, 1, 0, 0, 0, 0, 0, 0]),
    ("s", [0, 0, 1, 0, 0, 0, 0, 0]),
    ("kg", [1, 0, 0, 0, 0, 0, 0, 0]),
    ("A", [0, 0, 0, 1, 0, 0, 0, 0]),
    ("K", [0, 0, 0, 0, 1, 0, 0, 0]),
    ("N", [1, 1, -2, 0, 0, 0, 0, 0]),
    ("Pa", [1, -1, -2, 0, 0, 0, 0, 0]),
    ("V", [1, 2, -3, -1, 0, 0, 0, 0]),
    ("T", [1, 0, -2, -1, 0, 0, 0, 0]),
];

/// The unit of a field, such as `m/s^2` or `N*m`; `None` if it has another symbol.
pub fn of_field(text: &str) -> Option<BaseUnit> {
    if text == "ns" {
        return Some(BaseUnit { exponents: [0, 0, 1, 0, 0, 0, 0, 0], factor: 1e-9, offset: 0.0 });
    }
    let mut exponents = [0; 8];
    for (place, quotient) in text.split('/').enumerate() {
        let sign = if place == 0 { 1 } else { -1 };
        for factor in quotient.split('*') {
            let (symbol, power) = factor.split_once('^').unwrap_or((factor, "1"));
            let (_, of_symbol) = SYMBOLS.iter().find(|(known, _)| *known == symbol)?;
            let power: i32 = power.parse().ok()?;
            for (sum, exponent) in exponents.iter_mut().zip(of_symbol) {
                *sum += sign * power * exponent;
            }
        }
    }
    Some(BaseUnit { exponents, factor: 1.0, offset: 0.0 })
}

/// Conversion between the field's `unit` and the variable's, which is called `name`. A unit without a definition, and the
/// unit of a field that has no counterpart among base units, such as counts, are compared by name.
///
/// # Errors
/// They are of different quantities, in words.
pub fn conversion(unit: &str, name: &str, defined: Option<BaseUnit>) -> Result<Conversion, String> {
    let differ = || format!("is in `{name}`, and the field is in `{unit}`");
    let (Some(field), Some(variable)) = (of_field(unit), defined) else {
        return if unit == name { Ok(Conversion::NONE) } else { Err(differ()) };
    };
    let is_same = field.exponents[..RAD] == variable.exponents[..RAD] && variable.factor != 0.0;
    let is_left_out = variable.exponents[RAD] == 0 && variable.factor == 1.0 && !counts_turns(name);
    if !is_same || (field.exponents[RAD] != variable.exponents[RAD] && !is_left_out) {
        return Err(differ());
    }
    Ok(Conversion { factor: field.factor / variable.factor, offset: -variable.offset / variable.factor })
}

/// True for units such as Hz and rev/s.
fn counts_turns(name: &str) -> bool {
    ["hz", "rev", "turn", "cycle", "r/"].iter().any(|word| name.to_lowercase().contains(word))
}

#[cfg(test)]
mod tests {
    use super::{BaseUnit, Conversion, conversion};

    fn unit(exponents: [i32; 8], factor: f64) -> Option<BaseUnit> {
        Some(BaseUnit { exponents, factor, offset: 0.0 })
    }

    #[test]
    fn units_of_one_quantity_are_converted_and_others_are_refused() {
        let acceleration = [0, 1, -2, 0, 0, 0, 0, 0];
        assert_eq!(conversion("m/s^2", "m.s-2", unit(acceleration, 1.0)), Ok(Conversion::NONE));
        let degrees =
            conversion("rad/s", "deg/s", unit([0, 0, -1, 0, 0, 0, 0, 1], 0.017453292519943295)).unwrap();
        assert!((degrees.to_variable(1.0) - 57.29577951308232).abs() < 1e-12);
        assert!((degrees.to_field(degrees.to_variable(0.3)) - 0.3).abs() < 1e-15);
        assert_eq!(conversion("N*m", "N.m", unit([1, 2, -2, 0, 0, 0, 0, 0], 1.0)), Ok(Conversion::NONE));
        assert!(conversion("ns", "s", unit([0, 0, 1, 0, 0, 0, 0, 0], 1.0)).unwrap().factor == 1e-9);
        let celsius = Some(BaseUnit { exponents: [0, 0, 0, 0, 1, 0, 0, 0], factor: 1.0, offset: 273.15 });
        assert!((conversion("K", "degC", celsius).unwrap().to_variable(300.0) - 26.85).abs() < 1e-12);
        let refused = conversion("m", "m/s", unit([0, 1, -1, 0, 0, 0, 0, 0], 1.0)).unwrap_err();
        assert_eq!(refused, "is in `m/s`, and the field is in `m`");
        let per_second = [0, 0, -1, 0, 0, 0, 0, 0];
        assert_eq!(
            conversion("rad/s", "1/s", unit(per_second, 1.0)),
            Ok(Conversion::NONE),
            "rad is left out"
        );
        assert!(conversion("rad/s", "Hz", unit(per_second, 1.0)).is_err(), "turns");
        assert!(
            conversion("1", "deg", unit([0, 0, 0, 0, 0, 0, 0, 1], 0.0175)).is_err(),
            "an angle is no number"
        );
        assert!(conversion("count", "%", unit([0; 8], 0.01)).is_err(), "counts are no numbers");
        assert_eq!(conversion("count", "count", unit([0; 8], 1.0)), Ok(Conversion::NONE));
        assert!(
            conversion("m", "m", unit([0, 1, 0, 0, 0, 0, 0, 0], 0.3048)).unwrap().factor > 3.0,
            "its own definition holds"
        );
        assert!(conversion("m", "furlong", None).is_err(), "nothing says how long one is");
        assert_eq!(conversion("m", "m", None), Ok(Conversion::NONE));
    }
}
