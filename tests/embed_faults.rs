//! Faults of components on threads of this very process: whatever happens, the run ends, its error says why, and it
//! leaves neither threads nor shared memory nor its directory.
//!
//! One test at a time: each counts what this process has left.
#![allow(clippy::disallowed_methods, reason = "threads end at moments of host time")]

use bus::component::{Component, Info, StepError};
use bus::context::{NodeContext, StepContext};
use bus::messages::{MotorCommand, SetPoint};
use bus::{InputPorts, OutputPorts, ParameterError, Registration};
use campaign::base::Base;
use campaign::declaration::Campaign;
use campaign::row::Row;
use campaign::worker::{Job, Order, serve};
use hummingbus::{
    Answer, Error, Host, Launcher, Manifest, ManifestBuilder, Progress, Request, RunEvent, StopToken,
};
use runtime::registry::Registry;
use rustix::process::{Pid, Signal, kill_process};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering::SeqCst};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Counts its ticks, and does at one of them what it is told.
struct Source(Parameters);

#[derive(Clone, bus::Parameters)]
struct Parameters {
    fault: String,
    #[parameter(default = 0)]
    at_tick: u32,
}

#[derive(OutputPorts)]
struct Outputs {
    command: MotorCommand,
}

/// True while a fault is still to come: a process that is started again does not meet it again.
static IS_ARMED: AtomicBool = AtomicBool::new(false);
/// True if the threads that hang may go on.
static IS_RELEASED: AtomicBool = AtomicBool::new(false);

fn hang() {
    while !IS_RELEASED.load(SeqCst) {
        std::thread::sleep(Duration::from_millis(1));
    }
}

impl Component for Source {
    const INFO: Info = Info::new("source", "counts its ticks");
    type Parameters = Parameters;
    type Inputs<'a> = ();
    type Outputs = Outputs;
    type State = MotorCommand;

    fn new(parameters: Parameters, _: &NodeContext<'_>) -> Result<Self, ParameterError> {
        Ok(Self(parameters))
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
        // A node whose steps take time may skip the tick itself.
        let is_due = self.0.fault != "none" && context.tick() >= self.0.at_tick;
        if is_due && IS_ARMED.swap(false, SeqCst) {
            match self.0.fault.as_str() {
                "panic" => panic!("the propeller came off"),
                "error" => return Err("the gyroscope is stuck".into()),
                "hang" => hang(),
                other => unreachable!("{other}"),
            }
        }
        state.command[0] += 1.0;
        Ok(Outputs { command: *state })
    }
}

/// Component whose state is of another type than its predecessor's: it goes on from what that sent last.
struct Heir;

impl Component for Heir {
    const INFO: Info = Info::new("heir", "goes on from what its predecessor sent");
    type Parameters = serde::de::IgnoredAny;
    type Inputs<'a> = ();
    type Outputs = Outputs;
    type State = SetPoint;

    fn new(_: serde::de::IgnoredAny, _: &NodeContext<'_>) -> Result<Self, ParameterError> {
        Ok(Self)
    }

    fn initial(&self) -> SetPoint {
        SetPoint::default()
    }

    fn step(&self, context: &StepContext<'_>, (): (), state: &mut SetPoint) -> Result<Outputs, StepError> {
        if let Some(Outputs { command }) = context.predecessor() {
            state.altitude = 1000.0 + command.command[0];
        }
        Ok(Outputs {
            command: MotorCommand { command: [state.altitude; 4].into(), ..MotorCommand::default() },
        })
    }
}

/// Reads commands, and hangs behind a tick or heeds nothing if it is told to.
struct Sink(Parameters);

#[derive(InputPorts)]
struct Inputs<'a> {
    command: &'a MotorCommand,
}

impl Component for Sink {
    const INFO: Info = Info::new("sink", "reads commands");
    type Parameters = Parameters;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = ();
    type State = ();

    fn new(parameters: Parameters, _: &NodeContext<'_>) -> Result<Self, ParameterError> {
        Ok(Self(parameters))
    }

    fn initial(&self) {}

    fn step(&self, context: &StepContext<'_>, inputs: Inputs<'_>, (): &mut ()) -> Result<(), StepError> {
        if self.0.fault == "hang" && context.tick() == self.0.at_tick {
            hang();
        }
        let expected = f64::from(context.tick() + 1);
        if self.0.fault == "unheeding" || inputs.command.command[0] == expected {
            Ok(())
        } else {
            Err("a tick was skipped".into())
        }
    }
}

