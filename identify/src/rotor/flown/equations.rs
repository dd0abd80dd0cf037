//! Flights as linear equations for thrust and torque coefficients: the same windows as in `prepared`, whose derivatives
//! of measurements go over to the window.
//!
//! Forces, by the mass: f = sum_i (k_T / m) w_i^2 a_i, with the air's part at speed beside it. The rotors'
//! drag and loss of lift in a climb grow with speed times w. Lift by speed across the rotor and the body's
//! drag grow with the square of the speed. Torques about z, by I_zz: the rotors' drag, the spin-up of the
//! rotors, and a trim.
#![allow(non_snake_case, reason = "a trailing _W or _B names the frame a vector is written in")]

use std::ops::Range;
use std::sync::Arc;

use flights::Flight;
use nalgebra::{UnitQuaternion, Vector3};
use vehicles::Vehicle;

use super::blocks::Blocks;
use super::least_squares::Rows;
use crate::data::prepared::{BOX_STEPS, Equation, Prepared, Propulsion, Tracks, box_s};
use crate::data::rotor_track::EachRotor;
use crate::data::track::Track;
use crate::data::unusable::Unusable;
use crate::data::window::{SIMPSON, Window, central_difference};

/// Component of the specific force along z.
pub const FORCE_Z: usize = 0;
/// First of the three components of the acceleration in W.
pub const ACCELERATION: usize = 1;

/// Terms of the air at speed, behind those of the thrust.
pub const AIR_TERMS: usize = 5;

/// A flight on its grid, with measured rotor speeds.
pub struct Equations<'f> {
    /// The flight.
    pub flight: &'f Flight,
    prepared: Prepared<'f>,
    tracks: Arc<Tracks>,
    speeds: Vec<EachRotor>,
}

/// Columns of one component on the grid, before the window.
type Columns = Vec<Vec<f64>>;

impl<'f> Equations<'f> {
    /// The equations of `flight`, which has rotor speeds and no commands.
    ///
    /// # Errors
    /// If too little of its motion can be compared.
    pub fn of(flight: &'f Flight, propulsion: &Propulsion) -> Result<Self, Unusable> {
        let prepared = Prepared::new(flight, box_s(flight), propulsion)?;
        let tracks = prepared.tracks(0.0, 0.0);
        let speeds = Track::sampled(&flight.rotor_speed, 0.0, &prepared.layout.clock).values;
        Ok(Self { flight, prepared, tracks, speeds })
    }

    /// Time that is compared, in s.
    pub fn compared_s(&self) -> f64 {
        self.prepared.compared_s()
    }

    /// Time of the last instant, in s.
    pub fn end_s(&self) -> f64 {
        let clock = &self.prepared.layout.clock;
        clock.at(clock.count - 1)
    }

    /// True if the velocity of the vehicle is known.
    pub fn has_velocity(&self) -> bool {
        let flight = self.flight;
        let has_position = !flight.position.is_empty() || !flight.velocity.is_empty();
        has_position && !flight.attitude.is_empty() && !self.prepared.is_assumed()
    }

    /// Rows of the forces: those of the accelerometer along z, or else those of the acceleration. Parameters: coefficients
    /// of the rotors ([`of_rotors`]), the terms of the air at speed, and the bias of the accelerometer.
    pub fn forces(&self, vehicle: &Vehicle, number: usize, blocks: &Blocks, is_each: bool) -> Vec<Rows> {
        let body = self.forces_B(vehicle, is_each);
        let bias = body.len();
        let mut rows = Vec::new();
        if let Some(offset) = self.offset(Equation::SpecificForce) {
            let mut columns: Columns =
                body.iter().map(|column| column.iter().map(|force| force.z).collect()).collect();
            columns.push(vec![1.0; self.speeds.len()]);
            rows.push(self.rows(Equation::SpecificForce, FORCE_Z, offset + 2, &columns, number, blocks));
            return rows;
        }
        // A level attitude that was assumed says nothing about the acceleration of the vehicle.
        if let Some(offset) = self.offset(Equation::Acceleration).filter(|_| !self.prepared.is_assumed()) {
            for axis in 0..3 {
                let turned = |column: &Vec<Vector3<f64>>| -> Vec<f64> {
                    let pairs = self.tracks.attitude.iter().zip(column);
                    pairs
                        .map(|(attitude_WB, force_B): (&UnitQuaternion<f64>, _)| {
                            (attitude_WB * force_B)[axis]
                        })
                        .collect()
                };
                let mut columns: Columns = body.iter().map(turned).collect();
                columns.push(vec![0.0; self.speeds.len()]);
                let mut of_axis = self.rows(
                    Equation::Acceleration,
                    ACCELERATION + axis,
                    offset + axis,
                    &columns,
                    number,
                    blocks,
                );
                let weight = if axis == 2 { vehicle.gravity_m_s2 } else { 0.0 };
                of_axis.values.iter_mut().for_each(|value| *value += weight);
                rows.push(of_axis);
            }
        }
        debug_assert!(rows.iter().all(|rows| rows.columns.len() == bias + 1));
        rows
    }

