//! Predictions of the model for a flight: the rows of every equation under given parameters.
#![allow(non_snake_case, reason = "a trailing _W or _B names the frame a vector is written in")]

use crate::data::memo::{Key, Rows};
use crate::data::prepared::{BOX_STEPS, Equation, Prepared, Tracks};
use crate::data::rotor_track::{EachRotor, Rotors};
use crate::data::sensing::SensorErrors;
use crate::model::parameter::Parameters;
use crate::model::spinning::spun;
use nalgebra::{UnitQuaternion, Vector3};
use plant::effects::{EffectKind, FlightCondition, Quantity, Stage};
use plant::{Actuation, Airframe, NewtonEuler, PerRotor, RigidBody, RotorState, State};
use std::sync::Arc;
use vehicles::Vehicle;

/// The declared vehicle, with the parameters that a fit may change.
#[derive(Debug, Clone)]
pub struct Model {
    /// The vehicle as it is declared.
    pub vehicle: Vehicle,
    /// Parameters that a fit may change.
    pub parameters: Parameters,
}

impl Model {
    /// The vehicle under these values.
    pub fn airframe(&self, values: &[f64]) -> Airframe {
        Airframe::with_effects(self.vehicle.clone(), self.parameters.effects_under(values))
    }

    /// The vehicle of `flight` under these values, in the wind of that flight: effects of a rig do not act where it moves freely.
    pub fn airframe_of(&self, flight: &Prepared, values: &[f64]) -> Airframe {
        let mut effects = self.parameters.effects_of(flight.number, values);
        effects.retain(|effect| acts_on(effect.kind, flight));
        Airframe::with_effects(self.vehicle.clone(), effects)
    }

    /// The measured channels of `flight` under these values.
    pub fn tracks(&self, flight: &Prepared, values: &[f64]) -> Arc<Tracks> {
        let errors = SensorErrors::of(&self.parameters, values);
        flight.tracks(errors.pose_delay_s, errors.inertial_delay_s)
    }

    /// The rotors of `flight` under these values. Where speeds were measured, their difference from the
    /// commanded speeds is smoothed first: the noise of a sensor, differentiated, would pass for spin-up.
    pub fn rotors(&self, flight: &Prepared, values: &[f64]) -> Rotors {
        let pose_s = SensorErrors::of(&self.parameters, values).pose_delay_s;
        if flight.flight.command.is_empty() {
            let measured = || {
                let flown = measured_rotors(flight, pose_s);
                let commanded = flown.iter().map(speeds).collect();
                Rotors::new(flown, commanded)
            };
            return Rotors::clone(&flight.recent_rotors.at(pose_s, measured));
        }
        let mut flown = spun(&self.airframe_of(flight, values), flight, pose_s);
        let commanded: Vec<EachRotor> = flown.iter().map(speeds).collect();
        if !flight.flight.rotor_speed.is_empty() {
            correct(flight, pose_s, &commanded, &mut flown);
        }
        Rotors::new(flown, commanded)
    }

    /// Measurement less model, for each knot each equation's components.
    pub fn residual(&self, flight: &Prepared, tracks: &Tracks, rotors: &Rotors, values: &[f64]) -> Vec<f64> {
        let sides = self.sides(flight, tracks, rotors, values);
        let errors = SensorErrors::of(&self.parameters, values);
        let mut residual = tracks.rows.clone();
        let mut rows = residual.iter_mut();
        let mut take =
            |model: &[f64]| model.iter().for_each(|model| rows.next().map_or((), |row| *row -= model));
        for &knot in &flight.layout.knots {
            for (equation, (_, window)) in flight.layout.equations.iter().zip(&flight.layout.windows) {
                match equation {
                    Equation::SpecificForce => {
                        let force = Vector3::from(window.over(&sides.force_B, knot));
                        take((force + Vector3::from(errors.accelerometer_bias_m_s2)).as_slice());
                    }
                    Equation::Acceleration => take(&window.over(&sides.acceleration_W, knot)),
                    Equation::AngularAcceleration => take(&window.over(&sides.angular_B, knot)),
                    Equation::Gyroscope => take(&errors.gyroscope_bias_rad_s),
                    Equation::RotorSpeed(count) => take(&window.over(&rotors.commanded, knot)[..*count]),
                }
            }
        }
        self.leave_out_distrusted(flight, &mut residual);
        residual
    }

