//! Vehicle files from URDF and SDF: numbers against closed forms by hand, and errors with their places.

use nalgebra::{Matrix3, Vector3};
use proptest::prelude::*;
use vehicles::from_model::{Converted, convert, convert_with};
use vehicles::{MotorModel, Vehicle};

const URDF: &str = include_str!("models/plus.urdf");
const SDF: &str = include_str!("models/cross.sdf");

fn close(found: f64, expected: f64, what: &str) {
    assert!(
        (found - expected).abs() <= 1e-9 * expected.abs().max(1e-9),
        "{what}: {found}, by hand {expected}"
    );
}

fn of(text: &str, file: &str) -> Converted {
    convert(text, file).unwrap_or_else(|error| panic!("{error:#}"))
}

/// The tensor of point masses about their common centre of mass, by its definition: the sum of m (r^2 1 - r r^T).
fn of_points(points: &[(f64, [f64; 3])], centre: Vector3<f64>) -> Matrix3<f64> {
    let one = |(mass, place): &(f64, [f64; 3])| {
        let [x, y, z] = [place[0] - centre.x, place[1] - centre.y, place[2] - centre.z];
        *mass
            * Matrix3::new(
                y * y + z * z,
                -x * y,
                -x * z,
                -x * y,
                x * x + z * z,
                -y * z,
                -x * z,
                -y * z,
                x * x + y * y,
            )
    };
    points.iter().map(one).sum()
}

#[test]
fn a_urdf_gives_mass_centre_inertia_and_places_of_a_closed_form() {
    let made = of(URDF, "models/plus.urdf");
    let vehicle = &made.vehicle;
    // base 0.6 kg at 0; battery 0.2 kg at (0.03, 0, -0.05): the joint at (0.03, 0, -0.03), its link 0.02 m below.
    // Four rotors of 0.01 kg, 0.2 m from the origin and 0.02 m above. In all 0.84 kg.
    close(vehicle.mass_kg, 0.84, "mass");
    let centre = Vector3::new(0.2 * 0.03, 0.0, 0.2 * -0.05 + 4.0 * 0.01 * 0.02) / 0.84;
    let hubs = [[0.2, 0.0, 0.02], [0.0, -0.2, 0.02], [-0.2, 0.0, 0.02], [0.0, 0.2, 0.02]];
    let mut points = vec![(0.6, [0.0; 3]), (0.2, [0.03, 0.0, -0.05])];
    points.extend(hubs.map(|hub| (0.01, hub)));
    // The battery's axes are turned by 90 degrees about z: its x moment is about the body's y.
    let own = Matrix3::from_diagonal(&Vector3::new(
        0.004 + 2e-4 + 4.0 * 2e-5,
        0.005 + 1e-4 + 4.0 * 2e-5,
        0.008 + 2.5e-4 + 4.0 * 4e-5,
    ));
    let expected = own + of_points(&points, centre);
    for (found, expected) in vehicle.inertia_kg_m2.iter().zip(expected.iter()) {
        close(*found, *expected, "inertia");
    }
    assert!(vehicle.inertia_kg_m2[(0, 2)].abs() > 1e-5, "the battery makes a product of inertia");
    for (rotor, (hub, name)) in vehicle.rotors.iter().zip(hubs.iter().zip(["front", "right", "rear", "left"]))
    {
        assert_eq!(rotor.name, format!("rotor_{name}"));
        for axis in 0..3 {
            close(rotor.position_m[axis], hub[axis] - centre[axis], "hub");
        }
    }
    assert_eq!(vehicle.rotors.iter().map(|rotor| rotor.spin).collect::<Vec<_>>(), [-1.0, 1.0, -1.0, 1.0]);
    close(vehicle.rotor_inertia_kg_m2, 4e-5, "inertia of a rotor");
}

#[test]
fn numbers_that_a_urdf_has_not_are_the_hummingbirds_scaled_and_listed() {
    let made = of(URDF, "plus.urdf");
    let bird = Vehicle::parse(vehicles::reference::HUMMINGBIRD, "hummingbird.toml").unwrap();
    // As heavy a vehicle hovers at the same speed.
    close(made.vehicle.hover_speed_rad_s(), bird.hover_speed_rad_s(), "hover");
    close(made.vehicle.command.speed_at_max_rad_s, bird.command.speed_at_max_rad_s, "largest speed");
    assert_eq!(made.vehicle.motor, bird.motor);
    let keys: Vec<&str> = made.assumed.iter().map(|line| line.split(':').next().unwrap()).collect();
    for key in ["rotor.thrust_coefficient", "rotor.torque_coefficient", "motor.damping_ratio"] {
        assert!(keys.contains(&key), "{key} is not among {keys:?}");
    }
    assert!(made.text.contains("standard gravity") && !keys.contains(&"body.gravity"), "{keys:?}");
    close(made.vehicle.gravity_m_s2, 9.80665, "standard gravity");
    assert!(!keys.contains(&"rotor.inertia") && !keys.contains(&"body.mass"), "{keys:?}");
    let numbers = made.text.lines().filter(|line| line.contains(" = "));
    for line in numbers.filter(|line| *line != "name = \"plus\"") {
        let is_told = line.contains(" # from plus.urdf: ")
            || line.contains(" # not in plus.urdf: ")
            || line.ends_with(" # chosen: standard gravity");
        assert!(is_told, "no origin: {line}");
    }
    let assumed = made.text.lines().filter(|line| line.contains(" # not in ")).count();
    assert_eq!(assumed, made.assumed.len());
}

