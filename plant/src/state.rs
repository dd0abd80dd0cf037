//! The state that the integrator moves: one rigid body and its rotors, in SI units.

use crate::saved::saved_fields;
use component::Bounded;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use vehicles::ROTORS_MAX;

/// Pose and motion of the body frame B (x forward, y left, z up) in the world frame W (z up).
///
/// ```
/// use nalgebra::Vector3;
/// use plant::RigidBody;
///
/// let body = RigidBody::level_at(Vector3::z());
/// assert_eq!(body.attitude_WB * Vector3::x(), Vector3::x(), "it faces along the world's x");
/// assert!(body.velocity_W_m_s.norm() == 0.0 && body.is_finite());
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RigidBody {
    /// The centre of mass, in W.
    pub position_W_m: Vector3<f64>,
    /// Velocity of the centre of mass, in W.
    pub velocity_W_m_s: Vector3<f64>,
    /// Takes vectors written in B to W (Hamilton convention).
    pub attitude_WB: UnitQuaternion<f64>,
    /// Angular velocity of B relative to W, written in B.
    pub angular_velocity_B_rad_s: Vector3<f64>,
}

/// A value for each rotor of a vehicle, in the order of the motor commands.
///
/// ```
/// use plant::{PerRotor, RotorState};
///
/// let rotors = PerRotor::filled(6, RotorState::steady(400.0));
/// assert_eq!(rotors.map(|rotor| rotor.speed_rad_s), [400.0; 6]);
/// ```
pub type PerRotor<T> = Bounded<T, ROTORS_MAX>;

const _: () = assert!(ROTORS_MAX == component::messages::ROTORS_MAX, "messages have room for all rotors");

/// One rotor's speed relative to the body, positive in the rotor's own sense of rotation.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RotorState {
    /// Rotation speed.
    pub speed_rad_s: f64,
    /// Its rate of change.
    pub acceleration_rad_s2: f64,
}

/// Everything the physics carries from one tick to the next.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct State {
    /// The rigid body.
    pub body: RigidBody,
    /// The rotors, in the order of the motor commands.
    pub rotors: PerRotor<RotorState>,
}

saved_fields!(RigidBody { position_W_m, velocity_W_m_s, attitude_WB, angular_velocity_B_rad_s });
saved_fields!(RotorState { speed_rad_s, acceleration_rad_s2 });
saved_fields!(State { body, rotors });

impl RigidBody {
    /// At rest at `position_W_m`, level, facing along +x of the world.
    pub fn level_at(position_W_m: Vector3<f64>) -> Self {
        RigidBody {
            position_W_m,
            velocity_W_m_s: Vector3::zeros(),
            attitude_WB: UnitQuaternion::identity(),
            angular_velocity_B_rad_s: Vector3::zeros(),
        }
    }

    /// The angular velocity, written in W.
    pub(crate) fn angular_velocity_W_rad_s(&self) -> Vector3<f64> {
        self.attitude_WB * self.angular_velocity_B_rad_s
    }

    /// True if all numbers of pose and motion are finite.
    pub fn is_finite(&self) -> bool {
        let vectors = [&self.position_W_m, &self.velocity_W_m_s, &self.angular_velocity_B_rad_s];
        let numbers = vectors.into_iter().flatten().chain(self.attitude_WB.coords.iter());
        numbers.into_iter().all(|number| number.is_finite())
    }
}

impl RotorState {
    /// Turning steadily at `speed_rad_s`.
    pub fn steady(speed_rad_s: f64) -> Self {
        RotorState { speed_rad_s, acceleration_rad_s2: 0.0 }
    }
}

/// Rates of change of every component of a [`State`].
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Rates {
    pub body: BodyRates,
    pub rotors: PerRotor<RotorRates>,
}

/// Rates of change of every component of a [`RigidBody`].
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct BodyRates {
    pub velocity_W_m_s: Vector3<f64>,
    pub acceleration_W_m_s2: Vector3<f64>,
    pub attitude_WB_per_s: Quaternion<f64>,
    pub angular_acceleration_B_rad_s2: Vector3<f64>,
}

