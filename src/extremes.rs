//! Extreme numbers at every key of every file that is shipped: refused with a message, or harmless.
//!
//! `check` has tried every value that it accepts: it has stepped the plant and the law with it ("rehearsed"). So a
//! panic, or a number that overflows on the way, shows here without a process.

use crate::COMPONENTS;
use bus::Registration;
use bus::context::NodeContext;
use runtime::graph::Graph;
use runtime::manifest::Manifest;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// Values that replace a number.
const EXTREMES: [Value; 9] = [
    Value::Float(1e308),
    Value::Float(-1e308),
    Value::Float(5e-324),
    Value::Float(f64::NAN),
    Value::Float(f64::INFINITY),
    Value::Float(f64::NEG_INFINITY),
    Value::Float(0.0),
    Value::Float(-0.0),
    Value::Integer(u32::MAX as i64),
];

/// The repository's files that describe vehicles and runs, in a folder of their own.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        for sub in FOLDERS {
            std::fs::create_dir_all(folder.path(sub)).unwrap();
            for (name, text) in files(sub) {
                std::fs::write(folder.path(sub).join(name), text).unwrap();
            }
        }
        folder
    }

    fn path(&self, file: &str) -> PathBuf {
        self.0.path().join(file)
    }

    /// Checks the manifest at `path` with `settings`: its words where it is refused.
    fn check(path: &Path, settings: &[String]) -> Result<Graph, String> {
        let manifest = Manifest::load(path, settings, COMPONENTS).map_err(|problem| problem.to_string())?;
        Graph::build(&manifest).map_err(|problem| problem.to_string())
    }
}

const FOLDERS: [&str; 7] = [
    "manifests",
    "manifests/identify",
    "manifests/sets",
    "manifests/sticks",
    "vehicles",
    "scenes",
    "controllers/gains",
];

fn files(folder: &str) -> Vec<(String, String)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
    let mut files: Vec<_> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "toml" || extension == "csv"))
        .filter(|path| !path.ends_with("Cargo.toml"))
        .map(|path| {
            (path.file_name().unwrap().to_string_lossy().into(), std::fs::read_to_string(&path).unwrap())
        })
        .collect();
    files.sort();
    files
}

/// The paths of all numbers below `value`.
fn numbers(value: &Value, path: &[String]) -> Vec<Vec<String>> {
    let below = |key: String, value: &Value| numbers(value, &[path, &[key]].concat());
    match value {
        Value::Table(table) => table.iter().flat_map(|(key, value)| below(key.clone(), value)).collect(),
        Value::Array(array) => {
            array.iter().enumerate().flat_map(|(index, value)| below(index.to_string(), value)).collect()
        }
        Value::Float(_) | Value::Integer(_) => vec![path.to_vec()],
        _ => Vec::new(),
    }
}

fn with(tree: &Value, path: &[String], new: &Value) -> Value {
    let mut changed = tree.clone();
    let place = path.iter().fold(&mut changed, |value, key| match value {
        Value::Array(array) => &mut array[key.parse::<usize>().unwrap()],
        Value::Table(table) => table.get_mut(key).unwrap(),
        _ => unreachable!("the path leads through tables and arrays"),
    });
    *place = new.clone();
    changed
}

/// Outcome of a trial with an extreme number.
enum Outcome {
    Accepted,
    Refused,
}

/// Tries every `stride`-th case, an extreme in the place of a number of the file `file` of `folder`, with `check`. No
/// case panics, every refusal has a place, and no number that is not finite is accepted. Returns the counts of
/// accepted and refused cases.
fn try_all(
    folder: &Folder,
    file: &str,
    stride: usize,
    check: impl Fn() -> Result<(), String>,
) -> (usize, usize) {
    let text = std::fs::read_to_string(folder.path(file)).unwrap();
    let tree = Value::Table(text.parse::<Table>().unwrap());
    let places = numbers(&tree, &[]);
    let cases = places.iter().flat_map(|path| EXTREMES.iter().map(move |new| (path, new)));
    let (mut accepted, mut refused) = (0, 0);
    for (path, new) in cases.step_by(stride) {
        let case = format!("{file}: {} = {new}", path.join("."));
        std::fs::write(folder.path(file), toml::to_string(&with(&tree, path, new)).unwrap()).unwrap();
        let outcome = catch_unwind(AssertUnwindSafe(&check))
            .unwrap_or_else(|_| panic!("{case} is a panic of the check"));
        match judged(outcome, new, &case) {
            Outcome::Accepted => accepted += 1,
            Outcome::Refused => refused += 1,
        }
    }
    std::fs::write(folder.path(file), text).unwrap();
    (accepted, refused)
}

fn judged(outcome: Result<(), String>, new: &Value, case: &str) -> Outcome {
    match outcome {
        Ok(()) => {
            assert!(new.as_float().is_none_or(f64::is_finite), "{case} is accepted");
            Outcome::Accepted
        }
        Err(message) => {
            assert!(message.contains(".toml:"), "{case} is refused without a place: {message}");
            Outcome::Refused
        }
    }
}

/// Some of the cases of a long list: every `stride`-th, or all with HUMMINGBUS_EXTREMES=all.
fn stride(some: usize) -> usize {
    if std::env::var("HUMMINGBUS_EXTREMES").is_ok_and(|chosen| chosen == "all") { 1 } else { some }
}

