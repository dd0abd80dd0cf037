//! The command `identify`: effects that flights show and the declared model lacks, and the model with them.

use super::files::{PAGE, require_kind};
use super::interrupts::{WithoutRun, stop_token};
use super::kind;
use super::next_flight::{self, NextFlight};
use super::output::{self, print_json, print_text, readable};
use super::progress;
use anyhow::{Context, Result, bail};
use clap::{Args, Subcommand};
use flights::FlightSet;
use hummingbus::{COMPONENTS, Host};
use identify::proposal::Proposal;
use identify::report::Report;
use identify::run::Outcome;
use identify::vehicle_file;
use report::identification;
use report::validate::Validation;
use runtime::output_file::{self, Kind, Mark, is_same};
use serde_json::{Value, json};
use std::fs::File;
use std::io::{ErrorKind, Write as _};
use std::path::{Path, PathBuf};
use std::time::Duration;
use vehicles::Vehicle;

/// Text of `--help` behind the options.
pub const HELP: &str = "Examples: hummingbus identify flights.toml --out identified\n          \
    HUMMINGBUS_DATA=data hummingbus identify flights/nanobench.toml --out identified\n          \
    hummingbus identify rotor flights/stands/esc-test-f40.toml --out rotor\n          \
    hummingbus identify rotor stand.toml flights.toml --out rotor\n\n\
    Writes report.html, report.json and vehicle.toml into the folder. See docs/identify.md.";

/// A report as JSON: its writer comes first.
const REPORT: Kind = Kind { name: "report", mark: Mark::Start(b"{\n  \"writer\": \"hummingbus\",") };
/// The new vehicle file.
const VEHICLE: Kind =
    Kind { name: "identified vehicle", mark: Mark::Start(b"# Written by hummingbus identify.") };
/// The manifest of the next flight.
const NEXT: Kind = Kind { name: "next flight", mark: Mark::Start(next_flight::MANIFEST_START.as_bytes()) };
/// Its set points.
const SET_POINTS: Kind =
    Kind { name: "set points of a next flight", mark: Mark::Start(next_flight::SET_POINTS_START.as_bytes()) };
/// Tables for a vehicle file.
const TABLES: Kind =
    Kind { name: "table of a rotor", mark: Mark::Start(b"# Tables of a vehicle file, identified from ") };

/// Arguments of `identify`.
#[derive(Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub struct IdentifyArguments {
    #[command(subcommand)]
    part: Option<Part>,
    /// The flights file: the declared vehicle, and flights to fit and to test on.
    #[arg(required = true)]
    flights: Option<PathBuf>,
    /// Folder of the report and the new vehicle file; made if it is not there.
    #[arg(long, value_name = "DIR", required = true)]
    out: Option<PathBuf>,
    /// Print the report as JSON, and no progress.
    #[arg(long)]
    json: bool,
    /// Print no progress.
    #[arg(short, long)]
    quiet: bool,
    /// Do not fly the declared and the new vehicle on the bus.
    #[arg(long)]
    no_bus: bool,
    /// Do not search the next flight, which separates what these flights leave open.
    #[arg(long)]
    no_next_flight: bool,
}

#[derive(Subcommand)]
enum Part {
    /// Fit thrust, torque and motor to the logs of a thrust stand, or to flights that log rotor speeds.
    Rotor {
        /// A stand file, a flights file, or one of each, which are then compared.
        #[arg(required = true, num_args = 1..=2, value_name = "FILE")]
        files: Vec<PathBuf>,
        /// Folder of rotor.toml and rotor.json; made if it is not there.
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
        /// Print the report as JSON.
        #[arg(long)]
        json: bool,
    },
}

