//! Tables of multi-step prediction errors, for people and for programs.

use super::labels::labels;
use crate::cells::Cells;
use anyhow::Context;
use diagnostics::Error;
use flights::state::StateQuantity;
use flights::{Flight, FlightSet, Role};
use identify::steps_ahead::{self, Between, StepsAhead};
use plant::Airframe;
use serde_json::{Value, json};
use std::fmt;
use std::path::Path;
use vehicles::Vehicle;

/// Errors of one or two vehicles and of persistence on all flights; its text is a table.
#[derive(Debug, Default)]
pub struct StepsAheadErrors {
    /// Names of the vehicles.
    pub vehicles: Vec<String>,
    /// The flights, in the order of the flights file.
    pub flights: Vec<FlightSteps>,
}

/// The errors on one flight.
#[derive(Debug)]
pub struct FlightSteps {
    /// The flight's name.
    pub name: String,
    /// Role of the flight.
    pub role: Role,
    /// Quantities that the flight shows.
    pub quantities: Vec<StateQuantity>,
    /// The errors of each vehicle.
    pub errors: Vec<StepsAhead>,
}

impl FlightSteps {
    /// The `errors` of each vehicle on `flight`.
    #[must_use]
    pub fn of(flight: &Flight, errors: Vec<StepsAhead>) -> Self {
        let quantities =
            StateQuantity::ALL.into_iter().filter(|quantity| quantity.is_measured(flight)).collect();
        Self { name: flight.name.clone(), role: flight.role, quantities, errors }
    }

    /// The quantity's errors after 1, 2, … samples: of each vehicle, and of persistence last.
    fn columns(&self, quantity: StateQuantity) -> Vec<Vec<f64>> {
        let at = StateQuantity::ALL.iter().position(|of| *of == quantity).unwrap_or(0);
        let of = |steps: &[[f64; 4]]| steps.iter().map(|errors| errors[at]).collect();
        let models = self.errors.iter().map(|errors| of(&errors.model));
        models.chain(self.errors.first().map(|errors| of(&errors.persistence))).collect()
    }

    fn json(&self, names: &[String]) -> Value {
        let first = &self.errors[0];
        let mut value = json!({ "role": self.role, "windows": first.windows, "left_out": first.left_out, "period_s": first.period_s });
        for quantity in &self.quantities {
            let entry = &mut value[quantity.name()];
            entry["unit"] = json!(quantity.unit());
            for (name, errors) in names.iter().zip(self.columns(*quantity)) {
                entry[name.as_str()] = json!(errors);
            }
        }
        value
    }
}

impl StepsAheadErrors {
    /// Predicts `steps` samples ahead of every sample of the `flights` with each of `vehicles`, with the effects of their files.
    ///
    /// # Errors
    /// A vehicle file that cannot be read, a flight without the data that a prediction needs.
    pub fn of(
        vehicles: &[&Path],
        flights: &FlightSet,
        steps: usize,
        between: Between,
    ) -> Result<Self, Error> {
        let airframes = vehicles
            .iter()
            .map(|vehicle| Ok(Airframe::from_files(Vehicle::load_from(&flights.files, vehicle)?, &[])?))
            .collect::<anyhow::Result<Vec<_>>>()?;
        let of_flight = |flight: &Flight| {
            let errors =
                airframes.iter().map(|airframe| steps_ahead::errors(flight, airframe, steps, between));
            let errors = errors
                .collect::<Result<Vec<_>, _>>()
                .map_err(anyhow::Error::msg)
                .with_context(|| format!("the flight `{}` cannot be predicted", flight.name))?;
            Ok(FlightSteps::of(flight, errors))
        };
        let flights = flights.flights.iter().map(of_flight).collect::<anyhow::Result<Vec<_>>>()?;
        Ok(Self { vehicles: labels(vehicles), flights })
    }

    fn names(&self) -> Vec<String> {
        self.vehicles.iter().cloned().chain(["persistence".to_owned()]).collect()
    }

    /// The errors by the flights' names: a list by the number of samples ahead for each quantity and vehicle.
    #[must_use]
    pub fn json(&self) -> Value {
        let names = self.names();
        let flights = self.flights.iter().map(|flight| (flight.name.clone(), flight.json(&names)));
        json!({ "flights": flights.collect::<serde_json::Map<_, _>>() })
    }

    fn cells(&self) -> Cells {
        let first = ["flight", "role", "windows", "channel", "after"].map(str::to_owned);
        let headings: Vec<String> = first.into_iter().chain(self.names()).collect();
        let is_number = (0..headings.len()).map(|column| !matches!(column, 0 | 1 | 3)).collect();
        Cells { headings, is_number, rows: self.flights.iter().flat_map(rows).collect() }
    }
}

/// For each quantity a row after the first sample, after a fifth of them and after all, and one with the sum over several.
fn rows(flight: &FlightSteps) -> Vec<Vec<String>> {
    let (first, steps) = (&flight.errors[0], flight.errors[0].model.len());
    let mut shown = vec![1, steps.div_ceil(5), steps];
    shown.dedup();
    let row = |quantity: StateQuantity, after: String, of: &dyn Fn(&[f64]) -> f64| {
        let channel = format!("{} ({})", quantity.name(), quantity.unit());
        let cells =
            [flight.name.clone(), flight.role.name().to_owned(), first.windows.to_string(), channel, after];
        cells
            .into_iter()
            .chain(flight.columns(quantity).iter().map(|errors| format!("{:.4}", of(errors))))
            .collect()
    };
    let of_quantity = |quantity: &StateQuantity| {
        let at = shown.iter().map(|step| {
            row(*quantity, format!("{:.3} s", *step as f64 * first.period_s), &|errors| errors[step - 1])
        });
        let sum = (steps > 1).then(|| row(*quantity, "sum".to_owned(), &|errors| errors.iter().sum()));
        at.chain(sum).collect::<Vec<_>>()
    };
    flight.quantities.iter().flat_map(of_quantity).collect()
}

impl fmt::Display for StepsAheadErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.cells())
    }
}
