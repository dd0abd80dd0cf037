//! Keys of a scene file, and their dimensions.
#![allow(non_snake_case, reason = "a trailing _W names the frame a vector is written in")]

use crate::body::{self, Keys};
use crate::joint::{self, End};
use crate::mesh::{Mesh, Solidity};
use crate::mesh_file::Format;
use crate::rig::{self, PLACE};
use crate::scene::{Ball, Cuboid, Scene};
use crate::surface::Surface;
use crate::triangles::Triangles;
use diagnostics::parameter::Bounds;
use diagnostics::unit::{ANGLE, LENGTH, RATIO};
use diagnostics::{Diagnostic, Faults};
use inputs::{FileKind, FileRole, InputFiles};
use nalgebra::{Rotation3, Vector3};
use std::io::Result as IoResult;
use std::path::{Path, PathBuf};
use vehicles::reader::{Document, Section};

/// Scene files, for parameters that name one.
pub const FILE: FileKind = FileKind { others: Scene::mesh_files, ..FileKind::of(FileRole::Model) };

/// Lengths of a box.
const SIZE: Bounds = Bounds {
    min: 1e-4,
    max: 1e6,
    unit: "m",
    why: "three lengths above 0: nothing that a vehicle meets is thinner, and beyond 1000 km the ground is not flat",
};

/// Ten turns.
const YAW: Bounds = Bounds { min: -63.0, max: 63.0, unit: "rad", why: "ten turns, in case of a wrong unit" };

/// Length of a unit of a mesh file.
const SCALE: Bounds = Bounds {
    min: 1e-6,
    max: 1e3,
    unit: "m",
    why: "a unit of a mesh file is a micrometre at least and a kilometre at most",
};

/// Longest sides of meshes: a nut is longer, and a mountain range is not.
const MESH_SIZE_M: std::ops::RangeInclusive<f64> = 1e-3..=1e4;

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

/// The most free bodies of a scene: as many as a sample of their poses holds.
pub const BODIES_MAX: usize = 16;

/// A ball of a scene.
const RADIUS: Bounds =
    Bounds { min: 1e-4, max: 1e3, unit: "m", why: "above 0: nothing that a vehicle meets is thinner" };

/// Beyond these numbers of things a contact's number would be that of another vehicle.
const THINGS_MAX: usize = 900;

impl Scene {
    /// Reads and checks a scene file, and the meshes that it names, from the disk.
    ///
    /// # Errors
    /// The fault of the file, and its place.
    pub fn load(path: &Path) -> Result<Self, Diagnostic> {
        Self::load_from(&InputFiles::default(), path)
    }

    /// Reads and checks a scene file of `files`, and the meshes that it names: a component takes those of its context.
    ///
    /// # Errors
    /// The error in the file or a mesh, with its place.
    pub fn load_from(files: &InputFiles, path: &Path) -> Result<Self, Diagnostic> {
        let file = path.display().to_string();
        match files.text(path) {
            Ok(text) => Self::parse_with(&text, &file, &|path| Ok(files.bytes(path)?.to_vec())),
            Err(cause) => Err(Diagnostic::unreadable(file, &cause)),
        }
    }

    /// Reads and checks the text of a scene file, whose layout `scenes/room.toml` shows. `file_name` is for messages, and
    /// meshes are looked for beside it.
    ///
    /// # Errors
    /// The fault of the text or a mesh, and its place.
    pub fn parse(text: &str, file_name: &str) -> Result<Self, Diagnostic> {
        Self::parse_with(text, file_name, &inputs::read_bytes)
    }

