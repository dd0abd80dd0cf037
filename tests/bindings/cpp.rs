//! Nodes in C++ and C: same bytes, hand-over of state, own messages, and what is said where one fails.

use crate::build::{built, succeed};
use crate::support::{Ended, HUMMINGBUS, Place, repository};
use std::fs;
use std::path::Path;
use std::process::Command;

/// The shipped manifest `name`, flown by the controller that the tests have built.
fn shipped(place: &Place, name: &str) -> String {
    let text = fs::read_to_string(repository(&format!("manifests/{name}"))).unwrap();
    let text = text
        .replace("\"../target/cpp/controller\"", &format!("{:?}", built().program("controller")))
        .replace("\"sets/", &format!("\"{}/", repository("manifests/sets")))
        .replace("\"../vehicles/", &format!("\"{}/", repository("vehicles")));
    place.write(name, text)
}

/// A hover whose controller is `controller` and whose pilot `pilot` is, of 0.3 s.
fn hover(place: &Place, pilot: &str) -> String {
    let (flight, vehicle) =
        (repository("manifests/sets/flight.toml"), repository("vehicles/hummingbird.toml"));
    let text = format!(
        "include = [{flight:?}]\n[run]\nduration_s = 0.3\n\
         [process.controller]\nkind = \"pid\"\nvehicle = {vehicle:?}\n\
         inputs = {{ set_point = \"/pilot/set_point\", estimate = \"/ekf/estimate\" }}\n{pilot}"
    );
    place.write("hover.toml", text)
}

/// A pilot that is the program `name` with these parameters.
fn pilot(name: &str, more: &str) -> String {
    let program = built().program(name);
    format!(
        "[process.pilot]\ncommand = [{program:?}]\n\
         outputs.set_point = {{ type = \"hummingbus_msgs/msg/SetPoint\" }}\n{more}"
    )
}

fn fly(place: &Place, manifest: &str) -> Ended {
    place.call(&["run", manifest, "--record", &place.path("flight.mcap")])
}

#[test]
fn a_controller_in_cpp_flies_the_hover_and_two_runs_are_the_same_bytes() {
    let place = Place::new();
    let manifest = shipped(&place, "cpp-controller.toml");
    let [first, second] = ["first.mcap", "second.mcap"].map(|name| {
        let recording = place.path(name);
        place.call(&["run", &manifest, "--record", &recording]).with_code(0);
        fs::read(recording).unwrap()
    });
    assert!(first == second, "two runs differ");
}

#[test]
fn a_controller_in_cpp_takes_over_from_pid_with_its_state_and_pid_from_it() {
    let place = Place::new();
    let manifest = shipped(&place, "swap-cpp.toml");
    let ended = place.call(&["run", &manifest, "--record", &place.path("swap.mcap"), "--json"]).with_code(0);
    let summary = ended.json();
    let successions = summary["successions"].as_array().unwrap();
    assert_eq!(successions.len(), 2, "{ended}");
    assert!(successions.iter().all(|succession| succession["hand_over"] == "state"), "{ended}");
    // The same law from the same state: what it asks for as a shadow of `pid` differs in rounding.
    let shadows = summary["shadows"].as_array().unwrap().iter().filter(|shadow| shadow["from_tick"] == 2800);
    let rms: Vec<f64> = shadows.map(|shadow| shadow["rms"].as_f64().unwrap()).collect();
    assert!(rms.len() == 4 && rms.iter().all(|count| *count < 1e-6), "{rms:?}\n{ended}");
}

#[test]
fn a_new_project_in_cpp_is_built_and_passes_its_own_test() {
    let place = Place::new();
    let folder = place.path("my-quad");
    place.call(&["new", &folder, "--language", "cpp", "--sources", &repository("")]).with_code(0);
    let build = format!("{folder}/controller/build");
    let mut configure = Command::new("cmake");
    configure.args(["-S", &format!("{folder}/controller"), "-B", &build]);
    configure.arg(format!("-DCMAKE_PREFIX_PATH={}", built().prefix.display()));
    succeed(configure);
    let mut make = Command::new("cmake");
    make.args(["--build", &build]);
    succeed(make);
    // The test calls the program by its name.
    let programs = Path::new(HUMMINGBUS).parent().unwrap().display().to_string();
    let path = format!("{programs}:{}", std::env::var("PATH").unwrap_or_default());
    let mut test = Command::new("ctest");
    test.args(["--test-dir", &build, "--output-on-failure"]).env("PATH", path);
    place.mark(&mut test);
    let said = succeed(test);
    assert!(said.contains("100% tests passed"), "{said}");
}

