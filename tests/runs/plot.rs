//! Pictures of recordings: what is in them, and what is refused.

use crate::laps;
use crate::support::{Ended, Place, repository};
use serde_json::{Value, json};
use std::fs;
use std::path::Path;

/// A recording of vehicles that fly laps in the room.
fn laps(place: &Place, vehicles: &[&str]) -> String {
    let recording = place.path("laps.mcap");
    let room = fs::read_to_string(repository("scenes/room.toml")).unwrap();
    laps::record(Path::new(&recording), vehicles, Some(&room));
    recording
}

fn described(ended: Ended) -> Value {
    ended.with_code(0).json()
}

/// Requires that a command was refused with this message.
#[track_caller]
fn refused(ended: Ended, message: &str) {
    ended.with_code(2).says(&[message]);
}

/// Returns the data that a page draws, as the page holds it.
fn page(path: &str) -> Value {
    let text = fs::read_to_string(path).unwrap();
    let (_, data) = text.split_once("<script type=\"application/json\" id=\"data\">").unwrap();
    serde_json::from_str(data.split_once("</script>").unwrap().0).unwrap()
}

fn numbers(values: &Value) -> Vec<f64> {
    values.as_array().unwrap().iter().map(|value| value.as_f64().unwrap()).collect()
}

/// Names, fields and roles of the curves of one set of axes.
fn curves(axes: &Value) -> Vec<[&str; 3]> {
    let all = axes["curves"].as_array().unwrap().iter();
    all.map(|curve| ["name", "field", "role"].map(|key| curve[key].as_str().unwrap())).collect()
}

#[test]
fn what_the_topics_are_of_decides_what_is_plotted_and_how() {
    let place = Place::new();
    let recording = laps(&place, &["h1", "h2"]);
    let shown = described(place.call(&["plot", &recording, "--json"]));
    assert_eq!(shown["files"], json!([{ "path": place.path("laps.html"), "format": "html" }]));
    let vehicles: Vec<_> =
        shown["panels"].as_array().unwrap().iter().map(|panel| &panel["vehicle"]).collect();
    assert_eq!(vehicles, ["h1", "h2"]);
    let axes = shown["panels"][1]["axes"].as_array().unwrap();
    let titles: Vec<_> =
        axes.iter().map(|axes| (axes["title"].as_str().unwrap(), axes["unit"].as_str().unwrap())).collect();
    let expected = [
        ("Attitude", "deg"),
        ("Body rates", "deg/s"),
        ("Velocity", "m/s"),
        ("Position", "m"),
        ("Rotor speed", "rpm"),
    ];
    assert_eq!(titles, expected);
    // The planner asks for all three axes, so the pilot's altitude is left out.
    let position = [
        ["x", "position.x", "flown"],
        ["y", "position.y", "flown"],
        ["z", "position.z", "flown"],
        ["x set point", "position.x", "asked"],
        ["y set point", "position.y", "asked"],
        ["z set point", "position.z", "asked"],
    ];
    assert_eq!(curves(&axes[3]), position);
    assert_eq!(axes[3]["curves"][0]["topic"], "/h2/plant/state");
    assert_eq!(axes[3]["curves"][0]["colour"], axes[3]["curves"][3]["colour"]);
    assert_eq!(shown["solids"].as_array().unwrap().len(), 4);
    let trails: Vec<_> =
        shown["trails"].as_array().unwrap().iter().map(|trail| trail["name"].as_str().unwrap()).collect();
    assert_eq!(trails, ["h1", "h2", "h1 set point", "h2 set point"]);
    // Each vehicle at the start and at the end of its three laps, and at some places between.
    let airframes = shown["airframes"].as_array().unwrap();
    let topics: Vec<_> = airframes.iter().map(|airframe| airframe["topic"].as_str().unwrap()).collect();
    assert_eq!(topics, ["/h1/plant/state", "/h2/plant/state"]);
    for airframe in airframes {
        let places = airframe["places"].as_array().unwrap().len();
        assert!((4..=10).contains(&places) && airframe["name"] == "AscTec Hummingbird", "{airframe}");
    }
    let drawn = &page(&place.path("laps.html"))["airframes"][0];
    let (x, y) = (drawn["x"].as_array().unwrap(), drawn["y"].as_array().unwrap());
    // The first line is an arm: from the start of the first lap, at (2, 0), to the front, along x.
    assert!(x.len() > 4 * 100 && x[2].is_null(), "{}", x.len());
    let start_m = [&x[0], &y[0], &x[1], &y[1]].map(|value| value.as_f64().unwrap());
    assert!((start_m[0] - 2.0).abs() < 0.01 && (start_m[2] - start_m[0] - 0.17).abs() < 1e-3, "{start_m:?}");
    assert!(start_m[1].abs() < 1e-3 && start_m[3].abs() < 1e-3, "{start_m:?}");
}

