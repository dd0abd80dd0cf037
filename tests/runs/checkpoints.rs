//! A run that goes on from a checkpoint writes what the run that was never interrupted has written, whoever hosts its
//! nodes before and after.

use crate::manifests::{is_brief, settings, shipped, shipped_in_folders};
use crate::recordings::{first_tick, rows};
use crate::refusals::good;
use crate::skipped::{cases, first, is_thorough};
use crate::support::{Place, poll, repository};
use rustix::process::Signal;
use std::fs;
use std::path::Path;

/// Simulated length of the flights of all manifests, s.
const DURATION_S: f64 = 0.4;
/// The same of those in folders, of which several are alike.
const DURATION_IN_FOLDERS_S: f64 = 0.2;
/// Hosts of the nodes: the arguments that ask for them.
pub const HOSTS: [&[&str]; 3] = [&["--in-process"], &["--compose", "all"], &["--compose", "none"]];

/// A shipped manifest, flown for a part of a second.
struct Flight<'a> {
    manifest: &'a str,
    set: Vec<String>,
}

impl<'a> Flight<'a> {
    fn new(place: &Place, manifest: &'a str, duration_s: f64) -> Self {
        let mut set = settings(place, manifest);
        if !set.iter().any(|setting| setting.starts_with("run.duration_s")) {
            set.push(format!("run.duration_s={duration_s}"));
        }
        Self { manifest, set }
    }