#[test]
fn a_project_whose_library_is_gone_says_how_to_name_its_folder() {
    let place = Place::new();
    let folder = place.path("my-quad");
    place.call(&["new", &folder, "--language", "cpp", "--sources", &repository("")]).with_code(0);
    let file = format!("{folder}/controller/CMakeLists.txt");
    let text = fs::read_to_string(&file).unwrap();
    fs::write(&file, text.replace("/bindings/c]==]", "/gone]==]")).unwrap();
    let mut configure = Command::new("cmake");
    configure.args(["-S", &format!("{folder}/controller"), "-B", &format!("{folder}/controller/build")]);
    // As on a system without the library, wherever one is installed here.
    configure.arg("-DCMAKE_DISABLE_FIND_PACKAGE_hummingbus=TRUE");
    let ended = configure.output().unwrap();
    let said = String::from_utf8_lossy(&ended.stderr);
    assert!(!ended.status.success() && said.contains("cmake -DCMAKE_PREFIX_PATH=FOLDER"), "{said}");
}

#[test]
fn a_checkpoint_holds_the_state_of_a_controller_in_cpp() {
    let place = Place::new();
    let manifest = shipped(&place, "cpp-controller.toml");
    let (whole, rest) = (place.path("whole.mcap"), place.path("rest.mcap"));
    let set = ["--set", "run.duration_s=1.5", "--record", &whole, "--checkpoint-every", "0.7s"];
    place.call(&[&["run", &manifest], &set[..]].concat()).flown();
    let checkpoint = place.path("whole.700.ckpt");
    place.call(&["run", "--from", &checkpoint, "--record", &rest]).flown();
    let expected = "begins at tick 700, and from there on all messages are those of";
    place.call(&["diff", &whole, &rest]).with_code(1).prints(&[expected]);
}

#[test]
fn a_program_in_c_is_in_the_profile() {
    let place = Place::new();
    let manifest = hover(&place, &pilot("pilot", "parameters = { altitude_m = 1.25, name = \"up\" }\n"));
    let recording = place.path("flight.mcap");
    let ended =
        place.call(&["run", &manifest, "--record", &recording, "--set", "run.profile=true", "--json"]);
    let summary = ended.json();
    let nodes = summary["profile"]["nodes"].as_array().unwrap();
    let pilot = nodes.iter().find(|node| node["name"] == "pilot").unwrap();
    assert_eq!(pilot["compute"]["count"], 300, "{ended}");
}

#[test]
fn a_pilot_in_c_sends_what_the_controller_reads() {
    let place = Place::new();
    let manifest = hover(&place, &pilot("pilot", "parameters = { altitude_m = 1.25, name = \"up\" }\n"));
    fly(&place, &manifest).flown();
    let cat =
        ["cat", &place.path("flight.mcap"), "--topic", "/pilot/set_point", "--field", "altitude", "--csv"];
    let ended = place.call(&cat).with_code(0);
    assert_eq!(ended.output.lines().count(), 301, "{ended}");
    assert!(ended.output.lines().skip(1).all(|line| line.ends_with(",1.25")), "{ended}");
}

#[test]
fn a_message_of_the_program_s_own_is_recorded_with_its_units() {
    let place = Place::new();
    let battery = "outputs.battery = { type = \"test_msgs/msg/Cells\", every_ticks = 3 }\n";
    let manifest =
        hover(&place, &pilot("faulty", &format!("{battery}parameters = {{ fault = \"none\" }}\n")));
    fly(&place, &manifest).flown();
    let ended = place.call(&["cat", &place.path("flight.mcap"), "--topic", "/pilot/battery"]).with_code(0);
    ended.prints(&["voltage", "11.5", "cells"]);
}

