//! The world of a real run: the control segment in shared memory, processes or threads of the host, and the run
//! directory.

use crate::ctl::Reply;
use crate::ctl::control::ControlServer;
use crate::ctl::protocol::{Answer, Request};
use crate::descendants::Descendants;
use crate::executed::Executed;
use crate::graph::successor_of;
use crate::host::{End, Host, Thread, ThreadPart};
use crate::instances::Instances;
use crate::manifest::Manifest;
use crate::process_log;
use crate::program::{BackupSpec, Program, Readiness};
use crate::role::Role;
use crate::spawn::{self, Started};
use crate::view::{SegmentWrite, View};
use crate::world::{Body, Spent, World};
use anyhow::{Context, Result};
use bus::host_time::monotonic_ns;
use bus::lockstep::{SlotState, SupervisorView};
use bus::membership::Membership;
use bus::place::Place;
use bus::plan::{GroupPlan, InputPlan, NodePlan, Plan};
use bus::{BusError, Join};
use diagnostics::Diagnostic;
use inputs::InputFiles;
use rustix::io::Errno;
use rustix::process::{Pid, WaitId, WaitIdOptions, waitid};
use std::cell::RefCell;
use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::os::unix::net::UnixDatagram;
use std::path::{Path, PathBuf};
use std::process::Child;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

/// Messages of a sidecar that are read in one look, so that a sender that never ends does not block the launcher.
const MESSAGES_MAX: usize = 32;
/// The longest message of sd_notify(3) that is looked at.
const MESSAGE_BYTES: usize = 4096;

/// The world of a run on this host.
pub struct HostWorld<'a> {
    /// Host of its instances.
    pub host: Host,
    /// Its manifest.
    pub manifest: &'a Manifest,
    /// Its plan.
    pub plan: &'a Plan,
    /// The files that it reads.
    pub files: &'a InputFiles,
    /// Its control segment.
    pub control: Arc<SupervisorView>,
    /// Its run directory.
    pub run_dir: &'a Path,
    /// Serves requests.
    pub control_server: ControlServer<'a>,
    /// Processes started by its processes, if those are to end with the run.
    pub descendants: Option<&'a Descendants>,
    /// Sockets on which sidecars report that they are ready, by their number.
    pub sockets: BTreeMap<usize, UnixDatagram>,
    /// Processes that it has started in the places of others.
    pub instances: &'a Instances,
    /// The processes of groups that were started, by the groups' names.
    pub groups: BTreeMap<String, Rc<RefCell<SharedBody>>>,
    /// The files of the run's commands.
    pub executed: &'a mut Executed,
    /// Warnings about started processes, until they are taken.
    pub warnings: Vec<String>,
}

impl HostWorld<'_> {
    /// The socket on which sidecar `index` says that it is ready. The path of a socket may have 107 bytes only, so that
    /// the name is not in it.
    fn notify_socket(&mut self, name: &str, index: usize) -> Result<PathBuf> {
        let path = self.run_dir.join(format!("{index}.notify"));
        if let Entry::Vacant(place) = self.sockets.entry(index) {
            let socket = UnixDatagram::bind(&path)
                .with_context(|| format!("process `{name}`: cannot open the socket {}", path.display()))?;
            socket.set_nonblocking(true).context("cannot read a socket without waiting")?;
            place.insert(socket);
        }
        Ok(path)
    }
}

