//! The other subcommands, exit codes and JSON.

use crate::skipped::cases;
use crate::support::{Place, repository};
use serde_json::{Value, json};
use std::fs;

fn hover() -> String {
    repository("manifests/hover.toml")
}

/// A short recording of the hover.
fn recording(place: &Place) -> String {
    let path = place.path("hover.mcap");
    place.call(&["run", &hover(), "--record", &path, "--set", "run.duration_s=0.5"]).with_code(1);
    path
}

#[test]
fn a_run_whose_conditions_hold_passes() {
    let place = Place::new();
    let ended = place.call(&["run", &hover(), "--record", &place.path("a.mcap")]).with_code(0);
    ended.prints(&["12000 ticks", "ticks/s", "ok     altitude within 2 %", "recording: ", "\npassed\n"]);
}

#[test]
fn a_condition_that_does_not_hold_fails_the_run() {
    let place = Place::new();
    // Without the step the vehicle stays at 1 m.
    let args = ["--set", "process.pilot.parameters.set_points=[]", "--set", "run.duration_s=6"];
    let ended = place.call(&[&["run", &hover(), "--record", &place.path("a.mcap")][..], &args].concat());
    ended.with_code(1).prints(&["FAILED altitude within 2 % of 1.5 m", "(1.47 … 1.53)", "\nFAILED\n"]);
}

#[test]
fn a_condition_on_a_span_that_was_not_flown_fails() {
    let place = Place::new();
    let args = ["run", &hover(), "--record", &place.path("a.mcap"), "--set", "run.duration_s=3"];
    place.call(&args).with_code(1).prints(&["no samples"]);
}

/// The keys of an object.
fn keys(value: &Value) -> Vec<&str> {
    value.as_object().unwrap().keys().map(String::as_str).collect()
}

#[test]
fn the_json_summary_holds_what_the_text_says() {
    let place = Place::new();
    let path = place.path("a.mcap");
    let summary = place.call(&["run", &hover(), "--record", &path, "--json"]).with_code(0).json();
    for key in
        ["passed", "ticks", "ticks_per_s", "real_time_factor", "processes", "pass", "compare", "recording"]
    {
        assert!(keys(&summary).contains(&key), "no {key} in {summary}");
    }
    assert_eq!((&summary["passed"], &summary["ticks"]), (&true.into(), &12_000.into()));
    assert_eq!(summary["recording"], path);
    let number = |key: &str| summary[key].as_f64().unwrap();
    assert!((number("ticks_per_s") * number("host_s") - 12_000.0).abs() < 1e-3);
    assert!((number("real_time_factor") * number("host_s") - 12.0).abs() < 1e-6);
    let names: Vec<_> =
        summary["processes"].as_array().unwrap().iter().map(|process| &process["name"]).collect();
    assert_eq!(names, ["clock", "controller", "ekf", "imu", "mocap", "pilot", "plant", "recorder"]);
    assert!(summary["pass"].as_array().unwrap().iter().all(|pass| pass["passed"] == true));
}

#[test]
fn a_failed_run_in_json_says_which_condition() {
    let place = Place::new();
    let args = ["run", &hover(), "--record", &place.path("a.mcap"), "--json", "--set", "run.duration_s=3"];
    let summary = place.call(&args).with_code(1).json();
    assert_eq!(summary["passed"], false);
    assert_eq!(summary["pass"][0]["passed"], false);
    assert!(summary["pass"][0]["name"].as_str().unwrap().starts_with("altitude"));
}

#[test]
fn a_paced_run_takes_at_least_its_simulated_time() {
    let place = Place::new();
    let args = ["run", &hover(), "--record", &place.path("a.mcap"), "--json", "--pace", "2"];
    let summary = place.call(&[&args[..], &["--set", "run.duration_s=1"]].concat()).with_code(1).json();
    // The last tick's deadline lies one tick before the end.
    assert!(summary["host_s"].as_f64().unwrap() >= 0.999 / 2.0, "{summary}");
}

