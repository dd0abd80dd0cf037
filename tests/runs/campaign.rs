//! Campaigns: rows depend on the plan alone, failures are named and counted, and what was flown is never lost.

use crate::support::{Place, poll, repository};
use recorder::reader::Recording;
use rustix::process::Signal;
use serde_json::Value;
use std::fs;
use std::path::Path;

/// A campaign of short hovers of varied mass.
pub const HOVERS: &str = "flights = 12\nset = [\"run.duration_s=0.4\"]\n\
                      [[vary]]\nkey = \"process.plant.vehicle.body.mass\"\nas = \"factor\"\nuniform = [0.8, 1.2]\n\
                      [[measure]]\nname = \"height\"\ntopic = \"/plant/state\"\nfield = \"position.z\"\nunit = \"m\"\nstatistic = \"last\"\n";

/// Writes a campaign of the shipped hover without its conditions, which a short flight misses.
pub fn written(place: &Place, name: &str, text: &str) -> String {
    let hover = fs::read_to_string(repository("manifests/hover.toml")).unwrap();
    let (head, _) = hover.split_once("[[pass]]").unwrap();
    let vehicles = repository("vehicles");
    place.write("hover.toml", head.replace("../vehicles", &vehicles));
    place.write(name, format!("manifest = \"hover.toml\"\n{text}"))
}

/// The rows of a campaign by flight, without the host time.
pub fn rows(folder: &str) -> Vec<Value> {
    let text = fs::read_to_string(format!("{folder}/rows.jsonl")).unwrap();
    let mut rows: Vec<Value> = text.lines().skip(1).map(|line| serde_json::from_str(line).unwrap()).collect();
    rows.sort_by_key(|row| row["flight"].as_u64());
    for row in &mut rows {
        row.as_object_mut().unwrap().remove("wall_s");
    }
    rows
}

/// Height of the vehicle at the end of a recording, m.
pub fn last_height(recording: &str) -> f64 {
    let series =
        Recording::open(recording.as_ref()).unwrap().series(&[("/plant/state", "position.z")]).unwrap();
    *series[0].value.last().unwrap()
}

#[test]
fn the_rows_are_those_of_the_plan_however_many_workers_fly_and_whenever_it_is_interrupted() {
    let place = Place::new();
    let campaign = written(&place, "c.toml", HOVERS);
    let [one, three, cut] = ["one", "three", "cut"].map(|name| place.path(name));
    for (folder, workers) in [(&one, "1"), (&three, "3"), (&cut, "2")] {
        place
            .call(&["campaign", &campaign, "--out", folder, "--workers", workers])
            .with_code(0)
            .prints(&["12 of 12 flights passed"]);
    }
    let flown = rows(&one);
    assert_eq!(flown.len(), 12);
    assert_eq!(flown, rows(&three));
    let heights: Vec<f64> = flown.iter().map(|row| row["figures"][0].as_f64().unwrap()).collect();
    // A heavier vehicle sinks: the order of the heights is that of the masses.
    let mut by_mass: Vec<(f64, f64)> = flown
        .iter()
        .zip(&heights)
        .map(|(row, height)| (row["drawn"][0].as_f64().unwrap(), *height))
        .collect();
    by_mass.sort_by(|a, b| a.0.total_cmp(&b.0));
    assert!(by_mass.windows(2).all(|pair| pair[0].1 > pair[1].1), "{by_mass:?}");

    // As if it had been ended in the middle of a row: the rest is flown, and nothing else.
    let path = format!("{cut}/rows.jsonl");
    let text = fs::read_to_string(&path).unwrap();
    let kept: Vec<&str> = text.split_inclusive('\n').take(6).collect();
    fs::write(&path, format!("{}{{\"flight\": 11, \"pa", kept.concat())).unwrap();
    place.call(&["campaign", &campaign, "--out", &cut]).with_code(0).prints(&["12 of 12 flights passed"]);
    assert_eq!(flown, rows(&cut));
    assert!(fs::read_to_string(&path).unwrap().starts_with(&kept.concat()));
}