    /// One component of the model's side of an equation of forces or torques, through its window about each instant of the grid; 0 where
    /// that does not fit on it.
    pub fn side(&self, flight: &Prepared, equation: Equation, axis: usize, values: &[f64]) -> Vec<f64> {
        let sides = self.sides(flight, &self.tracks(flight, values), &self.rotors(flight, values), values);
        let of_equation = match equation {
            Equation::SpecificForce => &sides.force_B,
            Equation::Acceleration => &sides.acceleration_W,
            Equation::AngularAcceleration => &sides.angular_B,
            Equation::Gyroscope | Equation::RotorSpeed(_) => return vec![0.0; flight.layout.clock.count],
        };
        let at = flight.layout.equations.iter().position(|known| *known == equation);
        let window = at.map(|at| &flight.layout.windows[at].1);
        let reach = flight.reach();
        let about = |i: usize| {
            let is_inside = i >= reach && i + reach < of_equation.len();
            window.filter(|_| is_inside).map_or(0.0, |window| window.over(of_equation, i)[axis])
        };
        (0..flight.layout.clock.count).map(about).collect()
    }

    /// A rotor's speed that is not believed is compared with nothing.
    fn leave_out_distrusted(&self, flight: &Prepared, residual: &mut [f64]) {
        let Some(offset) = flight.offset_of(flight.rotor_speed()) else { return };
        for rotor in (0..flight.flight.rotors).filter(|rotor| flight.distrusted[*rotor]) {
            residual.iter_mut().skip(offset + rotor).step_by(flight.width()).for_each(|row| *row = 0.0);
        }
    }

    fn sides(&self, flight: &Prepared, tracks: &Tracks, rotors: &Rotors, values: &[f64]) -> Sides {
        let airframe = self.airframe_of(flight, values);
        let actuation = air(&airframe, flight.layout.clock.step_s);
        let model = NewtonEuler::flying(airframe, 1);
        let gravity_m_s2 = model.vehicle().gravity_m_s2;
        let has_world = flight.offset_of(Equation::Acceleration).is_some();
        let mut sides = Sides::with_capacity(flight.layout.clock.count);
        for state in self.states(flight, tracks, rotors, values) {
            let motion = model.accelerations_under(&actuation, &state);
            sides.force_B.push(motion.specific_force_B_m_s2.into());
            sides.angular_B.push(motion.angular_acceleration_B_rad_s2.into());
            if has_world {
                let mut acceleration_W = state.body.attitude_WB * motion.specific_force_B_m_s2;
                acceleration_W.z -= gravity_m_s2;
                sides.acceleration_W.push(acceleration_W.into());
            }
        }
        sides
    }