#[test]
fn what_goes_wrong_in_a_program_is_said_with_node_and_reason() {
    let cases = [
        ("throw", "node `pilot` failed at tick 100 (t = 0.100 s): the battery is empty"),
        ("throw-other", "it threw something that is no std::exception"),
        ("unwritten", "node `pilot` computed tick 100 without writing its output `set_point`"),
        ("nan", "holds altitude = NaN, expected a finite number"),
        ("unread", "parameters.extra is not read; the program reads `fault`"),
        ("missing", "parameters.gains.altitude is missing; the manifest gives `fault`"),
        ("array", "parameters.fault is \"array\", expected an array of 3 numbers"),
        (
            "port",
            "declares the output `nothing`, which the manifest does not name; it has `battery`, `set_point`",
        ),
        (
            "type",
            "publishes hummingbus_msgs/msg/MotorCommand on its output `set_point`, topic /pilot/set_point; the manifest states",
        ),
        (
            "layout",
            "layout mismatch on topic /pilot/set_point: node `controller` reads its port `set_point` as",
        ),
        ("layout", "and node `pilot` sends its port `set_point` as"),
        // The controller is built in: its user cannot rebuild it alone.
        ("layout", "Rebuild the program of node `pilot` with this version of hummingbus"),
        ("padding", "has its field `voltage` at byte 8, and the fields before it end at 4"),
        ("handle", "the step asks for input number 7; the program has declared 0"),
        ("twice", "declares its state twice"),
        ("kind", "the field `voltage` has the kind 77, expected an HbKind"),
        ("unaligned", "its offset has to be a multiple of 8"),
    ];
    for (fault, words) in cases {
        let place = Place::new();
        let extra = if fault == "unread" { ", extra = 1" } else { "" };
        let more = format!(
            "outputs.battery = {{ type = \"test_msgs/msg/Cells\" }}\nparameters = {{ fault = {fault:?}{extra} }}\n"
        );
        let manifest = hover(&place, &pilot("faulty", &more));
        let ended = fly(&place, &manifest);
        assert!(ended.code != Some(0) && ended.error.contains(words), "{fault}: no {words:?} in\n{ended}");
    }
}

/// The content of each block of docs/cpp.md in `language`.
fn blocks(language: &str) -> Vec<String> {
    let page = fs::read_to_string(repository("docs/cpp.md")).unwrap();
    let opening = format!("\n```{language}\n");
    let blocks = page.split(&opening).skip(1);
    blocks.map(|rest| rest.split("\n```").next().unwrap().to_owned()).collect()
}