#[test]
fn one_vehicle_of_several_is_chosen() {
    let place = Place::new();
    let recording = laps(&place, &["h1", "h2"]);
    let shown = described(place.call(&["plot", &recording, "--vehicle", "h2", "--json"]));
    assert_eq!(
        (shown["panels"].as_array().unwrap().len(), &shown["panels"][0]["vehicle"]),
        (1, &json!("h2"))
    );
    assert_eq!(shown["trails"].as_array().unwrap().len(), 2);
    let message = "the recording has no vehicle `h3`; it has h1, h2";
    refused(place.call(&["plot", &recording, "--vehicle", "h3"]), message);
}

#[test]
fn a_long_curve_keeps_its_one_spike_and_its_ends() {
    let place = Place::new();
    let recording = laps(&place, &[""]);
    place.call(&["plot", &recording, "--plot", "/plant/state:position.z"]).with_code(0);
    let curve = &page(&place.path("laps.html"))["panels"][0]["axes"][0]["curves"][0];
    let (x, y) = (numbers(&curve["x"]), numbers(&curve["y"]));
    assert!(x.len() <= 4000 && x.len() > 1000, "{}", x.len());
    let spike = y.iter().position(|value| *value == laps::SPIKE_M).expect("the spike is gone");
    assert!((x[spike] - f64::from(laps::SPIKE_TICK) * 0.01).abs() < 1e-6);
    assert_eq!((x[0], *x.last().unwrap()), (0.0, f64::from(laps::TICKS - 1) * 0.01));
}

#[test]
fn a_yaw_that_goes_round_is_drawn_without_jumps_in_degrees() {
    let place = Place::new();
    let recording = laps(&place, &[""]);
    place.call(&["plot", &recording, "--plot", "/plant/state:attitude.yaw"]).with_code(0);
    let yaw = numbers(&page(&place.path("laps.html"))["panels"][0]["axes"][0]["curves"][0]["y"]);
    // Three laps.
    assert!((yaw.last().unwrap() - 1080.0).abs() < 0.2, "{:?}", yaw.last());
    assert!(yaw.windows(2).all(|pair| (pair[1] - pair[0]).abs() < 2.0));
}

#[test]
fn a_span_of_time_is_chosen_its_ends_included() {
    let place = Place::new();
    let recording = laps(&place, &[""]);
    let shown = described(place.call(&["plot", &recording, "--from", "10", "--to", "10.5", "--json"]));
    assert_eq!(shown["span_s"], json!([10.0, 10.5]));
    let curve = &shown["panels"][0]["axes"][0]["curves"][0];
    assert_eq!((&curve["samples"], &curve["points"]), (&json!(51), &json!(51)));
    let message = "there is nothing to plot from 60 s: the recording spans 0.000 s to 59.990 s";
    refused(place.call(&["plot", &recording, "--from", "60"]), message);
    let message = "--from 5 --to 5: the end must be after the start";
    refused(place.call(&["plot", &recording, "--from", "5", "--to", "5"]), message);
}

