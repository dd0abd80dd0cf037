//! Backups that fail before they fly, and strikes at the others while one is on its way.

use crate::campaign;
use crate::flight::{Process, Reference, Watched, messages, write_manifest};
use crate::kill_points::{GUARD_TICKS, end, signal_name, words_of};
use crate::saboteur::{FAULT_VARIABLE, Fault, TICK_VARIABLE};
use crate::support::{Ended, Launch, Place, partial};
use bus::lockstep::{Phase, SlotState};
use rand_core::Rng;
use rustix::process::{Pid, Signal, kill_process};

const KILL_POINTS: u64 = 30;
const VICTIMS: [&str; 5] = ["controller", "ekf", "imu", "pilot", "saboteur"];
/// When the backup joins, and when it takes over.
const JOIN_TICK: u32 = 1000;
const TAKE_OVER_TICK: u32 = 1500;
/// A tick by which no backup has joined.
const EARLY_TICK: u32 = 900;
const LAST_TICK: u32 = 1600;
/// Long enough for a process to start in on a machine that is busy.
const WATCHDOG_MS_HOST: u32 = 3000;

/// A swap of `victim` for its like, with more keys.
fn swap(victim: &str, more: &str) -> String {
    format!(
        "[[swap]]\nprocess = \"{victim}\"\nat_tick = {TAKE_OVER_TICK}\nshadow_ticks = {}\n\
         with.watchdog_ms_host = {WATCHDOG_MS_HOST}\n{more}",
        TAKE_OVER_TICK - JOIN_TICK
    )
}

/// Requires that the backup was refused with these words and that the flight was the undisturbed one.
fn require_refused(ended: &Ended, victim: &str, message: &[&str], recording: &str, reference: &str) {
    assert_eq!(ended.code, Some(1), "{ended}");
    ended.says(&[&format!("the backup of `{victim}` was refused: "), &format!("`{victim}` flies on")]);
    ended.says(message);
    let succession = &ended.json()["successions"][0];
    let refused = succession["refused"].as_str().unwrap_or_else(|| panic!("not refused: {ended}"));
    assert!(refused.contains(&format!("process `{victim}.1` ")), "{ended}");
    assert!(succession["take_over_tick"].is_null(), "{ended}");
    assert_eq!(ended.json()["ticks"], 4000, "{ended}");
    assert!(messages(recording) == messages(reference), "other messages: {ended}");
}

#[test]
fn a_backup_that_fails_from_the_inside_is_refused_with_its_last_words() {
    let flown = Reference::fly();
    let reference = flown.path();
    let watchdog = ["was killed by the watchdog"];
    let ending = Fault::ENDING.map(|fault| (fault, words_of(fault)));
    let others: [(Fault, &[&str]); 3] = [
        (Fault::Hang, &watchdog),
        (Fault::NeverJoins, &["was killed by the watchdog: it did not join within 3000 ms"]),
        (Fault::OtherLayout, &["layout mismatch on topic /saboteur/report", "climb", "altitude"]),
    ];
    for (fault, message) in ending.into_iter().chain(others) {
        let place = Place::new();
        let fault = format!(
            "with.environment = {{ {FAULT_VARIABLE} = \"{fault:?}\", {TICK_VARIABLE} = \"{}\" }}\n",
            JOIN_TICK + 200
        );
        let (manifest, recording) =
            (write_manifest(&place, &swap("saboteur", &fault)), place.path("flight.mcap"));
        let ended = place.call(&["run", &manifest, "--record", &recording, "--json"]);
        require_refused(&ended, "saboteur", message, &recording, &reference);
    }
}

/// A run with a swap of `victim`, and with `tables`.
fn start_swap<'a>(place: &'a Place, victim: &str, tables: &str) -> (Launch<'a>, Watched) {
    let manifest = write_manifest(place, &format!("{tables}{}", swap(victim, "")));
    let launch = place.start(&["run", &manifest, "--record", &place.path("flight.mcap"), "--json"]);
    let watched = Watched::attach(place);
    (launch, watched)
}

