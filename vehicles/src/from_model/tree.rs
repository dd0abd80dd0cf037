//! Links and joints as a tree, with one root.

use diagnostics::Diagnostic;
use std::collections::{BTreeMap, VecDeque};

use super::model::{Joint, Link};
use super::xml::Source;

/// A link with the index of its joint; the root has none.
pub type Step = (usize, Option<usize>);

/// Orders links so that each stands behind its parent.
///
/// # Errors
/// If two links have one name, or a joint names a link that is not there. If a link has two parents, there
/// are two roots, or joints form a cycle.
pub fn order(source: Source, links: &[Link], joints: &[Joint]) -> Result<Vec<Step>, Diagnostic> {
    let index = index(source, links)?;
    let above = parents(source, &index, joints)?;
    let mut roots = (0..links.len()).filter(|link| !above.contains_key(link));
    let Some(root) = roots.next() else { return Err(cycle(source, links, joints, &[])) };
    if let Some(other) = roots.next() {
        let (first, second) = (&links[root].name, &links[other].name);
        let message = format!("expected one link without a parent, found two: `{first}` and `{second}`");
        return Err(source.fault(links[other].at.clone(), message).help("join them with a fixed joint"));
    }
    let mut below: BTreeMap<usize, Vec<Step>> = BTreeMap::new();
    for (number, joint) in joints.iter().enumerate() {
        below
            .entry(index[joint.parent.as_str()])
            .or_default()
            .push((index[joint.child.as_str()], Some(number)));
    }
    let mut steps = Vec::new();
    let mut next = VecDeque::from([(root, None)]);
    while let Some(step) = next.pop_front() {
        steps.push(step);
        next.extend(below.remove(&step.0).unwrap_or_default());
    }
    if steps.len() < links.len() { Err(cycle(source, links, joints, &steps)) } else { Ok(steps) }
}

fn index<'a>(source: Source, links: &'a [Link]) -> Result<BTreeMap<&'a str, usize>, Diagnostic> {
    let mut index = BTreeMap::new();
    for (number, link) in links.iter().enumerate() {
        let name = link.name.as_str();
        if index.insert(name, number).is_some() {
            let message = format!("expected links with different names, found `{name}` twice");
            return Err(source.fault(link.at.clone(), message).help("rename one of them"));
        }
    }
    if links.is_empty() {
        return Err(source.whole("expected a model with links, found none").help("add a <link> with mass"));
    }
    Ok(index)
}

/// The joint above each link.
fn parents(
    source: Source,
    index: &BTreeMap<&str, usize>,
    joints: &[Joint],
) -> Result<BTreeMap<usize, usize>, Diagnostic> {
    let mut above = BTreeMap::new();
    for (number, joint) in joints.iter().enumerate() {
        let name = &joint.name;
        for end in [joint.parent.as_str(), joint.child.as_str()] {
            if !index.contains_key(end) {
                let message = format!("joint `{name}`: expected the name of a link, found `{end}`");
                return Err(source
                    .fault(joint.at.clone(), message)
                    .help("add this link, or correct the name"));
            }
        }
        if let Some(other) = above.insert(index[joint.child.as_str()], number) {
            let (child, other) = (&joint.child, &joints[other].name);
            let message = format!(
                "link `{child}`: expected one parent, found two, by the joints `{other}` and `{name}`"
            );
            return Err(source.fault(joint.at.clone(), message).help("remove one of the joints"));
        }
    }
    Ok(above)
}

/// The error for joints that no way from the root leads to.
fn cycle(source: Source, links: &[Link], joints: &[Joint], seen: &[Step]) -> Diagnostic {
    let is_seen = |name: &str| seen.iter().any(|step| links[step.0].name == name);
    let (joint, at) = joints
        .iter()
        .find(|joint| !is_seen(&joint.child))
        .map_or(("", 0..0), |joint| (joint.name.as_str(), joint.at.clone()));
    source
        .fault(at, format!("expected joints that form a tree, found a cycle that joint `{joint}` is part of"))
        .help("remove one joint of the cycle")
}
