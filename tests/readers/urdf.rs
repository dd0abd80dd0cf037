//! A reader of URDF files finds in them the vehicle of the vehicle file, and what it touches with.

use crate::{HUMMINGBUS, ROOT, hummingbus, readers};
use hummingbus::plant::{Airframe, contact_dynamics::hull::Hull};
use hummingbus::vehicles::Vehicle;
use nalgebra::{Matrix3, Rotation3, Vector3};
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};
use tempfile::TempDir;

const EXACT: f64 = 1e-9;

#[test]
fn mass_inertia_rotors_and_hull_are_those_of_the_vehicle_file() {
    let Some(readers) = readers() else { return };
    for name in ["hummingbird", "crazyflie-2.1", "hummingbird-uneven"] {
        let file = format!("{ROOT}/vehicles/{name}.toml");
        let (folder, found) = read(&readers, &file, &[]);
        let vehicle = Vehicle::load(file.as_ref()).unwrap();
        compare(&found, &vehicle).unwrap_or_else(|difference| panic!("{name}: {difference}"));
        assert_eq!(
            (&found["root"], found["links"].as_array().unwrap().len()),
            (&"hb_body".into(), 1),
            "{name}"
        );

        // The same comparison must notice what differs by a millionth.
        let written = fs::read_to_string(folder.path().join("vehicle.urdf")).unwrap();
        let mass = format!("<mass value=\"{}\"/>", vehicle.mass_kg);
        let heavier = format!("<mass value=\"{}\"/>", vehicle.mass_kg * (1.0 + 1e-6));
        let at = vehicle.rotors[1].position_m;
        let place = format!("propeller\"><origin xyz=\"{} {} {}\"", at.x + 0.0, at.y + 0.0, at.z + 0.0);
        let aside = format!("propeller\"><origin xyz=\"{} {} {}\"", at.x, at.y + 1e-6, at.z);
        for (from, to, what) in [(mass, heavier, "mass"), (place, aside, "propeller")] {
            assert_eq!(written.matches(&from).count(), 1, "{from}");
            let falsified = folder.path().join("falsified.urdf");
            fs::write(&falsified, written.replace(&from, &to)).unwrap();
            let difference = compare(&parsed(&readers, &falsified), &vehicle).unwrap_err();
            assert!(difference.contains(what), "{difference}");
        }
    }
}

#[test]
fn a_full_tensor_and_names_that_xml_would_take_for_its_own_are_read_as_they_are() {
    let Some(readers) = readers() else { return };
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("odd.toml");
    let text = fs::read_to_string(format!("{ROOT}/vehicles/hummingbird.toml")).unwrap();
    let source = "source = \"test\", uncertainty = \"exact\" }";
    let products = format!(
        "inertia_xy = {{ value = 1e-4, unit = \"kg*m^2\", {source}\ninertia_xz = {{ value = -2e-4, unit = \"kg*m^2\", \
         {source}\ninertia_yz = {{ value = 3e-4, unit = \"kg*m^2\", {source}\n\n[rotor]\n"
    );
    let text = text
        .replace("[rotor]\n", &products)
        .replace("name = \"AscTec Hummingbird\"", "name = 'a \"<b>\" & c'");
    fs::write(&file, text.replace("name = \"front\"", "name = 'front & <1>'")).unwrap();
    let (_folder, found) = read(&readers, &file.to_string_lossy(), &["--frame", "h1 & h2_body"]);
    let vehicle = Vehicle::load(&file).unwrap();
    compare(&found, &vehicle).unwrap_or_else(|difference| panic!("{difference}"));
    assert_eq!((&found["robot"], &found["root"]), (&"a \"<b>\" & c".into(), &"h1 & h2_body".into()));
    assert_eq!(vehicle.inertia_kg_m2[(0, 2)], -2e-4);
}

/// Returns the content of a vehicle file's URDF by a reader, and the folder of the URDF.
fn read(readers: &Path, file: &str, more: &[&str]) -> (TempDir, Value) {
    let folder = tempfile::tempdir().unwrap();
    let urdf = folder.path().join("vehicle.urdf");
    let args = [&["urdf", file, "--out"].map(AsRef::as_ref)[..], &[urdf.as_os_str()]].concat();
    hummingbus(&[args, more.iter().map(AsRef::as_ref).collect()].concat());
    let found = parsed(readers, &urdf);
    (folder, found)
}

fn parsed(readers: &Path, urdf: &Path) -> Value {
    let mut command = Command::new(readers.join("venv/bin/python"));
    command
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .arg(Path::new(ROOT).join("tests/readers/read_urdf.py"))
        .arg(urdf);
    let Output { status, stdout, stderr } = command.output().unwrap();
    let said = String::from_utf8_lossy(&stderr);
    // It tells on standard error of what it does not know.
    assert!(status.success() && said.is_empty(), "{said}");
    serde_json::from_slice(&stdout).unwrap()
}

fn compare(found: &Value, vehicle: &Vehicle) -> Result<(), String> {
    same("mass", &[found["mass"].as_f64().ok_or("no mass")?], &[vehicle.mass_kg])?;
    same("centre", &numbers(&found["centre"]), &[0.0; 3])?;
    let rows: Vec<f64> = found["inertia"].as_array().ok_or("no inertia")?.iter().flat_map(numbers).collect();
    let found_kg_m2 = Matrix3::from_row_slice(&rows);
    same("inertia", found_kg_m2.as_slice(), vehicle.inertia_kg_m2.as_slice())?;
    let hull = Hull::of(&Airframe::new(vehicle.clone()));
    rotors(found, vehicle, &hull)?;
    touching(found, &hull)
}