const COMPONENTS: Registry = Registry::new(&[
    Registration::of::<Source>(),
    Registration::of::<Heir>(),
    Registration::of::<Sink>(),
    Registration::of::<recorder::node::Recorder>(),
    Registration::of::<report::judge::node::Judge>(),
]);

/// Names of the threads of a run.
const THREADS: [&str; 5] = ["clock", "source", "sink", "recorder", "control"];

/// Two nodes and a recorder for `ticks` ticks; `fault` strikes the source at tick 50.
fn plan(ticks: u32, fault: &str) -> ManifestBuilder {
    ManifestBuilder::new()
        .set("run.rate_hz", 1000)
        .set("run.duration_s", f64::from(ticks) * 1e-3)
        .set("process.source.kind", "source")
        .set("process.source.parameters.fault", fault)
        .set("process.source.parameters.at_tick", 50)
        .set("process.sink.kind", "sink")
        .set("process.sink.inputs.command", "/source/command")
        .set("process.sink.parameters.fault", "none")
        .set("process.recorder.kind", "recorder")
}

fn build(plan: &ManifestBuilder, folder: &Path) -> Manifest {
    plan.build(&folder.join("faults.toml"), COMPONENTS).unwrap()
}

/// Flies `plan` with an armed fault; the counts that were recorded, or the error as text.
fn flown(plan: &ManifestBuilder, folder: &Path) -> Result<Vec<f64>, String> {
    flown_by(Launcher::new(Host::Threads), plan, folder, "a.mcap")
}

fn flown_by(
    launcher: Launcher<'_>,
    plan: &ManifestBuilder,
    folder: &Path,
    name: &str,
) -> Result<Vec<f64>, String> {
    IS_ARMED.store(true, SeqCst);
    let (_, recording) =
        launcher.fly(&build(plan, folder), &folder.join(name)).map_err(|error| error.with_causes())?;
    let series = recording.unwrap().series(&[("/source/command", "command[0]")]).unwrap();
    Ok(series[0].value.clone())
}

/// 1, 2, … `ticks`: no tick was skipped or computed twice.
fn counted(ticks: u32) -> Vec<f64> {
    (1..=ticks).map(f64::from).collect()
}

/// The names of the threads of runs in this process.
fn threads() -> Vec<String> {
    let tasks = std::fs::read_dir("/proc/self/task").unwrap().flatten();
    let names = tasks.filter_map(|task| std::fs::read_to_string(task.path().join("comm")).ok());
    let names = names.map(|name| name.trim().to_owned());
    let mut names: Vec<_> = names.filter(|name| THREADS.contains(&name.as_str())).collect();
    names.sort();
    names
}

/// Waits until the threads of runs are `expected`: one that was joined may stand there for a moment.
fn await_threads(expected: &[&str], patience: Duration) {
    let deadline = Instant::now() + patience;
    while threads() != expected && Instant::now() < deadline {
        std::thread::sleep(Duration::from_millis(1));
    }
}

fn require_threads(expected: &[&str]) {
    await_threads(expected, Duration::from_secs(1));
    assert_eq!(threads(), expected);
}

/// Returns the names of the files that runs of this process have left in shared memory and among temporary files.
fn files() -> Vec<String> {
    let pid = std::process::id();
    let of_runs = [format!("hb_{pid:x}-"), format!("hummingbus-{}-{pid:x}-", bus::process::user_id())];
    let folders = ["/dev/shm".into(), std::env::temp_dir()].map(std::fs::read_dir);
    let names = folders.into_iter().flatten().flatten().flatten();
    let names = names.map(|entry| entry.file_name().to_string_lossy().into_owned());
    names.filter(|name| of_runs.iter().any(|start| name.starts_with(start))).collect()
}

/// Runs `test`, alone in this process, and requires that its runs left nothing.
fn alone(test: impl FnOnce(&Path)) {
    static ALONE: Mutex<()> = Mutex::new(());
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let folder = tempfile::tempdir().unwrap();
    IS_RELEASED.store(false, SeqCst);
    let _release = ReleaseOnDrop;
    test(folder.path());
    require_threads(&[]);
    assert_eq!(files(), [""; 0]);
}

