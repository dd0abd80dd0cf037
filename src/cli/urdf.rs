//! The command `urdf`.

use super::files::{open_recording, require_kind};
use super::kind::Kind as FileKind;
use super::output::print_file;
use anyhow::{Context, Result, bail};
use clap::Args;
use hummingbus::bus::messages::body_frame;
use hummingbus::plant::Airframe;
use hummingbus::vehicles::Vehicle;
use report::airframe::Body;
use report::attached::Attached;
use runtime::output_file::{self, Kind, Mark, is_same};
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// Examples that `--help` shows.
pub const HELP: &str = "Examples:
  hummingbus urdf vehicles/hummingbird.toml --out hummingbird.urdf
  hummingbus urdf swarm.mcap --vehicle h1 --out h1.urdf";

const URDF: Kind = Kind { name: "URDF file", mark: Mark::Within(report::urdf::MARK.as_bytes()) };

/// Arguments of `urdf`.
#[derive(Args)]
pub struct UrdfArguments {
    /// The vehicle file, or a recording (.mcap), which has the files of its vehicles attached.
    vehicle_or_recording: PathBuf,
    /// The vehicle of a recording that has several.
    #[arg(long, value_name = "NAME")]
    vehicle: Option<String>,
    /// Write this file; left out: print it.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// The name of the link: the frame that moves the body. Left out: that which the plant publishes, hb_body or
    /// VEHICLE/body.
    #[arg(long, value_name = "NAME")]
    frame: Option<String>,
}

/// Writes a vehicle's body in the Unified Robot Description Format.
///
/// # Errors
/// If the vehicle cannot be read, or the file not be written.
pub fn urdf(arguments: &UrdfArguments) -> Result<bool> {
    let from = &arguments.vehicle_or_recording;
    if arguments.frame.as_ref().is_some_and(|frame| frame.trim().is_empty()) {
        bail!("--frame: expected the name of a frame, such as hb_body, found an empty one");
    }
    if let Some(out) = &arguments.out {
        if is_same(out, from) {
            bail!("{} is what is read: name another file", out.display());
        }
        output_file::check(out, &URDF)?;
    }
    let is_recording = from.extension().is_some_and(|extension| extension == "mcap");
    let (name, body) = match &arguments.vehicle {
        _ if is_recording => of_recording(from, arguments.vehicle.as_deref())?,
        None => (String::new(), of_file(from)?),
        Some(name) => bail!("--vehicle {name}: a vehicle file has one vehicle; name a recording (.mcap)"),
    };
    let frame = arguments.frame.clone().unwrap_or_else(|| body_frame(&name));
    let text = report::urdf::text(&body, &frame);
    match &arguments.out {
        Some(out) => output_file::write(out, &URDF, |file| file.write_all(text.as_bytes()))?,
        None => print_file(&text)?,
    }
    Ok(true)
}

fn of_file(path: &Path) -> Result<Body> {
    // A model of another program has an error of its own.
    if path.extension().is_some_and(|extension| extension == "toml") {
        require_kind(path, &[FileKind::Vehicle], "urdf takes a vehicle file or a recording")?;
    }
    let airframe = Airframe::from_files(Vehicle::load(path)?, &[])?;
    let nothing = || format!("{}: its rotors are all in one place, so that it has no size", path.display());
    Body::of(&airframe).with_context(nothing)
}

/// The name of the vehicle, empty where it has none, and its body.
fn of_recording(path: &Path, name: Option<&str>) -> Result<(String, Body)> {
    let recording = open_recording(path)?;
    let attached = Attached::to(&recording)?;
    // The topics show the vehicles of a recording without a manifest.
    let has_topics = |name: &str| {
        let prefix = format!("/{name}/");
        recording.topics().keys().any(|topic| topic.starts_with(&prefix))
    };
    let (names, path) = (attached.names(), path.display());
    let name = match name {
        Some(name) if !names.contains(&name) && (!names.is_empty() || !has_topics(name)) => {
            let known = if names.is_empty() { "one without a name".to_owned() } else { names.join(", ") };
            bail!("the recording {path} has no vehicle `{name}`; it has {known}")
        }
        None if names.len() > 1 => {
            bail!("the recording {path} has {}: choose one with --vehicle", names.join(", "))
        }
        name => name.or(names.first().copied()).unwrap_or_default(),
    };
    let nothing = || {
        format!(
            "the recording {path} has no file of the vehicle attached that can be read: name the vehicle file"
        )
    };
    Ok((name.to_owned(), attached.body(name).with_context(nothing)?))
}
