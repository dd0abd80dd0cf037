//! The Newton-Euler backend (thesis section 3.1, with its errata corrected): free flight of one rigid body.
//!
//! Newton: v' = g + R_WB F_B / m, in the world frame (thesis eq. 3.12 forgets the division by m).
//! Euler: J w' = tau - w x J w, in the body frame (thesis eq. 3.17).
//! Attitude: q' = 1/2 q (0, w), a quaternion, where thesis eq. 3.18 is singular at a pitch of 90 degrees.
//! The motions of body and motors are integrated together by the classic fourth-order Runge-Kutta scheme.

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use vehicles::Vehicle;

use crate::actuation::Actuation;
use crate::airframe::Airframe;
use crate::effects::{Effect, FlightCondition};
use crate::rotation::rotated;
use crate::state::{BodyRates, PerRotor, Rates, RigidBody, RotorRates, RotorState, State};

/// The model: immutable, while the [`State`] it moves belongs to the caller.
///
/// ```
/// use nalgebra::Vector3;
/// use plant::{NewtonEuler, RigidBody};
///
/// let vehicle = vehicles::Vehicle::parse(vehicles::reference::HUMMINGBIRD, "hummingbird.toml").unwrap();
/// let (model, hover) = (NewtonEuler::new(vehicle.clone(), 1), vehicle.hover_command());
/// let state = model.start(RigidBody::level_at(Vector3::z()), hover);
/// let felt_m_s2 = model.accelerations(&state).specific_force_B_m_s2.z;
/// assert!((felt_m_s2 - 9.81).abs() < 1e-9, "in hover the rotors carry the weight: {felt_m_s2}");
/// ```
#[derive(Debug, Clone)]
pub struct NewtonEuler {
    airframe: Airframe,
    inverse_inertia: Matrix3<f64>,
    gravity_W_m_s2: Vector3<f64>,
    substeps: u32,
}

/// Accelerations of the body at an instant, as sensors at the centre of mass measure them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Accelerations {
    /// (all forces but gravity) / m, in the body frame: the reading of an accelerometer at the centre of mass.
    pub specific_force_B_m_s2: Vector3<f64>,
    /// Rate of change of the angular velocity, in the body frame.
    pub angular_acceleration_B_rad_s2: Vector3<f64>,
}

impl Accelerations {
    /// The difference to others.
    #[must_use]
    pub fn less(&self, others: &Self) -> Self {
        Self {
            specific_force_B_m_s2: self.specific_force_B_m_s2 - others.specific_force_B_m_s2,
            angular_acceleration_B_rad_s2: self.angular_acceleration_B_rad_s2
                - others.angular_acceleration_B_rad_s2,
        }
    }
}

impl NewtonEuler {
    /// A model of `vehicle` as it is declared, without the effects that its file lists; for the rest see
    /// [`NewtonEuler::flying`].
    pub fn new(vehicle: Vehicle, substeps: u32) -> Self {
        Self::flying(Airframe::new(vehicle), substeps)
    }

    /// A model of `airframe` that divides every tick into `substeps` Runge-Kutta steps (0 counts as 1).
    pub fn flying(airframe: Airframe, substeps: u32) -> Self {
        let vehicle = airframe.vehicle();
        // A vehicle's tensor is positive definite, so the inverse exists; zero would only freeze the rotation.
        let inverse_inertia = vehicle.inertia_kg_m2.try_inverse().unwrap_or_else(Matrix3::zeros);
        let gravity_W_m_s2 = Vector3::new(0.0, 0.0, -vehicle.gravity_m_s2);
        NewtonEuler { airframe, inverse_inertia, gravity_W_m_s2, substeps: substeps.max(1) }
    }

    /// The airframe this model flies.
    pub fn airframe(&self) -> &Airframe {
        &self.airframe
    }

    /// The vehicle this model flies, changed by its effects.
    pub fn vehicle(&self) -> &Vehicle {
        self.airframe.vehicle()
    }