#[test]
fn check_prints_nodes_edges_delays_and_rates() {
    let ended = Place::new().call(&["check", &hover()]).with_code(0);
    ended.prints(&["12000 ticks at 1000 Hz (12 s)", "pace free", "window 64 ticks", "seed 1"]);
    ended.prints(&["ekf (ekf), 1000 Hz", "controller (pid)", "imu (imu)", "recorder (recorder)"]);
    ended.prints(&["/controller/command [hummingbus_msgs/msg/MotorCommand], delayed by 1 tick"]);
    ended.prints(&["<- imu          /imu/imu [hummingbus_msgs/msg/Imu]\n"]);
    ended.prints(&["-> state        /plant/state [hummingbus_msgs/msg/PlantState] 1000 Hz"]);
    ended.prints(&["-> pose         /plant/pose [geometry_msgs/msg/PoseStamped] 100 Hz"]);
}

#[test]
fn check_prints_slow_nodes_at_their_rate_and_takes_overrides() {
    let set = ["--set", "process.imu.period_ticks=4", "--set", "run.seed=9"];
    let ended = Place::new().call(&[&["check", &hover()][..], &set].concat()).with_code(0);
    ended.prints(&["imu (imu), 250 Hz", "/imu/imu [hummingbus_msgs/msg/Imu] 250 Hz", "seed 9"]);
}

#[test]
fn check_prints_what_the_meshes_of_a_scene_have() {
    let ended = Place::new().call(&["check", &repository("manifests/office.toml")]).with_code(0);
    ended.prints(&["meshes of ", "scenes/office.toml:\n  desk: 60 triangles, ", " m, from [", "  lamp: "]);
}

#[test]
fn check_prints_the_graph_as_json() {
    let graph = Place::new().call(&["check", &hover(), "--json"]).with_code(0).json();
    assert_eq!(
        (graph["duration_ticks"].as_u64(), graph["tick_ns"].as_u64()),
        (Some(12_000), Some(1_000_000))
    );
    let nodes: Vec<_> = graph["nodes"].as_array().unwrap().iter().map(|node| &node["name"]).collect();
    assert_eq!(nodes, ["controller", "ekf", "imu", "mocap", "pilot", "plant", "recorder"]);
}

/// The part of the schema listing about one message.
fn section<'a>(text: &'a str, name: &str) -> &'a str {
    let start = text.find(name).unwrap_or_else(|| panic!("no {name} in\n{text}"));
    text[start..].split("\n\n").next().unwrap()
}

#[test]
fn schema_prints_every_message_with_units_frames_and_hash() {
    let ended = Place::new().call(&["schema"]).with_code(0);
    for name in ["AttitudeEstimate", "Imu", "MeasuredState", "MotorCommand", "PlantState", "SetPoint"] {
        let section = section(&ended.output, &format!("hummingbus_msgs/msg/{name} ("));
        let hash = section.split("layout ").nth(1).unwrap_or_else(|| panic!("no hash in {section}"));
        assert!(hash.len() >= 16 && hash[..16].bytes().all(|byte| byte.is_ascii_hexdigit()), "{section}");
    }
    let state = section(&ended.output, "hummingbus_msgs/msg/PlantState (");
    for (field, unit, frame) in [("position.x", "m", "world"), ("angular_velocity.z", "rad/s", "body")] {
        let row = state.lines().find(|line| line.contains(field)).unwrap();
        let cells: Vec<_> = row.split_whitespace().collect();
        assert_eq!(cells[1..], ["float64", field, unit, frame]);
    }
    ended.prints(&["geometry_msgs/msg/PoseStamped", "tf2_msgs/msg/TFMessage", "nav_msgs/msg/Odometry"]);
    ended.prints(&["sensor_msgs/msg/Imu", "sensor_msgs/msg/Range", "actuator_msgs/msg/Actuators"]);
    ended.prints(&["sensor_msgs/msg/LaserScan", "nav_msgs/msg/Path"]);
}

#[test]
fn schema_prints_the_same_as_json() {
    let place = Place::new();
    let (text, schemas) =
        (place.call(&["schema"]).output, place.call(&["schema", "--json"]).with_code(0).json());
    let schemas = schemas.as_array().unwrap();
    assert!(schemas.len() >= 8);
    for schema in schemas {
        let section = section(&text, schema["type_name"].as_str().unwrap());
        assert!(section.contains(schema["layout_hash"].as_str().unwrap()), "{section}");
        assert!(schema["definition"].as_str().unwrap().ends_with('\n'));
    }
}

