//! A gamepad that moves channels of `rc`: a pipe with the events of a joystick device.

use crate::documentation::code_blocks;
use crate::support::Place;
use std::fs::File;
use std::io::Write as _;
use std::process::Command;

/// Kinds of events (`linux/joystick.h`).
const BUTTON: u8 = 1;
const AXIS: u8 = 2;
const INITIAL: u8 = 0x80;

fn event(kind: u8, number: u8, value: i16) -> [u8; 8] {
    let [low, high] = value.to_ne_bytes();
    [0, 0, 0, 0, low, high, kind, number]
}

fn manifest(device: &str) -> String {
    format!(
        r#"[run]
duration_s = 0.05

[process.sticks]
kind = "rc"
outputs.rc = {{}}

[process.sticks.parameters]
gamepad = "{device}"
script = [{{ channel = 6, at_s = 0.0, pulse_us = 1200 }}]
controls = [
    {{ channel = 1, axis = 3 }},
    {{ channel = 3, axis = 1, from_us = 2000, to_us = 1000 }},
    {{ channel = 5, button = 0, toggles = true }},
]

[process.recorder]
kind = "recorder"
"#
    )
}

#[test]
fn a_gamepad_moves_sticks_and_switches_until_it_goes() {
    let place = Place::new();
    let pipe = place.path("js0");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let mut gamepad = File::options().read(true).write(true).open(&pipe).unwrap();
    let events = [
        event(AXIS | INITIAL, 3, 0),
        event(BUTTON | INITIAL, 0, 0),
        event(AXIS, 3, -32767),
        event(AXIS, 1, -32767),
        event(BUTTON, 0, 1),
        event(BUTTON, 0, 0),
    ];
    gamepad.write_all(&events.concat()).unwrap();
    let path = place.write("gamepad.toml", manifest(&pipe));
    let recording = place.path("a.mcap");
    place.call(&["run", &path, "--record", &recording]).flown();
    let args = ["cat", &recording, "--topic", "/sticks/rc", "--csv"];
    let rows = place.call(&args).with_code(0).output;
    let cells: Vec<&str> = rows.lines().last().unwrap().split(',').collect();
    let expected = ["1000.0", "1500.0", "2000.0", "1500.0", "2000.0", "1200.0"];
    assert_eq!(cells[cells.len() - 6..], expected, "roll, pitch, throttle, yaw, the toggle, the script");
    // A pipe that nobody writes to ends, as a device that is pulled out.
    drop(gamepad);
    let ended = place.call(&["run", &path, "--record", "none"]).with_code(2);
    ended.says(&["node `sticks`", "js0 cannot be read any more: it has gone"]);
    // Two keys for one channel, and no device at all.
    let twice = manifest(&pipe).replace("channel = 6", "channel = 5");
    let refused = place.call(&["check", &place.write("twice.toml", twice)]).with_code(2);
    refused.says(&["twice.toml:", "`controls` moves channel 5, which `script` moves"]);
    let absent = place.write("absent.toml", manifest("/nowhere/js0"));
    place.call(&["check", &absent]).with_code(2).says(&["/nowhere/js0: cannot open the gamepad"]);
}

/// The page has a script and a gamepad; the pipe takes the place of the device.
#[test]
fn the_sticks_of_the_page_pass_their_check() {
    let place = Place::new();
    let pipe = place.path("js0");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let _gamepad = File::options().read(true).write(true).open(&pipe).unwrap();
    let blocks = code_blocks("docs/set-points.md", "toml");
    let block =
        |key: &str| blocks.iter().find(|block| block.contains(key)).unwrap_or_else(|| panic!("{key}"));
    let run = "[run]\nduration_s = 3.0\n[process.recorder]\nkind = \"recorder\"\n";
    let script = format!("{run}{}\noutputs.rc = {{}}\n", block("parameters.script = ["));
    let gamepad = block("gamepad = \"/dev/input/js0\"").replace("/dev/input/js0", &pipe);
    let gamepad = format!("{run}[process.sticks]\nkind = \"rc\"\noutputs.rc = {{}}\n{gamepad}\n");
    for (name, text) in [("script.toml", script), ("gamepad.toml", gamepad)] {
        place.call(&["check", &place.write(name, text)]).with_code(0);
    }
}
