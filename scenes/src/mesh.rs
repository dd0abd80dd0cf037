//! Things of any shape: triangles in the world, for rays and for contacts with vehicles.
#![allow(non_snake_case, reason = "a trailing _W names the frame a vector is written in")]

use crate::body::FreeBody;
use crate::surface::Surface;
use parry3d_f64::math::Vector;
use parry3d_f64::shape::{SharedShape, TriMesh, TriMeshFlags};
use std::collections::BTreeMap;
use std::fmt;
use std::path::PathBuf;

/// Two triangles that meet at less than this are one face to the eye: 10 degrees; tuned, no source.
const SMOOTH_RAD: f64 = 0.17;

/// Part of a body's extent below which a length is rounding: that of a file of single precision is 1e-7.
const FLAT: f64 = 1e-6;

/// Each triangle of a convex mesh is held against each corner.
const CONVEX_MAX: usize = 2000;

/// Longest sides of meshes that are usual, in m: a nut to a stadium. Beyond it the unit of the file is in doubt; tuned, no source.
const USUAL_M: std::ops::RangeInclusive<f64> = 0.01..=200.0;

/// A triangle less high than this, over its longest side, is a line: as far as rounding goes.
const LINE_MAX: f64 = 1e-9;

/// Solid part of a mesh.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Solidity {
    /// The triangles themselves, a shell without thickness: walls, rooms, hollow things.
    Triangles,
    /// The volume that the triangles enclose, which is to be convex. Faster, and nothing gets inside.
    Convex,
}

/// A thing made of triangles.
#[derive(Debug, Clone, PartialEq)]
pub struct Mesh {
    /// Its name in the scene file, such as `desk`.
    pub name: String,
    /// The file that the triangles come from.
    pub file: PathBuf,
    /// Its corners, in the world.
    pub corners_W_m: Vec<[f64; 3]>,
    /// Its triangles, as numbers of corners, counter-clockwise from outside.
    pub faces: Vec<[u32; 3]>,
    /// Its solid part.
    pub solidity: Solidity,
    /// Friction and restitution of its surface.
    pub surface: Surface,
    /// Its mass and motion; nothing where it stands still.
    pub body: Option<FreeBody>,
}

impl Mesh {
    /// The shape, in the world, for rays and distances.
    ///
    /// # Errors
    /// In words, where no such shape can be made: every triangle is a line, or a mesh that is to be convex is not.
    pub fn shape(&self) -> Result<SharedShape, String> {
        self.shape_with(TriMeshFlags::empty())
    }

    /// The shape, in the world, for contacts with vehicles: a body that slides over the edge between two
    /// triangles of one face does not catch there.
    ///
    /// # Errors
    /// As [`Mesh::shape`].
    pub fn contact_shape(&self) -> Result<SharedShape, String> {
        self.shape_with(TriMeshFlags::FIX_INTERNAL_EDGES_TWO_SIDED)
    }

    fn shape_with(&self, flags: TriMeshFlags) -> Result<SharedShape, String> {
        if self.faces.is_empty() {
            return Err("each of its triangles is a line".to_owned());
        }
        if self.solidity == Solidity::Convex {
            return self.convex();
        }
        let flags =
            flags | TriMeshFlags::DELETE_DEGENERATE_TRIANGLES | TriMeshFlags::DELETE_DUPLICATE_TRIANGLES;
        let corners = self.corners_W_m.iter().map(|&corner| Vector::from(corner)).collect();
        let mesh = TriMesh::with_flags(corners, self.faces.clone(), flags);
        mesh.map(SharedShape::new).map_err(|error| error.to_string())
    }