#[test]
fn schema_prints_the_states_that_components_hand_over() {
    let place = Place::new();
    let state = place.call(&["schema", "ControllerState"]).with_code(0);
    state.prints(&[
        "hummingbus_msgs/msg/ControllerState (",
        "integrals.lift",
        "Handed over at a swap by ",
        " pid, ",
    ]);
    let all = place.call(&["schema"]).with_code(0);
    all.prints(&[state.output.as_str()]);
    let of = |name: &str| place.call(&["schema", name, "--json"]).with_code(0).json()[0]["state_of"].clone();
    assert!(of("ControllerState").as_array().unwrap().contains(&"pid".into()));
    assert_eq!(of("PlantState"), json!([]));
    for (option, table) in [("--c", "HbControllerState"), ("--cpp", "struct ControllerState ")] {
        place.call(&["schema", "ControllerState", option]).with_code(0).prints(&[table]);
    }
}

#[test]
fn cat_prints_one_json_object_a_line() {
    let place = Place::new();
    let recording = recording(&place);
    let ended = place.call(&["cat", &recording, "--topic", "/plant/pose"]).with_code(0);
    let lines: Vec<Value> = ended.output.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(lines.len(), 50);
    for (index, line) in lines.iter().enumerate() {
        assert_eq!(keys(line), ["topic", "tick", "time_ns", "fields"]);
        assert_eq!(line["tick"].as_u64(), Some(10 * index as u64));
        assert_eq!(line["time_ns"].as_u64(), Some(10_000_000 * index as u64));
    }
    assert_eq!(lines[0]["fields"]["header.frame_id"], "map");
    assert_eq!(lines[0]["fields"]["pose.position.z"], 1.0);
    let all = place.call(&["cat", &recording]).with_code(0).output;
    assert_eq!(all.lines().count(), 5 * 500 + 3 * 50);
}

#[test]
fn schema_components_and_effects_print_one() {
    let place = Place::new();
    let ended = place.call(&["schema", "PlantState"]).with_code(0);
    assert_eq!(ended.output.matches("layout ").count(), 1, "{}", ended.output);
    let one = place.call(&["schema", "hummingbus_msgs/msg/PlantState", "--json"]).with_code(0).json();
    assert_eq!(one.as_array().map(Vec::len), Some(1));
    place.call(&["schema", "PlantStat"]).with_code(2).says(&["no component", "PlantStat", "PlantState"]);
    place.call(&["schema", "ControllerStat"]).with_code(2).says(&["a state of type", "`ControllerState`"]);
    let ended = place.call(&["components", "pid"]).with_code(0);
    ended.prints(&[
        "pid: altitude, roll",
        "reads\n  set_point: SetPoint",
        "parameters\n  vehicle",
        "hands over",
    ]);
    let gps = place.call(&["components", "gps"]).with_code(0);
    gps.prints(&[
        "position_drift_time_s  [s] default 300.0; above 0\n",
        "rate_hz  [Hz] default 10.0; above 0\n      Measurements a second.",
    ]);
    for text in [&ended.output, &gps.output, &place.call(&["effects", "rotor-drag"]).with_code(0).output] {
        assert!(!["<br>", "](", "**", "|---", "`"].iter().any(|mark| text.contains(mark)), "{text}");
    }
    place.call(&["components", "pit"]).with_code(2).says(&["no component pit", "pid"]);
    let ended = place.call(&["effects", "rotor-drag"]).with_code(0);
    ended.prints(&["rotor-drag: ", "\nequation", "\nholds for", "parameters\n  coefficient  "]);
    ended.prints(&["file\n  [[effects]]\n  name = \"rotor-drag\"\n  coefficient = { value = "]);
    let one = place.call(&["effects", "rotor-drag", "--json"]).with_code(0).json();
    assert_eq!(one[0]["parameters"][0]["units"][0], "N*s^2/(m*rad)");
    let names = place.call(&["effects"]).with_code(0).output;
    let all = place.call(&["effects", "--json"]).with_code(0).json();
    assert_eq!(names.lines().count(), all.as_array().unwrap().len() + 1, "{names}");
    place.call(&["effects", "rotor-dreg"]).with_code(2).says(&["did you mean `rotor-drag`?"]);
}

