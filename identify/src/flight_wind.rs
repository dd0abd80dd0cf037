//! One wind for each flight: an effect of a set of flights, not of the vehicle.
//!
//! The effect `wind` of the catalogue is then the mean over the fit flights. Each of them has a deviation from it; the first has the negative sum of
//! the others, so that the deviations sum to zero. Deviations of zero are one wind for all flights. A flight without a number of its own, such as a
//! test flight, has the mean.

use crate::candidate::has;
use crate::fit::Problem;
use crate::prepared::Prepared;
use diagnostics::unit::WIND_VELOCITY;
use plant::effect_parameters;
use plant::effects::{EffectKind, Quantity};

/// A flight has a wind of its own from so many blocks of time on: its three numbers are known by these alone; tuned, no source.
const LEAST_BLOCKS: usize = 10;

/// The deviation of a flight's wind from the mean.
pub static FLIGHT_WIND: EffectKind = EffectKind {
    name: "flight-wind",
    summary: "each flight has a wind of its own",
    equation: "v_air += (x, y, z) in the world, with other values in each flight",
    source: "own (a definition)",
    validity: "constant over a flight",
    parameters: Deviation::SPECS,
    needs: &[Quantity::Airspeed, Quantity::Force],
    ..EffectKind::PLAIN
};

effect_parameters! {
    struct Deviation {
        /// velocity of the air along x of the world
        x: WIND_VELOCITY, min: -30.0, max: 30.0, neutral: Some(0.0), nominal: 3.0, source: "that of `wind`";
        /// velocity of the air along y of the world
        y: WIND_VELOCITY, min: -30.0, max: 30.0, neutral: Some(0.0), nominal: 3.0, source: "that of `wind`";
        /// velocity of the air along z of the world
        z: WIND_VELOCITY, min: -30.0, max: 30.0, neutral: Some(0.0), nominal: 0.2, source: "that of `wind`";
    }
}

