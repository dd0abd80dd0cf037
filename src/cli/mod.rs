//! The command line: the table of commands, printing, exit codes.

mod campaign;
mod campaign_engine;
mod cat;
mod check;
mod clean;
mod completions;
mod component_kind;
mod components;
mod components_page;
mod diff;
mod earlier;
mod effects;
mod export;
mod export_fmu;
mod files;
mod fork;
mod foxglove;
mod identify;
mod included_models;
mod inherited;
mod interrupts;
mod kind;
mod live_page;
mod new;
mod next_flight;
mod node;
mod output;
mod plot;
mod profile;
mod progress;
mod project;
mod run;
mod schema;
mod schema_code;
mod shadow;
mod shell;
mod steer;
mod table;
mod top;
mod tune;
mod urdf;
mod validate;
mod view;

use anyhow::Result;
use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{CommandFactory as _, Parser, Subcommand};
use diagnostics::{nearest, plain};
use output::{print_error, print_error_json, readable, say};
use std::path::Path;
use std::process::ExitCode;
use table::commands;

/// A vehicle simulation as independent processes in deterministic lockstep.
#[derive(Parser)]
#[command(
    version = env!("HUMMINGBUS_VERSION"),
    after_help = "Example: hummingbus run manifests/hover.toml\n\n`hummingbus COMMAND --help` tells what a command takes.\n\n\
                  Pages called docs/NAME.md are in the folder docs of a checkout, and in share/doc/hummingbus/docs of an installation: \
                  /usr/share/doc/hummingbus/docs of the Debian package. The first is docs/first-hour.md. Shipped manifests are in \
                  manifests of a checkout, and in share/hummingbus/manifests of an installation."
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

commands! {
    /// Fly a manifest, record it, and judge the recording.
    #[command(
        after_help = "Example: hummingbus run manifests/hover.toml --pace realtime --set run.seed=7\n         hummingbus run --from hover.6000.ckpt --fork 100 --vary process.plant.vehicle.body.mass=factor:uniform:0.9,1.1"
    )]
    Run(fork::RunOrForkArguments) => fork::run;
    /// Fly a manifest as `run` does, and show where the host time of its ticks goes.
    #[command(
        after_help = "Example: hummingbus profile manifests/hover.toml --html profile.html --trace trace.json"
    )]
    Profile(run::ProfileArguments) => run::profile;
    /// Fly a manifest with a shadow of one of its processes, or read a recording that has one: what the shadow
    /// would have done otherwise.
    #[command(
        after_help = "Examples: hummingbus shadow manifests/hover.toml --process controller --with better.toml\n          hummingbus shadow hover.mcap"
    )]
    Shadow(shadow::ShadowArguments) => shadow::shadow;
    /// Fly a manifest thousands of times with varied values: pass rate, figures and worst flights.
    #[command(after_help = campaign::HELP)]
    Campaign(campaign::CampaignArguments) => campaign::campaign;
    /// Tune gains: search those that make figures of many flights smaller, and judge them by other flights.
    #[command(after_help = tune::HELP)]
    Tune(tune::TuneArguments) => tune::tune;
    /// Check a manifest without running it, and print its graph.
    #[command(after_help = "Example: hummingbus check manifests/hover.toml")]
    Check(check::CheckArguments) => check::check;
    /// Compare two recordings, byte by byte or within a tolerance; exit code 1 if they differ.
    #[command(after_help = diff::HELP)]
    Diff(diff::DiffArguments) => diff::diff;
    /// Print a recording's messages, one JSON object a line.
    #[command(after_help = "Examples: hummingbus cat hover.mcap --topic /plant/state | head\n          hummingbus cat hover.mcap --topic /plant/state --field position.z --csv")]
    Cat(cat::CatArguments) => cat::cat;
    /// Write a recording's messages as tables, a file for each topic: Parquet or CSV.
    #[command(after_help = export::HELP)]
    Export(export::ExportArguments) => export::export;
    /// Draw a recording: a page with curves over time and the paths in space, or pictures of them.
    #[command(after_help = plot::HELP)]
    Plot(plot::PlotArguments) => plot::plot;
    /// Show a recording in the browser: the vehicles in their room, and any field over time.
    #[command(after_help = view::HELP)]
    View(view::ViewArguments) => view::view;
    /// Write a vehicle's body as URDF, which Foxglove, Rerun and RViz show: visual, inertial and collision elements.
    #[command(after_help = urdf::HELP)]
    Urdf(urdf::UrdfArguments) => urdf::urdf;
    /// Write a simulation as an FMU, for Simulink, OpenModelica, Dymola and others.
    #[command(after_help = export_fmu::HELP)]
    ExportFmu(export_fmu::ExportFmuArguments) => export_fmu::export_fmu;
    /// Make a project folder that flies, or a first vehicle file from a model in URDF or SDF.
    #[command(after_help = new::HELP)]
    New(new::NewArguments) => new::new;
    /// Print every message and every state that a component hands over: fields, units, frames and layout hash.
    #[command(after_help = "Example: hummingbus schema PlantState")]
    Schema(schema::SchemaArguments) => schema::schema;
    /// Print every component: its ports, its parameters, the state that it hands over.
    #[command(after_help = "Example: hummingbus components --json")]
    Components(components::ComponentsArguments) => components::components;
    /// Print the effects that vehicle and scene files may list: equations, sources, parameters with units and bounds.
    #[command(after_help = "Example: hummingbus effects rotor-drag")]
    Effects(effects::EffectsArguments) => effects::effects;
    /// Find what measured flights show that the declared vehicle lacks; or fit a rotor to a thrust stand.
    #[command(after_help = identify::HELP)]
    Identify(identify::IdentifyArguments) => identify::run;
    /// Fly the measured commands of flights with one or two vehicle files, and report the prediction errors.
    #[command(after_help = validate::HELP)]
    Validate(validate::ValidateArguments) => validate::validate;
    /// Watch a live run and steer it: ticks, processes, topics.
    #[command(after_help = top::HELP)]
    Top(top::TopArguments) => top::top;
    /// Pause, step, pace, show or stop a live run; exit code 2 if it refuses.
    #[command(after_help = "Example: hummingbus ctl pause")]
    Ctl(steer::CtlArguments) => steer::ctl;
    /// Replace a process of a live run.
    #[command(
        after_help = "Example: hummingbus swap controller --with better.toml --shadow-ticks 500\n\nIn a paused run, the swap waits until the run goes on: hummingbus ctl resume"
    )]
    Swap(steer::SwapArguments) => steer::swap;
    /// Remove what dead runs left, and nothing of live ones; exit code 1 if something could not be removed.
    #[command(after_help = "Example: hummingbus clean --dry-run")]
    Clean(clean::CleanArguments) => clean::clean;
    /// Print the completions of this program for a shell.
    #[command(after_help = "Example: hummingbus completions bash > ~/.local/share/bash-completion/completions/hummingbus")]
    Completions(completions::CompletionsArguments) => print_completions;
    /// Write the manual pages.
    #[command(after_help = "Example: hummingbus man ~/.local/share/man/man1")]
    Man(completions::ManArguments) => write_manual;
    /// Be a process of a run; started by `run`.
    #[command(hide = true)]
    Node(node::NodeArguments) => node::node;
}