/// Runs the command; every failure is an error, so that `true` means that the files are written.
///
/// # Errors
/// A file that cannot be read or written, flights that cannot be used, a run on the bus that fails.
pub fn run(arguments: &IdentifyArguments) -> Result<bool> {
    match (&arguments.part, &arguments.flights, &arguments.out) {
        (Some(Part::Rotor { files, out, json }), ..) => rotor(files, out, *json),
        (None, Some(flights), Some(out)) => flights_of(arguments, flights, out),
        _ => bail!("give a flights file, and a folder with --out"),
    }
}

fn rotor(files: &[PathBuf], out: &Path, is_json: bool) -> Result<bool> {
    let files: Vec<&Path> = files.iter().map(PathBuf::as_path).collect();
    for file in &files {
        require_kind(file, &[kind::Kind::Stand, kind::Kind::Flights], "")?;
    }
    let found = identify::rotor::run_files(&files)?;
    let _lock = claim(out, &[("rotor.toml", &TABLES), ("rotor.json", &REPORT)], &files)?;
    write(out, "rotor.toml", &TABLES, &found.tables)?;
    write(out, "rotor.json", &REPORT, &(found.figures + "\n"))?;
    let report = found.report;
    if is_json { print_json(&report) } else { print_text(&report.to_string()) }?;
    Ok(true)
}

fn flights_of(arguments: &IdentifyArguments, file: &Path, out: &Path) -> Result<bool> {
    let is_quiet = arguments.json || arguments.quiet;
    let bar = progress::bar("{spinner} {elapsed:>4}  {msg}", is_quiet);
    if !is_quiet {
        bar.enable_steady_tick(Duration::from_millis(100));
    }
    let lines = progress::Lines::default();
    let say = |text: &str| {
        bar.set_message(readable(text).into_owned());
        if bar.is_hidden() && !is_quiet && lines.is_due(text, bar.elapsed()) {
            output::say(&format!("{:6.1} s  {}", bar.elapsed().as_secs_f64(), readable(text)));
        }
    };
    say("reading flights");
    require_kind(file, &[kind::Kind::Flights], "")?;
    let set = FlightSet::load(file)?;
    let base = Vehicle::base(&set.files, &set.vehicle);
    let inputs: Vec<&Path> =
        [Some(file), Some(&set.vehicle), base.as_deref()].into_iter().flatten().collect();
    let files = [
        ("vehicle.toml", &VEHICLE),
        ("report.html", &PAGE),
        ("report.json", &REPORT),
        (next_flight::MANIFEST, &NEXT),
        (next_flight::SET_POINTS, &SET_POINTS),
    ];
    let _lock = claim(out, &files, &inputs)?;
    let stop = stop_token()?;
    let is_stopped = || stop.count() > 0;
    let searching = WithoutRun::begin();
    let mut outcome = identify::run::identify_until(&set, &mut |step| say(step), &is_stopped)?;
    drop(searching);
    let vehicle = out.join("vehicle.toml");
    let text = vehicle_file::text(&set.files, &set.vehicle, &outcome.effects, &outcome.report)?;
    write(out, "vehicle.toml", &VEHICLE, &text)?;
    // It is flown as it was written.
    set.files.keep(&vehicle, text.into_bytes());
    // All is written before anything is flown, so that a run that fails loses nothing.
    let write_page = |outcome: &Outcome, flown: Option<&Value>| {
        write(out, "report.html", &PAGE, identification::page(outcome, flown))
    };
    write_page(&outcome, None)?;
    let mut report = serde_json::to_value(&outcome.report)?;
    write_json(out, &report)?;
    let flown = if arguments.no_bus || is_stopped() {
        None
    } else {
        let how = Validation { host: Host::this_binary(), ..Validation::new(COMPONENTS, &stop) };
        let mut tell = |line: &str| say(&format!("on the bus: {line}"));
        identification::fly_again(&set, &vehicle, &outcome, &how, &mut tell)?
    };
    remove_proposal(out)?;
    let questions = outcome.questions.take().filter(|_| !arguments.no_next_flight && !is_stopped());
    let is_searched = questions.is_some();
    if let Some(questions) = questions {
        let next = next_flight::propose(&set, &outcome, questions, &vehicle, &stop, &say)?;
        write_proposal(out, &next)?;
        outcome.report.next_flight = Some(next.proposal);
        report = serde_json::to_value(&outcome.report)?;
    }
    if flown.is_some() || is_searched {
        write_page(&outcome, flown.as_ref())?;
    }
    bar.finish_and_clear();
    report["bus"] = flown.clone().unwrap_or(Value::Null);
    write_json(out, &report)?;
    if arguments.json {
        print_json(&report)?;
    } else {
        print_text(&summary(&outcome.report, flown.as_ref(), out))?;
    }
    Ok(true)
}

