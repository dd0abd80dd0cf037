//! The overseer in a simulated run: processes that die, freeze, come late, hear late or cannot be started, a clock that
//! jumps, holds, and any order of events, all drawn from one seed. When the faults stop, the run must end.
//!
//! Not drawn, and left to the runs of real processes: swaps and stops that are asked for in flight, watchdogs that
//! expire, sidecars, and files that cannot be written. `SIMULATED_RUNS` says how many seeds are flown, and
//! `SIMULATED_SEED` with which they begin.

use crate::overseer::{Death, Overseer};
use crate::program::{BackupSpec, Executable, OnExit, Program};
use crate::replacement::Replacements;
use crate::role::Role;
use crate::supervisor::{Event, State};
use crate::view::{Command, SlotView, View};
use bus::lockstep::{Phase, SlotState, TransferOutcome};
use bus::membership::Membership;
use bus::plan::{InputPlan, NodePlan, OutputPlan, Pace, Plan, TopicPlan, Wait};
use bus::random::Stream;
use rand_core::Rng as _;
use std::collections::BTreeMap;
use std::time::Duration;

const TICKS: u32 = 40;
const WINDOW: u32 = 4;
const NODES: usize = 3;
/// Steps with faults, and steps after them in which the run must end.
const STORMY: u32 = 2_000;
const QUIET: u32 = 20_000;
const NEVER: u32 = u32::MAX;

/// What a simulated process does next.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Doing {
    Starting,
    /// It waits for its slot to be joined.
    Prepared,
    /// It waits for its slot to be taken.
    Connected,
    Computing,
    /// Its tick is sent, and not completed yet.
    Sent,
    /// It has been replaced, and waits until its last samples are read.
    Leaving {
        taken: u32,
    },
}

#[derive(Debug)]
struct Process {
    node: usize,
    generation: u32,
    doing: Doing,
    /// The membership that it follows.
    membership: Membership,
    /// Steps for which it does nothing.
    frozen: u32,
    /// How it ended: whether in good order.
    end: Option<bool>,
    message: Option<String>,
    is_settled: bool,
}

/// A run without processes, files and time.
struct World {
    plan: Plan,
    random: Stream,
    now: Duration,
    phase: Phase,
    granted: u32,
    held_at: Option<u32>,
    join_tick: u32,
    user_hold: u32,
    end_tick: u32,
    is_stop_requested: bool,
    epoch: u32,
    sent: Vec<u32>,
    slots: Vec<SlotView>,
    processes: Vec<Process>,
    stored: BTreeMap<u32, Membership>,
    /// Who wrote the sample that counts: by topic and tick.
    writers: BTreeMap<(usize, u32), u32>,
    has_faults: bool,
    log: Vec<String>,
}

fn plan() -> Plan {
    let topic =
        |name: &str| TopicPlan { name: name.to_owned(), type_name: "test".to_owned(), period_ticks: 1 };
    let input = |topic: usize, delay_ticks: u32| InputPlan {
        port: topic.to_string(),
        topic,
        delay_ticks,
        initial: None,
    };
    let node = |name: &str, inputs: Vec<InputPlan>, outputs: &[usize]| NodePlan {
        name: name.to_owned(),
        period_ticks: 1,
        wait: Wait::Block,
        cpu: None,
        inputs,
        outputs: outputs.iter().map(|&topic| OutputPlan { port: "out".to_owned(), topic }).collect(),
        parameters: serde_json::Value::Null,
        restarts: true,
    };
    Plan {
        run_id: "0-0".to_owned(),
        seed: 0,
        tick_ns: 1_000_000,
        duration_ticks: TICKS,
        window_ticks: WINDOW,
        pace: Pace::Free,
        clock_cpu: None,
        profile: false,
        lock_memory: false,
        topics: vec![topic("/a"), topic("/b")],
        nodes: vec![
            node("a", vec![input(1, 1)], &[0]),
            node("b", vec![input(0, 0)], &[1]),
            node("c", vec![input(0, 0), input(1, 0)], &[]),
        ],
    }
}

/// Whether samples that count are new, or were sent as a shadow's before the promotion.
#[derive(Clone, Copy, PartialEq)]
enum Sending {
    Computed,
    Again,
}