#[test]
fn an_sdf_gives_what_its_plugins_say_in_the_order_of_their_numbers() {
    let made = of(SDF, "cross.sdf");
    let vehicle = &made.vehicle;
    // From the model's frame: body 1.46 kg at (0.01, 0, 0.1), gps 0.02 kg at (0, 0, 0.15), four rotors of 5 g at z = 0.13.
    close(vehicle.mass_kg, 1.5, "mass");
    let centre = Vector3::new(1.46 * 0.01 / 1.5, 0.0, (1.46 * 0.1 + 0.02 * 0.15 + 4.0 * 0.005 * 0.13) / 1.5);
    let hubs = [[0.15, -0.2, 0.13], [-0.15, 0.2, 0.13], [0.15, 0.2, 0.13], [-0.15, -0.2, 0.13]];
    let mut points = vec![(1.46, [0.01, 0.0, 0.1]), (0.02, [0.0, 0.0, 0.15])];
    points.extend(hubs.map(|hub| (0.005, hub)));
    // The gps is turned by 90 degrees about z.
    let own = Matrix3::from_diagonal(&Vector3::new(
        0.02 + 3e-6 + 4.0 * 1e-6,
        0.03 + 2e-6 + 4.0 * 3e-5,
        0.04 + 4e-6 + 4.0 * 3.1e-5,
    ));
    for (found, expected) in vehicle.inertia_kg_m2.iter().zip((own + of_points(&points, centre)).iter()) {
        close(*found, *expected, "inertia");
    }
    for (rotor, hub) in vehicle.rotors.iter().zip(hubs) {
        for axis in 0..3 {
            close(rotor.position_m[axis], hub[axis] - centre[axis], "hub");
        }
    }
    assert_eq!(vehicle.rotors.iter().map(|rotor| rotor.spin).collect::<Vec<_>>(), [1.0, 1.0, -1.0, -1.0]);
    close(vehicle.thrust_coefficient, 8.5e-6, "thrust coefficient");
    close(vehicle.torque_coefficient, 8.5e-6 * 0.016, "torque coefficient");
    // The plugins turn the links at a tenth of the speed unless they say otherwise.
    close(vehicle.rotor_inertia_kg_m2, 3.1e-6, "inertia of a rotor");
    assert_eq!(vehicle.motor, MotorModel::FirstOrder { time_constant_s: 0.0125 });
    assert_eq!((vehicle.command.speed_at_min_rad_s, vehicle.command.speed_at_max_rad_s), (0.0, 800.0));
    let text = &made.text;
    assert!(text.contains("timeConstantUp; timeConstantDown is 0.025 s"), "{text}");
    let keys: Vec<&str> = made.assumed.iter().map(|line| line.split(':').next().unwrap()).collect();
    assert_eq!(keys, ["command.min", "command.max", "command.speed_at_min"]);
    let lags = "timeConstantUp is 0.0125 s and timeConstantDown 0.025 s";
    assert!(made.notes.len() == 1 && made.notes[0].starts_with(lags), "{:?}", made.notes);
    let weak = of(&SDF.replace("<maxRotVelocity>800.0", "<maxRotVelocity>600.0"), "cross.sdf");
    // 4 c 600^2 = 12.24 N, and 1.5 kg weigh 14.710 N.
    assert!(weak.notes[1].contains("12.240 N") && weak.notes[1].contains("14.710 N"), "{:?}", weak.notes);
}

