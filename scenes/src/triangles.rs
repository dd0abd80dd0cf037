//! Triangles as mesh files hold them.

/// A scene file draws furniture, not a film: enough for a building, and a bound on memory.
const TRIANGLES_MAX: usize = 200_000;
/// Three for each, and some that belong to none.
const CORNERS_MAX: usize = 4 * TRIANGLES_MAX;

/// Corners, in the file's unit with z up, and triangles as numbers of corners, counter-clockwise from outside.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Triangles {
    pub(crate) corners: Vec<[f64; 3]>,
    pub(crate) faces: Vec<[u32; 3]>,
}

impl Triangles {
    /// Adds triangles as numbers of these corners; refuses more than are read.
    pub(crate) fn add(
        &mut self,
        corners: impl IntoIterator<Item = [f64; 3]>,
        faces: &[[u32; 3]],
    ) -> Result<(), String> {
        let first = self.corners.len() as u32;
        self.corners.extend(corners);
        self.faces.extend(faces.iter().map(|face| face.map(|corner| corner.saturating_add(first))));
        if self.corners.len() > CORNERS_MAX {
            return Err(format!("it holds more than {CORNERS_MAX} corners"));
        }
        self.check_count()
    }

    /// Adds a triangle with corners of its own.
    pub(crate) fn add_triangle(&mut self, corners: impl Iterator<Item = [f64; 3]>) {
        let first = self.corners.len() as u32;
        self.corners.extend(corners);
        self.faces.push([first, first + 1, first + 2]);
    }

    /// Refuses more triangles than are read.
    pub(crate) fn check_count(&self) -> Result<(), String> {
        if self.faces.len() <= TRIANGLES_MAX {
            return Ok(());
        }
        Err(format!("it holds {} triangles, and at most {TRIANGLES_MAX} are read", self.faces.len()))
    }

    /// The same, checked for the faults of any format.
    pub(crate) fn checked(self) -> Result<Self, String> {
        if self.faces.is_empty() {
            return Err("it holds no triangle".to_owned());
        }
        self.check_count()?;
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

/// A corner, of the first three numbers in a line: a weight or a colour may follow.
pub(crate) fn corner<'a>(words: impl Iterator<Item = &'a str>) -> Result<[f64; 3], String> {
    let numbers: Vec<f64> = words.take(3).map(|word| word.parse().unwrap_or(f64::NAN)).collect();
    let corner: [f64; 3] = numbers
        .try_into()
        .map_err(|found: Vec<f64>| format!("expected three coordinates, found {}", found.len()))?;
    let is_finite = corner.iter().all(|number| number.is_finite());
    is_finite.then_some(corner).ok_or_else(|| "a corner has a coordinate that is no finite number".to_owned())
}
