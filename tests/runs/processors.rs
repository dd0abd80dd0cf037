//! The same bytes on another processor. The shipped manifests are flown once more as if the processor had no
//! fused products. For fused products the C library has other versions of its functions; no node calls any of
//! these.

use crate::manifests::{is_brief, settings, shipped};
use crate::recordings::open;
use crate::skipped::{cases, first, is_thorough, leave};
use crate::support::{Place, repository};
use plant::effects::{CATALOGUE, EffectKind, ParameterSpec};
use recorder::diff::first_difference;
use std::hint::black_box;
use std::io::Write as _;
use std::process::Command;
use std::{env, fs};
use vehicles::Vehicle;

/// Setting that hides newer instructions from glibc, whose functions for older processors are taken then.
const OLDER: (&str, &str) = ("GLIBC_TUNABLES", "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX2_Usable,-FMA_Usable");

/// Ticks of a flight: behind the first differences that functions of the C library made, at tick 420 (ten vehicles) to
/// 4488 (every effect).
const TICKS: u32 = 5000;
/// Ticks of a quick flight. The witness names a function of the C library at its first call.
const QUICK_TICKS: u32 = 2000;
/// Those of other lengths: behind the last of three swaps; a swarm that takes long; a made-up flight of a second.
const OTHERS: [(&str, u32); 3] = [("swap-laws", 10_000), ("ten-vehicles", 1000), ("replay-nanobench", 1001)];

/// Those whose nodes are those of another one, which is flown: they differ from it in numbers or in a wire.
const ALIKE: [&str; 7] = [
    "wall-stop-slow",
    "wall-stop-fast",
    "wall-stop-open",
    "wall-stop-thesis-slow",
    "wall-stop-thesis-fast",
    "take-off-attitude",
    "rig-b",
];

/// Functions of the C library that a node may call, with the end of its name, since they change nothing. They
/// compute the number of halvings in nalgebra's matrix exponential, and a count in parry's tree of boxes.
/// They also compute normals of a mesh's corners, which no contact reads (docs/decisions/009-numbers.md).
const ALLOWED: [(&str, &str); 3] = [("log2", "controller"), ("log2", "plant"), ("acos", "plant")];

/// Names the file to which the witness, `c_library.c`, writes the functions that are called.
const CALLS: &str = "HUMMINGBUS_TEST_CALLS";
/// Asks this program for the C library's values.
const ASKED: &str = "HUMMINGBUS_TEST_C_LIBRARY";

