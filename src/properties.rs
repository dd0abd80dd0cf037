//! Properties of any manifest: it is accepted or refused with a message, and never brings the program down.

use crate::COMPONENTS;
use diagnostics::Diagnostic;
use proptest::prelude::*;
use proptest::sample::select;
use proptest::test_runner::{RngSeed, TestRunner};
use runtime::graph::Graph;
use runtime::manifest::Manifest;
use std::path::{Path, PathBuf};

const SHIPPED: [&str; 7] =
    ["custom-controller", "hover", "replay-nanobench", "standby", "swap-gains", "swap-identical", "swarm"];

/// Words with a meaning in a manifest, and some at the limits of TOML.
const WORDS: [&str; 48] = [
    "[run]",
    "[process.plant]",
    "[[pass]]",
    "[[swap]]",
    "[[shadow]]",
    "[[vehicle]]",
    "[set.hummingbird.process.plant]",
    "[process.\"h1/plant\"]",
    "include = [\"hover.toml\"]",
    "include = [\"sets/hover-set.toml\"]",
    "kind = \"plant\"",
    "command = [\"sh\"]",
    "command = []",
    "process = \"controller\"",
    "process.controller.on_exit = \"standby\"",
    "process.controller.standby = {}",
    "with = { kind = \"imu\" }",
    "at_tick = 3000",
    "at_s = 1e300",
    "shadow_ticks = 4294967295",
    "repeat = 4294967295",
    "every_ticks = 4294967295",
    "count = 4294967295",
    "name = \"h\"",
    "set = \"hummingbird\"",
    "duration_s = 4.2e6",
    "rate_hz = 1",
    "period_ticks = 4294967295",
    "lockstep = false",
    "nice = -2147483648",
    "watchdog_ms_host = 18446744073709551615",
    "window_ticks = 4294967295",
    "inputs = { state = { topic = \"/plant/state\", delay_ticks = 1, initial = {} } }",
    "outputs = { state = { topic = \"\", every_ticks = 0 } }",
    "parameters = [1, { a = [[[]]] }]",
    "vehicle = \"${\"",
    "log = \"\"",
    "= ",
    "nan",
    "-9223372036854775808",
    "99999999999999999999999999999999999999999",
    "1979-05-27T07:32:00Z",
    "\"\\u0000\"",
    "'''",
    "{ a = { a = { a = 1 } } }",
    "[[[[[[[[",
    "ä🐦",
    "\0",
];

/// The repository's manifests and vehicles, in a folder of their own.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        for sub in ["manifests", "manifests/sets", "vehicles"] {
            std::fs::create_dir(folder.path().join(sub)).unwrap();
            for entry in std::fs::read_dir(repository(sub)).unwrap().map(Result::unwrap) {
                if entry.path().extension().is_some_and(|extension| extension == "toml") {
                    std::fs::copy(entry.path(), folder.path().join(sub).join(entry.file_name())).unwrap();
                }
            }
        }
        Self(folder)
    }

    /// Checks `text` as a manifest beside the others.
    fn check(&self, text: &[u8], settings: &[String]) -> Result<(Manifest, Graph), Diagnostic> {
        let path = self.0.path().join("manifests/under-test.toml");
        std::fs::write(&path, text).unwrap();
        let manifest = Manifest::load(&path, settings, COMPONENTS)?;
        let graph = Graph::build(&manifest)?;
        Ok((manifest, graph))
    }

    /// Checks `text`, and requires a message about any problem.
    fn survives(&self, text: &[u8], settings: &[String]) {
        match self.check(text, settings) {
            Ok((_, graph)) => assert!(!graph.to_string().is_empty()),
            Err(problem) => assert!(!problem.to_string().is_empty()),
        }
    }
}

