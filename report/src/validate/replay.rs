//! One flight as a run: its data, its manifest, and the flight itself.
//!
//! The player plays the flight from its first moment on. For each vehicle and each length of window a plant flies the
//! commands, set to the measured state at the start of each window; all in one run, so that all fly the same.

use anyhow::{Context, Result, bail};
use flights::{Flight, MeasuredVoltage, Played};
use inputs::InputFiles;
use recorder::reader::Recording;
use runtime::event::{RunEvent, StopToken};
use runtime::host::Host;
use runtime::launcher::Launcher;
use runtime::manifest::ManifestBuilder;
use runtime::output_file::{self, Kind, Mark, is_same};
use runtime::registry::Registry;
use std::fs::File;
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// Lengths of the windows, in milliseconds.
pub const HORIZONS_MS: [u32; 3] = [100, 500, 1000];

/// The topic of the measured states.
pub const MEASURED: &str = "/player/measured";

/// The topic of the measured voltage of the battery.
const BATTERY: &str = "/player/battery";

/// Ticks a second.
const RATE_HZ: u32 = 1000;

/// Ticks between two recorded states: 100 Hz, enough to plot; the ends of all windows are among them.
const RECORDED_TICKS: u32 = 10;

const DATA: &str = "flight.csv";
const MANIFEST: &str = "manifest.toml";
const RECORDING: &str = "flight.mcap";
/// The first line of a manifest that is written here.
const MANIFEST_START: &str = "# A measured flight, flown again in windows. Written by `hummingbus validate`.";
const WRITTEN: Kind = Kind { name: "manifest of a replay", mark: Mark::Start(MANIFEST_START.as_bytes()) };
const CSV: Kind = Kind { name: "flight in SI", mark: Mark::Start(flights::HEADER_START.as_bytes()) };

/// First parts of the names of the vehicles' plants.
const VEHICLES: [&str; 2] = ["first", "second"];

/// A flight that is ready to be flown.
#[derive(Debug)]
pub struct Replay {
    /// Folder of its files.
    pub folder: PathBuf,
    manifest: ManifestBuilder,
    /// The rows that the player plays; tick 0 lies at its first row.
    pub played: Played,
    /// Ticks of the run.
    ticks: u32,
    /// Held so that no other command writes to the folder.
    _lock: File,
}

/// The name of the plant that flies vehicle number `vehicle` in windows of `horizon_ms`.
pub fn plant(vehicle: usize, horizon_ms: u32) -> String {
    format!("{}-{horizon_ms}ms", VEHICLES.get(vehicle).unwrap_or(&"other"))
}

impl Replay {
    /// Writes the files for a run of `flight` with `vehicles` into a folder of its own in `folder`.
    ///
    /// # Errors
    /// A flight without commands or shorter than the shortest window, or a folder that cannot be written to.
    pub fn prepare(flight: &Flight, vehicles: &[&Path], folder: &Path) -> Result<Self> {
        let folder = std::path::absolute(folder)?.join(file_name(&flight.name));
        output_file::make_folder(&folder)?;
        let lock = output_file::lock_folder(&folder)?;
        let data = folder.join(DATA);
        for output in [data.clone(), folder.join(MANIFEST), folder.join(RECORDING)] {
            require_no_input(&output, flight, vehicles)?;
        }
        let played = Played::of(flight)?;
        output_file::write(&data, &CSV, |out| out.write_all(played.csv().as_bytes()))?;
        let (start_s, end_s) = played.span_s();
        let ticks = ticks(end_s - start_s)?;
        let initial = command_at(flight, start_s).context("it has no motor commands")?;
        let manifest = manifest(ticks, flight, &initial, vehicles)?;
        // For a user who keeps the folder, and flies it once more.
        output_file::write(&folder.join(MANIFEST), &WRITTEN, |out| {
            write!(out, "{MANIFEST_START}\n\n{manifest}")
        })?;
        Ok(Self { folder, manifest, played, ticks, _lock: lock })
    }

    /// Flies the vehicles of `files` in `host`; returns how long that took on the host, in seconds, and the recording.
    ///
    /// # Errors
    /// As `hummingbus run`; a run that was stopped too.
    pub fn fly(
        &self,
        host: &Host,
        components: Registry,
        stop: &StopToken,
        files: &InputFiles,
        tell: &mut dyn FnMut(&str),
    ) -> Result<(f64, Recording)> {
        let manifest = self.manifest.build(&self.folder.join(MANIFEST), components)?;
        // The other files that the run reads are its own.
        let launcher = Launcher::new(host.clone()).as_part().reading(files.branch()).stopped_by(stop);
        // Only processes have descendants; a program that embeds this one may have children of its own meanwhile.
        let launcher = match host {
            Host::Exe(_) => launcher.adopting_orphans(),
            Host::Threads | Host::InProcess => launcher,
        };
        let launcher = launcher.followed_by(|event| {
            if let RunEvent::Note(text) = event {
                tell(text);
            }
        });
        let (outcome, recording) = launcher.fly(&manifest, &self.folder.join(RECORDING))?;
        let recording = recording.context("it was not recorded")?;
        if outcome.was_stopped {
            bail!("it was stopped after {} of {} ticks", outcome.ticks, self.ticks);
        }
        Ok((outcome.host_s, recording))
    }