    /// The measured states on the grid under `values`, with rotors as the model has them.
    fn states<'t>(
        &self,
        flight: &Prepared,
        tracks: &'t Tracks,
        rotors: &'t Rotors,
        values: &[f64],
    ) -> impl Iterator<Item = State> + use<'t> {
        let mounting = SensorErrors::of(&self.parameters, values).mounting();
        (0..flight.layout.clock.count).map(move |i| {
            let body = RigidBody {
                position_W_m: tracks.position.values[i].into(),
                velocity_W_m_s: tracks.velocity[i].into(),
                attitude_WB: tracks.attitude[i] * mounting,
                angular_velocity_B_rad_s: tracks.rates[i].into(),
            };
            State { body, rotors: rotors.flown[i] }
        })
    }

    /// The residual under `values`, and its derivative by each parameter of `free`: one column each. Those by the winds of single flights follow
    /// from those by the common wind.
    pub fn linearised(&self, flight: &Prepared, values: &[f64], free: &[usize]) -> (Vec<f64>, Vec<Vec<f64>>) {
        if free.iter().all(|at| self.parameters.all[*at].flight.is_none()) {
            return self.linearised_by(flight, values, free);
        }
        let acting: Vec<Option<(usize, f64)>> =
            free.iter().map(|at| self.parameters.acting(*at, flight.number)).collect();
        let mut computed: Vec<usize> = acting.iter().flatten().map(|(at, _)| *at).collect();
        computed.sort_unstable();
        computed.dedup();
        let (residual, columns) = self.linearised_by(flight, values, &computed);
        let column = |acting: &Option<(usize, f64)>| {
            let (at, factor) = acting.as_ref()?;
            let slopes = &columns[computed.binary_search(at).ok()?];
            Some(slopes.iter().map(|slope| factor * slope).collect::<Vec<f64>>())
        };
        let columns =
            acting.iter().map(|acting| column(acting).unwrap_or_else(|| vec![0.0; residual.len()])).collect();
        (residual, columns)
    }

    /// The same by parameters that act by themselves.
    fn linearised_by(&self, flight: &Prepared, values: &[f64], free: &[usize]) -> (Vec<f64>, Vec<Vec<f64>>) {
        use rayon::prelude::*;
        let key = Key { values: values.to_vec(), late: flight.late, distrusted: flight.distrusted };
        let (residual, columns) = match flight.memo.known(&key, free) {
            Some((residual, columns)) if columns.iter().all(Option::is_some) => {
                (residual, columns.into_iter().flatten().collect())
            }
            known => {
                let (residual, columns) = known.unzip();
                let about = About::of(self, flight, values, residual);
                let known = columns.unwrap_or_else(|| vec![None; free.len()]);
                let is_open = |(at, known): (&usize, &Option<Rows>)| {
                    known.is_none() && self.parameters.all[*at].kind.only_adds()
                };
                let flown = about.flown();
                let open = free.iter().zip(&known).any(is_open);
                let conditions = if open { about.conditions(&flown) } else { Vec::new() };
                let column = |(&parameter, known): (&usize, Option<Rows>)| {
                    known.unwrap_or_else(|| Arc::new(about.column(parameter, &flown, &conditions)))
                };
                let columns: Vec<Rows> = free.par_iter().zip(known).map(column).collect();
                (about.residual, columns)
            }
        };
        flight.memo.keep(key, &residual, free.iter().copied().zip(columns.iter().cloned()));
        (residual.to_vec(), columns.iter().map(|column| column.to_vec()).collect())
    }

    /// The derivatives with the rotors that follow from the commands alone, where these are logged.
    pub fn instruments(&self, flight: &Prepared, values: &[f64], free: &[usize]) -> Vec<Vec<f64>> {
        let (tracks, rotors) = (self.tracks(flight, values), self.commanded_rotors(flight, values));
        let residual = Arc::new(self.residual(flight, &tracks, &rotors, values));
        let about = About { model: self, flight, values, tracks, rotors, residual, is_commanded: true };
        let flown = about.flown();
        let conditions = about.conditions(&flown);
        free.iter().map(|parameter| about.column(*parameter, &flown, &conditions)).collect()
    }

    /// The rotors that follow from the commands; the measured ones where none are logged.
    fn commanded_rotors(&self, flight: &Prepared, values: &[f64]) -> Rotors {
        if flight.flight.command.is_empty() {
            return self.rotors(flight, values);
        }
        let pose_s = SensorErrors::of(&self.parameters, values).pose_delay_s;
        let flown = spun(&self.airframe_of(flight, values), flight, pose_s);
        let commanded = flown.iter().map(speeds).collect();
        Rotors::new(flown, commanded)
    }

    /// The residual under `values`.
    pub fn residual_under(&self, flight: &Prepared, values: &[f64]) -> Vec<f64> {
        self.residual(flight, &self.tracks(flight, values), &self.rotors(flight, values), values)
    }
}