impl World {
    fn new(seed: u64) -> Self {
        let plan = plan();
        let first = Membership::first(&plan);
        let process = |node| Process {
            node,
            generation: 0,
            doing: Doing::Starting,
            membership: first.clone(),
            frozen: 0,
            end: None,
            message: None,
            is_settled: false,
        };
        let mut slots = vec![SlotView::EMPTY; 2 * NODES];
        slots[..NODES].iter_mut().for_each(|slot| slot.state = SlotState::Taken);
        Self {
            random: bus::random::stream(seed, "simulation"),
            now: Duration::ZERO,
            phase: Phase::Announcing,
            granted: 0,
            held_at: None,
            join_tick: NEVER,
            user_hold: NEVER,
            end_tick: TICKS,
            is_stop_requested: false,
            epoch: 0,
            sent: vec![0; plan.topics.len()],
            slots,
            processes: (0..NODES).map(process).collect(),
            stored: BTreeMap::from([(0, first)]),
            writers: BTreeMap::new(),
            has_faults: true,
            log: Vec::new(),
            plan,
        }
    }

    /// A number below `bound`.
    fn draw(&mut self, bound: u64) -> u64 {
        self.random.next_u64() % bound
    }

    fn happens(&mut self, one_in: u64) -> bool {
        self.draw(one_in) == 0
    }

    fn view(&self) -> View {
        let living = self.processes.iter().filter(|process| process.end.is_none());
        View {
            now: self.now,
            host: self.now,
            phase: self.phase,
            held_at: self.held_at,
            end_tick: self.end_tick,
            is_stop_requested: self.is_stop_requested,
            epoch: self.epoch,
            sent: self.sent.clone(),
            slots: self.slots.clone(),
            living: living.map(|process| (process.node, process.generation)).collect(),
            commands: Vec::new(),
        }
    }

    fn taken(&self) -> impl Iterator<Item = &SlotView> {
        self.slots.iter().filter(|slot| slot.state == SlotState::Taken)
    }

    fn slowest(&self) -> u32 {
        self.taken().map(|slot| slot.done).min().unwrap_or(NEVER)
    }

    /// A step of the clock.
    fn step_clock(&mut self) {
        if self.phase < Phase::Running {
            let next = if self.phase == Phase::Announcing { Phase::Connecting } else { Phase::Running };
            if self.slots[..NODES].iter().all(|slot| slot.ready >= next) {
                self.phase = next;
            }
            return;
        }
        if self.is_stop_requested {
            self.end_tick = self.end_tick.min(self.granted);
        }
        let boundary = self.join_tick.min(self.user_hold);
        if self.granted >= self.end_tick {
            self.held_at = None;
        } else if boundary <= self.granted {
            self.held_at = (self.slowest() >= self.granted).then_some(self.granted);
        } else {
            self.held_at = None;
            let target = self.end_tick.min(boundary).min(self.slowest().saturating_add(WINDOW));
            self.granted = self.granted.max(target);
        }
    }

    /// A step of a process.
    fn step_process(&mut self, index: usize) {
        let Process { node, generation, doing, frozen, end, .. } = self.processes[index];
        if end.is_some() {
            return;
        }
        if frozen > 0 {
            self.processes[index].frozen -= 1;
            return;
        }
        let slot = self.plan.slot(node, generation);
        let goes_to = match doing {
            Doing::Starting if generation == 0 || self.phase >= Phase::Connecting => {
                self.slots[slot].ready = Phase::Connecting;
                Doing::Prepared
            }
            Doing::Prepared if generation == 0 && self.phase >= Phase::Connecting => {
                self.slots[slot].ready = Phase::Running;
                Doing::Connected
            }
            Doing::Prepared if generation > 0 && self.slots[slot].state == SlotState::Joining => {
                self.processes[index].membership = self.stored[&(self.epoch + 1)].clone();
                self.slots[slot].transfer = TransferOutcome::State;
                self.slots[slot].ready = Phase::Running;
                Doing::Connected
            }
            Doing::Connected
                if self.phase == Phase::Running && self.slots[slot].state == SlotState::Taken =>
            {
                self.slots[slot].acknowledged = self.processes[index].membership.epoch;
                Doing::Computing
            }
            Doing::Computing => self.compute(index, slot),
            Doing::Sent => {
                self.slots[slot].done += 1;
                Doing::Computing
            }
            Doing::Leaving { taken } if self.slowest() >= taken.min(self.end_tick) => {
                self.processes[index].end = Some(true);
                doing
            }
            stays => stays,
        };
        self.processes[index].doing = goes_to;
    }

