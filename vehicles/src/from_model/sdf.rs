//! Models in SDF, the Simulation Description Format.

use diagnostics::{Diagnostic, ParameterError};
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use roxmltree::Node;
use std::collections::BTreeMap;
use std::ops::Range;

use super::model::{Freedom, Inertial, Joint, Link, Model, pose, tensor};
use super::plugins;
use super::sdf_notes;
use super::text::plain;
use super::tree;
use super::xml::{Source, child, children, name_of, start_of, text_in, text_of};

/// Name of the model's own frame.
const MODEL: &str = "__model__";

/// Poses of a model's links, joints and frames, each relative to another.
#[derive(Default)]
struct Frames<'d> {
    poses: BTreeMap<&'d str, (Isometry3<f64>, String, Range<usize>)>,
}

/// Reads the only model of the element `<sdf>`. The model's frame is that of its element.
///
/// # Errors
/// If there is not one model, it includes or holds others, an element is missing or not of its kind, or the joints do not form a tree.
pub fn read<'a>(source: Source<'a>, sdf: Node) -> Result<Model<'a>, Diagnostic> {
    let model = only_model(source, sdf)?;
    let mut frames = Frames::default();
    for kind in ["link", "joint", "frame"] {
        for node in children(model, kind) {
            frames.add(source, node, kind)?;
        }
    }
    let links = children(model, "link").map(|node| link(source, node, &frames));
    let links = links.collect::<Result<Vec<_>, _>>()?;
    let joints = children(model, "joint").map(|node| joint(source, node, &frames));
    let joints: Vec<Joint> = joints.collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect();
    tree::order(source, &links, &joints)?;
    let name = name_of(model);
    let notes = sdf_notes::of(source, sdf, model)?;
    Ok(Model { source, name, links, joints, motors: plugins::read(source, model)?, notes })
}

fn only_model<'d, 'i>(source: Source, sdf: Node<'d, 'i>) -> Result<Node<'d, 'i>, Diagnostic> {
    let models: Vec<_> = children(sdf, "model")
        .chain(children(sdf, "world").flat_map(|world| children(world, "model")))
        .collect();
    let included =
        children(sdf, "include").chain(children(sdf, "world").flat_map(|world| children(world, "include")));
    if let (true, Some(include)) = (models.is_empty(), included.into_iter().next()) {
        return Err(included_model(source, include));
    }
    let [model] = models[..] else {
        let message = format!("expected one <model>, found {}", models.len());
        return Err(source.whole(message).help("keep the model of the vehicle alone in the file"));
    };
    let inner = model.children().find(|node| matches!(node.tag_name().name(), "include" | "model"));
    match inner {
        Some(node) if node.has_tag_name("include") => Err(included_model(source, node)),
        Some(node) => {
            let message = format!(
                "expected links and joints, found the model `{}` within this one",
                plain(&name_of(node))
            );
            Err(source.fault(start_of(node), message).help(
                "copy its links, joints and plugins into this model, and add its pose to the poses of its links",
            ))
        }
        None => Ok(model),
    }
}

/// The error for a model in another file, which is not looked for: its place depends on the simulator's settings.
fn included_model(source: Source, include: Node) -> Diagnostic {
    let uri = text_of(include, "uri")
        .map_or("a model without <uri>".to_owned(), |uri| format!("`{}`", plain(&uri)));
    let message = format!("expected links and joints, found <include> of {uri}, which is in another file");
    source.fault(start_of(include), message).help(
        "let the simulator write one file with all models, `gz sdf -p FILE > WHOLE.sdf`, and convert that, or copy the \
         links, joints and plugins of the included model into this one",
    )
}

impl<'d> Frames<'d> {
    fn add(&mut self, source: Source, node: Node<'d, '_>, kind: &str) -> Result<(), Diagnostic> {
        let name = source.attribute(node, "name")?;
        let carrier = match kind {
            "joint" => text_of(node, "child"),
            "frame" => node.attribute("attached_to").map(str::to_owned),
            _ => None,
        };
        let posed = child(node, "pose");
        let relative = |node: Node<'d, '_>| node.attribute("relative_to").or(node.attribute("frame"));
        let stated = posed.and_then(relative).filter(|name| !name.trim().is_empty());
        let to = stated.map(str::to_owned).or(carrier).unwrap_or_else(|| MODEL.to_owned());
        let entry = (own_pose(source, node)?, to, start_of(node));
        if self.poses.insert(name, entry).is_some() {
            let message =
                format!("expected links, joints and frames with different names, found `{name}` twice");
            return Err(source.fault(start_of(node), message).help("rename one of them"));
        }
        Ok(())
    }

    /// The pose of a link, joint or frame in the model's frame.
    fn of(&self, source: Source, name: &str) -> Result<Isometry3<f64>, Diagnostic> {
        let (mut whole, mut next, mut at) = (Isometry3::identity(), name, 0..0);
        for _ in 0..=self.poses.len() {
            if next == MODEL || next == "world" {
                return Ok(whole);
            }
            let Some((pose, to, place)) = self.poses.get(next) else {
                let message = format!("expected the name of a link, joint or frame, found `{next}`");
                return Err(source.fault(at, message).help("add it, or correct the name"));
            };
            (whole, next, at) = (pose * whole, to.as_str(), place.clone());
        }
        let message =
            format!("expected poses that lead to the model, found a cycle that `{name}` leads into");
        Err(source.fault(at, message).help("correct `relative_to`"))
    }
}