/// A flight under values of the parameters, about which derivatives are taken.
struct About<'m, 'p, 'f> {
    model: &'m Model,
    flight: &'p Prepared<'f>,
    values: &'m [f64],
    tracks: Arc<Tracks>,
    rotors: Rotors,
    residual: Rows,
    /// True if measured rotor speeds are left aside.
    is_commanded: bool,
}

impl<'m, 'p, 'f> About<'m, 'p, 'f> {
    /// The flight with its `residual` where that is known.
    fn of(model: &'m Model, flight: &'p Prepared<'f>, values: &'m [f64], residual: Option<Rows>) -> Self {
        let (tracks, rotors) = (model.tracks(flight, values), model.rotors(flight, values));
        let residual = residual.unwrap_or_else(|| Arc::new(model.residual(flight, &tracks, &rotors, values)));
        Self { model, flight, values, tracks, rotors, residual, is_commanded: false }
    }

    /// The rotors under other values.
    fn rotors_under(&self, values: &[f64]) -> Rotors {
        if self.is_commanded {
            self.model.commanded_rotors(self.flight, values)
        } else {
            self.model.rotors(self.flight, values)
        }
    }

    /// The model under the values.
    fn flown(&self) -> NewtonEuler {
        NewtonEuler::flying(self.model.airframe_of(self.flight, self.values), 1)
    }

