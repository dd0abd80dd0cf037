//! Remarks of components reach the outcome of a run, whatever hosts its nodes. In a process of its own: unit tests beside it hold the
//! only place of a run.

use bus::component::{Component, Info, StepError};
use bus::context::{NodeContext, StepContext};
use bus::messages::MotorCommand;
use bus::remark::Remark;
use bus::{ParameterError, Registration};
use runtime::host::Host;
use runtime::launcher::Launcher;
use runtime::manifest::{Composition, ManifestBuilder};
use runtime::registry::Registry;
use std::collections::BTreeMap;

#[derive(bus::OutputPorts)]
struct Outputs {
    command: MotorCommand,
}

/// Counts its ticks, and remarks on them if there are enough.
struct Counter {
    least_ticks: f64,
}

impl Component for Counter {
    const INFO: Info = Info::new("counter", "counts its ticks");
    type Parameters = BTreeMap<String, f64>;
    type Inputs<'a> = ();
    type Outputs = Outputs;
    type State = MotorCommand;

    fn new(parameters: Self::Parameters, _: &NodeContext<'_>) -> Result<Self, ParameterError> {
        Ok(Self { least_ticks: parameters.get("least_ticks").copied().unwrap_or_default() })
    }

    fn initial(&self) -> MotorCommand {
        MotorCommand { command: [0.0; 4].into(), ..MotorCommand::default() }
    }

    fn step(&self, _: &StepContext<'_>, (): (), state: &mut MotorCommand) -> Result<Outputs, StepError> {
        state.command = [state.command[0] + 1.0; 4].into();
        Ok(Outputs { command: *state })
    }

    fn remark(&self, state: &MotorCommand) -> Option<String> {
        let ticks = state.command[0];
        (ticks >= self.least_ticks).then(|| format!("{ticks} ticks"))
    }
}

const COMPONENTS: Registry = Registry::new(&[Registration::of::<Counter>()]);

/// The remarks of a run of 50 ticks.
fn remarks(launcher: Launcher<'_>) -> Vec<String> {
    let folder = tempfile::tempdir().unwrap();
    let manifest = ManifestBuilder::new()
        .set("run.rate_hz", 1000)
        .set("run.duration_s", 0.05)
        .set("process.first.kind", "counter")
        .set("process.first.parameters.least_ticks", 50.0)
        .set("process.second.kind", "counter")
        .set("process.second.parameters.least_ticks", 51.0)
        .set("process.third.kind", "counter")
        .set("process.third.parameters.least_ticks", 1.0)
        .build(&folder.path().join("counters.toml"), COMPONENTS)
        .unwrap();
    let (outcome, recording) = launcher.fly(&manifest, &folder.path().join("counters.mcap")).unwrap();
    assert!(recording.is_none(), "nothing is recorded: remarks need no recording");
    outcome.remarks.iter().map(Remark::to_string).collect()
}

#[test]
fn remarks_come_from_one_thread_from_threads_and_from_a_group() {
    let expected = ["`first`: 50 ticks", "`third`: 50 ticks"];
    assert_eq!(remarks(Launcher::new(Host::InProcess)), expected);
    assert_eq!(remarks(Launcher::new(Host::Threads)), expected);
    assert_eq!(remarks(Launcher::new(Host::Threads).composed(Composition::All)), expected);
}

#[test]
fn the_remark_of_a_shadow_names_its_process() {
    let shadow = toml::toml! { parameters.least_ticks = 2.0 };
    let launcher = Launcher::new(Host::Threads).shadowing("second", shadow);
    assert_eq!(remarks(launcher), ["`first`: 50 ticks", "`second.1`: 50 ticks", "`third`: 50 ticks"]);
}