/// Rates of change of a [`RotorState`].
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct RotorRates {
    pub acceleration_rad_s2: f64,
    pub jerk_rad_s3: f64,
}

/// A value for each rotor, made from two of its values.
pub(crate) fn paired<A, B, T: Copy + Default>(
    a: &PerRotor<A>,
    b: &PerRotor<B>,
    value: impl Fn(&A, &B) -> T,
) -> PerRotor<T> {
    a.iter().zip(b).map(|(a, b)| value(a, b)).collect()
}

impl Rates {
    /// Adds `factor * other`, the only arithmetic a Runge-Kutta step needs.
    pub fn add(&mut self, other: &Rates, factor: f64) {
        self.body = self.body.plus(&other.body, factor);
        for (rates, other) in self.rotors.iter_mut().zip(&other.rotors) {
            *rates = rates.plus(other, factor);
        }
    }
}

impl BodyRates {
    /// `self + factor * other`.
    pub fn plus(&self, other: &BodyRates, factor: f64) -> BodyRates {
        BodyRates {
            velocity_W_m_s: self.velocity_W_m_s + other.velocity_W_m_s * factor,
            acceleration_W_m_s2: self.acceleration_W_m_s2 + other.acceleration_W_m_s2 * factor,
            attitude_WB_per_s: self.attitude_WB_per_s + other.attitude_WB_per_s * factor,
            angular_acceleration_B_rad_s2: self.angular_acceleration_B_rad_s2
                + other.angular_acceleration_B_rad_s2 * factor,
        }
    }
}

impl RotorRates {
    pub fn plus(&self, other: &RotorRates, factor: f64) -> RotorRates {
        RotorRates {
            acceleration_rad_s2: self.acceleration_rad_s2 + other.acceleration_rad_s2 * factor,
            jerk_rad_s3: self.jerk_rad_s3 + other.jerk_rad_s3 * factor,
        }
    }
}

impl State {
    /// This state moved along `rates` for `span_s`.
    pub(crate) fn moved(&self, rates: &Rates, span_s: f64) -> State {
        let mut moved = *self;
        moved.move_from(self, rates, span_s);
        moved
    }

    /// Becomes `start`, which has as many rotors, moved along `rates` for `span_s`.
    pub(crate) fn move_from(&mut self, start: &State, rates: &Rates, span_s: f64) {
        self.body = start.body.moved(&rates.body, span_s);
        for ((rotor, start), rates) in self.rotors.iter_mut().zip(&start.rotors).zip(&rates.rotors) {
            *rotor = start.moved(rates, span_s);
        }
    }
}

impl RigidBody {
    /// This body moved along `rates` for `span_s`. The quaternion is left as long as it comes out: only a finished step
    /// normalises it, so that the stages inside a step stay a smooth function of time.
    pub(crate) fn moved(&self, rates: &BodyRates, span_s: f64) -> RigidBody {
        let attitude = self.attitude_WB.into_inner() + rates.attitude_WB_per_s * span_s;
        RigidBody {
            position_W_m: self.position_W_m + rates.velocity_W_m_s * span_s,
            velocity_W_m_s: self.velocity_W_m_s + rates.acceleration_W_m_s2 * span_s,
            attitude_WB: UnitQuaternion::new_unchecked(attitude),
            angular_velocity_B_rad_s: self.angular_velocity_B_rad_s
                + rates.angular_acceleration_B_rad_s2 * span_s,
        }
    }
}

impl RotorState {
    pub(crate) fn moved(&self, rates: &RotorRates, span_s: f64) -> RotorState {
        RotorState {
            speed_rad_s: self.speed_rad_s + rates.acceleration_rad_s2 * span_s,
            acceleration_rad_s2: self.acceleration_rad_s2 + rates.jerk_rad_s3 * span_s,
        }
    }
}
