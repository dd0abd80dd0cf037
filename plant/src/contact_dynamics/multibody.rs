//! The vehicle, its rig and the free bodies: one multibody system, with its state.
//!
//! Impulses see each of its bodies as a twist and a mobility; the mobility of the vehicle includes the rig.

use super::body::{mobility, shift, twist};
use super::free_bodies::FreeBodies;
use super::rig::{self, Mounted};
use super::solver::{Body, join};
use crate::backend::Neighbour;
use crate::newton_euler::NewtonEuler;
use crate::state::{RigidBody, State};
use nalgebra::{Matrix6, Vector3};
use scenes::Rig;

/// The vehicle with all that moves with it.
pub(super) struct Multibody {
    pub model: NewtonEuler,
    pub size: Size,
    pub rig: Option<Rig>,
    pub free_bodies: FreeBodies,
    /// State of the vehicle.
    pub state: State,
    pub changed: Changed,
}

/// Numbers of the vehicle on which its resistance to turning and rolling depends.
#[derive(Debug, Clone, Copy)]
pub(super) struct Size {
    /// Radius of its disc.
    pub disc_radius_m: f64,
    /// The least moment of inertia about any axis.
    pub inertia_min_kg_m2: f64,
}

/// Changes of the vehicle's velocities by contacts and joints since the tick began.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Changed {
    pub velocity_W_m_s: Vector3<f64>,
    pub spin_W_rad_s: Vector3<f64>,
}

impl Multibody {
    /// True if a rig or joints hold the vehicle.
    pub(super) fn is_held(&self) -> bool {
        self.rig.is_some() || self.free_bodies.is_vehicle_tied()
    }

    /// The vehicle in its rig, if it has one.
    pub(super) fn mounted(&self, body: &RigidBody) -> Option<Mounted<'_>> {
        let rig = self.rig.as_ref()?;
        Some(Mounted::new(rig, body, self.mobility(body)))
    }

    /// The mobility in free flight.
    fn mobility(&self, body: &RigidBody) -> Matrix6<f64> {
        mobility(body, self.model.vehicle().mass_kg, self.model.inverse_inertia())
    }

    /// Moves the mount back onto its line, from where the order of the step left it.
    pub(super) fn project(&self, body: &mut RigidBody) {
        let Some((rig, mounted)) = self.rig.as_ref().zip(self.mounted(body)) else { return };
        let off_W_m = rig::off_W_m(rig, body);
        shift(body, &mounted.back(&off_W_m));
    }

    /// Writes the world, the vehicle, free bodies and the others, as impulses see them, to `bodies`.
    pub(super) fn bodies(
        &self,
        vehicle: &RigidBody,
        free: &[RigidBody],
        others: &[Neighbour],
        bodies: &mut Vec<Body>,
    ) {
        let mounted = self.mounted(vehicle);
        let mobility = mounted.map_or_else(|| self.mobility(vehicle), |mounted| mounted.mobility());
        let others = others.iter().map(|other| Body {
            // Others do not turn, and nothing moves them.
            twist: join(&other.velocity_W_m_s, &Vector3::zeros()),
            ..Body::default()
        });
        bodies.clear();
        bodies.extend([Body::default(), Body { twist: twist(vehicle), mobility }]);
        bodies.extend(self.free_bodies.as_bodies(free).chain(others));
    }
}
