//! A browser shows recordings that `hummingbus view` serves: the poses are the recording's, the room and the scopes are
//! drawn, and keys alone do everything.

use crate::launched::Launched;
use crate::skipped::{cases, is_left};
use crate::{Flight, HUMMINGBUS, ROOT, laps, look, readers};
use bus::Message as _;
use bus::announcement::Announcement;
use bus::messages::{MotorCommand, PlantState, StateEstimate, Time};
use recorder::reader::Recording;
use recorder::writer::{ChannelId, RecordingWriter};
use serde_json::{Value, json};
use std::ffi::OsStr;
use std::fs;
use std::io::{BufRead as _, BufReader, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tempfile::TempDir;

/// A server of recordings.
struct View {
    process: Launched,
    address: String,
}

impl View {
    fn of(recordings: &[&Path]) -> Self {
        let mut command = Command::new(HUMMINGBUS);
        command.arg("view").args(recordings).arg("--no-open").stdout(Stdio::piped()).stderr(Stdio::null());
        let mut child = command.spawn().unwrap();
        let mut address = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut address).unwrap();
        Self { process: Launched(child), address: address.trim().to_owned() }
    }

    fn look(&self, readers: &Path, more: &[&str]) -> Value {
        let arguments: Vec<&OsStr> =
            std::iter::once(&*self.address).chain(more.iter().copied()).map(OsStr::new).collect();
        let seen = look(readers, "read_view.mjs", &arguments);
        assert_eq!((&seen["wrong"], &seen["state"], &seen["overflow"]), (&json!([]), &json!(""), &json!(0)));
        seen
    }
}

/// The numbers of `fields` on a topic at the newest sample at or before `time_ns`.
fn at<const N: usize>(recording: &Recording, topic: &str, fields: [&str; N], time_ns: u64) -> [f64; N] {
    let asked = fields.map(|field| (topic, field));
    let series = recording.series(&asked).unwrap();
    let index = series[0].time_ns.partition_point(|time| *time <= time_ns) - 1;
    std::array::from_fn(|field| series[field].value[index])
}

/// The shown pose of a vehicle is that of the recording.
fn require_pose(shown: &Value, recording: &Recording, topic: &str, time_ns: u64) {
    let numbers = |key: &str| serde_json::from_value::<Vec<f64>>(shown[key].clone()).unwrap();
    let position = at(recording, topic, ["position.x", "position.y", "position.z"], time_ns);
    assert_eq!(numbers("position"), position, "{topic} at {time_ns} ns");
    let attitude = at(recording, topic, ["attitude.x", "attitude.y", "attitude.z", "attitude.w"], time_ns);
    let differ = numbers("attitude").iter().zip(attitude).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    // The page makes it a unit quaternion once more.
    assert!(differ < 1e-12, "{topic} at {time_ns} ns: {shown} {attitude:?}");
}

/// The keys did what they are for, in a recording of ticks of `tick_ns` that ends at `end_ns`.
fn require_keys(seen: &Value, tick_ns: f64, end_ns: f64) {
    let time = |key: &str| seen["keys"][key].as_f64().unwrap();
    assert_eq!((time("home"), time("stepped"), time("back")), (0.0, 2.0 * tick_ns, tick_ns));
    assert!(time("paused") > 3e8 && time("paused") == time("still"), "{}", seen["keys"]);
    assert_eq!(time("end"), end_ns);
}

const TIMES_NS: [u64; 3] = [0, 1_234_000_000, 1_999_000_000];

#[test]
fn a_browser_shows_the_poses_and_curves_of_a_flight_on_every_screen() {
    let Some(readers) = readers() else { return };
    let flight = Flight::shared();
    let view = View::of(&[&flight.recording]);
    let recording = Recording::open(&flight.recording).unwrap();
    let times = TIMES_NS.map(|time| time.to_string());
    let screens = [&["1280x900"][..], &["390x844", "dark"], &["1280x900", "no-webgl", "dark"]];
    // Other tests have WebGL and both sizes.
    for looks in cases("screens", screens, |looks| looks.contains(&"no-webgl")) {
        let arguments: Vec<&str> = looks.iter().copied().chain(times.iter().map(String::as_str)).collect();
        let seen = view.look(&readers, &arguments);
        assert_eq!(
            (&seen["title"], &seen["isFlat"]),
            (&json!("hover.mcap"), &json!(looks.contains(&"no-webgl")))
        );
        for (poses, time_ns) in seen["poses"].as_array().unwrap().iter().zip(TIMES_NS) {
            require_pose(&poses[0], &recording, "/plant/state", time_ns);
        }
        assert!(seen["colours"].as_u64().unwrap() > 8, "the room is drawn: {looks:?} {}", seen["colours"]);
        require_keys(&seen, 1e6, 1.999e9);
        require_curves(&seen, &recording);
        // A quarter to a half of two seconds.
        let zoomed: [f64; 2] = serde_json::from_value(seen["zoomed"].clone()).unwrap();
        assert!((zoomed[0] - 0.5).abs() < 0.06 && (zoomed[1] - 1.0).abs() < 0.06, "{zoomed:?}");
        require_zoom_by_keys(&seen);
        assert_eq!(seen["picked"], json!([[0, "/plant/state", "position.z"]]));
    }
}