#[test]
fn cat_prints_a_span_of_fields_as_csv() {
    let place = Place::new();
    let recording = recording(&place);
    let topic = ["cat", &recording, "--topic", "/plant/state"];
    let span = ["--field", "position.z", "--field", "velocity", "--from", "0.1", "--to", "0.2", "--csv"];
    let ended = place.call(&[&topic[..], &span].concat()).with_code(0);
    let lines: Vec<_> = ended.output.lines().collect();
    assert_eq!(lines[0], "tick,time_ns,position.z,velocity.x,velocity.y,velocity.z");
    assert_eq!(lines.len(), 1 + 101);
    assert!(lines[1].starts_with("100,100000000,") && lines[101].starts_with("200,200000000,"));
    let height: f64 = lines[1].split(',').nth(2).unwrap().parse().unwrap();
    assert!((height - 1.0).abs() < 0.05, "{height} m");
    // Columns stand in the order of the arguments, each once.
    let fields = ["--field", "velocity.z", "--field", "position", "--field", "position.z", "--csv"];
    let ended = place.call(&[&topic[..], &fields].concat()).with_code(0);
    let head = ended.output.lines().next();
    assert_eq!(head, Some("tick,time_ns,velocity.z,position.x,position.y,position.z"));
    place.call(&[&topic[..], &["--field", "position.w"]].concat()).with_code(2).says(&[
        "no field position.w",
        "did you mean `position.x`?",
        "position.z",
    ]);
    place.call(&["cat", &recording, "--csv"]).with_code(2).says(&["--topic"]);
    place.call(&[&topic[..], &["--from", "-1"]].concat()).with_code(2);
}

#[test]
fn cat_leaves_padding_out() {
    let place = Place::new();
    let ended = place.call(&["cat", &recording(&place), "--topic", "/mocap/mocap"]).with_code(0);
    assert!(ended.output.lines().count() > 10 && !ended.output.contains("pad0"), "{}", ended.output);
}

#[test]
fn a_manifest_is_not_read_as_a_recording() {
    let ended = Place::new().call(&["cat", &hover()]).with_code(2);
    ended.says(&["hover.toml is a manifest, not a recording", "hummingbus run"]);
}

#[test]
fn a_file_of_another_kind_is_told_with_the_command_that_reads_it() {
    let place = Place::new();
    let flights =
        place.write("flights.toml", "vehicle = \"v.toml\"\n[[flight]]\nfile = \"a.csv\"\nrole = \"fit\"\n");
    let (csv, packed) = (place.write("log.csv", "t,x\n0,1\n"), place.write("log.csv.gz", "\u{1f}"));
    fs::write(&packed, b"\x1f\x8b\x08\0\0").unwrap();
    let recording = recording(&place);
    let vehicle = repository("vehicles/hummingbird.toml");
    let (gains, scene) = (repository("controllers/gains/pid.toml"), repository("scenes/office.toml"));
    let out = place.path("out");
    let says = |args: &[&str], says: &[&str]| place.call(args).with_code(2).says(says);
    says(
        &["validate", &flights, &vehicle],
        &["is a flights file, not a vehicle file", "identify", "stand first"],
    );
    says(
        &["identify", &hover(), "--out", &out],
        &["hover.toml is a manifest, not a flights file", "hummingbus run"],
    );
    says(&["campaign", &hover()], &["hover.toml is a manifest, not a campaign file"]);
    says(
        &["tune", &hover()],
        &["hover.toml is a manifest", "a tuning file is a campaign file with a table [tune]"],
    );
    for command in ["run", "check"] {
        says(&[command, &recording], &["is a recording, not a manifest", "hummingbus cat"]);
        says(&[command, &vehicle], &["is a vehicle file, not a manifest", "as `vehicle`"]);
        says(&[command, &scene], &["is a scene file, not a manifest"]);
        says(&[command, &gains], &["is a gains file, not a manifest"]);
    }
    for command in ["cat", "plot"] {
        says(&[command, &csv], &["is a CSV file, not a recording", "a flights file names it"]);
        says(&[command, &packed], &["is compressed (gzip), not a recording", "gunzip"]);
    }
    assert!(!std::path::Path::new(&out).exists());
}