    fn compute(&mut self, index: usize, slot: usize) -> Doing {
        let (node, generation) = (self.processes[index].node, self.processes[index].generation);
        let tick = self.slots[slot].done;
        if self.slots[slot].acknowledged < self.epoch {
            let membership = self.stored[&self.epoch].clone();
            self.processes[index].membership = membership;
            self.slots[slot].acknowledged = self.epoch;
            // A backup that is promoted has its shadow samples count.
            (0..tick).for_each(|tick| self.send(index, tick, Sending::Again));
            return Doing::Computing;
        }
        if tick >= self.end_tick {
            self.processes[index].end = Some(true);
            return Doing::Computing;
        }
        let own = &self.processes[index].membership.nodes[node];
        if own.primary.generation == generation && own.backup.is_some() && tick >= own.take_over_tick {
            // It stays until the backup has completed the tick of the take-over.
            if self.slots[self.plan.slot(node, generation + 1)].done <= tick {
                return Doing::Computing;
            }
            self.slots[slot].done = NEVER - 1;
            return Doing::Leaving { taken: tick + 2 };
        }
        let has = |input: &InputPlan| self.sent[input.topic] >= (tick + 1).saturating_sub(input.delay_ticks);
        if self.granted <= tick || !self.plan.nodes[node].inputs.iter().all(has) {
            return Doing::Computing;
        }
        self.send(index, tick, Sending::Computed);
        Doing::Sent
    }

    /// Sends the samples of `tick` that count.
    fn send(&mut self, index: usize, tick: u32, sending: Sending) {
        let Process { node, generation, .. } = self.processes[index];
        let own = &self.processes[index].membership.nodes[node];
        for (output, topic) in self.plan.nodes[node].outputs.iter().map(|output| output.topic).enumerate() {
            let take_over = own.take_over_ticks[output];
            let counts = match &own.backup {
                _ if own.primary.generation == generation => tick < take_over,
                Some(backup) if backup.generation == generation => tick >= take_over,
                Some(_) | None => false,
            };
            if counts && (sending == Sending::Computed || self.sent[topic] <= tick) {
                assert_eq!(
                    self.sent[topic], tick,
                    "{node}.{generation} writes tick {tick} of topic {topic} when tick {} is due",
                    self.sent[topic]
                );
                self.sent[topic] = tick + 1;
                let other = self.writers.insert((topic, tick), generation);
                assert_eq!(other, None, "two write tick {tick} of topic {topic}");
            }
        }
    }

    /// A fault, or none.
    fn fault(&mut self) {
        if !self.has_faults || self.processes.is_empty() {
            return;
        }
        let victim = self.draw(self.processes.len() as u64) as usize;
        if self.happens(400) && self.processes[victim].end.is_none() {
            let Process { node, generation, doing, .. } = self.processes[victim];
            self.log.push(format!("{node}.{generation} dies while {doing:?}"));
            self.processes[victim].end = Some(false);
        }
        if self.happens(60) {
            self.processes[victim].frozen = self.draw(200) as u32;
        }
        if self.happens(300) {
            // However far the host's clock jumps, the watchdogs' clock goes on by this at most.
            self.now += Duration::from_millis(100);
        }
        if self.happens(500) {
            self.user_hold = if self.user_hold == NEVER { 0 } else { NEVER };
        }
    }

