//! Values of variables, in the types of the standard.

/// Type of a variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ValueType {
    /// `Real` of FMI 2.0, `Float64` of 3.0.
    Float64,
    /// `Float32`.
    Float32,
    /// `Int64`, and `Enumeration` of 3.0.
    Int64,
    /// `Integer` and `Enumeration` of 2.0, `Int32` of 3.0.
    Int32,
    /// `Int16`.
    Int16,
    /// `Int8`.
    Int8,
    /// `UInt64`.
    UInt64,
    /// `UInt32`.
    UInt32,
    /// `UInt16`.
    UInt16,
    /// `UInt8`.
    UInt8,
    /// `Boolean`.
    Boolean,
    /// `String`.
    String,
}

/// A number, as a message and a variable exchange it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Number {
    /// With a point.
    Float(f64),
    /// Without; every integer of either side fits.
    Integer(i128),
}

/// Values of variables of one type, as its functions of the standard take them.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// Values of `Float64`.
    Float64(Vec<f64>),
    /// Values of `Float32`.
    Float32(Vec<f32>),
    /// Values of `Int64`.
    Int64(Vec<i64>),
    /// Values of `Int32`.
    Int32(Vec<i32>),
    /// Values of `Int16`.
    Int16(Vec<i16>),
    /// Values of `Int8`.
    Int8(Vec<i8>),
    /// Values of `UInt64`.
    UInt64(Vec<u64>),
    /// Values of `UInt32`.
    UInt32(Vec<u32>),
    /// Values of `UInt16`.
    UInt16(Vec<u16>),
    /// Values of `UInt8`.
    UInt8(Vec<u8>),
    /// Values of `Boolean` in FMI 3.0, of C's `bool`: a byte, whatever the FMU writes into it.
    Boolean(Vec<u8>),
    /// Values of `Boolean` in FMI 2.0, whose booleans are C's `int`.
    Boolean32(Vec<i32>),
}

impl Number {
    /// The nearest double.
    pub fn float(self) -> f64 {
        match self {
            Self::Float(number) => number,
            Self::Integer(number) => number as f64,
        }
    }

    /// The integer, if it is one: `1.0` is, `0.5` and NaN are not.
    pub fn integer<T: TryFrom<i128>>(self) -> Option<T> {
        let integer = match self {
            Self::Integer(number) => number,
            // Within ±2^64, beyond which no integer of a variable is.
            Self::Float(number) if fraction(number) == 0.0 && number.abs() < 2e19 => number as i128,
            Self::Float(_) => return None,
        };
        T::try_from(integer).ok()
    }

    fn boolean(self) -> Option<bool> {
        match self.integer::<i64>()? {
            0 => Some(false),
            1 => Some(true),
            _ => None,
        }
    }
}

impl std::fmt::Display for Number {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Float(number) => write!(f, "{number}"),
            Self::Integer(number) => write!(f, "{number}"),
        }
    }
}

/// Part behind the point; NaN of what is not finite.
fn fraction(number: f64) -> f64 {
    number % 1.0
}

impl Values {
    /// `count` zeros; `None` for strings, which no message holds.
    pub fn zeros(value_type: ValueType, count: usize, is_fmi2: bool) -> Option<Self> {
        Some(match value_type {
            ValueType::Float64 => Self::Float64(vec![0.0; count]),
            ValueType::Float32 => Self::Float32(vec![0.0; count]),
            ValueType::Int64 => Self::Int64(vec![0; count]),
            ValueType::Int32 => Self::Int32(vec![0; count]),
            ValueType::Int16 => Self::Int16(vec![0; count]),
            ValueType::Int8 => Self::Int8(vec![0; count]),
            ValueType::UInt64 => Self::UInt64(vec![0; count]),
            ValueType::UInt32 => Self::UInt32(vec![0; count]),
            ValueType::UInt16 => Self::UInt16(vec![0; count]),
            ValueType::UInt8 => Self::UInt8(vec![0; count]),
            ValueType::Boolean if is_fmi2 => Self::Boolean32(vec![0; count]),
            ValueType::Boolean => Self::Boolean(vec![0; count]),
            ValueType::String => return None,
        })
    }

