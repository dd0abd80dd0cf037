//! Campaigns that go on from a checkpoint: the climb is flown once, and each flight is what `run --from --set` flies.

use crate::campaign::{last_height, rows};
use crate::support::{Place, repository};
use serde_json::Value;
use std::fs;

/// Key of the varied mass.
const MASS: &str = "process.plant.vehicle.body.mass";
/// Two conditions: one whose span ends before the checkpoint, and one behind it that light and heavy vehicles miss.
const CONDITIONS: &str = "[[measure]]\nname = \"lowest at first\"\ntopic = \"/plant/state\"\nfield = \"position.z\"\n\
                          unit = \"m\"\nto_s = 1.0\nstatistic = \"min\"\n\
                          [[pass]]\nname = \"height\"\ntopic = \"/plant/state\"\nfield = \"position.z\"\nunit = \"m\"\n\
                          from_s = 0.4\nstatistic = \"last\"\nmin = 0.99\nmax = 1.01\n";

/// A hover with other conditions, flown up to a checkpoint; its path.
fn climbed(place: &Place) -> String {
    let hover = fs::read_to_string(repository("manifests/hover.toml")).unwrap();
    let (head, _) = hover.split_once("[[pass]]").unwrap();
    let head = head.replace("../vehicles", &repository("vehicles"));
    let manifest = place.write("m.toml", format!("{head}{CONDITIONS}"));
    let args = ["run", &manifest, "--record", &place.path("a.mcap"), "--in-process"];
    let set = ["--set", "run.duration_s=1.4", "--checkpoint-every", "1200ms"];
    place.call(&[&args[..], &set].concat()).flown();
    place.path("a.1200.ckpt")
}

/// The figures of the run in `summary`, in the order of a campaign's columns.
fn figures(summary: &Value) -> Vec<u64> {
    let of = |key: &str| summary[key].as_array().unwrap().clone();
    let verdicts = of("pass").into_iter().chain(of("measures"));
    let values = verdicts.flat_map(|verdict| verdict["values"].as_array().unwrap().clone());
    values.map(|value| value.as_f64().unwrap().to_bits()).collect()
}

/// The figures of a row.
fn row_figures(row: &Value) -> Vec<u64> {
    let values = row["figures"].as_array().unwrap().iter();
    values.map(|value| value.as_f64().unwrap().to_bits()).collect()
}

#[test]
fn each_flight_of_a_fork_is_the_run_that_goes_on_with_its_values() {
    let place = Place::new();
    let checkpoint = climbed(&place);
    let [one, two] = ["one", "two"].map(|name| place.path(name));
    let vary = format!("{MASS}=factor:uniform:0.9,1.1");
    let fork = |folder: &str, workers: &str| {
        let args =
            ["run", "--from", &checkpoint, "--fork", "8", "--vary", &vary, "--set", "run.duration_s=1.5"];
        place
            .call(&[&args[..], &["--out", folder, "--workers", workers, "--json"]].concat())
            .with_code(0)
            .json()
    };
    let report = fork(&one, "1");
    fork(&two, "2");
    let flown = rows(&one);
    assert_eq!(flown.len(), 8);
    assert_eq!(flown, rows(&two));
    assert_eq!((&report["flights"], report["from"].as_str()), (&8.into(), Some(checkpoint.as_str())));
    let passed = report["passed"].as_u64().unwrap();
    assert!((1..8).contains(&passed), "{passed} of 8 passed: the condition tells nothing");
    // The first second was flown once, and every judge has seen it.
    assert!(flown.iter().all(|row| row["figures"][1] == flown[0]["figures"][1]));
    assert!((flown[0]["figures"][1].as_f64().unwrap() - 1.0).abs() < 0.05);
    for worst in &report["worst"].as_array().unwrap()[..3] {
        let flight = worst["flight"].as_u64().unwrap() as usize;
        let command = worst["run"].as_str().unwrap();
        let recording = place.path("single.mcap");
        let command = command.replace(&format!("flight-{flight}.mcap"), &recording) + " --json";
        assert!(command.contains(&format!("--from {checkpoint}")), "{command}");
        let single = place.call(&command.split(' ').skip(1).collect::<Vec<_>>());
        let single = single.with_code(i32::from(!flown[flight]["passed"].as_bool().unwrap())).json();
        assert_eq!(single["first_tick"], 1200);
        assert_eq!(figures(&single), row_figures(&flown[flight]), "flight {flight}");
        let height = flown[flight]["figures"][0].as_f64().unwrap();
        assert_eq!(last_height(&recording).to_bits(), height.to_bits());
    }
}

