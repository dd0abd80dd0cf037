//! Parameters by name: a specification for files, and a struct for equations.

/// Specifies the parameters of an effect, and a struct that holds their values by name.
///
/// ```
/// use plant::effects::{ParameterSpec, Values};
/// use diagnostics::unit::LENGTH;
///
/// plant::effect_parameters! {
///     /// An offset.
///     struct Offset {
///         /// x: how far it is in front
///         ahead: LENGTH, min: -0.1, max: 0.1, neutral: Some(0.0), nominal: 0.005, source: "tuned, no source";
///     }
/// }
///
/// let specs: &[ParameterSpec] = Offset::SPECS;
/// assert_eq!((specs[0].name, specs[0].unit()), ("ahead", "m"));
/// let mut values = Values::default();
/// values[0] = 0.02;
/// assert_eq!(Offset::from(&values).ahead, 0.02);
/// ```
#[macro_export]
macro_rules! effect_parameters {
    ($(#[$doc:meta])* struct $View:ident { $(
        $(#[doc = $meaning:literal])+
        $name:ident: $dimension:ident, min: $min:expr, max: $max:expr, neutral: $neutral:expr, nominal: $nominal:expr,
        source: $source:expr;
    )* }) => {
        $(#[$doc])*
        struct $View { $($name: f64),* }

        impl $View {
            const SPECS: &'static [$crate::effects::ParameterSpec] = &[
                $($crate::effects::ParameterSpec {
                    name: stringify!($name),
                    meaning: concat!($($meaning),+).trim_ascii_start(),
                    dimension: $dimension,
                    min: $min,
                    max: $max,
                    neutral: $neutral,
                    nominal: $nominal,
                    nominal_source: $source,
                }),*
            ];
        }

        impl From<&$crate::effects::Values> for $View {
            fn from(&[$($name,)* ..]: &$crate::effects::Values) -> Self {
                Self { $($name),* }
            }
        }

        impl From<$View> for $crate::effects::Values {
            fn from(view: $View) -> Self {
                let mut values = Self::default();
                values.iter_mut().zip([$(view.$name),*]).for_each(|(value, named)| *value = named);
                values
            }
        }
    };
}
