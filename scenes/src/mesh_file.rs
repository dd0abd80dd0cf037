//! Triangles of a file: Wavefront OBJ, STL and binary glTF.
//!
//! OBJ and STL say neither their unit nor which axis is up: their numbers are taken as they are, and the scene file's
//! `scale` says how long one of them is. glTF is in metres with y up and x to the left of what looks along z (glTF 2.0
//! specification, section 3.4): it is turned so that z is up and x is kept.

use gltf::mesh::Mode;
use nalgebra::{Matrix4, Point3};
use std::path::Path;

/// A scene file draws furniture, not a film: enough for a building, and a bound on memory.
pub(crate) const TRIANGLES_MAX: usize = 200_000;

/// Corners, in the file's unit with z up, and triangles as numbers of corners, counter-clockwise from outside.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Triangles {
    pub(crate) corners: Vec<[f64; 3]>,
    pub(crate) faces: Vec<[u32; 3]>,
}

/// What a mesh file may be, by the end of its name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Format {
    Obj,
    Stl,
    Glb,
}

impl Format {
    /// The format of the file at `path`.
    pub(crate) fn of(path: &Path) -> Option<Self> {
        let end = path.extension()?.to_str()?.to_ascii_lowercase();
        match &*end {
            "obj" => Some(Self::Obj),
            "stl" => Some(Self::Stl),
            "glb" => Some(Self::Glb),
            _ => None,
        }
    }

    /// The triangles that `bytes` hold.
    ///
    /// # Errors
    /// In words: what is wrong with the bytes.
    pub(crate) fn read(self, bytes: &[u8]) -> Result<Triangles, String> {
        let triangles = match self {
            Self::Obj => of_loaded(&mesh_loader::obj::from_slice(bytes, None, no_material)),
            Self::Stl => of_loaded(&mesh_loader::stl::from_slice(bytes)),
            Self::Glb => of_glb(bytes),
        }?;
        triangles.checked()
    }
}

/// Materials are colours, and what they are called need not be there.
fn no_material(_: &Path) -> std::io::Result<Vec<u8>> {
    Ok(Vec::new())
}

fn of_loaded(loaded: &std::io::Result<mesh_loader::Scene>) -> Result<Triangles, String> {
    let scene = loaded.as_ref().map_err(ToString::to_string)?;
    let mut triangles = Triangles::default();
    for mesh in &scene.meshes {
        triangles.add(mesh.vertices.iter().map(|corner| corner.map(f64::from)), &mesh.faces)?;
    }
    Ok(triangles)
}

fn of_glb(bytes: &[u8]) -> Result<Triangles, String> {
    let file = gltf::Gltf::from_slice(bytes).map_err(|error| error.to_string())?;
    let scene = file.default_scene().or_else(|| file.scenes().next()).ok_or("it holds no scene")?;
    let mut triangles = Triangles::default();
    let y_up_to_z_up = Matrix4::new(1., 0., 0., 0., 0., 0., -1., 0., 0., 1., 0., 0., 0., 0., 0., 1.);
    let mut nodes: Vec<_> = scene.nodes().map(|node| (node, y_up_to_z_up)).collect();
    while let Some((node, above)) = nodes.pop() {
        let place = above * Matrix4::from(node.transform().matrix()).map(f64::from);
        for primitive in node.mesh().iter().flat_map(gltf::Mesh::primitives) {
            triangles.add_primitive(&primitive, &place, file.blob.as_deref())?;
        }
        nodes.extend(node.children().map(|child| (child, place)));
    }
    Ok(triangles)
}

impl Triangles {
    fn add_primitive(
        &mut self,
        primitive: &gltf::Primitive<'_>,
        place: &Matrix4<f64>,
        blob: Option<&[u8]>,
    ) -> Result<(), String> {
        if primitive.mode() != Mode::Triangles {
            return Err(format!("it holds {:?} where triangles are expected", primitive.mode()));
        }
        let reader = primitive.reader(|buffer| match buffer.source() {
            gltf::buffer::Source::Bin => blob,
            gltf::buffer::Source::Uri(_) => None,
        });
        let corners =
            reader.read_positions().ok_or("it keeps its corners in another file: export one .glb")?;
        let corners: Vec<[f64; 3]> = corners
            .map(|corner| place.transform_point(&Point3::from(corner.map(f64::from))).coords.into())
            .collect();
        let numbers: Vec<u32> = match reader.read_indices() {
            Some(numbers) => numbers.into_u32().collect(),
            None => (0..u32::try_from(corners.len()).unwrap_or(u32::MAX)).collect(),
        };
        let (faces, rest) = numbers.as_chunks::<3>();
        if rest.is_empty() {
            self.add(corners, faces)
        } else {
            Err("a triangle has fewer than three corners".to_owned())
        }
    }

    fn add(&mut self, corners: impl IntoIterator<Item = [f64; 3]>, faces: &[[u32; 3]]) -> Result<(), String> {
        let first = u32::try_from(self.corners.len()).map_err(|_| "it has more than 2^32 corners")?;
        self.corners.extend(corners);
        self.faces.extend(faces.iter().map(|face| face.map(|corner| corner.saturating_add(first))));
        Ok(())
    }

    fn checked(self) -> Result<Self, String> {
        if self.faces.is_empty() {
            return Err("it holds no triangle".to_owned());
        }
        if self.faces.len() > TRIANGLES_MAX {
            return Err(format!(
                "it holds {} triangles, and at most {TRIANGLES_MAX} are read",
                self.faces.len()
            ));
        }
        if !self.corners.iter().flatten().all(|number| number.is_finite()) {
            return Err("a corner has a coordinate that is no finite number".to_owned());
        }
        let is_known = |corner: &u32| (*corner as usize) < self.corners.len();
        if self.faces.iter().flatten().all(is_known) {
            Ok(self)
        } else {
            Err(format!("a triangle names a corner beyond its {}", self.corners.len()))
        }
    }
}
