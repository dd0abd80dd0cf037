//! Meshes in scenes: three formats of one shape, the points where a ray meets them, and the faults that are refused.

use nalgebra::Vector3;
use scenes::{Mesh, RayCaster, Scene, Solidity};
use std::io::Result as IoResult;
use std::path::Path;

/// Corners of a box of 1 by 2 by 3 whose lowest corner is the origin, by three bits.
fn corner(bits: u32) -> [f32; 3] {
    let along = |axis: u32, length: f32| if bits >> axis & 1 == 1 { length } else { 0.0 };
    [along(0, 1.0), along(1, 2.0), along(2, 3.0)]
}

/// Its triangles, counter-clockwise from outside.
const FACES: [[u32; 3]; 12] = [
    [0, 2, 3],
    [0, 3, 1],
    [4, 5, 7],
    [4, 7, 6],
    [0, 1, 5],
    [0, 5, 4],
    [2, 6, 7],
    [2, 7, 3],
    [0, 4, 6],
    [0, 6, 2],
    [1, 3, 7],
    [1, 7, 5],
];

fn obj() -> Vec<u8> {
    let corners = (0..8).map(corner).map(|[x, y, z]| format!("v {x} {y} {z}\n"));
    let faces = FACES.map(|face| format!("f {}\n", face.map(|corner| (corner + 1).to_string()).join(" ")));
    corners.chain(faces).collect::<String>().into_bytes()
}

fn ascii_stl() -> Vec<u8> {
    let facet = |face: [u32; 3]| {
        let line = |[x, y, z]: [f32; 3]| format!("vertex {x} {y} {z}\n");
        let loops: String = face.map(corner).map(line).concat();
        format!("facet normal 0 0 0\nouter loop\n{loops}endloop\nendfacet\n")
    };
    format!("solid box\n{}endsolid box\n", FACES.map(facet).concat()).into_bytes()
}

fn binary_stl() -> Vec<u8> {
    let mut bytes = vec![0; 80];
    bytes.extend(12_u32.to_le_bytes());
    for face in FACES {
        let numbers = [0.0; 3].into_iter().chain(face.into_iter().flat_map(corner));
        bytes.extend(numbers.flat_map(f32::to_le_bytes));
        bytes.extend([0, 0]);
    }
    bytes
}

/// The same with y up, as glTF has it, below a node that is `moved`.
fn glb(moved: &str) -> Vec<u8> {
    let y_up = |[x, y, z]: [f32; 3]| [x, z, -y];
    let mut blob: Vec<u8> = (0..8).map(corner).flat_map(y_up).flat_map(f32::to_le_bytes).collect();
    blob.extend(FACES.iter().flatten().flat_map(|&corner| u16::try_from(corner).unwrap().to_le_bytes()));
    let mut text = format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],
        "nodes":[{{"children":[1]{moved}}},{{"mesh":0}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":8,"type":"VEC3","min":[0,0,-2],"max":[1,3,0]}},
        {{"bufferView":1,"componentType":5123,"count":36,"type":"SCALAR"}}],
        "bufferViews":[{{"buffer":0,"byteOffset":0,"byteLength":96}},{{"buffer":0,"byteOffset":96,"byteLength":72}}],
        "buffers":[{{"byteLength":168}}]}}"#
    );
    text.push_str(&" ".repeat(text.len().next_multiple_of(4) - text.len()));
    let length = |bytes: usize| u32::try_from(bytes).unwrap().to_le_bytes();
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend(length(12 + 8 + text.len() + 8 + blob.len()));
    bytes.extend(length(text.len()));
    bytes.extend(b"JSON");
    bytes.extend(text.bytes());
    bytes.extend(length(blob.len()));
    bytes.extend(b"BIN\0");
    bytes.extend(blob);
    bytes
}

