//! Texts of scene files, part by part, and of a mesh.

use nalgebra::Vector3;

/// A number of a scene file.
pub fn given(value: &str, unit: &str) -> String {
    format!("{{ value = {value}, unit = \"{unit}\", source = \"test\", uncertainty = \"exact\" }}")
}

/// Keys with their values and units, a line each.
pub fn keys(keys: &[(&str, &str, &str)]) -> String {
    keys.iter().map(|(key, value, unit)| format!("{key} = {}\n", given(value, unit))).collect()
}

/// A thing of an array such as `balls`.
pub fn body(kind: &str, name: &str, more: &[(&str, &str, &str)]) -> String {
    format!("[[{kind}]]\nname = \"{name}\"\n{}", keys(more))
}

/// A joint called `joint`.
pub fn joint(kind: &str, [parent, child]: [&str; 2], more: &[(&str, &str, &str)]) -> String {
    format!(
        "[[joints]]\nname = \"joint\"\nkind = \"{kind}\"\nparent = \"{parent}\"\nchild = \"{child}\"\n{}",
        keys(more)
    )
}

/// An upright prism with its middle at the origin.
pub struct Prism {
    pub sides: u32,
    pub radius_m: f64,
    /// Half of its height.
    pub half_m: f64,
}

impl Prism {
    /// Its corners, those of the lower face first.
    pub fn corners_m(&self) -> Vec<Vector3<f64>> {
        let corner = |number: u32| {
            let z_m = if number < self.sides { -self.half_m } else { self.half_m };
            let turn_rad = f64::from(number % self.sides) * std::f64::consts::TAU / f64::from(self.sides);
            let (sin, cos) = libm::sincos(turn_rad);
            Vector3::new(self.radius_m * cos, self.radius_m * sin, z_m)
        };
        (0..2 * self.sides).map(corner).collect()
    }

    /// Its mesh as a file in OBJ.
    pub fn obj(&self) -> String {
        let sides = self.sides;
        let corners = self.corners_m();
        let lines = corners.iter().map(|corner| format!("v {:?} {:?} {:?}\n", corner.x, corner.y, corner.z));
        let walls = (1..=sides).map(|one| {
            let two = one % sides + 1;
            format!("f {one} {two} {} {}\n", two + sides, one + sides)
        });
        let face = |numbers: Vec<u32>| {
            let numbers: Vec<String> = numbers.iter().map(u32::to_string).collect();
            format!("f {}\n", numbers.join(" "))
        };
        let ends = [face((1..=sides).rev().collect()), face((sides + 1..=2 * sides).collect())];
        lines.chain(walls).chain(ends).collect()
    }
}