#[test]
fn chosen_fields_share_axes_where_they_share_a_unit() {
    let place = Place::new();
    let recording = laps(&place, &[""]);
    let plots = [
        "--plot",
        "/plant/state:position.z,/pilot/set_point:altitude",
        "--plot",
        "/plant/state:rotor_speed[0],rotor_speed[3]",
    ];
    let args = [&["plot", &recording, "--json"][..], &plots].concat();
    let shown = described(place.call(&args));
    let axes = shown["panels"][0]["axes"].as_array().unwrap();
    assert_eq!(curves(&axes[0]), [["z", "position.z", "flown"], ["z set point", "altitude", "asked"]]);
    assert_eq!((&axes[0]["label"], &axes[0]["unit"]), (&json!("position.z, altitude"), &json!("m")));
    assert_eq!(curves(&axes[1]).len(), 2);
    let message = "/plant/state:position.z in m, /plant/state:attitude.roll in deg";
    refused(place.call(&["plot", &recording, "--plot", "/plant/state:position.z,attitude.roll"]), message);
}

/// The first vehicle flies round the origin with its nose ahead.
#[test]
fn a_velocity_is_drawn_along_the_body_and_against_another_number() {
    let place = Place::new();
    let recording = laps(&place, &[""]);
    let body = "/plant/state:velocity.u,velocity.v,velocity.w";
    let (against, path) = ("/plant/state:position.x", place.path("against.html"));
    let args = ["plot", &recording, "--plot", body, "--against", against, "--out", &path, "--json"];
    let shown = described(place.call(&args));
    let axes = &shown["panels"][0]["axes"][0];
    assert_eq!((&axes["title"], &axes["unit"]), (&json!("velocity u, v, w"), &json!("m/s")));
    assert_eq!(curves(axes)[1], ["v", "velocity.v", "flown"]);
    assert_eq!(shown["across"]["label"], "position.x [m]");
    let drawn = page(&path);
    let [x, y] = ["x", "y"].map(|axis| numbers(&drawn["panels"][0]["axes"][0]["curves"][0][axis]));
    assert!(x.windows(2).any(|pair| pair[0] < pair[1]) && x.windows(2).any(|pair| pair[0] > pair[1]));
    let ends = numbers(&drawn["across"]["range"]);
    assert!(x.iter().all(|x| (ends[0] - 1e-4..=ends[1] + 1e-4).contains(x)) && x.len() == y.len());
    let message =
        "--against /plant/state:position is several numbers: name one of position.x, position.y, position.z";
    refused(place.call(&["plot", &recording, "--against", "/plant/state:position"]), message);
}

#[test]
fn what_is_not_there_is_refused_with_what_is() {
    let place = Place::new();
    let recording = laps(&place, &[""]);
    let cases: [(&[&str], &str); 14] = [
        (
            &["--plot", "/plant/stat:position.z"],
            "the recording has no topic /plant/stat (did you mean `/plant/state`?); it has /pilot/set_point, /planner/reference",
        ),
        (
            &["--plot", "/pilot/set_point:heigh"],
            "topic /pilot/set_point has no field `heigh`; it has stamp.sec, stamp.nanosec, altitude, roll",
        ),
        (&["--plot", "position.z"], "`position.z` is not TOPIC:FIELD"),
        (&["--plot", "/plant/state:"], "`/plant/state:` names no field"),
        (&["--against", "position.x"], "--against position.x: it is not TOPIC:FIELD"),
        (
            &["--against", "/plant/state:positio"],
            "topic /plant/state has no field `positio` (did you mean `position.x`?); it has",
        ),
        (&["--full-throttle", "0"], "--full-throttle 0: expected a number of counts above 0"),
        (&["--out", "laps.pdf"], "--out laps.pdf: its name must end in .html, .png or .svg"),
        (&["--png", "/no/where.png"], "cannot create /no/where.png: there is no folder /no"),
        (&["--svg", &recording], "laps.mcap is the recording itself: name another file"),
        (&["--png", &place.path("tmp")], "its name must end in .png"),
        (&["--png", &place.path("a.jpg")], "its name must end in .png"),
        (&["--png", &place.path("a.svg")], "its name must end in .png"),
        (&["--svg", &place.path("a.png")], "its name must end in .svg"),
    ];
    for (args, reason) in cases {
        refused(place.call(&[&["plot", &recording][..], args].concat()), reason);
    }
    assert!(!Path::new(&place.path("laps.html")).exists(), "a refused plot wrote its page");
}