impl HostWorld<'_> {
    /// The group in whose process the instance of `role` lives, and its slot.
    fn member_of(&self, role: Role) -> Option<(GroupPlan, usize)> {
        let Role::Node { node, generation: 0 } = role else { return None };
        Some((self.plan.group_of(node)?.clone(), self.plan.slot(node, 0)))
    }

    fn start_group(&mut self, group: &GroupPlan, role: Role) -> Result<Rc<RefCell<SharedBody>>> {
        let body = Rc::new(RefCell::new(self.start_body(&group.name, role, Started::Group, None)?));
        self.groups.insert(group.name.clone(), body.clone());
        Ok(body)
    }

    fn start_body(
        &self,
        name: &str,
        role: Role,
        started: Started<'_>,
        notify: Option<&Path>,
    ) -> Result<SharedBody> {
        let (body, log) = match &self.host {
            Host::Exe(exe) => {
                let (child, log) = spawn::start(exe, self.run_dir, name, role, started, notify)?;
                (Running::Process(child), log)
            }
            Host::Threads | Host::InProcess => {
                let part = match started {
                    Started::Clock => ThreadPart::Clock,
                    Started::Group => ThreadPart::Group,
                    Started::One(program) => {
                        self.host.require(name, program)?;
                        let component = program.component();
                        ThreadPart::Node(
                            component.with_context(|| format!("process `{name}` is no component"))?,
                        )
                    }
                };
                let components = self.manifest.registry().components();
                let (run_dir, node) = (self.run_dir.to_owned(), name.to_owned());
                let (generation, place) = (role.generation(), Place::default());
                let join = Join { run_dir, node, generation, place };
                let thread = Thread::start(part, components, join, self.control.clone())?;
                (Running::Thread(thread), PathBuf::new())
            }
        };
        Ok(SharedBody {
            is_log_of_run: log.starts_with(self.run_dir),
            body,
            log,
            end: None,
            left: BTreeSet::new(),
        })
    }
}

