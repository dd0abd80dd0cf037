//! The run that the faults strike: a short hover with a saboteur in it, watched through its control segment.

use crate::saboteur;
use crate::support::{Launch, Place, poll, repository};
use bus::lockstep::{Phase, SlotState, SupervisorView};
use bus::membership::{Membership, NodeInstances};
use bus::plan::Plan;
use recorder::reader::Recording;
use rustix::process::Pid;
use std::path::PathBuf;
use std::thread::sleep;
use std::time::Duration;

/// Length of the run in ticks of a millisecond.
const TICKS: u32 = 4000;
/// Ticks between two flushes of the recorder.
pub const FLUSH_TICKS: u32 = 1000;
const LOOK: Duration = Duration::from_micros(100);

/// The manifest: hover.toml with the saboteur, without conditions, over [`TICKS`].
pub fn manifest() -> String {
    let hover = std::fs::read_to_string(repository("manifests/hover.toml")).unwrap();
    let (flown, _) = hover.split_once("[[pass]]").unwrap();
    let vehicles = repository("vehicles");
    let flown = flown
        .replace("../vehicles", &vehicles)
        .replace("duration_s = 12.0", &format!("duration_s = {}", f64::from(TICKS) * 1e-3));
    format!("{flown}{}", saboteur::table())
}

/// Writes a manifest that adds `tables` to those of [`manifest`].
pub fn write_manifest(place: &Place, tables: &str) -> String {
    place.write("flight.toml", manifest());
    place.write("more.toml", format!("include = [\"flight.toml\"]\n{tables}"))
}

/// Every message of the recording at `path` but those of shadows: topic, tick and bytes.
pub fn messages(path: &str) -> Vec<(String, u32, Vec<u8>)> {
    records(path).into_iter().filter(|(topic, ..)| !topic.starts_with("/shadow/")).collect()
}

/// Every message of the recording at `path`.
pub fn records(path: &str) -> Vec<(String, u32, Vec<u8>)> {
    let recording = Recording::open(path.as_ref()).unwrap();
    let all = recording.messages().map(Result::unwrap);
    all.map(|record| (record.topic, record.tick, record.cdr)).collect()
}

/// The undisturbed recording of a manifest.
pub struct Reference {
    place: Place,
}

impl Reference {
    pub fn fly() -> Self {
        let place = Place::new();
        let path = place.write("flight.toml", manifest());
        Self::fly_manifest(place, &path)
    }

    /// That of [`write_manifest`].
    pub fn fly_with(tables: &str) -> Self {
        let place = Place::new();
        let path = write_manifest(&place, tables);
        Self::fly_manifest(place, &path)
    }

    fn fly_manifest(place: Place, path: &str) -> Self {
        place.call(&["run", path, "--record", &place.path("reference.mcap")]).with_code(0);
        Self { place }
    }

    pub fn path(&self) -> String {
        self.place.path("reference.mcap")
    }

    pub fn bytes(&self) -> Vec<u8> {
        std::fs::read(self.path()).unwrap()
    }
}

/// A run that is up, seen through its control segment. The mapping outlives the run: what the processes did last
/// can be read after their end.
pub struct Watched {
    pub plan: Plan,
    pub control: SupervisorView,
}

impl Watched {
    /// Waits for the control segment of the run launched in `place`.
    pub fn attach(place: &Place) -> Self {
        poll("no control segment", || {
            let plan = Plan::load(place.run_dirs().first()?).ok()?;
            SupervisorView::open(&plan).ok().map(|control| Self { plan, control })
        })
    }

    /// Has the clock wait at the boundary before `tick`; returns the boundary at which it waits.
    pub fn hold_at(&self, tick: u32) -> u32 {
        self.control.set_hold_tick(tick);
        // It may still wait where it was held before.
        self.look("the run was not held", || self.control.held_at().filter(|&held| held >= tick))
    }

    /// Waits until `node` (all nodes, if none is named) has completed `ticks` ticks.
    pub fn await_ticks(&self, node: Option<usize>, ticks: u32) {
        self.look("a tick was not reached", || {
            let done =
                node.map_or_else(|| self.control.completed_ticks(), |node| self.control.completed_by(node));
            (done >= ticks).then_some(())
        });
    }

    /// Waits until the run has come to its change number `epoch`.
    pub fn await_epoch(&self, epoch: u32) {
        self.look("nobody was replaced", || (self.control.epoch() >= epoch).then_some(()));
    }