#[test]
fn a_campaign_that_is_interrupted_loses_and_falsifies_no_flight() {
    let place = Place::new();
    let campaign =
        written(&place, "c.toml", &HOVERS.replace("0.4\"", "10.0\"").replace("flights = 12", "flights = 6"));
    let folder = place.path("out");
    let mut launch = place.start(&["campaign", &campaign, "--out", &folder, "--workers", "2", "--json"]);
    poll("no flight ended", || {
        assert!(!launch.has_ended(), "it ended by itself");
        let text = fs::read_to_string(format!("{folder}/rows.jsonl")).unwrap_or_default();
        (text.lines().count() > 1).then_some(())
    });
    launch.signal(Signal::INT);
    let ended = launch.end().with_code(2);
    ended.says(&["the campaign was interrupted; the same command flies the other"]);
    assert!(ended.json()["requirement_met"].is_null());
    let before = rows(&folder);
    assert!((1..6).contains(&before.len()) && before.iter().all(|row| row["error"].is_null()), "{before:?}");
    place.call(&["campaign", &campaign, "--out", &folder]).with_code(0).prints(&["6 of 6 flights passed"]);
    let after = rows(&folder);
    assert!(before.iter().all(|row| after.contains(row)) && after.len() == 6);
}

#[test]
fn an_edited_vehicle_file_is_refused_in_a_folder_of_the_old_one() {
    let place = Place::new();
    let campaign = written(&place, "c.toml", &HOVERS.replace("flights = 12", "flights = 2"));
    let vehicle = fs::read_to_string(repository("vehicles/hummingbird.toml")).unwrap();
    place.write("v.toml", &vehicle);
    let text = fs::read_to_string(&campaign).unwrap();
    let set = "set = [\"process.plant.vehicle=v.toml\", ";
    place.write("c.toml", text.replace("set = [", set));
    let folder = place.path("out");
    place.call(&["campaign", &campaign, "--out", &folder]).with_code(0);
    place.write("v.toml", vehicle.replace("value = 0.480", "value = 0.500"));
    place.call(&["campaign", &campaign, "--out", &folder]).with_code(2).says(&["flown with other inputs"]);
}

#[test]
fn a_factor_acts_on_the_value_that_all_flights_have() {
    let place = Place::new();
    let text = HOVERS.replace("set = [", "set = [\"process.plant.vehicle.body.mass=1.0\", ");
    let campaign = written(&place, "c.toml", &text.replace("uniform = [0.8, 1.2]", "values = [1.5]"));
    let folder = place.path("out");
    let report = place.call(&["campaign", &campaign, "--out", &folder, "--json"]).with_code(0).json();
    let run = report["worst"][0]["run"].as_str().unwrap();
    assert!(run.contains("vehicle.body.mass=1.0 ") && run.ends_with("vehicle.body.mass=1.5"), "{run}");
}

#[test]
fn a_flight_is_flown_again_recorded_by_the_command_of_the_report() {
    let place = Place::new();
    let campaign = written(&place, "c.toml", HOVERS);
    let folder = place.path("out");
    let report = place.call(&["campaign", &campaign, "--out", &folder, "--json"]).with_code(0).json();
    let worst = &report["worst"][0];
    let command = worst["run"].as_str().unwrap();
    let flight = worst["flight"].as_u64().unwrap();
    let recording = place.path("again.mcap");
    let command = command.replace(&format!("flight-{flight}.mcap"), &recording);
    let ended = place.call(&command.split(' ').skip(1).collect::<Vec<_>>()).with_code(0);
    // The measures of the campaign file are not those of the manifest.
    assert!(!ended.output.contains("value  height"), "{ended}");
    let height = rows(&folder)[flight as usize]["figures"][0].as_f64().unwrap();
    assert_eq!(last_height(&recording).to_bits(), height.to_bits());

    let number = flight.to_string();
    place
        .call(&["campaign", &campaign, "--out", &folder, "--fly", &number])
        .with_code(0)
        .prints(&["value  height"]);
    let again = format!("{folder}/flight-{flight}.mcap");
    assert_eq!(last_height(&again).to_bits(), height.to_bits());
    let beyond = place.call(&["campaign", &campaign, "--out", &folder, "--fly", "12"]).with_code(2);
    beyond.says(&["there is no flight 12: the plan has the flights 0 to 11"]);
}

