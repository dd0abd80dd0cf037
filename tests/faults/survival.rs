//! Strikes that a run survives: the process is started again, or the one that stands by takes over. What is recorded is
//! what would have been recorded without the strike.

use crate::campaign;
use crate::flight::{Reference, Watched, messages, records, write_manifest};
use crate::kill_points::{Blow, EDGES, GUARD_TICKS, Moment, signal_name, words_of};
use crate::saboteur::{self, FAULT_VARIABLE, Fault, GENERATIONS_VARIABLE, TICK_VARIABLE};
use crate::skipped::is_left;
use crate::support::{Ended, Launch, Place, partial, repository};
use rand_core::Rng;
use rustix::process::{Signal, kill_process};
use serde_json::Value;
use std::collections::BTreeSet;
use std::process::Command;

const KILL_POINTS: u64 = 30;
const VICTIMS: [&str; 6] = ["controller", "ekf", "imu", "pilot", "plant", "saboteur"];
/// Those that hand their state over.
const STATEFUL: [&str; 4] = ["controller", "ekf", "imu", "plant"];
/// The first strike comes before this tick, and the second so many ticks later: the first one's [`GUARD_TICKS`] are over.
const LAST_TICK: usize = 2200;
const TICKS_BETWEEN: u32 = GUARD_TICKS + 100;
/// Of the victim of a SIGSTOP: long enough for a process to start in on a machine that is busy.
const WATCHDOG_MS_HOST: &str = "5000";

/// Policy for the end of a process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Policy {
    Restart,
    Standby,
}

impl Policy {
    /// Tables that give it to every victim.
    fn tables(self) -> String {
        let on_exit = if self == Self::Restart { "restart" } else { "standby" };
        VICTIMS.map(|victim| format!("[process.{victim}]\non_exit = \"{on_exit}\"\n")).concat()
    }
}