/// Lets those that hang go on, and waits for their end.
fn release() {
    IS_RELEASED.store(true, SeqCst);
    await_threads(&[], Duration::from_secs(10));
}

/// Releases those that hang also if a test panics, for the next one counts threads too.
struct ReleaseOnDrop;

impl Drop for ReleaseOnDrop {
    fn drop(&mut self) {
        release();
    }
}

#[test]
fn a_component_that_panics_ends_the_run_with_its_message() {
    alone(|folder| {
        let message = flown(&plan(1000, "panic"), folder).unwrap_err();
        assert!(
            message.contains("process `source` failed: it panicked: the propeller came off"),
            "{message}"
        );
        assert!(message.contains("aborted at tick 50") && message.contains("/source/command"), "{message}");
    });
}

#[test]
fn a_component_that_returns_an_error_ends_the_run_with_it() {
    alone(|folder| {
        let message = flown(&plan(1000, "error"), folder).unwrap_err();
        assert!(
            message.contains("process `source` failed") && message.contains("gyroscope is stuck"),
            "{message}"
        );
        assert!(message.contains("aborted at tick 50"), "{message}");
        // What was recorded until then is whole.
        assert!(recorder::reader::Recording::open(&folder.join("a.partial.mcap")).is_ok());
    });
}

#[test]
fn those_that_hang_are_left_behind_by_their_watchdog_and_nothing_else_is() {
    alone(|folder| {
        let plan = plan(1000, "hang")
            .set("process.source.watchdog_ms_host", 2000)
            .set("process.sink.watchdog_ms_host", 2000)
            .set("process.sink.parameters.fault", "hang")
            .set("process.sink.parameters.at_tick", 49);
        let message = flown(&plan, folder).unwrap_err();
        assert!(message.contains("was killed by the watchdog: the run stood still"), "{message}");
        // The others have ended.
        require_threads(&["sink", "source"]);
        assert_eq!(files(), [""; 0], "their run has signed off");
        release();
    });
}

#[test]
fn a_run_whose_listener_panics_is_taken_down() {
    alone(|folder| {
        let give_up = |event: RunEvent<'_>| match event {
            RunEvent::Progress(Progress { ticks, .. }) if ticks > 100 => panic!("the listener gave up"),
            _ => {}
        };
        let launcher = Launcher::new(Host::Threads).followed_by(give_up);
        let manifest = build(&plan(1_000_000, "none"), folder);
        let path = folder.join("a.mcap");
        let flown = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| launcher.fly(&manifest, &path)));
        assert_eq!(flown.unwrap_err().downcast_ref(), Some(&"the listener gave up"));
    });
}

#[test]
fn on_one_thread_a_panic_of_the_listener_is_not_told_as_that_of_a_component() {
    alone(|folder| {
        let give_up = |event: RunEvent<'_>| {
            if let RunEvent::Progress(_) = event {
                panic!("the listener gave up");
            }
        };
        let launcher = Launcher::new(Host::InProcess).followed_by(give_up);
        let error = launcher.fly(&build(&plan(1000, "none"), folder), &folder.join("a.mcap")).unwrap_err();
        let text = error.with_causes();
        assert!(text.contains("the listener of the run's events panicked: the listener gave up"), "{text}");
        assert_eq!(sides(&error), [false; 3], "{text}");
    });
}

#[test]
fn a_run_that_is_interrupted_twice_is_aborted() {
    alone(|folder| {
        let stop = StopToken::new();
        let interrupt = |event: RunEvent<'_>| match event {
            RunEvent::Progress(Progress { ticks, .. }) if ticks > 100 => {
                stop.stop();
                stop.stop();
            }
            _ => {}
        };
        let launcher = Launcher::new(Host::Threads).stopped_by(&stop).followed_by(interrupt);
        let message = flown_by(launcher, &plan(1_000_000, "none"), folder, "a.mcap").unwrap_err();
        assert!(message.contains("interrupted twice: the run was aborted at tick"), "{message}");
    });
}

#[test]
fn a_standby_is_promoted_whatever_ended_the_thread_before_it() {
    for fault in ["panic", "error"] {
        alone(|folder| {
            let plan = plan(400, fault)
                .set("process.source.on_exit", "standby")
                .set("process.source.standby.parameters.fault", "none");
            assert_eq!(flown(&plan, folder).unwrap(), counted(400), "{fault}");
        });
    }
}