#[test]
fn a_fork_is_a_campaign_that_goes_on_where_it_was_cut_off() {
    let place = Place::new();
    let checkpoint = climbed(&place);
    let args = ["run", "--from", &checkpoint, "--fork", "4", "--vary", "run.seed=integers:1,9"];
    let fork = |more: &[&str]| place.call(&[&args[..], more].concat());
    fork(&[]).with_code(0).prints(&["4 of 4 flights passed", "report.html"]);
    let folder = place.path("a.1200.fork");
    let flown = rows(&folder);
    let heights: Vec<u64> = flown.iter().map(|row| row_figures(row)[0]).collect();
    assert!(heights[1..].iter().any(|height| *height != heights[0]), "no seed changes anything");
    let path = format!("{folder}/rows.jsonl");
    let text = fs::read_to_string(&path).unwrap();
    let kept: Vec<&str> = text.split_inclusive('\n').take(3).collect();
    fs::write(&path, kept.concat()).unwrap();
    // The file that it has written is that campaign.
    let file = format!("{folder}/campaign.toml");
    place.call(&["campaign", &file, "--out", &folder, "--workers", "1"]).with_code(0).prints(&["4 of 4"]);
    assert_eq!(rows(&folder), flown);
    assert!(fs::read(format!("{folder}/flights.parquet")).unwrap().starts_with(b"PAR1"));
    let again =
        place.call(&["campaign", &file, "--out", &folder, "--fly", "2", "--json"]).with_code(0).json();
    assert_eq!(figures(&again), row_figures(&flown[2]));
    let quiet = fork(&["--quiet", "--require", "pass_rate >= 0.9 at 95 %"]).with_code(1);
    quiet.says(&["not met"]);
    // The folder and the checkpoint may be moved together.
    let text = fs::read_to_string(&file).unwrap();
    assert!(text.starts_with("from = \"../a.1200.ckpt\"\n"), "{text}");
    let moved = place.path("moved");
    fs::create_dir(&moved).unwrap();
    let names = ["a.1200.ckpt", "a.1200.fork"];
    names.iter().for_each(|name| fs::rename(place.path(name), format!("{moved}/{name}")).unwrap());
    let file = format!("{moved}/a.1200.fork/campaign.toml");
    let folder = format!("{moved}/a.1200.fork");
    place.call(&["campaign", &file, "--out", &folder]).with_code(0).prints(&["4 of 4"]);
    names.iter().for_each(|name| fs::rename(format!("{moved}/{name}"), place.path(name)).unwrap());
    // The number of checkpoints that are kept changes no flight.
    let manifest = place.path("m.toml");
    let args = ["run", &manifest, "--record", &place.path("a.mcap"), "--in-process"];
    let set = ["--set", "run.duration_s=1.4", "--checkpoint-every", "1200ms", "--keep", "2"];
    place.call(&[&args[..], &set].concat()).flown();
    fork(&[]).with_code(0).prints(&["4 of 4"]);
    // Another checkpoint is another campaign.
    let args = ["run", &manifest, "--record", &place.path("a.mcap"), "--in-process", "--set", "run.seed=5"];
    let set = ["--set", "run.duration_s=1.4", "--checkpoint-every", "1200ms"];
    place.call(&[&args[..], &set].concat()).flown();
    fork(&[]).with_code(2).says(&["flown with other inputs"]);
}