#[test]
fn flights_that_cannot_be_flown_are_counted_with_their_reasons() {
    let place = Place::new();
    // Half of the masses are negative.
    let text = HOVERS.replace("as = \"factor\"\nuniform = [0.8, 1.2]", "values = [-1.0, 0.48]");
    let campaign = written(&place, "c.toml", &text);
    let folder = place.path("out");
    place.call(&["campaign", &campaign, "--out", &folder]).with_code(0).prints(&[
        "6 of 12 flights passed",
        // One reason, whatever was drawn.
        "  6 flights without figures:\n    6 such as flight ",
        "`body.mass` must be a finite number above 0, found -1",
        // The unit of a figure.
        "height: 0",
        " m\n",
    ]);
    let broken = rows(&folder).into_iter().filter(|row| !row["error"].is_null()).count();
    assert_eq!(broken, 6);

    // No flight is that fast.
    let text = HOVERS.replace("flights = 12", "flights = 3\ntimeout_s_host = 0.001").replace("0.4", "400.0");
    let campaign = written(&place, "slow.toml", &text);
    let folder = place.path("slow");
    let ended = place.call(&["campaign", &campaign, "--out", &folder]).with_code(2);
    ended.prints(&["0 of 3 flights passed", "timeout_s_host"]);
    ended.says(&[
        "the host ended 3 flights, without which there is no verdict; the same command flies them again",
    ]);
    // Whatever they come to, no more than all pass; and half of none is met by none.
    let gate = |rate: &str| place.call(&["campaign", &campaign, "--out", &folder, "--require", rate]).code;
    assert_eq!(
        ["pass_rate >= 0", "pass_rate >= 0.9 at 95 %", "pass_rate >= 0.5"].map(gate),
        [Some(0), Some(1), Some(2)]
    );
}

#[test]
fn a_plan_is_flown_whose_first_or_last_flights_are_refused() {
    let place = Place::new();
    let text = HOVERS.replace("flights = 12", "sampling = \"grid\"").replace("as = \"factor\"\n", "");
    let seeds = "[[vary]]\nkey = \"run.seed\"\nintegers = [1, 4]\n[[measure]]";
    let text = text.replace("[[measure]]", seeds);
    let grid = |values: &str| text.replace("uniform = [0.8, 1.2]", &format!("values = {values}"));
    let (out, cut) = (place.path("out"), place.path("cut"));
    let campaign = written(&place, "first.toml", &grid("[-0.1, 0.48]"));
    place.call(&["campaign", &campaign, "--out", &out]).with_code(0).prints(&["4 of 8 flights passed"]);

    // Interrupted where all others are refused.
    let campaign = written(&place, "last.toml", &grid("[0.48, -0.1]"));
    let fly = || place.call(&["campaign", &campaign, "--out", &cut, "--workers", "1"]);
    fly().with_code(0).prints(&["4 of 8 flights passed"]);
    let path = format!("{cut}/rows.jsonl");
    let text = fs::read_to_string(&path).unwrap();
    fs::write(&path, text.split_inclusive('\n').take(6).collect::<String>()).unwrap();
    fly().with_code(0).prints(&["4 of 8 flights passed"]);
    assert_eq!(rows(&cut).len(), 8);

    let campaign = written(&place, "none.toml", &grid("[-0.2, -0.1]"));
    let ended = place.call(&["campaign", &campaign, "--out", &place.path("none")]).with_code(2);
    ended.says(&["of the plan's 8 flights 8 were checked, which are all refused; flight 0", "mass"]);
}

#[test]
fn a_requirement_decides_the_exit_code() {
    let place = Place::new();
    let campaign = written(&place, "c.toml", HOVERS);
    let folder = place.path("out");
    let gate =
        |condition: &str| place.call(&["campaign", &campaign, "--out", &folder, "--require", condition]);
    gate("pass_rate >= 0.9").with_code(0);
    // Twelve flights without a failure show 0.05^(1/12) = 0.779.
    gate("pass_rate >= 0.77 at 95 %").with_code(0);
    gate("pass_rate >= 0.79 at 95 %")
        .with_code(1)
        .says(&["not met: pass_rate >= 0.79 at 95 %; 12 of 12 flights passed, which shows a pass rate of at least 0.779","one-sided lower limit at 95 %"]);
    gate("pass_rate > 1").with_code(2).says(&["expected `pass_rate >= 0.99 at 95 %`"]);
}

