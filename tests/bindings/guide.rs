//! The shell commands of README, the first hour and all other pages, as a reader runs them: in a copy of the repository.

use crate::pages;
use crate::shell::{
    Exception, blocks, commands, copy, left_out, negative, path, replaced, require_commands, run, shortened,
};
use crate::skipped::cases;
use crate::support::{HUMMINGBUS, Place, repository};
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

const README: &str = "README.md";
const FIRST_HOUR: &str = "docs/first-hour.md";
const TUTORIAL: &str = "docs/manifest.md";

/// A page whose commands run within seconds.
struct Page {
    name: &'static str,
    /// Commands that make the files that a reader of the page has.
    before: &'static str,
    /// Files that the commands make.
    made: &'static [&'static str],
    /// True if the quick tests run it, too.
    is_quick: bool,
}

/// The pages that run, beside README, the first hour and those about other languages.
const PAGES: [Page; 12] = [
    Page {
        name: "docs/airframe.md",
        // Too short for its conditions.
        before: "hummingbus run manifests/swarm.toml --record swarm.mcap --set run.duration_s=0.1 || test $? = 1",
        made: &["hummingbird.urdf", "h1.urdf"],
        is_quick: true,
    },
    Page { name: "docs/benchmarks.md", before: "", made: &[], is_quick: false },
    Page {
        name: "docs/checkpoints.md",
        before: "",
        made: &["manifests/hover.6000.ckpt", "manifests/hover.from-6000.mcap", "windy.mcap"],
        is_quick: false,
    },
    Page { name: "docs/conditions.md", before: "", made: &[], is_quick: true },
    Page {
        name: "docs/hot-swap.md",
        before: "hummingbus run manifests/hover.toml --pace realtime --set run.duration_s=600 --record live.mcap &
echo 'parameters.gains.roll = { proportional_1_s2 = 20.0, integral_1_s3 = 0.0, derivative_1_s = 7.0 }' >my-controller.toml",
        made: &["live.mcap"],
        is_quick: true,
    },
    Page {
        name: "docs/identify.md",
        before: "",
        made: &["walk/flights.toml", "walk/truth.toml", "walk/excite-1.mcap", "walk/excite-2.mcap"],
        is_quick: true,
    },
    Page { name: "docs/live.md", before: "", made: &[], is_quick: true },
    Page {
        name: "docs/plots.md",
        before:
            "hummingbus run manifests/hover.toml --record hover.mcap --set run.duration_s=2.5 || test $? = 1
cp hover.mcap again.mcap
hummingbus run manifests/wall-follow-varying.toml --record laps.mcap --set run.duration_s=1 || test $? = 1",
        made: &["hover.html", "laps.png", "tables"],
        is_quick: true,
    },
    Page {
        name: "docs/profiling.md",
        before: "",
        made: &["profile.html", "trace.json", "manifests/hover.mcap"],
        is_quick: true,
    },
    Page {
        name: "docs/rotor-flights.md",
        before: "",
        made: &["DIR/flights.toml", "DIR/excite-3.mcap", "stand.mcap"],
        is_quick: true,
    },
    Page {
        name: "docs/rotor-stand.md",
        before: "",
        made: &["manifests/thesis/propeller-steps.mcap", "rotor/rotor.toml"],
        is_quick: true,
    },
    Page {
        name: "docs/vehicles.md",
        before: "cp vehicles/tests/models/plus.urdf quad.urdf",
        made: &["my-drone.toml", "hexa/flights.toml", "hexa/truth.toml", "quad.toml"],
        is_quick: true,
    },
];

