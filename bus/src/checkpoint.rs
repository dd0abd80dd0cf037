//! Checkpoints: what the nodes of a run need so that another run goes on from a tick.
//!
//! Every node writes its part at its first due tick from the checkpoint's tick on, when it has taken its inputs and
//! before it steps. Its state is then still that of the checkpoint's tick, so that no node waits for another. A part
//! holds the state, the words of a simulated computing time, and the newest sample of each input that was sent before
//! the tick.

use crate::component::Transfer;
use crate::computation::Computation;
use crate::error::BusError;
use crate::plan::Plan;
use crate::saved_sample::SavedSample;
use crate::state_transfer::StateLayout;
use crate::user_file;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::io::Read as _;
use std::path::{Path, PathBuf};

/// The folder in a run directory with the parts that its nodes go on from.
const FROM: &str = "from";
/// The file with the samples among them.
const SAMPLES: &str = "samples";
/// The largest part that is read: no state comes near it.
const PART_BYTES_MAX: u64 = 1 << 30;

/// The part of a node in a checkpoint: its state, and the samples that it still reads.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct NodePart {
    /// Name of the node.
    pub name: String,
    /// Generation of the process that has written it: 0 unless another process has taken the first one's place.
    pub generation: u32,
    /// True if another component goes on in its place, as a successor in flight does: from the state if it can load it, from
    /// the samples that were sent last otherwise.
    pub(crate) is_succeeded: bool,
    layout: Option<StateLayout>,
    state: Vec<u8>,
    /// Words of a step under way that takes simulated time.
    timing: Vec<u64>,
    samples: Vec<SavedSample>,
}

/// Cause of a checkpoint. The nodes write the parts of each cause in a place of their own, so that a tick may have both.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// The plan of the run names its tick.
    Plan,
    /// A request in flight.
    Request,
}

impl Cause {
    /// Folder in a run directory with the parts, a folder for each tick.
    const fn folder(self) -> &'static str {
        match self {
            Self::Plan => "checkpoints",
            Self::Request => "requested-checkpoints",
        }
    }
}

/// Contents of a checkpoint: the parts of the nodes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Parts {
    /// The first tick that is computed.
    pub tick: u32,
    /// Parts of the nodes, in the order of the plan's nodes.
    pub nodes: Vec<NodePart>,
}

/// The newest samples from before a checkpoint, one of a topic.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Samples(Vec<SavedSample>);

impl NodePart {
    /// The part of the node `name`, whose state is that of `computation`.
    pub(crate) fn new(
        name: &str,
        transfer: Transfer,
        computation: &dyn Computation,
        timing: &[u64],
        samples: Vec<SavedSample>,
    ) -> Self {
        let layout = StateLayout::saved(transfer, computation.state_size(), computation.configuration());
        let mut state = vec![0; layout.as_ref().map_or(0, |layout| layout.size)];
        if layout.is_some() {
            computation.save(&mut state);
        }
        let (name, timing) = (name.to_owned(), timing.to_vec());
        Self { name, generation: 0, is_succeeded: false, layout, state, timing, samples }
    }

    /// Gives `computation`, the node's, the state of this part, and `timing` the words of its computing time.
    ///
    /// # Errors
    /// If the state is one of another component, or of other parameters.
    pub(crate) fn restore(
        &self,
        transfer: Transfer,
        computation: &mut dyn Computation,
        timing: &mut [u64],
    ) -> Result<(), BusError> {
        let refused = |reason: String| BusError::Checkpoint { node: self.name.clone(), reason };
        let layout = StateLayout::saved(transfer, computation.state_size(), computation.configuration());
        let goes_on = match (&self.layout, &layout) {
            (None, None) => Ok(true),
            (Some(found), Some(expected)) if found.fits(expected, transfer) => {
                computation.load(&self.state).map(|()| true)
            }
            (Some(found), Some(expected)) if found.is_of_type_of(expected) => computation.adopt(&self.state),
            _ => Ok(false),
        };
        if !goes_on.map_err(|error| refused(error.to_string()))? {
            let text = |layout: &Option<StateLayout>| {
                layout.as_ref().map_or("no state".to_owned(), ToString::to_string)
            };
            let (found, expected) = (text(&self.layout), text(&layout));
            let reason = format!(
                "it holds {found}, and the node goes on from {expected}; what has another memory by another value begins with \
                 the run"
            );
            return Err(refused(reason));
        }
        if self.is_succeeded && self.timing.len() != timing.len() {
            // As in a swap, the words of the new component stay.
            return Ok(());
        }
        if self.timing.len() != timing.len() {
            return Err(refused(
                "its steps take simulated time in one of the two and none in the other".to_owned(),
            ));
        }
        timing.copy_from_slice(&self.timing);
        Ok(())
    }

    /// True if `computation` can load the state of this part, as a successor in flight could.
    pub(crate) fn fits(&self, transfer: Transfer, computation: &dyn Computation) -> bool {
        let expected = StateLayout::saved(transfer, computation.state_size(), computation.configuration());
        match (&self.layout, expected) {
            (Some(found), Some(expected)) => found.fits(&expected, transfer),
            _ => false,
        }
    }

    /// The part that node `index` of the run in `run_dir` goes on from.
    pub(crate) fn of_run(run_dir: &Path, index: usize) -> Result<Self, BusError> {
        load(&run_dir.join(FROM).join(index.to_string()))
    }

    /// The part of a node without a state.
    #[must_use]
    pub fn stateless(name: &str) -> Self {
        let (layout, state) = (None, Vec::new());
        let (name, timing, samples) = (name.to_owned(), Vec::new(), Vec::new());
        Self { name, generation: 0, is_succeeded: false, layout, state, timing, samples }
    }

