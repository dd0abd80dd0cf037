//! Names and contents of files that others made reach the terminal escaped and shortened, whatever command prints them.

use crate::refusals::good;
use crate::skipped::quick_or;
use crate::support::{Ended, Place, repository};

/// Sets a window's title, rings, clears the screen in two ways, turns the direction of writing, and hides.
const HOSTILE: &str = "\u{1b}]0;x\u{7}\u{1b}[2J\u{9b}2J\u{7f}\u{202e}\u{2066}\u{200b}\u{feff}\u{2028}";

/// Requires that the command has told of the hostile text, and that a terminal would obey nothing of it.
#[track_caller]
fn require_escaped(ended: &Ended) {
    let said = format!("{}{}", ended.output, ended.error);
    let raw: Vec<char> = HOSTILE.chars().filter(|c| c.is_control() || !c.is_ascii()).collect();
    assert!(!said.contains(&raw[..]), "{:?}", said);
    assert!(
        ["\\u{202e}", "\\u202e", "&#8238;"].iter().any(|escaped| said.contains(escaped)),
        "not told of: {said}"
    );
}

/// A record of an MCAP file ("Records" in its specification).
fn record(opcode: u8, parts: &[&[u8]]) -> Vec<u8> {
    let body = parts.concat();
    [&[opcode][..], &(body.len() as u64).to_le_bytes(), &body].concat()
}

/// A text or a table with its length in front.
fn sized(bytes: &[u8]) -> Vec<u8> {
    [&u32::try_from(bytes.len()).unwrap().to_le_bytes()[..], bytes].concat()
}

/// The recording of one message with the text `value` and a number on the topic `topic`, as a writer leaves it that was
/// killed.
fn recording(topic: &str, value: &str) -> Vec<u8> {
    let id = 1_u16.to_le_bytes();
    let definition = format!("string {HOSTILE}name\nfloat64 number  # [{HOSTILE}]\n");
    let text = sized(&[value.as_bytes(), b"\0"].concat());
    let padding = vec![0; text.len().next_multiple_of(8) - text.len()];
    let stamps = [&id[..], &[7, 0, 0, 0], &[0; 16]].concat();
    let message = [&[0, 1, 0, 0][..], &text, &padding, &1.5_f64.to_le_bytes()].concat();
    [
        b"\x89MCAP0\r\n".to_vec(),
        record(1, &[&sized(b"ros2"), &sized(b"")]),
        record(
            3,
            &[
                &id,
                &sized(format!("a/msg/{HOSTILE}").as_bytes()),
                &sized(b"ros2msg"),
                &sized(definition.as_bytes()),
            ],
        ),
        record(4, &[&id, &id, &sized(topic.as_bytes()), &sized(b"cdr"), &sized(b"")]),
        record(5, &[&stamps, &message]),
    ]
    .concat()
}

#[test]
fn names_of_files_and_arguments_are_escaped_by_every_command() {
    let place = Place::new();
    let missing = place.path(HOSTILE);
    let (mcap, toml) = (format!("{missing}.mcap"), format!("{missing}.toml"));
    let vehicle = repository("vehicles/hummingbird.toml");
    let calls: &[&[&str]] = &[
        &["run", &toml],
        &["check", &toml],
        &["check", &toml, "--json"],
        &["profile", &toml],
        &["shadow", &mcap],
        &["shadow", &toml, "--process", "imu", "--with", HOSTILE],
        &["diff", &mcap, &mcap],
        &["cat", &mcap],
        &["plot", &mcap],
        &["plot", &mcap, "--out", HOSTILE],
        &["new", "vehicle", "--from", &missing, "-o", &place.path("new.toml")],
        &["urdf", &toml],
        &["urdf", &vehicle, "--frame", HOSTILE],
        &["identify", &toml, "--out", &place.path("out")],
        &["identify", "rotor", &toml, "--out", &place.path("out")],
        &["validate", &vehicle, &toml],
        &["run", &repository("manifests/hover.toml"), "--set", HOSTILE],
        &["run", &repository("manifests/hover.toml"), "--set", &format!("run.{HOSTILE}=1")],
        &["run", &repository("manifests/hover.toml"), "--record", &place.path(&format!("{HOSTILE}/a.mcap"))],
        &["check", &toml, HOSTILE],
        &[HOSTILE],
        &["run", &toml, "--pace", HOSTILE],
        &["swap", "imu", "--with", HOSTILE],
        &["node", HOSTILE],
    ];
    calls.iter().for_each(|args| require_escaped(&place.call(args)));
}