/// A second strike at the same run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Second {
    /// Another process, at the same moment.
    Together(&'static str),
    /// Any process, the first one's backup included, once the first is replaced.
    Later(&'static str),
}

/// One kill point.
#[derive(Clone, Copy, Debug)]
struct Case {
    policy: Policy,
    victim: &'static str,
    blow: Blow,
    moment: Moment,
    second: Option<Second>,
}

impl Case {
    fn draw(seed: u64, index: u64) -> Self {
        let mut random = bus::random::stream(seed, &format!("survived kill point {index}"));
        let mut below = |bound: usize| random.next_u32() as usize % bound;
        let number = usize::try_from(index).unwrap();
        let policy = [Policy::Restart, Policy::Standby][number % 2];
        let victim = VICTIMS[number / 2 % VICTIMS.len()];
        let tick =
            if below(4) == 0 { EDGES[below(EDGES.len())] } else { u32::try_from(below(LAST_TICK)).unwrap() };
        let moment = match below(2) {
            0 => Moment::Boundary { tick, is_lifted: below(2) == 0 },
            _ => Moment::Flight(tick.max(1)),
        };
        let blow = draw_blow(victim, &mut below);
        let is_signal = matches!(blow, Blow::Signal(signal) if signal != Signal::STOP);
        let another = VICTIMS[(number / 2 + 1 + below(VICTIMS.len() - 1)) % VICTIMS.len()];
        let second = match below(4) {
            0 if is_signal => Some(Second::Together(another)),
            1 if is_signal => Some(Second::Later(if below(2) == 0 { victim } else { another })),
            _ => None,
        };
        Self { policy, victim, blow, moment, second }
    }

    /// True if messages that one of two victims has sent may be lost to the other.
    fn may_be_too_much(&self) -> bool {
        matches!((self.moment, self.second), (Moment::Flight(_), Some(Second::Together(_))))
    }

    fn tick(&self) -> u32 {
        match self.moment {
            Moment::Start(_) => 0,
            Moment::Boundary { tick, .. } | Moment::Flight(tick) => tick,
        }
    }
}

fn draw_blow(victim: &str, below: &mut impl FnMut(usize) -> usize) -> Blow {
    match below(8) {
        0 => Blow::Signal(Signal::STOP),
        1 => Blow::Signal(Signal::USR1),
        _ if victim == "saboteur" => match below(Fault::ENDING.len() + 1) {
            0 => Blow::Fault(Fault::Hang),
            fault => Blow::Fault(Fault::ENDING[fault - 1]),
        },
        _ => Blow::Signal(Signal::KILL),
    }
}

#[test]
fn a_run_goes_on_after_every_kill_point_as_if_nothing_had_been() {
    let references = [Policy::Restart, Policy::Standby].map(|policy| Reference::fly_with(&policy.tables()));
    let paths = references.each_ref().map(Reference::path);
    campaign::run("survival", KILL_POINTS, Case::draw, |case| strike(case, &paths[case.policy as usize]));
}

/// The beginning of `manifest`, without conditions.
fn write_beginning(place: &Place, manifest: &str) -> String {
    let whole = std::fs::read_to_string(repository(manifest)).unwrap();
    let (flown, _) = whole.split_once("[[pass]]").unwrap();
    let flown = flown
        .replace("\"sets/", &format!("\"{}/", repository("manifests/sets")))
        .replace("\"../", &format!("\"{}/", repository("")))
        .replace("duration_s = 18.0", "duration_s = 4.5")
        .replace("duration_s = 7.0", "duration_s = 4.5");
    place.write("beginning.toml", flown)
}

/// Flies `manifest` with `on_exit` for its plant, which is killed at each of `ticks`; returns the recording.
fn fly_beginning(manifest: &str, on_exit: &str, ticks: &[u32]) -> Vec<(String, u32, Vec<u8>)> {
    let place = Place::new();
    let (manifest, recording) = (write_beginning(&place, manifest), place.path("flight.mcap"));
    let policy = format!("process.plant.on_exit={on_exit:?}");
    let launch = place.start(&["run", &manifest, "--record", &recording, "--json", "--set", &policy]);
    if !ticks.is_empty() {
        let watched = Watched::attach(&place);
        for (generation, &tick) in ticks.iter().enumerate() {
            assert_eq!(watched.hold_at(tick), tick);
            let plant = watched.node("plant").unwrap();
            if on_exit == "standby" {
                watched.await_shadow(&place, plant);
            }
            let primary = watched.instances(&place, plant).primary.generation;
            assert_eq!(primary as usize, generation);
            let epoch = watched.control.epoch();
            kill_process(place.process_of_generation("plant", primary), Signal::KILL).unwrap();
            watched.await_epoch(epoch + 1);
        }
        watched.control.set_hold_tick(u32::MAX);
    }
    let ended = launch.end().with_code(0);
    let summary = ended.json();
    let successions = summary["successions"].as_array().unwrap();
    let flew: Vec<&Value> = successions.iter().filter(|one| !one["take_over_tick"].is_null()).collect();
    assert_eq!(flew.len(), ticks.len(), "{ended}");
    assert!(flew.iter().all(|one| one["hand_over"] == "state"), "{ended}");
    messages(&recording)
}

fn require_the_plant_goes_on(manifest: &str, ticks: &[u32]) {
    for on_exit in ["restart", "standby"] {
        let undisturbed = fly_beginning(manifest, on_exit, &[]);
        assert!(fly_beginning(manifest, on_exit, ticks) == undisturbed, "other messages with {on_exit}");
    }
}

#[test]
fn a_plant_that_dies_with_a_load_on_a_rope_goes_on_as_if_nothing_had_been() {
    // Vehicle and load stand on the ground; the rope is slack; the load hangs.
    require_the_plant_goes_on("manifests/slung-load.toml", &[400, 2000, 3900]);
}

#[test]
fn a_plant_that_dies_among_driven_joints_goes_on_as_if_nothing_had_been() {
    if is_left("`a_plant_that_dies_with_a_load_on_a_rope_goes_on_as_if_nothing_had_been` has a rope") {
        return;
    }
    require_the_plant_goes_on("manifests/driven-joints.toml", &[700, 2345]);
}

/// Flies with a saboteur that panics at tick 700 whoever it is.
fn panic_again_and_again(policy: Policy) -> Ended {
    let place = Place::new();
    let (manifest, recording) = (write_manifest(&place, &policy.tables()), place.path("flight.mcap"));
    let fault = format!("{:?}", Fault::Panic);
    let args = ["run", &manifest, "--record", &recording, "--json"];
    let launch = place.start_with(&args, &[(FAULT_VARIABLE, &fault), (TICK_VARIABLE, "700")]);
    let ended = launch.end().with_code(2);
    let reference = Reference::fly_with(&policy.tables());
    require_prefix(&place, policy, &partial(&recording), &reference.path());
    assert_eq!(ended.json()["partial_recording"], partial(&recording), "{ended}");
    ended.says(&["the propeller came off", "The run was aborted at tick 700"]);
    ended
}

/// Requires that the recording is the beginning of `reference`. The last messages of a dead standby may be missing,
/// since no node waits for those of a shadow.
fn require_prefix(place: &Place, policy: Policy, recording: &str, reference: &str) {
    if policy == Policy::Standby {
        let (kept, whole) = (messages(recording), messages(reference));
        assert!(kept.len() < whole.len() && whole.starts_with(&kept), "other messages");
    } else {
        let diff = place.start(&["diff", recording, reference]).end_among_others().with_code(1);
        diff.prints(&["is a prefix of"]);
    }
}

#[test]
fn a_process_that_dies_at_the_same_tick_again_is_not_restarted_for_ever() {
    let ended = panic_again_and_again(Policy::Restart);
    ended.says(&["`saboteur` is restarted at tick 700", "process `saboteur.1` ended with exit code 101"]);
    ended.says(&["it came in the place of a process that had died, and completed no tick"]);
}

/// Installs an executable script at `path`. Another process writes it: one that this process holds open for a moment, in a child
/// of another test, could not be executed.
fn install(place: &Place, path: &str, script: &str) {
    let text = place.write("script", script);
    let installed = Command::new("install").args(["-m", "755", &text, path]).status().unwrap();
    assert!(installed.success());
}

/// Flies with a saboteur that is a script, which becomes `rebuilt` of its text at tick 700, where its process is killed. Returns the end of the
/// run, and the warning of a program that has changed.
fn fly_rebuilt(rebuilt: impl Fn(&str) -> String, goes_on: bool) -> (Ended, String) {
    let (place, manifest) = (Place::new(), Policy::Restart.tables());
    let (manifest, program) = (write_manifest(&place, &manifest), place.path("node"));
    let words = saboteur::command().map(|word| format!("'{word}'")).join(" ");
    let script = format!("#!/bin/sh\nexec {words}\n");
    install(&place, &program, &script);
    let command = format!("process.saboteur.command=[{program:?}]");
    let args = ["run", &manifest, "--record", &place.path("flight.mcap"), "--set", &command];
    let launch = place.start(&args);
    let watched = Watched::attach(&place);
    assert_eq!(watched.hold_at(700), 700);
    install(&place, &program, &rebuilt(&script));
    let epoch = watched.control.epoch();
    kill_process(place.process_of_generation("saboteur", 0), Signal::KILL).unwrap();
    if goes_on {
        watched.await_epoch(epoch + 1);
        watched.control.set_hold_tick(u32::MAX);
    }
    let warning = format!("warning: process `saboteur`: {program} has changed since the run first read it");
    (launch.end(), warning)
}

#[test]
fn a_restart_that_executes_a_rebuilt_program_warns() {
    for is_rebuilt in [false, true] {
        let build = if is_rebuilt { "# Rebuilt.\n" } else { "" };
        let (ended, warning) = fly_rebuilt(|script| script.replace("exec", &format!("{build}exec")), true);
        let ended = ended.with_code(0);
        assert_eq!(ended.error.contains(&warning), is_rebuilt, "{ended}");
    }
}

#[test]
fn a_rebuilt_program_that_cannot_be_started_is_told_with_the_end_of_the_run() {
    let (ended, warning) = fly_rebuilt(|_| "#!/nowhere/sh\n".to_owned(), false);
    ended.with_code(2).says(&[&warning, "`saboteur` has ended, and cannot be started again"]);
}

#[test]
fn a_process_that_dies_before_the_run_flies_is_not_restarted() {
    let place = Place::new();
    let manifest = write_manifest(&place, &Policy::Restart.tables());
    let args = ["run", &manifest, "--record", &place.path("flight.mcap")];
    let ended = place.call(&[&args[..], &["--set", "process.saboteur.command=[\"false\"]"]].concat());
    ended.with_code(2).says(&["process `saboteur` ended with exit code 1", "the run did not fly yet"]);
}

#[test]
fn a_standby_that_dies_at_the_same_tick_ends_the_run() {
    panic_again_and_again(Policy::Standby);
}

#[test]
fn a_process_that_is_tried_as_a_shadow_flies_never() {
    let place = Place::new();
    let tables = "[process.controller]\non_exit = \"restart\"\n[[shadow]]\nprocess = \"controller\"\n\
                  with.parameters.gains.tilt_command_max_rad = 0.1\n";
    let (manifest, recording) = (write_manifest(&place, tables), place.path("flight.mcap"));
    let launch = place.start(&["run", &manifest, "--record", &recording, "--json"]);
    let watched = Watched::attach(&place);
    assert_eq!(watched.hold_at(800), 800);
    kill_process(place.process_of_generation("controller", 0), Signal::KILL).unwrap();
    watched.control.set_hold_tick(u32::MAX);
    // The shadow had nobody to shadow any more: what was asked for did not happen.
    let ended = launch.end().with_code(1);
    ended.says(&["the process it was to succeed died first", "`controller` is restarted at tick 800"]);
    assert!(messages(&recording) == messages(&Reference::fly().path()), "other messages: {ended}");
}

fn strike(case: &Case, reference: &str) {
    let place = Place::new();
    let (manifest, recording) = (write_manifest(&place, &case.policy.tables()), place.path("flight.mcap"));
    let launch = start(case, &place, &manifest, &recording);
    let watched = Watched::attach(&place);
    deliver(case, &place, &watched);
    let ended = launch.end();
    if ended.code == Some(2) && case.may_be_too_much() {
        ended.says(&["it came in the place of a process that had died, and completed no tick"]);
        return require_prefix(&place, case.policy, &partial(&recording), reference);
    }
    assert_eq!(ended.code, Some(0), "{ended}");
    require_replaced(case, &ended);
    if case.policy == Policy::Restart {
        assert!(std::fs::read(&recording).unwrap() == std::fs::read(reference).unwrap(), "other bytes");
    } else {
        assert!(messages(&recording) == messages(reference), "other messages");
        // Whoever shadows starts each tick from the same state: what it shows is never anything else.
        let shown: BTreeSet<_> = records(reference).into_iter().collect();
        assert!(records(&recording).iter().all(|record| shown.contains(record)), "other shadow messages");
    }
}

fn start<'a>(case: &Case, place: &'a Place, manifest: &str, recording: &str) -> Launch<'a> {
    let watchdog = format!("process.{}.watchdog_ms_host={WATCHDOG_MS_HOST}", case.victim);
    let mut args = vec!["run", manifest, "--record", recording, "--json"];
    if matches!(case.blow, Blow::Signal(Signal::STOP) | Blow::Fault(Fault::Hang)) {
        args.extend(["--set", &watchdog]);
    }
    let Blow::Fault(fault) = case.blow else { return place.start(&args) };
    let (fault, tick) = (format!("{fault:?}"), case.tick().to_string());
    place.start_with(&args, &[(FAULT_VARIABLE, &fault), (TICK_VARIABLE, &tick), (GENERATIONS_VARIABLE, "1")])
}