    /// Duration of the run, in seconds.
    pub fn duration_s(&self) -> f64 {
        f64::from(self.ticks - 1) / f64::from(RATE_HZ)
    }

    /// Removes its files.
    ///
    /// # Errors
    /// If that is not possible.
    pub fn remove(self) -> Result<()> {
        std::fs::remove_dir_all(&self.folder)
            .with_context(|| format!("cannot remove {}", self.folder.display()))
    }
}

/// The manifest of a run of `ticks` ticks of `flight`, with the command `initial` before the first.
fn manifest(ticks: u32, flight: &Flight, initial: &[f64], vehicles: &[&Path]) -> Result<ManifestBuilder> {
    let every = i64::from(RECORDED_TICKS);
    let has_voltage = MeasuredVoltage::of(flight).is_some();
    let mut manifest = ManifestBuilder::new()
        .set("run.rate_hz", i64::from(RATE_HZ))
        .set("run.duration_s", f64::from(ticks) / f64::from(RATE_HZ))
        .set("run.seed", 1)
        .set("process.player.kind", "player")
        .set("process.player.data", DATA)
        .set("process.player.outputs.measured.every_ticks", every)
        // Windows that touch a gap do not count.
        .set("process.player.parameters.gaps", "hold")
        .set("process.player.parameters.columns", flights::columns(flight).parse::<toml::Table>()?)
        .set("process.recorder.kind", "recorder");
    if has_voltage {
        manifest = manifest.set("process.player.outputs.battery.every_ticks", 1);
    }
    for (number, vehicle) in vehicles.iter().enumerate() {
        let path = std::path::absolute(vehicle)?;
        let vehicle = path.to_str().with_context(|| {
            format!("the path {} is not UTF-8: move the file into a folder whose name is", path.display())
        })?;
        for horizon_ms in HORIZONS_MS {
            let plant = format!("process.{}", plant(number, horizon_ms));
            let [command, battery] = ["command", "battery"].map(|port| format!("{plant}.inputs.{port}"));
            manifest = manifest
                .set(&format!("{plant}.kind"), "plant")
                .set(&format!("{plant}.vehicle"), vehicle)
                .set(&format!("{plant}.parameters.window_s"), f64::from(horizon_ms) * 1e-3)
                .set(&format!("{command}.topic"), "/player/command")
                .set(&format!("{command}.delay_ticks"), 1)
                .set(&format!("{command}.initial.command"), initial.to_vec())
                .set(&format!("{plant}.inputs.measured"), MEASURED)
                .set(&format!("{plant}.outputs.state.every_ticks"), every);
            if has_voltage {
                manifest = manifest
                    .set(&format!("{battery}.topic"), BATTERY)
                    .set(&format!("{battery}.delay_ticks"), 1)
                    .set(&format!("{battery}.initial.valid"), 0);
            }
        }
    }
    Ok(manifest)
}

/// Refuses to write where `flight` or one of `vehicles` was read from.
fn require_no_input(output: &Path, flight: &Flight, vehicles: &[&Path]) -> Result<()> {
    match vehicles.iter().copied().chain(flight.files()).find(|input| is_same(input, output)) {
        Some(input) => bail!("{} would be replaced, and is read; keep it in another folder", input.display()),
        None => Ok(()),
    }
}

/// Ticks of a run that plays `duration_s` of a flight, both ends included.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "checked to be positive and short"
)]
fn ticks(duration_s: f64) -> Result<u32> {
    let (shortest_s, longest_s) = (f64::from(HORIZONS_MS[0]) * 1e-3, 86400.0);
    if !(shortest_s..longest_s).contains(&duration_s) {
        bail!("it lasts {duration_s:.3} s, expected {shortest_s} s to a day");
    }
    // Times are sums of decimal fractions: a nanosecond of slack keeps the last moment.
    Ok(((duration_s + 1e-9) * f64::from(RATE_HZ)).floor() as u32 + 1)
}

/// The command that holds at `time_s`, or the first where none was given before.
fn command_at(flight: &Flight, time_s: f64) -> Option<Vec<f64>> {
    let given = flight.command.time_s.partition_point(|time| *time <= time_s + 1e-9);
    flight.command.values.get(given.saturating_sub(1)).map(|command| command[..flight.rotors].to_vec())
}

/// A name for a file: letters and digits as they are, `-` for all else.
pub fn file_name(name: &str) -> String {
    name.chars().map(|letter| if letter.is_alphanumeric() || letter == '_' { letter } else { '-' }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_holds_both_ends_of_the_flight() {
        assert_eq!(ticks(1.0).unwrap(), 1001);
        assert_eq!(ticks(0.3).unwrap(), 301);
        assert_eq!(ticks(1.000_9).unwrap(), 1001);
        assert!(ticks(0.05).unwrap_err().to_string().contains("expected 0.1 s"));
        assert!(ticks(f64::NAN).is_err());
    }

    #[test]
    fn names_become_file_names() {
        assert_eq!(file_name("B3 figure/8"), "B3-figure-8");
    }
}
