//! The shell commands of the pages about other languages, as a reader runs them: in a copy of the repository.

use crate::build::built;
use crate::fmu::python_library;
use crate::python::{Python, python};
use crate::shell::{Exception, copy, left_out, path, replaced, require_commands, run, with_program};
use crate::support::Place;
use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;

/// The pages of this room.
pub const PAGES: [&str; 4] = ["docs/cpp.md", "docs/python.md", "docs/fmu.md", "docs/simulink.md"];

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
    replaced(
        "fmpy simulate plant.fmu --stop-time 1 --step-size 0.001 --show-plot",
        "fmpy simulate plant.fmu --stop-time 1 --step-size 0.001 --output-file plant.csv",
        "it opens a window",
    ),
    replaced(
        "cmake -S bindings/c -B target/c",
        "cmake -S bindings/c -B target/c -DHUMMINGBUS_BUILT=\"$BUILT\"",
        "the library is built already",
    ),
];

/// Runs the commands of `page`; returns the number of those that have run.
fn run_page(place: &Place, page: &str, variables: &[(&'static str, String)]) -> usize {
    run(place, page, &EXCEPTIONS, "", variables)
}

/// The variables of `python`, with the program on its search path.
fn variables(python: &Python) -> Vec<(&'static str, String)> {
    let variables = python.variables().into_iter();
    variables.map(|(name, value)| (name, if name == "PATH" { with_program(&value) } else { value })).collect()
}

#[test]
fn every_exception_is_a_command_of_a_page() {
    require_commands(&EXCEPTIONS, &PAGES);
}

#[test]
fn the_commands_of_the_page_for_cpp_run() {
    let place = copy();
    symlink(&built().programs, place.path("target/cpp")).unwrap();
    assert_eq!(run_page(&place, "docs/cpp.md", &[path()]), 5);
    assert!(Path::new(&place.path("home/.local/include/hummingbus/hummingbus.hpp")).exists());
}

#[test]
fn the_commands_of_the_page_for_python_run() {
    let Some(python) = python() else { return };
    assert_eq!(run_page(&copy(), "docs/python.md", &variables(python)), 2);
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
    assert_eq!(run_page(&place, "docs/fmu.md", &variables), 3);
    assert_eq!(run_page(&place, "docs/simulink.md", &variables), 5);
    let simulated = fs::read_to_string(place.path("plant.csv")).unwrap();
    assert!(simulated.lines().count() > 1000 && simulated.contains("plant.state.position.z"));
}