fn deliver(case: &Case, place: &Place, watched: &Watched) {
    let Blow::Signal(signal) = case.blow else { return };
    let tick = case.tick();
    match case.moment {
        Moment::Boundary { .. } => assert_eq!(watched.hold_at(tick), tick),
        _ => watched.control.set_hold_tick(tick + GUARD_TICKS),
    }
    let pid = ready(case, place, watched, case.victim);
    let other = match case.second {
        Some(Second::Together(other)) => Some(ready(case, place, watched, other)),
        _ => None,
    };
    if let Moment::Flight(tick) = case.moment {
        watched.await_ticks(watched.node(case.victim), tick);
    }
    let epoch = watched.control.epoch();
    kill_process(pid, signal).unwrap();
    if let Some(other) = other {
        kill_process(other, signal).unwrap();
    }
    if let Moment::Boundary { is_lifted: false, .. } = case.moment
        && signal != Signal::STOP
    {
        watched.await_epoch(epoch + 1);
    }
    if let Some(Second::Later(other)) = case.second {
        let later = tick + TICKS_BETWEEN;
        watched.control.set_hold_tick(later + GUARD_TICKS);
        watched.await_ticks(None, later);
        kill_process(ready(case, place, watched, other), signal).unwrap();
    }
    watched.control.set_hold_tick(u32::MAX);
}

