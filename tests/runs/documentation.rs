//! The documentation names only what is there, and every key of manifests.

use crate::refusals::good;
use crate::support::{HUMMINGBUS, Place, repository};
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::Command;

/// The words of a Markdown file that stand in backticks.
fn quoted(file: &str) -> Vec<String> {
    let text = fs::read_to_string(repository(file)).unwrap();
    text.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

#[test]
fn every_path_that_the_architecture_names_exists() {
    let is_path = |word: &String| word.contains('/') && word.contains('.') && !word.contains([' ', '*']);
    let paths: Vec<String> = quoted("docs/architecture.md").into_iter().filter(is_path).collect();
    assert!(paths.len() > 30, "found only {paths:?}");
    for path in paths {
        assert!(Path::new(&repository(&path)).exists(), "docs/architecture.md names {path}");
    }
}

/// The pages of the documentation, by their paths in the repository.
fn pages() -> Vec<String> {
    let within = |folder: &'static str| {
        let names = fs::read_dir(repository(folder)).unwrap().map(|entry| entry.unwrap().file_name());
        names.map(move |name| format!("{folder}/{}", name.to_string_lossy()))
    };
    let pages = within("docs").chain(within("docs/decisions")).filter(|page| page.ends_with(".md"));
    pages.chain(["README.md", "CONTRIBUTING.md", "CHANGELOG.md"].map(str::to_owned)).collect()
}

/// True if `path` names a file of the repository: one that is stored, in one of its folders.
fn is_stored(path: &str) -> bool {
    let is_made = [".mcap", ".html"].iter().any(|extension| path.ends_with(extension));
    let is_form = path.contains(|c: char| c.is_whitespace() || "*<>=${}…:".contains(c));
    let folder = path.split('/').next().unwrap();
    !is_made
        && !is_form
        && !path.contains("NAME")
        && path.contains('.')
        && Path::new(&repository(folder)).is_dir()
}

#[test]
fn every_path_that_a_page_names_exists() {
    let mut count = 0;
    for page in pages() {
        let named = quoted(&page).into_iter().map(|word| word.trim_matches('"').to_owned());
        for path in named.filter(|word| word.contains('/') && !word.starts_with('/')) {
            // Paths in manifests start at their folder.
            let path = path.strip_prefix("../").unwrap_or(&path);
            if is_stored(path) {
                count += 1;
                assert!(Path::new(&repository(path)).exists(), "{page} names {path}");
            }
        }
    }
    assert!(count > 100, "found only {count}");
}

/// The anchors of a page's headings, as GitHub makes them.
fn anchors(page: &str) -> Vec<String> {
    let text = fs::read_to_string(page).unwrap();
    let headings = text.lines().filter(|line| line.starts_with('#'));
    let anchor = |heading: &str| -> String {
        let kept = heading.trim_start_matches('#').trim().to_lowercase();
        kept.chars().filter(|&c| c.is_alphanumeric() || " -_".contains(c)).collect()
    };
    headings.map(|heading| anchor(heading).replace(' ', "-")).collect()
}

/// Links as GitHub resolves them; `scripts/site` checks those of the built site.
#[test]
fn every_link_of_a_page_leads_somewhere() {
    let mut count = 0;
    for page in pages() {
        let text = fs::read_to_string(repository(&page)).unwrap();
        // What stands in backticks is no link.
        let prose: String = text.split('`').step_by(2).collect();
        for link in prose.split("](").skip(1).map(|rest| rest.split(')').next().unwrap()) {
            if link.starts_with("http") {
                continue;
            }
            let (file, anchor) = link.split_once('#').unwrap_or((link, ""));
            let file = match file {
                "" => repository(&page).into(),
                _ => Path::new(&repository(&page)).with_file_name(file),
            };
            assert!(file.exists(), "{page}: {link}");
            let is_there = anchor.is_empty() || anchors(&file.to_string_lossy()).iter().any(|a| a == anchor);
            assert!(is_there, "{page}: {link}: no such heading");
            count += 1;
        }
    }
    assert!(count > 100, "found only {count}");
}

