//! Which keys a scene file has, and in which dimension.

use crate::rig::{self, PLACE};
use crate::scene::{Cuboid, Scene};
use diagnostics::parameter::Bounds;
use diagnostics::unit::{ANGLE, LENGTH};
use diagnostics::{Diagnostic, Faults};
use nalgebra::Vector3;
use std::path::Path;
use vehicles::reader::{Document, Section};

/// Lengths of a box.
const SIZE: Bounds = Bounds {
    min: 1e-4,
    max: 1e6,
    unit: "m",
    why: "three lengths above 0: contacts are resolved to 0.1 mm, and beyond 1000 km the ground is not flat",
};

/// Ten turns.
const YAW: Bounds = Bounds { min: -63.0, max: 63.0, unit: "rad", why: "ten turns, in case of a wrong unit" };

impl Scene {
    /// Reads and checks a scene file.
    ///
    /// # Errors
    /// What is wrong with the file, and where.
    pub fn load(path: &Path) -> Result<Self, Diagnostic> {
        let file = path.display().to_string();
        match vehicles::text::read(path) {
            Ok(text) => Self::parse(&text, &file),
            Err(cause) => Err(Diagnostic::unreadable(file, &cause)),
        }
    }

    /// Reads and checks the text of a scene file, whose layout `scenes/room.toml` shows; `file_name` is for messages only.
    ///
    /// # Errors
    /// What is wrong with the text, and where.
    pub fn parse(text: &str, file_name: &str) -> Result<Self, Diagnostic> {
        let doc = Document::new(file_name, text);
        let tree = doc.tree()?;
        let root = Section::new(&doc, String::new(), 0..0, tree.get_ref());
        let mut faults = Faults::default();
        let name = faults.keep(root.text("name").map(str::to_owned));
        let sections = root.sections_if_any("boxes")?;
        let boxes = faults.keep(Diagnostic::gather(sections.iter().map(one_box)));
        let rig = root.has("rig").then(|| faults.keep(root.section("rig").and_then(|rig| rig::parse(&rig))));
        let effects = faults.keep(vehicles::effects::read(&root));
        faults.keep(root.finish());
        let scene = name.zip(boxes).zip(effects);
        let rig = rig.flatten();
        faults.finish(scene.map(|((name, boxes), effects)| Self { name, boxes, rig, effects }))
    }
}

fn one_box(section: &Section) -> Result<Cuboid, Diagnostic> {
    let name = section.text("name")?.to_owned();
    let centre = section.vector("centre", LENGTH, &PLACE)?;
    let size = section.vector("size", LENGTH, &SIZE)?;
    let yaw_rad = if section.has("yaw") { section.bounded("yaw", ANGLE, &YAW)? } else { 0.0 };
    section.finish()?;
    Ok(Cuboid { name, centre_W_m: centre.into(), half_extents_m: Vector3::from(size) / 2.0, yaw_rad })
}