/// The primary of node `name`, once it can be replaced.
fn ready(case: &Case, place: &Place, watched: &Watched, name: &str) -> rustix::process::Pid {
    let node = watched.node(name).unwrap();
    if case.policy == Policy::Standby {
        watched.await_shadow(place, node);
    }
    place.process_of_generation(name, watched.instances(place, node).primary.generation)
}

/// Requires that the run says who ended how and who took the place, and when.
fn require_replaced(case: &Case, ended: &Ended) {
    let victims: Vec<&str> = match case.second {
        None => vec![case.victim],
        Some(Second::Together(other) | Second::Later(other)) => vec![case.victim, other],
    };
    let summary = ended.json();
    let successions = summary["successions"].as_array().unwrap();
    let flew: Vec<&Value> =
        successions.iter().filter(|succession| !succession["take_over_tick"].is_null()).collect();
    assert_eq!(flew.len(), victims.len(), "{ended}");
    match case.blow {
        Blow::Signal(Signal::STOP) | Blow::Fault(Fault::Hang) => ended.says(&["was killed by the watchdog"]),
        Blow::Signal(signal) => ended.says(&[&format!("was killed by {}", signal_name(signal))]),
        Blow::Fault(fault) => ended.says(words_of(fault)),
    }
    for victim in victims {
        let of_victim = |succession: &&&Value| succession["process"] == victim;
        let succession = flew.iter().find(of_victim).unwrap_or_else(|| panic!("none of {victim}: {ended}"));
        let tick = &succession["take_over_tick"];
        ended.says(&[&format!("process `{victim}")]);
        ended.says(&[&match case.policy {
            Policy::Restart => format!("` is restarted at tick {tick}"),
            Policy::Standby => format!("The standby of `{victim}` takes over at tick {tick}"),
        }]);
        let handed_over = if STATEFUL.contains(&victim) { "state" } else { "last output" };
        assert_eq!(succession["hand_over"], handed_over, "{ended}");
        // A process of several threads goes on for a moment after a SIGSTOP.
        let is_struck_there =
            matches!(case.moment, Moment::Boundary { .. }) && case.blow != Blow::Signal(Signal::STOP);
        if is_struck_there && victim == case.victim {
            let ticks = flew.iter().filter(|succession| of_victim(succession));
            assert!(ticks.map(|succession| &succession["take_over_tick"]).any(|tick| *tick == case.tick()));
        }
    }
}

/// The thesis's two processors: where the law of one dies or hangs, the other's simpler one flies on; the manifest's own
/// conditions say how.
#[test]
fn a_simpler_law_stands_by_for_one_that_dies_or_hangs() {
    for (signal, tick) in [(Signal::KILL, 4321), (Signal::STOP, 7890)] {
        let place = Place::new();
        let manifest = repository("manifests/llp-hlp.toml");
        let mut launch = place.start(&["run", &manifest, "--record", &place.path("flight.mcap")]);
        launch.hold_at(tick);
        kill_process(place.process_of_generation("controller", 0), signal).unwrap();
        launch.release();
        let ended = launch.end().with_code(0);
        ended.says(&[&format!("The standby of `controller` takes over at tick {tick}")]);
        ended.prints(&["ok     no jump of tilt"]);
    }
}
