//! Faults of all stages of a manifest, told at once, and no false ones after them.

use crate::refusals::good;
use crate::support::{Place, repository};
use std::fs;

/// Checks `text`, which must have the faults with these `parts` of their messages and no others, in this order.
#[track_caller]
fn told(text: &str, parts: &[&str]) {
    let place = Place::new();
    let path = place.write("faulty.toml", text);
    let found = place.call(&["check", &path, "--json"]).with_code(2).json();
    let faults = found["faults"].as_array().unwrap();
    let messages: Vec<&str> = faults.iter().map(|fault| fault["message"].as_str().unwrap()).collect();
    assert_eq!(messages.len(), parts.len(), "{messages:#?}");
    for (message, part) in messages.iter().zip(parts) {
        assert!(message.contains(part), "{part} is missing: {messages:#?}");
    }
}

/// The good manifest with each pair's first text replaced by its second.
#[track_caller]
fn with(changes: &[(&str, &str)]) -> String {
    changes.iter().fold(good(), |text, (from, to)| {
        assert_eq!(text.matches(from).count(), 1, "{from} stands once in the good manifest");
        text.replace(from, to)
    })
}

/// The value of an unknown key goes to another key only where one or two letters are wrong.
#[test]
fn an_unknown_key_is_told_alone() {
    let imu = "inputs.imu = \"/imu/imu\"";
    let text = with(&[(imu, "inputs.imu = { topic = \"/imu/imu\", every_ticks = 2 }")]);
    told(&text, &["unknown key `process.ekf.inputs.imu.every_ticks`"]);
    let text = with(&[(imu, "inputs.imu = { topi = \"/imu/imu\" }")]);
    told(&text, &["unknown key `process.ekf.inputs.imu.topi`"]);
    // Without it the input lacks its topic, which nobody has to be told as well.
    let text = with(&[(imu, "inputs.imu = { source = \"/imu/imu\" }")]);
    told(&text, &["unknown key `process.ekf.inputs.imu.source`"]);
}

/// An unknown key of a delay, of an output that others read, and of the run itself.
#[test]
fn nothing_follows_from_an_unknown_key() {
    let place = Place::new();
    let hover = fs::read_to_string(repository("manifests/hover.toml")).unwrap();
    let hover = hover.replace("../vehicles", &repository("vehicles"));
    for (from, to, key) in [
        ("delay_ticks = 1", "delay = 1", "delay`"),
        ("initial = { command", "start = { command", "start`"),
        ("topic = \"/tf\"", "topicname = \"/tf\"", "topicname`"),
        ("duration_s = 12.0", "[runn]\nduration_s = 12.0", "unknown key `runn`"),
    ] {
        assert!(hover.contains(from), "{from}");
        let path = place.write("m.toml", hover.replacen(from, to, 1));
        let found = place.call(&["check", &path, "--json"]).with_code(2).json();
        let faults = found["faults"].as_array().unwrap();
        assert!(faults.len() == 1 && faults[0]["message"].as_str().unwrap().contains(key), "{found:#}");
    }
}

/// Names of processes may have dots.
#[test]
fn a_fault_of_a_process_with_a_dot_in_its_name_ends_in_words() {
    let text = "[run]\nduration_s = 1.0\n[process.a]\nkind = \"imu\"\ninputs.state = \"/plant/state\"\n\
                [process.\"a.b\"]\noutputs = 3\n[group.a]\nprocesses = []\n[group.\"a.b\"]\nprocesses = 3\n";
    let place = Place::new();
    let path = place.write("m.toml", text);
    let found = place.call(&["check", &path, "--json"]).with_code(2).json();
    let all = found["faults"].to_string();
    assert!(all.contains("a.b") && all.contains("outputs"), "{found:#}");
}

/// A pass condition of the good manifest with this `line` in place of its statistic and limit.
fn pass(line: &str) -> String {
    format!(
        "\n[[pass]]\nname = \"a\"\ntopic = \"/plant/state\"\nfield = \"position.z\"\nunit = \"m\"\n{line}\n"
    )
}

