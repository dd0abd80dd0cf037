//! State of a connected node as words: the bytes of its computation, then the words of the bus.

use crate::checkpoint::NodePart;
use crate::component::Transfer;
use crate::computation::Computation;
use crate::error::BusError;
use crate::links::Links;
use crate::saved_sample::SavedSample;
use crate::state_transfer::{StateLayout, StateRing};

/// State of a node, and the rings by which processes of the node hand it to each other.
#[derive(Debug)]
pub(crate) struct HandOver {
    transfer: Transfer,
    layout: Option<StateLayout>,
    /// The state, then the words of the bus.
    words: Vec<u64>,
    state_words: usize,
    published: Option<StateRing>,
    predecessor: Option<StateRing>,
}

impl HandOver {
    /// The state of `computation` with `more_words` of the bus behind it.
    pub(crate) fn new(transfer: Transfer, computation: &dyn Computation, more_words: usize) -> Self {
        let layout = StateLayout::of(transfer, computation.state_size(), computation.configuration());
        let state_words = layout.as_ref().map_or(0, StateLayout::words);
        let words = vec![0; state_words + more_words];
        Self { transfer, layout, words, state_words, published: None, predecessor: None }
    }

    /// Opens the ring of the predecessor, which is generation `generation` and has `more_words` of the bus behind its
    /// state. Returns false if that publishes no state of this layout.
    pub(crate) fn open(
        &mut self,
        links: &Links,
        generation: u32,
        more_words: usize,
    ) -> Result<bool, BusError> {
        if let Some(layout) = &self.layout {
            let (dir, plan) = (&links.run_dir, &links.plan);
            self.predecessor = StateRing::open(dir, plan, links.index, generation, layout, more_words)?;
        }
        Ok(self.predecessor.is_some())
    }

    /// Creates the ring of this process.
    pub(crate) fn create(&mut self, links: &Links) -> Result<(), BusError> {
        if let Some(layout) = &self.layout {
            let (dir, plan, more_words) = (&links.run_dir, &links.plan, self.words.len() - self.state_words);
            self.published =
                Some(StateRing::create(dir, plan, links.index, links.generation, layout, more_words)?);
        }
        Ok(())
    }

    /// The words of the bus behind the state.
    pub(crate) fn more_words(&mut self) -> &mut [u64] {
        &mut self.words[self.state_words..]
    }

    /// Publishes the state of `node` at the start of `tick`; returns false if it publishes none.
    pub(crate) fn publish(&mut self, tick: u32, node: &dyn Computation) -> bool {
        let (Some(ring), Some(layout)) = (&self.published, &self.layout) else { return false };
        let (state, _) = self.words.split_at_mut(self.state_words);
        node.save(&mut bytemuck::cast_slice_mut(state)[..layout.size]);
        ring.store(tick, &self.words);
        true
    }

    /// True if the predecessor publishes a state that this node can load.
    pub(crate) fn has_predecessor(&self) -> bool {
        self.predecessor.is_some()
    }

    /// Loads the state that the predecessor had at the start of `tick` into `node`.
    ///
    /// # Errors
    /// The ring does not hold it, or it does not fit.
    pub(crate) fn load(&mut self, tick: u32, node: &mut dyn Computation) -> Result<(), String> {
        let (Some(ring), Some(layout)) = (&self.predecessor, &self.layout) else { return Ok(()) };
        // If the predecessor's steps take no time, it has no words of the bus, and those of this process stay.
        if !ring.load(tick, &mut self.words) {
            return Err(format!("the state that its predecessor had at tick {tick} is gone"));
        }
        let state = &bytemuck::cast_slice(&self.words[..self.state_words])[..layout.size];
        node.load(state).map_err(|error| error.to_string())
    }

    /// The part of a checkpoint of the node `name`, whose state `node` has and whose inputs read `samples`.
    pub(crate) fn part(&self, name: &str, samples: Vec<SavedSample>, node: &dyn Computation) -> NodePart {
        NodePart::new(name, self.transfer, node, &self.words[self.state_words..], samples)
    }

    /// True if `node` can load the state of `part`.
    pub(crate) fn fits(&self, part: &NodePart, node: &dyn Computation) -> bool {
        part.fits(self.transfer, node)
    }

    /// Goes on from `part` of a checkpoint.
    ///
    /// # Errors
    /// If it does not fit `node`.
    pub(crate) fn restore(&mut self, part: &NodePart, node: &mut dyn Computation) -> Result<(), BusError> {
        part.restore(self.transfer, node, &mut self.words[self.state_words..])
    }

    /// Forgets the predecessor.
    pub(crate) fn leave_predecessor(&mut self) {
        self.predecessor = None;
    }
}

impl Default for HandOver {
    /// The hand-over of a node without a state.
    fn default() -> Self {
        let (layout, words, state_words) = (None, Vec::new(), 0);
        Self { transfer: Transfer::Nothing, layout, words, state_words, published: None, predecessor: None }
    }
}
