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

use crate::files::open_recording;
use crate::output::print_text;
use crate::output_file::{self, Kind, is_same};
use anyhow::{Context, Result, bail};
use choice::Choice;
use clap::{Args, ValueEnum};
use figure::{Panel, Trail};
use read::Span;
use scene::Solid;
use serde::Serialize;
use serde_json::json;
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// Examples that `--help` shows.
pub const HELP: &str = "Examples:
  hummingbus plot hover.mcap                                   writes the page hover.html
  hummingbus plot hover.mcap --plot /plant/state:position.z,/pilot/set_point:altitude --png altitude.png
  hummingbus plot swarm.mcap --figure top --figure path --out swarm.svg";

/// What `hummingbus plot` is asked for.
#[derive(Args)]
pub struct PlotArguments {
    /// The recording.
    recording: PathBuf,
    /// One set of axes over time: TOPIC:FIELD[,TOPIC:FIELD…]; may be repeated. A field is a number
    /// (`position.z`), a vector, an array, or a quaternion, which is drawn as roll, pitch and yaw. Left out: what
    /// the types of the topics suggest.
    #[arg(long, value_name = "TOPIC:FIELD,…")]
    plot: Vec<String>,
    /// Only this view; may be repeated. Left out: a page has all, a picture `time`.
    #[arg(long, value_enum)]
    figure: Vec<View>,
    /// Only this vehicle.
    #[arg(long, value_name = "NAME")]
    vehicle: Option<String>,
    /// First second of simulated time.
    #[arg(long, value_name = "S", default_value_t = 0.0)]
    from: f64,
    /// Last second of simulated time.
    #[arg(long, value_name = "S")]
    to: Option<f64>,
    /// Title; the recording's name if left out.
    #[arg(long)]
    title: Option<String>,
    /// Write this file, a page (.html) or a picture (.png, .svg); may be repeated. The recording's name with
    /// `.html` if no file is named.
    #[arg(long, value_name = "FILE")]
    out: Vec<PathBuf>,
    /// Write a picture as PNG.
    #[arg(long, value_name = "FILE")]
    png: Option<PathBuf>,
    /// Write a picture as SVG.
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
    /// Print JSON: what was plotted, and the files.
    #[arg(long)]
    json: bool,
}

/// A way to look at a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
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

/// All that a file shows.
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
    /// What the axis of time shows.
    fn time_label(&self) -> &'static str {
        "simulated time [s]"
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

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
enum Format {
    Html,
    Png,
    Svg,
}

impl Format {
    fn kind(self) -> &'static Kind {
        match self {
            Self::Html => &crate::page::KIND,
            Self::Png => &picture::PNG,
            Self::Svg => &picture::SVG,
        }
    }
}

/// Plots a recording; false if it was cut off.
///
/// # Errors
/// If something that was asked for is not in the recording, or a file cannot be written.
pub fn plot(arguments: &PlotArguments) -> Result<bool> {
    let files = outputs(arguments)?;
    let span = span(arguments)?;
    let recording = open_recording(&arguments.recording)?;
    let choice = Choice::of(&recording, &arguments.plot, arguments.vehicle.as_deref())?;
    let read = read::read(&recording, &choice, span)?;
    let name = recording.path().file_name().unwrap_or_default().to_string_lossy().into_owned();
    let drawing = Drawing {
        title: arguments.title.clone().unwrap_or_else(|| name.clone()),
        recording: name,
        span_s: read.span_s,
        views: arguments.figure.clone(),
        panels: figure::panels(&choice, &read)?,
        trails: figure::trails(&choice, &read),
        solids: scene::scene_of(&recording)?,
    };
    if drawing.trails.is_empty() && arguments.figure.iter().any(|view| *view != View::Time) {
        bail!("the recording has no path to draw: no topic holds the position of a vehicle");
    }
    for (format, path) in &files {
        write(&drawing, *format, path)?;
    }
    print_text(&if arguments.json { as_json(&drawing, &files)? } else { as_text(&drawing, &files) })?;
    Ok(recording.cut().is_none())
}

fn span(arguments: &PlotArguments) -> Result<Span> {
    let (from_s, to_s) = (arguments.from, arguments.to);
    if !from_s.is_finite() || to_s.is_some_and(|to_s| to_s.is_nan() || to_s <= from_s) {
        bail!("--from {from_s} --to {}: the end must be after the start", to_s.unwrap_or(f64::NAN));
    }
    Ok(Span { from_s, to_s })
}

/// The files to write; checked before the recording is read for them.
fn outputs(arguments: &PlotArguments) -> Result<Vec<(Format, PathBuf)>> {
    let mut files = Vec::new();
    for path in &arguments.out {
        files.push((format_of(path)?, path.clone()));
    }
    files.extend(arguments.png.iter().map(|path| (Format::Png, path.clone())));
    files.extend(arguments.svg.iter().map(|path| (Format::Svg, path.clone())));
    if files.is_empty() {
        files.push((Format::Html, arguments.recording.with_extension("html")));
    }
    for (index, (format, path)) in files.iter().enumerate() {
        if is_same(path, &arguments.recording) {
            bail!("{} is the recording itself: name another file", path.display());
        }
        if files[..index].iter().any(|(_, other)| is_same(path, other)) {
            bail!("{} is named twice: name another file", path.display());
        }
        output_file::check(path, format.kind())?;
    }
    Ok(files)
}

fn format_of(path: &Path) -> Result<Format> {
    match path.extension().and_then(|extension| extension.to_str()) {
        Some("html") => Ok(Format::Html),
        Some("png") => Ok(Format::Png),
        Some("svg") => Ok(Format::Svg),
        _ => bail!("--out {}: its name must end in .html, .png or .svg", path.display()),
    }
}

fn write(drawing: &Drawing, format: Format, path: &Path) -> Result<()> {
    let bytes = match format {
        Format::Html => return output_file::write(path, format.kind(), |out| html::write(drawing, out)),
        Format::Svg => picture::svg(drawing).map(String::into_bytes),
        Format::Png => picture::svg(drawing).and_then(|svg| picture::png(&svg)),
    };
    let bytes = bytes.with_context(|| format!("cannot draw {}", path.display()))?;
    output_file::write(path, format.kind(), |out| out.write_all(&bytes))
}

fn as_json(drawing: &Drawing, files: &[(Format, PathBuf)]) -> Result<String> {
    let files = files.iter().map(|(format, path)| json!({ "path": path, "format": format }));
    let value = json!({
        "recording": drawing.recording,
        "span_s": drawing.span_s,
        "panels": drawing.panels,
        "trails": drawing.trails,
        "solids": drawing.solids,
        "files": files.collect::<Vec<_>>(),
    });
    Ok(serde_json::to_string_pretty(&value)?)
}

fn as_text(drawing: &Drawing, files: &[(Format, PathBuf)]) -> String {
    let axes = drawing.panels.iter().flat_map(|panel| &panel.axes);
    let curves: usize = axes.clone().map(|axes| axes.curves.len()).sum();
    let summary = format!(
        "axes: {} with {curves} curves; paths: {}; boxes: {}; from {:.3} s to {:.3} s",
        axes.count(),
        drawing.trails.len(),
        drawing.solids.len(),
        drawing.span_s[0],
        drawing.span_s[1]
    );
    let files = files.iter().map(|(format, path)| match format {
        Format::Html => format!("page: {}", path.display()),
        Format::Png | Format::Svg => format!("picture: {}", path.display()),
    });
    std::iter::once(summary).chain(files).collect::<Vec<_>>().join("\n")
}
