//! Simulations exported as FMUs: valid, with the trajectory of the bus bit for bit, and what cannot be exported.

use crate::fmu::{MAPPED, TOPIC, column, commands, fly, native};
use crate::support::{Place, repository};
use std::fs;
use std::path::Path;
use std::process::Command;

/// The table of `commands` of `controller` for `step.py`, each for so many `ticks`.
fn command_table(place: &Place, controller: &str, commands: &[f64], ticks: usize) -> String {
    let names: Vec<_> = (0..4).map(|index| format!("{controller}.command.command[{index}]")).collect();
    let mut text = names.join(",") + "\n";
    for row in commands.chunks(4) {
        let row = row.iter().map(|command| format!("{command:?}")).collect::<Vec<_>>().join(",") + "\n";
        text += &row.repeat(ticks);
    }
    place.write("commands.csv", text)
}

/// The values of `names` at each tick of `fmu`, a valid one, with the inputs of `table`.
fn stepped(readers: &Path, fmu: &str, table: &str, names: &[String]) -> Vec<Vec<f64>> {
    let mut python = Command::new(readers.join("venv/bin/python3"));
    python.args([&repository("tests/bindings/fmu/step.py"), fmu, table, "0.001"]).args(names);
    let printed = crate::build::succeed(python);
    printed.lines().map(|line| line.split(',').map(|number| number.parse().unwrap()).collect()).collect()
}

#[test]
fn a_simulation_as_an_fmu_is_valid_and_its_trajectory_is_that_of_the_bus_bit_for_bit() {
    let Some(readers) = std::env::var_os("HUMMINGBUS_READERS") else {
        return crate::skipped::skip("HUMMINGBUS_READERS with FMPy is not set");
    };
    let place = Place::new();
    let manifest = repository("manifests/hover.toml");
    let short = ["--set", "run.duration_s=3"];
    place.call(&[&["run", &manifest, "--record", &place.path("hover.mcap")], &short[..]].concat());
    let table = command_table(&place, "controller", &commands(&place, "hover.mcap", TOPIC), 1);
    let fields = [
        ("/plant/state", "position.x"),
        ("/plant/state", "position.z"),
        ("/plant/state", "rotor_speed[3]"),
        ("/ekf/estimate", "velocity.y"),
        ("/ekf/estimate", "attitude.w"),
    ];
    let names = fields.map(|(topic, field)| format!("{}.{field}", topic[1..].replace('/', ".")));
    for version in ["2", "3"] {
        let fmu = place.path(&format!("hover{version}.fmu"));
        place
            .call(&[&["export-fmu", &manifest, "--fmi", version, "--out", &fmu], &short[..]].concat())
            .with_code(0);
        let rows = stepped(Path::new(&readers), &fmu, &table, &names);
        for (index, (topic, field)) in fields.iter().enumerate() {
            let flown = column(&place, "hover.mcap", topic, field);
            assert_eq!(flown.len(), 3000);
            let differs =
                flown.iter().zip(&rows).position(|(flown, row)| flown.to_bits() != row[index].to_bits());
            assert_eq!((differs, rows.len()), (None, 3000), "{topic} {field} as FMI {version}");
        }
    }
    // Two exports are the same bytes, also from another folder: nothing in it is of this machine.
    for folder in ["manifests", "vehicles"] {
        fs::create_dir(place.path(folder)).unwrap();
    }
    for file in ["manifests/hover.toml", "vehicles/hummingbird.toml"] {
        fs::copy(repository(file), place.path(file)).unwrap();
    }
    let again = place.path("again.fmu");
    let moved = place.path("manifests/hover.toml");
    place.call(&[&["export-fmu", &moved, "--out", &again], &short[..]].concat()).with_code(0);
    assert!(
        fs::read(again).unwrap() == fs::read(place.path("hover2.fmu")).unwrap(),
        "another export differs"
    );
}