#[test]
fn what_is_wrong_with_a_model_is_told_with_its_line() {
    let refused = |text: &str, file: &str, place: &str, parts: &[&str]| {
        let error = convert(text, file).map(|made| made.text).unwrap_err().to_string();
        assert!(error.starts_with(&format!("{file}{place}")), "{error}");
        parts.iter().for_each(|part| assert!(error.contains(part), "no `{part}` in {error}"));
    };
    let urdf = |from: &str, to: &str, place: &str, parts: &[&str]| {
        assert!(URDF.contains(from), "{from}");
        refused(&URDF.replacen(from, to, 1), "quad.urdf", place, parts);
    };
    let sdf = |from: &str, to: &str, place: &str, parts: &[&str]| {
        assert!(SDF.contains(from), "{from}");
        refused(&SDF.replacen(from, to, 1), "quad.sdf", place, parts);
    };
    urdf("<mass value=\"0.6\"/>", "", ":5:5", &["base_link", "<mass>"]);
    urdf("<mass value=\"0.6\"/>", "<mass value=\"-1\"/>", ":5:5", &["base_link", "-1 kg"]);
    urdf("<mass value=\"0.6\"/>", "<mass value=\"nan\"/>", ":6:7", &["finite number", "`nan`"]);
    urdf("<mass value=\"0.6\"/>", "<mass value=\"${m}\"/>", ":6:13", &["xacro FILE.xacro"]);
    urdf("<link name=\"camera\"/>", "<xacro:mast/>", ":11:4", &["xacro FILE.xacro"]);
    urdf("ixx=\"0.004\"", "ixx=\"0\"", ":5:5", &["base_link", "above 0"]);
    urdf("izz=\"0.008\"", "izz=\"0.0095\"", ":5:5", &["base_link", "sum of the other two"]);
    urdf("<link name=\"camera\"/>", "<link name=\"battery\"/>", "", &["`battery` twice"]);
    urdf("<child link=\"camera\"/>", "<child link=\"base_link\"/>", "", &["expected"]);
    urdf("<child link=\"camera\"/>", "<child link=\"camra\"/>", ":12:3", &["camera_mount", "`camra`"]);
    urdf("<child link=\"camera\"/>", "<child link=\"battery\"/>", "", &["`battery`", "two", "camera_mount"]);
    urdf(
        "<link name=\"camera\"/>",
        "<link name=\"camera\"/><link name=\"lost\"/>",
        ":11:",
        &["`base_link` and `lost`"],
    );
    let ring = "<link name=\"a\"/><link name=\"b\"/><joint name=\"ab\" type=\"fixed\"><parent link=\"a\"/><child link=\"b\"/></joint>\
                <joint name=\"ba\" type=\"fixed\"><parent link=\"b\"/><child link=\"a\"/></joint></robot>";
    urdf("</robot>", ring, "", &["cycle", "joint `ab`"]);
    urdf("</robot>", "", ":", &["expected XML; the reader says: "]);
    urdf("<axis xyz=\"0 0 1\"/>", "<axis xyz=\"1 0 0\"/>", "", &["rotor_left_joint", "along z"]);
    let many = URDF.replace("</robot>", &(0..9).map(|number| another_rotor(number, 0.5)).collect::<String>())
        + "</robot>";
    refused(&many, "quad.urdf", "", &["expected 1 to 12 rotors, found 13", "rename the others"]);
    refused(&URDF.replace("rotor_", "part_"), "quad.urdf", "", &["found none", "`rotor`"]);
    refused("<robot name=\"q\"><link name=\"a\"/></robot>", "quad.urdf", "", &["with mass, found none"]);
    refused("<robot name=\"q\"/>", "quad.urdf", "", &["with links, found none"]);
    refused("<mujoco/>", "x2.xml", ":1:1", &["<mujoco>", "URDF or SDF"]);
    refused("", "quad.urdf", ":1:1", &["expected XML"]);
    refused("<robot>\n</robot\n", "quad.urdf", ":2:8", &["expected XML"]);
    refused("<robot>\n  <link", "quad.urdf", ":2:", &["expected XML"]);
    urdf("?>", ">", ":", &["expected XML"]);
    urdf("-->", ">", ":", &["expected XML"]);
    let deep = format!("<robot name=\"q\">{}{}</robot>", "<a>".repeat(100), "</a>".repeat(100));
    refused(&deep, "quad.urdf", ":1:", &["at most 64 deep"]);
    let many = format!("<robot name=\"q\">{}</robot>", "<a/>".repeat(100_001));
    refused(&many, "quad.urdf", "", &["at most 100000 elements"]);
    sdf("<mass>1.46</mass>", "", ":9:9", &["body", "<mass>", "Gazebo would take 1 kg"]);
    sdf("<pose relative_to=\"body\"", "<pose relative_to=\"gps\"", "", &["cycle"]);
    sdf("<pose relative_to=\"body\"", "<pose relative_to=\"bdy\"", ":15:", &["`bdy`"]);
    sdf(">ccw<", ">left<", "", &["turningDirection", "`left`"]);
    sdf("8.5e-06", "9.5e-06", "", &["motorConstant", "same for all rotors", "0.0000095"]);
    sdf("<jointName>rotor_2_joint", "<jointName>rotor_9_joint", "", &["rotor_9_joint"]);
    sdf("<jointName>rotor_2_joint", "<jointName>rotor_0_joint", "", &["two for `rotor_0_joint`"]);
    urdf("<mass value=\"0.6\"/>", "<mass value=\"1e7\"/>", ":5:5", &["base_link", "at most 1000000 kg"]);
    let far = "<origin xyz=\"0 0 -200\"";
    urdf("<origin xyz=\"0 0 -0.02\"", far, ":18:5", &["battery", "within 100 m", "-2.0003e2"]);
    let wide = URDF
        .replacen("<inertial>", "<inertial><origin xyz=\"-90 0 0\"/>", 1)
        .replace("<origin xyz=\"0.2 0 0\"", "<origin xyz=\"99 0 0\"");
    refused(
        &wide,
        "quad.urdf",
        ":60:3",
        &["distance from the centre of mass of rotor rotor_front", "100.0 m"],
    );
    sdf(
        "type=\"revolute\"",
        "type=\"prismatic\"",
        ":30:7",
        &["rotor_0_joint", "revolute, continuous or fixed"],
    );
    let heavy =
        URDF.replace("<mass value=\"0.6\"/>", "<mass value=\"9e5\"/>").replace("\"0.2\"/>", "\"8e5\"/>");
    refused(&heavy, "quad.urdf", ":5:5", &["mass of all links", "1700000.04 kg"]);
    let weak = without("maxRotVelocity").replace("8.5e-06", "1e-13");
    refused(&weak, "quad.sdf", ":81:7", &["largest speed of the rotors", "<motorConstant>"]);
    sdf(">0.016<", ">1e9<", ":79:9", &["momentConstant", "10.0 m"]);
    sdf(">800.0<", ">1e9<", ":77:9", &["maxRotVelocity", "rad/s"]);
    sdf(">0.0125<", ">1e9<", ":75:9", &["timeConstantUp", "100.0 s"]);
    sdf(">8.5e-06<", ">1e-40<", ":78:9", &["motorConstant", "N/(rad/s)^2"]);
    sdf(">2<", ">2.5<", ":80:9", &["actuator_number", "whole number"]);
    // The first plugin is that of rotor_2, at line 71.
    sdf("<actuator_number>2</actuator_number>", "", ":71:7", &["motorNumber", "none for `rotor_2_joint`"]);
    sdf("actuator_number>3<", "actuator_number>0<", ":93:7", &["0 for `rotor_0_joint` and `rotor_3_joint`"]);
    sdf("<turningDirection>cw</turningDirection>", "", ":71:7", &["turningDirection", "`rotor_2_joint`"]);
    let (low, head) = ("0.15 -0.2 0.03 0 0 0", ":23:7");
    sdf(low, "0.15 -0.2 0.03 3.141592653589793 0 0", head, &["rotor_0_joint", "upwards", "-1.0000]"]);
    let fixed = |text: &str| {
        text.replace(
            "<joint name=\"rotor_0_joint\" type=\"revolute\">",
            "<joint name=\"rotor_0_joint\" type=\"fixed\">",
        )
    };
    for turn in ["3.141592653589793 0 0", "0 1.5 0"] {
        let text = fixed(&SDF.replace(low, &format!("0.15 -0.2 0.03 {turn}")));
        refused(&text, "quad.sdf", head, &["rotor_0_joint", "z points upwards"]);
    }
    sdf(
        "<model name=\"cross\">",
        "<model name=\"cross\"><include><uri>model://x</uri></include>",
        ":5:",
        &["<include> of `model://x`", "another file", "GAZEBO_MODEL_PATH"],
    );
    sdf(
        "<model name=\"cross\">",
        "<model name=\"cross\"><model name=\"arm\"><link name=\"tip\"><inertial><mass>0.1</mass><inertia><ixx>1e-5</ixx>\
         <iyy>1e-5</iyy><izz>1e-5</izz></inertia></inertial></link></model>",
        ":5:",
        &["expected one link without a parent", "`arm::tip`"],
    );
    refused(
        "<sdf version=\"1.9\"><world name=\"w\"><include><uri>model://quad</uri></include></world></sdf>",
        "quad.sdf",
        ":1:",
        &["<include> of `model://quad`", "GAZEBO_MODEL_PATH"],
    );
    sdf(
        "<model name=\"cross\">",
        "<gravity>0 9</gravity><model name=\"cross\">",
        ":5:",
        &["gravity", "3 finite numbers"],
    );
}

