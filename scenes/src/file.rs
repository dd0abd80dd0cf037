//! Which keys a scene file has, and in which dimension.
#![allow(non_snake_case, reason = "a trailing _W names the frame a vector is written in")]

use crate::mesh::{Mesh, Solidity};
use crate::mesh_file::Format;
use crate::rig::{self, PLACE};
use crate::scene::{Cuboid, Scene};
use crate::surface::Surface;
use diagnostics::parameter::Bounds;
use diagnostics::unit::{ANGLE, LENGTH, RATIO};
use diagnostics::{Diagnostic, Faults};
use nalgebra::{Rotation3, Vector3};
use std::io::Result as IoResult;
use std::path::{Path, PathBuf};
use vehicles::reader::{Document, Section};

/// Lengths of a box.
const SIZE: Bounds = Bounds {
    min: 1e-4,
    max: 1e6,
    unit: "m",
    why: "three lengths above 0: nothing that a vehicle meets is thinner, and beyond 1000 km the ground is not flat",
};

/// Ten turns.
const YAW: Bounds = Bounds { min: -63.0, max: 63.0, unit: "rad", why: "ten turns, in case of a wrong unit" };

/// How long a unit of a mesh file is.
const SCALE: Bounds = Bounds {
    min: 1e-6,
    max: 1e3,
    unit: "m",
    why: "a unit of a mesh file is a micrometre at least and a kilometre at most",
};

/// Coulomb's coefficient.
const FRICTION: Bounds = Bounds {
    min: 0.0,
    max: 10.0,
    unit: "",
    why: "a coefficient of friction: 0 is ice without friction, rubber on concrete about 1",
};

/// Newton's coefficient.
const RESTITUTION: Bounds = Bounds {
    min: 0.0,
    max: 1.0,
    unit: "",
    why: "the fraction of the speed of approach that a bounce leaves: 0 leaves none, 1 all of it",
};

/// Beyond these numbers of things a contact's number would be that of another vehicle.
const THINGS_MAX: usize = 900;

impl Scene {
    /// Reads and checks a scene file, and the meshes that it names.
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

    /// Reads and checks the text of a scene file, whose layout `scenes/room.toml` shows. `file_name` is for messages, and
    /// meshes are looked for beside it.
    ///
    /// # Errors
    /// What is wrong with the text or a mesh, and where.
    pub fn parse(text: &str, file_name: &str) -> Result<Self, Diagnostic> {
        Self::parse_with(text, file_name, &|path| vehicles::text::read_log(path))
    }

    /// As [`Scene::parse`], with the bytes of its meshes from `read`, which gets their paths.
    ///
    /// # Errors
    /// What is wrong with the text or a mesh, and where.
    pub fn parse_with(
        text: &str,
        file_name: &str,
        read: &dyn Fn(&Path) -> IoResult<Vec<u8>>,
    ) -> Result<Self, Diagnostic> {
        let doc = Document::new(file_name, text);
        let tree = doc.tree()?;
        let root = Section::new(&doc, String::new(), 0..0, tree.get_ref());
        let mut faults = Faults::default();
        let name = faults.keep(root.text("name").map(str::to_owned));
        let surface = faults.keep(surface(&root, &Surface::default())).unwrap_or_default();
        let sections = root.sections_if_any("boxes")?;
        let boxes = sections.iter().map(|section| one_box(section, &surface));
        let boxes = faults.keep(Diagnostic::gather(boxes));
        let sections = root.sections_if_any("meshes")?;
        let folder = Path::new(file_name).parent().unwrap_or(Path::new(""));
        let meshes = sections.iter().map(|section| one_mesh(section, &surface, folder, read));
        let meshes = faults.keep(Diagnostic::gather(meshes));
        let rig = root.has("rig").then(|| faults.keep(root.section("rig").and_then(|rig| rig::parse(&rig))));
        let effects = faults.keep(vehicles::effects::read(&root));
        faults.keep(root.finish());
        let scene = name.zip(boxes).zip(meshes).zip(effects);
        let rig = rig.flatten();
        let scene = scene.map(|(((name, boxes), meshes), effects)| Self {
            name,
            boxes,
            meshes,
            rig,
            effects,
            surface,
        });
        if let Some(scene) = scene.as_ref().filter(|scene| scene.thing_count() > THINGS_MAX) {
            let found = format!("{} boxes and meshes", scene.thing_count());
            return Err(doc.bad(&(0..0), "boxes", format!("at most {THINGS_MAX} of both together"), found));
        }
        faults.finish(scene)
    }

