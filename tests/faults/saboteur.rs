//! A node that fails from the inside when it is told to: this executable itself, started by a launcher.

use bus::messages::{PlantState, Time};
use bus::{BusError, Message, NODE_VARIABLE, Node};
use std::time::Duration;

/// The environment variables that tell the saboteur what to do, and when.
pub const FAULT_VARIABLE: &str = "HUMMINGBUS_TEST_FAULT";
pub const TICK_VARIABLE: &str = "HUMMINGBUS_TEST_FAULT_TICK";

/// What the saboteur sends while it behaves.
#[derive(Clone, Copy, Default, Message)]
#[repr(C)]
#[message(type_name = "test_msgs/msg/Report")]
struct Report {
    stamp: Time,
    /// The altitude that it saw.
    #[field(unit = "m", frame = "world")]
    altitude: f64,
}

/// How a node fails from the inside.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    Error,
    Panic,
    ExitWith3,
    ExitWith0,
    Unwritten,
    SlowStep,
}

impl Fault {
    /// Those that end the run.
    pub const ENDING: [Self; 5] =
        [Self::Error, Self::Panic, Self::ExitWith3, Self::ExitWith0, Self::Unwritten];

    fn find(name: &str) -> Option<Self> {
        let mut all = Self::ENDING.into_iter().chain([Self::SlowStep]);
        all.find(|fault| format!("{fault:?}") == name)
    }

    fn strike(self) -> Result<(), String> {
        match self {
            Self::Error => Err("the battery is empty".to_owned()),
            Self::Panic => panic!("the propeller came off"),
            Self::ExitWith3 => std::process::exit(3),
            Self::ExitWith0 => std::process::exit(0),
            Self::Unwritten | Self::SlowStep => Ok(()),
        }
    }
}

/// The saboteur's part in a manifest.
pub fn table() -> String {
    let executable = std::env::current_exe().unwrap();
    format!(
        "[process.saboteur]\n\
         command = [{executable:?}, \"saboteur::a_process_started_by_a_launcher_is_the_saboteur\", \"--exact\", \
         \"--nocapture\"]\n\
         inputs.state = \"/plant/state\"\n\
         outputs.report = {{ type = \"test_msgs/msg/Report\" }}\n\n"
    )
}

/// A test like any other, but for a launcher's process: what it does is this.
#[test]
fn a_process_started_by_a_launcher_is_the_saboteur() {
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
    let (input, output) = (node.input::<PlantState>("state")?, node.output::<Report>("report")?);
    let variable = |name| std::env::var(name).ok();
    let fault = variable(FAULT_VARIABLE).and_then(|name| Fault::find(&name));
    let at_tick = variable(TICK_VARIABLE).and_then(|tick| tick.parse().ok()).unwrap_or(0);
    node.run(|tick| {
        if fault == Some(Fault::SlowStep) {
            std::thread::sleep(Duration::from_millis(3));
        } else if let Some(fault) = fault.filter(|_| tick.number() == at_tick) {
            return fault.strike();
        }
        let report = Report { altitude: tick.get(input).position.z, ..Report::default() };
        tick.write(output, report).map_err(|error| error.to_string())
    })
}
