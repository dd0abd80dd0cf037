//! State of a plant: the flight, and the place of its vehicle among those of the run.

use crate::backend::{Backend, CONFIGURATION};
use crate::others::Others;
use crate::saved::{Reader, Saved, Writer};
use crate::snapshot::SnapshotError;
use component::{State, StateError, Transfer};

/// Name of the state's type.
const TYPE_NAME: &str = "PlantMemory";
/// Reason why a plant does not go on from the state of another one.
const OTHER_WORLD: &str = "it is of another backend, another scene or another number of rotors; keep them from the checkpoint on, \
                           or fly from the start; effects may be other ones";

/// State of a plant.
///
/// Its bytes are the parts of the backend, in their order, and the place in the traffic. Buffers that every step
/// overwrites are not among them.
pub struct PlantMemory {
    pub(crate) backend: Box<dyn Backend>,
    pub(crate) others: Others,
}

impl PlantMemory {
    pub(crate) fn new(backend: Box<dyn Backend>) -> Self {
        Self { backend, others: Others::new() }
    }
}

impl std::fmt::Debug for PlantMemory {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct(TYPE_NAME).field("backend", &self.backend.name()).finish_non_exhaustive()
    }
}

impl State for PlantMemory {
    const TRANSFER: Transfer = Transfer::Bytes(TYPE_NAME);

    fn configuration(&self) -> u64 {
        self.backend.configuration()
    }

    fn size(&self) -> usize {
        let mut size = self.others.size();
        self.backend.parts(&mut |_, part| size += part.size());
        size
    }

    fn save(&self, bytes: &mut [u8]) {
        let mut to = Writer::new(bytes);
        self.others.save(&mut to);
        self.backend.parts(&mut |_, part| part.save(&mut to));
    }

    fn load(&mut self, bytes: &[u8]) -> Result<(), StateError> {
        StateError::check_size(TYPE_NAME, self.size(), bytes)?;
        let refused = |reason: String| StateError::Contents { type_name: TYPE_NAME, reason };
        let mut from = Reader::new(bytes);
        self.others.load(&mut from).map_err(|unfit| refused(format!("the place in the traffic: {unfit}")))?;
        let loaded = self.backend.parts_mut(&mut |name, part| {
            part.load(&mut from).map_err(|cause| SnapshotError::Misfit { component: name, cause })
        });
        loaded.map_err(|error| refused(error.to_string()))
    }

    /// Effects that the other plant lacks begin, and the states of effects that this one lacks are left out.
    fn adopt(&mut self, bytes: &[u8]) -> Result<bool, StateError> {
        let refused = |reason: String| StateError::Contents { type_name: TYPE_NAME, reason };
        let mut from = Reader::new(bytes);
        self.others
            .adopt(&mut from)
            .map_err(|unfit| refused(format!("the place in the traffic: {unfit}")))?;
        let adopted = self.backend.parts_mut(&mut |name, part| {
            part.adopt(&mut from).map_err(|cause| SnapshotError::Misfit { component: name, cause })
        });
        match adopted {
            Ok(()) if from.is_at_end() => Ok(true),
            Ok(()) => Err(refused("it is longer than expected".to_owned())),
            Err(SnapshotError::Misfit { component: CONFIGURATION, .. }) => {
                Err(refused(OTHER_WORLD.to_owned()))
            }
            Err(error) => Err(refused(error.to_string())),
        }
    }
}