/// Z halves the window around 1 s of the flight of 2 s, shift and Z doubles it, W shows all.
fn require_zoom_by_keys(seen: &Value) {
    let windows: Vec<Option<[f64; 2]>> = serde_json::from_value(seen["zoomedByKeys"].clone()).unwrap();
    let expected = [Some([0.5, 1.5]), Some([0.75, 1.25]), Some([0.5, 1.5]), None, Some([0.5, 1.5]), None];
    assert_eq!(windows.len(), expected.len());
    for (index, (found, expected)) in windows.iter().zip(expected).enumerate() {
        let is_near = match (found, expected) {
            (Some(found), Some(expected)) => {
                found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 2e-3)
            }
            (found, expected) => found.is_none() && expected.is_none(),
        };
        assert!(is_near, "key {index}: {windows:?}");
    }
}

/// The first plot has the positions, with the extremes of the recording.
fn require_curves(seen: &Value, recording: &Recording) {
    let curves = seen["plots"][0].as_array().unwrap();
    let height = curves.iter().find(|curve| curve["field"] == "position.z").unwrap();
    assert_eq!((&height["unit"], &height["topic"]), (&json!("m"), &json!("/plant/state")));
    let values = &recording.series(&[("/plant/state", "position.z")]).unwrap()[0].value;
    let spread = values
        .iter()
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| [low.min(*value), high.max(*value)]);
    assert_eq!(height["spread"], json!(spread));
    assert!(height["points"].as_u64().unwrap() > 100, "{height}");
}

#[test]
fn a_browser_shows_two_vehicles_in_their_room_and_another_recording_as_a_ghost() {
    let Some(readers) = readers() else { return };
    let laps = Laps::of(&["h1", "h2"]);
    let other = Laps::of(&["h1"]);
    let view = View::of(&[&laps.recording, &other.recording]);
    let time_ns = u64::from(laps::SPIKE_TICK) * laps::TICK_NS;
    let seen = view.look(&readers, &["1280x900", &time_ns.to_string()]);
    assert_eq!(seen["title"], "laps.mcap against laps.mcap");
    let poses = seen["poses"][0].as_array().unwrap();
    let names: Vec<_> = poses.iter().map(|pose| (&pose["name"], &pose["recording"])).collect();
    assert_eq!(names, [(&json!("h1"), &json!(0)), (&json!("h2"), &json!(0)), (&json!("h1"), &json!(1))]);
    let recording = Recording::open(&laps.recording).unwrap();
    require_pose(&poses[0], &recording, "/h1/plant/state", time_ns);
    require_pose(&poses[1], &recording, "/h2/plant/state", time_ns);
    require_pose(&poses[2], &Recording::open(&other.recording).unwrap(), "/h1/plant/state", time_ns);
    // The sample that is elsewhere for one tick of sixty seconds is seen in the curve of both.
    let heights = seen["plots"][0].as_array().unwrap().iter().filter(|curve| curve["field"] == "position.z");
    let highest: Vec<f64> = heights.map(|curve| curve["spread"][1].as_f64().unwrap()).collect();
    assert_eq!(highest, [laps::SPIKE_M, laps::SPIKE_M]);
    require_short_heads(&seen);
}

