//! Kill points: seeded strikes over processes, ticks and signals where nothing but a stop is to follow, and what is
//! promised after each.

use crate::campaign;
use crate::flight::{FLUSH_TICKS, Process, Reference, Watched, manifest};
use crate::saboteur::{FAULT_VARIABLE, Fault, TICK_VARIABLE};
use crate::support::{Ended, Launch, Place, partial};
use rand_core::Rng;
use recorder::writer::START;
use rustix::process::{Signal, kill_process};
use std::collections::BTreeMap;
use std::sync::Mutex;
use std::time::Duration;

const KILL_POINTS: u64 = 90;
/// Strikes come before this tick, so that a flush or two lie behind the last ones.
const LAST_TICK: usize = 3000;
/// Ticks after a strike in flight at which the clock waits, so that no run ends before it is struck.
pub const GUARD_TICKS: u32 = 500;
/// Ticks around which something else happens: the first, a full window, a flush, the next chunk.
pub const EDGES: [u32; 10] = [0, 1, 63, 64, 65, 998, 999, 1000, 1001, 2000];

/// Blow to the victim.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Blow {
    Signal(Signal),
    Fault(Fault),
}

/// When it is done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Moment {
    /// This long after its process has appeared.
    Start(Duration),
    /// While the clock waits at the boundary before this tick; then the clock goes on, or not.
    Boundary { tick: u32, is_lifted: bool },
    /// In flight, once the victim has completed this many ticks.
    Flight(u32),
}

/// One kill point.
#[derive(Clone, Copy, Debug)]
struct Case {
    victim: Process,
    blow: Blow,
    moment: Moment,
}

impl Case {
    /// Case `index` under `seed`: the same on every machine. Every process has its turn.
    fn draw(seed: u64, index: u64) -> Self {
        let mut random = bus::random::stream(seed, &format!("kill point {index}"));
        let mut below = |bound: usize| random.next_u32() as usize % bound;
        let victim = Process::ALL[usize::try_from(index).unwrap() % Process::ALL.len()];
        let moment = draw_moment(&mut below);
        let blow = draw_blow(victim, moment, &mut below);
        let mut case = Self { victim, blow, moment };
        // A node that is asked to end while the clock waits hears of it when the clock goes on.
        if let Moment::Boundary { tick, .. } = moment
            && case.is_request()
        {
            case.moment = Moment::Boundary { tick, is_lifted: true };
        }
        case
    }

    fn tick(&self) -> u32 {
        match self.moment {
            Moment::Start(_) => 0,
            Moment::Boundary { tick, .. } | Moment::Flight(tick) => tick,
        }
    }

    /// True if the run is only asked to end.
    fn is_request(&self) -> bool {
        matches!(self.blow, Blow::Signal(Signal::TERM | Signal::INT))
    }

    /// True if the recorder has no time to finish its file.
    fn cuts_recording(&self) -> bool {
        !self.is_request() && matches!(self.victim, Process::Launcher | Process::Node("recorder"))
    }
}

fn draw_moment(below: &mut impl FnMut(usize) -> usize) -> Moment {
    let tick =
        if below(3) == 0 { EDGES[below(EDGES.len())] } else { u32::try_from(below(LAST_TICK)).unwrap() };
    match below(8) {
        0 => Moment::Start(Duration::from_micros(below(30_000) as u64)),
        1..4 => Moment::Boundary { tick, is_lifted: below(2) == 0 },
        _ => Moment::Flight(tick.max(1)),
    }
}

/// Mostly SIGKILL; during the start nothing else, since until a process has joined every signal is one.
fn draw_blow(victim: Process, moment: Moment, below: &mut impl FnMut(usize) -> usize) -> Blow {
    // The launcher stops at whatever else ends a process.
    let others: &[Signal] = match victim {
        Process::Launcher => &[Signal::TERM, Signal::INT],
        _ => &[Signal::TERM, Signal::INT, Signal::USR1, Signal::ALARM],
    };
    if matches!(moment, Moment::Start(_)) {
        Blow::Signal(Signal::KILL)
    } else if victim == Process::Node("saboteur") && below(3) > 0 {
        Blow::Fault(Fault::ENDING[below(Fault::ENDING.len())])
    } else if below(3) > 0 {
        Blow::Signal(Signal::KILL)
    } else {
        Blow::Signal(others[below(others.len())])
    }
}