/// A link and a joint of one more rotor, ahead of the others by `x` m.
fn another_rotor(number: usize, x: f64) -> String {
    format!(
        "<link name=\"rotor_{number}\"><inertial><mass value=\"0.01\"/><inertia ixx=\"2e-5\" ixy=\"0\" ixz=\"0\" iyy=\"2e-5\" \
         iyz=\"0\" izz=\"4e-5\"/></inertial></link><joint name=\"rotor_{number}_joint\" type=\"continuous\"><origin \
         xyz=\"{x} {} 0\"/><parent link=\"base_link\"/><child link=\"rotor_{number}\"/><axis xyz=\"0 0 1\"/></joint>",
        if number.is_multiple_of(2) { 0.3 } else { -0.3 }
    )
}

#[test]
fn models_of_other_counts_share_the_weight_between_their_rotors() {
    let bird = Vehicle::parse(vehicles::reference::HUMMINGBIRD, "hummingbird.toml").unwrap();
    for more in [2, 4, 8] {
        let added: String =
            (0..more).map(|number| another_rotor(number, 0.1 * (1 + number / 2) as f64)).collect();
        let made = of(&(URDF.replace("</robot>", &added) + "</robot>"), "more.urdf");
        assert_eq!(made.vehicle.rotors.len(), 4 + more);
        close(made.vehicle.mass_kg, 0.84 + 0.01 * more as f64, "mass");
        // As heavy a vehicle hovers at the same speed, however many rotors carry it.
        close(made.vehicle.hover_speed_rad_s(), bird.hover_speed_rad_s(), "hover");
        assert_eq!(made.vehicle.rotors.iter().map(|rotor| rotor.spin).sum::<f64>(), 0.0);
    }
    let three = of(&URDF.replacen("type=\"continuous\"", "type=\"fixed\"", 1), "tri.urdf");
    assert_eq!(three.vehicle.rotors.len(), 3);
    assert!(
        three.notes.iter().any(|note| note.starts_with("3 rotors: controllers need four")),
        "{:?}",
        three.notes
    );
}