#[test]
fn a_browser_shows_a_shadow_for_as_long_as_it_sends_and_the_wind_of_the_files() {
    let Some(readers) = readers() else { return };
    let folder = tempfile::tempdir().unwrap();
    let recording = shadowed(folder.path());
    let view = View::of(&[&recording]);
    let seen = view.look(&readers, &["1280x900", "250000000"]);
    let arrows = &seen["arrows"][0];
    let speed = |command: f64| {
        let number = |key: &str| arrows["map"][key].as_f64().unwrap();
        let (least, most) = (number("speed_at_min_rad_s"), number("speed_at_max_rad_s"));
        least + (command - number("min")) / (number("max") - number("min")) * (most - least)
    };
    let ratio = (speed(SHADOW_COMMAND) / speed(COMMAND)).powi(2);
    for rotor in 0..4 {
        let length = |key: &str| arrows[key][rotor].as_f64().unwrap();
        assert!((length("shadow") / length("command") - ratio).abs() < 1e-9, "{arrows}");
    }
    assert_eq!(arrows["estimate"], json!([0, 0, 2]));
    // The commands of both are compared in a plot.
    let curves = seen["plots"].as_array().unwrap().last().unwrap().as_array().unwrap();
    let topics: Vec<_> = curves.iter().map(|curve| curve["topic"].as_str().unwrap()).collect();
    assert_eq!(topics, [["/controller/command"; 4], ["/shadow/controller/command"; 4]].concat());
    require_wind(&seen["wind"]);
    if is_left("the end of a shadow takes a second look") {
        return;
    }
    // Its last samples are not shown for ever.
    let later = view.look(&readers, &["390x844", "dark", "750000000"]);
    assert_eq!(
        (&later["arrows"][0]["shadow"], &later["arrows"][0]["estimate"]),
        (&json!([0, 0, 0, 0]), &Value::Null)
    );
    assert_eq!(later["arrows"][0]["command"], arrows["command"]);
}

/// Seen along x, a wind along y comes from the right; what is along x is not seen.
fn require_wind(wind: &Value) {
    let speed = (3.0_f64 * 3.0 + 1.0 + 0.2 * 0.2).sqrt();
    assert_eq!(wind["text"], format!("wind {speed:.1} m/s and gusts"));
    let [across, up]: [f64; 2] = serde_json::from_value(wind["seen"].clone()).unwrap();
    assert!((across + 1.0 / speed).abs() < 1e-6 && (up - 0.2 / speed).abs() < 1e-6, "{wind}");
    // Up is negative in a picture.
    let tip = wind["line"].as_str().unwrap().split('L').nth(1).unwrap();
    assert!(tip.starts_with("-6.3 -1.3"), "{wind}");
}

const COMMAND: f64 = 76.5;
const SHADOW_COMMAND: f64 = 100.0;

/// A second of flight in wind, whose controller and estimator have shadows in its first half.
fn shadowed(folder: &Path) -> PathBuf {
    let path = folder.join("shadowed.mcap");
    let mut writer = RecordingWriter::create(&path).unwrap();
    let manifest = "[process.plant]\nkind = \"plant\"\nvehicle = \"windy.toml\"\n";
    let effect = |name: &str, values: &[(&str, f64)]| {
        let stated = |(key, value): &(&str, f64)| {
            format!(
                "{key} = {{ value = {value}, unit = \"m/s\", source = \"test\", uncertainty = \"exact\" }}\n"
            )
        };
        format!("[[effects]]\nname = \"{name}\"\n{}", values.iter().map(stated).collect::<String>())
    };
    let windy = "name = \"windy\"\nbase = \"hummingbird.toml\"\n".to_owned()
        + &effect("wind", &[("x", 3.0), ("y", 1.0), ("z", 0.2)])
        + &effect("turbulence", &[("wind_at_20_ft", 5.0)]);
    writer.attach("run.toml", manifest.as_bytes()).unwrap();
    writer.attach("windy.toml", windy.as_bytes()).unwrap();
    writer.attach("hummingbird.toml", vehicles::reference::HUMMINGBIRD.as_bytes()).unwrap();
    let mut add = |topic, schema| writer.add_channel(topic, &Announcement::of(schema)).unwrap();
    let state = add("/plant/state", PlantState::SCHEMA);
    let commands =
        ["/controller/command", "/shadow/controller/command"].map(|topic| add(topic, MotorCommand::SCHEMA));
    let estimates = ["/ekf/estimate", "/shadow/ekf/estimate"].map(|topic| add(topic, StateEstimate::SCHEMA));
    for tick in 0..100_u32 {
        let time_ns = u64::from(tick) * 10_000_000;
        let stamp = Time::from_ns(time_ns);
        let mut send = |channel, bytes: &[u8]| {
            writer.write(channel, tick, time_ns, &[&[0, 1, 0, 0], bytes].concat()).unwrap();
        };
        send(state, bytemuck::bytes_of(&PlantState { stamp, ..PlantState::default() }));
        let of_shadow = [false, true].into_iter().filter(|is_shadow| !is_shadow || tick < 50);
        for number in of_shadow.map(usize::from) {
            let command = [[COMMAND; 4], [SHADOW_COMMAND; 4]][number].into();
            send(commands[number], bytemuck::bytes_of(&MotorCommand { stamp, command }));
            let position = [0.0, 0.0, [1.0, 2.0][number]].into();
            let estimate = StateEstimate { stamp, position, ..StateEstimate::default() };
            send(estimates[number], bytemuck::bytes_of(&estimate));
        }
        writer.end_tick().unwrap();
    }
    writer.finish().unwrap();
    path
}