    /// As [`Scene::parse`], with the bytes of its meshes from `read`, which gets their paths.
    ///
    /// # Errors
    /// The fault of the text or a mesh, and its place.
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
        let boxes = faults.keep(each(&root, "boxes", |section| one_box(section, &surface)));
        let folder = Path::new(file_name).parent().unwrap_or(Path::new(""));
        let meshes = faults.keep(each(&root, "meshes", |section| one_mesh(section, &surface, folder, read)));
        let balls = faults.keep(each(&root, "balls", |section| one_ball(section, &surface)));
        let rig = root.has("rig").then(|| faults.keep(root.section("rig").and_then(|rig| rig::parse(&rig))));
        let effects = faults.keep(vehicles::effects::read(&root));
        let joints = faults.keep(root.sections_if_any("joints")).unwrap_or_default();
        faults.keep(root.finish());
        let things = name.zip(boxes).zip(meshes).zip(balls).zip(effects);
        let rig = rig.flatten();
        let scene = things.map(|((((name, boxes), meshes), balls), effects)| Self {
            name,
            boxes,
            meshes,
            balls,
            rig,
            effects,
            surface,
            joints: Vec::new(),
        });
        // Joints name bodies: what is wrong with those comes first.
        let mut scene = faults.finish(scene)?;
        check_numbers(&doc, &scene)?;
        scene.tie(&doc, &joints)?;
        Ok(scene)
    }

    /// Reads the tables of `[[joints]]`, once all bodies are known.
    fn tie(&mut self, doc: &Document, sections: &[Section]) -> Result<(), Diagnostic> {
        let names: Vec<&str> = self.bodies().filter_map(|(number, _)| self.name_of(number)).collect();
        let joints = sections.iter().map(|section| joint::parse(section, &names));
        self.joints = Diagnostic::gather(joints)?;
        let mut faults = Faults::default();
        for (place, (joint, section)) in self.joints.iter().zip(sections).enumerate() {
            if self.joints[..place].iter().any(|before| before.name == joint.name) {
                let (expected, found) = ("a name of its own", format!("a second \"{}\"", joint.name));
                let at = section.at_of("name");
                faults.keep(Err::<(), _>(doc.bad(&at, &section.key("name"), expected, found)));
            }
        }
        if let Some(section) = self.joint_that_pins_the_vehicle().map(|place| &sections[place]) {
            let expected = "a rope, where the world and the vehicle are tied together; a [rig] holds a vehicle otherwise";
            let found = "another: its child is the vehicle, or hangs from it by other joints";
            let at = section.at_of("kind");
            faults.keep(Err::<(), _>(doc.bad(&at, &section.key("kind"), expected, found)));
        }
        let tying = self.joints.iter().position(|joint| [joint.parent, joint.child].contains(&End::Vehicle));
        if let Some(first) = tying.filter(|_| self.rig.is_some()).map(|place| &sections[place]) {
            let (expected, found) = ("a [rig] or joints to the vehicle", "both");
            faults.keep(Err::<(), _>(doc.bad(&first.at, &first.path, expected, found)));
        }
        faults.finish(Some(()))
    }

    /// The mesh files that the scene file at `path` names; its faults are reported where it is read.
    #[must_use]
    pub fn mesh_files(files: &InputFiles, path: &Path) -> Vec<PathBuf> {
        let table = files.text(path).ok().and_then(|text| text.parse::<toml::Table>().ok());
        let meshes = table.as_ref().and_then(|table| table.get("meshes")?.as_array());
        let folder = path.parent().unwrap_or(Path::new(""));
        let names = meshes.into_iter().flatten().filter_map(|mesh| mesh.get("file")?.as_str());
        names.map(|name| folder.join(name)).collect()
    }
}

/// The tables of the array `name`, as `one` reads them.
fn each<T>(
    root: &Section,
    name: &'static str,
    one: impl Fn(&Section) -> Result<T, Diagnostic>,
) -> Result<Vec<T>, Diagnostic> {
    Diagnostic::gather(root.sections_if_any(name)?.iter().map(one))
}

/// Refuses more things or free bodies than there are numbers for, and two bodies of one name.
fn check_numbers(doc: &Document, scene: &Scene) -> Result<(), Diagnostic> {
    let mut faults = Faults::default();
    let mut refuse = |key: &str, expected: String, found: String| {
        faults.keep(Err::<(), _>(doc.bad(&(0..0), key, expected, found)));
    };
    let (things, bodies) = (scene.thing_count(), scene.bodies().count());
    if things > THINGS_MAX {
        let expected = format!("at most {THINGS_MAX}, with meshes and balls");
        refuse("boxes", expected, format!("{things} boxes, meshes and balls"));
    }
    if bodies > BODIES_MAX {
        let expected = format!("a key of at most {BODIES_MAX} things");
        refuse("mass", expected, format!("{bodies} free bodies"));
    }
    let mut names: Vec<_> = scene.bodies().filter_map(|(number, _)| scene.name_of(number)).collect();
    names.sort_unstable();
    for of_one in names.chunk_by(|name, next| name == next) {
        let name = of_one[0];
        if ["world", "vehicle"].contains(&name) {
            let expected = "another: joints mean something else by it".to_owned();
            refuse("name", expected, format!("\"{name}\""));
        } else if of_one.len() > 1 {
            refuse("name", "one of its own for each free body".to_owned(), format!("two \"{name}\""));
        }
    }
    faults.finish(Some(()))
}

