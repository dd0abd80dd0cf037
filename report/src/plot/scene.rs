//! The scene of a recording, as what stands in it is drawn: boxes by their corners.

use recorder::RecordingError;
use recorder::reader::Recording;
use scenes::{Cuboid, Scene};
use serde::Serialize;

/// A box that stands on or above the ground.
#[derive(Clone, Debug, Serialize)]
pub struct Solid {
    /// Name in the scene file.
    pub name: String,
    /// Corners in metres: the lower four counter-clockwise from above, then the upper four above them.
    pub corners: [[f64; 3]; 8],
}

impl Solid {
    fn of(cuboid: &Cuboid) -> Self {
        let ([x, y, z], [a, b, c]) = (cuboid.centre_W_m.into(), cuboid.half_extents_m.into());
        let (sin, cos) = libm::sincos(cuboid.yaw_rad);
        let corner = |index: usize| {
            let (ahead, left) = [(-a, -b), (a, -b), (a, b), (-a, b)][index % 4];
            let up = if index < 4 { -c } else { c };
            [x + cos * ahead - sin * left, y + sin * ahead + cos * left, z + up]
        };
        Self { name: cuboid.name.clone(), corners: std::array::from_fn(corner) }
    }

    /// Its outline seen along an axis, as a closed line; `across` and `up` are the axes of the view.
    pub fn outline(&self, across: usize, up: usize) -> Vec<(f64, f64)> {
        let seen = self.corners.map(|corner| (corner[across], corner[up]));
        if up == 1 {
            return [0, 1, 2, 3, 0].map(|index| seen[index]).to_vec();
        }
        // From the side a box is upright, so it is seen as a rectangle.
        let left = seen.iter().fold(f64::INFINITY, |left, (x, _)| left.min(*x));
        let right = seen.iter().fold(f64::NEG_INFINITY, |right, (x, _)| right.max(*x));
        let (low, high) = (seen[0].1, seen[4].1);
        vec![(left, low), (right, low), (right, high), (left, high), (left, low)]
    }
}

/// The edges of a box: pairs of [`Solid::corners`].
pub const EDGES: [[usize; 2]; 12] =
    [[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]];

/// What stands in the scene of a recording, whose file is attached; nothing where it has none.
///
/// # Errors
/// If the recording is damaged.
pub fn scene_of(recording: &Recording) -> Result<Vec<Solid>, RecordingError> {
    // An attachment does not say what it is, but no manifest and no vehicle file can be read as a scene.
    let scene =
        |(name, bytes): (String, Vec<u8>)| Scene::parse(std::str::from_utf8(&bytes).ok()?, &name).ok();
    let scene = recording.attachments()?.into_iter().find_map(scene);
    Ok(scene.iter().flat_map(|scene| &scene.boxes).map(Solid::of).collect())
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
        let solid = Solid::of(&Scene::parse(SCENE, "test.toml").unwrap().boxes[0]);
        let expected = [[2.0, 0.0, 0.0], [2.0, 4.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 0.0]];
        for (index, [x, y, z]) in expected.into_iter().enumerate() {
            let (lower, upper) = (solid.corners[index], solid.corners[index + 4]);
            assert!((lower[0] - x).abs() + (lower[1] - y).abs() + (lower[2] - z).abs() < 1e-12, "{lower:?}");
            assert!((upper[2] - lower[2] - 1.0).abs() < 1e-12);
        }
        let side = solid.outline(0, 2);
        assert!((side[0].0 - 0.0).abs() < 1e-12 && (side[1].0 - 2.0).abs() < 1e-12, "{side:?}");
        assert!((side[2].1 - 1.0).abs() < 1e-12);
    }
}