/// The pages of which no command runs here, and why.
const LEFT_OUT: [(&str, &str); 17] = [
    ("docs/as-printed.md", "tests/runs/scenarios.rs flies these manifests"),
    (
        "docs/campaigns.md",
        "thousands of flights, and a cluster; tests/runs/campaign.rs and tests/runs/slurm.rs have small ones",
    ),
    ("docs/faults.md", "its commands run tests/faults and scripts/soak, for minutes or hours"),
    (
        "docs/firmware.md",
        "it downloads and builds a firmware; tests/runs/autopilots.rs flies with those that are there",
    ),
    (
        "docs/flights.md",
        "it needs data that are downloaded; identify/tests/real.rs reads those that are there",
    ),
    (
        "docs/real-flights.md",
        "it needs data that are downloaded; identify/tests/real.rs reads those that are there",
    ),
    ("docs/replay.md", "it downloads data; tests/runs/replay.rs flies those that are there"),
    ("docs/rig-delay.md", "tests/runs/scenarios.rs flies these manifests"),
    (
        "docs/set-points.md",
        "a person flies in the browser; tests/runs/by_hand.rs flies, and flies again, as a client",
    ),
    (
        "docs/timing.md",
        "`pgrep` finds processes of other runs on this machine; tests/faults/survival.rs kills those of its own",
    ),
    ("docs/tuning.md", "minutes of search; tests/runs/tune.rs tunes"),
    ("docs/validation-bus.md", "minutes of identification, and ten cases of scripts/next_flight_cases"),
    ("docs/validation-simulators.md", "a minute for each of its sets, and other simulators"),
    ("docs/validation.md", "its commands compile for release, and compute for up to twenty minutes"),
    ("docs/view.md", "each command serves a browser until it is ended; tests/runs/view.rs is such a client"),
    ("docs/walls.md", "tests/runs/scenarios.rs flies these manifests"),
    (
        "docs/your-drone.md",
        "minutes of identification; tests/runs/documentation.rs flies and reads the files of the page",
    ),
];