    /// Specific force along z that the accelerometer reads beyond that of the acceleration and the attitude, as rows of a
    /// constant: its bias. `None` where one of the two is not logged.
    pub fn accelerometer_bias(&self, gravity_m_s2: f64, blocks: &Blocks, number: usize) -> Option<Rows> {
        let force = self.offset(Equation::SpecificForce)?;
        let acceleration = self.offset(Equation::Acceleration).filter(|_| !self.prepared.is_assumed())?;
        let ones = vec![vec![1.0; self.speeds.len()]];
        let mut rows = self.rows(Equation::SpecificForce, 0, force + 2, &ones, number, blocks);
        let (width, measured) = (self.prepared.width(), &self.tracks.rows);
        for ((at, knot), value) in self.prepared.layout.knots.iter().enumerate().zip(&mut rows.values) {
            let of_axis = |axis: usize| measured[at * width + acceleration + axis];
            let force_W = Vector3::new(of_axis(0), of_axis(1), of_axis(2) + gravity_m_s2);
            *value -= (self.tracks.attitude[*knot].inverse() * force_W).z;
        }
        Some(rows)
    }

    /// Forces by the mass at each instant, by parameter.
    fn forces_B(&self, vehicle: &Vehicle, is_each: bool) -> Vec<Vec<Vector3<f64>>> {
        let instants = || 0..self.speeds.len();
        let thrust = |rotor: usize| -> Vec<Vector3<f64>> {
            instants().map(|at| vehicle.rotors[rotor].axis * self.speeds[at][rotor].powi(2)).collect()
        };
        let mut columns = of_rotors(vehicle, is_each, thrust, |sum, one| *sum += one);
        let air = |at: usize| -> [Vector3<f64>; AIR_TERMS] {
            if !self.has_velocity() {
                return [Vector3::zeros(); AIR_TERMS];
            }
            let velocity_B = self.tracks.attitude[at].inverse() * Vector3::from(self.tracks.velocity[at]);
            let fast: f64 = self.speeds[at].iter().sum();
            let (across, along) =
                (Vector3::new(velocity_B.x, velocity_B.y, 0.0), Vector3::z() * velocity_B.z);
            [
                -fast * across,
                -fast * along,
                across.norm_squared() * Vector3::z(),
                -velocity_B.norm() * across,
                -velocity_B.norm() * along,
            ]
        };
        let air: Vec<_> = instants().map(air).collect();
        columns.extend((0..AIR_TERMS).map(|term| air.iter().map(|terms| terms[term]).collect()));
        columns
    }

    /// Rows of the torque about z, by I_zz. Parameters: coefficients of the rotors' drag, spin-up, drag of the rotors at
    /// speed, and `trims`, of which this flight has number `trim`.
    pub fn torques(
        &self,
        vehicle: &Vehicle,
        number: usize,
        blocks: &Blocks,
        is_each: bool,
        (trim, trims): (usize, usize),
    ) -> Option<Rows> {
        let offset = self.offset(Equation::AngularAcceleration)?;
        let instants = || 0..self.speeds.len();
        let drag = |rotor: usize| -> Vec<f64> {
            let place = &vehicle.rotors[rotor];
            let scale = -place.spin * place.torque_scale * place.axis.z;
            instants().map(|at| scale * self.speeds[at][rotor].powi(2)).collect()
        };
        let mut columns = of_rotors(vehicle, is_each, drag, |sum, one| *sum += one);
        let spin_up = columns.len();
        let momentum = |at: usize| -> f64 {
            let rotors = vehicle.rotors.iter().zip(&self.speeds[at]);
            -rotors.map(|(place, speed)| place.spin * place.axis.z * speed).sum::<f64>()
        };
        columns.push(instants().map(momentum).collect());
        columns.push(instants().map(|at| self.drag_about_z(vehicle, at)).collect());
        columns.extend((0..trims).map(|other| vec![f64::from(u8::from(other == trim)); self.speeds.len()]));
        let equation = Equation::AngularAcceleration;
        let mut rows = self.rows(equation, 0, offset + 2, &columns, number, blocks);
        rows.columns[spin_up] = self.over(&self.differentiating(), &columns[spin_up]);
        rows.values = self.torque_about_z(vehicle, offset);
        Some(rows)
    }

