//! A backend's state as bytes: named components, so that two snapshots that differ show where.

use crate::saved::{Reader, Saved, Unfit, Writer};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Reason why a snapshot could not be taken or read.
#[derive(Debug, Error)]
pub enum SnapshotError {
    /// The bytes are not a snapshot.
    #[error("these bytes are no snapshot of a plant: {0}")]
    Unreadable(postcard::Error),
    /// It is one of another backend.
    #[error("this is a snapshot of the backend {found:?}, expected one of {expected:?}")]
    OtherBackend {
        /// The backend that was to be restored.
        expected: &'static str,
        /// The backend that took it.
        found: String,
    },
    /// A component is absent.
    #[error("the snapshot has no component {0:?}; it was taken by another version or in another scene")]
    Missing(&'static str),
    /// A component is that of another vehicle or scene.
    #[error(
        "component {component:?} does not fit this vehicle and scene: {cause}; restore it with the vehicle, effects \
         and scene that it was taken with"
    )]
    Misfit {
        /// Its name.
        component: &'static str,
        /// The reason.
        cause: Unfit,
    },
}

/// The components of a backend's state.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) struct Snapshot {
    backend: String,
    components: Vec<(String, Vec<u8>)>,
}

impl Snapshot {
    /// An empty snapshot of `backend`.
    pub(crate) fn of(backend: &str) -> Self {
        Self { backend: backend.to_owned(), components: Vec::new() }
    }

    /// Adds a component.
    pub(crate) fn push(&mut self, name: &'static str, part: &dyn Saved) {
        let mut bytes = vec![0; part.size()];
        part.save(&mut Writer::new(&mut bytes));
        self.components.push((name.to_owned(), bytes));
    }

    /// As bytes.
    pub(crate) fn bytes(&self) -> Result<Vec<u8>, SnapshotError> {
        postcard::to_stdvec(self).map_err(SnapshotError::Unreadable)
    }

    /// Reads the bytes of a snapshot of `backend`.
    pub(crate) fn read(bytes: &[u8], backend: &'static str) -> Result<Self, SnapshotError> {
        let snapshot: Self = postcard::from_bytes(bytes).map_err(SnapshotError::Unreadable)?;
        if snapshot.backend == backend {
            Ok(snapshot)
        } else {
            Err(SnapshotError::OtherBackend { expected: backend, found: snapshot.backend })
        }
    }

    /// Loads a component into `part`.
    pub(crate) fn load(&self, name: &'static str, part: &mut dyn Saved) -> Result<(), SnapshotError> {
        let found = self.components.iter().find(|(component, _)| component == name);
        let (_, bytes) = found.ok_or(SnapshotError::Missing(name))?;
        let loaded = match bytes.len() == part.size() {
            true => part.load(&mut Reader::new(bytes)),
            false => Err(Unfit::Value("it has another size")),
        };
        loaded.map_err(|cause| SnapshotError::Misfit { component: name, cause })
    }
}

/// The name of the first component in which two snapshots differ; `None` where they are the same.
///
/// # Errors
/// If one of them is not a snapshot.
///
/// ```
/// use plant::{Airframe, Backend, FreeFlight, NewtonEuler, RigidBody, snapshot::first_difference};
///
/// let vehicle = vehicles::Vehicle::parse(vehicles::reference::HUMMINGBIRD, "hummingbird.toml").unwrap();
/// let airframe = Airframe::new(vehicle);
/// let effects = airframe.initial_state(1, "plant", 1e-3);
/// let body = RigidBody::level_at(nalgebra::Vector3::z());
/// let mut flight = FreeFlight::new(NewtonEuler::flying(airframe, 1), body, effects);
/// let before = flight.snapshot()?;
/// flight.step(&[0.0; 4], 1e-3, &[]);
/// assert_eq!(first_difference(&before, &flight.snapshot()?)?.as_deref(), Some("state"));
/// # Ok::<(), plant::snapshot::SnapshotError>(())
/// ```
pub fn first_difference(a: &[u8], b: &[u8]) -> Result<Option<String>, SnapshotError> {
    let read = |bytes| postcard::from_bytes::<Snapshot>(bytes).map_err(SnapshotError::Unreadable);
    let (a, b) = (read(a)?, read(b)?);
    if a.backend != b.backend || a.components.len() != b.components.len() {
        return Ok(Some("backend".to_owned()));
    }
    let mut pairs = a.components.into_iter().zip(b.components);
    Ok(pairs.find(|(a, b)| a != b).map(|((name, _), _)| name))
}