#[test]
fn cat_refuses_a_span_without_messages() {
    let place = Place::new();
    let recording = recording(&place);
    place
        .call(&["cat", &recording, "--from", "100"])
        .with_code(2)
        .says(&["--from 100", "no message; those of the recording go from 0"]);
    place
        .call(&["cat", &recording, "--from", "0.1001", "--to", "0.1002"])
        .with_code(2)
        .says(&["--from 0.1001 --to 0.1002: no message"]);
    place
        .call(&["cat", &recording, "--from", "5", "--to", "3"])
        .with_code(2)
        .says(&["--from 5 --to 3", "the end"]);
    place.call(&["cat", &recording, "--from", "0.1", "--to", "0.1"]).with_code(0);
}

#[test]
fn a_quiet_run_prints_only_its_failure() {
    let place = Place::new();
    let record = place.path("quiet.mcap");
    let args = ["run", &hover(), "--quiet", "--record", &record];
    let passed = place.call(&args).with_code(0);
    assert_eq!((passed.output.as_str(), passed.error.as_str()), ("", ""));
    let short = ["--set", "run.duration_s=3"];
    place.call(&[&args[..], &short].concat()).with_code(1).prints(&["no samples", "FAILED"]);
}

#[test]
fn cat_names_the_topics_there_are() {
    let place = Place::new();
    let ended = place.call(&["cat", &recording(&place), "--topic", "/plant/stat"]).with_code(2);
    ended.says(&["no topic /plant/stat (did you mean `/plant/state`?); it has ", "/imu/imu"]);
}

#[test]
fn a_truncated_recording_is_a_prefix_up_to_its_last_whole_chunk() {
    let place = Place::new();
    let whole = recording(&place);
    let bytes = fs::read(&whole).unwrap();
    for part in cases("lengths", 1..16, |part| part % 3 == 0) {
        let cut = place.write("cut.mcap", &bytes[..bytes.len() * part / 16]);
        let ended = place.call(&["diff", &whole, &cut]).with_code(1);
        ended.says(&[&cut, "was cut off", "its writer did not finish it"]);
        ended.prints(&[&cut]);
        place.call(&["cat", &cut]).with_code(1).says(&[&cut, "was cut off"]);
    }
}

#[test]
fn a_recording_with_a_wrong_byte_is_never_identical_and_never_a_crash() {
    let place = Place::new();
    let whole = recording(&place);
    let bytes = fs::read(&whole).unwrap();
    for part in cases("bytes", 0..64, |part| part % 8 == 0) {
        let mut changed = bytes.clone();
        changed[bytes.len() * part / 64] ^= 0x55;
        let changed = place.write("changed.mcap", changed);
        let ended = place.call(&["diff", &whole, &changed]);
        assert!(matches!(ended.code, Some(1 | 2)), "byte {part}/64: {ended}");
        let ended = place.call(&["cat", &changed]);
        assert!(matches!(ended.code, Some(0 | 2)), "byte {part}/64: {:?} {}", ended.code, ended.error);
    }
}