/// Losses by kill points.
#[derive(Clone, Copy, Debug, Default)]
struct Loss {
    strikes: u64,
    lost_ticks_max: u32,
}

#[test]
fn every_kill_point_ends_as_documented() {
    let reference = Reference::fly();
    let reference_path = reference.path();
    let losses = Mutex::new(BTreeMap::<&str, Loss>::new());
    campaign::run("kill_points", KILL_POINTS, Case::draw, |case| {
        let lost = strike(case, &reference_path);
        let mut losses = losses.lock().unwrap();
        let loss = losses.entry(case.victim.name()).or_default();
        *loss = Loss { strikes: loss.strikes + 1, lost_ticks_max: loss.lost_ticks_max.max(lost) };
    });
    println!("{:#?}", losses.lock().unwrap());
}

/// Flies, strikes and checks; returns how many ticks were sent and are not in the recording.
fn strike(case: &Case, reference: &str) -> u32 {
    let place = Place::new();
    // A good recording is there already, or the beginning of one, which counts as much.
    let (manifest, recording) = (place.write("flight.toml", manifest()), place.write("flight.mcap", START));
    let launch = start(case, &place, &["run", &manifest, "--record", &recording]);
    let watched = Watched::attach(&place);
    let sent_before = deliver(case, &place, &launch, &watched);
    let ended = end(&place, launch, case.victim == Process::Launcher && !case.is_request());
    require_stopped(case, &watched, &ended);
    let recorded = recorded_ticks(case, &place, &recording, reference);
    require_bounded_loss(case, &watched, sent_before, recorded)
}

fn start<'a>(case: &Case, place: &'a Place, args: &[&str]) -> Launch<'a> {
    match case.blow {
        Blow::Signal(_) => place.start(args),
        Blow::Fault(fault) => {
            let (fault, tick) = (format!("{fault:?}"), case.tick().to_string());
            place.start_with(args, &[(FAULT_VARIABLE, &fault), (TICK_VARIABLE, &tick)])
        }
    }
}

/// Strikes at the case's moment; returns how many ticks every sender had completed right before.
fn deliver(case: &Case, place: &Place, launch: &Launch<'_>, watched: &Watched) -> u32 {
    let Blow::Signal(signal) = case.blow else { return 0 };
    if let Moment::Boundary { tick, .. } = case.moment {
        watched.control.set_hold_tick(tick);
    } else {
        watched.control.set_hold_tick(case.tick() + GUARD_TICKS);
    }
    let victim = case.victim.pid(place, launch);
    match case.moment {
        Moment::Start(wait) => std::thread::sleep(wait),
        Moment::Boundary { tick, .. } => assert_eq!(watched.hold_at(tick), tick),
        Moment::Flight(tick) => watched.await_ticks(watched.node(case.victim.name()), tick),
    }
    let sent_before = watched.sent_ticks(|ticks| ticks.min());
    kill_process(victim, signal).unwrap();
    if !matches!(case.moment, Moment::Boundary { is_lifted: false, .. }) {
        watched.control.set_hold_tick(u32::MAX);
    }
    sent_before
}

/// Waits for the end; nothing may be left behind, but files where the launcher was killed.
pub fn end(place: &Place, launch: Launch<'_>, launcher_was_killed: bool) -> Ended {
    if !launcher_was_killed {
        return launch.end();
    }
    let launcher = launch.id();
    let ended = launch.end_among_others();
    place.await_no_process();
    // Nobody is left who could remove the run's own files; they hinder no later run.
    let left = place.left_behind(launcher);
    let is_own = |path: &String| path.contains("/hb_") || path.contains("/hummingbus-");
    assert!(left.iter().all(is_own), "{left:#?}");
    ended
}

/// Exit code and message.
fn require_stopped(case: &Case, watched: &Watched, ended: &Ended) {
    let name = case.victim.name();
    if case.is_request() {
        assert_eq!(ended.code, Some(1), "{ended}");
        ended.prints(&["stopped before its end"]);
        return;
    }
    if case.victim == Process::Launcher {
        assert_eq!(ended.code, None, "{ended}");
        return;
    }
    assert_eq!(ended.code, Some(2), "{ended}");
    let node = watched.node(name);
    let completed =
        node.map_or_else(|| watched.control.completed_ticks(), |node| watched.control.completed_by(node));
    // The others may still complete what they have the samples for while a dead clock is noticed.
    if node.is_some() {
        ended.says(&[&format!("aborted at tick {completed}")]);
    }
    ended.says(&[&format!("process `{name}` "), "aborted at tick"]);
    node.into_iter().flat_map(|node| watched.topics_of(node)).for_each(|topic| ended.says(&[topic]));
    match case.blow {
        Blow::Signal(signal) => ended.says(&[&format!("was killed by {}", signal_name(signal))]),
        Blow::Fault(fault) => {
            assert_eq!(completed, case.tick());
            ended.says(words_of(fault));
        }
    }
}

