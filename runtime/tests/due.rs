//! A step is told which of its outputs are due, alike under every host. In a process of its own: unit tests beside it hold the only
//! place of a run.

use bus::component::{Component, Info, StepError};
use bus::context::{NodeContext, StepContext};
use bus::messages::MotorCommand;
use bus::ports::OutputNumber;
use bus::{ParameterError, Registration};
use runtime::checkpoint::Checkpoint;
use runtime::host::Host;
use runtime::launcher::Launcher;
use runtime::manifest::{Composition, Manifest, ManifestBuilder};
use runtime::registry::Registry;
use std::collections::BTreeMap;
use std::path::Path;

/// Ticks between two samples of the output `rare`.
const EVERY_TICKS: u32 = 7;
const TICKS: u32 = 400;

#[derive(bus::OutputPorts)]
struct Outputs {
    command: MotorCommand,
    rare: Option<MotorCommand>,
    unwired: Option<MotorCommand>,
}

const COMMAND: OutputNumber = OutputNumber::of::<Outputs>("command");
const RARE: OutputNumber = OutputNumber::of::<Outputs>("rare");
const UNWIRED: OutputNumber = OutputNumber::of::<Outputs>("unwired");

/// Sends on `rare` its tick, and the number of times that it has computed this output.
struct Source;
impl Component for Source {
    const INFO: Info = Info::new("source", "counts how often an output is due");
    type Parameters = BTreeMap<String, f64>;
    type Inputs<'a> = ();
    type Outputs = Outputs;
    type State = MotorCommand;
    fn new(_: Self::Parameters, _: &NodeContext<'_>) -> Result<Self, ParameterError> {
        Ok(Self)
    }
    fn initial(&self) -> MotorCommand {
        MotorCommand { command: [0.0; 4].into(), ..MotorCommand::default() }
    }
    fn step(
        &self,
        context: &StepContext<'_>,
        (): (),
        state: &mut MotorCommand,
    ) -> Result<Outputs, StepError> {
        if !context.is_due(COMMAND) || context.is_due(UNWIRED) {
            return Err("`command` is due at each tick, and `unwired` at none".into());
        }
        let rare = context.is_due(RARE).then(|| {
            state.command[0] = f64::from(context.tick());
            state.command[1] += 1.0;
            *state
        });
        Ok(Outputs { command: *state, rare, unwired: None })
    }
}

const COMPONENTS: Registry =
    Registry::new(&[Registration::of::<Source>(), Registration::of::<recorder::node::Recorder>()]);

fn described() -> ManifestBuilder {
    ManifestBuilder::new()
        .set("run.rate_hz", 1000)
        .set("run.duration_s", f64::from(TICKS) * 1e-3)
        .set("process.source.kind", "source")
        .set("process.source.outputs.rare.every_ticks", i64::from(EVERY_TICKS))
        .set("process.recorder.kind", "recorder")
}

/// Tick and number in the samples of `rare`.
fn sent(launcher: Launcher<'_>, manifest: &Manifest, path: &Path) -> Vec<(f64, f64)> {
    let (_, recording) = launcher.fly(manifest, path).unwrap();
    let fields = [("/source/rare", "command[0]"), ("/source/rare", "command[1]")];
    let series = recording.unwrap().series(&fields).unwrap();
    series[0].value.iter().copied().zip(series[1].value.iter().copied()).collect()
}

/// Samples of a component that computes the output at the ticks at which it is sent, and at no other.
fn computed_when_due() -> Vec<(f64, f64)> {
    (0..TICKS.div_ceil(EVERY_TICKS))
        .map(|index| (f64::from(EVERY_TICKS * index), f64::from(index + 1)))
        .collect()
}

#[test]
fn an_output_is_due_at_its_ticks_under_every_host_and_for_a_successor() {
    let folder = tempfile::tempdir().unwrap();
    let build =
        |described: ManifestBuilder| described.build(&folder.path().join("a.toml"), COMPONENTS).unwrap();
    let alone = build(described());
    let swap = toml::toml! { process = "source"
    at_tick = 203
    shadow_ticks = 20 };
    let swapped = build(described().add("swap", swap));
    for (case, launcher, manifest) in [
        ("one thread", Launcher::new(Host::InProcess), &alone),
        ("threads", Launcher::new(Host::Threads), &alone),
        ("a group", Launcher::new(Host::Threads).composed(Composition::All), &alone),
        ("a swap", Launcher::new(Host::Threads), &swapped),
    ] {
        let found = sent(launcher, manifest, &folder.path().join("a.mcap"));
        assert_eq!(found, computed_when_due(), "{case}");
    }
}

#[test]
fn a_run_from_a_checkpoint_computes_the_same_samples() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let manifest = described().set("run.checkpoint_every_s", 0.2).build(&path("a.toml"), COMPONENTS).unwrap();
    // A checkpoint loads the manifest from its file.
    std::fs::write(path("a.toml"), &manifest.recorded_text).unwrap();
    let whole = sent(Launcher::new(Host::InProcess), &manifest, &path("a.mcap"));
    assert_eq!(whole, computed_when_due());
    for host in [Host::InProcess, Host::Threads] {
        let from = Checkpoint::read(&path("a.200.ckpt")).unwrap();
        let fork = from.load_manifest(&[], COMPONENTS).unwrap();
        let found = sent(Launcher::new(host.clone()).going_on_from(from), &fork, &path("b.mcap"));
        assert!(found.len() >= 28 && whole.ends_with(&found), "{host:?}: {found:?}");
    }
}

/// A step of 1 ms is sent a tick later: the sample of tick 7 is that of the step at tick 6.
#[test]
fn where_steps_take_time_each_step_computes_the_output() {
    let folder = tempfile::tempdir().unwrap();
    let timed = described()
        .set("process.source.computing_time.distribution", "constant")
        .set("process.source.computing_time.ms", 1.0)
        .build(&folder.path().join("a.toml"), COMPONENTS)
        .unwrap();
    let later = computed_when_due().into_iter().skip(1).map(|(tick, _)| (tick - 1.0, tick));
    let expected: Vec<_> = std::iter::once((0.0, 1.0)).chain(later).collect();
    for host in [Host::InProcess, Host::Threads] {
        let found = sent(Launcher::new(host.clone()), &timed, &folder.path().join("a.mcap"));
        assert_eq!(found, expected, "{host:?}");
    }
}
