//! A recording of the server: its state, and the work that keeps up with its growth.

use crate::catalogue::{Lasting, catalogue};
use crate::fields::Listed;
use crate::overview::Overview;
use crate::shown::Shown;
use anyhow::Result;
use serde_json::{Value, json};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, PoisonError, RwLock};

/// A recording with its overview.
#[derive(Debug)]
pub struct Entry {
    known: RwLock<Arc<Known>>,
    /// Used by the thread that keeps up alone.
    parts: Mutex<Parts>,
    /// Extremes of all fields.
    pub overview: Overview,
}

/// The part of a recording read so far, and its catalogue.
#[derive(Debug)]
pub struct Known {
    /// The recording.
    pub shown: Shown,
    /// Its catalogue.
    pub catalogue: Value,
}

/// Parts of the catalogue that are kept, so that growth is read alone.
#[derive(Debug)]
struct Parts {
    listed: Listed,
    lasting: Lasting,
}

impl Entry {
    /// # Errors
    /// If the recording is damaged in front of the first message of a topic.
    pub fn of(shown: Shown) -> Result<Self> {
        let (listed, lasting) = (Listed::of(&shown)?, Lasting::of(&shown)?);
        let overview = Overview::new(listed.fields());
        let catalogue = catalogue(&shown, listed.fields(), &lasting);
        Ok(Self {
            known: RwLock::new(Arc::new(Known { shown, catalogue })),
            parts: Mutex::new(Parts { listed, lasting }),
            overview,
        })
    }

    /// The part of the recording read so far.
    pub fn known(&self) -> Arc<Known> {
        self.known.read().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Duration, blocks and number of topics; if the recording is followed, and the error that ended reading.
    pub fn growth(&self) -> Value {
        let (known, damage) = (self.known(), self.overview.damage());
        let catalogue = &known.catalogue;
        json!({
            "duration_ns": catalogue["duration_ns"],
            "blocks": catalogue["blocks"],
            "topics": catalogue["topics"].as_array().map_or(0, Vec::len),
            "is_growing": known.shown.is_growing() && damage.is_none(),
            "damage": damage,
        })
    }

    /// Reads the overview to the present end, and looks for more; true while more may come. An error ends it: the overview
    /// keeps it.
    pub fn keep_up(&self, is_over: &AtomicBool) -> bool {
        self.overview.damage().is_none()
            && self.grow(is_over).unwrap_or_else(|error| {
                self.overview.fail(format!("{error:#}"));
                false
            })
    }

    fn grow(&self, is_over: &AtomicBool) -> Result<bool> {
        let known = self.known();
        self.overview.fill(&known.shown, is_over)?;
        let Some(shown) = known.shown.grown()? else { return Ok(known.shown.is_growing()) };
        let mut parts = self.parts.lock().unwrap_or_else(PoisonError::into_inner);
        let Parts { listed, lasting } = &mut *parts;
        listed.update(&shown)?;
        lasting.update(&shown)?;
        self.overview.add_fields(listed.fields());
        let catalogue = catalogue(&shown, listed.fields(), lasting);
        *self.known.write().unwrap_or_else(PoisonError::into_inner) = Arc::new(Known { shown, catalogue });
        // The new blocks are read in the next round.
        Ok(true)
    }
}