#[test]
fn what_is_shipped_flies_the_same_on_an_older_processor() {
    notice_where_nothing_is_older();
    let flights = ["excite", "hover-gentle", "low-passes", "rig-a-riddle"];
    let flights = flights.map(|name| repository(&format!("manifests/identify/{name}.toml")));
    let most = if is_thorough() { TICKS } else { QUICK_TICKS };
    let differ = |path: String| {
        let place = Place::new();
        difference(&place, &args(&place, &path, most))
    };
    let is_alike = |path: &String| ALIKE.iter().any(|name| path.ends_with(&format!("/{name}.toml")));
    let others = shipped().into_iter().filter(|path| !is_alike(path));
    let taken = cases("manifests", others.chain(flights), |path| is_brief(path));
    if !is_thorough() {
        leave(taken.len(), "ends of flights");
    }
    let wrong: Vec<String> = taken.into_iter().filter_map(differ).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Gusts and noise that the shipped vehicles have not: a vehicle with every effect of the catalogue.
#[test]
fn every_effect_is_the_same_on_an_older_processor() {
    let place = Place::new();
    let base = repository("vehicles/hummingbird.toml");
    let hummingbird = Vehicle::load(base.as_ref()).unwrap();
    let effects = CATALOGUE.iter().map(|kind| effect_table(kind, &hummingbird)).collect::<String>();
    let text = format!("base = {base:?}\nname = \"every effect\"\n\n{effects}");
    let vehicle = format!("process.plant.vehicle={}", place.write("every-effect.toml", text));
    let backends = ["manifests/hover-rapier.toml", "manifests/hover.toml"];
    for manifest in first(1, "backends", backends) {
        let mut args = args(&place, &repository(manifest), TICKS);
        args.extend(["--set".to_owned(), vehicle.clone()]);
        assert_eq!(difference(&place, &args), None);
    }
}

/// An effect with its plausible values, as a file on the base of `vehicle` has it.
fn effect_table(kind: &EffectKind, vehicle: &Vehicle) -> String {
    let value = |spec: &ParameterSpec| {
        let unit = spec.dimension.units[0].0;
        let rest = format!("unit = {unit:?}, source = \"docs/effects.md\", uncertainty = \"not stated\"");
        format!("{} = {{ value = {:?}, {rest} }}\n", spec.name, spec.nominal)
    };
    let values: String = kind.parameters_for(vehicle).iter().map(value).collect();
    format!("[[effects]]\nname = {:?}\n{values}\n", kind.name)
}

/// The words that fly the manifest at `path` for `most` ticks, for those of [`OTHERS`], or to its end where that is earlier.
fn args(place: &Place, path: &str, most: u32) -> Vec<String> {
    let settings = settings(place, path).into_iter().flat_map(|setting| ["--set".to_owned(), setting]);
    let mut args: Vec<String> = ["run".to_owned(), path.to_owned()].into_iter().chain(settings).collect();
    let check: Vec<&str> =
        ["check", "--json"].into_iter().chain(args[1..].iter().map(String::as_str)).collect();
    let graph = place.call(&check).with_code(0).json();
    let of_its_own = OTHERS.iter().find(|(name, _)| path.ends_with(&format!("/{name}.toml")));
    let most = of_its_own.map_or(most, |(_, ticks)| *ticks);
    if graph["duration_ticks"].as_u64().unwrap() > most.into() {
        args.extend(["--set".into(), format!("run.duration_s={}", f64::from(most) / 1000.0)]);
    }
    args
}

/// Flies `args` both ways, side by side: where the recordings differ, and which nodes call functions of the C library.
fn difference(place: &Place, args: &[String]) -> Option<String> {
    let [here, older, calls] = ["here.mcap", "older.mcap", "calls"].map(|name| place.path(name));
    let witness = witness(place);
    let watched = [OLDER, ("LD_PRELOAD", &witness), (CALLS, &calls)];
    let start = |recording: &str, more: &[&str], variables: &[(&str, &str)]| {
        let args = args.iter().map(String::as_str).chain(["--record", recording]).chain(more.iter().copied());
        place.start_with(&args.collect::<Vec<_>>(), variables)
    };
    // The witness tells nodes apart by their processes. The other flight is the same composed, and sooner there.
    for launch in [start(&here, &["--compose", "all"], &[]), start(&older, &[], &watched)] {
        launch.end_among_others().flown();
    }
    let lines = fs::read_to_string(&calls).unwrap();
    assert!(lines.contains("loaded recorder\n") && lines.contains("plant"), "{lines}");
    fs::remove_file(calls).unwrap();
    let called: Vec<&str> = lines.lines().filter(|line| !is_allowed(line)).collect();
    let is_same = fs::read(&here).unwrap() == fs::read(&older).unwrap();
    (!is_same || !called.is_empty()).then(|| {
        let differ = first_difference(&open(&here), &open(&older)).unwrap();
        let differ = differ.map_or("no message differs".to_owned(), |differ| differ.to_string());
        format!("{args:?}: {differ}; functions of the C library, and who calls them: {called:?}")
    })
}

/// True if a line of the witness changes nothing of a recording: the start of a process, one of [`ALLOWED`], or a call
/// of the launcher for its progress bar and its tables.
fn is_allowed(line: &str) -> bool {
    let (function, node) = line.split_once(' ').unwrap();
    function == "loaded"
        || node == "launcher"
        || ALLOWED.iter().any(|(allowed, end)| function == *allowed && node.ends_with(end))
}

/// The library that notes which functions of the C library a process calls, made by what links this program.
fn witness(place: &Place) -> String {
    let (source, library) = (repository("tests/runs/c_library.c"), place.path("c_library.so"));
    let mut compiler = Command::new("cc");
    compiler.args(["-std=c11", "-O1", "-fno-builtin", "-shared", "-fPIC", "-o", &library, &source, "-ldl"]);
    let ended = compiler.output().unwrap();
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    library
}

/// The witness sees what the C library computes, so that its silence means something.
#[test]
fn the_witness_names_function_and_node() {
    let place = Place::new();
    let calls = place.path("calls");
    let mut asking = asking_the_c_library();
    asking.envs([("LD_PRELOAD", &witness(&place)), (CALLS, &calls)]).env("HUMMINGBUS_NODE", "asked");
    assert!(asking.output().unwrap().status.success());
    let calls = fs::read_to_string(&calls).unwrap();
    let mut found: Vec<&str> = calls.lines().collect();
    found.sort_unstable();
    assert_eq!(found, ["atan2 asked", "exp asked", "loaded asked", "pow asked", "sin asked"]);
}

/// Says where [`OLDER`] changes nothing of what the C library computes, so that equal recordings show nothing.
fn notice_where_nothing_is_older() {
    let asked = |variables: &[(&str, &str)]| {
        let ended = asking_the_c_library().envs(variables.iter().copied()).output().unwrap();
        let text = String::from_utf8(ended.stdout).unwrap();
        let values = text.lines().find_map(|line| line.split_once("C library: "));
        values.unwrap_or_else(|| panic!("no values in {text}")).1.to_owned()
    };
    if asked(&[]) == asked(&[OLDER]) {
        // Not `eprintln!`, which the test runner hides.
        let notice = "not shown here: GLIBC_TUNABLES changes no function of this C library on this processor";
        let _ = writeln!(std::io::stderr(), "{notice}; that no node calls one is");
    }
}

/// This program, that computes [`c_library`] and prints it.
fn asking_the_c_library() -> Command {
    let mut command = Command::new(env::current_exe().unwrap());
    let test = "processors::the_c_library_is_close_to_what_is_compiled_in";
    command.args(["--exact", test, "--nocapture"]).env(ASKED, "1");
    command
}

/// Two libraries, each within a unit in the last place of the truth; printed for the process that asked for it.
#[test]
fn the_c_library_is_close_to_what_is_compiled_in() {
    let values = c_library();
    for (found, expected) in values.iter().zip(compiled_in()) {
        assert!((found - expected).abs() <= 2.0 * f64::EPSILON * expected.abs(), "{found} {expected}");
    }
    if env::var_os(ASKED).is_some() {
        let bits = values.iter().fold(0_u64, |sum, value| sum.rotate_left(7) ^ value.to_bits());
        println!("C library: {bits:016x}");
    }
}

#[allow(clippy::disallowed_methods, reason = "it is the C library that is asked")]
fn c_library() -> Vec<f64> {
    arguments().flat_map(|x| [x.sin(), x.exp(), x.powf(1.7), x.atan2(0.3)]).collect()
}

fn compiled_in() -> Vec<f64> {
    let all = |x| [libm::sin(x), libm::exp(x), libm::pow(x, 1.7), libm::atan2(x, 0.3)];
    arguments().flat_map(all).collect()
}

/// Arguments that the compiler does not know; so many, as the functions for two processors differ in one of a thousand.
fn arguments() -> impl Iterator<Item = f64> {
    (1..100_000).map(|index| black_box(f64::from(index) * 1.234_567e-4))
}
