//! The memory of a simulated run, its instances, and the order of their steps.

use super::fault::Fault;
use crate::ctl::protocol::{Answer, Request};
use crate::event::StopToken;
use crate::host::End;
use crate::role::Role;
use crate::view::{SlotView, View};
use bus::lockstep::{Phase, SlotState};
use bus::membership::Membership;
use bus::plan::{InputPlan, Plan};
use bus::random::Stream;
use rand_core::Rng as _;
use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::rc::Rc;
use std::time::Duration;

pub(super) const NODES: usize = 3;
pub(super) const WINDOW: u32 = 4;
pub(super) const NEVER: u32 = u32::MAX;
/// Simulated time within which a run must end once nothing happens to it any more.
const QUIET: Duration = Duration::from_secs(60);
/// Time for which a node, and then the clock, stands still while the run starts: less than a watchdog, more than half of one.
pub(super) const SLOW_START: Duration = Duration::from_millis(300);
/// Duration of a state that never ends by itself.
pub(super) const FOR_EVER: Duration = Duration::MAX;

/// Log of events, if one is kept.
pub(super) type Log = Option<Rc<RefCell<Vec<String>>>>;

/// Numbers drawn from the seed.
#[derive(Debug)]
pub(super) struct Draw(Stream);

impl Draw {
    pub(super) fn new(seed: u64) -> Self {
        Self(bus::random::stream(seed, "simulation"))
    }

    pub(super) fn below(&mut self, bound: u64) -> u64 {
        self.0.next_u64() % bound
    }

    pub(super) fn one_in(&mut self, count: u64) -> bool {
        self.below(count) == 0
    }

    pub(super) fn micros(&mut self, bound: u64) -> Duration {
        Duration::from_micros(self.below(bound))
    }
}

/// A bug that is planted to see that it is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Bug {
    /// Nodes acknowledge a membership that they do not follow.
    AcknowledgesUnread,
    /// The supervisor takes every membership for acknowledged.
    AwaitsNobody,
    /// A backup is promoted at a tick that its predecessor has sent.
    PromotesTwo,
    /// A new membership wakes no process.
    LosesWakeUp,
    /// A stop never comes to the clock.
    ForgetsStop,
    /// A process that was killed lives on.
    KillMisses,
}

/// Condition that an instance sleeps for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Need {
    Samples(usize),
    Shadow(usize),
    Grant,
    /// The other instance of its node.
    Other(usize),
    /// Completed ticks: the clock waits for these.
    Done,
    /// A phase, or the state of a slot.
    State,
    /// A hold, a join or a stop.
    Steering,
    /// Nothing.
    Nothing,
}

/// Next action of an instance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Doing {
    Starting,
    /// It waits until its slot may join.
    Prepared,
    /// It waits until its slot is taken.
    Connected,
    /// It waits for the next tick.
    Waiting,
    /// It stores the sample of this output, or wakes its readers.
    Sending {
        output: usize,
        is_stored: bool,
    },
    /// It waits until its last samples are read.
    Leaving {
        taken: u32,
    },
    /// It follows the run no more, and its program goes on for a while.
    Left,
    /// The clock waits until every instance is ready for a phase.
    Gathering(Phase),
    /// The clock waits until these ticks are completed.
    Awaiting(u32),
    /// The clock holds the tick.
    Holding,
    /// Nothing: a sidecar.
    Idle,
}

/// A simulated process.
#[derive(Debug)]
pub(super) struct Instance {
    pub(super) role: Role,
    pub(super) doing: Doing,
    /// Condition that it sleeps for, and longest time.
    pub(super) sleep: Option<(Need, Duration)>,
    pub(super) frozen_until: Duration,
    pub(super) end: Option<End>,
    /// The membership that it follows, and its entries for this instance.
    pub(super) epoch: u32,
    pub(super) take_over_tick: u32,
    pub(super) retirement_tick: u32,
    pub(super) counts_from: Vec<u32>,
    pub(super) sends_from: Vec<u32>,
    /// Per input: up to which tick it waits for shadow samples.
    pub(super) shadows_until: Vec<u32>,
    /// The next tick that it computes.
    pub(super) tick: u32,
    /// True if a sidecar has reported that it is ready, and the supervisor has not heard it yet.
    pub(super) says_ready: bool,
    /// True if it has stood still before it joined.
    pub(super) was_slow: bool,
}

