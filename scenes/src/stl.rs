//! STL, as text or binary. Both may begin with `solid`: a binary file is one whose length is that of the triangles that it states.

use crate::triangles::{Triangles, corner};
use vehicles::lines::numbered;

/// Bytes in front of the triangles: a header of any text, and their number.
const HEAD_BYTES: usize = 80 + 4;
/// A normal, three corners, and two bytes for anything.
const TRIANGLE_BYTES: usize = 12 * 4 + 2;

/// The triangles that `bytes` hold.
///
/// # Errors
/// In words: the fault of the bytes, and its place.
pub(crate) fn read(bytes: &[u8]) -> Result<Triangles, String> {
    let stated = bytes.get(80..HEAD_BYTES).and_then(|number| number.try_into().ok()).map(u32::from_le_bytes);
    let length = |count: u32| HEAD_BYTES as u64 + u64::from(count) * TRIANGLE_BYTES as u64;
    // Some writers end with a line break.
    let is_binary = |count: u32| (0..=2).contains(&(bytes.len() as u64).wrapping_sub(length(count)));
    match stated {
        Some(count) if is_binary(count) => Ok(binary(bytes)),
        _ if is_text(bytes) => text(&String::from_utf8_lossy(bytes)),
        Some(count) => Err(format!(
            "it is no text that begins with `solid`, and as binary STL it states {count} triangles, which take {} bytes; it \
             has {}",
            length(count),
            bytes.len()
        )),
        None => Err(format!(
            "it is no text that begins with `solid`, and too short for binary STL: {} bytes",
            bytes.len()
        )),
    }
}

fn is_text(bytes: &[u8]) -> bool {
    let bytes = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes).trim_ascii_start();
    bytes.get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"))
}

fn binary(bytes: &[u8]) -> Triangles {
    let (triangles, _) = bytes[HEAD_BYTES..].as_chunks::<TRIANGLE_BYTES>();
    let mut read = Triangles::default();
    for triangle in triangles {
        let (numbers, _) = triangle.as_chunks::<4>();
        let (corners, _) = numbers[3..].as_chunks::<3>();
        read.add_triangle(
            corners.iter().map(|corner| corner.map(|number| f32::from_le_bytes(number).into())),
        );
    }
    read
}

fn text(text: &str) -> Result<Triangles, String> {
    let mut read = Triangles::default();
    let mut corners = Vec::new();
    let mut is_open = false;
    for (number, line) in numbered(text.trim_start_matches('\u{FEFF}')) {
        let mut words = line.split_whitespace();
        let keyword = words.next().unwrap_or_default().to_ascii_lowercase();
        let fault = |fault: String| format!("line {number}: {fault}");
        match keyword.as_str() {
            "vertex" => corners.push(corner(words).map_err(fault)?),
            "endloop" if corners.len() == 3 => read.add_triangle(corners.drain(..)),
            "endloop" => return Err(fault(format!("a triangle ends, and has {} corners", corners.len()))),
            "solid" => is_open = true,
            "endsolid" => is_open = false,
            "" | "facet" | "outer" | "endfacet" => {}
            _ => {
                let shown: String = keyword.chars().take(40).collect();
                let expected =
                    "expected `facet`, `outer loop`, `vertex`, `endloop`, `endfacet` or `endsolid`";
                return Err(fault(format!("{expected}, found `{shown}`")));
            }
        }
    }
    match (corners.is_empty(), is_open) {
        (false, _) => Err("it is cut: its last triangle does not end".to_owned()),
        // A file may be cut between two triangles.
        (true, true) => Err(format!(
            "it is cut: expected `endsolid` behind triangle {}; if no triangle is missing, add that line",
            read.faces.len()
        )),
        (true, false) => Ok(read),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FACET: &str = "facet normal 0 0 1\n outer loop\n  vertex 0 0 0\n  vertex 1e0 0 0\n  vertex 0 2 0.5\n endloop\nendfacet\n";

    fn binary_of(head: &[u8], count: u32, triangles: usize) -> Vec<u8> {
        let mut bytes = head.to_vec();
        bytes.resize(80, b' ');
        bytes.extend(count.to_le_bytes());
        for _ in 0..triangles {
            let numbers = [0., 0., 1., 0., 0., 0., 1., 0., 0., 0., 2., 0.5];
            bytes.extend(numbers.into_iter().flat_map(f32::to_le_bytes));
            bytes.extend([0, 0]);
        }
        bytes
    }

    #[test]
    fn text_and_binary_are_told_apart_whatever_they_begin_with() {
        for head in ["solid", "solid ", "solid box", "SOLID facet vertex", "\u{FEFF}solid", "  \n solid\t"] {
            let text = format!("{head}\n{FACET}{FACET}endsolid\n");
            // Ends of lines of Linux, Windows and old Macintoshes.
            for end in ["\n", "\r\n", "\r"] {
                let read = read(text.replace('\n', end).as_bytes()).unwrap();
                assert_eq!((read.faces.len(), read.corners[2]), (2, [0.0, 2.0, 0.5]), "{head} {end:?}");
            }
        }
        // A text whose length is that of some binary file.
        let padded = (0..50).map(|blanks| format!("solid\n{FACET}{}endsolid\n", " ".repeat(blanks)));
        assert!(
            padded.map(|text| read(text.as_bytes()).unwrap()).all(|read| read.corners[2] == [0.0, 2.0, 0.5])
        );
        for head in [&b"solid"[..], b"solid facet normal\n", b"made by hand"] {
            let mut bytes = binary_of(head, 3, 3);
            assert_eq!(read(&bytes).unwrap().faces.len(), 3);
            bytes.push(b'\n');
            assert_eq!(read(&bytes).unwrap().corners[2], [0.0, 2.0, 0.5]);
        }
    }

    #[test]
    fn what_is_neither_is_told_as_what_it_is() {
        for (bytes, part) in [
            (binary_of(b"cut", 3, 2), "states 3 triangles, which take 234 bytes; it has 184"),
            (binary_of(b"longer", 3, 4), "states 3 triangles"),
            (b"short".to_vec(), "too short for binary STL: 5 bytes"),
            (format!("solid\n{}", &FACET[..FACET.find(" endloop").unwrap()]).into_bytes(), "it is cut"),
            (format!("solid\n{FACET}").into_bytes(), "expected `endsolid` behind triangle 1"),
            (
                format!("solid a\n{FACET}endsolid a\nsolid b\n{FACET}facet nor").into_bytes(),
                "expected `endsolid` behind triangle 2",
            ),
            (b"solid\nvertex 0 0 0\nendloop\n".to_vec(), "line 3: a triangle ends, and has 1 corners"),
            (
                b"solid\nfacet\nvertex 0 0,5 0\n".to_vec(),
                "line 3: a corner has a coordinate that is no finite number",
            ),
            (b"solid\rfacet\r\nvertex 0 0\r".to_vec(), "line 3: expected three coordinates, found 2"),
            (b"solid\nvertex 0 0\n".to_vec(), "line 2: expected three coordinates, found 2"),
            (b"solid\nvertices 0 0 0\n".to_vec(), "found `vertices`"),
        ] {
            let told = read(&bytes).unwrap_err();
            assert!(told.contains(part), "no {part:?} in {told}");
        }
    }
}
