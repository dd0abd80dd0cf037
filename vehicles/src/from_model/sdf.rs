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
struct Frames {
    poses: BTreeMap<String, (Isometry3<f64>, String, Range<usize>)>,
}

/// The model, or a model within it, whose names have a prefix outside: `gps0::link`.
struct Scope<'d, 'i> {
    model: Node<'d, 'i>,
    prefix: String,
}

/// Reads the only model of the element `<sdf>`. The model's frame is that of its element.
///
/// # Errors
/// If there is not one model, or it includes another that was not found. If an element is missing or not of
/// its kind, or the joints do not form a tree.
pub fn read<'a>(source: Source<'a>, sdf: Node) -> Result<Model<'a>, Diagnostic> {
    let model = only_model(source, sdf)?;
    let mut scopes = Vec::new();
    add_scopes(source, model, String::new(), &mut scopes)?;
    let mut frames = Frames::default();
    for scope in &scopes {
        frames.add_all(source, scope)?;
    }
    let each = |kind| {
        scopes.iter().flat_map(move |scope| children(scope.model, kind).map(move |node| (node, scope)))
    };
    let links = each("link").map(|(node, scope)| link(source, node, scope, &frames));
    let links = links.collect::<Result<Vec<_>, _>>()?;
    let joints = each("joint").map(|(node, scope)| joint(source, node, scope, &frames));
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
    Ok(model)
}

/// Adds `model` and the models within it, which have no `<include>` any more.
fn add_scopes<'d, 'i>(
    source: Source,
    model: Node<'d, 'i>,
    prefix: String,
    scopes: &mut Vec<Scope<'d, 'i>>,
) -> Result<(), Diagnostic> {
    if let Some(include) = child(model, "include") {
        return Err(included_model(source, include));
    }
    let inner = children(model, "model").map(|inner| Ok((inner, source.attribute(inner, "name")?)));
    let inner = inner.collect::<Result<Vec<_>, Diagnostic>>()?;
    scopes.push(Scope { model, prefix: prefix.clone() });
    inner
        .into_iter()
        .try_for_each(|(inner, name)| add_scopes(source, inner, format!("{prefix}{name}::"), scopes))
}

impl Scope<'_, '_> {
    /// The frame of the model itself.
    fn frame(&self) -> &str {
        self.prefix.strip_suffix("::").unwrap_or(MODEL)
    }

    /// The full name of the part `name` in this model.
    fn full(&self, name: &str) -> String {
        match name {
            MODEL => self.frame().to_owned(),
            "world" => name.to_owned(),
            _ => format!("{}{name}", self.prefix),
        }
    }
}

/// The error for a model in another file that was not found.
fn included_model(source: Source, include: Node) -> Diagnostic {
    let uri = text_of(include, "uri")
        .map_or("a model without <uri>".to_owned(), |uri| format!("`{}`", plain(&uri)));
    let message = format!("expected links and joints, found <include> of {uri}, which is in another file");
    source.fault(start_of(include), message).help(
        "set GAZEBO_MODEL_PATH to the folder that holds the folder of this model, or put that beside the folder of this file",
    )
}

impl Frames {
    /// Adds the model of `scope`, if it lies within another, and its content.
    fn add_all(&mut self, source: Source, scope: &Scope) -> Result<(), Diagnostic> {
        if !scope.prefix.is_empty() {
            let outer =
                scope.frame().rsplit_once("::").map_or(String::new(), |(outer, _)| format!("{outer}::"));
            let outer = Scope { model: scope.model, prefix: outer };
            self.add(source, scope.model, scope.frame().to_owned(), &outer, None)?;
        }
        for kind in ["link", "joint", "frame"] {
            for node in children(scope.model, kind) {
                let carrier = match kind {
                    "joint" => text_of(node, "child"),
                    "frame" => node.attribute("attached_to").map(str::to_owned),
                    _ => None,
                };
                let name = scope.full(source.attribute(node, "name")?);
                self.add(source, node, name, scope, carrier)?;
            }
        }
        Ok(())
    }

    /// Adds the pose of `node`, which is called `name` outside; names in it are those of `scope`.
    fn add(
        &mut self,
        source: Source,
        node: Node,
        name: String,
        scope: &Scope,
        carrier: Option<String>,
    ) -> Result<(), Diagnostic> {
        let posed = child(node, "pose");
        let stated = posed.and_then(|pose| pose.attribute("relative_to").or(pose.attribute("frame")));
        let stated = stated.filter(|name| !name.trim().is_empty()).map(str::to_owned);
        let to = scope.full(&stated.or(carrier).unwrap_or_else(|| MODEL.to_owned()));
        let entry = (own_pose(source, node)?, to, start_of(node));
        if self.poses.insert(name.clone(), entry).is_some() {
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

fn link(source: Source, node: Node, scope: &Scope, frames: &Frames) -> Result<Link, Diagnostic> {
    let name = scope.full(source.attribute(node, "name")?);
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
fn joint(source: Source, node: Node, scope: &Scope, frames: &Frames) -> Result<Option<Joint>, Diagnostic> {
    let name = scope.full(source.attribute(node, "name")?);
    let end = |side: &str| {
        text_of(node, side).map(|end| scope.full(&end)).ok_or_else(|| {
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
    let axis = axis(source, node, scope, frames, &pose)?;
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
    scope: &Scope,
    frames: &Frames,
    pose: &Isometry3<f64>,
) -> Result<Vector3<f64>, Diagnostic> {
    let Some(axis) = child(joint, "axis") else { return Ok(pose * Vector3::z()) };
    let Some(xyz) = child(axis, "xyz") else { return Ok(pose * Vector3::z()) };
    let vector = Vector3::from(source.numbers(xyz, "xyz", &text_in(xyz))?);
    let of_model =
        text_of(axis, "use_parent_model_frame").is_some_and(|text| matches!(text.as_str(), "1" | "true"));
    match xyz.attribute("expressed_in").filter(|name| !name.trim().is_empty()) {
        Some(name) => Ok(frames.of(source, &scope.full(name))? * vector),
        None if of_model => Ok(frames.of(source, scope.frame())? * vector),
        None => Ok(pose * vector),
    }
}