/// A part of 10 g, 3 cm beside the origin of its model.
const PART: &str = "<sdf version=\"1.6\">\n<model name=\"part\"><pose>9 9 9 0 0 0</pose>\n<link name=\"link\"><pose>0.03 0 0 0 0 0</pose>\n\
                    <inertial><mass>0.01</mass><inertia><ixx>1e-6</ixx><iyy>1e-6</iyy><izz>1e-6</izz></inertia></inertial></link>\n\
                    </model></sdf>";

#[test]
fn a_model_within_the_model_is_a_part_of_it_in_the_file_or_in_another() {
    let joint =
        "<joint name=\"part_joint\" type=\"fixed\"><parent>body</parent><child>part0::link</child></joint>";
    // Turned by 90 degrees about z: its link lies 3 cm to the left of the place.
    let pose = "<pose>0.05 0 0.04 0 0 1.5707963267948966</pose>";
    let part = PART.replace("name=\"part\"", "name=\"part0\"").replace("<pose>9 9 9 0 0 0</pose>", pose);
    let inner = part.replace("<sdf version=\"1.6\">\n", "").replace("</sdf>", "");
    let include = format!("<include>\n<uri>model://part</uri>{pose}<name>part0</name></include>");
    let flat = "<link name=\"p\"><pose>0.05 0.03 0.04 0 0 1.5707963267948966</pose><inertial><mass>0.01</mass><inertia>\
                <ixx>1e-6</ixx><iyy>1e-6</iyy><izz>1e-6</izz></inertia></inertial></link>";
    let with = |part: &str, joint: &str| {
        let text = SDF.replacen("<model name=\"cross\">", &format!("<model name=\"cross\">{part}{joint}"), 1);
        convert_with(&text, "cross.sdf", &|uri| (uri == "model://part").then(|| Ok(PART.to_owned()))).unwrap()
    };
    let flat = with(flat, &joint.replace("part0::link", "p"));
    for part in [inner, include] {
        let made = with(&part, joint);
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} {b}");
        close(made.vehicle.mass_kg, flat.vehicle.mass_kg);
        close(made.vehicle.mass_kg, of(SDF, "cross.sdf").vehicle.mass_kg + 0.01);
        for (a, b) in made.vehicle.inertia_kg_m2.iter().zip(flat.vehicle.inertia_kg_m2.iter()) {
            close(*a, *b);
        }
        let rotors = made.vehicle.rotors.iter().zip(&flat.vehicle.rotors);
        rotors.for_each(|(a, b)| close((a.position_m - b.position_m).norm(), 0.0));
    }
}

#[test]
fn an_included_model_that_cannot_be_read_or_includes_itself_is_refused() {
    let include = "<model name=\"cross\"><include><uri>model://part</uri></include>";
    let text = SDF.replacen("<model name=\"cross\">", include, 1);
    let refused = |read: &dyn Fn(&str) -> Option<Result<String, String>>| {
        convert_with(&text, "cross.sdf", read).unwrap_err().to_string()
    };
    let unreadable = refused(&|_| Some(Err("cannot read part.sdf: no rights".to_owned())));
    assert!(unreadable.contains("cross.sdf:5:") && unreadable.contains("no rights"), "{unreadable}");
    let other = refused(&|_| Some(Ok("<robot name=\"q\"/>".to_owned())));
    assert!(other.contains("its file has no <model>"), "{other}");
    let endless = refused(&|_| Some(Ok(format!("<sdf>{include}</model></sdf>"))));
    assert!(endless.contains("include each other at most 8 deep"), "{endless}");
}

#[test]
fn gravity_and_other_models_of_a_world_are_noted() {
    let noted = |from: &str, to: &str| {
        assert!(SDF.contains(from), "{from}");
        let (plain, made) = (of(SDF, "cross.sdf"), of(&SDF.replacen(from, to, 1), "cross.sdf"));
        assert_eq!(made.text, plain.text);
        made.notes.into_iter().filter(|note| !plain.notes.contains(note)).collect::<Vec<_>>()
    };
    let world = |added: &str| noted("<model name=\"cross\">", &format!("{added}<model name=\"cross\">"));
    assert_eq!(world("<gravity>0 0 -9.8</gravity>"), [""; 0]);
    let mars = world("<gravity>0 0 -3.71</gravity>");
    assert!(
        mars.len() == 1 && mars[0].contains("[0, 0, -3.71] m/s^2") && mars[0].contains("body.gravity"),
        "{mars:?}"
    );
    let included = world("<include><uri>model://sun</uri></include><include/>");
    assert!(
        included.len() == 1 && included[0].contains("model://sun, a model without <uri> beside"),
        "{included:?}"
    );
    assert_eq!(noted("<link name=\"gps\">", "<link name=\"gps\"><gravity>1</gravity>"), [""; 0]);
    let off = noted("<link name=\"gps\">", "<link name=\"gps\"><gravity>false</gravity>");
    assert!(off.len() == 1 && off[0].contains("off for gps"), "{off:?}");
}