fn rotors(found: &Value, vehicle: &Vehicle, hull: &Hull) -> Result<(), String> {
    let seen = found["seen"].as_array().ok_or("nothing is seen")?;
    let arm_m = vehicle.rotors.iter().map(|rotor| (rotor.position_m - hull.centre_B_m).xy().norm());
    let radius_m = hull.disc_radius_m - arm_m.fold(0.0, f64::max);
    let mut colours = [None, None];
    for rotor in &vehicle.rotors {
        let named = |what: &str| {
            let name = format!("{} {what}", rotor.name);
            seen.iter().find(|part| part["name"] == name.as_str()).ok_or(format!("no {name}"))
        };
        let propeller = named("propeller")?;
        same(&format!("{} propeller", rotor.name), &numbers(&propeller["xyz"]), rotor.position_m.as_slice())?;
        same("radius of the propeller", &numbers(&propeller["size"])[..1], &[radius_m])?;
        let colour = colours[usize::from(rotor.spin > 0.0)].get_or_insert(&propeller["colour"]);
        if propeller["colour"] != **colour {
            return Err(format!("{} propeller has not the colour of its sense of rotation", rotor.name));
        }
        // Where the arm ends, seen from above.
        let arm = named("arm")?;
        let [roll, pitch, yaw] = numbers(&arm["rpy"])[..] else { return Err("rpy".to_owned()) };
        let half_m =
            Rotation3::from_euler_angles(roll, pitch, yaw) * Vector3::z() * numbers(&arm["size"])[1] / 2.0;
        let end_m = Vector3::from_column_slice(&numbers(&arm["xyz"])) + half_m;
        same(
            &format!("end of the {} arm", rotor.name),
            &end_m.as_slice()[..2],
            &rotor.position_m.as_slice()[..2],
        )?;
    }
    if colours[0] == colours[1] { Err("the senses of rotation look alike".to_owned()) } else { Ok(()) }
}

fn touching(found: &Value, hull: &Hull) -> Result<(), String> {
    let [disc, feet @ ..] = &found["touching"].as_array().ok_or("nothing touches")?[..] else {
        return Err("nothing touches".to_owned());
    };
    same("place of the disc", &numbers(&disc["xyz"]), hull.centre_B_m.as_slice())?;
    same("turn of the disc", &numbers(&disc["rpy"]), &[0.0; 3])?;
    same("disc", &numbers(&disc["size"]), &[hull.disc_radius_m, 2.0 * hull.disc_half_m])?;
    if feet.len() != 4 {
        return Err(format!("{} feet", feet.len()));
    }
    for (foot, expected_m) in feet.iter().zip(hull.feet_B_m) {
        same("foot", &numbers(&foot["xyz"]), expected_m.as_slice())?;
        same("radius of a foot", &numbers(&foot["size"]), &[hull.foot_radius_m])?;
    }
    Ok(())
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().into_iter().flatten().filter_map(Value::as_f64).collect()
}

/// Relative to the largest, so that the tensor of a light vehicle is held as closely as that of a heavy one.
fn same(what: &str, found: &[f64], expected: &[f64]) -> Result<(), String> {
    let size = expected.iter().fold(0.0_f64, |size, value| size.max(value.abs()));
    let is_same = |(a, b): (&f64, &f64)| (a - b).abs() <= EXACT * if size > 0.0 { size } else { 1.0 };
    if found.len() == expected.len() && found.iter().zip(expected).all(is_same) {
        Ok(())
    } else {
        Err(format!("{what}: expected {expected:?}, found {found:?}"))
    }
}

/// The layout for Foxglove holds the Hummingbird's body, since a layer's path would have to be absolute.
#[test]
fn the_layout_for_foxglove_holds_the_body_of_the_hummingbird() {
    let vehicle = format!("{ROOT}/vehicles/hummingbird.toml");
    let output = Command::new(HUMMINGBUS).args(["urdf", &vehicle]).output().unwrap();
    let plain = |byte: &u8| byte.is_ascii_alphanumeric() || b"_.-~/:;,=!?".contains(byte);
    let escaped =
        |byte: &u8| if plain(byte) { char::from(*byte).to_string() } else { format!("%{byte:02X}") };
    let expected: String = output.stdout.iter().map(escaped).collect();
    let text = fs::read_to_string(Path::new(ROOT).join("docs/foxglove-layout.json")).unwrap();
    let layout: Value = serde_json::from_str(&text).unwrap();
    let layer = &layout["configById"]["3D!space"]["layers"]["airframe"];
    let url = layer["url"].as_str().unwrap();
    let told = "write it anew: \"data:application/xml,\" and urllib.parse.quote(what `hummingbus urdf` prints, safe=\"/:;,=!?\")";
    assert!(url == format!("data:application/xml,{expected}"), "{told}");
    assert_eq!((&layer["layerId"], &layer["sourceType"]), (&"foxglove.Urdf".into(), &"url".into()));
}
