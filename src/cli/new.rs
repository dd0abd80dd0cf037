//! The command `new`.

use super::output::{print_text, say};
use super::shell::{command, quoted};
use super::{included_models, project};
use anyhow::{Result, bail};
use clap::{Args, Subcommand};
use hummingbus::inputs::InputFiles;
use hummingbus::vehicles::from_model::{self, Converted};
use runtime::output_file::{self, Kind, Mark};
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// Examples that `--help` shows.
pub const HELP: &str = "Examples: hummingbus new drone\n          hummingbus new drone --language python\n          hummingbus new vehicle --from quad.urdf -o quad.toml";
/// Example that the help of `new vehicle` shows.
const VEHICLE_HELP: &str = "Example: hummingbus new vehicle --from quad.urdf -o quad.toml";

const VEHICLE: Kind = Kind { name: "vehicle file", mark: Mark::Start(from_model::MARK.as_bytes()) };

/// Arguments of `new`.
#[derive(Args)]
#[command(args_conflicts_with_subcommands = true)]
pub struct NewArguments {
    /// Folder of a new project: vehicle, manifest, gains, campaign, and a controller.
    #[arg(required = true, value_name = "NAME")]
    folder: Option<PathBuf>,
    /// Language of the project's controller; without it Rust, or Python where a wheel holds this program.
    #[arg(long, value_enum)]
    language: Option<project::Language>,
    /// Checkout of hummingbus that the project's controller builds against.
    #[arg(long, value_name = "FOLDER")]
    sources: Option<PathBuf>,
    #[command(subcommand)]
    file: Option<NewFile>,
}

#[derive(Subcommand)]
enum NewFile {
    /// Make a first vehicle file from a model in URDF or SDF; numbers that the model does not have are the Hummingbird's,
    /// and are listed.
    #[command(after_help = VEHICLE_HELP)]
    Vehicle(VehicleArguments),
}

#[derive(Args)]
struct VehicleArguments {
    /// The model: a URDF or SDF file. Run `xacro` first where it has expressions.
    #[arg(long, value_name = "FILE")]
    from: PathBuf,
    /// Write this vehicle file, which must not exist yet.
    #[arg(short, long, value_name = "NAME.toml")]
    out: PathBuf,
}

/// Makes a project folder, or a vehicle file.
///
/// # Errors
/// If the folder or the file exists or cannot be written. For a project, if its name is not suitable. For a vehicle file, if the
/// model cannot be read, is not physical or does not have 1 to 12 rotors.
pub fn new(arguments: &NewArguments) -> Result<bool> {
    match (&arguments.file, &arguments.folder) {
        (Some(NewFile::Vehicle(arguments)), _) => vehicle(arguments),
        (None, Some(folder)) => new_project(folder, arguments.language, arguments.sources.as_deref()),
        (None, None) => bail!("name the folder of the new project: hummingbus new drone"),
    }
}

fn new_project(folder: &Path, language: Option<project::Language>, sources: Option<&Path>) -> Result<bool> {
    let language = project::make(folder, language, sources)?;
    let shown = quoted(folder);
    print_text(&format!(
        "{shown}: a project with a vehicle, a manifest, gains, a campaign and a controller in {}\n\
         to fly it: {}\nnext steps: {shown}/README.md",
        language.title(),
        command("run", &folder.join("hover.toml"))
    ))?;
    Ok(true)
}

fn vehicle(VehicleArguments { from, out }: &VehicleArguments) -> Result<bool> {
    require_free(out)?;
    let file = from.display().to_string();
    let text = InputFiles::default()
        .text(from)
        .map_err(|cause| hummingbus::Diagnostic::unreadable(file.clone(), &cause))?;
    let made = from_model::convert_with(&text, &file, &|uri| included_models::read(from, uri))?;
    output_file::write(out, &VEHICLE, |file| file.write_all(made.text.as_bytes()))?;
    made.notes.iter().for_each(|note| say(&format!("warning: {file}: {note}")));
    print_text(&summary(&made, &file, out))?;
    Ok(true)
}

fn require_free(out: &Path) -> Result<()> {
    if out.symlink_metadata().is_ok() {
        bail!(
            "{} already exists; `new` does not replace files: name another file, or remove this one",
            out.display()
        );
    }
    Ok(output_file::check(out, &VEHICLE)?)
}

fn summary(made: &Converted, file: &str, out: &Path) -> String {
    let vehicle = &made.vehicle;
    let rotors: Vec<_> = vehicle.rotors.iter().map(|rotor| rotor.name.as_str()).collect();
    // A path that holds in the manifests of all folders.
    let whole = std::path::absolute(out).unwrap_or_else(|_| out.to_owned()).display().to_string();
    let out = out.display();
    let mut text = format!(
        "{out}: made from {file}: {:.4} kg, rotors {} (in the order of the commands)\n",
        vehicle.mass_kg,
        rotors.join(", ")
    );
    if !made.assumed.is_empty() {
        text += &format!("not in {file}; measure these, and replace them in {out}:\n");
        made.assumed.iter().for_each(|line| text += &format!("  {line}\n"));
    }
    text + &format!(
        "fly it with this line in the manifest, under [process.plant] and under controllers: vehicle = {}",
        toml::Value::from(whole)
    )
}
