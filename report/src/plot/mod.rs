//! Pictures of a recording: curves over time, and paths in space.
//!
//! - [`choice`]: what is plotted, by `--plot` or by the types of the topics
//! - [`field`]: the numbers that a field is drawn as, in the units that people read
//! - [`read`]: the one pass over the recording
//! - [`thin`]: long curves as few points
//! - [`figure`]: named and coloured curves on axes of one unit
//! - [`scene`]: what stands around the vehicles
//! - [`html`]: the page
//! - [`picture`], [`space`]: the same as SVG and PNG: sheets, time plots; views of the paths

mod choice;
mod field;
mod figure;
mod html;
mod picture;
mod read;
mod scene;
mod space;
mod thin;

use anyhow::{Result, bail};
use choice::Choice;
use figure::{Panel, Trail};
use recorder::reader::Recording;
use scene::Solid;
use serde::Serialize;
use serde_json::{Value, json};
use std::fmt;

pub use picture::{PNG_MARK, SVG_MARK};
pub use read::Span;

/// What is drawn of a recording.
#[derive(Clone, Debug, Default)]
pub struct Request {
    /// Axes over time, each as `TOPIC:FIELD[,TOPIC:FIELD…]`; what the types of the topics suggest where empty.
    pub plots: Vec<String>,
    /// Views; where empty, a page has all and a picture has curves over time.
    pub views: Vec<View>,
    /// The only vehicle; all where absent.
    pub vehicle: Option<String>,
    /// Simulated time that is drawn.
    pub span: Span,
    /// Title; the name of the recording's file where absent.
    pub title: Option<String>,
}

/// A way to look at a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum View {
    /// Curves over time.
    Time,
    /// The paths in space, with the scene.
    Path,
    /// The paths from above.
    Top,
    /// The paths from the side.
    Side,
}

/// What the axis of time shows.
const TIME_LABEL: &str = "simulated time [s]";

/// All that a file shows; its text says how much that is.
#[derive(Debug)]
pub struct Drawing {
    title: String,
    recording: String,
    span_s: [f64; 2],
    views: Vec<View>,
    panels: Vec<Panel>,
    trails: Vec<Trail>,
    solids: Vec<Solid>,
}

impl Drawing {
    /// Reads from `recording` what `request` asks for; `read` hears how many messages are read, now and then.
    ///
    /// # Errors
    /// If something that was asked for is not in the recording.
    pub fn of(recording: &Recording, request: &Request, read: &mut dyn FnMut(u64)) -> Result<Self> {
        let choice = Choice::of(recording, &request.plots, request.vehicle.as_deref())?;
        let read = read::read(recording, &choice, request.span, read)?;
        let name = recording.path().file_name().unwrap_or_default().to_string_lossy().into_owned();
        let drawing = Self {
            title: request.title.clone().unwrap_or_else(|| name.clone()),
            recording: name,
            span_s: read.span_s,
            views: request.views.clone(),
            panels: figure::panels(&choice, &read)?,
            trails: figure::trails(&choice, &read),
            solids: scene::scene_of(recording)?,
        };
        if drawing.trails.is_empty() && request.views.iter().any(|view| *view != View::Time) {
            bail!("the recording has no path to draw: no topic holds the position of a vehicle");
        }
        Ok(drawing)
    }

    /// The file that shows it.
    ///
    /// # Errors
    /// If there is nothing to draw, or the picture would be too large.
    pub fn file(&self, format: Format) -> Result<Vec<u8>> {
        match format {
            Format::Html => Ok(html::page(self)),
            Format::Svg => picture::svg(self).map(String::into_bytes),
            Format::Png => picture::svg(self).and_then(|svg| picture::png(&svg)),
        }
    }

    /// What is drawn: names, units and numbers of points.
    #[must_use]
    pub fn json(&self) -> Value {
        json!({
            "recording": self.recording,
            "span_s": self.span_s,
            "panels": self.panels,
            "trails": self.trails,
            "solids": self.solids,
        })
    }

    /// The views that were asked for, or else those of `usual` that there is something for.
    fn views_or(&self, usual: &[View]) -> Vec<View> {
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
        write!(
            f,
            "axes: {} with {curves} curves; paths: {}; boxes: {}; from {:.3} s to {:.3} s",
            axes.count(),
            self.trails.len(),
            self.solids.len(),
            self.span_s[0],
            self.span_s[1]
        )
    }
}

/// A kind of file that shows a drawing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Format {
    /// A page that needs no network.
    Html,
    /// A picture of dots.
    Png,
    /// A picture of lines.
    Svg,
}