#[test]
fn contents_of_manifests_are_escaped() {
    let place = Place::new();
    // As a TOML text may have them; most control characters may not stand in TOML as they are.
    let text: String = HOSTILE.chars().map(|c| format!("\\u{:04x}", u32::from(c))).collect();
    let changes = [
        ("kind = \"imu\"", format!("kind = \"{text}\"")),
        ("[process.imu]", format!("[process.\"{text}\"]")),
        (
            "inputs.state = \"/plant/state\"\n\n[process.mocap]",
            format!("inputs.state = \"/{text}\"\n\n[process.mocap]"),
        ),
        ("[process.recorder]", format!("[\"{text}\"]\nx = 1\n[process.recorder]")),
        ("channel = \"altitude\"", format!("channel = \"{text}\"")),
        ("kind = \"recorder\"", format!("kind = \"recorder\"\nlog = \"{text}/log\"")),
        ("kind = \"recorder\"", format!("kind = \"recorder\"\n[process.other]\ncommand = [\"{text}\"]")),
    ];
    for (from, to) in changes {
        assert_eq!(good().matches(from).count(), 1, "{from}");
        let path = place.write("hostile.toml", good().replace(from, &to));
        for command in ["check", "run"] {
            require_escaped(&place.call(&[command, &path]).with_code(2));
        }
    }
}

#[test]
fn contents_of_recordings_are_escaped() {
    let place = Place::new();
    let a = place.write("a.mcap", recording(&format!("/{HOSTILE}"), HOSTILE));
    let b = place.write("b.mcap", recording(&format!("/{HOSTILE}"), "another"));
    let page = place.path("page.html");
    let calls: &[&[&str]] = &[
        &["cat", &a],
        &["cat", &a, "--topic", "/none"],
        &["diff", &a, &b],
        &["plot", &a, "--out", &page, "--json"],
        &["plot", &a, "--out", &page, "--plot", "/none:x"],
        &["plot", &a, "--out", &page, "--plot", &format!("/{HOSTILE}:x")],
        &["plot", &a, "--out", &page, "--json", "--plot", &format!("/{HOSTILE}:number")],
    ];
    calls.iter().for_each(|args| require_escaped(&place.call(args)));
    let line = place.call(&["cat", &a]).json();
    let mut values = line["fields"].as_object().unwrap().values();
    assert!(values.any(|value| value == HOSTILE), "escaped JSON is the same data: {line}");
}

/// A name with ends of lines, which would look like the end of a summary.
const FORGED: &str = "height\n\npassed\nto plot it: true\n";

/// Requires that no line of the command's output is one that only the forged name has.
#[track_caller]
fn require_one_line(ended: &Ended) {
    let said = format!("{}{}", ended.output, ended.error);
    assert!(!said.lines().any(|line| line == "passed" || line.starts_with("to plot it: true")), "{said}");
    assert!(said.contains("height\\n\\npassed"), "not told of: {said}");
}

#[test]
fn names_with_ends_of_lines_forge_no_line() {
    let place = Place::new();
    // As TOML writes it.
    let literal = format!("{FORGED:?}");
    let condition = |list: &str, limits: &str| {
        format!(
            "\n[[{list}]]\nname = {literal}\ntopic = \"/plant/state\"\nfield = \"position.z\"\nunit = \"m\"\n\
             statistic = \"max\"\n{limits}\n"
        )
    };
    for (list, limits) in [("pass", "max = 0.0"), ("measure", "")] {
        let path = place.write("forged.toml", good() + &condition(list, limits));
        for command in ["check", "run"] {
            let ended = place.call(&[command, &path]).with_code(2);
            require_one_line(&ended);
            ended.says(&["forged.toml:", "`name`: expected a text without control characters"]);
        }
    }
    let flights = format!(
        "vehicle = {}\n[channels]\n[[flight]]\nname = {literal}\nfile = \"log.csv\"\nrole = \"fit\"\n",
        toml::Value::from(repository("vehicles/hummingbird.toml"))
    );
    let flights = place.write("flights.toml", flights);
    let out = place.path("out");
    let ended = place.call(&["identify", &flights, "--out", &out]).with_code(2);
    require_one_line(&ended);
    ended.says(&["flights.toml:4", "a text without control characters"]);
    // Names in recordings of others are escaped.
    let topic = format!("/{FORGED}");
    let a = place.write("a.mcap", recording(&topic, "one"));
    let b = place.write("b.mcap", recording(&topic, "another"));
    let page = place.path("page.html");
    let calls: &[&[&str]] = &[
        &["cat", &a, "--topic", "/none"],
        &["diff", &a, &b],
        &["diff", &a, &b, "--tolerance", "1"],
        &["plot", &a, "--out", &page, "--plot", "/none:x"],
    ];
    calls.iter().for_each(|args| require_one_line(&place.call(args)));
    // And so are what the arguments of `plot` name, and their parts.
    let calls: &[&[&str]] = &[
        &["plot", &a, "--out", &page, "--plot", &format!("/none:{FORGED}")],
        &["plot", &a, "--out", &page, "--plot", &format!("{topic}:number,{FORGED}:x")],
        &["plot", &a, "--out", &page, "--plot", FORGED],
        &["plot", &a, "--out", &page, "--against", FORGED],
        &["plot", &a, "--out", &page, &format!("--against={FORGED}:x")],
        &["plot", &a, "--out", &page, "--vehicle", FORGED],
    ];
    calls.iter().for_each(|args| require_one_line(&place.call(args).with_code(2)));
}