    /// Number of values.
    pub fn len(&self) -> usize {
        match self {
            Self::Float64(values) => values.len(),
            Self::Float32(values) => values.len(),
            Self::Int64(values) => values.len(),
            Self::Int32(values) | Self::Boolean32(values) => values.len(),
            Self::Int16(values) => values.len(),
            Self::Int8(values) => values.len(),
            Self::UInt64(values) => values.len(),
            Self::UInt32(values) => values.len(),
            Self::UInt16(values) => values.len(),
            Self::UInt8(values) => values.len(),
            Self::Boolean(values) => values.len(),
        }
    }

    /// The value at `index`.
    pub fn get(&self, index: usize) -> Number {
        match self {
            Self::Float64(values) => Number::Float(values[index]),
            Self::Float32(values) => Number::Float(values[index].into()),
            Self::Int64(values) => Number::Integer(values[index].into()),
            Self::Int32(values) => Number::Integer(values[index].into()),
            Self::Int16(values) => Number::Integer(values[index].into()),
            Self::Int8(values) => Number::Integer(values[index].into()),
            Self::UInt64(values) => Number::Integer(values[index].into()),
            Self::UInt32(values) => Number::Integer(values[index].into()),
            Self::UInt16(values) => Number::Integer(values[index].into()),
            Self::UInt8(values) => Number::Integer(values[index].into()),
            Self::Boolean(values) => Number::Integer(i128::from(values[index] != 0)),
            Self::Boolean32(values) => Number::Integer(i128::from(values[index] != 0)),
        }
    }

    /// Makes `number` the value at `index`; `None` if this type does not hold it.
    pub fn set(&mut self, index: usize, number: Number) -> Option<()> {
        match self {
            Self::Float64(values) => values[index] = number.float(),
            Self::Float32(values) => values[index] = number.float() as f32,
            Self::Int64(values) => values[index] = number.integer()?,
            Self::Int32(values) => values[index] = number.integer()?,
            Self::Int16(values) => values[index] = number.integer()?,
            Self::Int8(values) => values[index] = number.integer()?,
            Self::UInt64(values) => values[index] = number.integer()?,
            Self::UInt32(values) => values[index] = number.integer()?,
            Self::UInt16(values) => values[index] = number.integer()?,
            Self::UInt8(values) => values[index] = number.integer()?,
            Self::Boolean(values) => values[index] = number.boolean()?.into(),
            Self::Boolean32(values) => values[index] = number.boolean()?.into(),
        }
        Some(())
    }

    /// The name of the type, for messages.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Float64(_) => "a double",
            Self::Float32(_) => "a float",
            Self::Int64(_) => "a signed 64-bit integer",
            Self::Int32(_) => "a signed 32-bit integer",
            Self::Int16(_) => "a signed 16-bit integer",
            Self::Int8(_) => "a signed 8-bit integer",
            Self::UInt64(_) => "an unsigned 64-bit integer",
            Self::UInt32(_) => "an unsigned 32-bit integer",
            Self::UInt16(_) => "an unsigned 16-bit integer",
            Self::UInt8(_) => "an unsigned 8-bit integer",
            Self::Boolean(_) | Self::Boolean32(_) => "a boolean",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Number, ValueType, Values};

    #[test]
    fn a_number_goes_where_it_fits_and_comes_back() {
        let mut bytes = Values::zeros(ValueType::UInt8, 2, false).unwrap();
        assert_eq!(bytes.set(1, Number::Float(255.0)), Some(()));
        assert_eq!(bytes.get(1), Number::Integer(255));
        for no_byte in
            [Number::Float(0.5), Number::Float(f64::NAN), Number::Integer(256), Number::Integer(-1)]
        {
            assert_eq!(bytes.set(0, no_byte), None, "{no_byte}");
        }
        let mut truth = Values::zeros(ValueType::Boolean, 1, true).unwrap();
        assert_eq!((truth.set(0, Number::Integer(1)), truth.get(0)), (Some(()), Number::Integer(1)));
        assert_eq!(truth.set(0, Number::Integer(2)), None);
        let mut large = Values::zeros(ValueType::UInt64, 1, false).unwrap();
        large.set(0, Number::Integer(u64::MAX.into())).unwrap();
        assert_eq!(large.get(0), Number::Integer(u64::MAX.into()), "not by way of a double");
        assert_eq!(Values::zeros(ValueType::String, 1, true), None);
    }
}