impl Problem<'_> {
    /// Numbers the fit flights that can show a wind of their own, and adds the parameters of these winds. Nothing changes where there are less
    /// than two such flights, or flights that effects are chosen on: no fit knows the winds of these.
    pub fn number_flights(&mut self) {
        let shows: Vec<bool> = self.estimation.iter().map(|flight| self.shows_wind(flight)).collect();
        let count = shows.iter().filter(|shows| **shows).count();
        if count < 2 || !self.validation.is_empty() {
            return;
        }
        let shown = self.estimation.iter_mut().zip(shows).filter(|(_, shows)| *shows);
        shown.enumerate().for_each(|(number, (flight, _))| flight.number = Some(number));
        self.model.parameters.add_winds(&self.model.vehicle, count);
    }

    fn shows_wind(&self, flight: &Prepared) -> bool {
        let is_measured = FLIGHT_WIND.needs.iter().all(|need| has(flight, *need));
        is_measured && !flight.is_assumed() && self.block_knots(flight).len() >= LEAST_BLOCKS
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Model;
    use crate::parameter::Parameters;
    use crate::prepared::Propulsion;
    use crate::test_flights::{flown, hummingbird};
    use crate::whitening::Noises;
    use flights::Flight;

    fn flight(phase: f64) -> Flight {
        flown(
            [12.0, 0.01],
            |t| [2.0 * libm::sin(1.3 * t + phase), 1.5 * libm::cos(0.9 * t), 2.0],
            |t| [0.3 * libm::sin(2.1 * t), 0.2 * libm::cos(1.7 * t + phase), 0.1 * t],
        )
    }

    /// Three fit flights and one for test, with rotor drag.
    fn problem(flights: &[Flight]) -> Problem<'_> {
        let vehicle = hummingbird();
        let propulsion = Propulsion::of(&vehicle);
        let mut prepared: Vec<Prepared> = flights
            .iter()
            .map(|flight| Prepared::new(flight, None, &propulsion).expect("a usable flight"))
            .collect();
        let test = prepared.split_off(3);
        let drag = plant::effects::find("rotor-drag").expect("an effect").nominal();
        let mut problem = Problem {
            model: Model { parameters: Parameters::of(&vehicle, &[drag]), vehicle },
            estimation: prepared,
            validation: Vec::new(),
            test,
            noises: Noises::new(),
            block_s: 1.0,
            shared_late_s: 0.0,
        };
        problem.number_flights();
        problem
    }

    fn flights() -> Vec<Flight> {
        [0.0, 0.5, 1.0, 1.5].into_iter().map(flight).collect()
    }

    #[test]
    fn deviations_of_the_winds_sum_to_zero_and_a_test_flight_has_the_mean() {
        let flights = flights();
        let problem = problem(&flights);
        let parameters = &problem.model.parameters;
        let mut values = parameters.baseline();
        values[parameters.wind()[0]] = 4.0;
        let deviations = parameters.of_name("flight-wind");
        assert_eq!(deviations.len(), 2 * 3);
        values[deviations[0]] = 1.0;
        values[deviations[3]] = 2.0;
        let wind = |flight: &Prepared| {
            let effects = parameters.effects_of(flight.number, &values);
            effects.iter().find(|effect| effect.kind.name == "wind").map(|effect| effect.values[0])
        };
        let found: Vec<_> = problem.flights().map(wind).collect();
        assert_eq!(found, [Some(1.0), Some(5.0), Some(6.0), Some(4.0)]);
    }

    /// They are taken from those by the common wind, without a simulation of their own.
    #[test]
    fn derivatives_by_the_wind_of_a_flight_are_those_of_the_whole_model() {
        let flights = flights();
        let problem = problem(&flights);
        let (model, mut values) = (&problem.model, problem.model.parameters.baseline());
        let deviations = model.parameters.of_name("flight-wind");
        let free = [model.parameters.wind(), deviations.clone()].concat();
        values[deviations[0]] = 2.0;
        let norm = |rows: &[f64]| rows.iter().map(|row| row * row).sum::<f64>().sqrt();
        for flight in problem.flights() {
            let (residual, columns) = model.linearised(flight, &values, &free);
            for (at, column) in free.iter().zip(&columns) {
                let mut moved = values.clone();
                moved[*at] += 0.01;
                let moved = model.residual_under(flight, &moved);
                let apart: Vec<f64> = moved
                    .iter()
                    .zip(&residual)
                    .zip(column)
                    .map(|((a, b), slope)| (a - b) / 0.01 - slope)
                    .collect();
                assert!(
                    norm(&apart) < 1e-6 * (1.0 + norm(column)),
                    "{at}: {} of {}",
                    norm(&apart),
                    norm(column)
                );
            }
            let shown = columns.iter().filter(|column| norm(column) > 0.0).count();
            let expected = match flight.number {
                None => 3,
                Some(0) => 9,
                Some(_) => 6,
            };
            assert!(shown <= expected && shown + 3 >= expected, "{shown}, expected {expected}");
        }
    }

    /// Too short a flight has the mean wind, and flights that effects are chosen on would have to be fitted.
    #[test]
    fn only_flights_that_can_show_a_wind_have_one() {
        let flights = flights();
        let mut problem = problem(&flights);
        let numbers = |problem: &Problem| problem.flights().map(|flight| flight.number).collect::<Vec<_>>();
        assert_eq!(numbers(&problem), [Some(0), Some(1), Some(2), None]);
        problem.block_s = 5.0;
        problem.estimation.iter_mut().for_each(|flight| flight.number = None);
        problem.number_flights();
        assert_eq!(numbers(&problem), [None; 4], "three blocks a flight");
        problem.block_s = 1.0;
        problem.validation = problem.estimation.split_off(2);
        problem.number_flights();
        assert_eq!(numbers(&problem), [None; 4], "a flight to choose on");
    }
}