    fn look<T>(&self, what: &str, mut look: impl FnMut() -> Option<T>) -> T {
        poll(what, || {
            // Finer than the watchdog's own poll: a run computes dozens of ticks in a millisecond.
            for _ in 0..100 {
                let seen = look();
                if seen.is_some() {
                    return seen;
                }
                sleep(LOOK);
            }
            None
        })
    }

    pub fn node(&self, name: &str) -> Option<usize> {
        self.plan.nodes.iter().position(|node| node.name == name)
    }

    /// Returns the instances in the slots of `node` now, once all nodes have been told of them.
    pub fn instances(&self, place: &Place, node: usize) -> NodeInstances {
        self.look("no membership", || {
            let run_dir = place.run_dirs().into_iter().next()?;
            let epoch = self.control.epoch();
            let mut membership = if epoch == 0 {
                Membership::first(&self.plan)
            } else {
                Membership::load(&run_dir, epoch).ok()?
            };
            Some(membership.nodes.swap_remove(node))
        })
    }

    /// Waits until the backup of `node` computes beside it; returns its generation.
    pub fn await_shadow(&self, place: &Place, node: usize) -> u32 {
        self.look("no backup has joined", || {
            let generation = self.instances(place, node).backup?.generation;
            let state = self.control.slot_state(self.plan.slot(node, generation));
            (state == SlotState::Taken).then_some(generation)
        })
    }

    /// Waits until the process `generation` of `node` flies.
    pub fn await_active(&self, place: &Place, node: usize, generation: u32) {
        let is_active = || (self.instances(place, node).primary.generation == generation).then_some(());
        self.look("the backup has not taken over", is_active);
    }

    /// Waits until `slot` is ready for `phase`.
    pub fn await_ready(&self, slot: usize, phase: Phase) {
        self.look("a process is not ready", || self.control.is_ready(slot, phase).then_some(()));
    }

    /// Waits until `slot` is as far as `state`.
    pub fn await_slot(&self, slot: usize, state: SlotState) {
        self.look("a slot was not taken", || (self.control.slot_state(slot) == state).then_some(()));
    }

    /// Ticks of the node that is `ahead` of all others that send, or behind.
    pub fn sent_ticks(&self, extreme: impl Fn(&mut dyn Iterator<Item = u32>) -> Option<u32>) -> u32 {
        let senders = (0..self.plan.nodes.len()).filter(|&node| !self.plan.nodes[node].outputs.is_empty());
        extreme(&mut senders.map(|node| self.control.completed_by(node))).unwrap()
    }

    /// The topics that `node` sends.
    pub fn topics_of(&self, node: usize) -> impl Iterator<Item = &str> {
        self.plan.nodes[node].outputs.iter().map(|output| self.plan.topics[output.topic].name.as_str())
    }

    /// Every file of the run: those in its directory and those in shared memory.
    pub fn files(&self, place: &Place) -> Vec<PathBuf> {
        let mut folders = place.run_dirs();
        let prefix = bus::names::shm_prefix(&self.plan.run_id);
        let shared = entries("/dev/shm".as_ref());
        let mut files: Vec<_> = shared
            .into_iter()
            .filter(|path| path.file_name().unwrap().to_string_lossy().starts_with(&prefix))
            .collect();
        while let Some(folder) = folders.pop() {
            let (inner, plain) = entries(&folder).into_iter().partition(|path| path.is_dir());
            folders.extend::<Vec<_>>(inner);
            files.extend::<Vec<_>>(plain);
        }
        files
    }
}

fn entries(folder: &std::path::Path) -> Vec<PathBuf> {
    std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path()).collect()
}

/// A process of the run: a node, the clock service, or the launcher.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Process {
    Node(&'static str),
    Clock,
    Launcher,
}

impl Process {
    pub const ALL: [Self; 9] = [
        Self::Node("plant"),
        Self::Node("imu"),
        Self::Node("ekf"),
        Self::Node("controller"),
        Self::Node("pilot"),
        Self::Node("saboteur"),
        Self::Node("recorder"),
        Self::Clock,
        Self::Launcher,
    ];

    pub fn name(self) -> &'static str {
        match self {
            Self::Node(name) => name,
            Self::Clock => "clock",
            Self::Launcher => "launcher",
        }
    }

    /// Its process id, once it has come up.
    pub fn pid(self, place: &Place, launch: &Launch<'_>) -> Pid {
        match self {
            Self::Node(name) => place.process_of(name),
            Self::Clock => place.clock(),
            Self::Launcher => Pid::from_raw(i32::try_from(launch.id()).unwrap()).unwrap(),
        }
    }
}