#[test]
fn a_tolerance_is_in_the_unit_of_each_field_and_json_has_every_field() {
    let place = Place::new();
    let hover = repository("manifests/hover.toml");
    let flown = |name: &str, more: &[&str]| {
        let path = place.path(name);
        let args = ["run", &hover, "--in-process", "--record", &path, "--set", "run.duration_s=0.5"];
        place.call(&[&args[..], more].concat()).flown();
        path
    };
    let (first, same) = (flown("a.mcap", &[]), flown("b.mcap", &[]));
    // A start that is a nanometre higher.
    let other =
        flown("c.mcap", &["--set", "process.plant.parameters.initial_position_m=[0.0, 0.0, 1.000000001]"]);
    let short = flown("d.mcap", &["--set", "run.duration_s=0.2"]);
    place.call(&["diff", &first, &same, "--json"]).with_code(0).prints(&["\"identical\": true"]);
    place.call(&["diff", &first, &same, "--tolerance", "0"]).with_code(0).prints(&["messages are the same"]);
    place.call(&["diff", &first, &other]).with_code(1);
    let ended = place.call(&["diff", &first, &other, "--tolerance", "1e-3"]).with_code(0);
    ended.prints(&[
        "are within 0.001",
        "/controller/command command[0]: at most",
        " count (tick",
        "--json lists all",
    ]);
    let ended = place.call(&["diff", &first, &other, "--tolerance", "1e-12"]).with_code(1);
    ended.prints(&["are beyond 1e-12", "/controller/command command[0]"]);
    let told = place.call(&["diff", &first, &other, "--tolerance", "1e-3", "--json"]).with_code(0).json();
    let fields = told["fields"].as_array().unwrap();
    let height =
        fields.iter().find(|it| it["topic"] == "/plant/state" && it["field"] == "position.z").unwrap();
    assert_eq!(
        (&told["within"], &height["unit"], &height["first_tick"]),
        (&true.into(), &"m".into(), &0.into())
    );
    assert!(height["largest"].as_f64().unwrap() < 1e-3, "{height}");
    let ended = place.call(&["diff", &first, &short, "--tolerance", "1e9"]).with_code(1);
    ended.prints(&["no tolerance allows this", "d.mcap ends after tick 199"]);
    for wrong in ["-1", "inf", "much"] {
        place
            .call(&["diff", &first, &same, &format!("--tolerance={wrong}")])
            .with_code(2)
            .says(&["from 0 on"]);
    }
}

#[test]
fn a_topic_that_only_one_recording_has_is_named_and_the_others_are_compared() {
    let place = Place::new();
    let hover = repository("manifests/hover.toml");
    let flown = |name: &str, more: &[&str]| {
        let path = place.path(name);
        let args = ["run", &hover, "--in-process", "--record", &path, "--set", "run.duration_s=0.5"];
        place.call(&[&args[..], more].concat()).flown();
        path
    };
    let first = flown("a.mcap", &[]);
    let other = flown("b.mcap", &["--set", "process.plant.outputs.tf.topic=/poses"]);
    let ended = place.call(&["diff", &first, &other]).with_code(1);
    ended.prints(&["tick 0, topic /poses: ", "a.mcap has no such topic, and ", "b.mcap has it"]);
    let ended = place.call(&["diff", &first, &other, "--tolerance", "0"]).with_code(1);
    ended.prints(&["messages are the same", "b.mcap has no topic /tf", "a.mcap has no topic /poses"]);
    assert!(!ended.output.contains("no tolerance allows this"), "{ended}");
    let told = place.call(&["diff", &first, &other, "--tolerance", "0", "--json"]).with_code(1).json();
    assert_eq!((&told["only_a"], &told["only_b"]), (&json!(["/tf"]), &json!(["/poses"])));
    assert_eq!((&told["within"], &told["refused"]), (&false.into(), &Value::Null));
    // All ticks of the others, not only the first.
    assert!(told["messages"].as_u64().unwrap() > 500, "{told}");
}

#[test]
fn an_export_replaces_no_file_of_another_kind_and_names_an_unknown_topic() {
    let place = Place::new();
    let recording = recording(&place);
    let out = place.path("tables");
    let args = ["export", &recording, "--out", &out, "--topic", "/plant/state", "--csv"];
    place.call(&args).with_code(0).prints(&["plant.state.csv: ", " messages"]);
    // A second time in the place of the first.
    place.call(&args).with_code(0);
    let file = format!("{out}/plant.state.csv");
    assert!(fs::read_to_string(&file).unwrap().starts_with("tick,time_ns,"));
    let columns = format!("{out}/plant.state.columns.csv");
    let text = fs::read_to_string(&columns).unwrap();
    assert!(text.starts_with("column,unit,frame,meaning\n"), "{text}");
    assert!(text.contains("\nvelocity.x,m/s,world,") && text.contains("\ntime_ns,ns,,"), "{text}");
    for file in [&file, &columns] {
        let before = fs::read_to_string(file).unwrap();
        fs::write(file, "a letter").unwrap();
        place.call(&args).with_code(2).says(&[file]);
        assert_eq!(fs::read_to_string(file).unwrap(), "a letter");
        fs::write(file, before).unwrap();
    }
    let parquet = ["export", &recording, "--out", &out, "--topic", "/plant/state", "--parquet"];
    place.call(&parquet).with_code(0).prints(&["plant.state.parquet: ", " messages"]);
    let both = place.call(&[&parquet[..], &["--csv"]].concat()).with_code(2);
    both.says(&["--parquet", "cannot be used with", "--csv"]);
    let unknown = place.call(&["export", &recording, "--out", &out, "--topic", "/none"]).with_code(2);
    unknown.says(&["/none", "/plant/state"]);
}