#[test]
fn what_cannot_be_flown_at_all_is_refused_before_the_first_flight() {
    let place = Place::new();
    let vary = |key: &str| HOVERS.replace("process.plant.vehicle.body.mass", key);
    for (text, says) in [
        (vary("process.plnt.vehicle.body.mass"), "there is no process `plnt`"),
        (vary("process.plant.vehicle.body.mas").replace("as = \"factor\"\n", ""), "mas"),
        (
            vary("process.plnt.vehicle.body.mass").replace("as = \"factor\"\n", ""),
            "there is no process `plnt`",
        ),
        (vary("run.sed").replace("as = \"factor\"\n", ""), "sed"),
        (HOVERS.replace("uniform = [0.8, 1.2]", "uniform = [1.2, 0.8]"), "a lower limit below the upper one"),
        (vary("process.plant.vehicle.rotors.0.position[2]"), "write `position.2`"),
        (HOVERS.replace("position.z", "position.w"), "c.toml:11:9: measure `height`"),
        (HOVERS.replace("statistic = \"last\"", "statistic = \"latest\""), "c.toml:13:13: "),
        // Also if the campaign itself states the duration.
        (
            format!("{HOVERS}from_s = 0.5\n"),
            "c.toml:14:10: measure `height`: `from_s` is 0.5 s, and the run ends at 0.4 s",
        ),
        (format!("figures = [\"heigth\"]\n{HOVERS}"), "c.toml:2:12: no flight has a figure `heigth`"),
        (HOVERS.replace("name = \"height\"", "name = \"mass\""), "`mass` is the name of another column"),
        (
            HOVERS.replace("[\"run.dur", "[\"process.controller.gains=none.toml\", \"run.dur"),
            "check the path; here, a relative path starts at the folder of the manifest",
        ),
        (HOVERS.replace("[\"run.dur", "[\"run.seed=5\", \"run.dur"), "each flight has a seed of its own"),
        (HOVERS.split("[[measure]]").next().unwrap().to_owned(), "neither [[pass]] nor [[measure]]"),
    ] {
        let campaign = written(&place, "c.toml", &text);
        let ended = place.call(&["campaign", &campaign, "--out", &place.path("out")]).with_code(2);
        ended.says(&[says]);
        assert!(!ended.to_string().contains("panicked"), "{ended}");
    }
    // A key of a file: the place in the campaign file, and no folder.
    let text = vary("process.plant.vehicle.body.mas").replace("as = \"factor\"\n", "");
    let (campaign, folder) = (written(&place, "key.toml", &text), place.path("no-folder"));
    let ended = place.call(&["campaign", &campaign, "--out", &folder]).with_code(2);
    let line =
        fs::read_to_string(&campaign).unwrap().lines().position(|line| line.starts_with("key = ")).unwrap()
            + 1;
    ended.says(&["unknown key `body.mas`", &format!("{campaign}:{line}:7: process.plant.vehicle.body.mas=")]);
    assert!(!ended.error.contains("--set") && !ended.error.contains("@plant"), "{ended}");
    assert!(!Path::new(&folder).exists());
    // A controller in a process of its own, and a swap.
    let swap = HOVERS.replace("set = [\"run.duration_s=0.4\"]\n", "");
    place.write("swap.toml", format!("include = [{:?}]", repository("manifests/swap-gains.toml")));
    let campaign = place.write("swap-c.toml", format!("manifest = \"swap.toml\"\n{swap}"));
    place
        .call(&["campaign", &campaign, "--out", &place.path("swap")])
        .with_code(2)
        .says(&["needs processes"]);
    // A folder of somebody else.
    let campaign = written(&place, "c.toml", HOVERS);
    place.call(&["campaign", &campaign, "--out", &place.path("")]).with_code(2).says(&["holds no campaign"]);
    // A folder whose flights are shorter.
    let campaign = written(&place, "c.toml", HOVERS);
    let folder = place.path("other");
    place.call(&["campaign", &campaign, "--out", &folder]).with_code(0);
    let campaign = written(&place, "c.toml", &HOVERS.replace("0.4\"", "0.5\""));
    place.call(&["campaign", &campaign, "--out", &folder]).with_code(2).says(&["flown with other inputs"]);
}

#[test]
fn an_unknown_key_of_a_file_is_told_without_a_value_and_without_detours_in_paths() {
    let place = Place::new();
    let gains = repository("controllers/gains/wall-stop.toml");
    for (key, says) in [
        (
            "hold.frequency",
            "process.controller.gains.hold.frequency: unknown key `hold.frequency`".to_owned(),
        ),
        ("holdx.frequency", "process.controller.gains.holdx.frequency: unknown key `holdx`".to_owned()),
        ("holdx.frequency", "did you mean `hold`?".to_owned()),
        ("hold.distance.value.x", format!("{gains} shows the keys")),
    ] {
        // The manifest includes one in another folder, which names the gains file from there.
        let text = format!(
            "manifest = {:?}\nflights = 2\n[[vary]]\nkey = \"process.controller.gains.{key}\"\nas = \"factor\"\nuniform = [0.9, 1.1]\n",
            repository("manifests/wall-stop.toml")
        );
        let campaign = place.write("c.toml", text);
        let ended = place.call(&["campaign", &campaign, "--out", &place.path("out")]).with_code(2);
        ended.says(&[&says]);
        assert!(!ended.error.contains("=1") && !ended.error.contains("/../"), "{ended}");
    }
}
