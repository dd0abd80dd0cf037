//! Groups: which nodes share a process, and why some cannot.

use super::processes::{DeclaredNode, require_core};
use crate::manifest::{Composition, Manifest};
use crate::program::Executable;
use bus::plan::{GroupPlan, MemberPlan, NodePlan};
use diagnostics::{Diagnostic, did_you_mean};
use std::collections::BTreeMap;
use std::ops::Range;

/// The groups of a run of `nodes`: those of `run.compose`, or else the manifest's `[group]` tables.
///
/// # Errors
/// A group that is not well formed, and a member that needs a process of its own.
pub fn of(
    manifest: &Manifest,
    declared_nodes: &[DeclaredNode<'_>],
    nodes: &[NodePlan],
) -> Result<Vec<GroupPlan>, Diagnostic> {
    let composer = Composer { manifest, declared_nodes, nodes };
    let stated = composer.stated()?;
    let Some(composition) = &manifest.content.run.compose else { return Ok(stated) };
    let span = composition.span();
    match composition.get_ref() {
        Composition::None => Ok(Vec::new()),
        Composition::All => Ok(composer.all()),
        Composition::Vehicles => composer.vehicles(&span),
        Composition::Groups(groups) => composer.chosen(groups, &stated, &span),
    }
}

struct Composer<'a> {
    manifest: &'a Manifest,
    declared_nodes: &'a [DeclaredNode<'a>],
    nodes: &'a [NodePlan],
}