    /// The convex body that the triangles enclose.
    fn convex(&self) -> Result<SharedShape, String> {
        let count = self.faces.len();
        if count > CONVEX_MAX {
            return Err(format!("it has {count} triangles, and a convex mesh at most {CONVEX_MAX}"));
        }
        let (corners, faces) = self.welded();
        let [x, y, z] = outermost(&corners);
        let tolerance_m = FLAT * (x + y + z);
        for face in &faces {
            let [a, b, c] = face.map(|corner| corners[corner as usize]);
            let normal = (b - a).cross(c - a).normalize();
            let above_m = |corner: &Vector| normal.dot(*corner - a);
            if let Some(outside) = corners.iter().find(|corner| above_m(corner) > tolerance_m) {
                return Err(format!(
                    "it is not convex: the corner at {outside:.3} is {:.4} m outside of one of its triangles; take \
                     \"triangles\", or export its convex hull",
                    above_m(outside)
                ));
            }
        }
        // Cones from the first corner: parry's own volume comes with principal axes, and they with a `cos`.
        let from_first = |corner: u32| corners[corner as usize] - corners[0];
        let cones = faces.iter().map(|face| face.map(from_first)).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0);
        let volume_m3: f64 = cones.sum();
        SharedShape::convex_mesh(corners, &faces)
            .filter(|_| volume_m3 > FLAT * x.max(y).max(z).powi(3))
            .ok_or_else(|| "it is flat or open: a convex mesh is closed and has an inside".to_owned())
    }

    /// Corners and triangles in which each place is one corner, as STL does not have it.
    fn welded(&self) -> (Vec<Vector>, Vec<[u32; 3]>) {
        let mut numbers = BTreeMap::new();
        let mut corners = Vec::new();
        let mut number = |corner: u32| {
            // Of the two zeros one.
            let place = self.corners_W_m[corner as usize].map(|number| number + 0.0);
            *numbers.entry(place.map(f64::to_bits)).or_insert_with(|| {
                corners.push(Vector::from(place));
                corners.len() as u32 - 1
            })
        };
        let faces = self.faces.iter().map(|face| face.map(&mut number)).collect();
        (corners, faces)
    }

    /// The lowest and the highest coordinates of its corners, in the world.
    #[must_use]
    pub fn extent_W_m(&self) -> [[f64; 3]; 2] {
        let used = || self.faces.iter().flatten().map(|&corner| self.corners_W_m[corner as usize]);
        let along = |bound: fn(f64, f64) -> f64, from: f64| {
            [0, 1, 2].map(|axis| used().map(|corner| corner[axis]).fold(from, bound))
        };
        [along(f64::min, f64::INFINITY), along(f64::max, f64::NEG_INFINITY)]
    }

    /// Reason to doubt the unit of its file, in words: beside vehicles and rooms it is implausibly large or small.
    #[must_use]
    pub fn doubt(&self) -> Option<String> {
        let [low, high] = self.extent_W_m();
        let size_m: [f64; 3] = std::array::from_fn(|axis| high[axis] - low[axis]);
        let longest_m = size_m.into_iter().fold(0.0, f64::max);
        let sides = |factor: f64| {
            let [x, y, z] = size_m.map(|side_m| factor * side_m);
            format!("{x:.4} x {y:.4} x {z:.4} m")
        };
        let is_large = longest_m > *USUAL_M.end();
        let (factor, mistake) = if is_large {
            (1e-3, "millimetres were read as metres")
        } else {
            (1e3, "metres were read as millimetres")
        };
        (!USUAL_M.contains(&longest_m)).then(|| {
            format!(
                "mesh \"{}\" measures {}, expected {} m to {} m in its longest side, as beside vehicles and in rooms; check its \
                 `scale`: {factor} times as large, as if {mistake}, it would measure {}",
                self.name,
                sides(1.0),
                USUAL_M.start(),
                USUAL_M.end(),
                sides(factor)
            )
        })
    }

    /// True if it has no border: each edge of a triangle is one of another too, the other way round.
    #[must_use]
    pub fn is_closed(&self) -> bool {
        let mut edges: BTreeMap<[u32; 2], i64> = BTreeMap::new();
        for face in self.welded().1 {
            for [a, b] in [[0, 1], [1, 2], [2, 0]].map(|edge| edge.map(|corner: usize| face[corner])) {
                *edges.entry([a.min(b), a.max(b)]).or_default() += if a < b { 1 } else { -1 };
            }
        }
        edges.values().all(|sum| *sum == 0)
    }

    /// The edges that the eye sees, as pairs of corners: those of one triangle, and those where two meet at an angle.
    #[must_use]
    pub fn edges(&self) -> Vec<[[f64; 3]; 2]> {
        let key = |corner: u32| self.corners_W_m[corner as usize].map(f64::to_bits);
        let mut edges: BTreeMap<_, Vec<Vector>> = BTreeMap::new();
        for face in &self.faces {
            let Some(normal_W) = self.normal_W(face) else { continue };
            for [a, b] in [[0, 1], [1, 2], [2, 0]] {
                let (a, b) = (key(face[a]), key(face[b]));
                edges.entry([a.min(b), a.max(b)]).or_default().push(normal_W);
            }
        }
        let is_seen = |normals: &[Vector]| match normals {
            [first, second] => first.dot(*second).abs() < libm::cos(SMOOTH_RAD),
            _ => true,
        };
        let seen = edges.into_iter().filter(|(_, normals)| is_seen(normals));
        seen.map(|(ends, _)| ends.map(|end| end.map(f64::from_bits))).collect()
    }

    /// The same without triangles that are lines, which have no side that could be met.
    pub(crate) fn without_lines(mut self) -> Self {
        let faces = std::mem::take(&mut self.faces);
        self.faces = faces.into_iter().filter(|face| self.normal_W(face).is_some()).collect();
        self
    }

    /// The normal of a triangle; none where it is a line.
    fn normal_W(&self, face: &[u32; 3]) -> Option<Vector> {
        let [a, b, c] = face.map(|corner| Vector::from(self.corners_W_m[corner as usize]));
        let (along, across) = (b - a, c - a);
        let normal = along.cross(across);
        let is_face = normal.length() > LINE_MAX * along.length_squared().max(across.length_squared());
        is_face.then(|| normal.normalize())
    }
}

impl fmt::Display for Mesh {
    /// Its size in a line.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [low, high] = self.extent_W_m();
        let [x, y, z] = [0, 1, 2].map(|axis| high[axis] - low[axis]);
        let closed = if self.is_closed() { "closed" } else { "open" };
        write!(
            f,
            "{}: {} triangles, {closed}, {x:.3} x {y:.3} x {z:.3} m, from {low:.3?} to {high:.3?} m",
            self.name,
            self.faces.len()
        )
    }
}

/// The lengths of the corners' bounding box.
fn outermost(corners: &[Vector]) -> [f64; 3] {
    [0, 1, 2].map(|axis| {
        let along = || corners.iter().map(|corner| corner[axis]);
        along().fold(f64::NEG_INFINITY, f64::max) - along().fold(f64::INFINITY, f64::min)
    })
}