/// All commands of these pages that do not run as they are written.
static EXCEPTIONS: [Exception; 38] = [
    replaced(
        "scripts/fly",
        "target/release/hummingbus run manifests/hover.toml",
        "it compiles for release; this is what follows",
    ),
    replaced("wait", "wait $!", "the flight has to pass"),
    shortened(
        "scripts/make_flights walk --program target/release/hummingbus --fit 1 --test 2 --seed 7 --effect com-offset:x=0.006",
        "scripts/make_flights walk --program target/release/hummingbus --fit 1 --test 2 --seed 7 --effect com-offset:x=0.006 \
         --set run.duration_s=3 || test -e walk/flights.toml",
        "two flights of 40 s",
    ),
    left_out(
        "hummingbus identify walk/flights.toml --out walk/identified",
        "it takes minutes here; tests/runs/identify.rs identifies",
    ),
    left_out("scripts/test", "it runs these tests"),
    left_out(
        "tar -C /usr/local -xzf hummingbus-VERSION-amd64-glibc-2.35.tar.gz",
        "scripts/package makes the tarball, and flies from it",
    ),
    replaced(
        "hummingbus run /usr/share/hummingbus/manifests/hover.toml --record hover.mcap",
        "hummingbus run manifests/hover.toml --record hover.mcap",
        "nothing is installed; scripts/package flies what it has installed",
    ),
    left_out("hummingbus view hover.mcap", "it serves a browser until it is ended: tests/runs/view.rs"),
    left_out(
        "hummingbus view hover.mcap heavy.mcap",
        "it serves a browser until it is ended: tests/runs/view.rs",
    ),
    shortened(
        "hummingbus campaign campaign.toml --out campaign",
        "sed 's/^flights = 50$/flights = 4/' campaign.toml >few.toml\nhummingbus campaign few.toml --out campaign",
        "50 flights",
    ),
    replaced(
        "cargo build --release --manifest-path controller/Cargo.toml",
        "mkdir -p controller/target/release\n\
         ln -s \"$BUILT/examples/project_controller\" controller/target/release/controller",
        "it compiles for release; the same controller is built with the tests",
    ),
    left_out(
        "cargo test --manifest-path controller/Cargo.toml",
        "it compiles; tests/project_controller.rs runs the same test",
    ),
    negative(
        "hummingbus run --from manifests/hover.6000.ckpt --set process.plant.vehicle.body.mass=0.55 --record heavy.mcap",
        "the heavier vehicle sinks",
    ),
    negative(
        "hummingbus run --from manifests/hover.6000.ckpt --set process.plant.vehicle.body.mass=0.60 --record heavier.mcap",
        "the heavier vehicle sinks",
    ),
    negative("hummingbus diff heavy.mcap heavier.mcap", "they differ"),
    negative(
        "hummingbus run --from manifests/hover.6000.ckpt --set process.controller.gains=../controllers/gains/pid.toml \
         --set process.controller.gains.roll.derivative=9 --record damped.mcap",
        "roll follows late",
    ),
    left_out(
        "hummingbus run --from manifests/hover.6000.ckpt --fork 100 \
         --set process.controller.gains=../controllers/gains/pid.toml \
         --vary process.controller.gains.roll.derivative=factor:uniform:0.9,1.1 --out target/gains",
        "100 flights; tests/runs/forks.rs forks",
    ),
    left_out(
        "hummingbus run --from manifests/hover.6000.ckpt --fork 100 \
         --vary process.plant.vehicle.body.mass=factor:uniform:0.9,1.1",
        "100 flights; tests/runs/forks.rs forks",
    ),
    left_out("hummingbus ctl pause", "no run is alive; tests/runs/rewinds.rs has one"),
    left_out("hummingbus ctl rewind", "no run is alive; tests/runs/rewinds.rs has one"),
    left_out("hummingbus ctl resume", "no run is alive; tests/runs/rewinds.rs has one"),
    replaced(
        "hummingbus swap controller --with my-controller.toml",
        "hummingbus swap controller --with my-controller.toml\nhummingbus ctl stop",
        "the flight of the test ends",
    ),
    negative(
        "hummingbus run first.toml --set process.plant.vehicle.body.mass=0.53 --record heavy.mcap",
        "the heavier vehicle sinks",
    ),
    left_out(
        "hummingbus view first.mcap heavy.mcap",
        "it serves a browser until it is ended: tests/runs/view.rs",
    ),
    left_out("pip install rerun-sdk==0.41.0 mcap-ros2-support", "tests/readers/requirements.txt has them"),
    left_out("python3 scripts/rerun_view.py hover.mcap hover.rrd", "tests/readers/plot.rs runs it"),
    left_out("rerun hover.rrd", "it opens a window"),
    left_out("cargo build --release", "it compiles for release"),
    shortened(
        "scripts/make_flights walk --program target/release/hummingbus --fit 1 --test 2 --seed 7 --effect com-offset:x=0.006 \
         --effect command-delay:delay=0.02",
        "scripts/make_flights walk --program target/release/hummingbus --fit 1 --test 2 --seed 7 --effect com-offset:x=0.006 \
         --effect command-delay:delay=0.02 --set run.duration_s=3 || test -e walk/flights.toml",
        "two flights of 40 s",
    ),
    left_out(
        "target/release/hummingbus identify walk/flights.toml --out walk/identified",
        "it takes minutes here; tests/runs/identify.rs identifies",
    ),
    left_out(
        "hummingbus run manifests/hover.toml --pace realtime --foxglove",
        "its address is one for the whole machine; tests/runs/foxglove.rs takes free ones",
    ),
    shortened(
        "scripts/make_flights DIR --program target/release/hummingbus --fit 1 --fit 2 --test 3 --seed 5",
        "scripts/make_flights DIR --program target/release/hummingbus --fit 1 --fit 2 --test 3 --seed 5 \
         --set run.duration_s=3 || test -e DIR/flights.toml",
        "three flights of 40 s",
    ),
    left_out(
        "HUMMINGBUS_STAND=$PWD/stand.mcap hummingbus identify rotor flights/stands/propeller-steps-noisy.toml \
         DIR/flights.toml --out rotor",
        "it takes minutes here; tests/runs/identify.rs identifies",
    ),
    shortened(
        "hummingbus run manifests/hexa-hover.toml",
        "hummingbus check manifests/hexa-hover.toml",
        "tests/runs/scenarios.rs flies it, too",
    ),
    shortened(
        "hummingbus run manifests/octo-hover.toml",
        "hummingbus check manifests/octo-hover.toml",
        "tests/runs/scenarios.rs flies it, too",
    ),
    shortened(
        "scripts/make_flights hexa --declared $V --fit 1 --test 2 --effect weak-rotor:loss_5=0.1 \
         --set process.controller.vehicle=$V \
         --set \"process.plant.inputs.command.initial.command=[0.523, 0.523, 0.523, 0.523, 0.523, 0.523]\"",
        "scripts/make_flights hexa --declared $V --fit 1 --test 2 --effect weak-rotor:loss_5=0.1 \
         --set process.controller.vehicle=$V \
         --set \"process.plant.inputs.command.initial.command=[0.523, 0.523, 0.523, 0.523, 0.523, 0.523]\" \
         --set run.duration_s=3 || test -e hexa/flights.toml",
        "two flights of 40 s",
    ),
    left_out(
        "hummingbus identify hexa/flights.toml --out hexa/identified",
        "it takes minutes here; tests/runs/identify.rs identifies",
    ),
    replaced(
        "hummingbus clean",
        "hummingbus clean --dry-run",
        "other tests look at what their dead runs left; tests/runs/clean.rs runs it",
    ),
];

