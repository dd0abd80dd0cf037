//! Quantities of a vehicle's motion at the knots of its flight, to plot residuals against.

use crate::data::prepared::Prepared;
use crate::data::track::Track;
use crate::model::physics::Model;
use nalgebra::Vector3;

/// A quantity at the knots of a flight.
#[derive(Debug, Clone)]
pub struct Regressor {
    /// Its name.
    pub name: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// Its values, by knot.
    pub values: Vec<f64>,
}

/// A quantity's name, its unit, and its value at an instant of the grid.
type Named<'a> = (&'static str, &'static str, &'a dyn Fn(usize) -> f64);

/// The quantities that residuals are looked at against, as far as `flight` has them: those that never change are left
/// out.
pub fn regressors(model: &Model, flight: &Prepared, values: &[f64]) -> Vec<Regressor> {
    let tracks = model.tracks(flight, values);
    let rotors = model.rotors(flight, values).flown;
    let voltage = Track::sampled(&flight.flight.battery_voltage, 0.0, &flight.layout.clock).values;
    let body = |at: usize, axis: usize| {
        tracks.attitude[at].inverse_transform_vector(&Vector3::from(tracks.velocity[at]))[axis]
    };
    let count = flight.flight.rotors as f64;
    let mean_speed = |at: usize| rotors[at].iter().map(|rotor| rotor.speed_rad_s).sum::<f64>() / count;
    let all: [Named<'_>; 10] = [
        ("speed", "m/s", &|at| Vector3::from(tracks.velocity[at]).norm()),
        ("velocity x (body)", "m/s", &|at| body(at, 0)),
        ("velocity y (body)", "m/s", &|at| body(at, 1)),
        ("velocity z (body)", "m/s", &|at| body(at, 2)),
        ("angular velocity x (body)", "rad/s", &|at| tracks.rates[at][0]),
        ("angular velocity y (body)", "rad/s", &|at| tracks.rates[at][1]),
        ("angular velocity z (body)", "rad/s", &|at| tracks.rates[at][2]),
        ("height", "m", &|at| tracks.position.values[at][2]),
        ("mean rotor speed", "rad/s", &mean_speed),
        ("battery voltage", "V", &|at| voltage[at][0]),
    ];
    let knots = &flight.layout.knots;
    let sampled = all.into_iter().map(|(name, unit, of)| Regressor {
        name,
        unit,
        values: knots.iter().map(|at| of(*at)).collect(),
    });
    sampled.filter(|row| row.values.iter().any(|value| *value != row.values[0])).collect()
}