/// The page's node, message, step in C and CMake file, as a project that finds the installed library.
#[test]
fn the_code_of_the_page_builds_and_flies() {
    let place = Place::new();
    let (cpp, c, cmake) = (blocks("cpp"), blocks("c"), blocks("cmake"));
    let ([node, message], [step], [cmake]) = (&cpp[..], &c[..], &cmake[..]) else { panic!("docs/cpp.md") };
    let (source, build) = (place.path("project"), place.path("project/build"));
    fs::create_dir_all(&source).unwrap();
    let file = |name: &str, text: String| fs::write(format!("{source}/{name}"), text).unwrap();
    file("controller.cpp", node.clone());
    file(
        "battery.cpp",
        format!(
            "#include <hummingbus/hummingbus.hpp>\n#include <hummingbus/messages.hpp>\n{message}\n\
             int main() {{\n  return hummingbus::program([] {{\n    hummingbus::Node node;\n\
             const auto battery = node.output<Battery>(\"battery\");\n\
             node.run([&](hummingbus::Tick& tick) {{ tick.output(battery)->voltage = 11.5; }});\n  }});\n}}\n"
        ),
    );
    file(
        "asking.c",
        format!(
            "#include <hummingbus/hummingbus.h>\n#include <hummingbus/messages.h>\n{step}\n\
             int main(void) {{\n  HbNode *node = NULL;\n  uint32_t set_point = 0;\n\
             int32_t status = hb_node_join(&node);\n\
             if (status == HB_OK) status = hb_node_output(node, \"set_point\", &HB_SET_POINT, &set_point);\n\
             if (status == HB_OK) status = hb_node_run(node, step, &set_point);\n\
             hb_node_free(node);\n  return status == HB_ABORTED ? HB_OK : status;\n}}\n"
        ),
    );
    let project = "cmake_minimum_required(VERSION 3.16)\nproject(page LANGUAGES C CXX)\n";
    let more = ["battery.cpp", "asking.c"].map(|file| {
        let name = file.split('.').next().unwrap();
        format!("add_executable({name} {file})\ntarget_link_libraries({name} PRIVATE hummingbus::static)\n")
    });
    file("CMakeLists.txt", format!("{project}{cmake}\n{}", more.concat()));
    let mut configure = Command::new("cmake");
    configure.args(["-S", &source, "-B", &build]);
    configure.arg(format!("-DCMAKE_PREFIX_PATH={}", built().prefix.display()));
    succeed(configure);
    let mut make = Command::new("cmake");
    make.args(["--build", &build]);
    succeed(make);

    let set_point = "outputs.set_point = { type = \"hummingbus_msgs/msg/SetPoint\" }";
    let state = "inputs.state = { topic = \"/plant/state\", delay_ticks = 1, initial = {} }";
    let manifest = hover(
        &place,
        &format!(
            "[process.pilot]\ncommand = [\"{build}/controller\"]\n{set_point}\n{state}\n\
             [process.asking]\ncommand = [\"{build}/asking\"]\n{set_point}\n\
             [process.battery]\ncommand = [\"{build}/battery\"]\n\
             outputs.battery = {{ type = \"my_msgs/msg/Battery\" }}\n"
        ),
    );
    fly(&place, &manifest).flown();
    let column = |topic: &str, field: &str| -> Vec<f64> {
        let cat = ["cat", &place.path("flight.mcap"), "--topic", topic, "--field", field, "--csv"];
        let printed = place.call(&cat).with_code(0).output;
        let value = |line: &str| line.rsplit(',').next().unwrap().parse().unwrap();
        printed.lines().skip(1).map(value).collect()
    };
    let (height, asked) = (column("/plant/state", "position.z"), column("/pilot/set_point", "altitude"));
    assert_eq!((height.len(), asked.len()), (300, 300));
    assert!(height.iter().zip(&asked[1..]).all(|(height, asked)| *asked == height + 0.5));
    assert_eq!(column("/asking/set_point", "altitude"), [1.5; 300]);
    assert_eq!(column("/battery/battery", "voltage"), [11.5; 300]);
}

#[test]
fn pkg_config_and_a_compiler_are_enough() {
    let built = built();
    let mut pkg_config = Command::new("pkg-config");
    pkg_config.args(["--cflags", "--libs", "hummingbus"]);
    let folders = ["lib", "lib64", "lib/x86_64-linux-gnu", "lib/aarch64-linux-gnu"];
    let folders =
        folders.map(|folder| built.prefix.join(folder).join("pkgconfig").to_string_lossy().into_owned());
    pkg_config.env("PKG_CONFIG_PATH", folders.join(":"));
    let flags = succeed(pkg_config);
    let place = Place::new();
    let (source, program) = (repository("tests/bindings/cpp/pilot.c"), place.path("pilot"));
    let mut compiler = Command::new("cc");
    compiler.args(["-std=c11", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-o", &program, &source]);
    compiler.args(flags.split_whitespace()).arg(format!("-Wl,-rpath,{}", library_folder()));
    succeed(compiler);
    let ended = Command::new(&program).output().unwrap();
    let said = String::from_utf8_lossy(&ended.stderr).into_owned();
    assert!(!ended.status.success() && said.contains("hummingbus run MANIFEST"), "{said}");
}

/// The folder that `cmake --install` has put the library into.
pub fn library_folder() -> String {
    let folders = ["lib", "lib64", "lib/x86_64-linux-gnu", "lib/aarch64-linux-gnu"];
    let mut found = folders.into_iter().map(|folder| built().prefix.join(folder));
    let found = found.find(|folder| folder.join("libhummingbus.so").exists());
    found.expect("the library is installed").to_string_lossy().into_owned()
}