    /// Drag of the rotors at speed about z, for a coefficient of 1.
    fn drag_about_z(&self, vehicle: &Vehicle, at: usize) -> f64 {
        let velocity_B = if self.has_velocity() {
            self.tracks.attitude[at].inverse() * Vector3::from(self.tracks.velocity[at])
        } else {
            Vector3::zeros()
        };
        let rates_B = Vector3::from(self.tracks.rates[at]);
        let of_rotor = |(place, speed): (&vehicles::Rotor, &f64)| {
            let hub_B = velocity_B + rates_B.cross(&place.position_m);
            -speed * (place.position_m.x * hub_B.y - place.position_m.y * hub_B.x)
        };
        vehicle.rotors.iter().zip(&self.speeds[at]).map(of_rotor).sum()
    }

    /// The torque about z by I_zz that the measured rates and the declared inertia ask for, less that of tilted thrusts.
    fn torque_about_z(&self, vehicle: &Vehicle, offset: usize) -> Vec<f64> {
        let inertia = vehicle.inertia_kg_m2;
        let gyroscopic = |(at, rates): (usize, &[f64; 3])| {
            let rates_B = Vector3::from(*rates);
            let tilted = |(place, speed): (&vehicles::Rotor, &f64)| {
                place.position_m.cross(&place.axis).z * vehicle.thrust_coefficient * speed * speed
            };
            let thrusts: f64 = vehicle.rotors.iter().zip(&self.speeds[at]).map(tilted).sum();
            (rates_B.cross(&(inertia * rates_B)).z - thrusts) / inertia[(2, 2)]
        };
        let gyroscopic: Vec<f64> = self.tracks.rates.iter().enumerate().map(gyroscopic).collect();
        let width = self.prepared.width();
        let acceleration = |knot: usize| {
            let at = knot * width + offset;
            let of_axis = |axis: usize| inertia[(2, axis)] * self.tracks.rows[at + axis];
            (0..3).map(of_axis).sum::<f64>() / inertia[(2, 2)]
        };
        let windowed = self.over(&self.window(Equation::AngularAcceleration).1, &gyroscopic);
        windowed.iter().enumerate().map(|(knot, gyroscopic)| acceleration(knot) + gyroscopic).collect()
    }

    /// Window of a derivative of what the model's side of the torques sees.
    fn differentiating(&self) -> Window {
        let clock = &self.prepared.layout.clock;
        let central = Window::b_spline(BOX_STEPS).behind(central_difference(clock.step_s));
        if self.flight.angular_velocity.is_empty() { central.behind(SIMPSON) } else { central }
    }

    fn window(&self, equation: Equation) -> &(Window, Window) {
        let layout = &self.prepared.layout;
        let at = layout.equations.iter().position(|known| *known == equation).unwrap_or(0);
        &layout.windows[at]
    }

    fn offset(&self, equation: Equation) -> Option<usize> {
        self.prepared.offset_of(equation)
    }

    /// The rows of `component`, whose measured side is at `offset` of each knot.
    fn rows(
        &self,
        equation: Equation,
        component: usize,
        offset: usize,
        columns: &Columns,
        number: usize,
        blocks: &Blocks,
    ) -> Rows {
        let (layout, width) = (&self.prepared.layout, self.prepared.width());
        let model = &self.window(equation).1;
        let block = |knot: &usize| blocks.of_time(number, layout.clock.at(*knot));
        Rows {
            component,
            stretches: self.stretches(),
            values: self.tracks.rows.iter().skip(offset).step_by(width).copied().collect(),
            columns: columns.iter().map(|column| self.over(model, column)).collect(),
            blocks: layout.knots.iter().map(block).collect(),
        }
    }

    /// A signal on the grid, seen through the window about each knot.
    fn over(&self, window: &Window, signal: &[f64]) -> Vec<f64> {
        let signal: Vec<[f64; 1]> = signal.iter().map(|value| [*value]).collect();
        self.prepared.layout.knots.iter().map(|knot| window.over(&signal, *knot)[0]).collect()
    }

    fn stretches(&self) -> Vec<Range<usize>> {
        crate::model::whitening::stretches(&self.prepared)
            .into_iter()
            .map(|(first, end)| first..end)
            .collect()
    }
}

/// A column for each working rotor, or their sum as one.
pub fn of_rotors<T: Clone>(
    vehicle: &Vehicle,
    is_each: bool,
    of: impl Fn(usize) -> Vec<T>,
    add: impl Fn(&mut T, T),
) -> Vec<Vec<T>> {
    let columns: Vec<Vec<T>> = working(vehicle).into_iter().map(of).collect();
    if is_each {
        return columns;
    }
    let sum = columns.into_iter().reduce(|mut sum, column| {
        sum.iter_mut().zip(column).for_each(|(sum, one)| add(sum, one));
        sum
    });
    sum.into_iter().collect()
}

/// Numbers of the rotors that turn.
pub fn working(vehicle: &Vehicle) -> Vec<usize> {
    (0..vehicle.rotors.len()).filter(|rotor| !vehicle.rotors[*rotor].has_failed).collect()
}
