//! Comparisons of a flight's channels with each other, at the knots of its windows.
#![allow(non_snake_case, reason = "a trailing _W or _B names the frame a vector is written in")]

use super::twin::Twin;
use crate::data::fault::Part;
use crate::data::prepared::{BOX_STEPS, Equation, Prepared, Tracks};
use crate::data::rotor_track::EachRotor;
use crate::data::rows::column;
use crate::data::track::Track;
use crate::model::physics::Model;
use nalgebra::{UnitQuaternion, Vector3};
use std::sync::Arc;

/// A flight's channels side by side.
#[derive(Debug)]
pub struct Evidence<'p> {
    /// The flight.
    pub flight: &'p Prepared<'p>,
    /// The model, of which only the declared values are used.
    pub model: &'p Model,
    /// Faulty parts of the flight, which are no evidence.
    pub doubted: Vec<Part>,
    tracks: Arc<Tracks>,
    /// Speeds that follow from the commands, on the grid.
    commanded: Arc<Vec<EachRotor>>,
    /// Measured speeds on the grid; zero where there are none.
    measured: Vec<EachRotor>,
}

impl<'p> Evidence<'p> {
    /// Evidence of `flight`.
    pub fn of(model: &'p Model, flight: &'p Prepared<'p>) -> Self {
        let declared = model.parameters.baseline();
        let commanded = model.rotors(flight, &declared).commanded;
        let measured = Track::sampled(&flight.flight.rotor_speed, 0.0, &flight.layout.clock).values;
        let tracks = model.tracks(flight, &declared);
        Self { flight, model, tracks, commanded, measured, doubted: Vec::new() }
    }

    /// Time between two knots.
    pub fn knot_s(&self) -> f64 {
        BOX_STEPS as f64 * self.flight.layout.clock.step_s
    }

    /// Measured side of `equation`, by component; `None` if it is not compared, or in doubt.
    pub fn measured(&self, equation: Equation) -> Option<Vec<Vec<f64>>> {
        let source = match equation {
            Equation::SpecificForce => Part::Accelerometer,
            Equation::Acceleration => Part::Translation,
            Equation::AngularAcceleration | Equation::Gyroscope => Part::Gyroscope,
            Equation::RotorSpeed(_) => Part::RotorSpeed,
        };
        if self.doubted.contains(&source) {
            return None;
        }
        self.flight.offset_of(equation)?;
        let of = |axis| column(self.flight, &self.tracks.rows, equation, axis);
        Some((0..equation.size()).map(of).collect())
    }

    /// Gyroscope beside the attitude's rate of change, by axis of B.
    pub fn gyroscope(&self) -> Option<[Twin; 3]> {
        let beyond = self.measured(Equation::Gyroscope)?;
        let equations = &self.flight.layout.equations;
        let at = equations.iter().position(|equation| *equation == Equation::Gyroscope)?;
        let window = &self.flight.layout.windows[at].1;
        let knots = &self.flight.layout.knots;
        let rates: Vec<[f64; 3]> = knots.iter().map(|knot| window.over(&self.tracks.rates, *knot)).collect();
        Some(std::array::from_fn(|axis| {
            let measured: Vec<f64> = rates.iter().map(|rate| rate[axis]).collect();
            let turned: Vec<f64> =
                measured.iter().zip(&beyond[axis]).map(|(rate, more)| rate - more).collect();
            Twin::of(&measured, &turned, self.knot_s())
        }))
    }

    /// Acceleration in W by position or velocity beside that by the lean of the vehicle, which still carries its weight.
    /// Upwards, the expected one follows from the thrust of the commands, or else of the rotors.
    pub fn translation(&self) -> Option<[Twin; 3]> {
        let measured = self.accelerations_W()?;
        let gravity = self.model.vehicle.gravity_m_s2;
        let expected = |at: usize, attitude_WB: UnitQuaternion<f64>| -> Vector3<f64> {
            let up = attitude_WB * Vector3::z();
            let lifted = up.z * self.thrust_m_s2(self.flight.layout.knots[at]);
            // Beyond 60 degrees the vehicle does not hold its height by leaning.
            let part = gravity / up.z.max(0.5);
            Vector3::new(part * up.x, part * up.y, lifted - gravity)
        };
        let expected: Vec<Vector3<f64>> =
            self.attitudes().enumerate().map(|(at, attitude)| expected(at, attitude)).collect();
        Some(std::array::from_fn(|axis| {
            let course: Vec<f64> = expected.iter().map(|vector| vector[axis]).collect();
            Twin::of(&measured[axis], &course, self.knot_s())
        }))
    }

    /// Specific force in B that follows from position and attitude, by axis.
    pub fn asked_force_B(&self) -> Option<[Vec<f64>; 3]> {
        let acceleration = self.accelerations_W()?;
        let gravity = self.model.vehicle.gravity_m_s2;
        let turned = |(at, attitude_WB): (usize, UnitQuaternion<f64>)| -> Vector3<f64> {
            let [x, y, z] = std::array::from_fn(|axis| acceleration[axis][at]);
            attitude_WB.inverse() * Vector3::new(x, y, z + gravity)
        };
        let asked: Vec<Vector3<f64>> = self.attitudes().enumerate().map(turned).collect();
        Some(std::array::from_fn(|axis| asked.iter().map(|force| force[axis]).collect()))
    }

    /// Squared speeds that follow from the commands, about `knot` less `late` instants; `None` outside the grid.
    pub fn commanded_squares(&self, knot: usize, late: isize) -> Option<EachRotor> {
        squares_about(&self.commanded, knot, late)
    }

    /// Squared speeds as measured, like [`Self::commanded_squares`].
    pub fn measured_squares(&self, knot: usize, late: isize) -> Option<EachRotor> {
        squares_about(&self.measured, knot, late)
    }

    /// Commanded thrust about `knot`, divided by mass.
    pub fn thrust_m_s2(&self, knot: usize) -> f64 {
        let vehicle = &self.model.vehicle;
        let squares = self.commanded_squares(knot, 0).unwrap_or_default();
        let upwards = vehicle.rotors.iter().zip(squares).map(|(rotor, square)| rotor.axis.z * square);
        vehicle.thrust_coefficient * upwards.sum::<f64>() / vehicle.mass_kg
    }

    fn accelerations_W(&self) -> Option<Vec<Vec<f64>>> {
        self.measured(Equation::Acceleration).filter(|_| !self.flight.is_assumed())
    }

    fn attitudes(&self) -> impl Iterator<Item = UnitQuaternion<f64>> + '_ {
        self.flight.layout.knots.iter().map(|knot| self.tracks.attitude[*knot])
    }
}

/// Mean squares about `knot` less `late` instants; `None` outside the grid.
fn squares_about(speeds: &[EachRotor], knot: usize, late: isize) -> Option<EachRotor> {
    let middle = knot.checked_add_signed(-late).filter(|middle| *middle >= BOX_STEPS)?;
    let about = speeds.get(middle - BOX_STEPS..=middle + BOX_STEPS)?;
    let sum = |rotor: usize| about.iter().map(|speeds| speeds[rotor] * speeds[rotor]).sum::<f64>();
    Some(std::array::from_fn(|rotor| sum(rotor) / about.len() as f64))
}
