//! Friction and restitution of a scene file: the things that they belong to, and their values.

use scenes::{Scene, Surface};

fn ratio(key: &str, value: f64) -> String {
    format!("{key} = {{ value = {value}, unit = \"1\", source = \"test\", uncertainty = \"exact\" }}\n")
}

/// A box with these keys in its table, in a scene with those above.
fn scene(above: &str, within: &str) -> Result<Scene, diagnostics::Diagnostic> {
    let vector = "{ value = [1, 1, 1], unit = \"m\", source = \"test\", uncertainty = \"exact\" }";
    let cuboid = format!("[[boxes]]\nname = \"crate\"\ncentre = {vector}\nsize = {vector}\n");
    Scene::parse(&format!("name = \"test\"\n{above}{cuboid}{within}"), "test.toml")
}

#[test]
fn a_box_has_its_own_surface_or_the_grounds_and_that_its_own_or_the_default() {
    let default = Surface::default();
    let plain = scene("", "").unwrap();
    assert_eq!((plain.surface, plain.boxes[0].surface), (default, default));
    let above = ratio("friction", 0.3) + &ratio("restitution", 0.9);
    let inherited = scene(&above, "").unwrap();
    let ground = Surface { friction: 0.3, restitution: 0.9 };
    assert_eq!((inherited.surface, inherited.boxes[0].surface), (ground, ground));
    let own = scene(&above, &ratio("restitution", 0.0)).unwrap();
    assert_eq!((own.surface, own.boxes[0].surface), (ground, Surface { restitution: 0.0, ..ground }));
}

#[test]
fn what_no_surface_has_is_refused_with_its_key() {
    for (key, value) in [("friction", -0.1), ("friction", 11.0), ("restitution", -0.1), ("restitution", 1.01)]
    {
        for (above, within) in [(ratio(key, value), String::new()), (String::new(), ratio(key, value))] {
            let error = scene(&above, &within).unwrap_err().to_string();
            assert!(error.contains(key) && error.contains(&value.to_string()), "{error}");
        }
    }
    let both = ratio("friction", -0.1) + &ratio("restitution", 0.3);
    let error = scene(&both, "").unwrap_err().to_string();
    assert!(!error.contains("restitution"), "what is right is not told: {error}");
    let error = scene("friction = 0.5\n", "").unwrap_err().to_string();
    assert!(error.contains("friction"), "a number without unit and source: {error}");
}

#[test]
fn all_faults_of_all_things_are_told() {
    let number = |value: &str, unit: &str| {
        format!("{{ value = {value}, unit = \"{unit}\", source = \"test\", uncertainty = \"exact\" }}")
    };
    let (point, size) = (number("[1, 0]", "m"), number("[0, 1, 1]", "kg"));
    let (rate, mass) = (number("2", "1"), number("-1", "kg"));
    let lines: [&str; 7] = [
        "name = \"\"",
        "friction = 1",
        &format!("restitution = {rate}"),
        &format!("[[boxes]]\nname = 3\ncentre = {point}\nsize = {size}\nmass = {mass}"),
        "[[balls]]\nname = \"a\"\npaint = 1",
        "[[meshes]]\nname = \"b\"\nfile = \"none.obj\"\nsolid = \"yes\"",
        "[rig]\nheave = 1\nsway = 2",
    ];
    let error = Scene::parse(&lines.join("\n"), "test.toml").unwrap_err();
    let keys: Vec<String> = error.all().map(|fault| fault.key().to_owned()).collect();
    for key in [
        "name",
        "friction",
        "restitution",
        "boxes.0.name",
        "boxes.0.centre.value",
        "boxes.0.size.unit",
        "boxes.0.mass",
        "balls.0.centre",
        "balls.0.radius",
        "balls.0.paint",
        "meshes.0.file",
        "meshes.0.position",
        "meshes.0.scale",
        "meshes.0.solid",
        "rig.bearing",
        "rig.heave",
        "rig.sway",
    ] {
        assert_eq!(keys.iter().filter(|told| *told == key).count(), 1, "{key} in {keys:?}");
    }
    let lines: Vec<usize> = error.all().filter_map(|fault| Some(fault.place?.line)).collect();
    assert!(lines.is_sorted(), "{error}");
}
