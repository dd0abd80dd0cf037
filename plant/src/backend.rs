//! Interface of a plant, whichever physics moves it.

use crate::actuation::Battery;
use crate::newton_euler::Accelerations;
use crate::saved::Saved;
use crate::snapshot::{Snapshot, SnapshotError};
use crate::state::{RigidBody, State};
use nalgebra::Vector3;

/// Name of the part of a state that refuses a state of another scene.
pub(crate) const CONFIGURATION: &str = "configuration";

/// Physics that moves one vehicle from tick to tick.
pub trait Backend: Send {
    /// The name of the physics, as manifests say it.
    fn name(&self) -> &'static str;

    /// Body and rotors at the end of the last tick.
    fn state(&self) -> &State;

    /// Returns the accelerations that sensors at the centre of mass measure at the end of the last tick.
    fn accelerations(&self) -> Accelerations;

    /// Moves the vehicle by one tick of `dt_s` under raw motor `commands`, one for each rotor, held over it. `traffic` are the other
    /// vehicles as they were at the start of the tick, always the same ones in the same order.
    fn step(&mut self, commands: &[f64], dt_s: f64, traffic: &[Neighbour]);

    /// Has the rotors turn steadily at raw motor `commands`.
    fn settle_rotors(&mut self, commands: &[f64]);

    /// Has the motors follow a measured voltage of the battery in the ticks from now on, in place of the model's; `None` is that of the model.
    fn set_measured_voltage(&mut self, voltage_V: Option<f64>);

    /// Puts the body where it is said to be; the rotors stay as they are.
    fn set_body(&mut self, body: &RigidBody);

    /// Returns the contacts over the last tick.
    fn contact(&self) -> ContactReport;

    /// The free bodies of the scene, in its order: where they are and how they move.
    fn bodies(&self) -> &[RigidBody] {
        &[]
    }

    /// Their numbers, as [`ContactReport::object`] counts them.
    fn body_objects(&self) -> &[u32] {
        &[]
    }

    /// The reason why the motion since the start cannot be trusted, if there is one; the run ends with it.
    fn trouble(&self) -> Option<String> {
        None
    }

    /// A remark on the accuracy of the motion since the backend was made, if the user must know one. It is not part of the state.
    fn remark(&self) -> Option<String> {
        None
    }

    /// The battery, if an effect models it.
    fn battery(&self) -> Option<Battery>;

    /// Hash of backend, scene and kinds of effects: only a state of the same can be loaded.
    fn configuration(&self) -> u64;

    /// Passes to `note` every part of the state that the next ticks depend on, by name, in a fixed order.
    fn parts(&self, note: &mut dyn FnMut(&'static str, &dyn Saved));

    /// As [`Backend::parts`], to be changed; the first error ends it.
    ///
    /// # Errors
    /// Those of `note`.
    fn parts_mut(&mut self, note: &mut NotePart<'_>) -> Result<(), SnapshotError>;

    /// The parts of the state as bytes with their names.
    ///
    /// # Errors
    /// If the state cannot be written.
    fn snapshot(&self) -> Result<Vec<u8>, SnapshotError> {
        let mut snapshot = Snapshot::of(self.name());
        self.parts(&mut |name, part| snapshot.push(name, part));
        snapshot.bytes()
    }

    /// Continues from a snapshot that the same backend took of the same vehicle in the same scene. After an
    /// error the backend is as it was.
    ///
    /// # Errors
    /// If the bytes are not such a snapshot.
    fn restore(&mut self, snapshot: &[u8]) -> Result<(), SnapshotError> {
        let snapshot = Snapshot::read(snapshot, self.name())?;
        let mut before = Snapshot::of(self.name());
        self.parts(&mut |name, part| before.push(name, part));
        self.parts_mut(&mut |name, part| snapshot.load(name, part)).inspect_err(|_| {
            // It was taken of this very backend: every part fits.
            let _ = self.parts_mut(&mut |name, part| before.load(name, part));
        })
    }
}

/// Function that changes a part of a state: see [`Backend::parts_mut`].
pub type NotePart<'a> = dyn FnMut(&'static str, &mut dyn Saved) -> Result<(), SnapshotError> + 'a;

/// The most vehicles that share a room, this one included.
pub const TRAFFIC_MAX: usize = 32;

/// Another vehicle of the run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Neighbour {
    /// Its place in the traffic, from 0.
    pub number: u32,
    /// Its centre of mass.
    pub position_W_m: Vector3<f64>,
    /// The velocity of its centre of mass.
    pub velocity_W_m_s: Vector3<f64>,
}

/// Contacts of the vehicle; `component::messages::Contact` describes each field.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ContactReport {
    /// Sum of the contact forces over the last tick.
    pub force_W_N: Vector3<f64>,
    /// Speed of approach of the newest impact of a part of the vehicle.
    pub impact_speed_m_s: f64,
    /// Number of things touched.
    pub count: u32,
    /// Object that is touched first: 0 nothing, 1 the ground, 2 + i the scene's thing i, 1000 + i the other
    /// vehicle i.
    pub object: u32,
    /// Contacts that began since the start.
    pub began: u32,
    /// True if an impact was faster than the vehicle bears.
    pub crashed: bool,
}