#[test]
fn what_is_no_recording_is_refused() {
    let place = Place::new();
    let (empty, text) = (place.write("empty.mcap", ""), place.write("text.mcap", "hello\n".repeat(100)));
    for (file, told) in [(empty, "is empty, not a recording"), (text, "not a complete MCAP file")] {
        place.call(&["diff", &file, &file]).with_code(2).says(&[&file, told]);
    }
    let none = place.path("none.mcap");
    place.call(&["diff", &none, &none]).with_code(2).says(&["cannot open the recording", &none]);
}

#[test]
fn a_misspelt_command_is_answered_with_the_near_one() {
    let place = Place::new();
    for (found, meant) in [("rn", "run"), ("rnu", "run"), ("vaildate", "validate")] {
        let unknown = format!("unrecognized subcommand '{found}'");
        let tip = format!("a similar subcommand exists: '{meant}'");
        place.call(&[found]).with_code(2).says(&[&unknown, &tip]);
    }
    // Those of another command are not confused with these.
    let ended = place.call(&["ctl", "rn"]).with_code(2);
    assert!(!ended.error.contains("'run'"), "{ended}");
}

#[test]
fn every_subcommand_shows_an_example() {
    let place = Place::new();
    for command in ["run", "check", "diff", "cat", "schema"] {
        let ended = place.call(&[command, "--help"]).with_code(0);
        // Of several the title is "Examples".
        ended.prints(&["Example", &format!(": hummingbus {command} ")]);
    }
    let pages = ["share/doc/hummingbus/docs", "docs/first-hour.md"];
    let help = place.call(&["--help"]).with_code(0);
    help.prints(&[&["Example: hummingbus run manifests/hover.toml"], &pages[..]].concat());
}

#[test]
fn shells_and_the_manual_know_the_commands() {
    let place = Place::new();
    for shell in ["bash", "zsh", "fish"] {
        let printed = place.call(&["completions", shell]).with_code(0).output;
        assert!(printed.contains("campaign"), "{shell}");
        assert!(printed.contains("in-process"), "{shell} does not know the options of run");
    }
    place.call(&["completions", "cmd"]).with_code(2).says(&["bash", "zsh", "fish"]);
    let folder = place.path("man1");
    place.call(&["man", &folder]).with_code(0);
    let whole = fs::read_to_string(format!("{folder}/hummingbus.1")).unwrap();
    assert!(whole.contains("share/doc/hummingbus/docs"), "{whole}");
    let page = fs::read_to_string(format!("{folder}/hummingbus-run.1")).unwrap();
    assert!(page.starts_with(".ie") || page.starts_with(".TH"), "{page}");
    assert!(page.contains("in\\-process"), "{page}");
    let version = place.call(&["--version"]).with_code(0).output;
    assert!(version.starts_with(concat!("hummingbus ", env!("CARGO_PKG_VERSION"))), "{version}");
}

#[test]
fn a_node_without_a_launcher_says_how_to_start_it() {
    let place = Place::new();
    let ended = place.call(&["node", "plant"]).with_code(2);
    ended.says(&["started without one", "hummingbus run MANIFEST"]);
}

/// The example is built with the tests (`cargo test`, or `cargo build --examples` for this one alone).
#[test]
fn the_example_controller_flies_its_manifest_from_its_own_binary() {
    let place = Place::new();
    let folder = std::path::Path::new(env!("CARGO_BIN_EXE_hummingbus")).parent().unwrap();
    let controller = folder.join("examples/custom_controller");
    assert!(controller.exists(), "{} is not built: cargo build --examples", controller.display());
    let manifest = repository("manifests/custom-controller.toml");
    let command = format!("process.controller.command=[{:?}]", controller.display().to_string());
    let args = ["run", &manifest, "--record", &place.path("custom.mcap"), "--set", &command];
    place.call(&args).with_code(0).prints(&["ok     altitude within 2 %", "passed"]);
}
