//! Wavefront OBJ: corners (`v`) and polygons (`f`), which are cut into triangles.
//!
//! A polygon may have any number of corners and be concave, such as a wall with a doorway: a fan from its first corner would close
//! the doorway.

use crate::triangles::{Triangles, corner};
use earcut::{Earcut, deviation, utils3d::project3d_to_2d};
use nalgebra::Vector3;
use vehicles::lines::numbered;

/// Cutting takes a time up to the square of this.
const POLYGON_MAX: usize = 10_000;
/// Triangles whose area differs from that of their polygon by more than this share do not fill it.
const DEVIATION_MAX: f64 = 1e-3;
/// A corner that is less far beside a line of length 1 lies on it.
const LINE_MAX: f64 = 1e-9;

/// The triangles that `bytes` hold.
///
/// # Errors
/// In words: the line, and its fault.
pub(crate) fn read(bytes: &[u8]) -> Result<Triangles, String> {
    let text = String::from_utf8_lossy(bytes);
    let mut triangles = Triangles::default();
    for (number, line) in lines(&text) {
        let code = line.split('#').next().unwrap_or_default();
        let mut words = code.split_whitespace();
        let read = match words.next() {
            Some("v") => corner(words).map(|corner| triangles.corners.push(corner)),
            Some("f") => face(words, triangles.corners.len()).and_then(|face| {
                let cut = cut(&triangles.corners, &face)?;
                triangles.faces.extend(cut);
                triangles.check_count()
            }),
            _ => Ok(()),
        };
        read.map_err(|fault| format!("line {number}: {fault}"))?;
    }
    Ok(triangles)
}

/// The lines with their numbers; one that ends in `\` goes on in the next.
fn lines(text: &str) -> impl Iterator<Item = (u64, String)> {
    let mut lines = numbered(text);
    std::iter::from_fn(move || {
        let (number, first) = lines.next()?;
        let mut line = first.to_owned();
        while line.ends_with('\\') {
            line.pop();
            line.push(' ');
            line.push_str(lines.next().map_or("", |(_, more)| more));
        }
        Some((number, line))
    })
}

/// The corners of a polygon among the `count` that there are: `i`, `i/texture`, `i//normal` or `i/texture/normal`, from 1 on, or
/// from -1 backwards.
fn face<'a>(words: impl Iterator<Item = &'a str>, count: usize) -> Result<Vec<u32>, String> {
    let index = |word: &str| {
        let number: i64 = word.split('/').next()?.parse().ok()?;
        let index = if number < 0 { i64::try_from(count).ok()? + number } else { number - 1 };
        u32::try_from(index).ok().filter(|index| (*index as usize) < count)
    };
    let index = |word: &str| {
        index(word).ok_or_else(|| {
            let shown: String = word.chars().take(40).collect();
            format!("a polygon names the corner `{shown}`, and {count} corners stand before it")
        })
    };
    let face = words.map(index).collect::<Result<Vec<_>, _>>()?;
    match face.len() {
        0..3 => Err(format!("expected a polygon of three corners or more, found {}", face.len())),
        count if count > POLYGON_MAX => {
            Err(format!("expected a polygon of at most {POLYGON_MAX} corners, found {count}"))
        }
        _ => Ok(face),
    }
}

