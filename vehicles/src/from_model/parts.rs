//! Parts of a model from which a vehicle file is written.

use super::body::Body;
use super::model::Model;
use super::rotors::Rotor;
use crate::vehicle::Vehicle;

/// Standard gravity.
pub const GRAVITY_M_S2: f64 = 9.80665;

/// Sources of a vehicle file.
pub struct Parts<'m> {
    /// The model.
    pub model: &'m Model<'m>,
    /// The links as one body.
    pub body: Body,
    /// The rotors, in the order of the commands.
    pub rotors: Vec<Rotor<'m>>,
    /// The Hummingbird.
    pub reference: Vehicle,
}