    fn execute(&mut self, command: Command) -> Option<(usize, u32)> {
        self.log.push(format!("tick {} of {}: {command:?}", self.granted, self.end_tick));
        let find = |processes: &mut Vec<Process>, node: usize, generation: u32| {
            processes.iter().position(|process| (process.node, process.generation) == (node, generation))
        };
        match command {
            Command::Spawn { node, generation, backup } => {
                assert_eq!(backup.node, node);
                if self.has_faults && self.happens(10) {
                    return Some((node, generation));
                }
                self.processes.push(Process {
                    node,
                    generation,
                    doing: Doing::Starting,
                    membership: self.stored[&self.epoch].clone(),
                    frozen: 0,
                    end: None,
                    message: None,
                    is_settled: false,
                });
            }
            Command::Kill { node, generation, message } => {
                if let Some(index) = find(&mut self.processes, node, generation) {
                    let process = &mut self.processes[index];
                    process.end = process.end.or(Some(false));
                    process.message = message;
                }
            }
            Command::Settle { node, generation } => {
                if let Some(index) = find(&mut self.processes, node, generation) {
                    self.processes[index].is_settled = true;
                }
            }
            Command::Free { node, generation, slot } => {
                self.slots[slot] = SlotView::EMPTY;
                self.processes.retain(|process| {
                    (process.node, process.generation) != (node, generation) || process.end.is_none()
                });
            }
            Command::Clear(slot) => self.slots[slot] = SlotView::EMPTY,
            Command::SetSlot(slot, state) => self.slots[slot].state = state,
            Command::FirstTick(slot, tick) => self.slots[slot].done = tick,
            Command::StartShadow(..) => {}
            Command::Store(membership) => drop(self.stored.insert(membership.epoch, *membership)),
            Command::Publish(epoch) => self.publish(epoch),
            Command::RequestStop => self.is_stop_requested = true,
        }
        None
    }

    /// One change at a time: whoever computes has acknowledged the one before.
    fn publish(&mut self, epoch: u32) {
        assert!(epoch >= self.epoch && epoch <= self.epoch + 1, "from {} to {epoch}", self.epoch);
        if epoch > self.epoch {
            for process in self.processes.iter().filter(|process| process.end.is_none()) {
                let slot = &self.slots[self.plan.slot(process.node, process.generation)];
                let computes = matches!(process.doing, Doing::Computing | Doing::Sent);
                assert!(
                    !computes
                        || slot.state != SlotState::Taken
                        || slot.acknowledged == self.epoch
                        || slot.done >= self.end_tick,
                    "{}.{} has not acknowledged {}",
                    process.node,
                    process.generation,
                    self.epoch
                );
            }
        }
        self.epoch = epoch;
    }
}

/// What the manifest of a seed says.
fn settings(world: &mut World) -> (Vec<Program>, Vec<BackupSpec>) {
    let program = |on_exit| Program { on_exit, ..Program::of(Executable::Command(Vec::new())) };
    let mut programs = Vec::new();
    let mut backups = Vec::new();
    for node in 0..NODES {
        let on_exit = [OnExit::Restart, OnExit::Standby, OnExit::Restart][world.draw(3) as usize];
        programs.push(program(on_exit));
        let backup = |join_tick, take_over_tick, is_standby| BackupSpec {
            node,
            join_tick,
            take_over_tick,
            is_standby,
            program: program(on_exit),
            plan: world.plan.nodes[node].clone(),
        };
        if on_exit == OnExit::Standby {
            backups.push(backup(0, None, true));
        } else {
            let join = 1 + (node as u32) * 9;
            backups.push(backup(join, Some(join + 5), false));
        }
    }
    backups.sort_by_key(|backup| backup.join_tick);
    (programs, backups)
}

/// The whole life of a run; how it ended.
fn live(seed: u64) -> (State, Vec<String>) {
    let mut world = World::new(seed);
    let (programs, backups) = settings(&mut world);
    let plan = world.plan.clone();
    let mut overseer = Overseer {
        plan: &plan,
        state: State::Starting,
        replacements: Replacements::new(&plan, world.view(), &programs, &backups),
        notes: Vec::new(),
        has_answered: false,
    };
    overseer.tell(Event::Started);
    world.join_tick = overseer.replacements.hold_tick();
    for step in 0..STORMY + QUIET {
        if step == STORMY {
            world.has_faults = false;
            world.user_hold = NEVER;
        }
        world.fault();
        world.now += Duration::from_micros(200);
        match world.draw(4) {
            0 => world.step_clock(),
            1 => {
                if look(&mut world, &mut overseer).is_err() {
                    overseer.state = State::Failed;
                }
            }
            _ => {
                let index = world.draw(world.processes.len().max(1) as u64) as usize;
                if index < world.processes.len() {
                    world.step_process(index);
                }
            }
        }
        if overseer.state.is_over() {
            if overseer.state == State::Stopped {
                assert!(
                    world.sent.iter().all(|&sent| sent == world.end_tick),
                    "samples are missing: {:?}",
                    world.sent
                );
            }
            return (overseer.state, world.log);
        }
    }
    let stuck: Vec<String> = world.log.iter().rev().take(12).rev().cloned().collect();
    panic!(
        "it does not end: {:?}, granted {}, held {:?}, join {}, slots {:?}, processes {:?}\n{}",
        overseer.state,
        world.granted,
        world.held_at,
        world.join_tick,
        world.slots,
        world.processes.iter().map(|p| (p.node, p.generation, p.doing, p.end, p.frozen)).collect::<Vec<_>>(),
        stuck.join("\n")
    );
}

