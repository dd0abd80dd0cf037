//! The command `export-fmu`.

use super::files::require_kind;
use super::kind;
use super::output::{print_json, print_text};
use anyhow::{Context, Result, bail};
use clap::Args;
use hummingbus::fmu_export::{Wishes, export};
use runtime::output_file::{self, Kind, Mark, is_same};
use serde_json::json;
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// Examples that `--help` shows.
pub const HELP: &str = "Examples:
  hummingbus export-fmu vehicles/hummingbird.toml                     the plant with an IMU and motion capture
  hummingbus export-fmu manifests/hover.toml --without controller     everything but the controller
  hummingbus export-fmu manifests/ten-vehicles.toml --only v0 --without v0/controller     one vehicle of ten
  hummingbus export-fmu hover.toml --output /imu/imu --fmi 3 --out plant.fmu";

/// Name of the library that goes into an FMU: bindings/fmu-export.
const LIBRARY: &str = "libhummingbus_fmu.so";
const FMU: Kind = Kind { name: "FMU", mark: Mark::Start(b"PK\x03\x04") };

/// Arguments of `export-fmu`.
#[derive(Args)]
pub struct ExportFmuArguments {
    /// A manifest, or a vehicle file.
    file: PathBuf,
    /// The process in whose place the importer of the FMU stands: what it sends becomes the inputs of the FMU.
    #[arg(long, value_name = "PROCESS", default_value = "controller")]
    without: String,
    /// A process, a vehicle or a group of the manifest that goes into the FMU; may be given again, or several with commas.
    /// Left out: all of them.
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    only: Vec<String>,
    /// A topic whose fields become outputs of the FMU. Left out: what that process reads, and the states of plants.
    #[arg(long = "output", value_name = "TOPIC")]
    outputs: Vec<String>,
    /// Version of the standard: 2 or 3.
    #[arg(long, value_name = "VERSION", default_value = "2")]
    fmi: String,
    /// Write this file. Left out: NAME.fmu in this folder.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// A value of the manifest or of a file that it names, as for `run`.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Print what it holds as JSON.
    #[arg(long)]
    json: bool,
}

/// Writes a simulation as an FMU, for Simulink, OpenModelica, Dymola and others.
///
/// # Errors
/// If the manifest has a problem, a requested process or topic is not in it, or the file cannot be written.
pub fn export_fmu(arguments: &ExportFmuArguments) -> Result<bool> {
    let Some(version) = fmu::export::version_of(&arguments.fmi) else {
        bail!("--fmi: expected 2 or 3, found {}", arguments.fmi);
    };
    let name = arguments.file.file_stem().unwrap_or_default();
    let out = arguments.out.clone().unwrap_or_else(|| format!("{}.fmu", name.to_string_lossy()).into());
    if is_same(&out, &arguments.file) {
        bail!("{} is what is read: name another file", out.display());
    }
    require_kind(&arguments.file, &[kind::Kind::Manifest, kind::Kind::Vehicle], "")?;
    output_file::check(&out, &FMU)?;
    let wishes = Wishes {
        without: &arguments.without,
        only: &arguments.only,
        outputs: &arguments.outputs,
        version,
        overrides: &arguments.set,
    };
    let exported = export(&arguments.file, &wishes, &library()?)?;
    output_file::write(&out, &FMU, |file| file.write_all(&exported.bytes))?;
    let (inputs, outputs): (Vec<_>, Vec<_>) =
        exported.model.variables.iter().partition(|variable| variable.is_input());
    if arguments.json {
        print_json(&json!({ "fmu": out, "model": exported.model, "unwired": exported.cut }))?;
    } else {
        let cut = match &exported.cut[..] {
            [] => String::new(),
            cut => format!("\nwithout a sender, and not wired: {}", cut.join(", ")),
        };
        print_text(&format!(
            "{}: FMI {}, {} inputs in place of `{}`, {} outputs, a step of {} s{cut}\nin Simulink: docs/simulink.md; in Python: \
             fmpy simulate {}",
            out.display(),
            arguments.fmi,
            inputs.len(),
            arguments.without,
            outputs.len(),
            exported.model.tick_s,
            out.display()
        ))?;
    }
    Ok(true)
}

/// The library, which lies beside the program, or in `lib/hummingbus` beside its folder.
fn library() -> Result<Vec<u8>> {
    let program = std::env::current_exe().context("cannot find this program's own file")?;
    let folder = program.parent().unwrap_or(Path::new("."));
    let places = [folder.join(LIBRARY), folder.join("../lib/hummingbus").join(LIBRARY)];
    let Some(path) = places.iter().find(|path| path.is_file()) else {
        let places: Vec<_> = places.iter().map(|path| path.display().to_string()).collect();
        bail!(
            "the library that goes into an FMU is not there: neither {}; build it{}",
            places.join(" nor "),
            how_to_build(folder)
        );
    };
    std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))
}

/// The command that builds the library beside the program in `folder`: a folder of cargo in the sources, or another one.
fn how_to_build(folder: &Path) -> String {
    let profile = if folder.ends_with("debug") { "" } else { " --release" };
    let command = format!("cargo build{profile} --locked -p hummingbus -p hummingbus-fmu-export");
    match folder.ancestors().nth(2).filter(|sources| sources.join("bindings/fmu-export").is_dir()) {
        Some(sources) => format!(": cd {} && {command}", sources.display()),
        None => format!(" in the sources of hummingbus, and copy it there: {command}"),
    }
}

#[cfg(test)]
mod tests {
    use super::how_to_build;
    use std::path::Path;

    #[test]
    fn the_command_that_builds_the_library_is_whole() {
        let sources = Path::new(env!("CARGO_MANIFEST_DIR"));
        let command = "cargo build --release --locked -p hummingbus -p hummingbus-fmu-export";
        let of_release = format!(": cd {} && {command}", sources.display());
        assert_eq!(how_to_build(&sources.join("target/release")), of_release);
        let of_debug = of_release.replace(" --release", "");
        assert_eq!(how_to_build(&sources.join("target/debug")), of_debug);
        assert!(how_to_build(Path::new("/usr/bin")).ends_with(command));
    }
}