#[test]
fn a_thread_is_restarted_with_the_state_of_the_one_that_ended() {
    for fault in ["panic", "error"] {
        alone(|folder| {
            let plan = plan(400, fault).set("process.source.on_exit", "restart");
            assert_eq!(flown(&plan, folder).unwrap(), counted(400), "{fault}");
        });
    }
}

/// A step under way goes on in the thread that takes over, at any of the node's ticks at which the first one ended.
#[test]
fn a_computing_time_goes_on_in_a_restarted_thread_and_in_a_standby() {
    let time = toml::toml! { distribution = "uniform"
    min_ms = 0.1
    max_ms = 9.0 };
    for (period_ticks, on_exit) in [(1, "restart"), (1, "standby"), (4, "restart"), (4, "standby")] {
        let timed = |fault: &str, at_tick: u32| {
            let plan = plan(400, fault)
                .set("process.source.computing_time", time.clone())
                .set("process.source.period_ticks", period_ticks)
                .set("process.source.on_exit", on_exit)
                .set("process.source.parameters.at_tick", at_tick)
                .set("process.sink.parameters.fault", "unheeding");
            if on_exit == "standby" {
                plan.set("process.source.standby.parameters.fault", "none")
            } else {
                plan
            }
        };
        alone(|folder| {
            let unhurt = flown(&timed("none", 0), folder).unwrap();
            let steps = unhurt.last().copied().unwrap();
            assert!((20.0..100.0).contains(&steps), "{steps} steps");
            for at_tick in [1, 50, 51, 52, 53, 54, 55, 56, 200] {
                let struck = flown(&timed("error", at_tick), folder).unwrap();
                assert!(!IS_ARMED.load(SeqCst), "the fault struck");
                assert_eq!(struck, unhurt, "{on_exit} at tick {at_tick}, every {period_ticks} ticks");
            }
        });
    }
}

/// The heir starts from the last outputs, with any step under way in it as a shadow when it takes over.
#[test]
fn what_takes_over_from_last_outputs_has_them_however_long_its_steps_take() {
    for at_tick in 200..208 {
        alone(|folder| {
            let swap = toml::toml! { process = "source"
            shadow_ticks = 20
            with = { kind = "heir", computing_time = { distribution = "constant", ms = 7.0 } } };
            let mut swap = toml::Value::Table(swap);
            swap.as_table_mut().unwrap().insert("at_tick".to_owned(), at_tick.into());
            let plan =
                plan(400, "none").set("swap", vec![swap]).set("process.sink.parameters.fault", "unheeding");
            let commands = flown(&plan, folder).unwrap();
            let (before, after) = commands.split_at(at_tick as usize);
            assert_eq!(before, counted(at_tick));
            let expected = 1000.0 + f64::from(at_tick);
            assert!(
                after.iter().all(|&command| command == expected),
                "at tick {at_tick}: {:?}",
                &after[..20]
            );
        });
    }
}

/// The thread that hung is left behind; once it goes on, it sends nothing any more.
#[test]
fn a_thread_that_hangs_is_replaced_and_sends_nothing_once_it_goes_on() {
    for on_exit in ["restart", "standby"] {
        alone(|folder| {
            let mut plan = plan(3000, "hang")
                .set("run.pace", 10.0)
                .set("process.source.watchdog_ms_host", 2000)
                .set("process.source.on_exit", on_exit);
            if on_exit == "standby" {
                plan = plan.set("process.source.standby.parameters.fault", "none");
            }
            let release_it = |event: RunEvent<'_>| match event {
                RunEvent::Progress(Progress { ticks, .. }) if ticks > 100 => IS_RELEASED.store(true, SeqCst),
                _ => {}
            };
            let launcher = Launcher::new(Host::Threads).followed_by(release_it);
            assert_eq!(flown_by(launcher, &plan, folder, "a.mcap").unwrap(), counted(3000), "{on_exit}");
            release();
        });
    }
}

#[test]
fn a_hot_swap_hands_the_state_over() {
    alone(|folder| {
        let swap = toml::toml! { process = "source"
        at_tick = 200
        shadow_ticks = 20 };
        assert_eq!(flown(&plan(400, "none").add("swap", swap), folder).unwrap(), counted(400));
    });
}

