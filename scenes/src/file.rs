//! Which keys a scene file has, and in which dimension.

use crate::rig;
use crate::scene::{Cuboid, Scene};
use nalgebra::Vector3;
use vehicles::VehicleError;
use vehicles::reader::{Document, Section};
use vehicles::units::{ANGLE, LENGTH};

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
    let centre = section.vector("centre", LENGTH)?;
    let size = section.vector("size", LENGTH)?;
    let yaw_rad = if section.has("yaw") { section.quantity("yaw", ANGLE)?.si } else { 0.0 };
    section.finish()?;
    if size.iter().any(|length_m| *length_m <= 0.0) {
        let found = format!("{size:?} m");
        return Err(section.doc.bad(&section.at, &section.key("size"), "three lengths above 0", found));
    }
    Ok(Cuboid { name, centre_W_m: centre.into(), half_extents_m: Vector3::from(size) / 2.0, yaw_rad })
}
