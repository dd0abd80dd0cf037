//! Models in URDF, the Unified Robot Description Format.

use diagnostics::Diagnostic;
use nalgebra::{Isometry3, Point3, Vector3};
use roxmltree::Node;
use std::collections::BTreeMap;

use super::model::{Freedom, Inertial, Joint, Link, Model, pose, tensor};
use super::plugins;
use super::tree;
use super::xml::{Source, child, children, name_of, start_of};

/// Reads the element `<robot>`. The model's frame is that of its root link.
///
/// # Errors
/// If an element or attribute is missing or not of its kind, or the joints do not form a tree.
pub fn read<'a>(source: Source<'a>, robot: Node) -> Result<Model<'a>, Diagnostic> {
    let mut links = children(robot, "link").map(|node| link(source, node)).collect::<Result<Vec<_>, _>>()?;
    let read = children(robot, "joint").map(|node| joint(source, node)).collect::<Result<Vec<_>, _>>()?;
    let (mut joints, origins): (Vec<_>, Vec<_>) = read.into_iter().unzip();
    place(source, &mut links, &mut joints, &origins)?;
    let name = name_of(robot);
    Ok(Model { source, name, links, joints, motors: plugins::read(source, robot)?, notes: Vec::new() })
}

/// Chains the joints from the root link, so that all poses are in its frame.
fn place(
    source: Source,
    links: &mut [Link],
    joints: &mut [Joint],
    origins: &[Isometry3<f64>],
) -> Result<(), Diagnostic> {
    let mut poses = BTreeMap::new();
    for (link, above) in tree::order(source, links, joints)? {
        let pose = match above {
            Some(number) => {
                let pose = poses[&joints[number].parent] * origins[number];
                joints[number].point = pose * Point3::origin();
                joints[number].axis = pose * joints[number].axis;
                pose
            }
            None => Isometry3::identity(),
        };
        poses.insert(links[link].name.clone(), pose);
        links[link].pose = pose;
    }
    Ok(())
}

fn link(source: Source, node: Node) -> Result<Link, Diagnostic> {
    let name = source.attribute(node, "name")?.to_owned();
    let inertial = child(node, "inertial").map(|node| inertial(source, node, &name)).transpose()?;
    Ok(Link { name, pose: Isometry3::identity(), inertial, at: start_of(node) })
}

fn inertial(source: Source, node: Node, link: &str) -> Result<Inertial, Diagnostic> {
    let part = |name: &str| {
        child(node, name).ok_or_else(|| {
            let message = format!("link `{link}`: expected <{name}> in <inertial>, found none");
            source.fault(start_of(node), message).help(format!("add <{name}>"))
        })
    };
    let mass_kg = source.number_in(part("mass")?, "value")?;
    let inertia = part("inertia")?;
    let mut entries = [0.0; 6];
    for (entry, name) in entries.iter_mut().zip(["ixx", "ixy", "ixz", "iyy", "iyz", "izz"]) {
        *entry = source.number_in(inertia, name)?;
    }
    let at = start_of(node);
    Ok(Inertial { mass_kg, pose: origin(source, node)?, tensor_kg_m2: tensor(entries), at })
}

fn joint(source: Source, node: Node) -> Result<(Joint, Isometry3<f64>), Diagnostic> {
    let name = source.attribute(node, "name")?.to_owned();
    let end = |side: &str| -> Result<String, Diagnostic> {
        let missing = || {
            let message = format!("joint `{name}`: expected <{side}>, found none");
            source.fault(start_of(node), message).help(format!("add <{side} link=\"…\"/>"))
        };
        Ok(source.attribute(child(node, side).ok_or_else(missing)?, "link")?.to_owned())
    };
    let (parent, below) = (end("parent")?, end("child")?);
    let freedom = match source.attribute(node, "type")? {
        "fixed" => Freedom::Fixed,
        "revolute" | "prismatic" if is_locked(source, node)? => Freedom::Fixed,
        "continuous" | "revolute" => Freedom::Turns,
        _ => Freedom::Other,
    };
    let axis = match child(node, "axis").and_then(|axis| Some((axis, axis.attribute("xyz")?))) {
        Some((node, text)) => source.numbers(node, "xyz", text)?,
        None => [1.0, 0.0, 0.0],
    };
    let (point, axis) = (Point3::origin(), Vector3::from(axis));
    let joint = Joint { name, parent, child: below, freedom, point, axis, at: start_of(node) };
    Ok((joint, origin(source, node)?))
}

/// True if a joint states that both of its limits are 0.
fn is_locked(source: Source, joint: Node) -> Result<bool, Diagnostic> {
    let Some(limit) = child(joint, "limit") else { return Ok(false) };
    for name in ["lower", "upper"] {
        if limit.attribute(name).is_none() || source.number_in(limit, name)? != 0.0 {
            return Ok(false);
        }
    }
    Ok(true)
}

/// The pose of `<origin>`; none is the identity.
fn origin(source: Source, node: Node) -> Result<Isometry3<f64>, Diagnostic> {
    let Some(origin) = child(node, "origin") else { return Ok(Isometry3::identity()) };
    let vector = |name: &str| match origin.attribute(name) {
        Some(text) => source.numbers(origin, name, text),
        None => Ok([0.0; 3]),
    };
    Ok(pose(vector("xyz")?, vector("rpy")?))
}