#[test]
fn a_swap_for_what_fails_is_refused_and_the_run_flies_on() {
    alone(|folder| {
        let stop = StopToken::new();
        let launcher = Launcher::new(Host::Threads).stopped_by(&stop);
        let remote = launcher.remote();
        let counts = std::thread::scope(|scope| {
            scope.spawn(|| {
                let with = "parameters.fault = 'panic'\nparameters.at_tick = 50_000".to_owned();
                let swap = Request::Swap {
                    process: "source".to_owned(),
                    with,
                    shadow_ticks: Some(100),
                    at_tick: Some(50_050),
                };
                let paused = remote.ask(Request::Pause);
                let (refused, resumed) = std::thread::scope(|scope| {
                    let asked = scope.spawn(|| remote.ask(swap));
                    let resumed = remote.ask(Request::Resume);
                    (asked.join().unwrap(), resumed)
                });
                // Before anything is required: a run that is not stopped takes its time.
                stop.stop();
                assert!(matches!(paused, Answer::Done { .. }), "{paused:?}");
                assert!(matches!(resumed, Answer::Done { .. }), "{resumed:?}");
                let Answer::Refused { reason, .. } = refused else { panic!("{refused:?}") };
                assert!(reason.contains("the propeller came off"), "{reason}");
            });
            // Paced, so that the swap is asked for in time even if its thread starts late.
            let plan = plan(10_000_000, "none").set("run.pace", 10.0);
            flown_by(launcher, &plan, folder, "a.mcap").unwrap()
        });
        assert_eq!(counts, counted(u32::try_from(counts.len()).unwrap()));
        assert!(counts.len() > 50_000);
    });
}

#[test]
fn of_two_runs_at_once_one_fails_and_the_other_does_not_notice() {
    alone(|folder| {
        let (sound, broken) = (plan(2000, "none"), plan(2000, "panic"));
        std::thread::scope(|scope| {
            let sound = scope.spawn(|| flown_by(Launcher::new(Host::Threads), &sound, folder, "sound.mcap"));
            for _ in 0..3 {
                let message =
                    flown_by(Launcher::new(Host::Threads), &broken, folder, "broken.mcap").unwrap_err();
                assert!(message.contains("the propeller came off"), "{message}");
            }
            assert_eq!(sound.join().unwrap().unwrap(), counted(2000));
        });
    });
}

/// A campaign of two flights, whose source panics in the first.
const CAMPAIGN: &str = "manifest = \"faults.toml\"\nflights = 2\nvary = []\n[[measure]]\nname = \"count\"\n\
                        topic = \"/source/command\"\nfield = \"command[0]\"\nunit = \"count\"\nstatistic = \"last\"\n";

#[test]
fn a_flight_of_a_campaign_that_panics_has_the_reason_in_its_row_and_its_worker_flies_on() {
    alone(|folder| {
        IS_ARMED.store(true, SeqCst);
        let manifest = "[run]\nrate_hz = 1000\nduration_s = 0.2\n[process.source]\nkind = \"source\"\n\
                        parameters = { fault = \"panic\", at_tick = 50 }\n";
        std::fs::write(folder.join("faults.toml"), manifest).unwrap();
        let path = folder.join("c.toml");
        let campaign = Campaign::parse(&path, CAMPAIGN).unwrap();
        let fingerprint = Base::read(&campaign, COMPONENTS).unwrap().fingerprint;
        let (build, text, folder) = ("1".to_owned(), CAMPAIGN.to_owned(), folder.to_owned());
        let order = Order { build, path, text, fingerprint, folder };
        let jobs = (0..2).map(|flight| serde_json::to_string(&Job { flight, sets: Vec::new() }).unwrap());
        let lines: Vec<String> =
            std::iter::once(serde_json::to_string(&order).unwrap()).chain(jobs).collect();
        let mut answers = Vec::new();
        serve(COMPONENTS, "1", lines.join("\n").as_bytes(), &mut answers).unwrap();
        let answers = String::from_utf8(answers).unwrap();
        let rows: Vec<Row> = answers.lines().skip(1).map(|row| serde_json::from_str(row).unwrap()).collect();
        let error = rows[0].error.as_deref().unwrap();
        assert!(error.contains("the propeller came off") && !rows[0].is_of_host, "{error}");
        assert_eq!((&rows[1].error, &rows[1].figures[..]), (&None, &[Some(200.0)][..]));
    });
}