/// A vehicle file alone: its plant and sensors with the commands that the hover has flown.
#[test]
fn a_vehicle_file_as_an_fmu_flies_as_on_the_bus_bit_for_bit() {
    let Some(readers) = std::env::var_os("HUMMINGBUS_READERS") else {
        return crate::skipped::skip("HUMMINGBUS_READERS with FMPy is not set");
    };
    let place = Place::new();
    let manifest = repository("manifests/hover.toml");
    place.call(&["run", &manifest, "--record", &place.path("hover.mcap"), "--set", "run.duration_s=2"]);
    let table = command_table(&place, "controller", &commands(&place, "hover.mcap", TOPIC), 1);
    let vectors = ["position", "velocity", "angular_velocity"].map(|vector| ("/plant/state", vector, "xyz"));
    let fields =
        [&vectors[..], &[("/plant/state", "attitude", "wxyz"), ("/imu/imu", "angular_velocity", "xyz")]];
    let fields: Vec<(&str, String)> = fields
        .concat()
        .into_iter()
        .flat_map(|(topic, vector, axes)| axes.chars().map(move |axis| (topic, format!("{vector}.{axis}"))))
        .collect();
    let names: Vec<String> =
        fields.iter().map(|(topic, field)| format!("{}.{field}", topic[1..].replace('/', "."))).collect();
    let vehicle = repository("vehicles/hummingbird.toml");
    let begun = "process.plant.inputs.command.initial={ command = [76.5, 76.5, 76.5, 76.5] }";
    for version in ["2", "3"] {
        let fmu = place.path(&format!("vehicle{version}.fmu"));
        let outputs = ["--output", "/plant/state", "--output", "/imu/imu"];
        let export = ["export-fmu", &vehicle, "--fmi", version, "--out", &fmu, "--set", begun];
        place.call(&[&export[..], &outputs].concat()).with_code(0);
        let rows = stepped(Path::new(&readers), &fmu, &table, &names);
        for (index, (topic, field)) in fields.iter().enumerate() {
            let flown = column(&place, "hover.mcap", topic, field);
            let differs =
                flown.iter().zip(&rows).position(|(flown, row)| flown.to_bits() != row[index].to_bits());
            assert_eq!(
                (differs, rows.len(), flown.len()),
                (None, 2000, 2000),
                "{topic} {field} as FMI {version}"
            );
        }
    }
}

/// One vehicle of ten, as it flies where the others are not: its own noise and its own walls.
#[test]
fn a_vehicle_of_a_manifest_of_ten_is_exported_and_flies_as_it_does_alone() {
    let Some(readers) = std::env::var_os("HUMMINGBUS_READERS") else {
        return crate::skipped::skip("HUMMINGBUS_READERS with FMPy is not set");
    };
    let place = Place::new();
    let ten = repository("manifests/ten-vehicles.toml");
    let text = fs::read_to_string(&ten).unwrap();
    let (first, rest) = (text.find("[[vehicle]]").unwrap(), text.find("[[vehicle]]\nname = \"v1\"").unwrap());
    let alone = format!(
        "include = [{:?}]\n[run]\nduration_s = 1.0\nseed = 1\n[process.traffic]\nkind = \"traffic\"\n\
         inputs.v0 = \"/v0/plant/state\"\n[process.recorder]\nkind = \"recorder\"\n{}",
        repository("manifests/sets/room-set.toml"),
        &text[first..rest]
    );
    fly(&place, &place.write("alone.toml", alone), "alone.mcap").with_code(0);
    let commands = commands(&place, "alone.mcap", "/v0/controller/command");
    let table = command_table(&place, "v0.controller", &commands, 4);
    let fmu = place.path("v0.fmu");
    let export = ["export-fmu", &ten, "--without", "v0/controller", "--out", &fmu, "--only"];
    place.call(&[&export[..], &["v0,traffic"]].concat()).with_code(0);
    let fields = ["position.x", "position.z", "velocity.y", "attitude.w"];
    let rows =
        stepped(Path::new(&readers), &fmu, &table, &fields.map(|field| format!("v0.plant.state.{field}")));
    for (index, field) in fields.iter().enumerate() {
        let flown = column(&place, "alone.mcap", "/v0/plant/state", field);
        let differs =
            flown.iter().zip(&rows).position(|(flown, row)| flown.to_bits() != row[index].to_bits());
        assert_eq!((differs, rows.len(), flown.len()), (None, 1000, 1000), "{field}");
    }
    // The left-out process needs no inputs of its own.
    let plant = ["export-fmu", &repository("manifests/hover.toml"), "--only", "plant,controller", "--json"];
    let ended = place.call(&[&plant[..], &["--out", &place.path("plant.fmu")]].concat()).with_code(0);
    assert_eq!(ended.json()["unwired"], serde_json::json!([]), "{ended}");
    // Without `traffic` two inputs that may be missing have no sender.
    let ended = place.call(&[&export[..], &["v0", "--json"]].concat()).with_code(0);
    let unwired = &ended.json()["unwired"];
    assert_eq!(*unwired, serde_json::json!(["v0/plant.traffic", "v0/range.traffic"]), "{ended}");
}

/// Heights and climbs of the vehicle `name` in a run of 0.5 s: its FMU is the plant, and keeps the commands that it begins with,
/// 1 count above those of hover.
fn climbed(place: &Place, name: &str) -> [Vec<f64>; 2] {
    let fmu = place.path(&format!("{name}.fmu"));
    place.call(&["export-fmu", &repository(&format!("vehicles/{name}.toml")), "--out", &fmu]).with_code(0);
    let commands: String =
        (0..4).map(|rotor| format!("\"controller.command.command[{rotor}]\" = 77.5\n")).collect();
    let text = format!(
        "[run]\nrate_hz = 1000\nduration_s = 0.5\n[process.plant]\nkind = \"fmu\"\nfmu = {fmu:?}\n\
         outputs.state = {{ type = \"hummingbus_msgs/msg/PlantState\" }}\n[process.plant.parameters.outputs]\n\
         \"plant.state.position.z\" = \"state.position.z\"\n\"plant.state.velocity.z\" = \"state.velocity.z\"\n\
         [process.plant.parameters.start]\nseed = 7\n{commands}[process.recorder]\nkind = \"recorder\"\n"
    );
    let recording = format!("{name}.mcap");
    fly(place, &place.write("plant.toml", text), &recording).with_code(0);
    ["position.z", "velocity.z"].map(|field| column(place, &recording, "/plant/state", field))
}