    /// The same part for another component, which goes on as a successor in flight does.
    #[must_use]
    pub fn succeeded(self) -> Self {
        Self { is_succeeded: true, ..self }
    }

    /// The same part, of generation `generation` of the node.
    pub(crate) fn of_process(self, generation: u32) -> Self {
        Self { generation, ..self }
    }

    /// Bytes of its state.
    #[must_use]
    pub fn state_bytes(&self) -> usize {
        self.state.len()
    }

    /// Its state.
    #[must_use]
    pub fn state(&self) -> &[u8] {
        &self.state
    }
}

impl Samples {
    /// The newest sample of each topic in `parts`.
    fn of(parts: &Parts) -> Self {
        let mut newest: Vec<SavedSample> = Vec::new();
        for sample in parts.nodes.iter().flat_map(|part| &part.samples) {
            match newest.iter_mut().find(|known| known.topic == sample.topic) {
                Some(known) if known.tick < sample.tick => *known = sample.clone(),
                Some(_) => {}
                None => newest.push(sample.clone()),
            }
        }
        Self(newest)
    }

    /// The samples from before the first tick of the run in `run_dir`.
    pub(crate) fn of_run(run_dir: &Path, plan: &Plan) -> Result<Self, BusError> {
        let path = run_dir.join(FROM).join(SAMPLES);
        if plan.first_tick == 0 { Ok(Self::default()) } else { load(&path).map(Self) }
    }

    /// The sample of `topic`.
    pub(crate) fn get(&self, topic: &str) -> Option<&SavedSample> {
        self.0.iter().find(|sample| sample.topic == topic)
    }
}

impl Parts {
    /// True if it holds a sample of the topic called `name`.
    #[must_use]
    pub fn has_sample_of(&self, name: &str) -> bool {
        self.nodes.iter().flat_map(|part| &part.samples).any(|sample| sample.topic == name)
    }

    /// The newest samples from before its tick.
    pub(crate) fn samples(&self) -> Samples {
        Samples::of(self)
    }

    /// Puts the parts where the nodes of the run in `run_dir` find them.
    ///
    /// # Errors
    /// If they cannot be written.
    pub fn store_for_run(&self, run_dir: &Path) -> Result<(), BusError> {
        let folder = run_dir.join(FROM);
        store(&folder.join(SAMPLES), &self.samples().0)?;
        let mut parts = self.nodes.iter().enumerate();
        parts.try_for_each(|(index, part)| store(&folder.join(index.to_string()), part))
    }

    /// The parts that the `nodes` nodes of the run in `run_dir` have written for `tick`; `None` before the last has.
    ///
    /// # Errors
    /// If one of them cannot be read.
    pub fn written(run_dir: &Path, cause: Cause, tick: u32, nodes: usize) -> Result<Option<Self>, BusError> {
        if !Self::are_written(run_dir, cause, tick, nodes) {
            return Ok(None);
        }
        let part = |index| load(&part_path(run_dir, cause, tick, index));
        let nodes = (0..nodes).map(part).collect::<Result<_, _>>()?;
        Ok(Some(Self { tick, nodes }))
    }

    /// True if the `nodes` nodes of the run in `run_dir` have written their parts for `tick`.
    #[must_use]
    pub fn are_written(run_dir: &Path, cause: Cause, tick: u32, nodes: usize) -> bool {
        (0..nodes).all(|index| part_path(run_dir, cause, tick, index).exists())
    }

    /// Removes the parts that the nodes have written for `tick`.
    pub fn remove_written(run_dir: &Path, cause: Cause, tick: u32) {
        // It goes with the run directory otherwise.
        let _ = std::fs::remove_dir_all(run_dir.join(cause.folder()).join(tick.to_string()));
    }
}

/// Writes the part of node `index` of the checkpoint at `tick` into `run_dir`.
pub(crate) fn store_part(
    run_dir: &Path,
    cause: Cause,
    tick: u32,
    index: usize,
    part: &NodePart,
) -> Result<(), BusError> {
    store(&part_path(run_dir, cause, tick, index), part)
}

fn part_path(run_dir: &Path, cause: Cause, tick: u32, index: usize) -> PathBuf {
    run_dir.join(cause.folder()).join(tick.to_string()).join(index.to_string())
}

/// Writes `value` to `path` in one step, in a folder that is made where it is missing.
fn store(path: &Path, value: &impl Serialize) -> Result<(), BusError> {
    let bytes =
        postcard::to_stdvec(value).unwrap_or_else(|error| unreachable!("its types serialise: {error}"));
    let folder = path.parent().map_or(Ok(()), std::fs::create_dir_all);
    let draft = path.with_extension("draft");
    let written =
        folder.and_then(|()| std::fs::write(&draft, bytes)).and_then(|()| std::fs::rename(&draft, path));
    written.map_err(|source| BusError::File { action: "write", path: path.to_owned(), source })
}

fn load<T: DeserializeOwned>(path: &Path) -> Result<T, BusError> {
    let mut bytes = Vec::new();
    let read =
        user_file::open(path, false).and_then(|file| file.take(PART_BYTES_MAX).read_to_end(&mut bytes));
    read.map_err(|source| BusError::File { action: "read", path: path.to_owned(), source })?;
    postcard::from_bytes(&bytes).map_err(|error| BusError::Content {
        path: path.to_owned(),
        expected: "a part of a checkpoint",
        found: error.to_string(),
    })
}