    /// Returns the number of integration steps in a tick.
    pub(crate) fn substeps(&self) -> u32 {
        self.substeps
    }

    /// Takes a torque to the angular acceleration that it makes, both in the body frame.
    pub(crate) fn inverse_inertia(&self) -> &Matrix3<f64> {
        &self.inverse_inertia
    }

    /// A rotor that has settled at a raw motor command.
    pub fn steady(&self, command: f64) -> RotorState {
        RotorState::steady(self.vehicle().command.speed(command))
    }

    /// Rotors that have settled at raw motor `commands`.
    pub(crate) fn steady_each(&self, commands: &[f64]) -> PerRotor<RotorState> {
        let speed = |(rotor, command): (usize, &f64)| self.vehicle().commanded_speed_rad_s(rotor, *command);
        commands.iter().enumerate().map(speed).map(RotorState::steady).collect()
    }

    /// A state with all rotors settled at the same raw motor command.
    pub fn start(&self, body: RigidBody, command: f64) -> State {
        let commands = PerRotor::filled(self.vehicle().rotors.len(), command);
        State { body, rotors: self.steady_each(&commands) }
    }

    /// Moves `state` by one tick of `dt_s` under raw motor `commands` held over the tick, as the declared vehicle
    /// does.
    ///
    /// # Panics
    /// If the airframe has effects: some of them have a state, which [`NewtonEuler::advance`] sees by the actuation.
    pub fn step(&self, state: &mut State, commands: &[f64], dt_s: f64) {
        assert!(self.airframe.effects().is_empty(), "effects need begin_tick and advance");
        self.advance(state, &self.airframe.commanded(commands), dt_s);
    }

    /// Moves `state` by one tick of `dt_s` under the `actuation` with which [`Airframe::begin_tick`] began it.
    pub fn advance(&self, state: &mut State, actuation: &Actuation, dt_s: f64) {
        let span_s = dt_s / f64::from(self.substeps);
        for _ in 0..self.substeps {
            Self::step_by(state, span_s, |state, rates| self.set_rates(state, actuation, rates));
        }
        state.body.attitude_WB = UnitQuaternion::new_normalize(state.body.attitude_WB.into_inner());
        self.airframe.settle(actuation, &mut state.rotors);
    }

    /// The same with rotors whose speeds grow by their accelerations, whatever their motors would do.
    pub(crate) fn advance_with_rotors(&self, state: &mut State, actuation: &Actuation, dt_s: f64) {
        let held = shown_rates(state);
        let span_s = dt_s / f64::from(self.substeps);
        for _ in 0..self.substeps {
            Self::step_by(state, span_s, |state, rates| {
                rates.rotors = held;
                self.set_body_rates(state, actuation, rates);
            });
        }
        state.body.attitude_WB = UnitQuaternion::new_normalize(state.body.attitude_WB.into_inner());
    }

    /// Specific force and angular acceleration at `state`, in still air.
    pub fn accelerations(&self, state: &State) -> Accelerations {
        self.accelerations_under(&Actuation::none(state.rotors.len()), state)
    }

    /// Specific force and angular acceleration at `state`, with the actuation over the tick that ends there.
    pub fn accelerations_under(&self, actuation: &Actuation, state: &State) -> Accelerations {
        let wrench = self.airframe.wrench(actuation, state, &shown_rates(state));
        Accelerations {
            specific_force_B_m_s2: wrench.force_B_N / self.vehicle().mass_kg,
            angular_acceleration_B_rad_s2: self.angular_acceleration(state, &wrench.torque_B_N_m),
        }
    }

    /// Specific force and angular acceleration that `effect` adds to those of this model under `condition`. The effect has to be one that only adds:
    /// [`EffectKind::only_adds`](crate::effects::EffectKind::only_adds).
    pub fn accelerations_added(&self, effect: &Effect, condition: &FlightCondition<'_>) -> Accelerations {
        let wrench = effect.added_wrench(condition);
        Accelerations {
            specific_force_B_m_s2: wrench.force_B_N / self.vehicle().mass_kg,
            angular_acceleration_B_rad_s2: self.inverse_inertia * wrench.torque_B_N_m,
        }
    }