#[test]
fn the_page_of_components_is_what_they_declare() {
    let page = fs::read_to_string(repository("docs/components.md")).unwrap();
    let printed = Place::new().call(&["components"]).with_code(0).output;
    assert!(page == printed, "write it anew: hummingbus components >docs/components.md");
}

/// The names of the workspace's libraries that the crate in `folder` depends on.
fn known_to(folder: &str) -> BTreeSet<String> {
    let text = fs::read_to_string(repository(&format!("{folder}Cargo.toml"))).unwrap();
    let manifest: toml::Table = text.parse().unwrap();
    let root: toml::Table = fs::read_to_string(repository("Cargo.toml")).unwrap().parse().unwrap();
    let is_ours = |name: &String| root["workspace"]["dependencies"][name].get("path").is_some();
    let known = manifest.get("dependencies").and_then(toml::Value::as_table).cloned().unwrap_or_default();
    known.keys().filter(|name| is_ours(name)).cloned().collect()
}

#[test]
fn the_architecture_tells_every_crate_and_whom_it_knows() {
    let text = fs::read_to_string(repository("docs/architecture.md")).unwrap();
    let rows =
        text.lines().filter_map(|line| line.strip_prefix("| `")?.strip_suffix(" |")?.split_once("/` |"));
    let mut told = BTreeSet::new();
    for (folder, rest) in rows {
        let known = rest.rsplit(" | ").next().unwrap();
        let known: BTreeSet<String> =
            known.split(", ").filter(|name| *name != "–").map(str::to_owned).collect();
        let crate_folder = if folder == "src" { String::new() } else { format!("{folder}/") };
        assert_eq!(known, known_to(&crate_folder), "docs/architecture.md, {folder}");
        told.insert(folder.to_owned());
    }
    let root: toml::Table = fs::read_to_string(repository("Cargo.toml")).unwrap().parse().unwrap();
    let members = root["workspace"]["members"].as_array().unwrap().iter();
    let members = members.map(|member| member.as_str().unwrap().to_owned());
    assert_eq!(told, members.chain(["src".to_owned()]).collect());
}

#[test]
fn the_page_of_the_thesis_begins_and_ends_as_its_script_writes_it() {
    let script = fs::read_to_string(repository("scripts/thesis")).unwrap();
    let page = fs::read_to_string(repository("docs/thesis.md")).unwrap();
    let text = |name: &str| {
        let (_, rest) = script.split_once(&format!("\n{name} = \"\"\"")).unwrap();
        rest.split_once("\"\"\"").unwrap().0
    };
    assert!(page.starts_with(text("HEAD")) && page.ends_with(text("TAIL")));
    let clients = page.lines().find(|line| line.starts_with("| remote clients ")).unwrap();
    for language in ["Rust", "C++", "Python", "FMUs"] {
        assert!(clients.contains(language), "{language} is missing in: {clients}");
    }
}

#[test]
fn every_manifest_is_named_in_the_scenarios() {
    let scenarios = fs::read_to_string(repository("docs/scenarios.md")).unwrap();
    for entry in fs::read_dir(repository("manifests")).unwrap() {
        let name = entry.unwrap().file_name().to_string_lossy().into_owned();
        let is_named = scenarios.contains(&format!("`{name}`"));
        assert!(!name.ends_with(".toml") || is_named, "docs/scenarios.md does not name {name}");
    }
}

/// The content of each code block of a page that begins with this line.
pub fn code_blocks(page: &str, fence: &str) -> Vec<String> {
    let text = fs::read_to_string(repository(page)).unwrap();
    let opening = format!("\n```{fence}\n");
    let blocks = text.split(&opening).skip(1);
    blocks.map(|block| block.split("\n```\n").next().unwrap().to_owned()).collect()
}

/// The commands of a page's shell blocks, each on one line.
fn commands(page: &str) -> Vec<String> {
    let joined = code_blocks(page, "sh").join("\n").replace("\\\n", " ");
    joined.lines().map(|line| line.trim().trim_end_matches('&').to_owned()).collect()
}

