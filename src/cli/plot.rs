//! The command `plot`.

use super::files::{PAGE, open_recording};
use super::output::{print_json, print_text};
use super::progress;
use anyhow::{Context, Result, bail};
use clap::{Args, ValueEnum};
use indicatif::ProgressBar;
use recorder::reader::Recording;
use report::plot::{Drawing, Format, PNG_MARK, Request, SVG_MARK, Span, View};
use runtime::output_file::{self, Kind, Mark, is_same};
use serde_json::{Value, json};
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// Examples that `--help` shows.
pub const HELP: &str = "Examples:
  hummingbus plot hover.mcap                                   writes the page hover.html
  hummingbus plot hover.mcap --plot /plant/state:position.z,/pilot/set_point:altitude --png altitude.png
  hummingbus plot swarm.mcap --figure top --figure path --out swarm.svg";

/// A recording of more messages takes seconds to read, and shows how far it is.
const MESSAGES_QUICK: u64 = 200_000;

const PNG: Kind = Kind { name: "PNG picture", mark: Mark::Within(PNG_MARK) };
const SVG: Kind = Kind { name: "SVG picture", mark: Mark::Within(SVG_MARK.as_bytes()) };

/// Arguments of `plot`.
#[derive(Args)]
pub struct PlotArguments {
    /// The recording.
    recording: PathBuf,
    /// One set of axes over time: TOPIC:FIELD[,TOPIC:FIELD…]; may be repeated. A field is a number
    /// (`position.z`), a vector, an array, or a quaternion, which is drawn as roll, pitch and yaw. Left out: what
    /// the types of the topics suggest.
    #[arg(long, value_name = "TOPIC:FIELD,…")]
    plot: Vec<String>,
    /// Draw the curves against this number instead of time: TOPIC:FIELD.
    #[arg(long, value_name = "TOPIC:FIELD")]
    against: Option<String>,
    /// Draw motor commands as throttle, in % of this many counts; the Hummingbird's full throttle is 200.
    #[arg(long, value_name = "COUNTS")]
    full_throttle: Option<f64>,
    /// Only this view; may be repeated. Left out: a page has all, a picture `time`.
    #[arg(long, value_enum)]
    figure: Vec<Figure>,
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

#[derive(Clone, Copy, ValueEnum)]
enum Figure {
    /// Curves over time.
    Time,
    /// The paths in space, with the scene.
    Path,
    /// The paths from above.
    Top,
    /// The paths from the side.
    Side,
}

impl From<Figure> for View {
    fn from(figure: Figure) -> Self {
        match figure {
            Figure::Time => Self::Time,
            Figure::Path => Self::Path,
            Figure::Top => Self::Top,
            Figure::Side => Self::Side,
        }
    }
}

/// Plots a recording; false if it was cut off.
///
/// # Errors
/// If a requested topic or field is not in the recording, or a file cannot be written.
pub fn plot(arguments: &PlotArguments) -> Result<bool> {
    let files = outputs(arguments)?;
    let request = Request {
        plots: arguments.plot.clone(),
        views: arguments.figure.iter().map(|figure| View::from(*figure)).collect(),
        vehicle: arguments.vehicle.clone(),
        span: span(arguments)?,
        title: arguments.title.clone(),
        full_throttle: full_throttle(arguments)?,
        against: arguments.against.clone(),
    };
    let recording = open_recording(&arguments.recording)?;
    let bar = bar(&recording);
    let drawing = Drawing::of(&recording, &request, &mut |read| bar.set_position(read))?;
    bar.finish_and_clear();
    for (format, path) in &files {
        let bytes = drawing.file(*format).with_context(|| format!("cannot draw {}", path.display()))?;
        output_file::write(path, kind(*format), |out| out.write_all(&bytes))?;
    }
    if arguments.json {
        print_json(&as_json(&drawing, &files))?;
    } else {
        print_text(&as_text(&drawing, &files))?;
    }
    Ok(recording.cut().is_none())
}

fn span(arguments: &PlotArguments) -> Result<Span> {
    let (from_s, to_s) = (arguments.from, arguments.to);
    if !from_s.is_finite() || to_s.is_some_and(|to_s| to_s.is_nan() || to_s <= from_s) {
        bail!("--from {from_s} --to {}: the end must be after the start", to_s.unwrap_or(f64::NAN));
    }
    Ok(Span { from_s, to_s })
}

fn full_throttle(arguments: &PlotArguments) -> Result<Option<f64>> {
    match arguments.full_throttle {
        Some(counts) if !(counts.is_finite() && counts > 0.0) => {
            bail!("--full-throttle {counts}: expected a number of counts above 0")
        }
        counts => Ok(counts),
    }
}

/// The files to write; checked before the recording is read for them.
fn outputs(arguments: &PlotArguments) -> Result<Vec<(Format, PathBuf)>> {
    let out = arguments.out.iter().map(|path| Ok((format_of(path)?, path.clone())));
    let mut files: Vec<_> = out.collect::<Result<_>>()?;
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
        require_name(*format, path)?;
        output_file::check(path, kind(*format))?;
    }
    Ok(files)
}

/// Refuses a picture whose name says that it is another kind of file.
fn require_name(format: Format, path: &Path) -> Result<()> {
    let (option, ending) = match format {
        Format::Html => return Ok(()),
        Format::Png => ("--png", "png"),
        Format::Svg => ("--svg", "svg"),
    };
    if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case(ending)) {
        return Ok(());
    }
    bail!("{option} {}: its name must end in .{ending}; --out takes pages and pictures", path.display())
}

fn format_of(path: &Path) -> Result<Format> {
    match path.extension().and_then(|extension| extension.to_str()) {
        Some("html") => Ok(Format::Html),
        Some("png") => Ok(Format::Png),
        Some("svg") => Ok(Format::Svg),
        _ => bail!("--out {}: its name must end in .html, .png or .svg", path.display()),
    }
}

fn kind(format: Format) -> &'static Kind {
    match format {
        Format::Html => &PAGE,
        Format::Png => &PNG,
        Format::Svg => &SVG,
    }
}

/// A bar that is seen where reading takes long.
fn bar(recording: &Recording) -> ProgressBar {
    let messages = recording.topics().values().map(|topic| topic.message_count).sum();
    let bar = progress::bar("{bar:30} {percent} % read  {eta} left", messages < MESSAGES_QUICK);
    bar.set_length(messages);
    bar
}

fn as_json(drawing: &Drawing, files: &[(Format, PathBuf)]) -> Value {
    let mut value = drawing.json();
    value["files"] = files.iter().map(|(format, path)| json!({ "path": path, "format": format })).collect();
    value
}

fn as_text(drawing: &Drawing, files: &[(Format, PathBuf)]) -> String {
    let files = files.iter().map(|(format, path)| {
        let name = if *format == Format::Html { "page" } else { "picture" };
        format!("{}\n{name}: {}", drawing.amounts(*format), path.display())
    });
    files.collect::<Vec<_>>().join("\n")
}