/// Everything outside the supervisor.
#[derive(Debug)]
pub(super) struct Sim {
    pub(super) plan: Plan,
    pub(super) draw: Draw,
    pub(super) bug: Option<Bug>,
    /// The faults that are drawn; none once the storm is over.
    pub(super) faults: BTreeSet<Fault>,
    pub(super) now: Duration,
    /// The control segment.
    pub(super) segment: View,
    /// True if the senders have left an aborted run.
    pub(super) is_drained: bool,
    pub(super) join_tick: u32,
    pub(super) shadow: Vec<u32>,
    pub(super) published: Vec<u32>,
    pub(super) notices: u32,
    pub(super) instances: Vec<Instance>,
    /// The memberships in the run directory.
    pub(super) stored: BTreeMap<u32, Membership>,
    /// Instance that wrote the sample that counts: by topic and tick.
    pub(super) writers: BTreeMap<(usize, u32), u32>,
    /// Faults that were struck and may end a run.
    pub(super) excuses: Vec<String>,
    pub(super) requests: VecDeque<Request>,
    /// Answers to requests.
    pub(super) answers: Vec<Option<Answer>>,
    pub(super) looks: u32,
    /// The look at which a stop was requested.
    pub(super) stop_look: Option<u32>,
    pub(super) stop: StopToken,
    pub(super) log: Log,
    /// Steps so far, and with how many of them the storm is over; when that was.
    pub(super) steps: u32,
    pub(super) storm_steps: u32,
    pub(super) quiet_since: Option<Duration>,
}

impl Sim {
    pub(super) fn new(plan: &Plan, mut draw: Draw, faults: BTreeSet<Fault>) -> Self {
        let mut slots = vec![SlotView::EMPTY; 2 * NODES];
        slots[..NODES].iter_mut().for_each(|slot| slot.state = SlotState::Taken);
        let segment = View {
            now: Duration::ZERO,
            host: Duration::ZERO,
            first_grant: Duration::ZERO,
            phase: Phase::Announcing,
            pace: plan.pace,
            granted: 0,
            held_at: None,
            hold_tick: NEVER,
            awaits_clock: false,
            end_tick: plan.duration_ticks,
            is_stop_requested: false,
            is_aborted: false,
            epoch: 0,
            sent: vec![0; plan.topics.len()],
            slots,
            living: BTreeSet::new(),
            commands: Vec::new(),
        };
        Self {
            bug: None,
            faults,
            now: Duration::from_secs(1),
            segment,
            is_drained: false,
            join_tick: NEVER,
            shadow: vec![0; plan.topics.len()],
            published: vec![0; 2 * NODES],
            notices: 0,
            instances: Vec::new(),
            stored: BTreeMap::from([(0, Membership::first(plan))]),
            writers: BTreeMap::new(),
            excuses: Vec::new(),
            requests: VecDeque::new(),
            answers: Vec::new(),
            looks: 0,
            stop_look: None,
            stop: StopToken::new(),
            log: None,
            steps: 0,
            storm_steps: 500 + draw.below(2500) as u32,
            quiet_since: None,
            draw,
            plan: plan.clone(),
        }
    }

    pub(super) fn note(&self, text: impl FnOnce(&Self) -> String) {
        if let Some(log) = &self.log {
            let View { granted, end_tick, .. } = self.segment;
            log.borrow_mut().push(format!("{:?}, tick {granted} of {end_tick}: {}", self.now, text(self)));
        }
    }

    /// Starts an instance, which says that it is ready if it `notifies`; returns its number.
    pub(super) fn start(&mut self, role: Role, notifies: bool) -> usize {
        let outputs = match role {
            Role::Node { node, .. } => self.plan.nodes[node].outputs.len(),
            Role::Clock | Role::Sidecar { .. } => 0,
        };
        let doing = match role {
            Role::Clock => Doing::Gathering(Phase::Connecting),
            Role::Sidecar { .. } if !notifies => Doing::Idle,
            Role::Node { .. } | Role::Sidecar { .. } => Doing::Starting,
        };
        let is_slow =
            matches!(role, Role::Node { node: 0, generation: 0 }) && self.faults.contains(&Fault::SlowStart);
        let start = if is_slow { SLOW_START } else { self.draw.micros(1000) };
        self.instances.push(Instance {
            role,
            doing,
            sleep: None,
            frozen_until: self.now + start,
            end: None,
            epoch: 0,
            take_over_tick: 0,
            retirement_tick: NEVER,
            counts_from: vec![0; outputs],
            sends_from: vec![0; outputs],
            shadows_until: Vec::new(),
            tick: 0,
            says_ready: false,
            was_slow: false,
        });
        self.instances.len() - 1
    }