pub fn signal_name(signal: Signal) -> &'static str {
    match signal {
        Signal::KILL => "signal 9 (SIGKILL)",
        Signal::USR1 => "signal 10 (SIGUSR1)",
        Signal::ALARM => "signal 14 (SIGALRM)",
        _ => unreachable!("no case sends {signal:?}"),
    }
}

pub fn words_of(fault: Fault) -> &'static [&'static str] {
    match fault {
        Fault::Error => &["ended with exit code 1", "the battery is empty", "failed at tick"],
        Fault::Panic => &["ended with exit code 101", "the propeller came off"],
        Fault::ExitWith3 | Fault::LateExit | Fault::BehindTheEnd => &["ended with exit code 3"],
        Fault::ExitWith0 => &["ended with exit code 0 before the run did"],
        Fault::Unwritten => &["without writing its output `report`"],
        Fault::SlowStep | Fault::Await | Fault::Hang | Fault::NeverJoins | Fault::OtherLayout => {
            unreachable!("{fault:?} ends no run by itself")
        }
    }
}

/// Ticks in the recording, which must be the first ones of the undisturbed recording: `hummingbus diff` says so.
fn recorded_ticks(case: &Case, place: &Place, recording: &str, reference: &str) -> u32 {
    let partial = (!case.is_request()).then(|| {
        assert_eq!(std::fs::read(recording).unwrap(), START, "a good recording was replaced");
        std::fs::remove_file(recording).unwrap();
        partial(recording)
    });
    let recording = partial.as_deref().unwrap_or(recording);
    // A launcher that is killed leaves the file that it had created for the recorder.
    if std::fs::metadata(recording).map_or(0, |file| file.len()) == 0 {
        // A recording without a message is not kept; the caller knows how many ticks it should hold.
        return 0;
    }
    let diff = place.start(&["diff", recording, reference]).end_among_others().with_code(1);
    diff.prints(&[recording, "is a prefix of", reference]);
    assert_eq!(diff.error.contains("was cut off"), case.cuts_recording(), "{diff}");
    let Some((_, tick)) = diff.output.trim().split_once("it ends after tick ") else {
        diff.prints(&["it ends before the first message"]);
        return 0;
    };
    tick.parse::<u32>().unwrap() + 1
}

/// Requires that what is recorded is at least what is promised; returns the ticks that are lost.
fn require_bounded_loss(case: &Case, watched: &Watched, sent_before: u32, recorded: u32) -> u32 {
    let (control, window) = (&watched.control, watched.plan.window_ticks);
    let recorder = control.completed_by(watched.node("recorder").unwrap());
    // The word of a topic that is sent every p ticks counts those that need no sample, up to p - 1 of them.
    let longest = watched.plan.topics.iter().filter_map(|topic| topic.ticks.period()).max().unwrap();
    let lost = watched.sent_ticks(|ticks| ticks.max()).saturating_sub(recorded + longest - 1);
    if case.cuts_recording() {
        // Killed between a flush and the word that says so, it has recorded a tick more than it says.
        let flushed = recorder - recorder % FLUSH_TICKS;
        assert!((flushed..=recorder + 1).contains(&recorded), "{recorded} of {recorder} ticks are recorded");
        assert!(lost <= FLUSH_TICKS + window, "{lost} ticks are lost");
    } else {
        assert_eq!(recorded, recorder, "a whole recording holds what its recorder took");
        assert!(
            recorded >= sent_before,
            "{recorded} ticks recorded, {sent_before} were sent before the strike"
        );
        assert!(lost <= window, "{lost} ticks are lost");
    }
    if let Moment::Boundary { tick, is_lifted: false } = case.moment
        && matches!(case.blow, Blow::Signal(_))
    {
        assert_eq!(recorder, tick, "the clock held every node at this tick");
    }
    lost
}
