//! The voltages of the battery that flights have logged, and the parameters that they determine.

use flights::{Flight, MeasuredVoltage};
use plant::effects::{Effect, EffectKind};

/// Voltages of the battery that the flights of a set have logged.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct LoggedVoltage {
    /// The greatest in V; `None` if no flight has logged one.
    greatest_v: Option<f64>,
    /// True if all flights with commands have logged it.
    is_in_all: bool,
}

impl LoggedVoltage {
    /// The voltages of those of `flights` that have commands: without them no motor follows a voltage.
    pub fn of<'f>(flights: impl IntoIterator<Item = &'f Flight>) -> Self {
        let commanded = flights.into_iter().filter(|flight| !flight.command.is_empty());
        let greatest: Vec<Option<f64>> =
            commanded.map(|flight| MeasuredVoltage::of(flight).map(|voltage| voltage.greatest())).collect();
        let greatest_v = greatest.iter().flatten().copied().reduce(f64::max);
        Self { greatest_v, is_in_all: greatest.iter().all(Option::is_some) }
    }

    /// An effect that no file declares. If it follows a measured voltage, it does nothing at an exponent of 0.
    pub fn undeclared(&self, mut effect: Effect) -> Effect {
        if let Some((law, greatest_v)) = effect.kind.voltage_law.zip(self.greatest_v) {
            let spec = &effect.kind.parameters[law.nominal];
            effect.values[law.exponent] = 0.0;
            effect.values[law.nominal] = (law.full_V)(greatest_v).clamp(spec.min, spec.max);
        }
        effect
    }

    /// True if the parameter of `kind` at `index` is fitted to flights with these voltages. Where all have one, the exponent is fitted alone; where none
    /// has, it is the declared one.
    pub fn determines(&self, kind: &EffectKind, index: usize) -> bool {
        let Some(law) = kind.voltage_law else { return true };
        let is_exponent = index == law.exponent;
        if self.greatest_v.is_none() { !is_exponent } else { is_exponent || !self.is_in_all }
    }
}