    /// The slot of an instance of a node.
    pub(super) fn slot(&self, role: Role) -> usize {
        let Role::Node { node, generation } = role else { unreachable!("{role:?} has no slot") };
        self.plan.slot(node, generation)
    }

    pub(super) fn inputs(&self, role: Role) -> &[InputPlan] {
        let Role::Node { node, .. } = role else { unreachable!("{role:?} has no inputs") };
        &self.plan.nodes[node].inputs
    }

    pub(super) fn living(&self) -> impl Iterator<Item = &Instance> {
        self.instances.iter().filter(|instance| instance.end.is_none())
    }

    pub(super) fn slowest(&self) -> u32 {
        self.segment.computing().map(|slot| self.segment.slots[slot].done).min().unwrap_or(NEVER)
    }

    /// Wakes the instances that sleep for `need`.
    pub(super) fn wake(&mut self, need: Need) {
        for instance in &mut self.instances {
            instance.sleep.take_if(|(other, _)| *other == need);
        }
    }

    pub(super) fn wake_all(&mut self) {
        self.instances.iter_mut().for_each(|instance| instance.sleep = None);
    }

    /// Notifies the supervisor that there is something to look at.
    pub(super) fn notify(&mut self) {
        if !self.strikes(Fault::LostNotice, 3) {
            self.notices += 1;
        }
    }

    /// Runs all instances until `deadline`, or until there is a notice beyond `notices`.
    pub(super) fn run_until(&mut self, deadline: Duration, notices: u32) {
        while self.now < deadline && self.notices == notices {
            self.step(deadline);
        }
    }

    /// Lets others act, while the supervisor is busy.
    pub(super) fn preempt(&mut self) {
        while self.draw.one_in(4) {
            self.step(self.now + Duration::from_micros(50));
        }
    }

    fn step(&mut self, deadline: Duration) {
        self.steps += 1;
        if self.steps == self.storm_steps {
            self.calm();
        }
        if self.quiet_since.is_some_and(|since| self.now > since + QUIET) {
            panic!("it does not end: {:?} {:?}", self.segment, self.living().collect::<Vec<_>>());
        }
        self.strike();
        let spurious = self.strikes(Fault::SpuriousWakeUp, 20);
        let is_awake = |sim: &Self, index: usize| {
            let instance = &sim.instances[index];
            let is_asleep = instance.sleep.is_some_and(|(_, until)| until > sim.now);
            instance.end.is_none() && instance.frozen_until <= sim.now && (spurious || !is_asleep)
        };
        let count = self.instances.len();
        let first = self.draw.below(count.max(1) as u64) as usize;
        let awake = (0..count).map(|offset| (first + offset) % count).find(|&index| is_awake(self, index));
        let Some(index) = awake else {
            let moments = self.living().map(|instance| {
                instance.frozen_until.max(instance.sleep.map_or(Duration::ZERO, |(_, until)| until))
            });
            let next = moments.chain([deadline]).min().unwrap_or(deadline);
            self.now = next.max(self.now + Duration::from_micros(1));
            return;
        };
        self.now += self.draw.micros(60);
        self.instances[index].sleep = None;
        match self.instances[index].role {
            role if self.leaves(role) => self.instances[index].end = Some(End::Exited(0)),
            Role::Clock => self.step_clock(index),
            Role::Node { .. } => self.step_node(index),
            Role::Sidecar { .. } => self.step_sidecar(index),
        }
    }

    /// True if an instance with this role finds that the run was aborted and that nothing more comes.
    fn leaves(&self, role: Role) -> bool {
        let reads_only = |node: usize| self.plan.nodes[node].outputs.is_empty();
        let stays = matches!(role, Role::Node { node, .. } if reads_only(node)) && !self.is_drained;
        self.segment.is_aborted && !stays
    }

    fn step_sidecar(&mut self, index: usize) {
        let says_ready =
            self.instances[index].doing == Doing::Starting && !self.strikes(Fault::NeverReady, 2);
        let instance = &mut self.instances[index];
        instance.says_ready |= says_ready;
        instance.doing = Doing::Idle;
        instance.sleep = Some((Need::Nothing, FOR_EVER));
    }
}
