//! Results of campaigns: the same bytes, of one build, and a summary even where a file cannot be written.

use crate::campaign::{HOVERS, rows, written};
use crate::support::{HUMMINGBUS, Load, Place, repository};
use serde_json::json;
use std::fs::{self, OpenOptions};
use std::io::Write as _;
use std::process::Command;

fn table(folder: &str) -> Vec<u8> {
    fs::read(format!("{folder}/flights.parquet")).unwrap()
}

#[test]
fn the_table_is_the_same_bytes_however_many_workers_fly_it_interrupted_and_on_a_loaded_machine() {
    let place = Place::new();
    let campaign = written(&place, "c.toml", HOVERS);
    let fly = |name: &str, workers: &str| {
        let folder = place.path(name);
        place.call(&["campaign", &campaign, "--out", &folder, "--workers", workers]).with_code(0);
        folder
    };
    let one = table(&fly("one", "1"));
    let two = fly("two", "2");
    assert!(one == table(&two), "two workers wrote another table than one");

    let path = format!("{two}/rows.jsonl");
    let text = fs::read_to_string(&path).unwrap();
    fs::write(&path, text.split_inclusive('\n').take(5).collect::<String>()).unwrap();
    fs::remove_file(format!("{two}/flights.parquet")).unwrap();
    assert!(one == table(&fly("two", "2")), "a continued campaign wrote another table");

    let load = Load::of_threads(8);
    assert!(one == table(&fly("loaded", "2")), "a loaded machine wrote another table");
    drop(load);
}

#[test]
fn the_table_of_refused_flights_is_the_same_bytes_from_any_folder_and_names_files_that_exist() {
    let place = Place::new();
    // Masses below 0, and masses that the rotors cannot let down.
    let text = HOVERS
        .replace("flights = 12", "flights = 40")
        .replace("as = \"factor\"\nuniform = [0.8, 1.2]", "uniform = [-0.6, 0.6]");
    let campaign = written(&place, "c.toml", &text);
    let fly = |folder: &str, file: &str, out: &str| {
        let mut command = Command::new(HUMMINGBUS);
        command.args(["campaign", file, "--out", out]).current_dir(folder);
        place.launch(command).end().with_code(0);
    };
    let (here, there) = (place.path("here"), place.path("there"));
    fly(&place.path(""), "c.toml", "here");
    fly(&repository(""), &campaign, &there);
    assert!(table(&here) == table(&there), "another folder gave another table");
    let errors: Vec<String> =
        rows(&here).iter().filter_map(|row| Some(row["error"].as_str()?.to_owned())).collect();
    for says in ["c.toml:5:7: process.plant.vehicle.body.mass=-", "cannot come down"] {
        assert!(errors.iter().any(|error| error.contains(says)), "no {says} in {errors:#?}");
    }
    for error in errors {
        assert!(error.starts_with("hover.toml:") && !error.contains("@plant"), "{error}");
    }
}

/// A program of another build: the bytes behind an executable change what it is, and not what it does.
pub fn other_build(place: &Place) -> String {
    let path = place.path("other");
    fs::copy(HUMMINGBUS, &path).unwrap();
    OpenOptions::new().append(true).open(&path).unwrap().write_all(b"another").unwrap();
    path
}

#[test]
fn rows_of_two_builds_are_not_mixed() {
    let place = Place::new();
    let campaign = written(&place, "c.toml", HOVERS);
    let out = place.path("out");
    let report = place.call(&["campaign", &campaign, "--out", &out, "--json"]).with_code(0).json();
    let version = report["version"].as_str().unwrap();
    assert!(version.starts_with(env!("CARGO_PKG_VERSION")), "{version}");
    let mut other = Command::new(other_build(&place));
    other.args(["campaign", &campaign, "--out", &out]);
    let ended = place.launch(other).end().with_code(2);
    ended.says(&[
        &format!(
            "its flights were flown by hummingbus {version}, this is hummingbus {}",
            env!("CARGO_PKG_VERSION")
        ),
        "go on with that build, choose another --out, or remove the file",
    ]);
    assert_eq!(rows(&out).len(), 12);
    // One flight is flown again by any build: a program that was mended, for example.
    let mut other = Command::new(other_build(&place));
    other.args(["campaign", &campaign, "--out", &out, "--fly", "3"]);
    place.launch(other).end().with_code(0);
    assert_eq!(rows(&out).len(), 12);
}

#[test]
fn a_table_that_cannot_be_written_costs_neither_the_summary_nor_the_verdict() {
    let place = Place::new();
    let campaign = written(&place, "c.toml", HOVERS);
    let out = place.path("out");
    for name in ["report.html/x", "flights.parquet/x"] {
        place.call(&["campaign", &campaign, "--out", &out, "--plan-only"]).with_code(0);
        fs::create_dir_all(format!("{out}/{name}")).unwrap();
    }
    let gate = ["campaign", &campaign, "--out", &out, "--require", "pass_rate >= 0.9 at 95 %"];
    let ended = place.call(&gate).with_code(2);
    ended.prints(&["12 of 12 flights passed"]);
    assert!(!ended.output.contains("report: "), "{ended}");
    ended.says(&[
        "cannot write",
        "report.html",
        "flights.parquet",
        "not met: pass_rate",
        "2 of 3 files were not written",
    ]);
    assert!(fs::exists(format!("{out}/report.json")).unwrap());
}