    fn args<'s>(&'s self, more: &[&'s str]) -> Vec<&'s str> {
        let set = self.set.iter().flat_map(|setting| ["--set", setting]);
        ["run", self.manifest].into_iter().chain(set).chain(more.iter().copied()).collect()
    }
}

/// True for a manifest of which a node is replaced in flight, which one process cannot host.
fn has_backups(manifest: &str) -> bool {
    let name = Path::new(manifest).file_stem().unwrap().to_string_lossy();
    ["llp-hlp", "standby", "swap-gains", "swap-identical", "swap-laws"].contains(&&*name)
}

/// True for a manifest that names an executable or a core of its own.
fn needs_processes(manifest: &str) -> bool {
    manifest.ends_with("custom-controller.toml")
}

/// Checkpoints beside the recording `stem`: their ticks and paths, by tick.
pub fn checkpoints(place: &Place, stem: &str) -> Vec<(u32, String)> {
    let folder = place.path("");
    let names = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let tick = |name: &String| -> Option<u32> {
        name.strip_prefix(&format!("{stem}."))?.strip_suffix(".ckpt")?.parse().ok()
    };
    let mut found: Vec<(u32, String)> =
        names.filter_map(|name| Some((tick(&name)?, place.path(&name)))).collect();
    found.sort();
    found
}

/// Requires that `later` begins at `tick` and goes on as `whole` does.
#[track_caller]
pub fn require_goes_on(place: &Place, whole: &str, later: &str, tick: u32) {
    let expected = format!("begins at tick {tick}, and from there on all messages are those of");
    place.call(&["diff", whole, later]).with_code(1).prints(&[&expected]);
}

#[test]
fn every_shipped_manifest_goes_on_from_random_ticks_under_every_host() {
    let place = Place::new();
    let mut drawn: u32 = 1;
    let mut draw = |below: u32| {
        // The constants of a linear congruential generator (Numerical Recipes, 2nd ed., ch. 7.1).
        drawn = drawn.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (drawn >> 8) % below
    };
    let mut gone_on = 0;
    // How long each flies, and from how many of its checkpoints a run goes on.
    let turns = if is_thorough() { 2 } else { 1 };
    let flat = shipped().into_iter().map(|path| (path, DURATION_S, turns));
    let in_folders = shipped_in_folders().into_iter().map(|path| (path, DURATION_IN_FOLDERS_S, 1));
    let all = flat.chain(in_folders).filter(|(path, ..)| !has_backups(path));
    let taken = cases("manifests", all, |(path, ..)| is_brief(path));
    let least = taken.len();
    for (number, (manifest, duration_s, turns)) in taken.into_iter().enumerate() {
        let flight = Flight::new(&place, &manifest, duration_s);
        let host = |index: usize| match needs_processes(&manifest) {
            true => HOSTS[2],
            false => HOSTS[index % HOSTS.len()],
        };
        let whole = place.path(&format!("{number}.mcap"));
        let every = format!("{}ms", 17 + draw(70));
        let more = [&["--record", &whole, "--checkpoint-every", &every][..], host(number)].concat();
        place.call(&flight.args(&more)).flown();
        let stem = number.to_string();
        let all = checkpoints(&place, &stem);
        assert!(!all.is_empty(), "{manifest}: no checkpoint every {every}");
        for turn in 0..turns {
            let (tick, file) = &all[draw(all.len() as u32) as usize];
            let later = place.path(&format!("{number}.later.mcap"));
            // Another host than before, and the same one.
            let more =
                [&["run", "--from", file, "--record", &later][..], host(number + (turn + 1) % 2)].concat();
            place.call(&more).flown();
            // Where all that is recorded is sent seldom, the first message is a little later.
            let begins = u32::try_from(first_tick(&later)).unwrap();
            assert!(
                (*tick..tick + 20).contains(&begins),
                "{manifest}: from tick {tick}, and begins at {begins}"
            );
            require_goes_on(&place, &whole, &later, begins);
            gone_on += 1;
        }
        for (_, file) in all {
            fs::remove_file(file).unwrap();
        }
    }
    assert!(
        if is_thorough() { least > 20 && gone_on > 80 } else { gone_on > 10 },
        "only {gone_on} runs of {least} manifests went on"
    );
}

#[test]
fn verdicts_are_those_of_the_whole_flight_and_the_manifest_names_the_tick() {
    let place = Place::new();
    let hover = repository("manifests/hover.toml");
    let text = format!("include = [{hover:?}]\n[[checkpoint]]\nat_tick = 6500\n");
    let manifest = place.write("m.toml", text);
    let whole = place.path("a.mcap");
    let ended = place.call(&["run", &manifest, "--record", &whole, "--json"]).with_code(0).json();
    let file = place.path("a.6500.ckpt");
    assert_eq!(ended["checkpoints"], serde_json::json!([{ "tick": 6500, "path": file }]));
    for (host, record) in [(HOSTS[0], "none"), (HOSTS[1], "b.mcap"), (HOSTS[2], "c.mcap")] {
        let record = if record == "none" { record.to_owned() } else { place.path(record) };
        let more = [&["run", "--from", &file, "--json", "--record", &record][..], host].concat();
        let summary = place.call(&more).with_code(0).json();
        assert_eq!((&summary["first_tick"], &summary["ticks"]), (&6500.into(), &5500.into()));
        assert_eq!(summary["pass"], ended["pass"]);
        assert!(ended["pass"].as_array().unwrap().len() > 2);
        if record != "none" {
            require_goes_on(&place, &whole, &record, 6500);
            let told = place.call(&["diff", &whole, &record, "--json"]).with_code(1).json();
            assert_eq!((&told["identical"], &told["same_from_tick"]), (&false.into(), &6500.into()));
        }
    }
}

/// Contacts, joints, a queue of a radio link, a step that takes time, and a filter that remembers the past.
#[test]
fn what_is_under_way_goes_on() {
    let place = Place::new();
    let flights = [
        ("workshop", 1503, "run.duration_s=1.7"),
        ("driven-joints", 1201, "run.duration_s=1.4"),
        ("commands-over-a-link", 1999, "run.duration_s=2.2"),
        ("computing-time", 1502, "run.duration_s=1.7"),
        ("sensors", 2101, "run.duration_s=2.3"),
        ("take-off", 1702, "run.duration_s=2.0"),
    ];
    // Contacts, joints, landings and steps that take time go on in other tests, too.
    let is_quick = |name: &str| ["commands-over-a-link", "sensors"].contains(&name);
    for (name, tick, more) in cases("manifests", flights, |(name, ..)| is_quick(name)) {
        let manifest = repository(&format!("manifests/{name}.toml"));
        require_goes_on_under_every_host(&place, name, &format!("include = [{manifest:?}]\n"), tick, more);
    }
}

/// Flies a manifest with this `text` and a checkpoint at `tick`, and requires that runs go on from there. Returns the recording.
#[track_caller]
fn require_goes_on_under_every_host(place: &Place, name: &str, text: &str, tick: u32, more: &str) -> String {
    let text = format!("{text}[[checkpoint]]\nat_tick = {tick}\n");
    let manifest = place.write(&format!("{name}.toml"), text);
    let (whole, later) = (place.path(&format!("{name}.mcap")), place.path(&format!("{name}.later.mcap")));
    place.call(&["run", &manifest, "--set", more, "--record", &whole, "--in-process"]).flown();
    let file = place.path(&format!("{name}.{tick}.ckpt"));
    for host in HOSTS {
        place.call(&[&["run", "--from", &file, "--record", &later][..], host].concat()).flown();
        require_goes_on(place, &whole, &later, tick);
    }
    whole
}

/// The vehicle leans on a wall all the time.
#[test]
fn a_wall_contact_goes_on() {
    let place = Place::new();
    let vehicle = repository("vehicles/hummingbird.toml");
    let text = format!(
        "include = [{:?}]\n[run]\nduration_s = 0.9\n\
         [process.plant]\nscene = {:?}\noutputs.contact = {{}}\n\
         parameters = {{ backend = \"rapier\", initial_position_m = [4.7, 0.0, 1.5], crash_speed_m_s = 6.0 }}\n\
         [process.ekf.parameters]\ninitial_position_m = [4.7, 0.0, 1.5]\n\
         [process.controller]\nkind = \"pid\"\nvehicle = {vehicle:?}\n\
         inputs = {{ set_point = \"/pilot/set_point\", estimate = \"/ekf/estimate\" }}\n\
         [process.pilot]\nkind = \"pilot\"\nparameters = {{ initial_altitude_m = 1.5, set_points = [\n\
         {{ kind = \"step\", channel = \"pitch\", at_s = 0.1, to = 8.0, unit = \"deg\" }},\n] }}\n",
        repository("manifests/sets/flight.toml"),
        repository("scenes/room.toml"),
    );
    let tick = 741;
    let whole = require_goes_on_under_every_host(&place, "wall", &text, tick, "run.duration_s=0.9");
    let contacts = rows(&whole, "/plant/contact");
    let around: Vec<_> = contacts.iter().filter(|row| row.tick.abs_diff(tick) < 10).collect();
    assert_eq!(around.len(), 19, "a contact report each tick");
    assert!(around.iter().all(|row| row.get("count") == 1.0 && row.get("object") == 2.0), "{around:?}");
}

/// In the air, at the touch, and on the ground.
#[test]
fn a_landing_goes_on() {
    let place = Place::new();
    let take_off = repository("manifests/take-off.toml");
    let landing = "[run]\nduration_s = 3.2\n[process.pilot.parameters]\ninitial_altitude_m = -1.0\nset_points = [\n\
                   { kind = \"ramp\", channel = \"altitude\", at_s = 0.3, over_s = 0.7, to = 0.6, unit = \"m\" },\n\
                   { kind = \"ramp\", channel = \"altitude\", at_s = 1.6, over_s = 0.6, to = -1.0, unit = \"m\" },\n]\n\
                   [[pass]]\nname = \"lands\"\ntopic = \"/plant/contact\"\nfield = \"began\"\nunit = \"1\"\nfrom_s = 1.8\n\
                   statistic = \"max\"\nmin = 1\n";
    let ticks: Vec<u32> = (0..14).map(|number| 1801 + number * 97).collect();
    let checkpoints: String =
        ticks.iter().map(|tick| format!("[[checkpoint]]\nat_tick = {tick}\n")).collect();
    let manifest = place.write("m.toml", format!("include = [{take_off:?}]\n{landing}{checkpoints}"));
    let (whole, later) = (place.path("a.mcap"), place.path("b.mcap"));
    let flown = place.call(&["run", &manifest, "--record", &whole, "--in-process", "--json"]).json();
    let verdicts = flown["pass"].as_array().unwrap();
    let lands = verdicts.iter().find(|verdict| verdict["name"] == "lands").unwrap();
    assert_eq!(lands["passed"], true, "{lands}");
    // Quick tests take every other one: in the air, at the touch, and on the ground.
    let ticks = cases("ticks", ticks, |tick| (tick - 1801) / 97 % 2 == 0);
    for (tick, host) in ticks.into_iter().zip(HOSTS.iter().cycle()) {
        let file = place.path(&format!("a.{tick}.ckpt"));
        place.call(&[&["run", "--from", &file, "--record", &later][..], host].concat()).flown();
        require_goes_on(&place, &whole, &later, tick);
    }
}

/// Before, between and behind swaps to other laws: a run that goes on is told by the manifest who flies.
#[test]
fn whoever_has_taken_over_by_then_goes_on() {
    let place = Place::new();
    let laws = repository("manifests/swap-laws.toml");
    let ticks = [2501, 4500, 7500, 10_001].map(|tick| format!("[[checkpoint]]\nat_tick = {tick}\n"));
    let manifest = place.write("m.toml", format!("include = [{laws:?}]\n{}", ticks.concat()));
    let whole = place.path("a.mcap");
    let flown = place.call(&["run", &manifest, "--record", &whole, "--json"]).with_code(0).json();
    let later = place.path("b.mcap");
    for tick in cases("ticks", [2501, 4500, 7500, 10_001], |tick| *tick == 4500) {
        // Nobody takes over behind the last: one process can host what is left.
        let host = if tick > 9000 { HOSTS[0] } else { HOSTS[1] };
        let file = place.path(&format!("a.{tick}.ckpt"));
        let more = [&["run", "--from", &file, "--json", "--record", &later][..], host].concat();
        assert_eq!(place.call(&more).with_code(0).json()["pass"], flown["pass"], "from tick {tick}");
        require_goes_on(&place, &whole, &later, tick);
    }
    place
        .call(&["run", "--from", &place.path("a.4500.ckpt"), "--in-process"])
        .with_code(2)
        .says(&["in-process"]);
}

/// A standby shadows the process before from the first tick on.
#[test]
fn a_standby_stands_by_again() {
    let place = Place::new();
    let standby = repository("manifests/standby.toml");
    let (whole, later) = (place.path("a.mcap"), place.path("b.mcap"));
    let args =
        ["run", &standby, "--record", &whole, "--checkpoint-every", "1s", "--set", "run.duration_s=2.5"];
    place.call(&args).flown();
    place.call(&["run", "--from", &place.path("a.1000.ckpt"), "--record", &later]).flown();
    require_goes_on(&place, &whole, &later, 1000);
}

#[test]
fn a_fork_differs_from_the_tick_on_at_which_its_value_counts() {
    let place = Place::new();
    let whole = place.path("a.mcap");
    let hover = repository("manifests/hover.toml");
    let args = ["run", &hover, "--record", &whole, "--in-process", "--checkpoint-every", "1s", "--keep", "2"];
    place.call(&[&args[..], &["--set", "run.duration_s=4"]].concat()).flown();
    let kept = checkpoints(&place, "a");
    assert_eq!(kept.iter().map(|(tick, _)| *tick).collect::<Vec<_>>(), [2000, 3000], "two are kept");
    let fork = place.path("fork.mcap");
    let set = [
        "--set",
        "process.controller.parameters.gains.roll={ proportional_1_s2 = 20.0, integral_1_s3 = 0.0, derivative_1_s = 7.0 }",
    ];
    let ended =
        place.call(&[&["run", "--from", &kept[0].1, "--record", &fork, "--in-process"][..], &set].concat());
    ended.flown();
    place.call(&["diff", &whole, &fork]).with_code(1).prints(&["tick 2000, topic /controller/"]);
    let told = place.call(&["diff", &whole, &fork, "--json"]).with_code(1).json();
    assert_eq!(told["same_from_tick"], serde_json::Value::Null);
    // One that ends before the other begins has nothing in common with it.
    let short = place.path("short.mcap");
    let end = ["--set", "run.duration_s=0.1", "--in-process"];
    place.call(&[&["run", &hover, "--record", &short][..], &end].concat()).flown();
    place.call(&["diff", &short, &fork]).with_code(1).prints(&[
        "tick 0, topic",
        "a message of",
        "at tick 2000",
    ]);
}

/// As a swap at that tick does: all laws have a state of one layout.
#[test]
fn another_law_goes_on_as_a_swap_has_it() {
    let place = Place::new();
    let laws = fs::read_to_string(repository("manifests/swap-laws.toml")).unwrap();
    let laws = laws.replace("sets/flight.toml", &repository("manifests/sets/flight.toml"));
    let laws = laws.replace("../vehicles", &repository("vehicles"));
    let gains = repository("controllers/gains");
    let laws = laws.replace("../controllers/gains", &gains).replace("duration_s = 12.0", "duration_s = 4.0");
    let mut parts = laws.split("[[swap]]");
    let (head, swap) = (parts.next().unwrap(), parts.next().unwrap());
    let plain = place.write("plain.toml", format!("{head}[[checkpoint]]\nat_tick = 3000\n"));
    let swapped = place.write("swapped.toml", format!("{head}[[swap]]{swap}"));
    let whole = place.path("swapped.mcap");
    place.call(&["run", &swapped, "--record", &whole]).with_code(0);
    place.call(&["run", &plain, "--record", &place.path("a.mcap"), "--in-process"]).with_code(0);
    let (file, fork) = (place.path("a.3000.ckpt"), place.path("fork.mcap"));
    let gains = format!("process.controller.gains={gains}/cascade.toml");
    let args = [
        "run",
        "--from",
        &file,
        "--record",
        &fork,
        "--set",
        "process.controller.kind=cascade",
        "--set",
        &gains,
    ];
    for host in first(1, "hosts", HOSTS) {
        place.call(&[&args[..], host].concat()).with_code(0);
        require_goes_on(&place, &whole, &fork, 3000);
    }
    // It keeps no gains of the law before.
    let args = ["run", "--from", &file, "--record", &fork, "--in-process", "--set"];
    place.call(&[&args[..], &["process.controller.kind=cascade"]].concat()).with_code(0);
    // One that reads something else.
    let gains = repository("controllers/gains/geometric.toml");
    let set = [
        "process.controller.kind=geometric".to_owned(),
        format!("process.controller.gains={gains}"),
        "process.controller.inputs={ reference = \"/trajectory/reference\", estimate = \"/ekf/estimate\" }"
            .to_owned(),
    ];
    let set: Vec<&str> = set.iter().flat_map(|set| ["--set", set]).collect();
    let args = ["run", "--from", &file, "--record", &fork, "--in-process"];
    place.call(&[&args[..], &set].concat()).with_code(0);
    place.call(&["diff", &whole, &fork]).with_code(1).prints(&["topic /controller/command"]);
}

/// A filter with another state, or none, begins as a successor: under every host with the same messages.
#[test]
fn what_has_another_state_begins_as_a_successor() {
    let place = Place::new();
    let hover = repository("manifests/hover.toml");
    let whole = place.path("a.mcap");
    let args = ["run", &hover, "--record", &whole, "--in-process", "--checkpoint-every", "1s", "--keep", "1"];
    place.call(&[&args[..], &["--set", "run.duration_s=2.5"]].concat()).flown();
    let file = place.path("a.2000.ckpt");
    let ideal = [
        "process.ekf.kind=ideal",
        "process.ekf.parameters={}",
        "process.ekf.inputs={ state = \"/plant/state\" }",
    ];
    let ideal: Vec<&str> = ideal.iter().flat_map(|set| ["--set", set]).collect();
    let forks = ["0", "1", "2"].map(|name| place.path(&format!("{name}.mcap")));
    for (host, fork) in HOSTS.iter().zip(&forks) {
        place.call(&[&["run", "--from", &file, "--record", fork], &ideal[..], host].concat()).flown();
        place.call(&["diff", &whole, fork]).with_code(1).prints(&["tick 2000, topic /"]);
        place.call(&["diff", &forks[0], fork]).with_code(0);
    }
}

#[test]
fn a_run_that_breaks_leaves_the_checkpoints_before() {
    let place = Place::new();
    let hover = repository("manifests/hover.toml");
    let record = place.path("a.mcap");
    let launch = place.start_endless(&[
        "run",
        &hover,
        "--record",
        &record,
        "--checkpoint-every",
        "100ms",
        "--keep",
        "3",
    ]);
    let kept = poll("three checkpoints", || {
        let found = checkpoints(&place, "a");
        (found.len() >= 3).then_some(found)
    });
    rustix::process::kill_process(place.process_of("imu"), Signal::KILL).unwrap();
    launch.end().with_code(2).says(&[
        "imu",
        "the last checkpoint is",
        "to go on from it: hummingbus run --from",
    ]);
    let left = checkpoints(&place, "a");
    assert!(left.len() <= 3 && left.last().unwrap().0 >= kept[2].0, "{left:?}");
    let (tick, file) = left.last().unwrap();
    let later = place.path("b.mcap");
    let end = format!("run.duration_s={}", f64::from(tick + 200) * 1e-3);
    let args = ["run", "--from", file, "--record", &later, "--pace", "free", "--set", &end];
    place.call(&args).flown();
    assert!(fs::metadata(&later).unwrap().len() > 4000);
}

/// A fork without a recording has checkpoints of its own, beside the manifest.
#[test]
fn an_unrecorded_fork_keeps_the_checkpoints_of_the_run_before() {
    let place = Place::new();
    let hover = repository("manifests/hover.toml");
    let manifest = place.write("m.toml", format!("include = [{hover:?}]\n[run]\nduration_s = 1.4\n"));
    let args = ["run", &manifest, "--in-process", "--checkpoint-every", "500ms"];
    place.call(&args).flown();
    let of_run = checkpoints(&place, "m");
    assert_eq!(of_run.iter().map(|(tick, _)| *tick).collect::<Vec<_>>(), [500, 1000]);
    let before = fs::read(&of_run[1].1).unwrap();
    let args = ["run", "--from", &of_run[0].1, "--record", "none", "--in-process"];
    let set = ["--set", "process.plant.vehicle.body.mass=0.6", "--set", "run.duration_s=1.2"];
    place.call(&[&args[..], &set].concat()).flown();
    assert!(fs::read(&of_run[1].1).unwrap() == before, "the checkpoint of the run before was replaced");
    let of_fork = checkpoints(&place, "m.from-500");
    assert_eq!(of_fork.iter().map(|(tick, _)| *tick).collect::<Vec<_>>(), [1000]);
}

/// They look like those of the run that has replaced the recording. Nothing removes them: another run may go on from one.
#[test]
fn checkpoints_of_an_earlier_run_are_named() {
    let place = Place::new();
    let hover = repository("manifests/hover.toml");
    let record = place.path("a.mcap");
    let every = ["--in-process", "--checkpoint-every", "100ms", "--set"];
    let flown =
        |end: &str| place.call(&[&["run", &hover, "--record", &record][..], &every, &[end]].concat()).flown();
    let first = flown("run.duration_s=0.5");
    assert!(!first.error.contains("of an earlier run"), "{first}");
    let second = flown("run.duration_s=0.25");
    second.says(&["warning: 2 checkpoints of an earlier run lie beside", "a.300.ckpt", "a.400.ckpt"]);
    assert!(!second.error.contains("a.200.ckpt"), "{second}");
    let left: Vec<u32> = checkpoints(&place, "a").iter().map(|(tick, _)| *tick).collect();
    assert_eq!(left, [100, 200, 300, 400]);
    // A run that goes on from one of them needs those before.
    let args = ["run", "--from", &place.path("a.300.ckpt"), "--record", &record, "--in-process"];
    let later = place.call(&args).flown();
    assert!(!later.error.contains("of an earlier run"), "{later}");
}

/// The summary says from where to look at what went wrong.
#[test]
fn a_failed_condition_leads_to_the_checkpoint_before() {
    let place = Place::new();
    let hover = repository("manifests/hover.toml");
    let rises = "[[pass]]\nname = \"stays down\"\ntopic = \"/plant/state\"\nfield = \"position.z\"\nunit = \"m\"\nstatistic = \"max\"\nmax = 1.25\n";
    let manifest = place.write("m.toml", format!("include = [{hover:?}]\n{rises}"));
    let args = ["run", &manifest, "--record", &place.path("a.mcap"), "--checkpoint-every", "1s"];
    // The climb from 1.0 m to 1.5 m begins at 2 s.
    let ended = place.call(&args).with_code(1);
    ended.prints(&["FAILED stays down", ", tick 2", "to go on from tick 2000:", "a.2000.ckpt"]);
    // It is kept beside the newest.
    let args = [&args[..], &["--keep", "3"]].concat();
    place.call(&args).with_code(1).prints(&["to go on from tick 2000:", "a.2000.ckpt"]);
    place.call(&[&args[..], &["--in-process"]].concat()).with_code(1).prints(&["to go on from tick 2000:"]);
    let kept: Vec<u32> = checkpoints(&place, "a").iter().map(|(tick, _)| *tick).collect();
    assert_eq!(kept, [2000, 9000, 10_000, 11_000]);
    // Where there is none before it, the summary says so.
    let args =
        ["run", &manifest, "--record", &place.path("b.mcap"), "--checkpoint-every", "3s", "--in-process"];
    place.call(&args).with_code(1).prints(&["no checkpoint before tick 2", "was kept"]);
}

/// The message comes in flight, and says how to go back there.
#[test]
fn a_condition_that_fails_is_told_while_the_run_flies() {
    let place = Place::new();
    let hover = repository("manifests/hover.toml");
    let rises = "[[pass]]\nname = \"stays down\"\ntopic = \"/plant/state\"\nfield = \"position.z\"\nunit = \"m\"\nstatistic = \"max\"\nmax = 1.25\n";
    let manifest = place.write("m.toml", format!("include = [{hover:?}]\n{rises}"));
    let args = ["run", &manifest, "--record", &place.path("a.mcap"), "--checkpoint-every", "500ms"];
    let launch = place.start_endless(&[&args[..], &["--json"]].concat());
    launch.await_said("condition `stays down` failed at tick 2");
    launch.await_said("a.2000.ckpt; `hummingbus ctl pause`, then `hummingbus ctl rewind 2000` go back there");
    let run = place.run_id();
    for request in [&["pause"][..], &["rewind", "2000"]] {
        let all = [&["ctl"], request, &["--run", &run]].concat();
        place.start(&all).end_among_others().with_code(0);
    }
    place.start(&["ctl", "stop", "--run", &run]).end_among_others().with_code(0);
    launch.end().with_code(1);
    // A run on one thread takes no requests, and tells it once.
    let args = ["run", &manifest, "--record", &place.path("b.mcap"), "--checkpoint-every", "500ms"];
    let ended = place.call(&[&args[..], &["--in-process", "--quiet"]].concat()).with_code(1);
    ended.says(&["b.2000.ckpt; `hummingbus run --from` goes on from there"]);
    assert_eq!(ended.error.matches("failed at tick").count(), 1, "{ended}");
}

/// The checkpoint from which it went on is the one before.
#[test]
fn a_fork_that_fails_before_its_own_first_checkpoint_goes_back_to_its_start() {
    let place = Place::new();
    let hover = repository("manifests/hover.toml");
    let stays = "[[pass]]\nname = \"stays up\"\ntopic = \"/plant/state\"\nfield = \"position.z\"\nunit = \"m\"\nstatistic = \"min\"\nmin = 0.8\n";
    let text = format!("include = [{hover:?}]\n[run]\nduration_s = 2.5\n{stays}");
    let manifest = place.write("m.toml", text);
    let args = ["run", &manifest, "--record", &place.path("a.mcap"), "--in-process"];
    place.call(&[&args[..], &["--checkpoint-every", "1s"]].concat()).flown();
    let file = place.path("a.1000.ckpt");
    // Twice as heavy, it falls by 0.2 m within some tenths of a second.
    let args = ["run", "--from", &file, "--record", &place.path("b.mcap"), "--in-process", "--set"];
    let ended = place.call(&[&args[..], &["process.plant.vehicle.body.mass=1.0"]].concat()).with_code(1);
    ended.prints(&["FAILED stays up", ", tick 1", "to go on from tick 1000:", "a.1000.ckpt"]);
    assert!(!ended.to_string().contains("was kept"), "{ended}");
}

#[test]
fn a_live_run_writes_one_when_it_is_asked() {
    let place = Place::new();
    let hover = repository("manifests/hover.toml");
    let mut launch = place.start_endless(&["run", &hover, "--record", &place.path("a.mcap")]);
    launch.await_ticks(100);
    let run = place.run_id();
    let file = place.path("asked.ckpt");
    let asked = place.start(&["ctl", "checkpoint", &file, "--run", &run, "--json"]).end_among_others();
    let tick = asked.with_code(0).json()["tick"].as_u64().unwrap();
    assert!(tick > 0);
    place.start(&["ctl", "pause", "--run", &run]).end_among_others().with_code(0);
    // A paused run writes one where it is, as often as it is asked, and stays there.
    let status =
        || place.start(&["ctl", "status", "--run", &run, "--json"]).end_among_others().with_code(0).json();
    let paused = status();
    let held = paused["tick"].as_u64().unwrap();
    let of_pause = place.path("paused.ckpt");
    for _ in 0..2 {
        let asked =
            place.start(&["ctl", "checkpoint", &of_pause, "--run", &run, "--json"]).end_among_others();
        assert_eq!(asked.with_code(0).json()["tick"], held);
    }
    assert_eq!(status(), paused);
    place.start(&["ctl", "step", "150", "--run", &run]).end_among_others().with_code(0);
    place.start(&["ctl", "stop", "--run", &run]).end_among_others().with_code(0);
    launch.end().with_code(1);
    let fork = ["run", "--from", &file, "--fork", "2", "--set", "run.duration_s=1e3"];
    place.call(&fork).with_code(2).says(&["holds nothing of the conditions so far", "--checkpoint-every"]);
    let end = ["--set", "run.duration_s=1e3", "--pace", "free", "--record"];
    let later = place.path("b.mcap");
    let mut goes_on = place.start(&[&["run", "--from", &file][..], &end, &[&later]].concat());
    goes_on.await_ticks(u32::try_from(tick).unwrap() + 300);
    goes_on.signal(Signal::INT);
    goes_on.end().with_code(1).prints(&["from the checkpoint of tick"]);
    let compared = place.call(&["diff", &place.path("a.mcap"), &later]);
    compared.with_code(1).prints(&["begins at tick"]);
    // Of the pause: up to the end of the first run, and no further.
    let (short, end) = (place.path("c.mcap"), format!("run.duration_s={}", (held + 150) as f64 * 1e-3));
    let args = ["run", "--from", &of_pause, "--pace", "free", "--set", &end, "--record", &short];
    for host in HOSTS {
        // The run before had no judge: what nothing has judged has not passed.
        let ended = place.call(&[&args[..], host].concat()).with_code(1);
        let unjudged = format!("conditions: not judged, since no judge flew before tick {held};");
        ended.prints(&[&unjudged, "FAILED: the conditions were not judged"]);
        require_goes_on(&place, &place.path("a.mcap"), &short, u32::try_from(held).unwrap());
    }
    let json = place.call(&[&args[..], &["--in-process", "--json"]].concat()).with_code(1).json();
    assert_eq!((&json["passed"], &json["is_unjudged"]), (&false.into(), &true.into()));
    let args = ["run", "--from", &of_pause, "--set", &end, "--record", "none"];
    place.call(&args).with_code(2).says(&["holds nothing of the conditions so far", "--checkpoint-every"]);
}

#[test]
fn a_run_without_conditions_passes_from_a_checkpoint_that_was_asked_for() {
    let place = Place::new();
    let manifest = place.write("good.toml", good());
    let mut launch = place.start_endless(&["run", &manifest, "--record", &place.path("a.mcap")]);
    launch.await_ticks(100);
    let (run, file) = (place.run_id(), place.path("asked.ckpt"));
    let asked = place.start(&["ctl", "checkpoint", &file, "--run", &run, "--json"]).end_among_others();
    let tick = asked.with_code(0).json()["tick"].as_u64().unwrap();
    place.start(&["ctl", "stop", "--run", &run]).end_among_others().with_code(0);
    launch.end().with_code(1);
    let end = format!("run.duration_s={}", (tick + 100) as f64 * 1e-3);
    let args = ["run", "--from", &file, "--pace", "free", "--set", &end, "--record", &place.path("b.mcap")];
    let ended = place.call(&[&args[..], &["--in-process"]].concat()).with_code(0);
    ended.prints(&["from the checkpoint of tick", "passed"]);
    assert!(!ended.output.contains("not judged"), "{ended}");
}

/// In processes of several nodes, and where some compute seldom.
#[test]
fn a_paused_run_writes_a_checkpoint_under_every_composition() {
    let place = Place::new();
    let fast = repository("manifests/fast-loops.toml");
    for compose in ["none", "all", "plant+imu,ekf+controller"] {
        let record = place.path("a.mcap");
        let args = ["run", &fast, "--record", &record, "--compose", compose, "--pace", "realtime"];
        // As long as 32 bits of ticks allow.
        let mut launch = place.start(&[&args[..], &["--set", "run.duration_s=400000"]].concat());
        launch.await_ticks(200);
        let run = place.run_id();
        let ctl = |args: &[&str]| {
            let all = [&["ctl"], args, &["--run", &run, "--json"]].concat();
            place.start(&all).end_among_others().with_code(0).json()["tick"].as_u64().unwrap()
        };
        ctl(&["pause"]);
        // Between the ticks of the slow loops.
        let held = ctl(&["step", "13"]);
        let file = place.path("held.ckpt");
        assert_eq!(ctl(&["checkpoint", &file]), held);
        ctl(&["step", "120"]);
        ctl(&["stop"]);
        launch.end().with_code(1);
        let (later, end) = (place.path("b.mcap"), format!("run.duration_s={}", (held + 120) as f64 / 8000.0));
        let args =
            ["run", "--from", &file, "--pace", "free", "--set", &end, "--record", &later, "--in-process"];
        place.call(&args).flown();
        require_goes_on(&place, &record, &later, u32::try_from(held).unwrap());
    }
}

#[test]
fn what_does_not_fit_is_refused_in_words() {
    let place = Place::new();
    let vehicle = place.write("v.toml", fs::read(repository("vehicles/hummingbird.toml")).unwrap());
    let text = fs::read_to_string(repository("manifests/hover.toml")).unwrap();
    let text = text.replace("../vehicles/hummingbird.toml", &vehicle);
    assert!(text.contains(&vehicle), "hover.toml names its vehicle otherwise");
    let manifest = place.write("m.toml", &text);
    let record = place.path("a.mcap");
    let args = ["run", &manifest, "--record", &record, "--in-process", "--set", "run.duration_s=1"];
    place.call(&[&args[..], &["--checkpoint-every", "500ms"]].concat()).flown();
    let file = place.path("a.500.ckpt");
    let refused = |args: &[&str], parts: &[&str]| {
        place.call(&[&["run", "--from", &file, "--record", "none"], args].concat()).with_code(2).says(parts);
    };
    refused(&["--set", "run.duration_s=0.4"], &["tick 500", "tick 400", "raise run.duration_s"]);
    refused(&["--set", "run.rate_hz=500"], &["a tick of the checkpoint is 1000000 ns"]);
    refused(&[&manifest], &["cannot be used with"]);
    place.call(&["run", &file]).with_code(2).says(&["a.500.ckpt", "with --from"]);
    let absent = ["run", "--from", &place.path("a.600.ckpt")];
    place.call(&absent).with_code(2).says(&[
        "a.600.ckpt",
        "no such file; the checkpoint near it is ",
        "a.500.ckpt",
    ]);
    let named = ["m.toml", "at tick 500 (0.500 s), not a recording", "run --from"];
    place.call(&["cat", &file]).with_code(2).says(&named);

    let good = fs::read(&file).unwrap();
    let mut damaged = good.clone();
    damaged[good.len() / 2] ^= 4;
    fs::write(&file, damaged).unwrap();
    refused(&[], &["a.500.ckpt", "damaged"]);
    fs::write(&file, "a letter").unwrap();
    refused(&[], &["a.500.ckpt", "no checkpoint"]);
    fs::write(&file, &good).unwrap();

    fs::write(&vehicle, format!("{}\n# heavier\n", fs::read_to_string(&vehicle).unwrap())).unwrap();
    refused(&[], &["v.toml has changed since the checkpoint was written"]);
    fs::write(&vehicle, fs::read(repository("vehicles/hummingbird.toml")).unwrap()).unwrap();
    fs::write(&manifest, format!("{text}\n# longer\n")).unwrap();
    refused(&[], &["m.toml has changed since the checkpoint was written"]);
    fs::write(&manifest, &text).unwrap();
    let moved = place.path("moved.toml");
    fs::rename(&manifest, &moved).unwrap();
    refused(&[], &["m.toml, is no longer there", "put it back there"]);
    fs::rename(&moved, &manifest).unwrap();
    // A gain of a file that the manifest does not name: a fork names it, too.
    let gain = "process.controller.gains.roll.derivative=6.5";
    refused(&["--set", gain], &["names no gains file", "or give --set process.controller.gains=PATH, too"]);
    let file_of_gains = format!("process.controller.gains={}", repository("controllers/gains/pid.toml"));
    let fork = ["run", "--from", &file, "--record", "none", "--in-process", "--set", &file_of_gains];
    place.call(&[&fork[..], &["--set", gain]].concat()).flown();
    place.call(&["run", "--from", &file, "--record", "none", "--in-process"]).flown();

    for (more, part) in [
        ("[[checkpoint]]\nat_tick = 0\n", "tick 0"),
        ("[[checkpoint]]\nat_tick = 12000\n", "tick 12000 of a run of 12000 ticks"),
        ("[[checkpoint]]\nat_s = 1\n", "at_s"),
    ] {
        let hover = repository("manifests/hover.toml");
        let manifest = place.write("bad.toml", format!("include = [{hover:?}]\n{more}"));
        place.call(&["check", &manifest]).with_code(2).says(&[part]);
    }
    // Without a recording, checkpoints lie beside the manifest.
    let hover = place.write("m.toml", format!("include = [{:?}]\n", repository("manifests/hover.toml")));
    let args = ["run", &hover, "--record", "none", "--in-process", "--set", "run.duration_s=0.1"];
    let every = |time: &str| place.call(&[&args[..], &["--checkpoint-every", time]].concat());
    let neighbours = ["which is 1.5 ticks", "such as 0.001 s or 0.002 s"];
    every("1.5ms").with_code(2).says(&neighbours);
    every("333.3ms").with_code(2).says(&["is 0.3333 s, which is 333.3 ticks", "such as 0.333 s or 0.334 s"]);
    every("0.5ms").with_code(2).says(&["which is 0.5 ticks", "such as 0.001 s"]);
    every("3ms").flown();
    every("200ms")
        .says(&["warning: ", "`checkpoint_every_s` is 0.2 s: the run ends before its first checkpoint"]);
}

#[test]
fn a_run_on_one_thread_takes_no_requests_and_says_so() {
    let place = Place::new();
    let hover = repository("manifests/hover.toml");
    let launch = place.start_endless(&["run", &hover, "--record", "none", "--in-process"]);
    poll("a run", || (!place.run_dirs().is_empty()).then_some(()));
    let run = place.run_id();
    let ended = place.start(&["ctl", "pause", "--run", &run]).end_among_others().with_code(2);
    ended.says(&["takes no requests: it flies on one thread (--in-process)"]);
    assert!(!ended.to_string().contains("os error"), "{ended}");
    launch.signal(Signal::INT);
    launch.end().with_code(1);
}
