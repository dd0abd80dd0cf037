//! Which keys a scene file has, and in which dimension.

use crate::rig;
use crate::scene::{Cuboid, Scene};
use diagnostics::parameter::Bounds;
use diagnostics::unit::{ANGLE, LENGTH};
use nalgebra::Vector3;
use vehicles::VehicleError;
use vehicles::reader::{Document, Section};

/// Where things of a scene stand.
pub(crate) const PLACE: Bounds = Bounds {
    min: -1e6,
    max: 1e6,
    unit: "m",
    why: "beyond 1000 km the ground is not flat, and contacts of a double lose their micrometres",
};

/// Lengths of a box.
const SIZE: Bounds = Bounds {
    min: 1e-4,
    max: 1e6,
    unit: "m",
    why: "three lengths above 0: contacts are resolved to 0.1 mm, and beyond 1000 km the ground is not flat",
};

/// Ten turns.
const YAW: Bounds = Bounds { min: -63.0, max: 63.0, unit: "rad", why: "ten turns, in case of a wrong unit" };

/// Reads the whole file; see `scenes/room.toml` for the layout.
pub(crate) fn parse(text: &str, file_name: &str) -> Result<Scene, VehicleError> {
    let doc = Document::new(file_name, text);
    let tree = doc.tree()?;
    let root = Section::new(&doc, String::new(), 0..0, tree.get_ref());
    let name = root.text("name")?.to_owned();
    let sections = if root.has("boxes") { root.sections("boxes")? } else { Vec::new() };
    let boxes = sections.iter().map(one_box).collect::<Result<_, _>>()?;
    let rig = if root.has("rig") { Some(rig::parse(&root.section("rig")?)?) } else { None };
    let effects = vehicles::effects::read(&root)?;
    root.finish()?;
    Ok(Scene { name, boxes, rig, effects })
}

fn one_box(section: &Section) -> Result<Cuboid, VehicleError> {
    let name = section.text("name")?.to_owned();
    let centre = section.vector("centre", LENGTH, &PLACE)?;
    let size = section.vector("size", LENGTH, &SIZE)?;
    let yaw_rad =
        if section.has("yaw") { section.quantity("yaw", ANGLE)?.within(section.doc, &YAW)?.si } else { 0.0 };
    section.finish()?;
    Ok(Cuboid { name, centre_W_m: centre.into(), half_extents_m: Vector3::from(size) / 2.0, yaw_rad })
}