#[test]
fn the_worst_flights_are_flown_again_from_any_folder() {
    let place = Place::new();
    written(&place, "c.toml", HOVERS);
    let from_place = |args: &[&str]| {
        let mut command = Command::new(HUMMINGBUS);
        command.args(args).current_dir(place.path(""));
        place.launch(command).end()
    };
    let ended = from_place(&["campaign", "c.toml", "--out", "out"]).with_code(0);
    ended.prints(&["each is flown again, recorded, by: hummingbus campaign /", " --fly FLIGHT"]);
    let report = from_place(&["campaign", "c.toml", "--out", "out", "--json"]).with_code(0).json();
    assert!(report["requirement_met"].is_null());
    let worst = report["worst"].as_array().unwrap();
    assert_eq!(worst.len(), 10);
    for key in ["command", "run"] {
        let command = worst[9][key].as_str().unwrap();
        let recording = place.path(&format!("{key}.mcap"));
        let flight = format!("flight-{}.mcap", worst[9]["flight"]);
        let command = command.replace(&flight, &recording);
        // From the folder of the tests, not from that of the campaign.
        place.call(&command.split(' ').skip(1).collect::<Vec<_>>()).with_code(0);
    }
}

#[test]
fn a_report_keeps_the_figures_that_the_campaign_chooses() {
    let place = Place::new();
    let more = "[[measure]]\nname = \"east\"\ntopic = \"/plant/state\"\nfield = \"position.x\"\nunit = \"m\"\nstatistic = \"every\"\n";
    let text = format!("{HOVERS}{more}");
    let out = place.path("out");
    let fly = |figures: &str| {
        let campaign = written(&place, "c.toml", &format!("{figures}{text}"));
        place.call(&["campaign", &campaign, "--out", &out, "--json"]).with_code(0).json()
    };
    let names = |report: &serde_json::Value| {
        let figures = report["figures"].as_array().unwrap().clone();
        figures.into_iter().map(|figure| figure["figure"].as_str().unwrap().to_owned()).collect::<Vec<_>>()
    };
    let report = fly("");
    assert_eq!(names(&report), ["height", "east (min)", "east (max)"]);
    let units: Vec<_> = report["figures"].as_array().unwrap().iter().map(|figure| &figure["unit"]).collect();
    assert_eq!(units, ["m", "m", "m"]);
    // Metadata of the table.
    let parquet = String::from_utf8_lossy(&table(&out)).into_owned();
    assert!(["unit of height", "unit of east (min)"].iter().all(|key| parquet.contains(key)));
    let wide = table(&out).len();
    let unknown = written(&place, "unknown.toml", &format!("figures = [\"heigth\"]\n{text}"));
    let ended = place.call(&["campaign", &unknown, "--out", &out]).with_code(2);
    ended.says(&["unknown.toml:2:12: no flight has a figure `heigth`", "did you mean `height`?"]);
    // Another choice needs no flight.
    let before = fs::read_to_string(format!("{out}/rows.jsonl")).unwrap();
    assert_eq!(names(&fly("figures = [\"east (max)\"]\n")), ["east (max)"]);
    assert!(table(&out).len() < wide);
    assert_eq!(before, fs::read_to_string(format!("{out}/rows.jsonl")).unwrap());
}

#[test]
fn an_effect_on_both_sides_of_a_range_is_an_influence() {
    let place = Place::new();
    let campaign = written(&place, "c.toml", &HOVERS.replace("flights = 12", "flights = 60"));
    // Light vehicles are too high, and heavy ones are too low.
    let hover = fs::read_to_string(place.path("hover.toml")).unwrap();
    let pass = "[[pass]]\nname = \"level\"\ntopic = \"/plant/state\"\nfield = \"position.z\"\nunit = \"m\"\nstatistic = \"last\"\nmin = 0.99\nmax = 1.01\n";
    place.write("hover.toml", format!("{hover}\n{pass}"));
    let args = ["campaign", &campaign, "--out", &place.path("out")];
    place.call(&args).with_code(0).prints(&["  pass rates by `mass`: 0.0 % from 0."]);
    let report = place.call(&[&args[..], &["--json"]].concat()).with_code(0).json();
    let groups = report["pass_rates"][0]["groups"].as_array().unwrap();
    let passed: Vec<u64> = groups.iter().map(|group| group["passed"].as_u64().unwrap()).collect();
    assert_eq!(passed.len(), 5, "{report}");
    assert!(passed[0] == 0 && passed[2] > 0 && passed[4] == 0, "{passed:?}");
    assert_eq!(passed.iter().sum::<u64>(), report["passed"].as_u64().unwrap());
    let influences = report["influences"].as_array().unwrap();
    let found = influences.iter().find(|it| it["figure"] == "passed").unwrap();
    assert_eq!((&found["varied"], &found["test"]), (&json!("mass"), &json!("pass-rates")), "{report}");
}