/// The second one has the first as its base, and drag.
#[test]
fn a_vehicle_as_an_fmu_joins_a_run_as_its_plant() {
    let place = Place::new();
    let [height, climb] = climbed(&place, "hummingbird");
    assert!(height.len() == 500 && (0.01..0.2).contains(&(height[499] - 1.0)), "{:?}", height.last());
    assert!(climb.windows(2).all(|pair| pair[0] <= pair[1] + 1e-12), "it climbs ever faster");
    let [_, dragged] = climbed(&place, "hummingbird-drag");
    assert!(dragged.len() == 500 && dragged[499] > 0.9 * climb[499] && dragged[499] < climb[499]);
}

/// The processes of a group as a whole.
#[test]
fn a_group_of_a_manifest_is_exported() {
    let place = Place::new();
    let group = "[group.craft]\nprocesses = [\"plant\", \"imu\", \"mocap\"]\n";
    let text = format!("include = [{:?}]\n{group}", repository("manifests/hover.toml"));
    let (manifest, fmu) = (place.write("group.toml", text), place.path("craft.fmu"));
    let arguments = [
        "export-fmu",
        &manifest,
        "--only",
        "craft,controller",
        "--out",
        &fmu,
        "--output",
        "/imu/imu",
        "--json",
    ];
    let ended = place.call(&arguments).with_code(0);
    assert_eq!(ended.json()["unwired"], serde_json::json!([]), "{ended}");
    // The filter is not in the group.
    let arguments = [&arguments[..7], &["/ekf/estimate"]].concat();
    place.call(&arguments).with_code(2).says(&["there is no topic /ekf/estimate"]);
}

#[test]
fn an_export_that_cannot_be_is_refused_in_words() {
    let place = Place::new();
    let hover = repository("manifests/hover.toml");
    let out = place.path("out.fmu");
    let text = place.write("text.fmu", "not an FMU");
    let foreign = format!(
        "include = [{hover:?}]\n[process.foreign]\nkind = \"fmu\"\nfmu = {:?}\ninputs.state = \"/plant/state\"\n\
         outputs.command = {{ type = \"hummingbus_msgs/msg/MotorCommand\" }}\n[process.foreign.parameters]\n{MAPPED}",
        native(&place)
    );
    let foreign = place.write("foreign.toml", foreign);
    let computing = repository("manifests/computing-time.toml");
    let ten = repository("manifests/ten-vehicles.toml");
    let cases: [(&[&str], &str); 15] = [
        (&[&hover, "--without", "control"], "there is no process `control` to leave out; there are"),
        (
            &[&hover, "--without", "imu"],
            "`imu` sends `imu` (hummingbus_msgs/msg/Imu), which an importer cannot",
        ),
        (&[&hover, "--without", "recorder"], "`recorder` sends nothing"),
        (
            &[&hover, "--without", "pilot", "--output", "/controller/command"],
            "depends on what `pilot` sends in the same tick",
        ),
        (&[&hover, "--set", "run.seed=5000000000"], "is not one of 32 bits"),
        (&[&computing, "--without", "t20/controller"], "has a `computing_time`"),
        (&[&hover, "--output", "/no/topic"], "there is no topic /no/topic; there are"),
        (&[&hover, "--fmi", "1"], "--fmi: expected 2 or 3, found 1"),
        (&[&hover, "--out", &text], "text.fmu"),
        (&[&foreign, "--without", "controller"], "needs a process of its own"),
        (&[&ten, "--only", "v0"], "there is no process `controller` to leave out"),
        (&[&ten, "--only", "v11", "--without", "v0/controller"], "no process, vehicle or group `v11`"),
        (&[&hover, "--only", "ekf,controller"], "--only leaves out the senders of ekf."),
        (&[&hover, "--only", "plant"], "--only leaves out `controller`, in whose place the importer stands"),
        (&["nowhere.toml"], "nowhere.toml"),
    ];
    for (arguments, words) in cases {
        let out = if arguments.contains(&"--out") { &[][..] } else { &["--out", &out] };
        let ended = place.call(&[&["export-fmu"], arguments, out].concat());
        assert!(
            ended.code == Some(2) && ended.error.contains(words),
            "{arguments:?}: no {words:?} in\n{ended}"
        );
    }
    assert!(!Path::new(&out).exists());
    assert_eq!(fs::read_to_string(text).unwrap(), "not an FMU");
}