/// The names of all pages with a block for the shell.
fn all() -> BTreeSet<String> {
    let within = |folder: &'static str| {
        let names = fs::read_dir(repository(folder)).unwrap().map(|entry| entry.unwrap().file_name());
        names.map(move |name| format!("{folder}/{}", name.to_string_lossy()))
    };
    let pages = within("docs").chain(within("docs/decisions")).filter(|page| page.ends_with(".md"));
    let pages = pages.chain([README, "CONTRIBUTING.md", "CHANGELOG.md"].map(str::to_owned));
    pages.filter(|page| !commands(page).is_empty()).collect()
}

/// The pages of this room that run.
fn running() -> Vec<&'static str> {
    [README, FIRST_HOUR, TUTORIAL].into_iter().chain(PAGES.iter().map(|page| page.name)).collect()
}

#[test]
fn every_page_runs_or_has_a_reason() {
    let left_out = LEFT_OUT.map(|(page, reason)| {
        println!("{page} is left out: {reason}");
        page
    });
    let listed: Vec<&str> = [&running()[..], &pages::PAGES, &left_out].concat();
    let unique: BTreeSet<String> = listed.iter().map(|page| (*page).to_owned()).collect();
    assert_eq!(unique.len(), listed.len(), "a page is listed twice");
    assert_eq!(unique, all(), "pages that are listed, and pages that have commands");
}

#[test]
fn every_exception_is_a_command_of_a_page() {
    require_commands(&EXCEPTIONS, &running());
}

/// Runs the commands of `page` in `place`, which make the files `made`; returns the number of those that have run.
fn run_page(place: &Place, page: &str, before: &str, made: &[&str]) -> usize {
    let count = run(place, page, &EXCEPTIONS, before, &[path()]);
    for file in made {
        assert!(Path::new(&place.path(file)).exists(), "{page}: no {file}");
    }
    count
}

#[test]
fn the_commands_of_the_readme_run() {
    let made = ["manifests/hover.mcap", "flown.mcap", "walk/flights.toml", "walk/excite-2.mcap"];
    assert_eq!(run_page(&copy(), README, "", &made), 7);
}

#[test]
fn the_commands_of_the_first_hour_run() {
    let controller = Path::new(HUMMINGBUS).with_file_name("examples/project_controller");
    assert!(controller.exists(), "{} is not built: cargo build --examples", controller.display());
    let place = copy();
    let made = ["hover.mcap", "hover.html", "heavy.mcap", "hover-rust.mcap", "swapped.mcap"];
    let made = made.map(|file| format!("drone/{file}"));
    let made: Vec<&str> = made.iter().map(String::as_str).chain(["drone/campaign/report.html"]).collect();
    assert_eq!(run_page(&place, FIRST_HOUR, "", &made), 15);
}

/// As the page says, `first.toml` holds its blocks, one below the other.
#[test]
fn the_commands_of_the_tutorial_run() {
    let place = copy();
    fs::write(place.path("manifests/first.toml"), blocks(TUTORIAL, "toml").join("\n")).unwrap();
    assert_eq!(run_page(&place, TUTORIAL, "", &["manifests/first.mcap", "manifests/heavy.mcap"]), 4);
}

#[test]
fn the_commands_of_the_other_pages_run() {
    for Page { name, before, made, .. } in cases("pages", PAGES, |page: &Page| page.is_quick) {
        let count = run_page(&copy(), name, before, made);
        println!("{name}: {count} commands have run");
    }
}
