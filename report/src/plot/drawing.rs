//! Content of a file with a drawing, for any format.

use super::figure::{Across, Panel, Trail};
use super::outline::Outline;
use super::request::View;
use super::scene::Solid;
use serde::Serialize;
use serde_json::{Value, json};
use std::fmt;

/// Content of a file with a drawing; its text states the amounts.
#[derive(Debug, Serialize)]
pub struct Drawing {
    #[serde(skip)]
    pub(super) title: String,
    pub(super) recording: String,
    pub(super) span_s: [f64; 2],
    pub(super) across: Across,
    #[serde(skip)]
    pub(super) views: Vec<View>,
    pub(super) panels: Vec<Panel>,
    pub(super) trails: Vec<Trail>,
    pub(super) airframes: Vec<Outline>,
    pub(super) solids: Vec<Solid>,
}

impl Drawing {
    /// Names, units and numbers of points of the drawing.
    #[must_use]
    pub fn json(&self) -> Value {
        json!(self)
    }

    /// The requested views, or else those of `usual` that have content.
    pub(super) fn views_or(&self, usual: &[View]) -> Vec<View> {
        let has_some =
            |view: &View| if *view == View::Time { !self.panels.is_empty() } else { !self.trails.is_empty() };
        if self.views.is_empty() {
            usual.iter().copied().filter(has_some).collect()
        } else {
            self.views.clone()
        }
    }
}

impl fmt::Display for Drawing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let axes = self.panels.iter().flat_map(|panel| &panel.axes);
        let curves: usize = axes.clone().map(|axes| axes.curves.len()).sum();
        let (axes, paths, things, [from_s, to_s]) =
            (axes.count(), self.trails.len(), self.solids.len(), self.span_s);
        write!(f, "axes: {axes} with {curves} curves; paths: {paths}; objects in the scene: {things}; ")?;
        write!(f, "from {from_s:.3} s to {to_s:.3} s")
    }
}