#[test]
fn faults_of_every_stage_are_told_at_once() {
    let place = Place::new();
    let hummingbird = repository("vehicles/hummingbird.toml");
    let text = fs::read_to_string(&hummingbird).unwrap();
    let vehicle =
        place.write("light.toml", text.replacen("mass = { value = 0.480", "mass = { value = -1", 1));
    let text = with(&[
        ("window_ticks = 64", "sed = 1"),
        ("kind = \"mocap\"", "kind = \"mocup\""),
        ("\"/imu/imu\"", "\"/imu/imo\""),
        ("altitude_m = 1.0", "altitude_m = \"high\""),
    ]);
    let text = text.replace(&hummingbird, &vehicle) + &pass("statistic = \"evry\"\nmax = 2.0");
    let parts =
        ["unknown key `run.sed`", "mass", "no kind `mocup`", "/imu/imo", "`initial_altitude_m`", "`evry`"];
    told(&text, &parts);
}

/// Nothing is told that follows from the value that is missing then.
#[test]
fn a_value_of_a_wrong_type_hides_no_other_fault() {
    let imu = "inputs.imu = \"/imu/imu\"";
    let rate = ("window_ticks = 64", "rate_hz = \"x\"");
    told(&with(&[rate, (imu, "")]), &["`run.rate_hz`", "no publisher for its input `imu`"]);
    let limit = with(&[(imu, "")]) + &pass("statistic = \"max\"\nmin = \"a\"");
    told(&limit, &["no publisher for its input `imu`", "`pass.0.min`"]);
    let duration = with(&[("duration_s = 0.1", "duration_s = []"), ("kind = \"pid\"", "kind = \"pud\"")]);
    told(&(duration + &pass("statistic = \"max\"\nmax = 9\nfrom_s = 5.0")), &["`run.duration_s`", "`pud`"]);
    let both = with(&[]) + &pass("statistic = \"evry\"\nmin = \"a\"\nmx = 1");
    told(&both, &["`pass.0.statistic`", "`pass.0.min`", "`pass.0.mx`"]);
}

/// Others read what a process with a fault sends, conditions judge it, and groups hold it.
#[test]
fn nothing_is_told_of_what_a_faulty_process_sends() {
    let judged = "\n[[pass]]\nname = \"a\"\ntopic = \"/mocap/mocap\"\nfield = \"position.z\"\nunit = \"m\"\n\
                  statistic = \"max\"\nmax = 2.0\n[group.all]\nprocesses = [\"imu\", \"mocap\"]\n";
    let with = |from: &str, to: &str| with(&[(from, to)]) + judged;
    told(&with("kind = \"mocap\"", "kind = \"mocup\""), &["no kind `mocup`"]);
    told(&with("kind = \"mocap\"", "kind = 3"), &["`process.mocap.kind`"]);
    told(&with("kind = \"mocap\"", "command = [\"/no/such/program\"]"), &["there is no such file"]);
    told(&with("period_ticks = 5", "period_ticks = \"a\""), &["`process.mocap.period_ticks`"]);
    told(&with("period_ticks = 5", "outputs.mocap.every_ticks = 0"), &["is due every 0 ticks"]);
    told(&with("kind = \"recorder\"", "kind = \"recorder\"\ncpu = \"x\""), &["`process.recorder.cpu`"]);
}

#[test]
fn all_faults_of_a_table_of_parameters_are_told() {
    let mocap = |parameters: &str| with(&[("period_ticks = 5", &format!("parameters = {{ {parameters} }}"))]);
    told(&mocap("rate = 3, delay = 4"), &["unknown key `rate`", "unknown key `delay`"]);
    told(&mocap("delay_ms = -1, dropout = 2"), &["`delay_ms`", "`dropout`"]);
    told(&mocap("rate_hz = \"x\", delay = 4"), &["`rate_hz`", "unknown key `delay`"]);
    let late = "rate_hz = 10.0, delay_ms = 1e7, dropout = 0.9, dropout_mean_s = 0.5";
    told(&mocap(late), &["`delay_ms`", "`dropout_mean_s`"]);
}

/// Parameters that do not go together, each pair of them.
#[test]
fn all_contradictions_of_a_process_are_told() {
    let plant = "kind = \"plant\"\nparameters = { crash_speed_m_s = 3.0, window_s = 0.00015 }";
    told(
        &with(&[("kind = \"plant\"", plant)]),
        &["`crash_speed_m_s` needs `backend`", "needs the input `measured`", "not a whole number of ticks"],
    );
}