fn carry_out(world: &mut World, overseer: &mut Overseer<'_>) -> Result<(), String> {
    while !overseer.replacements.view.commands.is_empty() {
        for command in std::mem::take(&mut overseer.replacements.view.commands) {
            if let Some((node, generation)) = world.execute(command) {
                let error = anyhow::anyhow!("no more processes");
                overseer
                    .replacements
                    .note_not_started(node, generation, &error)
                    .map_err(|e| e.to_string())?;
            }
        }
    }
    Ok(())
}

/// A look of the supervisor, in the order of its loop.
fn look(world: &mut World, overseer: &mut Overseer<'_>) -> Result<(), String> {
    overseer.replacements.view = world.view();
    for index in 0..world.processes.len() {
        let Some(process) = world.processes.get(index) else { break };
        let (Some(is_good), false) = (process.end, process.is_settled) else { continue };
        let role = Role::Node { node: process.node, generation: process.generation };
        let (node, generation) = (process.node, process.generation);
        let is_settled = if is_good && overseer.has_done_its_part(role) {
            true
        } else {
            let name = world.plan.nodes[node].name.clone();
            let settled = overseer.settle(&Death { name, role, words: "died".to_owned() });
            carry_out(world, overseer)?;
            settled.map_err(|abort| abort.0)?
        };
        let mut processes = world.processes.iter_mut();
        if let Some(process) = processes.find(|p| is_settled && (p.node, p.generation) == (node, generation))
        {
            process.is_settled = true;
        }
    }
    overseer.note_gathered();
    if overseer.state == State::Running && world.granted >= world.end_tick {
        overseer.tell(Event::EndReached);
    }
    if world.processes.iter().all(|process| process.end.is_some() && process.is_settled) {
        overseer.tell(Event::AllEnded);
    }
    if overseer.state == State::Draining {
        overseer.replacements.end();
    }
    carry_out(world, overseer)?;
    let too_late = overseer.note_too_late();
    carry_out(world, overseer)?;
    too_late.map_err(|abort| abort.0)?;
    overseer.replacements.view = world.view();
    world.join_tick = overseer.replacements.hold_tick();
    overseer.replacements.view = world.view();
    overseer.replacements.advance();
    carry_out(world, overseer)?;
    world.join_tick = overseer.replacements.hold_tick();
    overseer.note_laggards();
    carry_out(world, overseer)
}

#[test]
fn whatever_dies_hangs_or_comes_late_the_run_ends_and_every_sample_has_one_writer() {
    let seeds: u64 = std::env::var("SIMULATED_RUNS").ok().and_then(|text| text.parse().ok()).unwrap_or(3000);
    let first: u64 = std::env::var("SIMULATED_SEED").ok().and_then(|text| text.parse().ok()).unwrap_or(0);
    let mut ends = BTreeMap::new();
    for seed in first..first + seeds {
        let (state, _) = std::panic::catch_unwind(|| live(seed)).unwrap_or_else(|_| panic!("seed {seed}"));
        *ends.entry(format!("{state:?}")).or_insert(0) += 1;
    }
    // Runs come to their end, and runs are aborted because of what nobody can answer.
    let share =
        |state: State| f64::from(ends.get(&format!("{state:?}")).copied().unwrap_or(0)) / seeds as f64;
    let shares = [State::Stopped, State::Failed].map(share);
    assert!(shares.iter().all(|&share| share > 0.2) || seeds < 100, "{ends:?}");
}
