//! The shell commands of the pages about other languages, as a reader runs them: in a copy of the repository.

use crate::build::{built, succeed};
use crate::fmu::python_library;
use crate::python::{Python, python};
use crate::support::{HUMMINGBUS, Place, repository};
use std::collections::BTreeSet;
use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::Command;

/// A command of a page that is not run as it stands.
struct Exception {
    command: &'static str,
    /// The command that is run in its place.
    instead: Option<&'static str>,
    reason: &'static str,
}

const fn left_out(command: &'static str, reason: &'static str) -> Exception {
    Exception { command, instead: None, reason }
}

/// All of them; the rest of the commands is run to the letter.
static EXCEPTIONS: [Exception; 9] = [
    left_out("cmake -S examples/cpp -B target/cpp", "the tests build it once: tests/bindings/build.rs"),
    left_out("cmake --build target/cpp", "the tests build it once: tests/bindings/build.rs"),
    left_out(
        "pip install ./python",
        "it compiles the workspace; the tests have the package that was built with them",
    ),
    left_out("scripts/wheel", "it compiles the workspace for release, and flies from the wheel itself"),
    left_out("pip install pythonfmu", "tests/readers/requirements.txt installs it"),
    left_out("pip install fmpy", "tests/readers/requirements.txt installs it"),
    left_out(
        "cargo build --release --locked -p hummingbus -p hummingbus-fmu-export",
        "it compiles the workspace for release; the tests have a library of their build",
    ),
    Exception {
        command: "fmpy simulate plant.fmu --stop-time 1 --step-size 0.001 --show-plot",
        instead: Some("fmpy simulate plant.fmu --stop-time 1 --step-size 0.001 --output-file plant.csv"),
        reason: "it opens a window",
    },
    Exception {
        command: "cmake -S bindings/c -B target/c",
        instead: Some("cmake -S bindings/c -B target/c -DHUMMINGBUS_BUILT=\"$BUILT\""),
        reason: "the library is built already",
    },
];

/// The commands in the blocks of `page` for the shell, without their comments; `&&` joins several.
fn commands(page: &str) -> Vec<String> {
    let text = fs::read_to_string(repository(page)).unwrap();
    let blocks = text.split("\n```sh\n").skip(1).map(|rest| rest.split("\n```").next().unwrap());
    let lines = blocks.flat_map(str::lines).map(|line| line.split(" #").next().unwrap());
    let commands = lines.flat_map(|line| line.split("&&")).map(|command| command.trim().to_owned());
    commands.filter(|command| !command.is_empty()).collect()
}

/// The folders of the repository that the commands use. Manifests are a copy, since paths in them begin beside their folder.
fn copy() -> Place {
    let place = Place::new();
    for name in ["bindings", "controllers", "examples", "scenes", "vehicles", "Cargo.toml"] {
        symlink(repository(name), place.path(name)).unwrap();
    }
    let mut copy = Command::new("cp");
    copy.args(["-r", &repository("manifests"), &place.path("manifests")]);
    succeed(copy);
    fs::create_dir(place.path("target")).unwrap();
    place
}

/// Runs the commands of `page` in `place` with these variables; returns how many it has run.
fn run(place: &Place, page: &str, variables: &[(&'static str, String)]) -> usize {
    let mut count = 0;
    for command in commands(page) {
        let exception = EXCEPTIONS.iter().find(|exception| exception.command == command);
        if let Some(Exception { instead, reason, .. }) = exception {
            println!("{page}: `{command}` is not run as it stands: {reason}; instead: {instead:?}");
        }
        let Some(command) = exception.map_or(Some(command.as_str()), |exception| exception.instead) else {
            continue;
        };
        let mut shell = Command::new("sh");
        // `~` of the pages is a folder of the test.
        shell.args(["-ec", command]).current_dir(place.path("")).env("HOME", place.path("home"));
        shell.env("BUILT", Path::new(HUMMINGBUS).parent().unwrap()).envs(variables.iter().cloned());
        place.mark(&mut shell);
        succeed(shell);
        count += 1;
    }
    count
}

/// `path` with the program on it.
fn with_program(path: &str) -> String {
    format!("{}:{path}", Path::new(HUMMINGBUS).parent().unwrap().display())
}

/// The variables of `python`, with the program on its search path.
fn variables(python: &Python) -> Vec<(&'static str, String)> {
    let variables = python.variables().into_iter();
    variables.map(|(name, value)| (name, if name == "PATH" { with_program(&value) } else { value })).collect()
}

#[test]
fn every_exception_is_a_command_of_a_page() {
    let pages = ["docs/cpp.md", "docs/python.md", "docs/fmu.md", "docs/simulink.md"];
    let commands: BTreeSet<String> = pages.iter().flat_map(|page| commands(page)).collect();
    for Exception { command, .. } in &EXCEPTIONS {
        assert!(commands.contains(*command), "no page has `{command}`");
    }
}

#[test]
fn the_commands_of_the_page_for_cpp_run() {
    let place = copy();
    let path = with_program(&std::env::var("PATH").unwrap_or_default());
    symlink(&built().programs, place.path("target/cpp")).unwrap();
    assert_eq!(run(&place, "docs/cpp.md", &[("PATH", path)]), 5);
    assert!(Path::new(&place.path("home/.local/include/hummingbus/hummingbus.hpp")).exists());
}

#[test]
fn the_commands_of_the_page_for_python_run() {
    let Some(python) = python() else { return };
    assert_eq!(run(&copy(), "docs/python.md", &variables(python)), 2);
}

#[test]
fn the_commands_of_the_pages_for_fmus_run() {
    let (Some(python), Some(library)) = (python(), python_library()) else {
        return crate::skipped::skip(
            "HUMMINGBUS_READERS is not set, or there is no shared library of Python",
        );
    };
    let place = copy();
    // As the page says: the version of this machine.
    let manifest = place.path("manifests/fmu-controller.toml");
    let text = fs::read_to_string(&manifest).unwrap();
    assert!(text.contains("\"libpython3.11.so.1.0\""));
    fs::write(&manifest, text.replace("libpython3.11.so.1.0", &library)).unwrap();
    let variables = variables(python);
    assert_eq!(run(&place, "docs/fmu.md", &variables), 3);
    assert_eq!(run(&place, "docs/simulink.md", &variables), 5);
    let simulated = fs::read_to_string(place.path("plant.csv")).unwrap();
    assert!(simulated.lines().count() > 1000 && simulated.contains("plant.state.position.z"));
}
