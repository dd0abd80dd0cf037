//! A group of nodes as one process, or one thread: the first instances of its members step on one executor.

use crate::error::BusError;
use crate::executor::Executor;
use crate::join::Join;
use crate::plan::{MemberPlan, Pace, Plan};
use crate::registration::Registration;
use crate::run_process::{Part, finish};
use crate::transport::Transport;
use std::rc::Rc;

/// The environment variable that names the group that a process is.
pub const GROUP_VARIABLE: &str = "HUMMINGBUS_GROUP";

/// Runs the group that the launcher started this process for, whose components are among `components`; returns when the
/// run ends or other processes have taken its members' places.
///
/// # Errors
/// If the process was not started by a launcher as a group, or as [`run`].
pub fn run_process(components: &'static [Registration]) -> Result<(), BusError> {
    run(&Join::named_by(GROUP_VARIABLE)?, components)
}

/// Runs the group that `join` names.
///
/// # Errors
/// If there is no such group, the manifest and a component do not fit, a step fails, or the run is aborted.
pub fn run(join: &Join, components: &'static [Registration]) -> Result<(), BusError> {
    let Join { run_dir, node: name, place, .. } = join;
    let plan = Plan::load(run_dir)?;
    let group =
        plan.groups.iter().find(|group| group.name == *name).ok_or_else(|| BusError::UnknownNode {
            node: name.clone(),
            known: plan.groups.iter().map(|group| group.name.as_str()).collect::<Vec<_>>().join(", "),
        })?;
    place.stay_on(group.cpu);
    if plan.pace == Pace::Free {
        place.wait_for_turn();
    }
    let transport = Rc::new(Transport::new(run_dir, &plan.run_id, name, place)?);
    let parts = group.members.iter().map(|member| part(join, &plan, member, components));
    let mut parts = parts.collect::<Result<Vec<Part>, BusError>>()?;
    let end = fly(&mut parts, &transport);
    finish(parts, end)
}

fn part(
    group: &Join,
    plan: &Plan,
    member: &MemberPlan,
    components: &'static [Registration],
) -> Result<Part, BusError> {
    let node = plan.nodes[member.node].name.clone();
    let registration = components.iter().find(|component| component.name == member.kind);
    let registration = registration.ok_or_else(|| BusError::Program {
        node: node.clone(),
        reason: format!("this program brings no component `{}`", member.kind),
    })?;
    Part::make(Join { node, generation: 0, ..group.clone() }, registration, components)
}

fn fly(parts: &mut [Part], transport: &Rc<Transport>) -> Result<(), BusError> {
    // All announce before one connects: connecting waits until every node of the run has announced.
    let announced = parts.iter_mut().map(|part| part.take_node()?.announce(transport.clone()));
    let announced = announced.collect::<Result<Vec<_>, BusError>>()?;
    let members = parts.iter_mut().zip(announced).map(|(part, node)| part.member(node.connect()?));
    let members = members.collect::<Result<Vec<_>, BusError>>()?;
    Executor::group(members).run()
}