/// A scene with one mesh at `at` (m), read from `bytes`.
fn with_mesh(file: &str, more: &str, bytes: Vec<u8>) -> Result<Scene, String> {
    let number = |value: &str, unit: &str| {
        format!("{{ value = {value}, unit = \"{unit}\", source = \"test\", uncertainty = \"exact\" }}")
    };
    let scale =
        if file.ends_with(".glb") { String::new() } else { format!("scale = {}\n", number("1", "m")) };
    let more = more.replace("PLACE", &number("[10, 20, 0.5]", "m")).replace("TURN", &number("90", "deg"));
    let scene = format!("name = \"test\"\n[[meshes]]\nname = \"box\"\nfile = \"{file}\"\n{scale}{more}");
    let read = move |_: &Path| -> IoResult<Vec<u8>> { Ok(bytes.clone()) };
    Scene::parse_with(&scene, "test.toml", &read).map_err(|error| error.to_string())
}

const TURNED: &str = "position = PLACE\nyaw = TURN\nsolid = \"triangles\"\n";

/// The corners of each triangle, in any order.
fn triangles(mesh: &Mesh) -> Vec<[[i64; 3]; 3]> {
    let nanometres = |metres: f64| (metres * 1e9).round() as i64;
    let triangle = |face: &[u32; 3]| {
        let mut corners = face.map(|corner| mesh.corners_W_m[corner as usize].map(nanometres));
        // The sense of rotation stays.
        let first = (0..3).min_by_key(|&index| corners[index]).unwrap();
        corners.rotate_left(first);
        corners
    };
    let mut all: Vec<_> = mesh.faces.iter().map(triangle).collect();
    all.sort_unstable();
    all
}

/// Millimetres that are read as metres, and metres that are read as millimetres.
#[test]
fn a_mesh_of_implausible_size_is_doubted_with_its_scale() {
    let of = |factor: f32| {
        let corners =
            (0..8).map(corner).map(|[x, y, z]| format!("v {} {} {}\n", factor * x, factor * y, factor * z));
        let faces =
            FACES.map(|face| format!("f {}\n", face.map(|corner| (corner + 1).to_string()).join(" ")));
        let bytes = corners.chain(faces).collect::<String>().into_bytes();
        with_mesh("box.obj", TURNED, bytes).unwrap().meshes.remove(0).doubt()
    };
    assert_eq!([of(1.0), of(50.0), of(0.01)], [None, None, None]);
    let large = of(1000.0).unwrap();
    for part in [
        "mesh \"box\" measures 2000.0000 x 1000.0000 x 3000.0000 m",
        "check its `scale`: 0.001 times",
        "2.0000 x 1.0000 x 3.0000 m",
    ] {
        assert!(large.contains(part), "{part} is not in: {large}");
    }
    assert!(of(0.001).unwrap().contains("1000 times as large, as if metres were read as millimetres"));
}

