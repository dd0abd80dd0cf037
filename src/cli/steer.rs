//! `hummingbus ctl` and `hummingbus swap`: a live run is steered from outside.

use super::interrupts::stop_token;
use super::kind::Kind;
use super::{foxglove, output, view};
use anyhow::{Context, Result, bail};
use clap::{Args, Subcommand};
use inputs::InputFiles;
use runtime::ctl::client;
use runtime::ctl::protocol::{Answer, Request, State};
use runtime::manifest::PaceSetting;
use runtime::run_dir::{LiveRun, find_own, is_own_alive};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

/// Longest time that a swap waits for a run to be alive.
const ALIVE: Duration = Duration::from_secs(10);
/// The same where a run is alive that was started elsewhere, which may be the one that is meant.
const ALIVE_BESIDE: Duration = Duration::from_secs(5);
/// Time after which a swap says that it waits for its backup.
const SILENCE: Duration = Duration::from_secs(1);

/// The arguments of `hummingbus ctl`.
#[derive(Args)]
pub struct CtlArguments {
    /// The run, as `hummingbus top` names it; needed unless just one that is alive was started in this folder and on this terminal.
    #[arg(long, global = true, value_name = "ID")]
    run: Option<String>,
    /// Print the run's answer as JSON.
    #[arg(long, global = true)]
    json: bool,
    #[command(subcommand)]
    verb: CtlVerb,
}

#[derive(Clone, Subcommand)]
enum CtlVerb {
    /// Say how far the run has come, and list its groups.
    Status,
    /// Hold the run at the next tick boundary, and wait until it is held.
    Pause,
    /// Run exactly this many ticks from the hold, and wait until it is held again; pauses a running run first.
    #[command(after_help = "Example: hummingbus ctl step 100")]
    Step {
        /// Number of ticks.
        #[arg(value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
        ticks: u32,
    },
    /// Let a held run go on.
    Resume,
    /// Change the pace of the run.
    #[command(after_help = "Example: hummingbus ctl pace 0.5")]
    Pace {
        /// free, realtime, or simulated seconds per second.
        pace: PaceSetting,
    },
    /// Write a checkpoint of the next tick boundary, from which `run --from` goes on.
    #[command(after_help = "Example: hummingbus ctl checkpoint before-the-wall.ckpt")]
    Checkpoint {
        /// The file; beside the recording and called after the tick where absent.
        file: Option<PathBuf>,
    },
    /// Go back in a paused run to one of its checkpoints, and wait until it is paused there.
    #[command(
        after_help = "Examples: hummingbus ctl rewind\n          hummingbus ctl rewind 6000\n          hummingbus ctl rewind before-the-wall.ckpt"
    )]
    Rewind {
        /// Tick of a checkpoint beside the recording, or the file of one; the newest before the pause where absent.
        #[arg(value_name = "TICK|FILE")]
        to: Option<String>,
    },
    /// End the run at the next tick boundary, as Ctrl-C does.
    Stop,
    /// Show the run in Foxglove or Lichtblick, as `hummingbus view --foxglove` does, until it ends or until Ctrl-C.
    #[command(after_help = "Examples: hummingbus ctl foxglove\n          hummingbus ctl foxglove 9000")]
    Foxglove {
        /// A port of 127.0.0.1, or an address of this machine, with or without a port.
        #[arg(value_name = "ADDRESS", default_value = "127.0.0.1", value_parser = foxglove::address)]
        address: SocketAddr,
    },
}

/// Deed of a command.
enum Deed {
    /// Asks the launcher.
    Ask(Request),
    /// Shows the run at this address.
    Show(SocketAddr),
}