fn one_mesh(
    section: &Section,
    surface_around: &Surface,
    folder: &Path,
    read: &dyn Fn(&Path) -> IoResult<Vec<u8>>,
) -> Result<Mesh, Diagnostic> {
    let known = section.require_known(
        &[&["name", "file", "position", "yaw", "scale", "solid"], &SURFACE[..], &body::KEYS].concat(),
    );
    let mut faults = Faults::default();
    let name = faults.keep(section.text("name"));
    let file = faults.keep(section.text("file")).map(|file| folder.join(file));
    let triangles = file.as_deref().and_then(|file| faults.keep(triangles_of(section, file, read)));
    let place_W_m = faults.keep(section.vector("position", LENGTH, &PLACE));
    let yaw_rad = faults.keep(yaw(section));
    let scale_m = faults.keep(scale(section, file.as_deref()));
    let solidity = faults
        .keep(section.choice("solid", &[("triangles", Solidity::Triangles), ("convex", Solidity::Convex)]));
    let surface = faults.keep(surface(section, surface_around));
    let keys = faults.keep(Keys::read(section));
    faults.keep(known.and_then(|()| section.finish()));
    if matches!((&keys, solidity), (Some(Some(_)), Some(Solidity::Triangles))) {
        let expected = "\"convex\" of what has a `mass`: a shell has no inside that could weigh";
        let (at, key) = (section.at_of("solid"), section.key("solid"));
        faults.keep(Err::<(), _>(section.doc.bad(&at, &key, expected, "\"triangles\"")));
    }
    let all = || Some((name?, file?, triangles?, place_W_m?, yaw_rad?, scale_m?, solidity?, surface?, keys?));
    let (name, file, triangles, place_W_m, yaw_rad, scale_m, solidity, surface, keys) =
        faults.finish(all())?;
    let refused = |found: String| refused_mesh(section, &file, &found);
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), yaw_rad);
    let placed =
        |corner: [f64; 3]| (turn * Vector3::from(corner) * scale_m + Vector3::from(place_W_m)).into();
    let corners_W_m = triangles.corners.into_iter().map(placed).collect();
    let (name, faces) = (name.to_owned(), triangles.faces);
    let mesh = Mesh { name, file: file.clone(), corners_W_m, faces, solidity, surface, body: None };
    let mut mesh = mesh.without_lines();
    mesh.shape().map_err(refused)?;
    check_size(&mesh, scale_m).map_err(refused)?;
    mesh.body = keys.map(|keys| {
        let (centre_W_m, spread_m2) = body::solid_moments(&mesh.corners_W_m, &mesh.faces);
        // Along the file's axes, which are turned.
        keys.body(turn.transpose() * spread_m2 * turn, centre_W_m, yaw_rad)
    });
    Ok(mesh)
}

/// The triangles in the mesh `file` of `section`.
fn triangles_of(
    section: &Section,
    file: &Path,
    read: &dyn Fn(&Path) -> IoResult<Vec<u8>>,
) -> Result<Triangles, Diagnostic> {
    let refused = |found: String| refused_mesh(section, file, &found);
    let format =
        Format::of(file).ok_or_else(|| refused("a name that ends in none of .obj, .stl, .glb".to_owned()))?;
    let bytes = read(file).map_err(|error| refused(error.to_string()))?;
    format.read(&bytes).map_err(refused)
}

/// The error of the mesh `file` of `section`.
fn refused_mesh(section: &Section, file: &Path, found: &str) -> Diagnostic {
    let expected = "a mesh file, relative to this one";
    let found = format!("{}: {found}", file.display());
    section.doc.bad(&section.at_of("file"), &section.key("file"), expected, found)
}