/// Removes the next flight that an earlier command proposed: it would pass for that of this one.
fn remove_proposal(out: &Path) -> Result<()> {
    for name in [next_flight::MANIFEST, next_flight::SET_POINTS] {
        match std::fs::remove_file(out.join(name)) {
            Err(error) if error.kind() != ErrorKind::NotFound => {
                return Err(error).with_context(|| format!("cannot remove {}", out.join(name).display()));
            }
            _ => {}
        }
    }
    Ok(())
}

fn write_proposal(out: &Path, next: &NextFlight) -> Result<()> {
    let Some((manifest, set_points)) = &next.files else { return Ok(()) };
    write(out, next_flight::MANIFEST, &NEXT, manifest)?;
    write(out, next_flight::SET_POINTS, &SET_POINTS, set_points)
}

/// Makes the folder `out`, claims it for this command, and checks that `files` can lie in it.
///
/// # Errors
/// If another command writes to it, or one of the files would replace something of another kind or one of `inputs`.
fn claim(out: &Path, files: &[(&str, &Kind)], inputs: &[&Path]) -> Result<File> {
    output_file::make_folder(out)?;
    for (name, kind) in files {
        let path = out.join(name);
        output_file::check(&path, kind)?;
        if let Some(input) = inputs.iter().find(|input| is_same(input, &path)) {
            let path = path.display();
            bail!(
                "{path} would be replaced, and is read as {}; name another folder with --out",
                input.display()
            );
        }
    }
    Ok(output_file::lock_folder(out)?)
}

fn write_json(out: &Path, report: &Value) -> Result<()> {
    let mut all = serde_json::Map::from_iter([("writer".to_owned(), json!("hummingbus"))]);
    all.extend(report.as_object().cloned().unwrap_or_default());
    write(out, "report.json", &REPORT, serde_json::to_string_pretty(&all)?)
}

fn write(out: &Path, name: &str, kind: &Kind, content: impl AsRef<[u8]>) -> Result<()> {
    Ok(output_file::write(&out.join(name), kind, |file| file.write_all(content.as_ref()))?)
}

fn summary(report: &Report, flown: Option<&Value>, out: &Path) -> String {
    let mut text = report.to_string();
    let furthest = flown.and_then(|flown| {
        Some((flown["furthest_from_prediction"].as_f64()?, flown["furthest_at"].as_str()?))
    });
    if let Some((away, at)) = furthest {
        text += &format!(
            "flown again on the bus with both vehicle files: all errors agree with these within {:.1} %; the largest difference: {at}\n",
            away * 100.0
        );
    }
    let mut names = vec!["report.html", "report.json"];
    if report.next_flight.as_ref().is_some_and(Proposal::is_worth_flying) {
        names.extend([next_flight::MANIFEST, next_flight::SET_POINTS]);
    }
    // The line ends with the vehicle file, and what it is not for.
    names.push("vehicle.toml");
    let files: Vec<String> = names.iter().map(|name| out.join(name).display().to_string()).collect();
    let limit = report.limited_use().map_or(String::new(), |limit| format!(" ({limit})"));
    text + &format!("\nwritten: {}{limit}", files.join(", "))
}
