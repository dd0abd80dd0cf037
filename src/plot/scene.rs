//! The scene of a recording, as what stands in it is drawn: boxes by their corners.

use recorder::reader::Recording;
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
    /// The box around `centre_m` with edges of `size_m`, turned by `yaw_rad` about the vertical.
    pub fn new(name: &str, centre_m: [f64; 3], size_m: [f64; 3], yaw_rad: f64) -> Self {
        let (sin, cos) = yaw_rad.sin_cos();
        let corner = |index: usize| {
            let [x, y] = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]][index % 4];
            let (x, y) = (x * size_m[0], y * size_m[1]);
            let z = if index < 4 { -0.5 } else { 0.5 } * size_m[2];
            [centre_m[0] + cos * x - sin * y, centre_m[1] + sin * x + cos * y, centre_m[2] + z]
        };
        Self { name: name.to_owned(), corners: std::array::from_fn(corner) }
    }

    /// Its outline seen along an axis, as a closed line; `across` and `up` are the axes of the view.
    pub fn outline(&self, across: usize, up: usize) -> Vec<(f64, f64)> {
        let seen = self.corners.map(|corner| (corner[across], corner[up]));
        if up == 1 {
            return [0, 1, 2, 3, 0].map(|index| seen[index]).to_vec();
        }
        // From the side a box is upright, so it is seen as a rectangle.
        let x = seen.map(|(x, _)| x);
        let (left, right) =
            (x.into_iter().fold(f64::INFINITY, f64::min), x.into_iter().fold(f64::NEG_INFINITY, f64::max));
        let (low, high) = (seen[0].1, seen[4].1);
        vec![(left, low), (right, low), (right, high), (left, high), (left, low)]
    }
}

/// The edges of a box: pairs of [`Solid::corners`].
pub const EDGES: [[usize; 2]; 12] =
    [[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]];

/// What stands in the scene of a recording; nothing where it has none.
pub fn scene_of(_recording: &Recording) -> Vec<Solid> {
    Vec::new()
}

#[cfg(test)]
mod tests {
    use super::Solid;

    #[test]
    fn a_turned_box_has_its_corners_where_they_are() {
        let solid = Solid::new("box", [1.0, 2.0, 0.5], [4.0, 2.0, 1.0], std::f64::consts::FRAC_PI_2);
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