#[test]
fn no_number_of_a_shipped_manifest_brings_the_check_down() {
    let folder = Folder::new();
    let mut refused = 0;
    for sub in ["manifests", "manifests/identify"] {
        for (name, _) in files(sub).iter().filter(|(name, _)| name.ends_with(".toml")) {
            let file = format!("{sub}/{name}");
            let path = folder.path(&file);
            refused += try_all(&folder, &file, stride(31), || Folder::check(&path, &[]).map(|_| ())).1;
        }
    }
    assert!(refused > 120, "only {refused} refusals");
}

#[test]
fn no_number_of_a_set_brings_the_check_down() {
    let folder = Folder::new();
    for (set, manifest) in [("flight", "take-off"), ("hover-set", "swarm"), ("room", "wall-follow-constant")]
    {
        let path = folder.path(&format!("manifests/{manifest}.toml"));
        let file = format!("manifests/sets/{set}.toml");
        try_all(&folder, &file, stride(5), || Folder::check(&path, &[]).map(|_| ()));
    }
}

#[test]
fn no_number_of_a_shipped_vehicle_brings_plant_or_law_down() {
    let folder = Folder::new();
    let path = folder.path("manifests/hover.toml");
    for (name, _) in files("vehicles") {
        let file = format!("vehicles/{name}");
        let settings = ["plant", "controller"]
            .map(|process| format!("process.{process}.vehicle={}", folder.path(&file).display()));
        let (_, refused) = try_all(&folder, &file, stride(5), || Folder::check(&path, &settings).map(|_| ()));
        assert!(refused > 2, "only {refused} refusals of {name}");
    }
}

#[test]
fn no_number_of_a_shipped_scene_brings_the_plant_down() {
    let folder = Folder::new();
    let path = folder.path("manifests/hover-rapier.toml");
    for (name, _) in files("scenes") {
        let file = format!("scenes/{name}");
        let setting = format!("process.plant.scene={}", folder.path(&file).display());
        try_all(&folder, &file, stride(7), || {
            Folder::check(&path, std::slice::from_ref(&setting)).map(|_| ())
        });
    }
}

#[test]
fn no_number_of_shipped_gains_brings_a_law_down() {
    use controllers::controller::Controller;
    use controllers::{cascade, geometric, lqr, pid, velocity};
    use controllers::{wall_follow, wall_follow_thesis, wall_stop, wall_stop_thesis};
    let folder = Folder::new();
    let kinds = [
        ("pid", Registration::of::<Controller<pid::PidLaw>>()),
        ("pid-thesis", Registration::of::<Controller<pid::PidLaw>>()),
        ("cascade", Registration::of::<Controller<cascade::CascadeLaw>>()),
        ("velocity", Registration::of::<Controller<velocity::VelocityLaw>>()),
        ("wall-stop", Registration::of::<Controller<wall_stop::WallStopLaw>>()),
        ("wall-follow", Registration::of::<Controller<wall_follow::WallFollowLaw>>()),
        ("wall-stop-thesis", Registration::of::<Controller<wall_stop_thesis::WallStopThesisLaw>>()),
        ("wall-follow-thesis", Registration::of::<Controller<wall_follow_thesis::WallFollowThesisLaw>>()),
        ("lqr", Registration::of::<Controller<lqr::LqrLaw>>()),
        ("geometric", Registration::of::<Controller<geometric::GeometricLaw>>()),
    ];
    for (name, kind) in kinds {
        let file = format!("controllers/gains/{name}.toml");
        let mut parameters = serde_json::json!({
            "vehicle": folder.path("vehicles/hummingbird.toml"),
            "gains": folder.path(&file),
        });
        if kind.name == "velocity" || kind.name.starts_with("wall-") {
            parameters["altitude_m"] = 1.5.into();
        }
        if kind.name.starts_with("wall-follow") {
            parameters["mode"] = "constant".into();
        }
        assert_eq!(kind.check(&parameters, &NodeContext::new("node", &[])), Ok(()));
        let (_, refused) = try_all(&folder, &file, stride(2), || {
            kind.check(&parameters, &NodeContext::new("node", &[]))
                .map_err(|error| error.to_string())
                .map_err(
                    |message| if message.contains(".toml:") { message } else { format!("{file}: {message}") },
                )
        });
        // The files of the thesis's guidance hold one number or two.
        let least = if kind.name.starts_with("wall-") && kind.name.ends_with("-thesis") { 2 } else { 10 };
        assert!(refused > least, "only {refused} refusals of {name}");
    }
}

#[test]
fn what_is_shipped_has_no_warnings() {
    let (folder, mut checked) = (Folder::new(), 0);
    for sub in ["manifests", "manifests/identify"] {
        for (name, _) in files(sub) {
            if let Ok(graph) = Folder::check(&folder.path(&format!("{sub}/{name}")), &[]) {
                let messages: Vec<String> = graph.warnings.iter().map(ToString::to_string).collect();
                assert_eq!(messages, Vec::<String>::new(), "{name}");
                checked += 1;
            }
        }
    }
    assert!(checked > 15, "only {checked} were checked");
}