/// The pose in the element `<pose>` of `node`; none is the identity.
fn own_pose(source: Source, node: Node) -> Result<Isometry3<f64>, Diagnostic> {
    let Some(node) = child(node, "pose") else { return Ok(Isometry3::identity()) };
    let text = text_in(node);
    let text = text.as_str();
    if node.attribute("rotation_format") == Some("quat_xyzw") {
        let [x, y, z, i, j, k, w] = source.numbers(node, "pose", text)?;
        let quaternion = nalgebra::Quaternion::new(w, i, j, k);
        let turn = UnitQuaternion::try_new(quaternion, f64::MIN_POSITIVE).ok_or_else(|| {
            source.fault(start_of(node), ParameterError::value("pose", "a quaternion that is not 0", text))
        })?;
        return Ok(Isometry3::from_parts(Vector3::new(x, y, z).into(), turn));
    }
    if text.trim().is_empty() {
        return Ok(Isometry3::identity());
    }
    let [x, y, z, roll, pitch, yaw] = source.numbers(node, "pose", text)?;
    let is_in_degrees = matches!(node.attribute("degrees"), Some("true" | "1"));
    let unit = if is_in_degrees { std::f64::consts::PI / 180.0 } else { 1.0 };
    Ok(pose([x, y, z], [roll * unit, pitch * unit, yaw * unit]))
}

fn link(source: Source, node: Node, frames: &Frames) -> Result<Link, Diagnostic> {
    let name = source.attribute(node, "name")?.to_owned();
    let missing = |what: &str, place: Node| {
        let message = format!("link `{name}`: expected {what}, found none");
        source
            .fault(start_of(place), message)
            .help("add it: Gazebo would take 1 kg or 1 kg*m^2, which is seldom meant")
    };
    let inertial = child(node, "inertial").ok_or_else(|| missing("<inertial>", node))?;
    let mass = child(inertial, "mass").ok_or_else(|| missing("<mass>", inertial))?;
    let inertia = child(inertial, "inertia").ok_or_else(|| missing("<inertia>", inertial))?;
    let mut entries = [0.0; 6];
    for (entry, key) in entries.iter_mut().zip(["ixx", "ixy", "ixz", "iyy", "iyz", "izz"]) {
        let is_product = matches!(key, "ixy" | "ixz" | "iyz");
        *entry = match child(inertia, key) {
            Some(number) => source.number_of(number)?,
            None if is_product => 0.0,
            None => return Err(missing(&format!("<{key}>"), inertia)),
        };
    }
    let (mass_kg, tensor_kg_m2) = (source.number_of(mass)?, tensor(entries));
    let pose = frames.of(source, &name)?;
    let of = Inertial { mass_kg, pose: own_pose(source, inertial)?, tensor_kg_m2, at: start_of(inertial) };
    Ok(Link { name, pose, inertial: Some(of), at: start_of(node) })
}

/// A joint; none for one that holds the model to the world.
fn joint(source: Source, node: Node, frames: &Frames) -> Result<Option<Joint>, Diagnostic> {
    let name = source.attribute(node, "name")?.to_owned();
    let end = |side: &str| {
        text_of(node, side).ok_or_else(|| {
            let message = format!("joint `{name}`: expected <{side}>, found none");
            source.fault(start_of(node), message).help(format!("add <{side}> with the name of a link"))
        })
    };
    let (parent, below) = (end("parent")?, end("child")?);
    if parent == "world" || below == "world" {
        return Ok(None);
    }
    let freedom = match source.attribute(node, "type")? {
        "fixed" => Freedom::Fixed,
        "revolute" | "prismatic" if is_locked(source, node)? => Freedom::Fixed,
        "continuous" | "revolute" => Freedom::Turns,
        _ => Freedom::Other,
    };
    let pose = frames.of(source, &name)?;
    let axis = axis(source, node, frames, &pose)?;
    let at = start_of(node);
    let point = pose * Point3::origin();
    Ok(Some(Joint { name, parent, child: below, freedom, point, axis, at }))
}

/// True if a joint states that both of its limits are 0.
fn is_locked(source: Source, joint: Node) -> Result<bool, Diagnostic> {
    let Some(limit) = child(joint, "axis").and_then(|axis| child(axis, "limit")) else { return Ok(false) };
    for name in ["lower", "upper"] {
        match child(limit, name) {
            Some(node) if source.number_of(node)? == 0.0 => {}
            _ => return Ok(false),
        }
    }
    Ok(true)
}

/// The axis of a joint in the model's frame; z of the joint if there is none.
fn axis(
    source: Source,
    joint: Node,
    frames: &Frames,
    pose: &Isometry3<f64>,
) -> Result<Vector3<f64>, Diagnostic> {
    let Some(axis) = child(joint, "axis") else { return Ok(pose * Vector3::z()) };
    let Some(xyz) = child(axis, "xyz") else { return Ok(pose * Vector3::z()) };
    let vector = Vector3::from(source.numbers(xyz, "xyz", &text_in(xyz))?);
    let of_model =
        text_of(axis, "use_parent_model_frame").is_some_and(|text| matches!(text.as_str(), "1" | "true"));
    match xyz.attribute("expressed_in").filter(|name| !name.trim().is_empty()) {
        Some(name) => Ok(frames.of(source, name)? * vector),
        None if of_model => Ok(vector),
        None => Ok(pose * vector),
    }
}
