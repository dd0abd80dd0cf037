//! The same bytes on a processor of another make: every shipped manifest is flown once more as if the processor had no
//! fused products, of which the C library takes other versions of its functions then.

use crate::manifests::{settings, shipped};
use crate::recordings::require_same;
use crate::support::{Place, repository};
use std::hint::black_box;
use std::io::Write as _;
use std::process::Command;
use std::{env, fs};

/// What hides newer instructions from glibc, whose functions for older processors are taken then.
const OLDER: (&str, &str) = ("GLIBC_TUNABLES", "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX2_Usable,-FMA_Usable");

/// Ticks of a flight: behind all swaps, and behind the first differences that functions of the C library made, at
/// tick 420 (ten vehicles) to 3676 (rig B).
const TICKS: u32 = 10_000;

/// Asks this program for the C library's values alone; see [`c_library`].
const ASKED: &str = "HUMMINGBUS_TEST_C_LIBRARY";

/// Flies `words` both ways, side by side, and requires the same recording.
#[track_caller]
fn require_the_same_on_both(place: &Place, words: &[String]) {
    let recordings = ["here.mcap", "older.mcap"].map(|name| place.path(name));
    let launches = recordings.each_ref().map(|recording| {
        let words = words.iter().map(String::as_str).chain(["--record", recording]).collect::<Vec<_>>();
        place.start_with(&words, if recording == &recordings[0] { &[] } else { &[OLDER] })
    });
    for launch in launches {
        launch.end_among_others().flown();
    }
    require_same(&fs::read(&recordings[0]).unwrap(), &recordings[1]);
}

/// The words that fly the manifest at `path` for [`TICKS`], or to its end where that is earlier.
fn words(place: &Place, path: &str) -> Vec<String> {
    let mut words = vec!["run".to_owned(), path.to_owned()];
    let settings = settings(place, path);
    words.extend(settings.into_iter().flat_map(|setting| ["--set".to_owned(), setting]));
    let mut check = words.clone();
    check[0] = "check".into();
    check.push("--json".into());
    let check: Vec<&str> = check.iter().map(String::as_str).collect();
    let graph = place.call(&check).with_code(0).json();
    // The made-up flight that is replayed lasts a second.
    let most = if path.ends_with("replay-nanobench.toml") { 1001 } else { TICKS };
    if graph["duration_ticks"].as_u64().unwrap() > most.into() {
        words.extend(["--set".into(), format!("run.duration_s={}", f64::from(most) / 1000.0)]);
    }
    words
}

#[test]
fn every_shipped_manifest_flies_the_same_on_an_older_processor() {
    if is_skipped() {
        return;
    }
    let flights = ["excite", "hover-gentle", "low-passes", "rig-a-riddle"];
    let flights = flights.map(|name| repository(&format!("manifests/identify/{name}.toml")));
    for path in shipped().into_iter().chain(flights) {
        let place = Place::new();
        require_the_same_on_both(&place, &words(&place, &path));
    }
}

/// Gusts and noise that the shipped vehicles have not: a vehicle with every effect of the catalogue.
#[test]
fn every_effect_is_the_same_on_an_older_processor() {
    if is_skipped() {
        return;
    }
    let place = Place::new();
    let effects = plant::effects::CATALOGUE.map(|kind| {
        let value = |own: &plant::effects::ParameterSpec| {
            let unit = own.dimension.units[0].0;
            let rest = format!("unit = {unit:?}, source = \"docs/effects.md\", uncertainty = \"not stated\"");
            format!("{} = {{ value = {:?}, {rest} }}\n", own.name, own.typical)
        };
        let values: String = kind.parameters.iter().map(value).collect();
        format!("[[effects]]\nname = {:?}\n{values}\n", kind.name)
    });
    let base = repository("vehicles/hummingbird.toml");
    let text = format!("base = {base:?}\nname = \"every effect\"\n\n{}", effects.concat());
    let vehicle = format!("process.plant.vehicle={}", place.write("every-effect.toml", text));
    for manifest in ["manifests/hover.toml", "manifests/hover-rapier.toml"] {
        let mut words = words(&place, &repository(manifest));
        words.extend(["--set".to_owned(), vehicle.clone()]);
        require_the_same_on_both(&place, &words);
    }
}

/// Whether [`OLDER`] changes nothing of what the C library computes, so that a flight under it would show nothing.
fn is_skipped() -> bool {
    let asked = |variables: &[(&str, &str)]| {
        let mut command = Command::new(env::current_exe().unwrap());
        command.args([
            "--exact",
            "processors::the_c_library_is_asked_in_a_process_of_its_own",
            "--nocapture",
        ]);
        let ended = command.env(ASKED, "1").envs(variables.iter().copied()).output().unwrap();
        let text = String::from_utf8(ended.stdout).unwrap();
        let line =
            text.lines().find_map(|line| line.split_once("C library: ")).map(|(_, bits)| bits.to_owned());
        line.unwrap_or_else(|| panic!("no values in {text}"))
    };
    let (here, older) = (asked(&[]), asked(&[OLDER]));
    if here == older {
        // Not `eprintln!`, which the test runner hides.
        let notice = "skipped: GLIBC_TUNABLES changes no function of this C library on this processor";
        let _ = writeln!(std::io::stderr(), "{notice}");
    }
    here == older
}

/// Prints the C library's values where [`ASKED`] is set, for the process that set it; and requires that they come as
/// close to those of `libm` as two libraries' may.
#[test]
fn the_c_library_is_asked_in_a_process_of_its_own() {
    let values = c_library();
    for (found, expected) in values.iter().zip(ours()) {
        assert!((found - expected).abs() <= 2.0 * f64::EPSILON * expected.abs(), "{found} {expected}");
    }
    if env::var_os(ASKED).is_some() {
        let bits = values.iter().fold(0_u64, |sum, value| sum.rotate_left(7) ^ value.to_bits());
        println!("C library: {bits:016x}");
    }
}

/// Arguments of all kinds, away from the functions' zeros.
fn arguments() -> impl Iterator<Item = f64> {
    (1..1000).map(|index| black_box(f64::from(index) * 1.234_567e-3))
}

/// Functions of the C library.
#[allow(clippy::disallowed_methods, reason = "it is the C library that is asked")]
fn c_library() -> Vec<f64> {
    arguments().flat_map(|x| [x.sin(), x.exp(), x.powf(1.7), x.atan2(0.3)]).collect()
}

/// The same of `libm`.
fn ours() -> Vec<f64> {
    let all = |x| [libm::sin(x), libm::exp(x), libm::pow(x, 1.7), libm::atan2(x, 0.3)];
    arguments().flat_map(all).collect()
}