impl CtlVerb {
    fn deed(&self) -> Result<Deed> {
        Ok(Deed::Ask(match self {
            Self::Status => Request::Status,
            Self::Pause => Request::Pause,
            Self::Step { ticks } => Request::Step { ticks: *ticks },
            Self::Resume => Request::Resume,
            Self::Pace { pace } => Request::Pace { pace: *pace },
            // The run has a working directory of its own.
            Self::Checkpoint { file } => {
                Request::Checkpoint { path: file.as_ref().map(std::path::absolute).transpose()? }
            }
            Self::Rewind { to } => {
                let tick = to.as_ref().and_then(|to| to.parse().ok());
                let file = to.as_ref().filter(|_| tick.is_none());
                Request::Rewind { tick, path: file.map(std::path::absolute).transpose()? }
            }
            Self::Stop => Request::Stop,
            Self::Foxglove { address } => return Ok(Deed::Show(*address)),
        }))
    }
}

/// Sends the request of `arguments` to a live run, and prints its answer; or shows the run.
///
/// # Errors
/// If there is no such run, it refuses, or the address to show it at is taken.
pub fn ctl(arguments: &CtlArguments) -> Result<bool> {
    let run_id = arguments.run.as_deref();
    match arguments.verb.deed()? {
        Deed::Ask(request) => ask(run_id, &request, arguments.json).map(|()| true),
        Deed::Show(_) if arguments.json => {
            bail!("`ctl foxglove` prints no answer of the run: leave out --json")
        }
        Deed::Show(address) => view::in_foxglove(&find_own(run_id)?, address, &stop_token()?),
    }
}

/// The arguments of `hummingbus swap`.
#[derive(Args)]
pub struct SwapArguments {
    /// The process to replace.
    process: String,
    /// Differences of its backup: a TOML file, or TOML text, with the keys of one process (kind, command, gains, parameters), not
    /// a whole manifest; none where absent.
    #[arg(long, value_name = "FILE|TOML", default_value = "")]
    with: String,
    /// Ticks that the backup computes beside the process before it takes over.
    #[arg(long, value_name = "TICKS")]
    shadow_ticks: Option<u32>,
    /// The tick from which on the backup's outputs count; as soon as possible where absent.
    #[arg(long, value_name = "TICK")]
    at_tick: Option<u32>,
    /// The run, as `hummingbus top` names it; needed unless just one that is alive was started in this folder and on this terminal.
    #[arg(long, value_name = "ID")]
    run: Option<String>,
    /// Print the run's answer as JSON.
    #[arg(long)]
    json: bool,
}

/// Makes a live run replace one of its processes, and prints the result.
///
/// # Errors
/// If there is no such run, the backup's description is not TOML, or the run refuses.
pub fn swap(arguments: &SwapArguments) -> Result<bool> {
    let request = Request::Swap {
        process: arguments.process.clone(),
        with: description(&arguments.with, &arguments.process)?,
        shadow_ticks: arguments.shadow_ticks,
        at_tick: arguments.at_tick,
    };
    let run_id = arguments.run.as_deref();
    let run = awaited_run(run_id)?;
    tell_of_wait(&run, run_id);
    let answer = if arguments.json {
        client::ask(&run, &request)?
    } else {
        ask_for_swap(&run, &request, &arguments.process)?
    };
    show(&run, run_id, answer, arguments.json).map(|()| true)
}

/// The run that a swap asks. If no run that was started here is alive, it waits for one that is about to start.
fn awaited_run(run_id: Option<&str>) -> Result<LiveRun> {
    if run_id.is_none() && !is_own_alive() {
        let (of_which, patience) =
            if client::is_any_alive() { (" of this folder and terminal", ALIVE_BESIDE) } else { ("", ALIVE) };
        output::say(&format!(
            "no run{of_which} is alive yet: the swap waits for one ({} s at most)",
            patience.as_secs()
        ));
        client::await_own(patience);
    }
    Ok(find_own(run_id)?)
}

/// Says at once that a swap waits until the run starts or goes on. Other states and errors are left to the answer.
fn tell_of_wait(run: &LiveRun, run_id: Option<&str>) {
    let Ok(Answer::Status(status)) = client::ask(run, &Request::Status) else { return };
    match status.state {
        State::Starting => output::say("the run is still starting, and the swap waits until it flies"),
        State::Paused => {
            let named = run_id.map_or(String::new(), |run_id| format!(" --run {run_id}"));
            output::say(&format!(
                "the run is paused at tick {}, and the swap waits until it goes on: `hummingbus ctl resume{named}`",
                status.tick
            ));
        }
        _ => {}
    }
}