#[test]
fn a_figure_that_no_flight_has_is_told() {
    let place = Place::new();
    let campaign = written(&place, "c.toml", HOVERS);
    let measure = "[[measure]]\nname = \"late\"\ntopic = \"/plant/state\"\nfield = \"position.z\"\nunit = \"m\"\nstatistic = \"last\"\nfrom_s = 0.3\n";
    // A measure of the manifest, which the campaign cuts short.
    let hover = fs::read_to_string(place.path("hover.toml")).unwrap();
    place.write("hover.toml", format!("{hover}\n{}", measure.replace("0.3", "5.0")));
    let ended = place.call(&["campaign", &campaign, "--out", &place.path("cut")]).with_code(0);
    ended.prints(&["  warning: no flight has a value of `late`", "    late: no value"]);
    assert!(!ended.output.contains("a value of `height`"), "{ended}");

    // Of drawn durations some are long enough: nothing is refused, and some flights have the figure.
    let text = HOVERS
        .replace("run.duration_s=0.4", "run.duration_s=0.2")
        .replace("process.plant.vehicle.body.mass\"\nas = \"factor\"", "run.duration_s\"")
        .replace("uniform = [0.8, 1.2]", "values = [0.2, 0.4]");
    let campaign = written(&place, "varied.toml", &format!("{text}{measure}"));
    let ended = place.call(&["campaign", &campaign, "--out", &place.path("varied")]).with_code(0);
    ended.prints(&["12 of 12 flights passed", "    late: "]);
    assert!(!ended.output.contains("no value") && !ended.output.contains("warning"), "{ended}");
}

/// Vehicles side by side: each flight of one is a flight of the other, and all results have their names.
#[test]
fn texts_are_varied_and_told_apart_in_every_result() {
    let place = Place::new();
    let (light, heavy) = ("light.toml", "heavy.toml");
    let vehicle = fs::read_to_string(repository("vehicles/hummingbird.toml")).unwrap();
    place.write(light, &vehicle);
    place.write(heavy, vehicle.replace("value = 0.480", "value = 0.500"));
    let text = "sampling = \"grid\"\nset = [\"run.duration_s=0.4\"]\n\
                [[vary]]\nkey = \"process.plant.vehicle\"\nvalues = [\"light.toml\", \"heavy.toml\"]\n\
                [[vary]]\nkey = \"run.seed\"\nintegers = [1, 3]\n\
                [[measure]]\nname = \"height\"\ntopic = \"/plant/state\"\nfield = \"position.z\"\nunit = \"m\"\nstatistic = \"last\"\n";
    let (campaign, folder) = (written(&place, "c.toml", text), place.path("out"));
    let report = place.call(&["campaign", &campaign, "--out", &folder, "--json"]).with_code(0).json();
    let plan = fs::read_to_string(format!("{folder}/plan.csv")).unwrap();
    let lines: Vec<String> =
        [light, heavy].iter().flat_map(|name| (1..=3).map(move |seed| format!("{name},{seed}"))).collect();
    let numbered = lines.iter().enumerate().map(|(flight, line)| format!("{flight},{line}\n"));
    assert_eq!(plan, format!("flight,vehicle,seed\n{}", numbered.collect::<String>()));
    let heights: Vec<f64> = rows(&folder).iter().map(|row| row["figures"][0].as_f64().unwrap()).collect();
    // The same noise, a heavier vehicle.
    assert!((0..3).all(|flight| heights[flight] > heights[flight + 3]), "{heights:?}");
    let choices = report["choices"].as_array().unwrap();
    let told: Vec<_> =
        choices.iter().map(|it| (it["choice"].as_str().unwrap(), it["flights"].as_u64().unwrap())).collect();
    assert_eq!(told, [(light, 3), (heavy, 3)]);
    let mut of_light = heights[..3].to_vec();
    of_light.sort_by(f64::total_cmp);
    assert_eq!(choices[0]["medians"][0].as_f64(), Some(of_light[1]));
    assert!(report["influences"].as_array().unwrap().iter().all(|it| it["varied"] != "vehicle"), "{report}");
    let worst = report["worst"].as_array().unwrap().iter().find(|worst| worst["flight"] == 4).unwrap();
    assert!(worst["run"].as_str().unwrap().contains("'process.plant.vehicle=\"heavy.toml\"'"), "{worst}");
    // A text that is none of the key's is refused before anything is flown.
    let wrong = written(&place, "wrong.toml", &text.replace("\"heavy.toml\"", "\"heavi.toml\""));
    let ended = place.call(&["campaign", &wrong, "--out", &place.path("none")]).with_code(2);
    ended.says(&["no flight with \"heavi.toml\" as `vehicle` can be flown"]);
}