    /// The conditions on the grid of the vehicle of `flown`, each with its attitude.
    fn conditions<'v>(&self, flown: &'v NewtonEuler) -> Vec<(FlightCondition<'v>, UnitQuaternion<f64>)> {
        let air_velocity_W_m_s = air(flown.airframe(), self.flight.layout.clock.step_s).air_velocity_W_m_s;
        let of_state = |state: State| {
            (FlightCondition::new(flown.vehicle(), &state, &air_velocity_W_m_s), state.body.attitude_WB)
        };
        self.model.states(self.flight, &self.tracks, &self.rotors, self.values).map(of_state).collect()
    }

    /// The derivative of the residual by one parameter. Effects that only add forces and torques are evaluated under the `conditions` of the vehicle of
    /// `flown`.
    fn column(
        &self,
        parameter: usize,
        flown: &NewtonEuler,
        conditions: &[(FlightCondition<'_>, UnitQuaternion<f64>)],
    ) -> Vec<f64> {
        let (model, flight) = (self.model, self.flight);
        let entry = &model.parameters.all[parameter];
        let up = self.values[parameter] + entry.step <= entry.max;
        let step = if up { entry.step } else { -entry.step };
        let moved_by = |by: f64| {
            let mut values = self.values.to_vec();
            values[parameter] += by;
            values
        };
        let ahead = moved_by(step);
        let moved = match entry.kind.stage {
            Stage::Sampling => {
                // The derivative holds the sensor's noise as well: of a difference to one side it would be
                // correlated with the residual's, and every delay would come out too long.
                let ahead = model.residual_under(flight, &ahead);
                let behind = model.residual_under(flight, &moved_by(-step));
                return ahead.iter().zip(&behind).map(|(a, b)| (a - b) / (2.0 * step)).collect();
            }
            Stage::Rotors => model.residual(flight, &self.tracks, &self.rotors_under(&ahead), &ahead),
            Stage::Body if entry.kind.only_adds() => {
                return self.column_of_added((entry.kind, &ahead, step), flown, conditions);
            }
            Stage::Body => model.residual(flight, &self.tracks, &self.rotors, &ahead),
        };
        moved.iter().zip(self.residual.iter()).map(|(moved, before)| (moved - before) / step).collect()
    }

    /// The same by a parameter of an effect that only adds forces and torques, which goes to the values `ahead` by `step`: all others stay.
    fn column_of_added(
        &self,
        (kind, ahead, step): (&'static EffectKind, &[f64], f64),
        flown: &NewtonEuler,
        conditions: &[(FlightCondition<'_>, UnitQuaternion<f64>)],
    ) -> Vec<f64> {
        let flight = self.flight;
        if !acts_on(kind, flight) {
            return vec![0.0; self.residual.len()];
        }
        let [after, now] =
            [ahead, self.values].map(|values| self.model.parameters.effect_under(kind, values));
        let is_neutral = now.values == kind.neutral().values;
        let has_world = flight.offset_of(Equation::Acceleration).is_some();
        let mut sides = Sides::with_capacity(conditions.len());
        for (condition, attitude_WB) in conditions {
            let mut added = flown.accelerations_added(&after, condition);
            if !is_neutral {
                added = added.less(&flown.accelerations_added(&now, condition));
            }
            // The residual has the model's side taken off.
            let force_B = added.specific_force_B_m_s2 / -step;
            sides.force_B.push(force_B.into());
            sides.angular_B.push((added.angular_acceleration_B_rad_s2 / -step).into());
            if has_world {
                sides.acceleration_W.push((attitude_WB * force_B).into());
            }
        }
        let mut column = Vec::with_capacity(self.residual.len());
        for &knot in &flight.layout.knots {
            for (equation, (_, window)) in flight.layout.equations.iter().zip(&flight.layout.windows) {
                match equation {
                    Equation::SpecificForce => column.extend(window.over(&sides.force_B, knot)),
                    Equation::Acceleration => column.extend(window.over(&sides.acceleration_W, knot)),
                    Equation::AngularAcceleration => column.extend(window.over(&sides.angular_B, knot)),
                    Equation::Gyroscope | Equation::RotorSpeed(_) => {
                        column.extend(std::iter::repeat_n(0.0, equation.size()));
                    }
                }
            }
        }
        column
    }
}

/// True if effects of `kind` act on `flight`: those of a rig do not where it moves freely.
fn acts_on(kind: &EffectKind, flight: &Prepared) -> bool {
    !(flight.moves_freely && kind.needs.contains(&Quantity::Rig))
}

/// The model's sides on the grid.
struct Sides {
    force_B: Vec<[f64; 3]>,
    acceleration_W: Vec<[f64; 3]>,
    angular_B: Vec<[f64; 3]>,
}

impl Sides {
    fn with_capacity(count: usize) -> Self {
        let [force_B, acceleration_W, angular_B] = std::array::from_fn(|_| Vec::with_capacity(count));
        Self { force_B, acceleration_W, angular_B }
    }
}

/// Returns the motion of the air under the steady effects, which is the same at every instant.
pub fn air(airframe: &Airframe, step_s: f64) -> Actuation {
    let count = airframe.vehicle().rotors.len();
    let rotors = PerRotor::filled(count, RotorState::default());
    let state = State { body: RigidBody::level_at(Vector3::zeros()), rotors };
    let commands = PerRotor::filled(count, 0.0);
    *airframe.begin_tick(&mut airframe.initial_state(0, "identify", step_s), &state, &commands, step_s)
}

/// The speeds; zeros behind the last rotor.
fn speeds(rotors: &PerRotor<RotorState>) -> EachRotor {
    std::array::from_fn(|rotor| rotors.get(rotor).map_or(0.0, |rotor| rotor.speed_rad_s))
}

/// Adds to rotors that follow from the commands by how much the measured ones turn faster. Their acceleration stays that
/// of the commands: even of a smoothed measurement it would be noise for the most part.
fn correct(flight: &Prepared, pose_s: f64, commanded: &[EachRotor], rotors: &mut [PerRotor<RotorState>]) {
    let mut difference = flight.rotor_speeds(pose_s);
    for (difference, commanded) in difference.values.iter_mut().zip(commanded) {
        *difference = std::array::from_fn(|i| difference[i] - commanded[i]);
    }
    let smooth = difference.smoothed(BOX_STEPS);
    for (rotors, more) in rotors.iter_mut().zip(&smooth) {
        for i in (0..flight.flight.rotors).filter(|i| !flight.distrusted[*i]) {
            rotors[i].speed_rad_s += more[i];
        }
    }
}

fn measured_rotors(flight: &Prepared, pose_s: f64) -> Vec<PerRotor<RotorState>> {
    let track = flight.rotor_speeds(pose_s);
    let slopes = track.slope(BOX_STEPS, flight.layout.clock.step_s);
    let rotor = |speed_rad_s, acceleration_rad_s2| RotorState { speed_rad_s, acceleration_rad_s2 };
    let rotors = track.values.iter().zip(&slopes);
    let count = flight.flight.rotors;
    rotors.map(|(speed, slope)| PerRotor::from_fn(count, |i| rotor(speed[i], slope[i]))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::prepared::Propulsion;
    use crate::test_flights::{flown, hummingbird};

    /// Derivatives by parameters of effects that only add forces and torques are those of the whole model: beside others that act, in wind, for a
    /// heavier vehicle, and where a step has to go down.
    #[test]
    fn derivatives_by_added_forces_are_those_of_the_whole_model() {
        let vehicle = hummingbird();
        let model = Model { parameters: Parameters::of(&vehicle, &[]), vehicle };
        let flight = flown(
            [4.0, 0.01],
            |t| [2.0 * libm::sin(1.3 * t), 1.5 * libm::cos(0.9 * t), 0.6 + 0.3 * libm::sin(2.0 * t)],
            |t| [0.3 * libm::sin(2.1 * t), 0.2 * libm::cos(1.7 * t), 0.5 * t],
        );
        let prepared = Prepared::new(&flight, None, &Propulsion::of(&model.vehicle)).unwrap();
        let mut values = model.parameters.baseline();
        let acting = ["rotor-drag", "translational-lift", "wind", "mass-error", "com-offset", "sensor-bias"];
        for (value, entry) in values.iter_mut().zip(&model.parameters.all) {
            if acting.contains(&entry.kind.name) {
                *value = entry.bounded(entry.baseline + 0.5 * entry.scale);
            }
            if entry.kind.name == "parasitic-drag" {
                *value = entry.max;
            }
        }
        let all = &model.parameters.all;
        let free: Vec<usize> = (0..all.len()).filter(|at| all[*at].kind.only_adds()).collect();
        assert!(free.len() > 10, "{free:?}");
        let (residual, columns) = model.linearised(&prepared, &values, &free);
        let norm = |rows: &[f64]| rows.iter().map(|row| row * row).sum::<f64>().sqrt();
        for (at, column) in free.iter().zip(&columns) {
            let entry = &all[*at];
            let up = values[*at] + entry.step <= entry.max;
            let step = if up { entry.step } else { -entry.step };
            let mut moved = values.clone();
            moved[*at] += step;
            let moved = model.residual_under(&prepared, &moved);
            let expected: Vec<f64> = moved.iter().zip(&residual).map(|(a, b)| (a - b) / step).collect();
            let apart: Vec<f64> = column.iter().zip(&expected).map(|(a, b)| a - b).collect();
            let (kind, name) = (entry.kind.name, entry.spec().name);
            // Differences of sums have the rounding of the sums.
            let rounding = 1e-11 * norm(&residual) / step.abs();
            assert!(
                norm(&apart) <= 1e-9 * norm(&expected) + rounding,
                "{kind}.{name}: {} of {}",
                norm(&apart),
                norm(&expected)
            );
        }
        let shown = columns.iter().filter(|column| norm(column) > 0.0).count();
        assert!(shown > 8, "{shown} of {} act in this flight", columns.len());
    }
}
