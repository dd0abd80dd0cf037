//! The processes that the tests put into runs: this executable itself, started by a launcher.

use bus::lockstep::LiveView;
use bus::messages::Time;
use bus::plan::Plan;
use bus::process::RUN_VARIABLE;
use bus::{BusError, Input, Message, NODE_VARIABLE, Node, Tick};
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// Message of a test node: its tick, and the note that it saw.
#[derive(Clone, Copy, Default, Message)]
#[repr(C)]
#[message(type_name = "test_msgs/msg/Note")]
struct Note {
    stamp: Time,
    /// The sender's tick.
    tick: u64,
    /// The sender's tick of the note that was seen.
    seen_tick: u64,
    /// The stamp of the note that was seen, in nanoseconds.
    seen_ns: u64,
    /// Ticks that the sender was ahead of the slowest node.
    lead_ticks: u64,
}

/// Another message under the same name, as after a change on one side only.
#[derive(Clone, Copy, Default, Message)]
#[repr(C)]
#[message(type_name = "test_msgs/msg/Note")]
struct OtherNote {
    stamp: Time,
    /// Was the sender's tick.
    #[field(unit = "m", frame = "world")]
    place: [f64; 3],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Parameters {
    #[serde(default)]
    has_other_layout: bool,
    /// With the other layout: what it sends is no number at `at_tick`.
    #[serde(default)]
    is_nan: bool,
    /// Declares its output a second time, as the other layout.
    #[serde(default)]
    declares_twice: bool,
    fault: Option<Fault>,
    #[serde(default)]
    at_tick: u32,
    /// Time that the node sleeps at that tick.
    #[serde(default)]
    nap_ms: u64,
    /// A file, and the text that has to be in it.
    data: Option<PathBuf>,
    expected_text: Option<String>,
    /// Further files, and the texts that have to be in them.
    #[serde(default)]
    others: Vec<(PathBuf, String)>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Fault {
    Error,
    Panic,
    ExitWith3,
    ExitWith0,
    Unwritten,
    Hang,
}

impl Fault {
    fn strike(self) -> Result<(), String> {
        match self {
            Self::Error => Err("the battery is empty".to_owned()),
            Self::Panic => panic!("the propeller came off"),
            Self::ExitWith3 => std::process::exit(3),
            Self::ExitWith0 => std::process::exit(0),
            Self::Unwritten => Ok(()),
            Self::Hang => loop {
                std::thread::park();
            },
        }
    }
}

/// A test like any other, but for a launcher's processes: what they do is this.
#[test]
fn a_process_started_by_a_launcher_is_a_node() {
    if std::env::var_os(NODE_VARIABLE).is_none() {
        return;
    }
    match run() {
        Ok(()) | Err(BusError::Aborted) => std::process::exit(0),
        Err(error) => {
            eprintln!("error: {error}");
            std::process::exit(1);
        }
    }
}

fn run() -> Result<(), BusError> {
    let mut node = Node::join()?;
    let parameters: Parameters = node.parameters()?;
    if let Some(path) = &parameters.data {
        let text = node.files().text(path).map_err(|cause| node.error(cause))?;
        if Some(&text) != parameters.expected_text.as_ref() {
            return Err(node.error(format!("{} holds {text:?}", path.display())));
        }
    }
    for (path, expected) in &parameters.others {
        let text = std::fs::read_to_string(path).map_err(|cause| node.error(cause))?;
        if text != *expected {
            return Err(node.error(format!("{} holds {text:?}", path.display())));
        }
    }
    if parameters.has_other_layout {
        let output = node.output::<OtherNote>("note")?;
        return node.run(|tick| {
            let is_nan = parameters.is_nan && tick.number() == parameters.at_tick;
            let place = [0.0, if is_nan { f64::NAN } else { 1.0 }, 2.0];
            tick.write(output, OtherNote { place, ..Default::default() })
        });
    }
    let input = node.optional_input::<Note>("input");
    let output = node.optional_output::<Note>("note")?;
    if parameters.declares_twice {
        node.output::<OtherNote>("note")?;
    }
    let control = control()?;
    node.run(|tick| {
        if let Some(fault) = parameters.fault.filter(|_| tick.number() == parameters.at_tick) {
            return fault.strike();
        }
        if parameters.nap_ms > 0 && tick.number() == parameters.at_tick {
            std::thread::sleep(std::time::Duration::from_millis(parameters.nap_ms));
        }
        let Some(output) = output else { return Ok(()) };
        tick.write(output, note(tick, input, &control)).map_err(|error| error.to_string())
    })
}

fn control() -> Result<LiveView, BusError> {
    let run_dir = std::env::var(RUN_VARIABLE).unwrap();
    LiveView::open(&Plan::load(Path::new(&run_dir))?)
}

fn note(tick: &Tick<'_>, input: Option<Input<Note>>, control: &LiveView) -> Note {
    let seen = input.map(|input| *tick.get(input)).unwrap_or_default();
    Note {
        tick: tick.number().into(),
        seen_tick: seen.tick,
        seen_ns: u64::from(seen.stamp.sec.unsigned_abs()) * 1_000_000_000 + u64::from(seen.stamp.nanosec),
        lead_ticks: tick.number().saturating_sub(control.completed_ticks()).into(),
        ..Note::default()
    }
}

/// The table of a manifest that makes process `name` a node of this executable.
pub fn table(name: &str, rest: &str) -> String {
    let executable = std::env::current_exe().unwrap();
    let test = "nodes::a_process_started_by_a_launcher_is_a_node";
    format!(
        "[process.{name}]\ncommand = [{executable:?}, {test:?}, \"--exact\", \"--nocapture\"]\n{rest}\n\n"
    )
}

/// As [`table`], with the output `note`, sent every `every_ticks` ticks.
pub fn sender(name: &str, every_ticks: u32, rest: &str) -> String {
    let output = format!("outputs.note = {{ type = \"test_msgs/msg/Note\", every_ticks = {every_ticks} }}");
    table(name, &format!("{rest}\n{output}"))
}

/// A manifest of a run of `ticks` milliseconds with these processes and a recorder.
pub fn manifest(ticks: u32, processes: &[String]) -> String {
    let run = format!("[run]\nduration_s = {}\n\n", f64::from(ticks) * 1e-3);
    run + &processes.concat() + "[process.recorder]\nkind = \"recorder\"\n"
}
