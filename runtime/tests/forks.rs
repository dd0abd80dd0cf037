//! Another component goes on from a checkpoint in the place of the one that has written it. In a process of its own: unit tests beside it
//! hold the only place of a run.

use bus::component::{Component, Info, StepError};
use bus::context::{NodeContext, StepContext};
use bus::messages::{MotorCommand, SetPoint};
use bus::{ParameterError, Registration};
use runtime::checkpoint::Checkpoint;
use runtime::host::Host;
use runtime::launcher::Launcher;
use runtime::manifest::{Manifest, ManifestBuilder};
use runtime::registry::Registry;
use std::collections::BTreeMap;
use std::path::Path;

#[derive(bus::OutputPorts)]
struct Outputs {
    command: MotorCommand,
}

#[derive(bus::InputPorts)]
struct Inputs<'a> {
    #[allow(dead_code, reason = "it makes the checkpoint hold the sample")]
    command: &'a MotorCommand,
}

fn sent(command: f64) -> Outputs {
    Outputs { command: MotorCommand { command: [command; 4].into(), ..Default::default() } }
}

/// Sends its tick.
struct First;
impl Component for First {
    const INFO: Info = Info::new("first", "sends its tick");
    type Parameters = BTreeMap<String, f64>;
    type Inputs<'a> = ();
    type Outputs = Outputs;
    type State = ();
    fn new(_: Self::Parameters, _: &NodeContext<'_>) -> Result<Self, ParameterError> {
        Ok(Self)
    }
    fn initial(&self) {}
    fn step(&self, context: &StepContext<'_>, (): (), (): &mut ()) -> Result<Outputs, StepError> {
        Ok(sent(f64::from(context.tick())))
    }
}

/// Adds 100 to its predecessor's last output, then 1000 a tick; its state is not a state of `First`.
struct Second;
impl Component for Second {
    const INFO: Info = Info::new("second", "goes on from what its predecessor sent");
    type Parameters = BTreeMap<String, f64>;
    type Inputs<'a> = ();
    type Outputs = Outputs;
    type State = SetPoint;
    fn new(_: Self::Parameters, _: &NodeContext<'_>) -> Result<Self, ParameterError> {
        Ok(Self)
    }
    fn initial(&self) -> SetPoint {
        SetPoint::default()
    }
    fn step(&self, context: &StepContext<'_>, (): (), state: &mut SetPoint) -> Result<Outputs, StepError> {
        let last: Option<Outputs> = context.predecessor();
        state.altitude = last.map_or(state.altitude + 1000.0, |last| last.command.command[0] + 100.0);
        Ok(sent(state.altitude))
    }
}

/// Reads the command.
struct Reader;
impl Component for Reader {
    const INFO: Info = Info::new("reader", "reads the command");
    type Parameters = BTreeMap<String, f64>;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = ();
    type State = ();
    fn new(_: Self::Parameters, _: &NodeContext<'_>) -> Result<Self, ParameterError> {
        Ok(Self)
    }
    fn initial(&self) {}
    fn step(&self, _: &StepContext<'_>, _: Inputs<'_>, (): &mut ()) -> Result<(), StepError> {
        Ok(())
    }
}

const COMPONENTS: Registry = Registry::new(&[
    Registration::of::<First>(),
    Registration::of::<Second>(),
    Registration::of::<Reader>(),
    Registration::of::<recorder::node::Recorder>(),
]);

fn commands(host: Host, from: Option<Checkpoint>, manifest: &Manifest, path: &Path) -> Vec<f64> {
    let launcher = Launcher::new(host);
    let launcher = match from {
        Some(from) => launcher.going_on_from(from),
        None => launcher,
    };
    let (_, recording) = launcher.fly(manifest, path).unwrap();
    recording.unwrap().series(&[("/source/command", "command[0]")]).unwrap()[0].value.clone()
}

#[test]
fn a_successor_of_another_state_begins_with_what_was_sent_last() {
    let folder = tempfile::tempdir().unwrap();
    let built = ManifestBuilder::new()
        .set("run.duration_s", 0.01)
        .set("run.checkpoint_every_s", 0.005)
        .set("process.source.kind", "first")
        .set("process.reader.kind", "reader")
        .set("process.reader.inputs.command", "/source/command")
        .set("process.recorder.kind", "recorder")
        .build(&folder.path().join("a.toml"), COMPONENTS)
        .unwrap();
    // A checkpoint loads the manifest from its file.
    std::fs::write(folder.path().join("a.toml"), &built.recorded_text).unwrap();
    let whole = commands(Host::InProcess, None, &built, &folder.path().join("a.mcap"));
    assert_eq!(whole, (0..10).map(f64::from).collect::<Vec<_>>());
    for host in [Host::InProcess, Host::Threads] {
        let from = Checkpoint::read(&folder.path().join("a.5.ckpt")).unwrap();
        let set = ["process.source.kind=second".to_owned()];
        let fork = from.load_manifest(&set, COMPONENTS).unwrap();
        let found = commands(host, Some(from), &fork, &folder.path().join("b.mcap"));
        assert_eq!(found, [104.0, 1104.0, 2104.0, 3104.0, 4104.0]);
    }
}
