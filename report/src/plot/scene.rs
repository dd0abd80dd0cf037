//! The scene of a recording, as its fixed things are drawn: boxes, meshes and balls by their corners and edges.

use crate::attached::named;
use nalgebra::Vector3;
use recorder::RecordingError;
use recorder::reader::Recording;
use scenes::{Ball, BodyPose, Cuboid, Mesh, Scene, Thing};
use serde::Serialize;
use std::f64::consts::{PI, TAU};
use std::path::Path;

/// A thing that stands on or above the ground, as drawn.
#[derive(Clone, Debug, Serialize)]
pub struct Solid {
    /// Name in the scene file.
    pub name: String,
    /// Corners in metres, in the world. Of a box: the lower four counter-clockwise from above, then the upper four above
    /// them.
    pub corners: Vec<[f64; 3]>,
    /// Triangles, as places in `corners`.
    pub faces: Vec<[u32; 3]>,
    /// The edges that are seen.
    pub edges: Vec<[[f64; 3]; 2]>,
    #[serde(skip)]
    is_box: bool,
}

/// The edges of a box: pairs of [`Solid::corners`].
const BOX_EDGES: [[usize; 2]; 12] =
    [[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]];

/// The faces of a box as triangles of its corners.
const BOX_FACES: [[u32; 3]; 12] = [
    [0, 1, 5],
    [0, 5, 4],
    [1, 2, 6],
    [1, 6, 5],
    [2, 3, 7],
    [2, 7, 6],
    [3, 0, 4],
    [3, 4, 7],
    [4, 5, 6],
    [4, 6, 7],
    [0, 3, 2],
    [0, 2, 1],
];

/// Corners around a ball as drawn, and rings of them between its poles.
const AROUND: usize = 24;
const RINGS: usize = 11;

impl Solid {
    fn of(thing: &Thing) -> Self {
        match thing {
            Thing::Cuboid(cuboid) => Self::of_box(cuboid),
            Thing::Mesh(mesh) => Self::of_mesh(mesh),
            Thing::Ball(ball) => Self::of_ball(ball),
        }
    }

    /// A ball by rings of latitude; its equator and two meridians are seen.
    fn of_ball(ball: &Ball) -> Self {
        let on_ball = |ring: usize, place: usize| {
            let (down, out) = libm::sincos(PI * (ring + 1) as f64 / (RINGS + 1) as f64 - PI / 2.0);
            let (y, x) = libm::sincos(TAU * place as f64 / AROUND as f64);
            let [a, b, c] = [x * out, y * out, -down].map(|part| part * ball.radius_m);
            [ball.centre_W_m.x + a, ball.centre_W_m.y + b, ball.centre_W_m.z + c]
        };
        let corners: Vec<_> =
            (0..RINGS).flat_map(|ring| (0..AROUND).map(move |place| on_ball(ring, place))).collect();
        let quads = (0..RINGS - 1).flat_map(|ring| (0..AROUND).map(move |place| (ring, place)));
        let number = |ring: usize, place: usize| (ring * AROUND + place % AROUND) as u32;
        let faces = quads.flat_map(|(ring, place)| {
            let [a, b] = [number(ring, place), number(ring, place + 1)];
            let [c, d] = [number(ring + 1, place + 1), number(ring + 1, place)];
            [[a, d, c], [a, c, b]]
        });
        let middle = RINGS / 2;
        let equator = (0..AROUND).map(|place| [on_ball(middle, place), on_ball(middle, place + 1)]);
        let meridian =
            |place: usize| (0..RINGS - 1).map(move |ring| [on_ball(ring, place), on_ball(ring + 1, place)]);
        let meridians = (0..4).flat_map(|quarter| meridian(quarter * AROUND / 4));
        let edges = equator.chain(meridians).collect();
        Self { name: ball.name.clone(), faces: faces.collect(), edges, corners, is_box: false }
    }

    fn of_box(cuboid: &Cuboid) -> Self {
        let ([x, y, z], [a, b, c]) = (cuboid.centre_W_m.into(), cuboid.half_extents_m.into());
        let (sin, cos) = libm::sincos(cuboid.yaw_rad);
        let corner = |index: usize| {
            let (ahead, left) = [(-a, -b), (a, -b), (a, b), (-a, b)][index % 4];
            let up = if index < 4 { -c } else { c };
            [x + cos * ahead - sin * left, y + sin * ahead + cos * left, z + up]
        };
        let corners: Vec<_> = (0..8).map(corner).collect();
        let edges = BOX_EDGES.map(|edge| edge.map(|corner| corners[corner])).to_vec();
        Self { name: cuboid.name.clone(), corners, faces: BOX_FACES.to_vec(), edges, is_box: true }
    }

    fn of_mesh(mesh: &Mesh) -> Self {
        let (corners, faces) = (mesh.corners_W_m.clone(), mesh.faces.clone());
        Self { name: mesh.name.clone(), corners, faces, edges: mesh.edges(), is_box: false }
    }