#[test]
fn a_backup_that_dies_before_its_predecessor_has_left_is_replaced() {
    let place = Place::new();
    let (launch, watched) = start_swap(&place, "controller", "[process.controller]\non_exit = \"restart\"\n");
    let node = watched.node("controller").unwrap();
    assert_eq!(watched.hold_at(TAKE_OVER_TICK), TAKE_OVER_TICK);
    let backup = place.process_of_generation("controller", 1);
    // It cannot leave: the recorder is given no time to turn to the backup before the next one is there.
    kill_process(place.process_of_generation("controller", 0), Signal::STOP).unwrap();
    kill_process(place.process_of("recorder"), Signal::STOP).unwrap();
    watched.control.set_hold_tick(TAKE_OVER_TICK + GUARD_TICKS);
    watched.await_ticks(Some(watched.plan.slot(node, 1)), TAKE_OVER_TICK + 20);
    kill_process(backup, Signal::KILL).unwrap();
    kill_process(place.process_of("recorder"), Signal::CONT).unwrap();
    watched.control.set_hold_tick(u32::MAX);
    let ended = launch.end().with_code(0);
    ended.says(&["process `controller.1` was killed by signal 9", "`controller.1` is restarted at tick 15"]);
    assert_eq!(ended.json()["successions"].as_array().unwrap().len(), 2, "{ended}");
    let flown = messages(&place.path("flight.mcap"));
    assert!(flown == messages(&Reference::fly().path()), "other messages: {ended}");
}

#[test]
fn a_backup_that_waits_for_its_tick_is_not_late() {
    let place = Place::new();
    let manifest = write_manifest(&place, &format!("[run]\npace = 1.0\n{}", swap("controller", "")));
    // Its tick comes three watchdogs after its start.
    let args = ["--set", "swap.0.at_tick=3990", "--set", "swap.0.with.watchdog_ms_host=1000"];
    let ended = place
        .call(&[&["run", &manifest, "--record", &place.path("flight.mcap"), "--json"], &args[..]].concat());
    assert_eq!(ended.json()["successions"][0]["take_over_tick"], 3990, "{ended}");
}

/// Target of a strike.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Target {
    /// The process that flies.
    Active,
    /// The one that is to succeed it, or has.
    Backup,
    /// A process that has no backup.
    Other(Process),
}

/// When.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Moment {
    /// While the clock waits at the boundary before this tick, before the backup's, in its shadow phase, at its
    /// take-over or behind it.
    Boundary(u32),
    /// In flight, once the node has completed this many ticks.
    Flight(u32),
    /// While the clock waits at the tick at which the backup joins, and it does not, since it was stopped.
    Joining,
}

/// One strike.
#[derive(Clone, Copy, Debug)]
struct Case {
    victim: &'static str,
    restarts: bool,
    target: Target,
    moment: Moment,
    signal: Signal,
}

impl Case {
    fn draw(seed: u64, index: u64) -> Self {
        let mut random = bus::random::stream(seed, &format!("strike at a swap {index}"));
        let mut below = |bound: u32| random.next_u32() % bound;
        let number = usize::try_from(index).unwrap();
        let others = [Process::Node("recorder"), Process::Clock, Process::Launcher];
        let target = match below(5) {
            0 | 1 => Target::Active,
            2 | 3 => Target::Backup,
            _ => Target::Other(others[below(3) as usize]),
        };
        let tick = match below(4) {
            0 => [JOIN_TICK, JOIN_TICK + 1, TAKE_OVER_TICK - 1, TAKE_OVER_TICK][below(4) as usize],
            1 => TAKE_OVER_TICK - 1 + below(4),
            _ => EARLY_TICK + below(LAST_TICK - EARLY_TICK),
        };
        let moment = match below(5) {
            0 => Moment::Joining,
            1 | 2 => Moment::Boundary(tick),
            _ => Moment::Flight(tick),
        };
        let signal = match (target, below(5)) {
            (Target::Backup, 0) => Signal::STOP,
            // A stopped process dies of nothing less than SIGKILL.
            (Target::Active | Target::Backup, 1) if moment != Moment::Joining => Signal::USR1,
            _ => Signal::KILL,
        };
        Self { victim: VICTIMS[number % VICTIMS.len()], restarts: below(2) == 0, target, moment, signal }
    }