#[test]
fn a_recording_without_a_vehicle_is_plotted_by_its_fields_only() {
    let place = Place::new();
    let recording = laps(&place, &[]);
    let message = "name fields with --plot TOPIC:FIELD; the topics are none";
    refused(place.call(&["plot", &recording]), message);
}

#[test]
fn pictures_have_their_size_their_letters_and_their_dashes_and_are_the_same_twice() {
    let place = Place::new();
    let recording = laps(&place, &[""]);
    let [a, b, svg] = ["a.png", "b.png", "laps.svg"].map(|name| place.path(name));
    let views = [
        "--figure",
        "time",
        "--figure",
        "top",
        "--figure",
        "side",
        "--figure",
        "path",
        "--title",
        "Laps & walls",
    ];
    let args = [&["plot", &recording, "--png", &a, "--out", &b, "--svg", &svg][..], &views].concat();
    place.call(&args).with_code(0);
    let (a, b) = (fs::read(a).unwrap(), fs::read(b).unwrap());
    assert!(a.starts_with(b"\x89PNG\r\n\x1a\n") && a.len() > 100_000);
    assert!(a == b, "two pictures of one recording differ");
    // The width is that of the picture times 1.5.
    assert_eq!(u32::from_be_bytes(a[16..20].try_into().unwrap()), 1500);
    let svg = fs::read_to_string(svg).unwrap();
    assert!(svg.starts_with("<svg width=\"1000\" height=\"") && svg.trim_end().ends_with("</svg>"));
    for text in [
        "Laps &amp; walls",
        "Attitude",
        "angle [deg]",
        "simulated time [s]",
        "set point",
        "Path from above",
        "x [m]",
    ] {
        assert!(svg.contains(text), "{text} is missing");
    }
    // Three set points have the colours of three flown lines, and one row of the legend.
    assert!(!svg.contains("z set point"));
    // Three angles of one lap that was asked for are one dash after the other; each is a line of its own.
    assert!(svg.matches("<polyline").count() > 200);
    assert!(!Path::new(&place.path("laps.html")).exists());
}

#[test]
fn a_recording_that_was_cut_off_is_plotted_as_far_as_it_goes() {
    let place = Place::new();
    let recording = laps(&place, &[""]);
    let bytes = fs::read(&recording).unwrap();
    let cut = place.write("cut.mcap", &bytes[..bytes.len() * 2 / 3]);
    place.call(&["plot", &cut, "--json"]).with_code(1).says(&["was cut off"]);
    assert!(Path::new(&place.path("cut.html")).exists());
}

#[test]
fn the_amounts_are_those_of_each_file() {
    let place = Place::new();
    let recording = laps(&place, &["h1", "h2"]);
    let plotted = |more: &[&str]| place.call(&[&["plot", &recording], more].concat()).with_code(0).output;
    let page = plotted(&[]);
    assert!(
        page.starts_with("axes: 10 with ") && page.contains("paths: 4; objects in the scene: 4"),
        "{page}"
    );
    // A picture shows the first vehicle over time.
    let picture = plotted(&["--svg", &place.path("a.svg")]);
    assert!(picture.starts_with("axes: 5 with ") && !picture.contains("paths"), "{picture}");
    let paths = plotted(&["--figure", "top", "--svg", &place.path("b.svg")]);
    assert!(
        paths.starts_with("paths: 4; objects in the scene: 4; from ") && !paths.contains("axes"),
        "{paths}"
    );
}