/// The head of a plot has each topic once, and values of up to four digits, or whole numbers.
fn require_short_heads(seen: &Value) {
    let head = seen["heads"][0].as_str().unwrap();
    assert_eq!(head.matches("/h1/plant/state").count(), 1, "{head}");
    let values = seen["values"].as_array().unwrap();
    let digits = |value: &Value| {
        let text = value.as_str().unwrap().split('e').next().unwrap_or_default();
        text.trim_start_matches(['-', '0', '.']).chars().filter(char::is_ascii_digit).count()
    };
    assert!(!values.is_empty() && values.iter().all(|value| digits(value) <= 5), "{values:?}");
}

/// Names are those of whoever wrote the recording: they are text, whatever they look like.
#[test]
fn a_browser_shows_names_that_look_like_html_as_they_are_and_says_that_the_server_has_ended() {
    let Some(readers) = readers() else { return };
    let name = "<img src=x onerror=alert(1)>";
    let laps = Laps::of(&[name]);
    let view = View::of(&[&laps.recording]);
    let seen = view.look(&readers, &["1280x900", "0", &format!("end={}", view.process.0.id())]);
    assert_eq!((&seen["poses"][0][0]["name"], &seen["images"]), (&json!(name), &json!(0)));
    assert!(seen["legend"].as_str().unwrap().starts_with(name), "{}", seen["legend"]);
    assert_eq!(seen["plots"][0][0]["topic"], format!("/{name}/plant/state"));
    // At the end of the server the page says what to do.
    assert!(seen["lost"].as_str().unwrap().contains("Start it again"), "{}", seen["lost"]);
}

/// Limit for the processor's time of the page's own thread in a frame: about four times the 21 to 31 ms of machines of two cores at a load of 10.
const CPU_MAX_MS: f64 = 100.0;

/// The time from frame to frame is that of the machine: without a graphics card, Chromium draws by the processor, and other tests run
/// beside it. The processor's time of the page's thread is the page's own. Waiting for a core or for the drawing is not in it.
#[test]
fn the_page_of_ten_vehicles_takes_little_of_the_processor_for_a_frame() {
    if is_left("it flies ten vehicles and draws for seconds; other tests show two") {
        return;
    }
    let Some(readers) = readers() else { return };
    let folder = tempfile::tempdir().unwrap();
    let recording = folder.path().join("ten.mcap");
    let mut run = Command::new(HUMMINGBUS);
    run.arg("run").arg(Path::new(ROOT).join("manifests/ten-vehicles.toml")).arg("--record").arg(&recording);
    // Its conditions do not matter: it is cut short.
    let ended = run.args(["--set", "run.duration_s=8"]).output().unwrap();
    assert!(matches!(ended.status.code(), Some(0 | 1)), "{}", String::from_utf8_lossy(&ended.stderr));
    let view = View::of(&[&recording]);
    let seen = look(&readers, "read_frames.mjs", &[view.address.as_ref(), "6".as_ref()]);
    // Not `println!`, which the test runner hides.
    std::io::stderr().write_all(format!("frames of ten vehicles, ms: {seen}\n").as_bytes()).unwrap();
    assert_eq!(
        (&seen["vehicles"], &seen["isPlaying"], &seen["isFlat"], &seen["wrong"]),
        (&json!(10), &json!(true), &json!(false), &json!([]))
    );
    assert_eq!(seen["isSmooth"], false, "smooth edges take long where the processor draws");
    // Each frame is drawn: the room moves all the time.
    let [frames, drawn] = ["frames", "drawn"].map(|key| seen[key].as_u64().unwrap());
    assert!(frames > 2 && drawn * 10 >= frames * 9, "{seen}");
    assert!(seen["cpu"].as_f64().unwrap() < CPU_MAX_MS, "{seen}");
}