/// The flight has the values of the run that wrote the checkpoint, `run.checkpoint_every_s` among them.
#[test]
fn a_flight_that_is_flown_again_names_the_checkpoints_that_it_writes() {
    let place = Place::new();
    let checkpoint = climbed(&place);
    let out = place.path("out");
    let fork = ["run", "--from", &checkpoint, "--fork", "1", "--vary", "run.seed=integers:1,9"];
    let set = ["--set", "run.duration_s=2.5", "--out", &out];
    place.call(&[&fork[..], &set].concat()).with_code(0);
    let names = |ending: &str| {
        let names =
            fs::read_dir(&out).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
        names.filter(|name| name.ends_with(ending)).collect::<Vec<_>>()
    };
    assert!(names(".ckpt").is_empty(), "flights of a campaign write no checkpoints");
    let again =
        place.call(&["campaign", &format!("{out}/campaign.toml"), "--out", &out, "--fly", "0"]).flown();
    again.prints(&["checkpoints: 1, the last ", "/flight-0.2400.ckpt"]);
    // docs/campaigns.md lists both.
    assert_eq!(
        (names(".ckpt"), names(".mcap")),
        (vec!["flight-0.2400.ckpt".to_owned()], vec!["flight-0.mcap".to_owned()])
    );
}

#[test]
fn what_cannot_vary_behind_a_checkpoint_is_refused_in_words() {
    let place = Place::new();
    let checkpoint = climbed(&place);
    let out = place.path("out");
    let refused = |more: &[&str], says: &str| {
        let args = ["run", "--from", &checkpoint, "--fork", "2", "--out", &out];
        let ended = place.call(&[&args[..], more].concat()).with_code(2);
        ended.says(&[says]);
        assert!(!ended.to_string().contains("panicked"), "{ended}");
    };
    let start = "`process.plant.parameters.initial_yaw_deg` counts at the start of a run alone, and this one goes on from tick 1200";
    refused(&["--vary", "process.plant.parameters.initial_yaw_deg=uniform:0,90"], start);
    refused(&["--set", "process.plant.parameters.initial_yaw_deg=3"], start);
    let initial = "process.plant.inputs.command.initial={ command = [1.0, 2.0, 3.0, 4.0] }";
    refused(&["--set", initial], "`process.plant.inputs.command.initial` counts at the start");
    refused(
        &["--vary", "process.ekf.parameters.delay_max_ms=values:600"],
        "has another memory by another value",
    );
    refused(&["--vary", "run.rate_hz=values:500"], "a tick of the checkpoint is 1000000 ns");
    refused(&["--set", "run.duration_s=1.0"], "raise run.duration_s");
    refused(&["--vary", "process.plnt.period_ticks=values:2"], "there is no process `plnt`");
    refused(&["--vary", "run.seed=even:1,2"], "KEY=DISTRIBUTION:VALUES");
    refused(&["--set", "run.seed=2"], "each flight has a seed of its own");
    refused(&["--record", "b.mcap"], "cannot be used with");
    place.call(&["run", &place.path("m.toml"), "--fork", "2"]).with_code(2).says(&["--from"]);
    place.call(&["run", "--from", &checkpoint, "--vary", "run.seed=values:1"]).with_code(2).says(&["--fork"]);
    // As of a single run.
    let single = ["run", "--from", &checkpoint, "--record", "none", "--in-process", "--set"];
    place
        .call(&[&single[..], &["process.plant.parameters.initial_yaw_deg=3"]].concat())
        .with_code(2)
        .says(&[start]);

    for (text, says) in [
        ("manifest = \"m.toml\"\nfrom = \"a.1200.ckpt\"", "the manifest is that of the checkpoint"),
        ("seed = 3", "a manifest, or a checkpoint as `from`"),
        ("from = \"m.toml\"", "no checkpoint"),
    ] {
        let file = place.write("c.toml", format!("{text}\nflights = 2\nvary = []\n"));
        place.call(&["campaign", &file, "--out", &out]).with_code(2).says(&[says]);
    }
    let measure = CONDITIONS.split("[[pass]]").next().unwrap();
    let file = place.write("c.toml", format!("from = \"a.1200.ckpt\"\nflights = 2\nvary = []\n{measure}"));
    place
        .call(&["campaign", &file, "--out", &out])
        .with_code(2)
        .says(&["lowest at first", "from the checkpoint on only"]);
    fs::write(place.path("m.toml"), fs::read_to_string(place.path("m.toml")).unwrap() + "# longer\n")
        .unwrap();
    refused(&[], "m.toml has changed since the checkpoint was written");
}
