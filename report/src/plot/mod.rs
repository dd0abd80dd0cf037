//! Pictures of a recording: curves over time, and paths in space.
//!
//! - `request`: the request for a drawing
//! - `choice`: the choice of the curves, by `--plot` or by the types of the topics
//! - `field`: the numbers that a field is drawn as, in the units that people read
//! - `read`: the one pass over the recording
//! - `thin`: long curves as few points
//! - `figure`: named and coloured curves on axes of one unit
//! - `scene`: the things around the vehicles
//! - `outline`: the vehicles along their paths
//! - `drawing`: the content of a file
//! - `html`: the page
//! - `ink`: lines, letters and legends of pictures
//! - `picture`, `space`: the same as SVG and PNG: sheets, time plots; views of the paths

mod choice;
mod drawing;
mod field;
mod figure;
mod html;
mod ink;
mod outline;
mod picture;
mod read;
mod request;
mod scene;
mod space;
mod thin;

use crate::attached::Attached;
use anyhow::anyhow;
use choice::Choice;
use diagnostics::Error;
use recorder::reader::Recording;

pub use drawing::Drawing;
pub use picture::{PNG_MARK, SVG_MARK};
pub use request::{Format, Request, Span, View};
pub use scene::{Solid, bodies_of, scene_of};

impl Drawing {
    /// Reads from `recording` what `request` asks for; `read` hears how many messages are read, now and then.
    ///
    /// ```
    /// use report::plot::{Drawing, Format, Request};
    /// # use bus::{Message, announcement::Announcement, messages::PlantState};
    /// # let folder = tempfile::tempdir()?;
    /// # let path = folder.path().join("fall.mcap");
    /// # let mut writer = recorder::writer::RecordingWriter::create(&path)?;
    /// # let channel = writer.add_channel("/plant/state", &Announcement::of(PlantState::SCHEMA))?;
    /// # for tick in 0..100_u32 {
    /// #     let mut state = PlantState::default();
    /// #     state.position.z = 10.0 - 5.0 * (f64::from(tick) * 0.01).powi(2);
    /// #     let cdr = [&[0, 1, 0, 0], bytemuck::bytes_of(&state)].concat();
    /// #     writer.write(channel, tick, u64::from(tick) * 10_000_000, &cdr)?;
    /// #     writer.end_tick()?;
    /// # }
    /// # writer.finish()?;
    /// let recording = recorder::reader::Recording::open(&path)?;
    /// let plots = vec!["/plant/state:position.z".to_owned()];
    /// let request = Request { plots, title: Some("A fall".to_owned()), ..Request::default() };
    ///
    /// let drawing = Drawing::of(&recording, &request, &mut |_messages_read| ())?;
    ///
    /// let axes = &drawing.json()["panels"][0]["axes"][0];
    /// assert_eq!((&axes["unit"], &axes["curves"][0]["samples"]), (&"m".into(), &100.into()));
    /// assert!(drawing.file(Format::Svg)?.starts_with(b"<svg"));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// If something that was asked for is not in the recording.
    pub fn of(recording: &Recording, request: &Request, read: &mut dyn FnMut(u64)) -> Result<Self, Error> {
        let mut choice = Choice::of(recording, request)?;
        let span_s = read::read(recording, &mut choice, request, read)?;
        let name = recording.path().file_name().unwrap_or_default().to_string_lossy().into_owned();
        let trails = figure::trails(&choice.trails);
        let drawing = Self {
            title: request.title.clone().unwrap_or_else(|| name.clone()),
            recording: name,
            span_s,
            across: figure::across(&choice, span_s)?,
            views: request.views.clone(),
            panels: figure::panels(&choice.axes)?,
            airframes: outline::outlines(&choice.trails, &trails, &Attached::to(recording)?),
            trails,
            solids: scene::scene_of(recording)?,
        };
        if drawing.trails.is_empty() && request.views.iter().any(|view| *view != View::Time) {
            let none = "the recording has no path to draw: no topic holds the position of a vehicle";
            return Err(anyhow!(none).into());
        }
        Ok(drawing)
    }

    /// The file that shows it.
    ///
    /// # Errors
    /// If there is nothing to draw, or the picture would be too large.
    pub fn file(&self, format: Format) -> Result<Vec<u8>, Error> {
        match format {
            Format::Html => Ok(html::page(self)),
            Format::Svg => Ok(picture::svg(self)?.into_bytes()),
            Format::Png => Ok(picture::png(&picture::svg(self)?)?),
        }
    }
}