impl World for HostWorld<'_> {
    type Body = HostBody;
    type Reply = Reply;

    fn now(&self) -> Duration {
        Duration::from_nanos(monotonic_ns())
    }

    fn see(&self) -> View {
        View::of(self.plan, &self.control)
    }

    fn awaited_topic(&self, slot: usize, inputs: &[InputPlan]) -> Option<usize> {
        self.control.awaited_topic(self.plan, slot, inputs)
    }

    fn write(&mut self, write: SegmentWrite) {
        let control = &self.control;
        match write {
            SegmentWrite::Clear(slot) => control.clear_slot(slot),
            SegmentWrite::SetSlot(slot, state) => {
                if state == SlotState::Taken {
                    self.instances.note_transfer(self.plan, slot, control.transfer(slot));
                }
                control.set_slot_state(slot, state);
            }
            SegmentWrite::FirstTick(slot, tick) => control.set_first_tick(slot, tick),
            SegmentWrite::StartShadow(topic, tick) => control.start_shadow(topic, tick),
            SegmentWrite::Publish(epoch) => control.set_epoch(epoch),
            SegmentWrite::JoinTick(tick) => control.set_join_tick(tick),
            SegmentWrite::RequestStop => control.request_stop(),
            SegmentWrite::Abort => control.abort(),
            SegmentWrite::Drained => control.note_drained(),
        }
    }

    fn notices(&self) -> u32 {
        self.control.notices()
    }

    fn wait(&mut self, notices: u32, timeout: Duration) {
        self.control.wait_for_notice(notices, timeout);
    }

    fn spent(&self, slot: usize) -> Spent {
        let [overruns, skipped_steps] = self.control.overruns(slot);
        let (cpu_ns, late) = (self.control.cpu_ns(slot), self.control.late_count(slot));
        Spent { cpu_ns, late, overruns, skipped_steps }
    }

    fn start(&mut self, name: &str, role: Role, program: Option<&Program>) -> Result<HostBody> {
        self.warnings.extend(program.into_iter().flat_map(|program| self.executed.note(name, program)));
        let notify = match (role, program) {
            (Role::Sidecar { index, .. }, Some(program)) if program.ready == Readiness::Notify => {
                Some(self.notify_socket(name, index)?)
            }
            _ => None,
        };
        let member = self.member_of(role);
        if let Some((group, slot)) = member {
            let started = self.groups.get(&group.name).cloned();
            let body = match started {
                Some(body) => body,
                None => self.start_group(&group, role)?,
            };
            return Ok(HostBody::member(body, slot, &group, self.plan, self.control.clone()));
        }
        let started = program.map_or(Started::Clock, Started::One);
        Ok(HostBody::alone(self.start_body(name, role, started, notify.as_deref())?))
    }

    fn take_warnings(&mut self) -> Vec<String> {
        std::mem::take(&mut self.warnings)
    }

    fn hears_ready(&mut self, index: usize) -> bool {
        let Some(socket) = self.sockets.get(&index) else { return false };
        let mut message = [0; MESSAGE_BYTES];
        let mut is_ready = false;
        for _ in 0..MESSAGES_MAX {
            let Ok(length) = socket.recv(&mut message) else { break };
            // Lines of `NAME=VALUE`.
            is_ready |= message[..length].split(|&byte| byte == b'\n').any(|line| line == b"READY=1");
        }
        is_ready
    }

    fn reap(&self, known: &[u32]) {
        if let Some(descendants) = self.descendants {
            descendants.reap(known);
        }
    }

    fn store_backup(&mut self, backup: &BackupSpec, generation: u32) -> Result<(), BusError> {
        self.instances.note_start(generation, backup);
        store_files(self.files, self.run_dir, &backup.plan)?;
        backup.plan.store_backup(self.run_dir, backup.node, generation)
    }

    fn store_membership(&mut self, membership: &Membership) -> Result<(), BusError> {
        self.instances.note_membership(membership);
        membership.store(self.run_dir)
    }

    fn remove_traces(&mut self, node: usize, generation: u32, was_killed: bool) {
        if was_killed {
            // Its ports would keep their places; those that cannot be removed now go with the run.
            let _ = bus::reap_dead(self.run_dir, &self.plan.run_id);
        }
        bus::state_transfer::remove(self.run_dir, self.plan, node, generation);
        let _ = std::fs::remove_file(bus::plan::backup_path(self.run_dir, node, generation));
        bus::claim::remove(self.run_dir, &self.plan.nodes[node].name, generation);
    }

    fn next_request(&mut self) -> Option<(Request, Reply)> {
        self.control_server.serve()
    }

    fn answer(&mut self, reply: Reply, answer: &Answer) {
        reply.send(answer);
    }

    fn backup_of(&self, process: &str, with: &str) -> Result<(BackupSpec, Vec<Diagnostic>), Diagnostic> {
        successor_of(self.manifest, self.plan, self.files, process, with)
    }
}

/// Writes the files that the node of `plan` reads into the run directory.
///
/// # Errors
/// If they cannot be written.
pub fn store_files(files: &InputFiles, run_dir: &Path, plan: &NodePlan) -> Result<(), BusError> {
    let folder = run_dir.join(Plan::INPUTS);
    files.store(&folder, &plan.files).map_err(|source| BusError::File {
        action: "write",
        path: folder,
        source,
    })
}

/// The process or thread of an instance, and its log.
#[derive(Debug)]
pub struct HostBody {
    shared: Rc<RefCell<SharedBody>>,
    member: Option<MemberBody>,
}

/// A process or thread that one instance has for itself, or the members of a group share.
#[derive(Debug)]
pub struct SharedBody {
    body: Running,
    log: PathBuf,
    is_log_of_run: bool,
    /// Its end.
    end: Option<End>,
    /// Slots of the members of a group that were seen to have left. A later instance may use the slot again.
    left: BTreeSet<usize>,
}

/// A member of a group.
#[derive(Debug)]
struct MemberBody {
    slot: usize,
    /// The slots of all members.
    slots: Vec<usize>,
    control: Arc<SupervisorView>,
}

impl HostBody {
    fn alone(body: SharedBody) -> Self {
        Self { shared: Rc::new(RefCell::new(body)), member: None }
    }