/// The triangles that fill a polygon, each turning as it does.
fn cut(corners: &[[f64; 3]], face: &[u32]) -> Result<Vec<[u32; 3]>, String> {
    if let [a, b, c] = *face {
        return Ok(vec![[a, b, c]]);
    }
    let polygon: Vec<[f64; 3]> = face.iter().map(|&corner| corners[corner as usize]).collect();
    // From its own place and in its own size: far from the origin the products of coordinates have no digits left.
    let (origin, size) = (polygon[0], size(&polygon));
    let near: Vec<[f64; 3]> = polygon
        .iter()
        .map(|corner| std::array::from_fn(|axis| (corner[axis] - origin[axis]) / size))
        .collect();
    let mut flat = Vec::new();
    let crosses = || format!("its polygon of {} corners crosses itself: cut it into triangles", face.len());
    if !project3d_to_2d(&near, near.len(), &mut flat) {
        // A line, which has no side that could be met, or parts that turn both ways round and cancel.
        return if is_line(&near) { Ok(vec![[face[0], face[1], face[2]]]) } else { Err(crosses()) };
    }
    let mut numbers: Vec<u32> = Vec::new();
    Earcut::new().earcut(flat.iter().copied(), &[], &mut numbers);
    if deviation(flat.iter().copied(), &[], &numbers) > DEVIATION_MAX {
        return Err(crosses());
    }
    let (triangles, _) = numbers.as_chunks::<3>();
    let turned = |&[a, b, c]: &[u32; 3]| {
        let [p, q, r] = [a, b, c].map(|corner| flat[corner as usize]);
        let area = (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
        let of_face = |corner: u32| face[corner as usize];
        if area < 0.0 { [a, c, b].map(of_face) } else { [a, b, c].map(of_face) }
    };
    Ok(triangles.iter().map(turned).collect())
}

/// True if all corners, of which the first is the origin, lie on a line; their sizes are about 1.
fn is_line(corners: &[[f64; 3]]) -> bool {
    let corners = || corners.iter().map(|corner| Vector3::from(*corner));
    let along = corners().max_by(|a, b| a.norm().total_cmp(&b.norm())).unwrap_or_default();
    corners().all(|corner| along.cross(&corner).norm() < LINE_MAX)
}

/// The longest side of the box around a polygon; 1 of one without a size.
fn size(polygon: &[[f64; 3]]) -> f64 {
    let side = |axis: usize| {
        let along = || polygon.iter().map(|corner| corner[axis]);
        along().fold(f64::NEG_INFINITY, f64::max) - along().fold(f64::INFINITY, f64::min)
    };
    let size = (0..3).map(side).fold(0.0, f64::max);
    if size > 0.0 && size.is_finite() { size } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The area of the triangles along `axis`, which are to turn as the polygon does.
    fn area(triangles: &Triangles, axis: usize) -> f64 {
        let of = |face: &[u32; 3]| {
            let [a, b, c] = face.map(|corner| triangles.corners[corner as usize]);
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            0.5 * ((b[u] - a[u]) * (c[v] - a[v]) - (b[v] - a[v]) * (c[u] - a[u]))
        };
        let areas: Vec<f64> = triangles.faces.iter().map(of).collect();
        assert!(areas.iter().all(|area| area.signum() == areas[0].signum()), "{areas:?}");
        areas.iter().sum()
    }

    #[test]
    fn a_doorway_stays_open_whichever_way_the_wall_stands() {
        // Around a doorway of 1 by 2 in a wall of 4 by 3.
        let outline = [[0, 0], [1, 0], [1, 2], [2, 2], [2, 0], [4, 0], [4, 3], [0, 3]];
        for axis in 0..3 {
            for offset in [0.0, 1e6] {
                for first in 0..8 {
                    let corners = (0..8).map(|corner| outline[(corner + first) % 8]);
                    let line = |[along, up]: [i32; 2]| {
                        let mut place = [offset; 3];
                        place[(axis + 1) % 3] += f64::from(along);
                        place[(axis + 2) % 3] += f64::from(up);
                        format!("v {} {} {}\n", place[0], place[1], place[2])
                    };
                    let text: String = corners.map(line).collect();
                    let forward = read(format!("{text}f 1 2 3 4 5 6 7 8\n").as_bytes()).unwrap();
                    assert_eq!(forward.faces.len(), 6);
                    assert!((area(&forward, axis) - 10.0).abs() < 1e-9, "{}", area(&forward, axis));
                    let backward = read(format!("{text}f 8 7 6 5 4 3 2 1\n").as_bytes()).unwrap();
                    assert!((area(&backward, axis) + 10.0).abs() < 1e-9);
                }
            }
        }
    }

    #[test]
    fn lines_go_on_and_corners_are_named_in_all_ways() {
        let text = b"# a square \xE9\r\no caf\xE9\nv 0 0 0 1 0 0\nv 1 0 0 # second\nv 1 \\\n1 0\nv 0 1 0\nvn 0 0 1\nvt 0 0\n\
                     f -4/1/1 -3//1 3/1 \\\n -1\n";
        let square = read(text).unwrap();
        assert_eq!((square.corners.len(), square.faces.len()), (4, 2));
        assert!((area(&square, 2) - 1.0).abs() < 1e-12);
        for end in ["\r\n", "\r"] {
            let text = String::from_utf8_lossy(text).replace("\r\n", "\n").replace('\n', end);
            assert_eq!(read(text.as_bytes()).unwrap(), square, "{end:?}");
        }
    }

    #[test]
    fn what_is_wrong_is_told_with_its_line() {
        let square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";
        for (line, part) in [
            ("f 1 2", "line 5: expected a polygon of three corners or more, found 2"),
            ("f 1 2 5", "line 5: a polygon names the corner `5`, and 4 corners stand before it"),
            ("f 1 2 0", "the corner `0`"),
            ("f 1 2 -5", "the corner `-5`"),
            ("f 1 2 x", "the corner `x`"),
            ("f 1 3 2 4", "line 5: its polygon of 4 corners crosses itself"),
            ("v 1 2", "line 5: expected three coordinates, found 2"),
            ("v 1 2 3,5", "line 5: a corner has a coordinate that is no finite number"),
        ] {
            let told = read(format!("{square}{line}\n").as_bytes()).unwrap_err();
            assert!(told.contains(part), "no {part:?} in {told}");
        }
    }
}
