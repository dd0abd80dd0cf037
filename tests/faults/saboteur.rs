//! A node that fails from the inside when it is told to: this executable itself, started by a launcher.

use bus::messages::{PlantState, Time};
use bus::{BusError, Message, NODE_VARIABLE, Node};
use std::path::Path;
use std::time::Duration;

/// The environment variables that tell the saboteur what to do, and when.
pub const FAULT_VARIABLE: &str = "HUMMINGBUS_TEST_FAULT";
pub const TICK_VARIABLE: &str = "HUMMINGBUS_TEST_FAULT_TICK";
/// The file that another instance makes when it computes the tick of a [`Fault::LateExit`].
pub const MARK_VARIABLE: &str = "HUMMINGBUS_TEST_FAULT_MARK";
/// The file for which a [`Fault::Await`] waits.
pub const AWAITED_VARIABLE: &str = "HUMMINGBUS_TEST_FAULT_AWAITED";
/// Number of processes of the node that fail, from the first on; all if it is not set.
pub const GENERATIONS_VARIABLE: &str = "HUMMINGBUS_TEST_FAULT_GENERATIONS";

/// Report of the saboteur while it behaves.
#[derive(Clone, Copy, Default, Message)]
#[repr(C)]
#[message(type_name = "test_msgs/msg/Report")]
struct Report {
    stamp: Time,
    /// The altitude that it saw.
    #[field(unit = "m", frame = "world")]
    altitude: f64,
}

/// Another message under the same name, as after a change on one side only.
#[derive(Clone, Copy, Default, Message)]
#[repr(C)]
#[message(type_name = "test_msgs/msg/Report")]
struct OtherReport {
    stamp: Time,
    /// The rate of climb that it saw.
    #[field(unit = "m/s", frame = "world")]
    climb: f64,
}

/// Failure of a node from the inside.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    Error,
    Panic,
    ExitWith3,
    /// As the last of all: the others have completed the tick by then, another instance of its node included.
    LateExit,
    ExitWith0,
    Unwritten,
    SlowStep,
    /// Its step lasts until somebody makes a file.
    Await,
    Hang,
    NeverJoins,
    OtherLayout,
    /// It dies when it has completed its last tick.
    BehindTheEnd,
}

impl Fault {
    /// Those that end the run.
    pub const ENDING: [Self; 5] =
        [Self::Error, Self::Panic, Self::ExitWith3, Self::ExitWith0, Self::Unwritten];

    fn find(name: &str) -> Option<Self> {
        let others = [Self::SlowStep, Self::Await, Self::Hang, Self::NeverJoins, Self::OtherLayout];
        let at_end = [Self::BehindTheEnd, Self::LateExit];
        let mut all = Self::ENDING.into_iter().chain(others).chain(at_end);
        all.find(|fault| format!("{fault:?}") == name)
    }

    fn strike(self) -> Result<(), String> {
        match self {
            Self::Error => Err("the battery is empty".to_owned()),
            Self::Panic => panic!("the propeller came off"),
            Self::ExitWith3 => std::process::exit(3),
            Self::LateExit => {
                await_file(MARK_VARIABLE);
                // From the mark to the end of the other's part are a sample and a store.
                std::thread::sleep(Duration::from_millis(300));
                std::process::exit(3)
            }
            Self::ExitWith0 => std::process::exit(0),
            Self::Await => {
                await_file(AWAITED_VARIABLE);
                Ok(())
            }
            Self::Hang => hang(),
            Self::Unwritten | Self::SlowStep | Self::NeverJoins | Self::OtherLayout | Self::BehindTheEnd => {
                Ok(())
            }
        }
    }
}

/// Waits until the file that `variable` names exists.
fn await_file(variable: &str) {
    let is_awaited = || std::env::var_os(variable).is_some_and(|path| !Path::new(&path).exists());
    while is_awaited() {
        std::thread::sleep(Duration::from_millis(1));
    }
}

fn hang() -> ! {
    loop {
        std::thread::park();
    }
}

/// The words that start the saboteur.
pub fn command() -> [String; 4] {
    let executable = std::env::current_exe().unwrap().to_string_lossy().into_owned();
    [
        executable,
        "saboteur::a_process_started_by_a_launcher_is_the_saboteur".to_owned(),
        "--exact".to_owned(),
        "--nocapture".to_owned(),
    ]
}

/// The saboteur's part in a manifest.
pub fn table() -> String {
    format!(
        "[process.saboteur]\n\
         command = {:?}\n\
         inputs.state = \"/plant/state\"\n\
         outputs.report = {{ type = \"test_msgs/msg/Report\" }}\n\n",
        command()
    )
}

/// A test like any other, but for a launcher's process: what it does is this.
#[test]
fn a_process_started_by_a_launcher_is_the_saboteur() {
    if std::env::var_os(NODE_VARIABLE).is_none() {
        return;
    }
    match run() {
        Ok(()) if fault() == Some(Fault::BehindTheEnd) => std::process::exit(3),
        Ok(()) | Err(BusError::Aborted) => std::process::exit(0),
        Err(error) => {
            eprintln!("error: {error}");
            std::process::exit(1);
        }
    }
}

fn run() -> Result<(), BusError> {
    let fault = fault();
    if fault == Some(Fault::NeverJoins) {
        hang();
    }
    let mut node = Node::join()?;
    if fault == Some(Fault::OtherLayout) {
        node.input::<PlantState>("state")?;
        let output = node.output::<OtherReport>("report")?;
        return node.run(|tick| tick.write(output, OtherReport::default()));
    }
    let (input, output) = (node.input::<PlantState>("state")?, node.output::<Report>("report")?);
    let at_tick = number(TICK_VARIABLE).unwrap_or(0);
    node.run(|tick| {
        if fault == Some(Fault::SlowStep) {
            std::thread::sleep(Duration::from_millis(3));
        } else if let Some(fault) =
            fault.filter(|&fault| fault != Fault::BehindTheEnd && tick.number() == at_tick)
        {
            fault.strike()?;
            if fault != Fault::Await {
                return Ok(());
            }
        }
        if let Some(mark) = std::env::var_os(MARK_VARIABLE).filter(|_| tick.number() == at_tick) {
            std::fs::write(mark, "").map_err(|error| error.to_string())?;
        }
        let report = Report { altitude: tick.get(input).position.z, ..Report::default() };
        tick.write(output, report).map_err(|error| error.to_string())
    })
}

/// The fault of this process, if it has one.
fn fault() -> Option<Fault> {
    let generation = number(bus::GENERATION_VARIABLE).unwrap_or(0);
    let fails = generation < number(GENERATIONS_VARIABLE).unwrap_or(u32::MAX);
    std::env::var(FAULT_VARIABLE).ok().filter(|_| fails).and_then(|name| Fault::find(&name))
}

fn number(variable: &str) -> Option<u32> {
    std::env::var(variable).ok().and_then(|text| text.parse().ok())
}