    /// The mesh files that the scene file at `path` names; what is wrong with it is told where it is read.
    #[must_use]
    pub fn mesh_files(path: &Path) -> Vec<PathBuf> {
        let table = vehicles::text::read(path).ok().and_then(|text| text.parse::<toml::Table>().ok());
        let meshes = table.as_ref().and_then(|table| table.get("meshes")?.as_array());
        let folder = path.parent().unwrap_or(Path::new(""));
        let files = meshes.into_iter().flatten().filter_map(|mesh| mesh.get("file")?.as_str());
        files.map(|file| folder.join(file)).collect()
    }
}

fn one_mesh(
    section: &Section,
    surface_around: &Surface,
    folder: &Path,
    read: &dyn Fn(&Path) -> IoResult<Vec<u8>>,
) -> Result<Mesh, Diagnostic> {
    let name = section.text("name")?.to_owned();
    let file = folder.join(section.text("file")?);
    let refused = |found: String| {
        let found = format!("{}: {found}", file.display());
        section.doc.bad(
            &section.at_of("file"),
            &section.key("file"),
            "a mesh file, relative to this one",
            found,
        )
    };
    let format = Format::of(&file)
        .ok_or_else(|| refused("a name that ends in none of .obj, .stl, .glb".to_owned()))?;
    let place_W_m = section.vector("position", LENGTH, &PLACE)?;
    let yaw_rad = if section.has("yaw") { section.bounded("yaw", ANGLE, &YAW)? } else { 0.0 };
    let is_in_metres = format == Format::Glb && !section.has("scale");
    let scale_m = if is_in_metres { 1.0 } else { section.bounded("scale", LENGTH, &SCALE)? };
    let solidity =
        section.choice("solid", &[("triangles", Solidity::Triangles), ("convex", Solidity::Convex)])?;
    let surface = surface(section, surface_around)?;
    section.finish()?;
    let bytes = read(&file).map_err(|error| refused(error.to_string()))?;
    let triangles = format.read(&bytes).map_err(refused)?;
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), yaw_rad);
    let placed =
        |corner: [f64; 3]| (turn * Vector3::from(corner) * scale_m + Vector3::from(place_W_m)).into();
    let corners_W_m = triangles.corners.into_iter().map(placed).collect();
    let mesh = Mesh { name, file: file.clone(), corners_W_m, faces: triangles.faces, solidity, surface }
        .without_lines();
    mesh.shape().map(|_| mesh).map_err(refused)
}

/// What `section` says of its surface, and what `otherwise` says where it is silent.
fn surface(section: &Section, otherwise: &Surface) -> Result<Surface, Diagnostic> {
    let number = |name, bounds, otherwise| {
        if section.has(name) { section.bounded(name, RATIO, bounds) } else { Ok(otherwise) }
    };
    // Both are read before either is refused: one that was not read would be told as unknown.
    let friction = number("friction", &FRICTION, otherwise.friction);
    let restitution = number("restitution", &RESTITUTION, otherwise.restitution);
    Ok(Surface { friction: friction?, restitution: restitution? })
}

fn one_box(section: &Section, surface_around: &Surface) -> Result<Cuboid, Diagnostic> {
    let name = section.text("name")?.to_owned();
    let centre = section.vector("centre", LENGTH, &PLACE)?;
    let size = section.vector("size", LENGTH, &SIZE)?;
    let yaw_rad = if section.has("yaw") { section.bounded("yaw", ANGLE, &YAW)? } else { 0.0 };
    let surface = surface(section, surface_around)?;
    section.finish()?;
    let half_extents_m = Vector3::from(size) / 2.0;
    Ok(Cuboid { name, centre_W_m: centre.into(), half_extents_m, yaw_rad, surface })
}