/// Bash takes a line apart as it does for a user, and clap reads its arguments: `--help` is the last of them.
#[test]
fn every_call_of_the_program_on_a_page_has_options_that_exist() {
    let mut count = 0;
    let program = |word: &str| word.trim_start_matches("target/release/") == "hummingbus";
    for page in pages() {
        let lines = commands(&page).into_iter();
        // A line may begin with variables of its environment.
        for line in lines.filter(|line| line.split(' ').find(|word| !word.contains('=')).is_some_and(program))
        {
            let line = line.replace("target/release/hummingbus", "hummingbus");
            let script = format!("set -o pipefail; hummingbus() {{ \"$PROGRAM\" \"$@\" --help; }}; {line}");
            let mut bash = Command::new("bash");
            let ended = bash.args(["-c", &script]).env("PROGRAM", HUMMINGBUS).output().unwrap();
            let said = String::from_utf8_lossy(&ended.stderr);
            assert!(ended.status.success(), "{page}: {line}\n{said}");
            count += 1;
        }
    }
    assert!(count > 60, "found only {count}");
}

#[test]
fn every_path_in_a_shell_block_exists() {
    let folders =
        ["manifests/", "vehicles/", "flights/", "examples/", "scripts/", "bindings/", "containers/"];
    let mut count = 0;
    for page in pages() {
        for line in commands(&page) {
            let line = line.split(" #").next().unwrap().to_owned();
            let is_made = |word: &&str| [".mcap", ".ckpt"].iter().any(|end| word.ends_with(end));
            let is_ours = |word: &&str| folders.iter().any(|folder| word.starts_with(folder));
            for path in line.split_whitespace().filter(|word| is_ours(word) && !is_made(word)) {
                let path = path.trim_end_matches(';');
                count += 1;
                assert!(path.contains('$') || Path::new(&repository(path)).exists(), "{page} names {path}");
            }
        }
    }
    assert!(count > 40, "found only {count}");
}

/// The README's controller is that of the example, which `manifests/custom-controller.toml` flies.
#[test]
fn the_component_of_the_readme_is_the_one_that_is_flown() {
    let example = fs::read_to_string(repository("examples/custom_controller.rs")).unwrap();
    let blocks = code_blocks("README.md", "rust,no_run");
    assert!(example.ends_with(&format!("\n\n{}\n", blocks[0])), "README.md has another controller");
    let manifest = fs::read_to_string(repository("manifests/custom-controller.toml")).unwrap();
    let [package, process] = &code_blocks("README.md", "toml")[..] else { panic!("two blocks of TOML") };
    assert!(manifest.contains(&format!("\n{process}\n")), "README.md wires the controller otherwise");
    let package: toml::Table = package.parse().unwrap();
    let bus = &package["dependencies"]["bus"];
    assert_eq!(bus["path"].as_str(), Some("../hummingbus/bus"));
    let named = fs::read_to_string(repository("bus/Cargo.toml")).unwrap().parse::<toml::Table>().unwrap();
    assert_eq!(bus["package"], named["package"]["name"]);
    // The program uses no other library than the block names.
    let used = blocks[0].lines().filter_map(|line| line.strip_prefix("use ")?.split("::").next());
    assert!(used.into_iter().all(|name| package["dependencies"].get(name).is_some()), "{package}");
}

#[test]
fn the_test_of_the_readme_is_the_one_that_runs() {
    let run = fs::read_to_string(repository("tests/runs/readme.rs")).unwrap();
    let [printed] = &code_blocks("README.md", "rust")[..] else { panic!("one block of Rust") };
    assert!(
        run.ends_with(&format!("\n\n{printed}\n")),
        "README.md has another test than tests/runs/readme.rs"
    );
}

/// The table of languages in the README states the lengths of its examples.
#[test]
fn the_examples_of_the_readme_have_as_many_lines_as_it_says() {
    let text = fs::read_to_string(repository("README.md")).unwrap();
    let mut count = 0;
    for row in text.lines().filter(|line| line.starts_with("| ")) {
        let Some((before, _)) = row.split_once(" lines |") else { continue };
        let (link, stated) = before.rsplit_once("), ").unwrap_or_else(|| panic!("{row}"));
        let (_, path) = link.rsplit_once("](").unwrap_or_else(|| panic!("{row}"));
        let lines = fs::read_to_string(repository(path)).unwrap().lines().count();
        assert_eq!(stated.parse(), Ok(lines), "README.md, {path}");
        count += 1;
    }
    assert_eq!(count, 4);
}

