//! Tuning gains: the same gains however many workers fly, judged by other flights, and refusals in words.

use crate::campaign::{rows, written};
use crate::support::{Place, poll, repository};
use rustix::process::Signal;
use std::fs;

/// A tuning of the height of short hovers, whose damping is far too weak at first.
const TUNING: &str = "flights = 3\nset = [\"run.duration_s=3.0\", \"process.controller.gains=weak.toml\"]\n\
    [[measure]]\nname = \"height error\"\ntopic = \"/plant/state\"\nfield = \"position.z\"\n\
    minus = { topic = \"/pilot/set_point\", field = \"altitude\" }\nunit = \"m\"\nstatistic = \"rms\"\n\
    [tune]\ngains = \"process.controller.gains\"\nheld_out = 4\ngenerations = 4\npopulation = 6\n\
    [[tune.gain]]\nname = \"damping\"\nkey = \"altitude.derivative\"\nfactor = [0.5, 8.0]\n\
    [[tune.minimise]]\nfigure = \"height error\"\nweight = 2.0\n";

fn tuning(place: &Place, name: &str, text: &str) -> String {
    let gains = fs::read_to_string(repository("controllers/gains/pid.toml")).unwrap();
    let weak = gains.replace(
        "derivative = { value = 6, unit = \"1/s\", source = \"tuned; thesis Table 5.1: 10\" }",
        "derivative = { value = 1.5, unit = \"1/s\", source = \"weak\" }",
    );
    assert_ne!(weak, gains);
    place.write("weak.toml", weak);
    written(place, name, text)
}

#[test]
fn the_gains_are_those_of_the_seed_however_many_workers_fly_and_cost_less_on_other_flights() {
    let place = Place::new();
    let file = tuning(&place, "t.toml", TUNING);
    let (one, three) = (place.path("one.toml"), place.path("three.toml"));
    let tune = |out: &str, workers: &str| {
        let args = ["tune", &file, "--out", out, "--workers", workers, "--json"];
        place.call(&args).with_code(0).json()
    };
    let outcome = tune(&one, "1");
    assert_eq!(tune(&three, "3"), outcome);
    let text = fs::read_to_string(&one).unwrap();
    assert_eq!(fs::read_to_string(&three).unwrap(), text);

    let number = |pointer: &str| outcome.pointer(pointer).unwrap().as_f64().unwrap();
    assert_eq!(number("/gains/0/before"), 1.5);
    assert_eq!((number("/held_out/flights"), number("/tuned_on/flights")), (4.0, 3.0));
    assert!(number("/held_out/costs/after") < 0.9 * number("/held_out/costs/before"), "{outcome}");
    // Costs are the weight times the figure.
    let figure = number("/held_out/figures/0/1/after");
    assert!((number("/held_out/costs/after") - 2.0 * figure).abs() < 1e-12, "{outcome}");

    let after = number("/gains/0/after");
    for line in [
        "# Written by hummingbus tune.".to_owned(),
        "# weak.toml, tuned by t.toml".to_owned(),
        "# On 4 other flights (plan of seed 2), before and after:".to_owned(),
        format!(
            "derivative = {{ value = {after}, unit = \"1/s\", source = \"hummingbus tune t.toml; before: 1.5\" }}"
        ),
    ] {
        assert!(text.contains(&line), "no {line} in\n{text}");
    }
    // It is a gains file: its flights cost what the tuned ones do.
    let text = TUNING.replace("weak.toml", "one.toml").replace("flights = 3", "flights = 4\nseed = 2");
    let again = tuning(&place, "again.toml", &text);
    let args = ["campaign", &again, "--out", &place.path("again"), "--json"];
    place.call(&args).with_code(0);
    let heights: Vec<f64> =
        rows(&place.path("again")).iter().map(|row| row["figures"][0].as_f64().unwrap()).collect();
    assert_eq!(heights.iter().sum::<f64>() / 4.0, figure);
}

#[test]
fn another_seed_of_the_optimiser_flies_other_candidates() {
    let place = Place::new();
    let tune = |name: &str, seed: &str| {
        let text = TUNING.replace("generations = 4", &format!("generations = 1\nseed = {seed}"));
        let file = tuning(&place, name, &text);
        let out = place.path("gains.toml");
        // One generation may find nothing.
        place.call(&["tune", &file, "--out", &out, "--json"]).json()["gains"].clone()
    };
    assert_ne!(tune("a.toml", "1"), tune("b.toml", "2"));
}

#[test]
fn gains_that_are_not_better_on_other_flights_are_not_written() {
    let place = Place::new();
    // No gain changes what the pilot wants.
    let text = TUNING
        .replace(
            "field = \"position.z\"\nminus = { topic = \"/pilot/set_point\", field = \"altitude\" }\n",
            "field = \"altitude\"\n",
        )
        .replace("/plant/state", "/pilot/set_point")
        .replace("generations = 4", "generations = 1");
    let file = tuning(&place, "t.toml", &text);
    let out = place.path("gains.toml");
    place
        .call(&["tune", &file, "--out", &out])
        .with_code(1)
        .prints(&["no gains were written: today's are as good or better"]);
    assert!(!fs::exists(&out).unwrap());
}