/// Asks `run` for a swap of `process`. A line on standard error says if its program has not connected after a second.
fn ask_for_swap(run: &LiveRun, request: &Request, process: &str) -> Result<Answer> {
    let (asking, answered) = channel::<()>();
    let answer = std::thread::scope(|scope| {
        scope.spawn(move || {
            let mut is_told = false;
            while !is_told && answered.recv_timeout(SILENCE) == Err(RecvTimeoutError::Timeout) {
                let awaited = client::awaited_backup(run, process);
                is_told = awaited.is_some();
                if let Some(backup) = awaited {
                    output::say(&format!("waiting for {backup}"));
                }
            }
        });
        let answer = client::ask(run, request);
        drop(asking);
        answer
    });
    Ok(answer?)
}

/// The TOML text that `given` is, or that the file of this name holds: keys of `process`, in which its backup or shadow differs.
///
/// # Errors
/// If it is no TOML, or a whole file of another kind, such as a manifest. The error says how to name what was meant.
pub fn description(given: &str, process: &str) -> Result<String> {
    let is_file = !given.is_empty() && (Path::new(given).is_file() || !given.contains('='));
    let text = if is_file {
        InputFiles::default().text(Path::new(given)).with_context(|| {
            format!("--with: cannot read {given}, and it is no TOML text such as kind=\"pid\"")
        })?
    } else {
        given.to_owned()
    };
    let place = if is_file { given } else { "its text" };
    let table = text.parse::<toml::Table>().with_context(|| format!("--with: {place} is no TOML"))?;
    require_keys_of(process, place, Kind::of(text.as_bytes()), &table)?;
    Ok(text)
}

/// Refuses a file of another kind than keys of a process.
fn require_keys_of(process: &str, place: &str, kind: Option<Kind>, table: &toml::Table) -> Result<()> {
    // Gains within the keys of a process look like a file of gains.
    let names_gains = ["gains", "parameters"].iter().any(|key| table.contains_key(*key));
    let (kind, advice) = match kind {
        Some(Kind::Manifest) => (Kind::Manifest, how_to_name(process, table)),
        Some(Kind::Gains) if !names_gains => (Kind::Gains, as_key("gains", place)),
        Some(Kind::Vehicle) => (Kind::Vehicle, as_key("vehicle", place)),
        Some(Kind::Scene) => (Kind::Scene, as_key("scene", place)),
        Some(kind @ (Kind::Flights | Kind::Stand | Kind::Campaign)) => (kind, kind.reader(place)),
        _ => return Ok(()),
    };
    bail!(
        "--with: {place} is {}, expected keys of one process, such as kind = \"pid\" or parameters.gains.roll = {{ … }}\n{advice}",
        kind.name()
    )
}

/// Advice for a file that a key of a process names.
fn as_key(key: &str, file: &str) -> String {
    format!(
        "name the file by its key: --with '{key} = \"{file}\"'; its path starts at the folder of the run's manifest"
    )
}

/// Advice for a whole manifest, of which one process is meant.
fn how_to_name(process: &str, manifest: &toml::Table) -> String {
    let processes = manifest.get("process").and_then(toml::Value::as_table);
    let names: Vec<&str> = processes.into_iter().flat_map(toml::Table::keys).map(String::as_str).collect();
    let source = match names.as_slice() {
        names if names.contains(&process) => process,
        [only] => *only,
        _ => "NAME",
    };
    let there = if source == "NAME" && !names.is_empty() {
        format!("; its processes are {}", names.join(", "))
    } else {
        String::new()
    };
    format!(
        "to swap to a process of that manifest, save the keys below its [process.{source}], without this line, as a file: \
         --with FILE; paths in it start at the folder of the run's manifest{there}"
    )
}

