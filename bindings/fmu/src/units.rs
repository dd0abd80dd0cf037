//! Units of variables, which an FMU defines by base units, against the units of fields.
//!
//! `rad` counts as a number, as in SI: some tools write it, others do not.

/// Exponents of kg, m, s, A, K, mol and cd.
type Exponents = [i32; 7];

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
const SYMBOLS: [(&str, Exponents); 12] = [
    ("1", [0; 7]),
    ("rad", [0; 7]),
    ("count", [0; 7]),
    ("m", [0, 1, 0, 0, 0, 0, 0]),
    ("s", [0, 0, 1, 0, 0, 0, 0]),
    ("kg", [1, 0, 0, 0, 0, 0, 0]),
    ("A", [0, 0, 0, 1, 0, 0, 0]),
    ("K", [0, 0, 0, 0, 1, 0, 0]),
    ("N", [1, 1, -2, 0, 0, 0, 0]),
    ("Pa", [1, -1, -2, 0, 0, 0, 0]),
    ("V", [1, 2, -3, -1, 0, 0, 0]),
    ("T", [1, 0, -2, -1, 0, 0, 0]),
];

/// The unit of a field, such as `m/s^2` or `N*m`; `None` if it has another symbol.
pub fn of_field(text: &str) -> Option<BaseUnit> {
    if text == "ns" {
        return Some(BaseUnit { exponents: [0, 0, 1, 0, 0, 0, 0], factor: 1e-9, offset: 0.0 });
    }
    let mut exponents = [0; 7];
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
/// unit of a field that has no counterpart among base units, are compared by name.
///
/// # Errors
/// They are of different quantities, in words.
pub fn conversion(unit: &str, name: &str, defined: Option<BaseUnit>) -> Result<Conversion, String> {
    let differ = || format!("is in `{name}`, and the field is in `{unit}`");
    if unit == name {
        return Ok(Conversion::NONE);
    }
    let (Some(field), Some(variable)) = (of_field(unit), defined) else { return Err(differ()) };
    if field.exponents != variable.exponents || variable.factor == 0.0 {
        return Err(differ());
    }
    Ok(Conversion { factor: field.factor / variable.factor, offset: -variable.offset / variable.factor })
}

#[cfg(test)]
mod tests {
    use super::{BaseUnit, Conversion, conversion};

    fn unit(exponents: [i32; 7], factor: f64) -> Option<BaseUnit> {
        Some(BaseUnit { exponents, factor, offset: 0.0 })
    }

    #[test]
    fn units_of_one_quantity_are_converted_and_others_are_refused() {
        let acceleration = [0, 1, -2, 0, 0, 0, 0];
        assert_eq!(conversion("m/s^2", "m.s-2", unit(acceleration, 1.0)), Ok(Conversion::NONE));
        let degrees =
            conversion("rad/s", "deg/s", unit([0, 0, -1, 0, 0, 0, 0], 0.017453292519943295)).unwrap();
        assert!((degrees.to_variable(1.0) - 57.29577951308232).abs() < 1e-12);
        assert!((degrees.to_field(degrees.to_variable(0.3)) - 0.3).abs() < 1e-15);
        assert_eq!(conversion("N*m", "N.m", unit([1, 2, -2, 0, 0, 0, 0], 1.0)), Ok(Conversion::NONE));
        assert!(conversion("ns", "s", unit([0, 0, 1, 0, 0, 0, 0], 1.0)).unwrap().factor == 1e-9);
        let celsius = Some(BaseUnit { exponents: [0, 0, 0, 0, 1, 0, 0], factor: 1.0, offset: 273.15 });
        assert!((conversion("K", "degC", celsius).unwrap().to_variable(300.0) - 26.85).abs() < 1e-12);
        let refused = conversion("m", "m/s", unit([0, 1, -1, 0, 0, 0, 0], 1.0)).unwrap_err();
        assert_eq!(refused, "is in `m/s`, and the field is in `m`");
        assert!(conversion("m", "furlong", None).is_err(), "nothing says how long one is");
        assert_eq!(conversion("m", "m", None), Ok(Conversion::NONE));
    }
}