#[test]
fn comments_within_a_text_change_no_number() {
    let plain = of(SDF, "cross.sdf");
    for (from, to) in [
        (">0.01 0 0 0 0 0</pose>", "><!-- x -->0.01 0 <!-- y --> 0 0 0 0</pose>"),
        (">1.46<", ">1<!-- c -->.46<"),
        (">0.02<", "><!-- c -->0.0<!-- d -->2<"),
        (">0 0 1</xyz>", "><!-- axis -->0 0 1</xyz>"),
        (">ccw<", "><!-- not cw -->ccw<"),
        ("<parent>body<", "<parent><!-- root -->bo<!-- -->dy<"),
        (">0.016<", ">0.<?pi?>01<!-- x -->6<"),
    ] {
        assert!(SDF.contains(from), "{from}");
        assert_eq!(of(&SDF.replace(from, to), "cross.sdf"), plain, "{to}");
    }
    let divided = SDF.replace(">1.46<", ">1<b/>.46<");
    let error = convert(&divided, "cross.sdf").unwrap_err().to_string();
    assert!(error.contains(":11:") && error.contains("`1 .46`"), "{error}");
    let hidden = SDF.replace(">1.46<", "><!-- kg -->${mass}<");
    let error = convert(&hidden, "cross.sdf").unwrap_err().to_string();
    assert!(error.contains(":11:") && error.contains("xacro"), "{error}");
}

#[test]
fn a_link_that_the_simulator_turns_slower_than_the_rotor_has_as_much_more_inertia() {
    let with = |by: &str| {
        let key = format!("<rotorVelocitySlowdownSim>{by}</rotorVelocitySlowdownSim><motorConstant>");
        of(&SDF.replace("<motorConstant>", &key), "cross.sdf")
    };
    for (by, inertia) in [("1", 3.1e-5), ("10", 3.1e-6), ("20", 1.55e-6)] {
        let made = with(by);
        close(made.vehicle.rotor_inertia_kg_m2, inertia, "inertia of a rotor");
        close(made.vehicle.thrust_coefficient, 8.5e-6, "thrust coefficient");
        let told = format!("divided by rotorVelocitySlowdownSim = {by}: ");
        assert_eq!(made.text.contains(&told), by != "1", "{}", made.text);
    }
    let (stated, default) = (with("10"), of(SDF, "cross.sdf"));
    assert_eq!(default.vehicle.rotor_inertia_kg_m2, stated.vehicle.rotor_inertia_kg_m2);
    assert!(
        default.text.contains("rotorVelocitySlowdownSim = 10 (the plugins' default): "),
        "{}",
        default.text
    );
}

#[test]
fn a_key_that_one_plugin_lacks_is_told_with_both_rotors() {
    // Rotors are in the order of their numbers; the file has the plugins of 2, 0, 3, 1.
    for (rotor, found) in [
        ("rotor_0", "found none for `rotor_0_joint` and 0.0000085 for `rotor_1_joint`"),
        ("rotor_3", "found 0.0000085 for `rotor_0_joint` and none for `rotor_3_joint`"),
    ] {
        let at = SDF.find(&format!("<linkName>{rotor}<")).unwrap();
        let rest = SDF[at..].replacen("<motorConstant>8.5e-06</motorConstant>", "", 1);
        let error = convert(&format!("{}{rest}", &SDF[..at]), "cross.sdf").unwrap_err().to_string();
        assert!(error.contains("motorConstant: expected the same") && error.contains(found), "{error}");
    }
}

/// The SDF model without the elements of this name.
fn without(name: &str) -> String {
    let lines: Vec<&str> =
        SDF.lines().filter(|line| !line.trim().starts_with(&format!("<{name}>"))).collect();
    assert!(lines.len() < SDF.lines().count(), "{name}");
    lines.join("\n")
}

#[test]
fn assumed_directions_alternate_around_the_vehicle_whatever_the_order_of_commands() {
    let made = of(&without("turningDirection"), "cross.sdf");
    for rotor in &made.vehicle.rotors {
        // Front right and rear left are the first and the third clockwise from the nose.
        let is_clockwise = rotor.position_m.x * rotor.position_m.y < 0.0;
        assert_eq!(rotor.spin, if is_clockwise { -1.0 } else { 1.0 }, "{}", rotor.name);
    }
    assert_eq!(
        made.vehicle.rotors.iter().map(|rotor| rotor.spin).collect::<Vec<_>>(),
        [-1.0, -1.0, 1.0, 1.0]
    );
}