    fn tables(&self) -> String {
        let on_exit = if self.restarts { "restart" } else { "stop" };
        format!("[process.{}]\non_exit = \"{on_exit}\"\n{}", self.victim, swap(self.victim, ""))
    }
}

/// Stage of the backup when it or another was struck, as far as the striker can tell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd)]
enum Stage {
    Starting,
    Joining,
    Shadowing,
    /// In flight, about the tick of the take-over.
    Between,
    Flying,
}

#[test]
fn a_strike_in_the_middle_of_a_swap_ends_as_documented() {
    let plain = Reference::fly();
    let swapped = VICTIMS.map(|victim| {
        let case = Case {
            victim,
            restarts: false,
            target: Target::Active,
            moment: Moment::Joining,
            signal: Signal::KILL,
        };
        Reference::fly_with(&case.tables())
    });
    let plain = plain.path();
    let swapped = swapped.each_ref().map(Reference::path);
    campaign::run("backups", KILL_POINTS, Case::draw, |case| {
        let of_victim = VICTIMS.iter().position(|victim| *victim == case.victim).unwrap();
        strike(case, &plain, &swapped[of_victim]);
    });
}

fn strike(case: &Case, plain: &str, swapped: &str) {
    let place = Place::new();
    let (manifest, recording) = (write_manifest(&place, &case.tables()), place.path("flight.mcap"));
    let launch = place.start(&["run", &manifest, "--record", &recording, "--json"]);
    let watched = Watched::attach(&place);
    let stage = deliver(case, &place, &launch, &watched);
    let ended = end(&place, launch, case.target == Target::Other(Process::Launcher));
    match case.target {
        Target::Other(other) => require_stopped(case, other.name(), &ended),
        Target::Backup if stage < Stage::Between => {
            let how = match case.signal {
                Signal::STOP => "was killed by the watchdog".to_owned(),
                signal => format!("was killed by {}", signal_name(signal)),
            };
            return require_refused(&ended, case.victim, &[&how], &recording, plain);
        }
        _ if stage == Stage::Between && ended.code != Some(2) => {
            // Struck before its first sample the backup is refused; its predecessor may have been through already.
            return assert!(messages(&recording) == messages(plain), "other messages: {ended}");
        }
        _ if case.restarts => return require_replaced(case, stage, &ended, &recording, plain),
        _ => require_stopped(case, case.victim, &ended),
    }
    require_prefix(&place, &partial(&recording), swapped);
}

/// Requires that the run went on with another process.
fn require_replaced(case: &Case, stage: Stage, ended: &Ended, recording: &str, plain: &str) {
    // A backup that had not joined yet waits for its turn again, and may have missed its tick by then: what was asked
    // for did not happen.
    let is_refused = ended.error.contains("was refused");
    assert!(!is_refused || stage < Stage::Shadowing, "{ended}");
    assert_eq!(ended.code, Some(i32::from(is_refused)), "{ended}");
    ended.says(&[&format!("process `{}", case.victim)]);
    let replaces = ["is restarted at tick", "takes over at tick"].map(|text| ended.error.contains(text));
    assert!(replaces.contains(&true), "{ended}");
    assert!(messages(recording) == messages(plain), "other messages: {ended}");
}