/// [`Error::is_component`], [`Error::is_input`] and [`Error::is_system`].
fn sides(error: &Error) -> [bool; 3] {
    [error.is_component(), error.is_input(), error.is_system()]
}

#[test]
fn an_error_about_a_manifest_is_one_of_the_input_and_has_the_place() {
    alone(|folder| {
        let path = folder.join("wrong.toml");
        std::fs::write(&path, "[run]\nrate_hz = 1000\nduration_s = \"long\"\n[process]\n").unwrap();
        let error = hummingbus::check_with_programs(&path, &[]).unwrap_err();
        assert_eq!(sides(&error), [false, true, false], "{error}");
        let fault = error.diagnostic().unwrap();
        assert_eq!((fault.file.as_str(), fault.place.as_ref().unwrap().line), (path.to_str().unwrap(), 3));
        assert_eq!(error.process(), None);
    });
}

#[test]
fn an_error_of_a_component_names_its_process_on_one_thread_and_on_several() {
    for host in [Host::InProcess, Host::Threads] {
        for fault in ["error", "panic"] {
            alone(|folder| {
                IS_ARMED.store(true, SeqCst);
                let manifest = build(&plan(1000, fault), folder);
                let flown = Launcher::new(host.clone()).fly(&manifest, &folder.join("a.mcap"));
                let error = flown.unwrap_err();
                assert_eq!(sides(&error), [true, false, false], "{host:?}, {fault}: {error}");
                assert_eq!(error.process(), Some("source"), "{host:?}, {fault}: {error}");
            });
        }
    }
}

/// Kills the child of this process that is a component of the kind `kind`.
fn kill_child(kind: &str) {
    let of_this = format!("PPid:\t{}\n", std::process::id());
    let children = std::fs::read_dir("/proc").unwrap().flatten().filter_map(|entry| {
        let status = std::fs::read_to_string(entry.path().join("status")).ok()?;
        let arguments = std::fs::read_to_string(entry.path().join("cmdline")).ok()?;
        let is_meant = status.contains(&of_this) && arguments.split('\0').any(|word| word == kind);
        Pid::from_raw(entry.file_name().to_str()?.parse().ok()?).filter(|_| is_meant)
    });
    children.for_each(|child| kill_process(child, Signal::KILL).unwrap());
}

#[test]
fn an_error_of_a_process_names_it() {
    alone(|folder| {
        let hover = concat!(env!("CARGO_MANIFEST_DIR"), "/manifests/hover.toml");
        let manifest = hummingbus::load(hover).unwrap().set("run.duration_s", 1000.0).unwrap();
        let mut is_struck = false;
        let strike = |event: RunEvent<'_>| match event {
            RunEvent::Progress(Progress { ticks, .. }) if ticks > 100 && !is_struck => {
                is_struck = true;
                kill_child("imu");
            }
            _ => {}
        };
        let launcher = Launcher::new(Host::Exe(env!("CARGO_BIN_EXE_hummingbus").into())).followed_by(strike);
        let error = hummingbus::fly(launcher, &manifest, folder.join("a.mcap")).unwrap_err();
        assert_eq!(sides(&error), [true, false, false], "{error}");
        assert_eq!(error.process(), Some("imu"), "{error}");
        assert!(error.to_string().contains("process `imu`"), "{error}");
    });
}

#[test]
fn an_error_about_the_place_of_a_recording_is_one_of_the_system() {
    // Nobody may make files in /proc.
    for place in ["missing/a.mcap", "/proc/self/a.mcap"] {
        alone(|folder| {
            let manifest = build(&plan(100, "none"), folder);
            let flown = Launcher::new(Host::Threads).fly(&manifest, &folder.join(place));
            let error = flown.unwrap_err();
            assert_eq!(sides(&error), [false, false, true], "{place}: {error}");
            assert!(error.diagnostic().is_none() && error.process().is_none(), "{place}: {error}");
        });
    }
}

#[test]
fn an_error_about_a_request_is_on_no_side() {
    alone(|folder| {
        let stop = StopToken::new();
        stop.stop();
        stop.stop();
        let manifest = build(&plan(1_000_000, "none"), folder);
        let flown = Launcher::new(Host::Threads).stopped_by(&stop).fly(&manifest, &folder.join("a.mcap"));
        let error = flown.unwrap_err();
        assert!(error.to_string().contains("interrupted twice"), "{error}");
        assert_eq!(sides(&error), [false; 3], "{error}");
    });
}