    fn member(
        shared: Rc<RefCell<SharedBody>>,
        slot: usize,
        group: &GroupPlan,
        plan: &Plan,
        control: Arc<SupervisorView>,
    ) -> Self {
        let slots = group.members.iter().map(|member| plan.slot(member.node, 0)).collect();
        Self { shared, member: Some(MemberBody { slot, slots, control }) }
    }
}

impl MemberBody {
    /// True if the member has ended and others of its group have not: the last one ends with the process. `left` are the
    /// slots of the members that were seen to have left.
    fn has_left_others(&self, left: &mut BTreeSet<usize>) -> bool {
        if self.control.has_left(self.slot) {
            left.insert(self.slot);
        }
        let has_left = |slot: &usize| left.contains(slot) || self.control.has_left(*slot);
        left.contains(&self.slot) && !self.slots.iter().all(has_left)
    }
}

#[derive(Debug)]
enum Running {
    Process(Child),
    Thread(Thread),
}

/// True if a process has exited. One that this process traces, as it does after PTRACE_TRACEME, is reported when it stops,
/// too, and has not ended then.
fn has_exited(child: &Child, options: WaitIdOptions) -> bool {
    let options = options | WaitIdOptions::EXITED | WaitIdOptions::NOWAIT;
    match waitid(WaitId::Pid(Pid::from_child(child)), options) {
        Ok(Some(status)) => status.exited() || status.killed() || status.dumped(),
        Ok(None) | Err(Errno::INTR) => false,
        // Another caller has waited for it: `wait` returns the consequence.
        Err(_) => true,
    }
}

impl SharedBody {
    fn id(&self) -> Option<u32> {
        match &self.body {
            Running::Process(child) => Some(child.id()),
            Running::Thread(_) => None,
        }
    }

    /// Looks whether it has ended.
    fn look(&mut self) -> Result<()> {
        if self.end.is_some() {
            return Ok(());
        }
        self.end = match &mut self.body {
            Running::Process(child) if !has_exited(child, WaitIdOptions::NOHANG) => None,
            Running::Process(child) => child.try_wait().context("cannot watch a process")?.map(End::from),
            Running::Thread(thread) => thread.end(),
        };
        Ok(())
    }

    fn kill(&mut self, patience: &mut Duration) {
        if self.end.is_some() {
            return;
        }
        self.end = match &mut self.body {
            Running::Process(child) => {
                // A command may have started processes of its own.
                bus::process::kill_group(child.id());
                let _ = child.kill();
                while !has_exited(child, WaitIdOptions::empty()) {}
                child.wait().ok().map(End::from)
            }
            Running::Thread(thread) => {
                thread.cancel();
                Some(thread.join(patience))
            }
        }
    }
}

impl Body for HostBody {
    fn id(&self) -> Option<u32> {
        self.shared.borrow().id()
    }

    fn end(&mut self) -> Result<Option<End>> {
        let mut shared = self.shared.borrow_mut();
        shared.look()?;
        match &self.member {
            Some(member) if member.has_left_others(&mut shared.left) => Ok(Some(End::Exited(0))),
            _ => Ok(shared.end.clone()),
        }
    }

    fn cancel(&self) {
        if let Running::Thread(thread) = &self.shared.borrow().body {
            thread.cancel();
        }
    }

    fn kill(&mut self, patience: &mut Duration) -> Option<End> {
        let mut shared = self.shared.borrow_mut();
        shared.kill(patience);
        shared.end.clone()
    }

    fn last_lines(&self) -> Vec<String> {
        process_log::last_words(&self.shared.borrow().log)
    }

    fn bound_log(&self) {
        let shared = self.shared.borrow();
        if shared.is_log_of_run {
            process_log::bound(&shared.log);
        }
    }

    fn remove_log(&self) {
        let shared = self.shared.borrow();
        // The log of a group is that of its other members, too.
        if shared.is_log_of_run && self.member.is_none() {
            let _ = std::fs::remove_file(&shared.log);
        }
    }
}
