//! Parameters that sensors share: the times of measurements, their delays and losses.

use crate::channel::Timing;
use component::Parameters;

/// Declares parameters with the four of [`Timing`] first: `struct Name timed { rate_hz: …, delay_ms: … } { fields }`. The fields are those
/// of a struct that derives [`Parameters`].
macro_rules! timed_parameters {
    (
        $(#[$meta:meta])*
        pub struct $name:ident timed { rate_hz: $rate_hz:expr, delay_ms: $delay_ms:expr } { $($fields:tt)* }
    ) => {
        $(#[$meta])*
        #[derive(Debug, Clone, PartialEq, component::Parameters)]
        #[parameters(default)]
        pub struct $name {
            /// Measurements a second.
            #[parameter(default = $rate_hz, check = diagnostics::parameter::positive)]
            pub rate_hz: f64,
            /// Time from a measurement to its arrival; at most 10,000 measurements are under way.
            #[parameter(default = $delay_ms, check = diagnostics::parameter::not_negative)]
            pub delay_ms: f64,
            /// Fraction of the measurements that are lost.
            #[parameter(default = 0.0, range = "0 to below 1", check = crate::channel::fraction_lost)]
            pub dropout: f64,
            /// Mean duration of losses; 0: each is independent of the one before.
            #[parameter(default = 0.0, check = diagnostics::parameter::not_negative)]
            pub dropout_mean_s: f64,
            $($fields)*
        }

        impl $crate::parameters::Timed for $name {
            fn timing(&self) -> $crate::channel::Timing {
                let Self { rate_hz, delay_ms, dropout, dropout_mean_s, .. } = *self;
                $crate::channel::Timing { rate_hz, delay_ms, dropout, dropout_mean_s }
            }
        }
    };
}

/// Parameters of a sensor, as the manifest's `parameters` table holds them.
pub trait Timed: Parameters {
    /// Returns the times at which it measures, and the delays and losses of its measurements.
    fn timing(&self) -> Timing;
}