#[test]
fn all_faults_of_a_room_are_told() {
    let odometry = format!(
        "\n[process.range]\nkind = \"range\"\nscene = {:?}\nperiod_ticks = 10\ninputs.state = \"/plant/state\"\n\
         [process.attitude]\nkind = \"attitude\"\ninputs.imu = \"/imu/imu\"\n\
         [process.odometry]\nkind = \"range-inertial\"\n\
         inputs = {{ ranges = \"/range/ranges\", imu = \"/imu/imu\", attitude = \"/attitude/estimate\" }}\n\
         parameters = {{ room_m = [4.0, 4.0], start_in_room_m = [-1.0, 5.0] }}\n",
        repository("scenes/room.toml")
    );
    told(&(with(&[]) + &odometry), &["`room_m.1` must be", "`start_in_room_m.0` must be"]);
}

#[test]
fn a_number_out_of_all_range_hides_no_fault_of_a_file() {
    let place = Place::new();
    let hummingbird = repository("vehicles/hummingbird.toml");
    let text = fs::read_to_string(&hummingbird).unwrap().replacen("value = 0.480", "value = -1", 1);
    let vehicle = place.write("light.toml", text);
    let plant =
        "kind = \"plant\"\nparameters = { initial_position_m = [1e30, 0.0, 0.0], initial_yaw_deg = 1e30 }";
    let text = with(&[("kind = \"plant\"", plant)]).replace(&hummingbird, &vehicle);
    told(&text, &["`initial_position_m.0`", "`initial_yaw_deg`", "`body.mass`"]);
}

#[test]
fn all_faults_of_all_entries_of_a_list_are_told() {
    let text = with(&[("at_s = 0.1, to = 1.5, unit = \"m\"", "at_s = -0.1, to = 1.5, unit = \"s\"")]);
    told(&text, &["`set_points.0.at_s`", "`set_points.0.unit`"]);
}

/// A vehicle file, a gains file and a scene file with three faults each: each fault once, although two processes read the vehicle.
#[test]
fn all_faults_of_all_files_are_told() {
    let place = Place::new();
    let faulty = |name: &str, path: &str, changes: [(&str, &str); 3]| {
        let text = fs::read_to_string(repository(path)).unwrap();
        let change = |text: String, (from, to): (&str, &str)| {
            assert!(text.contains(from), "{path} has {from}");
            text.replacen(from, to, 1)
        };
        place.write(name, changes.into_iter().fold(text, change))
    };
    let vehicle = faulty(
        "vehicle.toml",
        "vehicles/hummingbird.toml",
        [
            ("value = 0.480, unit = \"kg\"", "value = \"x\", unit = \"m\""),
            ("value = \"clockwise\"", "value = \"left\""),
            ("[-0.17, 0, 0]", "[-1700, 0, 0]"),
        ],
    );
    let gains = faulty(
        "gains.toml",
        "controllers/gains/pid.toml",
        [("value = 12,", "value = -12,"), ("value = 3,", "valu = 3,"), ("\"rad/s^2\"", "\"rad\"")],
    );
    let scene = faulty(
        "scene.toml",
        "scenes/room.toml",
        [("value = 0.5,", "value = -0.5,"), ("\"wall +y\"", "\"\""), ("[0, 5.05, 1.5]", "[0, 5.05]")],
    );
    let plant = format!("kind = \"plant\"\nscene = \"{scene}\"\nparameters.colour = 1");
    let pid = format!("kind = \"pid\"\ngains = \"{gains}\"");
    let text = with(&[("kind = \"plant\"", &plant), ("kind = \"pid\"", &pid)]);
    let text = text.replace(&repository("vehicles/hummingbird.toml"), &vehicle);
    let parts = [
        "`friction`",
        "`boxes.2.name`",
        "`boxes.2.centre.value`",
        "unknown key `colour`",
        "`body.mass.value`",
        "`body.mass.unit`",
        "`rotors.0.spin.value`",
        "`rotors.2.position`",
        "`altitude.proportional`",
        "unknown key `altitude.integral.valu`",
        "`attitude.integral_max.unit`",
    ];
    told(&text, &parts);
}