fn repository(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

fn shipped(name: &str) -> String {
    std::fs::read_to_string(repository(&format!("manifests/{name}.toml"))).unwrap()
}

/// Change of a text.
#[derive(Clone, Debug)]
enum Mutation {
    RemoveLine,
    RepeatLine,
    ReplaceValue(&'static str),
    InsertLine(&'static str),
    FlipByte(u8),
    Cut,
}

fn mutation() -> impl Strategy<Value = (Mutation, prop::sample::Index)> {
    let how = prop_oneof![
        Just(Mutation::RemoveLine),
        Just(Mutation::RepeatLine),
        select(&WORDS[..]).prop_map(Mutation::ReplaceValue),
        select(&WORDS[..]).prop_map(Mutation::InsertLine),
        any::<u8>().prop_map(Mutation::FlipByte),
        Just(Mutation::Cut),
    ];
    (how, any::<prop::sample::Index>())
}

fn mutated(text: Vec<u8>, (how, place): &(Mutation, prop::sample::Index)) -> Vec<u8> {
    let mut bytes = text;
    if bytes.is_empty() {
        return bytes;
    }
    match how {
        Mutation::FlipByte(mask) => {
            let index = place.index(bytes.len());
            bytes[index] ^= mask;
            return bytes;
        }
        Mutation::Cut => {
            bytes.truncate(place.index(bytes.len()));
            return bytes;
        }
        _ => {}
    }
    let mut lines: Vec<Vec<u8>> = bytes.split(|&byte| byte == b'\n').map(<[u8]>::to_vec).collect();
    let line = place.index(lines.len());
    match how {
        Mutation::RemoveLine => drop(lines.remove(line)),
        Mutation::RepeatLine => lines.insert(line, lines[line].clone()),
        Mutation::InsertLine(word) => lines.insert(line, word.as_bytes().to_vec()),
        Mutation::ReplaceValue(word) => {
            let key = lines[line].iter().position(|&byte| byte == b'=').map_or(0, |at| at + 1);
            lines[line].truncate(key);
            lines[line].extend_from_slice(word.as_bytes());
        }
        Mutation::FlipByte(_) | Mutation::Cut => {}
    }
    lines.join(&b'\n')
}

/// Settings that the swarm and the hover accept, in pairs of key and values.
const GOOD_SETTINGS: [(&str, &[&str]); 8] = [
    ("run.seed", &["7", "0"]),
    // Longer than the 4 s from which on the swarm is judged: the recorded text would be refused.
    ("run.duration_s", &["4.5", " 8"]),
    ("process.recorder.period_ticks", &["1"]),
    ("pass.0.max", &["1e3", "2"]),
    ("pass.1.name", &["spaces in it", "\"quoted\"", "it's # no comment"]),
    ("vehicle.1.process.plant.parameters.substeps", &["3"]),
    ("set.hummingbird.process.imu.parameters.gyroscope_range_rad_s", &["9.5"]),
    ("process.h3/imu.parameters.gyroscope_initial_bias_rad_s", &["[0, 0.1, 0]"]),
];

/// Parts of keys.
const KEYS: [&str; 17] = [
    "run",
    "process",
    "set",
    "vehicle",
    "swap",
    "pass",
    "0",
    "1",
    "plant",
    "controller",
    "with",
    "inputs",
    "command",
    "parameters",
    "hummingbird",
    "h1/plant",
    "kind",
];

fn good_setting() -> impl Strategy<Value = String> {
    select(&GOOD_SETTINGS[..])
        .prop_flat_map(|(key, values)| select(values).prop_map(move |value| format!("{key}={value}")))
}

/// Has `holds` look at `cases` values, in a folder that they share.
fn for_any<S: Strategy>(cases: u32, strategy: S, holds: impl Fn(&Folder, S::Value)) {
    // A seed of its own, so that a run that fails fails again.
    let rng_seed = RngSeed::Fixed(1);
    let config = ProptestConfig { cases, failure_persistence: None, rng_seed, ..ProptestConfig::default() };
    let folder = Folder::new();
    let result = TestRunner::new(config).run(&strategy, |value| {
        holds(&folder, value);
        Ok(())
    });
    result.unwrap_or_else(|error| panic!("{error}"));
}

#[test]
fn any_text_is_accepted_or_refused() {
    for_any(200, (any::<Vec<u8>>(), "\\PC{0,60}"), |folder, (bytes, text)| {
        folder.survives(&bytes, &[]);
        folder.survives(text.as_bytes(), std::slice::from_ref(&text));
    });
}

#[test]
fn any_words_are_accepted_or_refused() {
    let given = prop::collection::vec(select(&WORDS[..]), 0..12);
    for_any(300, given, |folder, words| folder.survives(words.join("\n").as_bytes(), &[]));
}

#[test]
fn any_change_of_a_shipped_manifest_is_accepted_or_refused() {
    let mutations = prop::collection::vec(mutation(), 1..4);
    for_any(600, (select(&SHIPPED[..]), mutations), |folder, (name, mutations)| {
        let text = mutations.iter().fold(shipped(name).into_bytes(), mutated);
        folder.survives(&text, &[]);
    });
}

#[test]
fn any_setting_of_a_shipped_manifest_is_accepted_or_refused() {
    let key = prop_oneof![select(&KEYS[..]).prop_map(str::to_owned), "[a-z./ ]{0,4}"];
    let keys = prop::collection::vec(key, 1..5);
    for_any(300, (select(&SHIPPED[..]), keys, select(&WORDS[..])), |folder, (name, keys, word)| {
        let settings = [format!("{}={word}", keys.join("."))];
        folder.survives(shipped(name).as_bytes(), &settings);
    });
}

#[test]
fn the_recorded_text_says_what_the_settings_said() {
    let settings = prop::collection::vec(good_setting(), 0..5);
    for_any(40, settings, |folder, settings| {
        let plan = |graph: &Graph| serde_json::to_value(&graph.plan).unwrap();
        let (manifest, graph) = folder.check(shipped("swarm").as_bytes(), &settings).unwrap();
        let (again, same) = folder.check(manifest.recorded_text.as_bytes(), &[]).unwrap();
        assert_eq!(plan(&graph), plan(&same), "{}", manifest.recorded_text);
        assert_eq!(again.recorded_text, manifest.recorded_text);
        let names = |manifest: &Manifest| -> Vec<String> {
            manifest.content.pass.iter().map(|pass| pass.get_ref().name.clone()).collect()
        };
        assert_eq!(names(&manifest), names(&again));
    });
}