#[test]
fn an_interrupted_tuning_prints_the_best_gains_so_far() {
    let place = Place::new();
    let file = tuning(&place, "t.toml", &TUNING.replace("generations = 4", "generations = 1000"));
    let out = place.path("gains.toml");
    for signal in [Signal::INT, Signal::TERM] {
        let mut launch = place.start(&["tune", &file, "--out", &out]);
        poll("no generation ended", || {
            assert!(!launch.has_ended(), "it ended by itself: {}", launch.errors());
            launch.errors().contains("tuning: generation 1 of 1000, lowest costs").then_some(())
        });
        launch.signal(signal);
        let ended = launch.end().with_code(2);
        ended.says(&[
            "the tuning was interrupted after generation",
            "of 1000; no file was written, since other flights have not judged its gains",
        ]);
        ended.prints(&[
            "the best one so far:",
            "damping: 1.5 → ",
            "costs on the flights that it was tuned on: ",
        ]);
    }
    assert!(!fs::exists(&out).unwrap());
}

#[test]
fn the_result_has_units() {
    let place = Place::new();
    let file = tuning(&place, "t.toml", &TUNING.replace("generations = 4", "generations = 2"));
    let out = place.path("gains.toml");
    let ended = place.call(&["tune", &file, "--out", &out]).with_code(0);
    for (name, unit) in [("damping: ", " 1/s"), ("height error: ", " m")] {
        let line = ended.output.lines().find(|line| line.contains(name)).unwrap();
        assert!(line.ends_with(unit), "{ended}");
    }
    let text = fs::read_to_string(&out).unwrap();
    let line = text.lines().find(|line| line.contains("height error: ")).unwrap();
    assert!(line.starts_with('#') && line.ends_with(" m"), "{text}");
}

#[test]
fn what_cannot_be_tuned_is_refused_in_words() {
    let place = Place::new();
    let out = place.path("gains.toml");
    for (from, to, says) in [
        ("[tune]\n", "[[vary]]\n", "unknown"),
        (
            "figure = \"height error\"",
            "figure = \"hight error\"",
            "there is no figure `hight error` to minimise; the figures are: height error",
        ),
        ("altitude.derivative", "altitude.derivativ", "the gains file has no number `altitude.derivativ`"),
        (
            ", \"process.controller.gains=weak.toml\"",
            "",
            "names no gains file; add process.controller.gains=\"PATH\" to `set`",
        ),
        (
            "process.controller.gains\"\nheld",
            "process.pilo.gains\"\nheld",
            "process `pilo` names no gains file",
        ),
        ("factor = [0.5, 8.0]", "factor = [2.0, 8.0]", "outside of 2 to 8"),
        (
            "key = \"altitude.derivative\"",
            "keys = [\"altitude.derivative\", \"altitude.proportional\"]",
            "differ in the gains file",
        ),
        ("run.duration_s=3.0\"", "run.duration_s=3.0\", \"process.plant.vehicle.body.mass=-1\"", "mass"),
    ] {
        assert!(TUNING.contains(from), "{from}");
        let file = tuning(&place, "t.toml", &TUNING.replace(from, to));
        let ended = place.call(&["tune", &file, "--out", &out]).with_code(2);
        ended.says(&[says]);
        assert!(!ended.to_string().contains("panicked"), "{ended}");
    }
    // A figure that does not exist: its place, and the one that is meant.
    let text = TUNING.replace("figure = \"height error\"", "figure = \"hight error\"");
    let file = tuning(&place, "t.toml", &text);
    let written = fs::read_to_string(&file).unwrap();
    let line = written.lines().position(|line| line.starts_with("figure = ")).unwrap() + 1;
    let ended = place.call(&["tune", &file, "--out", &out]).with_code(2);
    ended.says(&[
        &format!("{file}:{line}:10: there is no figure `hight error`"),
        "did you mean `height error`?",
    ]);
    // So has a gain that does not exist.
    let file = tuning(&place, "t.toml", &TUNING.replace("altitude.derivative", "altitude.derivativ"));
    let written = fs::read_to_string(&file).unwrap();
    let line = written.lines().position(|line| line.starts_with("key = \"altitude")).unwrap() + 1;
    place.call(&["tune", &file, "--out", &out]).with_code(2).says(&[
        &format!("{file}:{line}:7: the gains file has no number `altitude.derivativ`"),
        "did you mean `altitude.derivative`?",
    ]);
    let file = tuning(&place, "t.toml", TUNING);
    let weak = place.path("weak.toml");
    place.call(&["tune", &file, "--out", &weak]).with_code(2).says(&["is an input of the tuning"]);
    let letter = place.write("letter.txt", "a letter");
    place
        .call(&["tune", &file, "--out", &letter])
        .with_code(2)
        .says(&["no tuned gains file of hummingbus, and would be lost"]);
    assert_eq!(fs::read_to_string(&letter).unwrap(), "a letter");
}