#[test]
fn one_box_in_each_format_is_the_same_triangles_placed_and_turned() {
    let of = |file: &str, bytes| with_mesh(file, TURNED, bytes).unwrap().meshes.remove(0);
    let from_obj = of("box.obj", obj());
    let others = [
        of("box.STL", binary_stl()),
        of("box.stl", ascii_stl()),
        of("box.glb", glb("")),
        // Moved by (1, 0, 0) and back by the scale's sign being none: a node's place is heeded.
        of("box.glb", glb(r#","translation":[0,0,0],"scale":[1,1,1]"#)),
    ];
    assert_eq!(from_obj.faces.len(), 12);
    for other in &others {
        assert_eq!(triangles(other), triangles(&from_obj));
    }
    // x goes to y, y to -x.
    let extent = |axis: usize| {
        let all = || from_obj.corners_W_m.iter().map(|corner| corner[axis]);
        [all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max)]
    };
    for (axis, expected) in [[8.0, 10.0], [20.0, 21.0], [0.5, 3.5]].into_iter().enumerate() {
        let found = extent(axis);
        assert!((found[0] - expected[0]).abs() + (found[1] - expected[1]).abs() < 1e-9, "{found:?}");
    }
    assert_eq!(from_obj.edges().len(), 12, "of each side the diagonal is not seen");
}

#[test]
fn a_gltf_nodes_place_and_scale_are_heeded() {
    let place = "position = PLACE\nsolid = \"triangles\"\n";
    let of = |moved: &str| with_mesh("box.glb", place, glb(moved)).unwrap().meshes.remove(0);
    let moved = of(r#","translation":[1,2,3],"scale":[2,2,2]"#);
    let plain = of("");
    for (corner, before) in moved.corners_W_m.iter().zip(&plain.corners_W_m) {
        // y is up in the file: 2 up, and 3 against the world's y.
        let [x, y, z] = *before;
        let expected =
            [10.0 + 2.0 * (x - 10.0) + 1.0, 20.0 + 2.0 * (y - 20.0) - 3.0, 0.5 + 2.0 * (z - 0.5) + 2.0];
        let off = (0..3).map(|axis| (corner[axis] - expected[axis]).abs()).fold(0.0, f64::max);
        assert!(off < 1e-6, "{corner:?} {expected:?}");
    }
}

#[test]
fn a_mirrored_node_keeps_its_outside_outside() {
    let place = "position = PLACE\nsolid = \"convex\"\n";
    for moved in [
        r#","scale":[-1,1,1]"#,
        r#","scale":[1,-2,1]"#,
        r#","scale":[-1,-1,-1]"#,
        r#","scale":[-1,-1,1]"#,
        r#","matrix":[0,1,0,0, 1,0,0,0, 0,0,1,0, 0,0,0,1]"#,
    ] {
        let scene = with_mesh("box.glb", place, glb(moved)).unwrap_or_else(|told| panic!("{moved}: {told}"));
        assert!(scene.meshes[0].is_closed(), "{moved}");
    }
}

#[test]
fn a_node_below_itself_is_refused() {
    let children = br#""children":["#;
    let at = glb("").windows(children.len()).position(|bytes| bytes == children).unwrap() + children.len();
    let mut itself = glb("");
    itself[at] = b'0';
    assert!(with_mesh("box.glb", TURNED, itself).unwrap_err().contains("stands below itself"));
}

/// A wall of 4 by 3 with a doorway of 1 by 2, across the x axis.
const WALL: &str =
    "v 0 -1.5 0\nv 0 -0.5 0\nv 0 -0.5 2\nv 0 0.5 2\nv 0 0.5 0\nv 0 2.5 0\nv 0 2.5 3\nv 0 -1.5 3\n";

#[test]
fn a_wall_of_one_polygon_has_its_doorway() {
    for faces in ["f 1 2 3 4 5 6 7 8\n", "f 5 6 7 8 1 2 3 4\n", "f 8 7 6 5 4 3 2 1\n"] {
        let scene = with_mesh(
            "wall.obj",
            "position = PLACE\nsolid = \"triangles\"\n",
            format!("{WALL}{faces}").into(),
        )
        .unwrap();
        let caster = RayCaster::new(&scene);
        let meets = |y: f64, z: f64| {
            caster.distance_m(&Vector3::new(0.0, 20.0 + y, 0.5 + z), &Vector3::x(), 100.0).is_some()
        };
        assert!(!meets(0.0, 1.0) && !meets(0.4, 1.9) && !meets(-0.4, 0.1), "{faces}");
        assert!(meets(0.0, 2.5) && meets(-1.0, 1.0) && meets(1.5, 0.5) && meets(2.4, 2.9), "{faces}");
    }
}

#[test]
fn what_a_mesh_has_is_told() {
    let of =
        |file: &str, bytes: Vec<u8>| with_mesh(file, TURNED, bytes).unwrap().meshes.remove(0).to_string();
    let expected = "box: 12 triangles, closed, 2.000 x 1.000 x 3.000 m, from [8.000, 20.000, 0.500] to [10.000, 21.000, 3.500] m";
    for told in [
        of("box.obj", obj()),
        of("box.stl", ascii_stl()),
        of("box.stl", binary_stl()),
        of("box.glb", glb("")),
    ] {
        assert_eq!(told, expected);
    }
    let open = format!("{WALL}f 1 2 3 4 5 6 7 8\n");
    assert!(of("wall.obj", open.into()).starts_with("box: 6 triangles, open, "));
}

#[test]
fn a_mesh_of_a_size_that_nothing_has_is_refused() {
    let scaled = |factor: f64| {
        let corner = |bits| corner(bits).map(|length| f64::from(length) * factor);
        let corners = (0..8).map(corner).map(|[x, y, z]| format!("v {x:e} {y:e} {z:e}\n"));
        let faces =
            FACES.map(|face| format!("f {}\n", face.map(|corner| (corner + 1).to_string()).join(" ")));
        corners.chain(faces).collect::<String>().into_bytes()
    };
    for (factor, size) in [(1e30, "3e30 m"), (1e4, "3e4 m"), (1e-4, "e-4 m")] {
        let told = with_mesh("box.obj", TURNED, scaled(factor)).unwrap_err();
        assert!(
            told.contains("its longest side is") && told.contains(size) && told.contains("set `scale`"),
            "{told}"
        );
    }
    assert!(
        with_mesh("box.obj", TURNED, scaled(1e3)).is_ok()
            && with_mesh("box.obj", TURNED, scaled(1e-3)).is_ok()
    );
}

#[test]
fn rays_meet_the_triangles_and_the_hull() {
    for (solid, inside_m) in [("triangles", 1.0), ("convex", 0.0)] {
        let more = TURNED.replace("triangles", solid);
        let scene = with_mesh("box.obj", &more, obj()).unwrap();
        let is_hull = scene.meshes[0].solidity == Solidity::Convex;
        assert_eq!(is_hull, solid == "convex");
        let caster = RayCaster::new(&scene);
        let distance = |from: [f64; 3], along: [f64; 3]| {
            caster.distance_m(&Vector3::from(from), &Vector3::from(along), 100.0)
        };
        let near = |found: Option<f64>, expected: f64| {
            assert!((found.unwrap() - expected).abs() < 1e-9, "{solid}: {found:?}, expected {expected}");
        };
        near(distance([0.0, 20.5, 1.0], [1.0, 0.0, 0.0]), 8.0);
        near(distance([9.0, 30.0, 1.0], [0.0, -1.0, 0.0]), 9.0);
        near(distance([9.0, 20.5, 10.0], [0.0, 0.0, -1.0]), 6.5);
        // Below it is air, and the ground.
        near(distance([9.0, 20.5, 0.25], [0.0, 0.0, -1.0]), 0.25);
        assert_eq!(distance([0.0, 20.5, 0.25], [1.0, 0.0, 0.0]), None);
        // From inside: the next triangle of a shell, nothing of a solid.
        near(distance([9.0, 20.5, 1.0], [1.0, 0.0, 0.0]), inside_m);
        assert!((caster.clearance_m(&Vector3::new(9.0, 18.0, 1.0)) - 2.0).abs() < 1e-9);
    }
}

#[test]
fn what_is_no_mesh_is_refused_with_the_file_and_the_key() {
    let refused = |file: &str, more: &str, bytes: Vec<u8>, parts: &[&str]| {
        let told = with_mesh(file, more, bytes).unwrap_err();
        for part in ["test.toml:4:8", "meshes.0.file"].iter().chain(parts) {
            assert!(told.contains(part), "no {part:?} in {told}");
        }
    };
    refused("box.step", TURNED, obj(), &["box.step: a name that ends in none of .obj, .stl, .glb"]);
    refused("box.obj", TURNED, b"v 0 0 0\n".to_vec(), &["it holds no triangle"]);
    refused("box.obj", TURNED, b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n".to_vec(), &["box.obj"]);
    refused("box.obj", TURNED, b"v 0 0 0\nv 1 0 0\nv 0 nan 0\nf 1 2 3\n".to_vec(), &["no finite number"]);
    refused("box.stl", TURNED, b"solid nothing".to_vec(), &["box.stl"]);
    refused("box.stl", TURNED, binary_stl()[..300].to_vec(), &["box.stl"]);
    let whole = glb("").len();
    let cut = format!("it is cut: its head states {whole} bytes, and it has 500");
    refused("box.glb", TURNED, b"glTF\x02\0\0\0".to_vec(), &["box.glb", "it is cut"]);
    refused("box.glb", TURNED, glb("")[..500].to_vec(), &["box.glb", &cut]);
    refused("box.glb", TURNED, obj(), &["it is no binary glTF"]);
    let mut shorts = glb("");
    let of_corners = shorts.windows(4).position(|bytes| bytes == b"5126").unwrap();
    shorts[of_corners..][..4].copy_from_slice(b"5122");
    refused("box.glb", TURNED, shorts, &["its corners are whole numbers"]);
    let flat = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 3 4\n".to_vec();
    refused("box.obj", &TURNED.replace("triangles", "convex"), flat, &["it is flat or open"]);
    let mut dented = obj();
    dented.extend(b"v 0.5 1 1.5\nf 1 2 9\n");
    refused("box.obj", &TURNED.replace("triangles", "convex"), dented, &["it is not convex: the corner at"]);
    let line = b"v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n".to_vec();
    refused("box.obj", TURNED, line, &["each of its triangles is a line"]);
}

#[test]
fn keys_that_are_missing_or_unknown_are_named() {
    let named = |more: &str, part: &str| {
        let told = with_mesh("box.obj", more, obj()).unwrap_err();
        assert!(told.contains(part), "no {part:?} in {told}");
    };
    named("solid = \"triangles\"\n", "position");
    named("position = PLACE\n", "solid");
    named("position = PLACE\nsolid = \"hollow\"\n", "convex");
    named("position = PLACE\nsolid = \"triangles\"\ncolour = \"red\"\n", "colour");
    let glb_scaled = with_mesh("box.glb", "position = PLACE\nsolid = \"triangles\"\nscale = 1\n", glb(""));
    assert!(glb_scaled.unwrap_err().contains("scale"));
}

#[test]
fn a_mesh_file_that_is_not_there_is_named() {
    let told = Scene::load(Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/office.toml")));
    assert_eq!(told.unwrap().meshes.len(), 4);
    let scene = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/labyrinth.toml")).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("labyrinth.toml");
    std::fs::write(&path, scene).unwrap();
    assert_eq!(
        Scene::mesh_files(&inputs::InputFiles::default(), &path),
        [folder.path().join("meshes/labyrinth.stl")]
    );
    let told = Scene::load(&path).unwrap_err().to_string();
    assert!(told.contains("labyrinth.stl") && told.contains("No such file"), "{told}");
}

/// As scripts/furniture places them.
#[test]
fn the_furniture_of_the_office_is_where_its_file_puts_it() {
    let scene = Scene::load(Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/office.toml"))).unwrap();
    let caster = RayCaster::new(&scene);
    let down = |x: f64, y: f64, from_m: f64| {
        caster.distance_m(&Vector3::new(x, y, from_m), &-Vector3::z(), 10.0).unwrap()
    };
    let near =
        |found: f64, expected: f64| assert!((found - expected).abs() < 1e-6, "{found}, expected {expected}");
    near(down(1.2, 0.8, 2.0), 2.0 - 0.72); // the desk's top
    near(down(1.2, 1.7, 2.0), 2.0 - 0.97); // the lamp's tip
    near(down(-1.5, 2.3, 1.9), 1.9 - 1.5); // a shelf's fourth board
    near(down(-0.6, -1.2, 2.5), 2.5 - 1.98); // the other's fifth
    near(down(0.0, 0.0, 1.0), 1.0); // the floor
    assert_eq!(scene.name_of(4), Some("desk"));
}
