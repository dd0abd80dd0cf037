//! The vehicle as the physics sees it: SI numbers only, immutable once read.
//!
//! Body frame B: x forward, y left, z up, origin at the centre of mass. World frame W: z up.

use nalgebra::{Matrix3, Vector3};

use crate::command::CommandMap;
use crate::effects::EffectEntry;
use crate::envelope::Envelope;
use crate::provenance::Provenance;

/// The most rotors that a vehicle has.
pub const ROTORS_MAX: usize = 12;

/// A multirotor, in SI units.
///
/// ```
/// use vehicles::{MotorModel, Vehicle};
///
/// let vehicle = Vehicle::parse(vehicles::reference::HUMMINGBIRD, "hummingbird.toml")?;
/// assert!((400.0..600.0).contains(&vehicle.hover_speed_rad_s()));
/// assert!(vehicle.rotors.iter().map(|rotor| rotor.spin).sum::<f64>() == 0.0);
/// assert!(matches!(vehicle.motor, MotorModel::SecondOrder { damping_ratio, .. } if damping_ratio > 0.0));
/// # Ok::<(), diagnostics::Diagnostic>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Vehicle {
    /// Name of the vehicle.
    pub name: String,
    /// Take-off mass.
    pub mass_kg: f64,
    /// Inertia tensor about the centre of mass, body frame, rotors at rest included.
    pub inertia_kg_m2: Matrix3<f64>,
    /// Magnitude of gravity; it points along -z of the world.
    pub gravity_m_s2: f64,
    /// The 1 to [`ROTORS_MAX`] rotors, in the order of the motor commands.
    pub rotors: Vec<Rotor>,
    /// c_T of T = c_T w^2, in N/(rad/s)^2 (thesis eq. 3.1).
    pub thrust_coefficient: f64,
    /// c_Q of Q = c_Q w^2, in N*m/(rad/s)^2 (thesis eq. 3.2).
    pub torque_coefficient: f64,
    /// Moment of inertia of one rotor about its axis (I_m of thesis eq. 3.11).
    pub rotor_inertia_kg_m2: f64,
    /// Dynamics from the commanded speed to the rotor speed.
    pub motor: MotorModel,
    /// Map from a raw motor command to a commanded speed.
    pub command: CommandMap,
    /// The effects that act beyond all this, in the file's order. Only a plant that flies them reads their
    /// meaning: the rest of this structure is the vehicle as it is declared, without them.
    pub effects: Vec<EffectEntry>,
    /// The flight envelope in which these numbers were validated, if the file states one.
    pub envelope: Option<Envelope>,
    /// Provenance of every number, in the file's order of reading.
    pub provenance: Vec<Provenance>,
}

/// One rotor's place and sense of rotation.
#[derive(Debug, Clone, PartialEq)]
pub struct Rotor {
    /// Its name in the file, such as `front`.
    pub name: String,
    /// The hub, seen from the centre of mass, body frame.
    pub position_m: Vector3<f64>,
    /// Direction of the thrust: a unit vector in the body frame, (0, 0, 1) unless the file says otherwise.
    pub axis: Vector3<f64>,
    /// Sense of rotation seen from the tip of the axis: +1 counter-clockwise, -1 clockwise.
    pub spin: f64,
    /// This rotor's drag torque as a multiple of that by c_Q at its speed: 1 unless the file says otherwise. Only the
    /// physics knows it; controllers count on rotors that are alike.
    pub torque_scale: f64,
    /// True for a rotor that has failed: it stands still under any command.
    pub has_failed: bool,
}

/// Dynamics from the commanded speed to the rotor speed. Both have unit gain at rest: the thesis's gain of
/// 3.5 (section 4.2) has no unit and does not map a speed onto the same speed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum MotorModel {
    /// w'' = wn^2 (wc - w) - 2 zeta wn w'.
    SecondOrder {
        /// wn.
        natural_frequency_rad_s: f64,
        /// zeta.
        damping_ratio: f64,
    },
    /// w' = (wc - w) / tau.
    FirstOrder {
        /// tau.
        time_constant_s: f64,
    },
}

impl Vehicle {
    /// The rotor speed at which rotors that turn alike carry the weight: sqrt(m g / (c_T sum of their axes' z)), in rad/s.
    /// Rotors that have failed carry nothing. Infinite for a vehicle whose rotors make no thrust upwards.
    pub fn hover_speed_rad_s(&self) -> f64 {
        #[allow(non_snake_case, reason = "units stand last in names, and the newton is N")]
        let weight_N = self.mass_kg * self.gravity_m_s2;
        let upwards: f64 = self.working_rotors().map(|rotor| rotor.axis.z).sum();
        if weight_N == 0.0 { 0.0 } else { (weight_N / (upwards.max(0.0) * self.thrust_coefficient)).sqrt() }
    }

    /// The rotors that turn.
    pub fn working_rotors(&self) -> impl Iterator<Item = &Rotor> {
        self.rotors.iter().filter(|rotor| !rotor.has_failed)
    }

    /// The speed in rad/s that a raw `command` asks of a rotor, counted from 0; 0 of one that has failed.
    pub fn commanded_speed_rad_s(&self, rotor: usize, command: f64) -> f64 {
        let has_failed = self.rotors.get(rotor).is_some_and(|rotor| rotor.has_failed);
        if has_failed { 0.0 } else { self.command.speed(command) }
    }

    /// Thrust along z of the body, in N, of rotors that have settled at `commands`. The map of commands is
    /// `map` in place of the vehicle's own.
    pub fn static_thrust_by(&self, map: &CommandMap, commands: &[f64; ROTORS_MAX]) -> f64 {
        let working = self.rotors.iter().zip(commands).filter(|(rotor, _)| !rotor.has_failed);
        let squares = working.map(|(rotor, command)| rotor.axis.z * map.speed(*command).powi(2));
        self.thrust_coefficient * squares.sum::<f64>()
    }

    /// The raw motor command for hover, saturated to the motors' range.
    pub fn hover_command(&self) -> f64 {
        self.command.command(self.hover_speed_rad_s())
    }
}