/// Requires that the run was aborted because of the end of `name`, or died with its launcher.
fn require_stopped(case: &Case, name: &str, ended: &Ended) {
    if case.target == Target::Other(Process::Launcher) {
        return assert_eq!(ended.code, None, "{ended}");
    }
    assert_eq!(ended.code, Some(2), "{ended}");
    let how = match case.signal {
        Signal::STOP => "was killed by the watchdog".to_owned(),
        signal => format!("was killed by {}", signal_name(signal)),
    };
    ended.says(&[&format!("process `{name}"), &how, "The run was aborted at tick"]);
}

/// Requires that the recording is the start of the one with an undisturbed swap.
fn require_prefix(place: &Place, recording: &str, swapped: &str) {
    place.start(&["diff", recording, swapped]).end_among_others().with_code(1).prints(&["is a prefix of"]);
}

/// Strikes, and says where the backup stood.
fn deliver(case: &Case, place: &Place, launch: &Launch<'_>, watched: &Watched) -> Stage {
    let node = watched.node(case.victim).unwrap();
    let backup = watched.plan.slot(node, 1);
    let pid = |target| match target {
        Target::Active => {
            place.process_of_generation(case.victim, watched.instances(place, node).primary.generation)
        }
        Target::Backup => place.process_of_generation(case.victim, 1),
        Target::Other(process) => process.pid(place, launch),
    };
    match case.moment {
        Moment::Boundary(tick) => {
            let stage = stage_at(tick);
            assert_eq!(watched.hold_at(tick), tick);
            match stage {
                Stage::Shadowing => drop(watched.await_shadow(place, node)),
                Stage::Flying => watched.await_active(place, node, 1),
                _ => {}
            }
            hit(case, watched, pid(case.target));
            // A predecessor has nothing more to do there, and a SIGSTOP takes a moment: it may be seen too late.
            let is_between =
                tick == TAKE_OVER_TICK && (case.target == Target::Active || case.signal == Signal::STOP);
            if is_between { Stage::Between } else { stage }
        }
        Moment::Flight(tick) => {
            // The clock waits there until it has joined.
            let stage = if tick == JOIN_TICK { Stage::Joining } else { stage_at(tick) };
            watched.control.set_hold_tick(match stage {
                Stage::Starting => JOIN_TICK - 1,
                _ if tick < TAKE_OVER_TICK => TAKE_OVER_TICK - 1,
                _ => tick + GUARD_TICKS,
            });
            // Looked up before: to look takes longer than to fly on.
            let struck = pid(case.target);
            watched.await_ticks(None, tick);
            hit(case, watched, struck);
            // Nobody can tell from outside whether it has sent its first sample.
            let is_between =
                tick == TAKE_OVER_TICK || (stage == Stage::Flying && case.target == Target::Active);
            if is_between { Stage::Between } else { stage }
        }
        Moment::Joining => {
            assert_eq!(watched.hold_at(EARLY_TICK), EARLY_TICK);
            watched.await_ready(backup, Phase::Connecting);
            let joining = pid(Target::Backup);
            kill_process(joining, Signal::STOP).unwrap();
            watched.control.set_hold_tick(u32::MAX);
            watched.await_slot(backup, SlotState::Joining);
            hit(case, watched, pid(case.target));
            if case.target != Target::Backup {
                // The launcher may have ended it by now.
                let _ = kill_process(joining, Signal::CONT);
            }
            Stage::Joining
        }
    }
}

fn hit(case: &Case, watched: &Watched, struck: Pid) {
    // A predecessor may have left by itself.
    let _ = kill_process(struck, case.signal);
    watched.control.set_hold_tick(u32::MAX);
}

/// Returns the stage of the backup while the clock waits before `tick`.
fn stage_at(tick: u32) -> Stage {
    match tick {
        ..JOIN_TICK => Stage::Starting,
        JOIN_TICK..=TAKE_OVER_TICK => Stage::Shadowing,
        _ => Stage::Flying,
    }
}
