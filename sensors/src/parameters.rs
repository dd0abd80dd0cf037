//! Parameters, each declared once: with its documentation, its default and the values that it may have.

use crate::channel::Timing;
use diagnostics::parameter::{ParameterError, require};
use serde::de::DeserializeOwned;
use std::ops::RangeBounds;

/// Declares a table of parameters.
///
/// `name: type = default => check` is a field; a check such as [`positive`](diagnostics::parameter::positive) is asked for
/// each number of it. After `timed { rate_hz: …, delay_ms: … }` the table has the four parameters of [`Timing`] too.
macro_rules! parameters {
    (
        $(#[$meta:meta])*
        pub struct $name:ident timed { rate_hz: $rate_hz:expr, delay_ms: $delay_ms:expr } { $($fields:tt)* }
    ) => {
        parameters! {
            $(#[$meta])*
            pub struct $name {
                /// Measurements a second.
                rate_hz: f64 = $rate_hz,
                /// Time from a measurement to its arrival, ms.
                delay_ms: f64 = $delay_ms,
                /// Fraction of measurements that are lost.
                dropout: f64 = 0.0,
                /// Mean duration of losses, s; 0 where each is independent of the one before.
                dropout_mean_s: f64 = 0.0,
                $($fields)*
            }
        }

        impl $crate::parameters::Parameters for $name {
            fn timing(&self) -> $crate::channel::Timing {
                let Self { rate_hz, delay_ms, dropout, dropout_mean_s, .. } = *self;
                $crate::channel::Timing { rate_hz, delay_ms, dropout, dropout_mean_s }
            }

            fn validate(&self) -> Result<(), diagnostics::ParameterError> {
                Self::validate(self)
            }
        }
    };
    (
        $(#[$meta:meta])*
        pub struct $name:ident {
            $($(#[$field_meta:meta])* $field:ident: $type:ty = $default:expr $(=> $check:expr)?,)*
        }
    ) => {
        $(#[$meta])*
        #[derive(Debug, Clone, PartialEq, serde::Deserialize)]
        #[serde(default, deny_unknown_fields)]
        pub struct $name {
            $($(#[$field_meta])* pub $field: $type,)*
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $($field: $default,)* }
            }
        }

        impl $name {
            /// Refuses a parameter that is outside its range.
            pub(crate) fn validate(&self) -> Result<(), diagnostics::ParameterError> {
                use $crate::parameters::Numbers;
                $($(self.$field.check(&|value| $check(stringify!($field), value))?;)?)*
                Ok(())
            }
        }
    };
}

/// Parameters of a sensor, as the manifest's `parameters` table holds them.
pub trait Parameters: DeserializeOwned {
    /// Returns the times at which it measures, and the delays and losses of its measurements.
    fn timing(&self) -> Timing;

    /// Refuses a parameter that is outside its range.
    ///
    /// # Errors
    /// The first that is.
    fn validate(&self) -> Result<(), ParameterError>;
}

/// Numbers to check.
pub(crate) trait Numbers {
    /// Asks `check` for each.
    fn check(&self, check: &dyn Fn(f64) -> Result<(), ParameterError>) -> Result<(), ParameterError>;
}

impl Numbers for f64 {
    fn check(&self, check: &dyn Fn(f64) -> Result<(), ParameterError>) -> Result<(), ParameterError> {
        check(*self)
    }
}

impl Numbers for usize {
    fn check(&self, check: &dyn Fn(f64) -> Result<(), ParameterError>) -> Result<(), ParameterError> {
        check(*self as f64)
    }
}

impl<const N: usize> Numbers for [f64; N] {
    fn check(&self, check: &dyn Fn(f64) -> Result<(), ParameterError>) -> Result<(), ParameterError> {
        self.iter().try_for_each(|number| check(*number))
    }
}

impl<T: Numbers> Numbers for Option<T> {
    fn check(&self, check: &dyn Fn(f64) -> Result<(), ParameterError>) -> Result<(), ParameterError> {
        self.iter().try_for_each(|numbers| numbers.check(check))
    }
}

/// Passes a number in `range`, which `expected` describes.
pub(crate) fn within(
    range: impl RangeBounds<f64>,
    expected: &'static str,
) -> impl Fn(&str, f64) -> Result<(), ParameterError> {
    move |key, value| require(key, value, range.contains(&value), expected)
}