/// Parses the arguments of this process, runs the command, and returns the exit code of the process.
pub fn main() -> ExitCode {
    let command = match Cli::try_parse() {
        Ok(cli) => cli.command,
        Err(mut error) => {
            suggest_command(&mut error);
            explain_files(&mut error);
            return refuse(&error);
        }
    };
    if !matches!(command, Command::Node(_)) {
        inherited::forget();
        bus::process::survive_file_limit();
        bus::limit_transport_log();
    }
    match command.run() {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            print_error(&error);
            ExitCode::from(2)
        }
    }
}

fn print_completions(arguments: &completions::CompletionsArguments) -> Result<bool> {
    completions::print(arguments, Cli::command())
}

fn write_manual(arguments: &completions::ManArguments) -> Result<bool> {
    completions::write_manual(arguments, Cli::command())
}

/// Adds the command that was probably meant, if clap has no suggestion: it knows none that is near to a word of two letters.
fn suggest_command(error: &mut clap::Error) {
    let Some(ContextValue::String(found)) = error.get(ContextKind::InvalidSubcommand) else { return };
    // The commands within another one are not among those here.
    let is_first =
        std::env::args_os().nth(1).is_some_and(|argument| argument.to_str() == Some(found.as_str()));
    if !is_first || error.get(ContextKind::SuggestedSubcommand).is_some() {
        return;
    }
    let command = Cli::command();
    let shown = command.get_subcommands().filter(|command| !command.is_hide_set());
    let near = nearest(found, shown.map(clap::Command::get_name)).map(str::to_owned);
    if let Some(near) = near {
        error.insert(ContextKind::SuggestedSubcommand, ContextValue::Strings(vec![near]));
    }
}

/// Adds the reason for a file too many: where a shell finds several files for a pattern, it passes the name of each on.
fn explain_files(error: &mut clap::Error) {
    let is_file = matches!(
        error.get(ContextKind::InvalidArg),
        Some(ContextValue::String(found)) if Path::new(found).exists()
    );
    if is_file && error.kind() == ErrorKind::UnknownArgument {
        let tip = "this is one file more than the command takes; a shell replaces a pattern such as `*` by all names that fit";
        error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![tip.into()]));
    }
}

/// Prints help, the version, or the reason why the arguments are refused. A shell's `*` makes arguments of any names.
fn refuse(error: &clap::Error) -> ExitCode {
    let rendered = error.render();
    let text = plain(&rendered.to_string()).into_owned();
    if error.use_stderr() {
        print_error_json(
            &serde_json::json!({ "error": text.trim_end().trim_start_matches("error: "), "faults": [] }),
        );
    }
    if !error.use_stderr() || (readable(&text) == text && rendered.to_string() == text) {
        // In colour where the terminal has it.
        error.exit();
    }
    say(text.trim_end());
    ExitCode::from(2)
}
