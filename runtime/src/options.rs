//! Options of a launcher: values in place of keys of a manifest, and shadows beside those that it names.

use crate::graph::Graph;
use crate::manifest::{Composition, Manifest, PaceSetting};
use bus::plan::Pace;
use diagnostics::Diagnostic;
use std::borrow::Cow;
use toml::{Spanned, Table};

/// Options of a launcher. Those that are absent leave the manifest as it is.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// In place of `run.pace`.
    pub pace: Option<Pace>,
    /// In place of `run.window_ticks`.
    pub window_ticks: Option<u32>,
    /// In place of `run.compose` and the `[group]` tables.
    pub composition: Option<Composition>,
    /// True if the run is profiled, whatever `run.profile` says.
    pub is_profiled: bool,
    /// Processes that get a shadow, with the keys in which it differs.
    pub shadows: Vec<(String, Table)>,
}

impl Options {
    /// `manifest` with the options in place of its keys.
    ///
    /// # Errors
    /// If the pace is out of its range. [`Graph::build`] checks the others.
    pub fn stated_in<'m>(&self, manifest: &'m Manifest) -> Result<Cow<'m, Manifest>, Diagnostic> {
        let mut stated = Cow::Borrowed(manifest);
        if let Some(pace) = self.pace {
            let text = PaceSetting(pace).to_string();
            let manifest = stated.to_mut();
            let span = manifest.note_option("run.pace", &text);
            let parsed = text.parse::<PaceSetting>();
            manifest.content.run.pace = parsed.map_err(|error| manifest.problem(&span, error, ""))?;
        }
        if let Some(ticks) = self.window_ticks {
            let manifest = stated.to_mut();
            let span = manifest.note_option("run.window_ticks", ticks);
            manifest.content.run.window_ticks = Some(Spanned::new(span, ticks));
        }
        if let Some(composition) = &self.composition {
            let manifest = stated.to_mut();
            let span = manifest.note_option("run.compose", composition);
            manifest.content.run.compose = Some(Spanned::new(span, composition.clone()));
        }
        if self.is_profiled {
            stated.to_mut().content.run.profile = true;
        }
        Ok(stated)
    }

    /// Adds the shadows to `graph`, the checked `manifest`.
    ///
    /// # Errors
    /// As [`Graph::add_shadow`].
    pub fn add_shadows(&self, manifest: &Manifest, graph: &mut Graph) -> Result<(), Diagnostic> {
        let mut shadows = self.shadows.iter();
        shadows.try_for_each(|(process, with)| graph.add_shadow(manifest, process, &with.to_string()))
    }
}