#[test]
fn stated_directions_that_do_not_balance_are_noted() {
    let notes = |changes: [(&str, &str); 2]| {
        let mut text = SDF.to_owned();
        for (rotor, to) in changes {
            let at = text.find(&format!("<linkName>{rotor}<")).unwrap();
            let end = at + text[at..].find("</turningDirection>").unwrap();
            let start = text[..end].rfind('>').unwrap() + 1;
            text.replace_range(start..end, to);
        }
        // The first note is that on the lags.
        of(&text, "cross.sdf").notes.split_off(1).join("; ")
    };
    let three = notes([("rotor_0", "cw"), ("rotor_0", "cw")]);
    assert!(three.starts_with("counter-clockwise rotors: 1, clockwise rotors: 3"), "{three}");
    // The front pair the one way, the rear pair the other.
    let pairs = notes([("rotor_1", "cw"), ("rotor_2", "ccw")]);
    assert!(pairs.contains("opposite to each other turn in different directions"), "{pairs}");
    assert_eq!(notes([("rotor_0", "ccw"), ("rotor_1", "ccw")]), "");
}

#[test]
fn joints_whose_limits_are_both_0_are_fixed() {
    let sdf = |lower: &str| {
        let axis =
            format!("<axis><xyz>0 0 1</xyz><limit><lower>{lower}</lower><upper>0</upper></limit></axis>");
        let joint = format!("type=\"revolute\"><parent>body</parent><child>gps</child>{axis}");
        SDF.replace("type=\"fixed\"><parent>body</parent><child>gps</child>", &joint)
    };
    assert_eq!(of(&sdf("0"), "cross.sdf"), of(SDF, "cross.sdf"));
    let note = "joint gps_joint is movable but not a rotor; its link is treated as fixed at the joint's zero";
    assert_eq!(of(&sdf("-1"), "cross.sdf").notes[0], note);
    let urdf = |limit: &str| {
        let from = "type=\"fixed\">\n    <origin xyz=\"0.03 0 -0.03\"";
        assert!(URDF.contains(from));
        let to =
            from.replace("fixed\">", &format!("revolute\"><limit {limit} effort=\"1\" velocity=\"1\"/>"));
        of(&URDF.replace(from, &to), "plus.urdf")
    };
    assert_eq!(urdf("lower=\"0\" upper=\"0\""), of(URDF, "plus.urdf"));
    assert!(urdf("upper=\"0\"").notes[0].contains("battery_mount is movable"));
}

#[test]
fn a_body_without_mass_is_noted() {
    let note = "the links of the rotors have ";
    assert!(!of(URDF, "plus.urdf").notes.iter().any(|found| found.starts_with(note)));
    let link = |name: &str, mass_kg: f64| {
        format!(
            "<link name=\"{name}\"><inertial><mass value=\"{mass_kg}\"/><inertia ixx=\"1e-6\" iyy=\"1e-6\" izz=\"2e-6\" \
             ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial></link>"
        )
    };
    let rotors: String = [(0.1, 0.1), (0.1, -0.1), (-0.1, -0.1), (-0.1, 0.1)]
        .iter()
        .enumerate()
        .map(|(index, (x, y))| {
            let joint = format!(
                "<joint name=\"rotor_{index}\" type=\"continuous\"><parent link=\"base\"/><child link=\"prop_{index}\"/>\
                 <origin xyz=\"{x} {y} 0\"/><axis xyz=\"0 0 1\"/></joint>"
            );
            link(&format!("prop_{index}"), 0.005) + &joint
        })
        .collect();
    let model = |base: &str| of(&format!("<robot name=\"q\">{base}{rotors}</robot>"), "q.urdf");
    let notes = model("<link name=\"base\"/>").notes;
    let found = notes.iter().find(|found| found.starts_with(note)).unwrap();
    assert!(
        found.contains("0.0200 kg of the vehicle's 0.0200 kg: the body probably lacks its mass"),
        "{found}"
    );
    assert!(!model(&link("base", 0.1)).notes.iter().any(|found| found.starts_with(note)));
}

/// Texts that replace a part of a model.
const PARTS: [&str; 16] = [
    "",
    "0",
    "-1",
    "1e308",
    "-1e308",
    "5e-324",
    "nan",
    "inf",
    "\"",
    "<",
    "/>",
    "&#10;",
    "rotor_0",
    "base_link",
    "fixed",
    "cw",
];