    /// One classic Runge-Kutta step of fourth order over the full state, in free flight.
    pub(crate) fn runge_kutta(&self, state: &State, actuation: &Actuation, span_s: f64) -> State {
        self.runge_kutta_held(state, actuation, span_s, |_, rates| rates)
    }

    /// The same, with something that holds the body: it gets the state and the rates of free flight, and gives the
    /// rates back that it leaves of them.
    pub(crate) fn runge_kutta_held(
        &self,
        state: &State,
        actuation: &Actuation,
        span_s: f64,
        hold: impl Fn(&State, Rates) -> Rates,
    ) -> State {
        let mut moved = *state;
        Self::step_by(&mut moved, span_s, |state, rates| *rates = hold(state, self.rates(state, actuation)));
        moved
    }

    /// One classic Runge-Kutta step of fourth order. `set_rates` gets the rates of an earlier stage, and sets them.
    fn step_by(state: &mut State, span_s: f64, set_rates: impl Fn(&State, &mut Rates)) {
        // States and rates have room for twelve rotors: each copy of one costs as much as its arithmetic.
        let start = *state;
        let mut sum = Rates::default();
        set_rates(&start, &mut sum);
        state.move_from(&start, &sum, span_s / 2.0);
        let mut rates = sum;
        for (weight, share) in [(2.0, 0.5), (2.0, 1.0)] {
            set_rates(state, &mut rates);
            sum.add(&rates, weight);
            state.move_from(&start, &rates, share * span_s);
        }
        set_rates(state, &mut rates);
        sum.add(&rates, 1.0);
        state.move_from(&start, &sum, span_s / 6.0);
    }

    /// Rates of free flight.
    pub(crate) fn rates(&self, state: &State, actuation: &Actuation) -> Rates {
        let mut rates = Rates::default();
        self.set_rates(state, actuation, &mut rates);
        rates
    }

    /// The same, into `rates`.
    fn set_rates(&self, state: &State, actuation: &Actuation, rates: &mut Rates) {
        self.airframe.set_rotor_rates(actuation, state, &mut rates.rotors);
        self.set_body_rates(state, actuation, rates);
    }

    /// Those of the body, with the rotors' that `rates` has.
    fn set_body_rates(&self, state: &State, actuation: &Actuation, rates: &mut Rates) {
        let wrench = self.airframe.wrench(actuation, state, &rates.rotors);
        let attitude_WB = state.body.attitude_WB.as_ref();
        let force_W_N = rotated(attitude_WB, &wrench.force_B_N);
        rates.body = BodyRates {
            velocity_W_m_s: state.body.velocity_W_m_s,
            acceleration_W_m_s2: self.gravity_W_m_s2 + force_W_N / self.vehicle().mass_kg,
            // 1/2 q (0, w), with w in the body frame.
            attitude_WB_per_s: attitude_WB * Quaternion::from_imag(state.body.angular_velocity_B_rad_s * 0.5),
            angular_acceleration_B_rad_s2: self.angular_acceleration(state, &wrench.torque_B_N_m),
        };
    }

    /// J^-1 (tau - w x J w).
    fn angular_acceleration(&self, state: &State, torque_B_N_m: &Vector3<f64>) -> Vector3<f64> {
        let w = &state.body.angular_velocity_B_rad_s;
        self.inverse_inertia * (torque_B_N_m - w.cross(&(self.vehicle().inertia_kg_m2 * w)))
    }
}

/// Rates of the rotors that their state itself shows, where no target is at hand.
fn shown_rates(state: &State) -> PerRotor<RotorRates> {
    let shown = |RotorState { acceleration_rad_s2, .. }| RotorRates { acceleration_rad_s2, jerk_rad_s3: 0.0 };
    state.rotors.map(shown)
}
