//! A sample that a checkpoint holds.

use serde::{Deserialize, Serialize};

/// A sample that was sent before the tick of a checkpoint.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SavedSample {
    pub(crate) topic: String,
    pub(crate) layout_hash: u64,
    pub(crate) tick: u64,
    pub(crate) sequence: u64,
    pub(crate) words: Vec<u64>,
}
