//! Arguments of the functions of effects: the motion of the vehicle, the air that it moves through, and the height.

use crate::rotation::rotated_back;
use crate::rotor;
use crate::state::{PerRotor, State};
use nalgebra::Vector3;
use vehicles::Vehicle;

/// A vehicle at an instant: the quantities that forces depend on.
///
/// ```
/// use nalgebra::Vector3;
/// use plant::effects::FlightCondition;
/// use plant::{PerRotor, RigidBody, RotorState, State};
///
/// let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../vehicles/hummingbird.toml");
/// let vehicle = vehicles::Vehicle::load(path.as_ref()).unwrap();
/// let body = RigidBody::level_at(Vector3::new(0.0, 0.0, 2.0));
/// let state = State { body, rotors: PerRotor::filled(4, RotorState::steady(400.0)) };
/// let headwind_W_m_s = Vector3::new(-3.0, 0.0, 0.0);
/// let condition = FlightCondition::new(&vehicle, &state, &headwind_W_m_s);
/// assert_eq!((condition.airspeed_B_m_s.x, condition.height_m), (3.0, 2.0));
/// ```
#[derive(Debug, Clone)]
pub struct FlightCondition<'v> {
    /// The vehicle as it flies.
    pub vehicle: &'v Vehicle,
    /// Velocity of the centre of mass relative to the air.
    pub airspeed_B_m_s: Vector3<f64>,
    /// Angular velocity relative to the world.
    pub angular_velocity_B_rad_s: Vector3<f64>,
    /// The unit vector that points up.
    pub up_B: Vector3<f64>,
    /// Height of the centre of mass over the ground, the plane z = 0 of the world.
    pub height_m: f64,
    /// Speeds of the rotors, in the order of the motor commands.
    pub rotor_speeds_rad_s: PerRotor<f64>,
}

impl<'v> FlightCondition<'v> {
    /// `vehicle` at `state`, in air that moves with `air_velocity_W_m_s`.
    #[must_use]
    pub fn new(vehicle: &'v Vehicle, state: &State, air_velocity_W_m_s: &Vector3<f64>) -> Self {
        let body = &state.body;
        let attitude_WB = body.attitude_WB.as_ref();
        Self {
            vehicle,
            airspeed_B_m_s: rotated_back(attitude_WB, &(body.velocity_W_m_s - air_velocity_W_m_s)),
            angular_velocity_B_rad_s: body.angular_velocity_B_rad_s,
            up_B: rotated_back(attitude_WB, &Vector3::z()),
            height_m: body.position_W_m.z,
            rotor_speeds_rad_s: state.rotors.map(|rotor| rotor.speed_rad_s),
        }
    }

    /// Velocity of the hub of a rotor relative to the air.
    #[must_use]
    pub fn hub_airspeed_B_m_s(&self, rotor: usize) -> Vector3<f64> {
        self.airspeed_B_m_s + self.angular_velocity_B_rad_s.cross(&self.vehicle.rotors[rotor].position_m)
    }

    /// The part of [`FlightCondition::hub_airspeed_B_m_s`] along the rotor's axis, and the part across it.
    #[must_use]
    pub fn hub_airspeed_along_and_across(&self, rotor: usize) -> (f64, Vector3<f64>) {
        let (v_B_m_s, axis) = (self.hub_airspeed_B_m_s(rotor), &self.vehicle.rotors[rotor].axis);
        let along_m_s = v_B_m_s.dot(axis);
        (along_m_s, v_B_m_s - axis * along_m_s)
    }

    /// Height of the hub of a rotor over the ground.
    #[must_use]
    pub fn hub_height_m(&self, rotor: usize) -> f64 {
        self.height_m + self.up_B.dot(&self.vehicle.rotors[rotor].position_m)
    }

    /// Thrust of a rotor before any effect on it.
    #[must_use]
    pub fn thrust_N(&self, rotor: usize) -> f64 {
        rotor::thrust_N(self.vehicle, self.rotor_speeds_rad_s[rotor])
    }
}