/// The pages of C++ and Python state the lengths, too. An example is short.
#[test]
fn the_controllers_of_two_pages_have_as_many_lines_as_they_say() {
    for (page, path, most) in [
        ("docs/cpp.md", "examples/cpp/controller.cpp", 60),
        ("docs/python.md", "examples/python/controller.py", 70),
    ] {
        let lines = fs::read_to_string(repository(path)).unwrap().lines().count();
        let text = fs::read_to_string(repository(page)).unwrap();
        let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(words.contains(&format!(" in {lines} lines")), "{page}: {path} has {lines} lines");
        assert!(lines <= most, "{path} has {lines} lines, expected at most {most}");
    }
}

/// The keys that the refusal of `unknown_key` in the good manifest, with `from` replaced by `to`, names as known.
#[track_caller]
fn known_keys(from: &str, to: &str) -> Vec<String> {
    let place = Place::new();
    assert_eq!(good().matches(from).count(), 1, "{from}");
    let ended = place.call(&["check", &place.write("keys.toml", good().replace(from, to))]).with_code(2);
    ended.says(&["unknown key `", "unknown_key`, expected "]);
    let list = ended.error.split("unknown_key`, expected ").nth(1).unwrap().lines().next().unwrap();
    list.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

#[test]
fn the_documentation_has_every_key() {
    let pages = ["docs/manifest-reference.md", "docs/conditions.md", "docs/components.md", "docs/laws.md"];
    let text = pages.map(|page| fs::read_to_string(repository(page)).unwrap()).concat();
    let end = "[process.recorder]\nkind = \"recorder\"\n";
    let list = |name: &str| format!("{end}\n[[{name}]]\nunknown_key = 1\n");
    let within = |process: &str, key: &str| format!("kind = \"{process}\"\n{key}.unknown_key = 1");
    let sensor = |kind: &str| {
        let port = if kind == "battery" { "battery" } else { "state" };
        let input = format!("inputs.{port} = \"/plant/{port}\"\n[process.plant.outputs.battery]\n");
        format!("{end}\n[process.sensor]\n{}\n{input}", within(kind, "parameters"))
    };
    let keys = [
        known_keys("window_ticks = 64", "unknown_key = 64"),
        known_keys("kind = \"imu\"", "kind = \"imu\"\nunknown_key = 1"),
        known_keys("kind = \"imu\"", &within("imu", "outputs.imu")),
        known_keys(end, &list("pass")),
        known_keys(end, &list("measure")),
        known_keys(end, &list("compare")),
        known_keys(end, &list("swap")),
        known_keys(end, &list("shadow")),
        known_keys(end, &list("vehicle")),
        known_keys("kind = \"plant\"", &within("plant", "parameters")),
        known_keys("kind = \"imu\"", &within("imu", "parameters")),
        known_keys("kind = \"pid\"", &within("pid", "parameters.gains")),
        known_keys("kind = \"pid\"", &within("pid", "parameters.gains.roll")),
        known_keys("initial_altitude_m = 1.0", "initial_altitude_m = 1.0\nunknown_key = 1"),
    ];
    let sensors = ["gps", "barometer", "magnetometer", "mocap", "range", "battery", "rpm"];
    let keys = [keys.concat(), sensors.map(|kind| known_keys(end, &sensor(kind))).concat()].concat();
    assert!(keys.len() > 150, "{keys:?}");
    for key in keys {
        let is_named = [format!("`{key}`"), format!("`{key}."), format!(".{key}`")];
        let is_shown = [format!("{key} = "), format!("{key}.")];
        let is_there = is_named.iter().chain(&is_shown).any(|form| text.contains(form));
        assert!(is_there, "none of {pages:?} has `{key}`");
    }
}

#[test]
fn the_examples_of_the_documentation_are_toml() {
    let mut count = 0;
    for page in pages() {
        for example in code_blocks(&page, "toml") {
            toml::from_str::<toml::Table>(&example)
                .unwrap_or_else(|error| panic!("{page}: {error}\n{example}"));
            count += 1;
        }
    }
    assert!(count >= 60, "{count}");
}

/// A reader saves the blocks of the tutorial, one below the other, in the folder of the manifests.
#[test]
fn the_manifest_of_the_tutorial_passes() {
    let place = Place::new();
    let [vehicles, from] = ["vehicles", "../vehicles"].map(|path| format!("\"{path}/hummingbird.toml\""));
    let here = vehicles.replace("vehicles/", &repository("vehicles/"));
    let text = code_blocks("docs/manifest.md", "toml").join("\n").replace(&from, &here);
    let ended = place.call(&["run", &place.write("first.toml", text), "--record", "none"]).with_code(0);
    ended.prints(&["passed"]);
}

/// A reader saves the blocks of the page in a new project. The flights are cut to 4 s. `identify` takes minutes in a build of the
/// tests: tests/runs/identify.rs runs it on flights of its own.
#[test]
fn the_files_of_the_page_on_your_own_drone_are_flown_and_read() {
    let place = Place::new();
    let file = |name: &str| place.path(&format!("drone/{name}"));
    place.call(&["new", &place.path("drone")]).with_code(0);
    let blocks = code_blocks("docs/your-drone.md", "toml");
    let names = ["heavy.toml", "truth.toml", "practice.toml", "flights.toml", "blackbox.toml"];
    assert_eq!(blocks.len(), names.len());
    for (name, block) in names.iter().zip(&blocks) {
        place.write(&format!("drone/{name}"), block);
    }
    let heavy = format!("process.plant.vehicle={}", file("heavy.toml"));
    place.call(&["run", &file("hover.toml"), "--set", &heavy, "--record", "none"]).with_code(0);
    for (flight, seed) in [("flight1.mcap", "run.seed=1"), ("flight2.mcap", "run.seed=2")] {
        let (practice, recording) = (file("practice.toml"), file(flight));
        let words = ["run", &practice, "--record", &recording, "--set", seed, "--set", "run.duration_s=4"];
        place.call(&words).with_code(0);
    }
    let read = place.call(&["validate", &file("vehicle.toml"), &file("flights.toml"), "--steps-ahead", "1"]);
    read.with_code(0).prints(&["flight1", "flight2", "attitude (deg)"]);
}

/// The recipe of docs/plots.md: an exported flight is read as a log.
#[test]
fn an_exported_flight_is_read_as_the_page_on_tables_says() {
    let place = Place::new();
    let (recording, tables) = (place.path("hover.mcap"), place.path("tables"));
    // Too short for its conditions.
    let args = ["run", &repository("manifests/hover.toml"), "--record", &recording];
    place.call(&[&args[..], &["--set", "run.duration_s=2.5"]].concat()).with_code(1);
    place.call(&["export", &recording, "--csv", "--out", &tables]).with_code(0);
    let blocks = code_blocks("docs/plots.md", "toml");
    let flights = blocks.iter().find(|block| block.contains("[channels]")).unwrap();
    let vehicle = repository("vehicles/hummingbird.toml");
    let flights = place.write("flights.toml", flights.replace("vehicles/hummingbird.toml", &vehicle));
    let read = place.call(&["validate", &vehicle, &flights, "--steps-ahead", "1"]).with_code(0);
    read.prints(&["hover", "position (m)", "attitude (deg)", "rates (rad/s)"]);
    // The rows that the page shows are those of the file, in this order.
    let columns = fs::read_to_string(format!("{tables}/plant.state.columns.csv")).unwrap();
    let page = fs::read_to_string(repository("docs/plots.md")).unwrap();
    let (_, shown) = page.split_once("\n```\ncolumn,").unwrap();
    let shown = format!("column,{}", shown.split("\n```").next().unwrap());
    let found: Vec<&str> = columns.lines().filter(|line| shown.lines().any(|row| row == *line)).collect();
    assert_eq!(found, shown.lines().collect::<Vec<_>>(), "{columns}");
}