    /// The solid along the axes of a body, from its centre of mass.
    fn seen_from(mut self, pose: &BodyPose) -> Self {
        let seen = |corner: &[f64; 3]| -> [f64; 3] {
            pose.attitude_W.inverse_transform_vector(&(Vector3::from(*corner) - pose.position_W_m)).into()
        };
        self.corners = self.corners.iter().map(seen).collect();
        self.edges = self.edges.iter().map(|edge| [seen(&edge[0]), seen(&edge[1])]).collect();
        self
    }

    /// Its lines as seen along an axis: the closed outline of a box, or the edges of a mesh. `across` and `up` are
    /// the axes of the view.
    pub fn outlines(&self, across: usize, up: usize) -> Vec<Vec<(f64, f64)>> {
        let seen = |corner: &[f64; 3]| (corner[across], corner[up]);
        if !self.is_box {
            return self.edges.iter().map(|edge| edge.iter().map(seen).collect()).collect();
        }
        let seen: Vec<_> = self.corners.iter().map(seen).collect();
        if up == 1 {
            return vec![[0, 1, 2, 3, 0].map(|index| seen[index]).to_vec()];
        }
        // From the side a box is upright, so it is seen as a rectangle.
        let left = seen.iter().fold(f64::INFINITY, |left, (x, _)| left.min(*x));
        let right = seen.iter().fold(f64::NEG_INFINITY, |right, (x, _)| right.max(*x));
        let (low, high) = (seen[0].1, seen[4].1);
        vec![vec![(left, low), (right, low), (right, high), (left, high), (left, low)]]
    }
}

/// Fixed things in the scene of a recording, whose file and meshes are attached; empty if it has no scene.
///
/// # Errors
/// If the recording is damaged.
pub fn scene_of(recording: &Recording) -> Result<Vec<Solid>, RecordingError> {
    let Some(scene) = read_scene(recording)? else { return Ok(Vec::new()) };
    let still = scene.things().filter(|thing| thing.body().is_none());
    Ok(still.map(|thing| Solid::of(&thing)).collect())
}

/// The free bodies of a recording's scene, drawn along their own axes from their centres of mass, in the order of
/// their numbers in `BodyStates`; empty if it has no scene that can be read.
///
/// # Errors
/// If the recording is damaged.
pub fn bodies_of(recording: &Recording) -> Result<Vec<Solid>, RecordingError> {
    let Some(scene) = read_scene(recording)? else { return Ok(Vec::new()) };
    let bodies = scene.things().filter_map(|thing| Some(Solid::of(&thing).seen_from(&thing.body()?.start())));
    Ok(bodies.collect())
}

/// Names of the free bodies of a recording's scene; empty if it has no scene that can be read.
pub fn body_names(recording: &Recording) -> Vec<String> {
    let Ok(Some(scene)) = read_scene(recording) else { return Vec::new() };
    scene.bodies().filter_map(|(number, _)| scene.name_of(number)).map(str::to_owned).collect()
}

fn read_scene(recording: &Recording) -> Result<Option<Scene>, RecordingError> {
    let attachments = recording.attachments()?;
    let read = |path: &Path| {
        let found = named(&attachments, path).into_iter().next();
        found.map(|(_, bytes)| bytes.clone()).ok_or_else(|| std::io::ErrorKind::NotFound.into())
    };
    // An attachment does not say what it is, but no manifest and no vehicle file can be read as a scene.
    let scene = |(name, bytes): &(String, Vec<u8>)| {
        Scene::parse_with(std::str::from_utf8(bytes).ok()?, name, &read).ok()
    };
    Ok(attachments.iter().find_map(scene))
}

#[cfg(test)]
mod tests {
    use super::Solid;
    use scenes::Scene;

    const SCENE: &str = r#"
        name = "test"
        [[boxes]]
        name = "box"
        centre = { value = [1, 2, 0.5], unit = "m", source = "test", uncertainty = "exact" }
        size = { value = [4, 2, 1], unit = "m", source = "test", uncertainty = "exact" }
        yaw = { value = 90, unit = "deg", source = "test", uncertainty = "exact" }
    "#;

    #[test]
    fn a_turned_box_has_its_corners_where_they_are() {
        let solid = Solid::of_box(&Scene::parse(SCENE, "test.toml").unwrap().boxes[0]);
        let expected = [[2.0, 0.0, 0.0], [2.0, 4.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 0.0]];
        for (index, [x, y, z]) in expected.into_iter().enumerate() {
            let (lower, upper) = (solid.corners[index], solid.corners[index + 4]);
            assert!((lower[0] - x).abs() + (lower[1] - y).abs() + (lower[2] - z).abs() < 1e-12, "{lower:?}");
            assert!((upper[2] - lower[2] - 1.0).abs() < 1e-12);
        }
        let side = &solid.outlines(0, 2)[0];
        assert!((side[0].0 - 0.0).abs() < 1e-12 && (side[1].0 - 2.0).abs() < 1e-12, "{side:?}");
        assert!((side[2].1 - 1.0).abs() < 1e-12);
    }
}