impl Composer<'_> {
    /// The groups of the `[group]` tables.
    fn stated(&self) -> Result<Vec<GroupPlan>, Diagnostic> {
        let mut groups = Vec::new();
        for (name, setting) in &self.manifest.content.group {
            require_core(self.manifest, &setting.cpu, "cpu")?;
            let members = setting.processes.get_ref().iter();
            let members = members.map(|member| self.member(member.get_ref(), &member.span()));
            let members = Diagnostic::gather(members)?;
            let cpu = setting.cpu.as_ref().map(|cpu| *cpu.get_ref());
            groups.push(self.group(name.get_ref(), members, cpu, &setting.processes.span())?);
        }
        let spans = self.manifest.content.group.values().map(|setting| setting.processes.span());
        self.require_one_each(&groups, &spans.collect::<Vec<_>>())?;
        Ok(groups)
    }

    /// One group of all nodes that can be members.
    fn all(&self) -> Vec<GroupPlan> {
        let nodes: Vec<usize> =
            (0..self.nodes.len()).filter(|&node| self.objection(node).is_none()).collect();
        if nodes.len() < 2 { Vec::new() } else { vec![self.plan("all", &nodes, None)] }
    }

    /// One group per vehicle.
    fn vehicles(&self, span: &Range<usize>) -> Result<Vec<GroupPlan>, Diagnostic> {
        let mut vehicles: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
        for (node, plan) in self.nodes.iter().enumerate() {
            if let Some((vehicle, _)) = plan.name.rsplit_once('/')
                && self.objection(node).is_none()
            {
                vehicles.entry(vehicle).or_default().push(node);
            }
        }
        if vehicles.is_empty() {
            let message = "there is no vehicle to compose: no process has a name such as `h1/plant`";
            return Err(self.manifest.problem(span, message, "declare [[vehicle]] tables, or compose `all`"));
        }
        let group = |(name, nodes): (&str, Vec<usize>)| self.plan(name, &nodes, None);
        Ok(vehicles.into_iter().map(group).filter(|group| group.members.len() > 1).collect())
    }

    /// The groups that were named.
    fn chosen(
        &self,
        groups: &[Vec<String>],
        stated: &[GroupPlan],
        span: &Range<usize>,
    ) -> Result<Vec<GroupPlan>, Diagnostic> {
        let group = |names: &Vec<String>| {
            if let [name] = names.as_slice() {
                if let Some(group) = stated.iter().find(|group| group.name == *name) {
                    return Ok(group.clone());
                }
                // A process alone is a group of one, so that a list may name each process once.
                if !self.nodes.iter().any(|node| node.name == *name) {
                    return Err(self.no_group(name, stated, span));
                }
            }
            let members = Diagnostic::gather(names.iter().map(|name| self.member(name, span)))?;
            self.group(&names.join("+"), members, None, span)
        };
        let groups = Diagnostic::gather(groups.iter().map(group))?;
        self.require_one_each(&groups, &vec![span.clone(); groups.len()])?;
        Ok(groups)
    }

    fn no_group(&self, name: &str, stated: &[GroupPlan], span: &Range<usize>) -> Diagnostic {
        let message = format!("there is no group `{name}`");
        let help = if stated.is_empty() {
            "the manifest has no [group] table; name processes with + between them, such as plant+imu"
                .to_owned()
        } else {
            did_you_mean(name, stated.iter().map(|group| group.name.as_str()), "the groups are")
        };
        self.manifest.problem(span, message, help)
    }

    fn group(
        &self,
        name: &str,
        mut nodes: Vec<usize>,
        cpu: Option<usize>,
        span: &Range<usize>,
    ) -> Result<GroupPlan, Diagnostic> {
        nodes.sort_unstable();
        if let Some(twice) = nodes.windows(2).find(|pair| pair[0] == pair[1]) {
            let message = format!("group `{name}` names `{}` twice", self.nodes[twice[0]].name);
            return Err(self.manifest.problem(span, message, "name each process once"));
        }
        if nodes.is_empty() {
            let message = format!("group `{name}` has no member");
            return Err(self.manifest.problem(span, message, "name processes, or leave the group out"));
        }
        Ok(self.plan(name, &nodes, cpu))
    }

    /// The group `name` of `nodes`, which can be its members.
    fn plan(&self, name: &str, nodes: &[usize], cpu: Option<usize>) -> GroupPlan {
        let member = |&node: &usize| {
            let kind = self.declared_nodes[node].program.component()?.name.to_owned();
            Some(MemberPlan { node, kind })
        };
        GroupPlan { name: name.to_owned(), members: nodes.iter().filter_map(member).collect(), cpu }
    }

    /// The node called `name`, which can be a member of a group.
    fn member(&self, name: &str, span: &Range<usize>) -> Result<usize, Diagnostic> {
        let Some(node) = self.nodes.iter().position(|node| node.name == name) else {
            let known = self.nodes.iter().map(|node| node.name.as_str());
            let help = did_you_mean(name, known, "the processes that take part in the ticks are");
            return Err(self.manifest.problem(
                span,
                format!("a group names `{name}`, which is not there"),
                help,
            ));
        };
        match self.objection(node) {
            None => Ok(node),
            Some(reason) => {
                let message = format!("`{name}` cannot be a member of a group: {reason}");
                Err(self.manifest.problem(
                    span,
                    message,
                    "leave it out of the group: it has a process of its own",
                ))
            }
        }
    }

    /// Reason why `node` needs a process of its own; `None` if it can be a member of a group.
    fn objection(&self, node: usize) -> Option<String> {
        let DeclaredNode { program, process, .. } = &self.declared_nodes[node];
        match program.executable {
            Executable::Component(_) => {}
            Executable::Program(kind) => {
                return Some(format!("a process of kind `{}` holds nothing else", kind.name));
            }
            Executable::Command(_) => return Some("it is a `command`".to_owned()),
        }
        if program.is_recorder() {
            return Some("it is the recorder, whose file must outlive the others' faults".to_owned());
        }
        let stated = [
            ("environment", !program.environment.is_empty()),
            ("working_directory", program.working_directory.is_some()),
            ("nice", program.nice.is_some()),
            ("realtime_priority", program.realtime_priority.is_some()),
            ("log", program.log.is_some()),
            ("cpu", process.cpu.is_some()),
        ];
        let key = stated.into_iter().find(|(_, is_stated)| *is_stated).map(|(key, _)| key)?;
        Some(format!("its `{key}` is that of a process of its own"))
    }

    /// Refuses a node that is a member of two groups.
    fn require_one_each(&self, groups: &[GroupPlan], spans: &[Range<usize>]) -> Result<(), Diagnostic> {
        for (index, group) in groups.iter().enumerate() {
            for other in &groups[..index] {
                let Some(member) = group.members.iter().find(|member| other.has(member.node)) else {
                    continue;
                };
                let message = format!(
                    "`{}` is a member of group `{}` and of group `{}`",
                    self.nodes[member.node].name, other.name, group.name
                );
                return Err(self.manifest.problem(
                    &spans[index],
                    message,
                    "a process is a member of one group",
                ));
            }
        }
        Ok(())
    }
}