/// Length of a unit of the mesh `file`: a glTF file is in metres unless the scene says otherwise.
fn scale(section: &Section, file: Option<&Path>) -> Result<f64, Diagnostic> {
    let is_in_metres = file.and_then(Format::of).is_none_or(|format| format == Format::Glb);
    if is_in_metres && !section.has("scale") { Ok(1.0) } else { section.bounded("scale", LENGTH, &SCALE) }
}

fn yaw(section: &Section) -> Result<f64, Diagnostic> {
    if section.has("yaw") { section.bounded("yaw", ANGLE, &YAW) } else { Ok(0.0) }
}

/// Refuses a mesh of a size that nothing has.
fn check_size(mesh: &Mesh, scale_m: f64) -> Result<(), String> {
    let [low, high] = mesh.extent_W_m();
    let size_m = (0..3).map(|axis| high[axis] - low[axis]).fold(0.0, f64::max);
    if MESH_SIZE_M.contains(&size_m) {
        return Ok(());
    }
    let (min, max) = (MESH_SIZE_M.start(), MESH_SIZE_M.end());
    Err(format!(
        "its longest side is {size_m:e} m with a unit of {scale_m} m, expected {min} m to {max} m; set `scale` to the \
         length of the unit of the mesh"
    ))
}

/// Keys of a surface.
const SURFACE: [&str; 2] = ["friction", "restitution"];

/// Reads the surface of `section`; keys that it does not have are those of `otherwise`.
fn surface(section: &Section, otherwise: &Surface) -> Result<Surface, Diagnostic> {
    let number = |name, bounds, otherwise| {
        if section.has(name) { section.bounded(name, RATIO, bounds) } else { Ok(otherwise) }
    };
    let mut faults = Faults::default();
    let friction = faults.keep(number("friction", &FRICTION, otherwise.friction));
    let restitution = faults.keep(number("restitution", &RESTITUTION, otherwise.restitution));
    faults.finish((|| Some(Surface { friction: friction?, restitution: restitution? }))())
}

fn one_box(section: &Section, surface_around: &Surface) -> Result<Cuboid, Diagnostic> {
    let known =
        section.require_known(&[&["name", "centre", "size", "yaw"], &SURFACE[..], &body::KEYS].concat());
    let mut faults = Faults::default();
    let name = faults.keep(section.text("name"));
    let centre = faults.keep(section.vector("centre", LENGTH, &PLACE));
    let size = faults.keep(section.vector("size", LENGTH, &SIZE));
    let yaw_rad = faults.keep(yaw(section));
    let surface = faults.keep(surface(section, surface_around));
    let keys = faults.keep(Keys::read(section));
    faults.keep(known.and_then(|()| section.finish()));
    let all = || Some((name?, centre?, size?, yaw_rad?, surface?, keys?));
    let (name, centre, size, yaw_rad, surface, keys) = faults.finish(all())?;
    let (centre_W_m, half_extents_m) = (Vector3::from(centre), Vector3::from(size) / 2.0);
    let body = keys.map(|keys| keys.body(body::box_inertia_m2(&half_extents_m), centre_W_m, yaw_rad));
    Ok(Cuboid { name: name.to_owned(), centre_W_m, half_extents_m, yaw_rad, surface, body })
}

fn one_ball(section: &Section, surface_around: &Surface) -> Result<Ball, Diagnostic> {
    let known = section.require_known(&[&["name", "centre", "radius"], &SURFACE[..], &body::KEYS].concat());
    let mut faults = Faults::default();
    let name = faults.keep(section.text("name"));
    let centre = faults.keep(section.vector("centre", LENGTH, &PLACE));
    let radius_m = faults.keep(section.bounded("radius", LENGTH, &RADIUS));
    let surface = faults.keep(surface(section, surface_around));
    let keys = faults.keep(Keys::read(section));
    faults.keep(known.and_then(|()| section.finish()));
    let all = || Some((name?, centre?, radius_m?, surface?, keys?));
    let (name, centre, radius_m, surface, keys) = faults.finish(all())?;
    let centre_W_m = Vector3::from(centre);
    let body = keys.map(|keys| keys.body(body::ball_inertia_m2(radius_m), centre_W_m, 0.0));
    Ok(Ball { name: name.to_owned(), centre_W_m, radius_m, surface, body })
}
