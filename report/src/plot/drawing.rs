//! Content of a file with a drawing, for any format.

use super::figure::{Across, Panel, Trail};
use super::outline::Outline;
use super::request::{Format, View};
use super::scene::Solid;
use serde::Serialize;
use serde_json::{Value, json};

/// Content of a file with a drawing.
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

    /// The amounts of what a file of this `format` shows, and the span of time.
    ///
    /// ```
    /// use report::plot::{Drawing, Format, Request};
    /// # use bus::{Message, announcement::Announcement, messages::PlantState};
    /// # let folder = tempfile::tempdir()?;
    /// # let path = folder.path().join("fall.mcap");
    /// # let mut writer = recorder::writer::RecordingWriter::create(&path)?;
    /// # let channel = writer.add_channel("/plant/state", &Announcement::of(PlantState::SCHEMA))?;
    /// # for tick in 0..100_u32 {
    /// #     let cdr = [&[0, 1, 0, 0], bytemuck::bytes_of(&PlantState::default())].concat();
    /// #     writer.write(channel, tick, u64::from(tick) * 10_000_000, &cdr)?;
    /// #     writer.end_tick()?;
    /// # }
    /// # writer.finish()?;
    /// let recording = recorder::reader::Recording::open(&path)?;
    /// let plots = vec!["/plant/state:position.z".to_owned()];
    /// let drawing = Drawing::of(&recording, &Request { plots, ..Request::default() }, &mut |_| ())?;
    /// assert_eq!(drawing.amounts(Format::Png), "axes: 1 with 1 curves; from 0.000 s to 0.990 s");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn amounts(&self, format: Format) -> String {
        let views = self.views_or(format.usual_views());
        let mut parts = Vec::new();
        if views.contains(&View::Time) {
            // A picture has room for the first vehicle.
            let room = if format == Format::Html { self.panels.len() } else { 1 };
            let axes = self.panels.iter().take(room).flat_map(|panel| &panel.axes);
            let curves: usize = axes.clone().map(|axes| axes.curves.len()).sum();
            parts.push(format!("axes: {} with {curves} curves", axes.count()));
        }
        if views.iter().any(|view| *view != View::Time) {
            let (paths, things) = (self.trails.len(), self.solids.len());
            parts.push(format!("paths: {paths}; objects in the scene: {things}"));
        }
        let [from_s, to_s] = self.span_s;
        parts.push(format!("from {from_s:.3} s to {to_s:.3} s"));
        parts.join("; ")
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
