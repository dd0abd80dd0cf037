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