/// A recording with another encoding of messages and schemas is told with both, and not with a damage.
#[test]
fn a_recording_in_another_encoding_is_told_with_it() {
    let place = Place::new();
    let bytes = recording("/odometry", "x");
    let swapped = |bytes: &[u8], from: &[u8], to: &[u8]| {
        let at = bytes.windows(from.len()).position(|window| window == from).unwrap();
        [&bytes[..at], to, &bytes[at + from.len()..]].concat()
    };
    // Of the same lengths as `cdr` and `ros2msg`.
    for (message, schema) in [("jsn", "jsonsch"), ("pbf", "protobf")] {
        let other = swapped(&bytes, b"cdr", message.as_bytes());
        let path = place.write("other.mcap", swapped(&other, b"ros2msg", schema.as_bytes()));
        for args in [&["cat", &path][..], &["plot", &path], &["diff", &path, &path]] {
            let ended = place.call(args).with_code(2);
            ended.says(&[
                &format!("topic /odometry has messages encoded as `{message}` with a `{schema}` schema"),
                "expected messages of ROS 2, encoded as `cdr` with a `ros2msg` schema",
                "mcap filter",
            ]);
            assert!(!ended.error.contains("not a complete MCAP file"), "{}", ended.error);
        }
    }
}

#[test]
fn a_live_run_of_a_hostile_name_is_shown_escaped() {
    let place = Place::new();
    let hover = repository("manifests/hover.toml");
    let path = place.write(&format!("{HOSTILE}.toml"), format!("include = [{}]\n", toml::Value::from(hover)));
    let args = [
        "run",
        &path,
        "--record",
        &place.path("a.mcap"),
        "--pace",
        "realtime",
        "--set",
        "run.duration_s=600",
    ];
    let mut launch = place.start(&args);
    launch.await_ticks(1);
    let calls: &[&[&str]] = &[
        &["top", "--once"],
        &["top", "--once", "--json"],
        &["ctl", "status", "--run", "none"],
        &["ctl", "status", "--run", HOSTILE],
        &["swap", "none", "--run", HOSTILE],
    ];
    let ended: Vec<Ended> = calls
        .iter()
        .map(|args| {
            let run = if args.contains(&"--run") { vec![] } else { vec!["--run".to_owned(), place.run_id()] };
            let args: Vec<&str> = args.iter().copied().chain(run.iter().map(String::as_str)).collect();
            place.start(&args).end_among_others()
        })
        .collect();
    let swap = ["swap", HOSTILE, "--run", &place.run_id()];
    let swapped = place.start(&swap).end_among_others();
    place.start(&["ctl", "stop", "--run", &place.run_id()]).end_among_others().with_code(0);
    let flown = launch.end();
    ended.iter().chain([&swapped]).for_each(require_escaped);
    flown.with_code(1).prints(&["stopped before its end"]);
}

#[test]
fn a_name_of_megabytes_is_shortened() {
    let place = Place::new();
    let long = "x".repeat(quick_or(1_usize, 8, "names of 8 MB") << 20);
    for (from, to) in [
        ("kind = \"imu\"", format!("kind = \"{long}\"")),
        ("[process.imu]", format!("[process.{long}]")),
        ("duration_s = 0.1", format!("{long} = 0.1")),
    ] {
        let path = place.write("long.toml", good().replace(from, &to));
        let ended = place.call(&["check", &path]).with_code(2);
        assert!(ended.error.len() < 100_000, "{} bytes", ended.error.len());
        ended.says(&["characters left out", "long.toml:"]);
    }
}