fn ask(run_id: Option<&str>, request: &Request, json: bool) -> Result<()> {
    let run = find_own(run_id)?;
    let answer = client::ask(&run, request)?;
    show(&run, run_id, answer, json)
}

/// Prints the `answer` of `run`, which the user named `run_id`.
fn show(run: &LiveRun, run_id: Option<&str>, answer: Answer, json: bool) -> Result<()> {
    if json {
        let mut told = serde_json::to_value(&answer)?;
        // Of the files of the run, not of its answer: older runs are asked, too.
        told["run_id"] = run.entry.run_id.as_str().into();
        told["manifest"] = run.entry.manifest.to_string_lossy().into();
        output::print_json_line(&told)?;
    }
    if let Answer::Done { warnings, .. } | Answer::Refused { warnings, .. } = &answer {
        warnings.iter().for_each(|warning| output::say(&format!("warning: {warning}")));
    }
    let manifest = run.entry.manifest.file_name().unwrap_or_default().display();
    let of_run = |text: &str| format!("run {} ({manifest}): {text}", run.entry.run_id);
    match answer {
        Answer::Refused { reason, .. } => bail!("{reason}"),
        _ if json => Ok(()),
        Answer::Done { text, .. } if run_id.is_some() => output::print_text(&text),
        // The user did not name the run: the answer does.
        Answer::Done { text, .. } => output::print_text(&of_run(&text)),
        Answer::Status(status) => {
            let text = status.to_string();
            let named = format!("{}: ", status.run_id);
            output::print_text(&of_run(text.strip_prefix(&named).unwrap_or(&text)))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::description;

    #[test]
    fn a_backup_is_described_by_a_file_or_by_text() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), "kind = 'pid'\n").unwrap();
        assert_eq!(description(file.path().to_str().unwrap(), "pid").unwrap(), "kind = 'pid'\n");
        assert_eq!(description("kind='pid'", "pid").unwrap(), "kind='pid'");
        assert_eq!(description("", "pid").unwrap(), "");
        let message = |text| format!("{:#}", description(text, "pid").unwrap_err());
        assert!(message("kind='").contains("its text is no TOML"), "{}", message("kind='"));
        assert!(message("nowhere.toml").contains("cannot read nowhere.toml"));
    }

    #[test]
    fn a_file_of_another_kind_is_refused_with_what_to_name_in_its_place() {
        let message = |text: &str| {
            let file = tempfile::NamedTempFile::new().unwrap();
            std::fs::write(file.path(), text).unwrap();
            let path = file.path().to_str().unwrap();
            description(path, "controller").unwrap_err().to_string().replace(path, "FILE.toml")
        };
        let run = "[run]\nduration_s = 1.0\n";
        for (processes, expected) in [
            ("[process.controller]\nkind = 'pid'", "below its [process.controller], without this line"),
            ("[process.law]\nkind = 'pid'", "below its [process.law]"),
            ("[process.a]\nkind = 'a'\n[process.b]\nkind = 'b'", "its processes are a, b"),
            ("", "[process.NAME]"),
        ] {
            let text = message(&format!("{run}{processes}"));
            assert!(
                text.starts_with("--with: FILE.toml is a manifest, expected keys of one process"),
                "{text}"
            );
            assert!(text.contains(expected), "{text}");
        }
        let gains = "[roll]\nproportional = { value = 1, unit = '1/s^2', source = 'tuned' }";
        let text = message(gains);
        assert!(
            text.contains("is a gains file") && text.contains("--with 'gains = \"FILE.toml\"'"),
            "{text}"
        );
        assert!(message("name = 'v'\nbase = 'w.toml'").contains("--with 'vehicle = \"FILE.toml\"'"));
        // The same as text, and gains within the keys of a process.
        assert!(description("process.controller.kind = 'pid'", "controller").is_err());
        assert!(description(&gains.replace("[roll]", "[gains.roll]"), "controller").is_ok());
    }
}