/// The page goes on with the newest second, and has the whole flight when the run has ended.
#[test]
fn a_browser_follows_a_live_run_to_its_end() {
    if is_left("`a_browser_steers_a_run_with_mouse_and_keys_on_every_screen` follows a live run") {
        return;
    }
    let Some(readers) = readers() else { return };
    let folder = tempfile::tempdir().unwrap();
    let recording = folder.path().join("live.mcap");
    let partial = folder.path().join("live.partial.mcap");
    let mut run = Command::new(HUMMINGBUS);
    run.arg("run").arg(Path::new(ROOT).join("manifests/hover.toml")).arg("--record").arg(&recording);
    run.args(["--pace", "realtime", "--set", "run.duration_s=4000"]);
    let mut run = Launched(run.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap());
    while Recording::salvage(&partial).map_or(true, |recording| recording.topics().is_empty()) {
        assert!(run.0.try_wait().unwrap().is_none(), "the run has ended");
        std::thread::sleep(std::time::Duration::from_millis(50));
    }
    let view = View::of(&[&partial]);
    let seen =
        look(&readers, "read_view.mjs", &[view.address.as_ref(), format!("live={}", run.0.id()).as_ref()]);
    run.0.wait().unwrap();
    assert_eq!(seen["wrong"], json!([]));
    let number = |look: &str, key: &str| seen[look][key].as_f64().unwrap();
    assert!(number("later", "timeNs") >= number("first", "timeNs") + 2e9, "{seen}");
    assert!(number("last", "durationNs") >= number("later", "durationNs"), "{seen}");
    assert_eq!(seen["held"]["isPlaying"], json!(false));
    assert_eq!(seen["held"]["endS"], seen["stillHeld"]["endS"], "the curves of a page that is paused grew");
    assert!(number("stillHeld", "durationNs") > number("held", "durationNs") + 1e9, "{seen}");
    assert_eq!((&seen["later"]["isPlaying"], &seen["last"]["isKnown"]), (&json!(true), &json!(true)));
}

/// A vehicle whose first message comes after the opening of the page is shown like the others. This holds
/// also if the first question for it gets no answer.
#[test]
fn a_browser_shows_a_vehicle_that_comes_late() {
    let Some(readers) = readers() else { return };
    let folder = tempfile::tempdir().unwrap();
    let (recording, ready) = (folder.path().join("late.mcap"), folder.path().join("ready"));
    let mut writer = RecordingWriter::create(&recording).unwrap();
    let add = |writer: &mut RecordingWriter, name: &str| {
        writer.add_channel(&format!("/{name}/plant/state"), &Announcement::of(PlantState::SCHEMA)).unwrap()
    };
    let mut channels = vec![add(&mut writer, "h1")];
    fly_second(&mut writer, &channels, 0);
    let view = View::of(&[&recording]);
    let is_over = AtomicBool::new(false);
    let seen = std::thread::scope(|scope| {
        scope.spawn(|| {
            for second in 1.. {
                std::thread::sleep(Duration::from_millis(200));
                if is_over.load(Ordering::Relaxed) {
                    break;
                }
                if ready.exists() && channels.len() == 1 {
                    channels.push(add(&mut writer, "h2"));
                }
                fly_second(&mut writer, &channels, second);
            }
        });
        let arguments = [view.address.clone(), "late=h2".to_owned(), format!("ready={}", ready.display())];
        let seen = std::panic::catch_unwind(|| {
            look(&readers, "read_view.mjs", &arguments.each_ref().map(|argument| argument.as_ref()))
        });
        is_over.store(true, Ordering::Relaxed);
        seen.unwrap()
    });
    let vehicle = |name: &str, height_m: f64| json!({ "name": name, "isKnown": true, "height_m": height_m });
    assert_eq!(seen["vehicles"], json!([vehicle("h1", 1.5), vehicle("h2", 2.5)]));
    assert_eq!((&seen["choices"], &seen["lines"]), (&json!(["h1", "h2"]), &json!(2)));
    assert_eq!((&seen["refused"], &seen["wrong"]), (&json!(1), &json!([])));
}

/// One more second of a recording: the first vehicle hovers at 1.5 m, the next one at 2.5 m.
fn fly_second(writer: &mut RecordingWriter, channels: &[ChannelId], second: u32) {
    for tick in 100 * second..100 * (second + 1) {
        for (channel, height_m) in channels.iter().zip([1.5, 2.5]) {
            let position = [0.0, 0.0, height_m].into();
            let state = PlantState { position, ..PlantState::default() };
            let cdr = [&[0, 1, 0, 0], bytemuck::bytes_of(&state)].concat();
            writer.write(*channel, tick, u64::from(tick) * 10_000_000, &cdr).unwrap();
        }
    }
    writer.flush().unwrap();
}

/// A recording in which vehicles fly laps in a room.
struct Laps {
    recording: PathBuf,
    _folder: TempDir,
}

impl Laps {
    fn of(vehicles: &[&str]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let recording = folder.path().join("laps.mcap");
        let room = fs::read_to_string(Path::new(ROOT).join("scenes/room.toml")).unwrap();
        laps::record(&recording, vehicles, Some(&room));
        Self { recording, _folder: folder }
    }
}