/// Bounds that the physics sets, and those of all vehicles.
fn require_physical(vehicle: &Vehicle) -> Result<(), TestCaseError> {
    let within = |what: &str, value: f64, min: f64, max: f64| {
        prop_assert!((min..=max).contains(&value), "{what}: {value}");
        Ok(())
    };
    within("mass", vehicle.mass_kg, 1e-6, 1e6)?;
    let moments = vehicle.inertia_kg_m2.symmetric_eigenvalues();
    within("least moment", moments.min(), f64::MIN_POSITIVE, 1e9)?;
    within("triangle", 2.0 * moments.max(), 0.0, moments.sum() * (1.0 + 1e-3))?;
    within("thrust", vehicle.thrust_coefficient, f64::MIN_POSITIVE, 1e5)?;
    within("torque", vehicle.torque_coefficient, f64::MIN_POSITIVE, 1e6)?;
    within("inertia of a rotor", vehicle.rotor_inertia_kg_m2, f64::MIN_POSITIVE, 1e7)?;
    within("largest speed", vehicle.command.speed_at_max_rad_s, vehicle.command.speed_at_min_rad_s, 1e5)?;
    within("gravity", vehicle.gravity_m_s2, 9.8, 9.81)?;
    for rotor in &vehicle.rotors {
        within("spin", rotor.spin.abs(), 1.0, 1.0)?;
        within("hub", rotor.position_m.amax(), 0.0, 100.0)?;
    }
    match vehicle.motor {
        MotorModel::FirstOrder { time_constant_s } => within("lag", time_constant_s, 1e-6, 100.0),
        MotorModel::SecondOrder { damping_ratio, .. } => within("damping", damping_ratio, 0.1, 1.0),
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    /// A replaced word of a model gives an error with the file's name, or a vehicle file that loads.
    #[test]
    fn a_changed_model_is_refused_in_words_or_loads(
        is_urdf in any::<bool>(),
        pick in any::<prop::sample::Index>(),
        part in prop::sample::select(PARTS.to_vec()),
    ) {
        let model = if is_urdf { URDF } else { SDF };
        let is_border = |c: char| matches!(c, '"' | '<' | '>' | ' ' | '\n');
        let borders: Vec<usize> = model.match_indices(is_border).map(|(at, _)| at).collect();
        let index = pick.index(borders.len() - 1);
        let text = format!("{}{part}{}", &model[..=borders[index]], &model[borders[index + 1]..]);
        match convert(&text, "any.model") {
            Err(error) => {
                let told = error.to_string();
                prop_assert!(told.starts_with("any.model"), "{told}");
                prop_assert!(!told.contains("of the vehicle file: "), "a number without a place: {told}");
            }
            Ok(made) => {
                let read = Vehicle::parse(&made.text, "made.toml");
                let read = read.map_err(|error| TestCaseError::fail(format!("{error}\n{}", made.text)))?;
                prop_assert_eq!(&read.rotors, &made.vehicle.rotors);
                require_physical(&read)?;
                if text == model {
                    prop_assert_eq!(made, of(model, "any.model"));
                }
            }
        }
    }

    /// Comments change nothing, wherever they stand.
    #[test]
    fn a_model_that_says_the_same_gives_the_same_numbers(
        is_urdf in any::<bool>(),
        picks in prop::collection::vec(any::<prop::sample::Index>(), 1..20),
    ) {
        let model = if is_urdf { URDF } else { SDF };
        let ends: Vec<usize> = model.match_indices('>').map(|(at, _)| at + 1).collect();
        let mut places: Vec<usize> = picks.iter().map(|pick| ends[pick.index(ends.len())]).collect();
        places.sort_unstable();
        let mut text = model.to_owned();
        for place in places.into_iter().rev() {
            text.insert_str(place, "<!-- 1 2 rotor -->");
        }
        prop_assert_eq!(of(&text, "any.model"), of(model, "any.model"));
    }
}

#[test]
fn names_of_a_model_end_neither_a_comment_nor_a_text() {
    let hostile = URDF
        .replace("name=\"plus\"", "name=\"a&#10;mass = 1&quot;'\"")
        .replace("rotor_front_joint", "rotor&#10;[command]&#10;")
        .replace("rotor_front", "rotor&#10;'''&quot;");
    let made = of(&hostile, "plus.urdf");
    for (model, name) in [(URDF, "plus"), (SDF, "cross")] {
        let named = format!("name=\"{name}\"");
        assert_eq!(of(&model.replace(&named, "name=\" \""), "a.model").vehicle.name, "vehicle");
        assert_eq!(of(&model.replace(&named, ""), "a.model").vehicle.name, "vehicle");
    }
    assert_eq!(made.vehicle.name, "a\\nmass = 1\"'");
    assert!(made.vehicle.rotors[0].name.starts_with("rotor\\n'''"), "{:?}", made.vehicle.rotors[0].name);
    assert_eq!(made.text.lines().count(), of(URDF, "plus.urdf").text.lines().count());
}

#[test]
fn rotors_on_fixed_joints_are_at_the_centres_of_mass_of_their_links() {
    // Joints at one place, and the places of the rotors in the links.
    let mut text = URDF.replace("type=\"continuous\"", "type=\"fixed\"");
    for xyz in ["<origin xyz=\"0.2 0 0\"/>\n    <parent", "<origin xyz=\"-0.2 0 0\"/>\n    <parent"] {
        text = text.replace(xyz, "<parent");
    }
    for (name, xyz) in [("left", "0.2"), ("front", "0.2"), ("rear", "-0.2"), ("right", "-0.2")] {
        let from = format!("<link name=\"rotor_{name}\">\n    <inertial>");
        assert!(text.contains(&from), "{from}");
        text = text.replace(&from, &format!("{from}\n      <origin xyz=\"{xyz} 0 0\"/>"));
    }
    // The default axis of URDF is x, which is no rotor's.
    let text = text.replace("<axis xyz=\"0 0 1\"/>", "");
    let (fixed, turning) = (of(&text, "plus.urdf").vehicle, of(URDF, "plus.urdf").vehicle);
    assert_eq!(fixed.rotors, turning.rotors);
    assert_eq!(fixed.inertia_kg_m2, turning.inertia_kg_m2);
    close(fixed.rotor_inertia_kg_m2, 4e-5, "inertia of a rotor about z");
}
