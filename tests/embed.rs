//! Runs in this very process: nodes on threads, two at a time, stopped, steered, and nodes that fail.

use hummingbus::bus::plan::GroupPlan;
use hummingbus::flights::FlightSet;
use hummingbus::report::validate::Validation;
use hummingbus::{
    Answer, COMPONENTS, Composition, Host, Launcher, Manifest, Pace, Request, RunEvent, StopToken,
};
use std::path::{Path, PathBuf};

fn hover() -> Manifest {
    hummingbus::load(concat!(env!("CARGO_MANIFEST_DIR"), "/manifests/hover.toml")).unwrap()
}

fn threads() -> Launcher<'static> {
    Launcher::new(Host::Threads)
}

/// The bytes of a recording of `manifest`.
fn recorded(launcher: Launcher<'_>, manifest: &Manifest, path: PathBuf) -> Vec<u8> {
    launcher.fly(manifest, &path).unwrap();
    std::fs::read(path).unwrap()
}

fn exe() -> Host {
    Host::Exe(env!("CARGO_BIN_EXE_hummingbus").into())
}

#[test]
fn threads_and_processes_record_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let manifest = hover().set("run.duration_s", 0.5).unwrap();
    let of_threads = recorded(threads(), &manifest, folder.path().join("threads.mcap"));
    let of_processes = recorded(Launcher::new(exe()), &manifest, folder.path().join("processes.mcap"));
    assert!(of_threads.len() > 100_000);
    assert!(of_threads == of_processes, "{} and {} bytes", of_threads.len(), of_processes.len());
}

#[test]
fn two_runs_in_one_process_do_not_disturb_each_other() {
    /// The signals that this process handles itself, or ignores.
    fn signals() -> Vec<String> {
        let status = std::fs::read_to_string("/proc/self/status").unwrap();
        status
            .lines()
            .filter(|line| line.starts_with("SigCgt") || line.starts_with("SigIgn"))
            .map(str::to_owned)
            .collect()
    }
    let before = signals();
    let folder = tempfile::tempdir().unwrap();
    let manifest = hover().set("run.duration_s", 0.5).unwrap();
    let alone = recorded(threads(), &manifest, folder.path().join("alone.mcap"));
    std::thread::scope(|scope| {
        let runs = ["a.mcap", "b.mcap"].map(|name| {
            let (path, manifest) = (folder.path().join(name), &manifest);
            scope.spawn(move || recorded(threads(), manifest, path))
        });
        runs.into_iter().for_each(|run| assert!(run.join().unwrap() == alone));
    });
    assert_eq!(signals(), before);
    assert!(rustix::process::child_subreaper().unwrap().is_none());
}

#[test]
fn a_run_is_followed_steered_and_stopped_from_another_thread() {
    let folder = tempfile::tempdir().unwrap();
    let manifest = hover().set("run.duration_s", 1000.0).unwrap();
    let (token, mut progress) = (StopToken::new(), 0);
    let launcher = threads().stopped_by(&token);
    let remote = launcher.remote();
    let launcher = launcher.followed_by(|event| {
        if let RunEvent::Progress(now) = event {
            progress = now.ticks;
        }
    });
    let (outcome, swapped) = std::thread::scope(|scope| {
        let steering = scope.spawn(move || {
            let Answer::Done { tick, .. } = remote.ask(Request::Pause) else { panic!("not paused") };
            let Answer::Done { tick: stepped, .. } = remote.ask(Request::Step { ticks: 7 }) else {
                panic!("not stepped")
            };
            assert_eq!(stepped, tick + 7);
            assert!(matches!(remote.ask(Request::Resume), Answer::Done { .. }));
            let swap = Request::Swap {
                process: "controller".to_owned(),
                with: String::new(),
                shadow_ticks: Some(20),
                at_tick: None,
            };
            let swapped = remote.ask(swap);
            token.stop();
            swapped
        });
        let (outcome, _) = launcher.fly(&manifest, &folder.path().join("a.mcap")).unwrap();
        (outcome, steering.join().unwrap())
    });
    assert!(matches!(swapped, Answer::Done { .. }), "{swapped:?}");
    assert!(outcome.was_stopped && outcome.ticks > 20);
    assert_eq!(progress, outcome.ticks);
    assert!(outcome.replacements[0].take_over_tick.is_some(), "{:?}", outcome.replacements);
}

#[test]
fn what_threads_cannot_have_is_refused_in_words() {
    let refused = |key: &str, value: toml::Value| {
        let manifest = hover().set(key, value).unwrap();
        threads().fly(&manifest, Path::new("/tmp/never.mcap")).map(|_| ()).unwrap_err().to_string()
    };
    for (key, value) in [
        ("process.imu.nice", 1.into()),
        ("process.imu.cpu", 0.into()),
        ("process.imu.log", "/tmp/never.log".into()),
        ("run.lock_memory", true.into()),
    ] {
        let (message, name) = (refused(key, value), key.rsplit('.').next().unwrap());
        assert!(message.contains(name) && message.contains("needs a process of its own"), "{message}");
    }
}

/// Settings of a flight's plan, and the bytes of its recording.
fn settings_and_bytes(
    launcher: Launcher<'_>,
    manifest: &Manifest,
    path: &Path,
) -> ((Pace, u32, Vec<GroupPlan>, bool), Vec<u8>) {
    let (graph, ..) = launcher.fly_planned(manifest, path).unwrap();
    let plan = graph.plan;
    ((plan.pace, plan.window_ticks, plan.groups, plan.profile), std::fs::read(path).unwrap())
}

#[test]
fn an_option_of_the_launcher_is_the_key_of_the_manifest() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("option.mcap");
    let short = || hover().set("run.duration_s", 0.2).unwrap();
    let (settings, bytes) = settings_and_bytes(threads(), &short(), &path);
    let groups = Composition::Groups(vec![vec!["imu".to_owned(), "ekf".to_owned()]]);
    let cases: [(Launcher<'_>, &str, toml::Value); 6] = [
        (threads().paced(Pace::REAL_TIME), "run.pace", "realtime".into()),
        (threads().paced(Pace::Factor(4.0)), "run.pace", 4.0.into()),
        (threads().with_window(3), "run.window_ticks", 3.into()),
        (threads().composed(Composition::All), "run.compose", "all".into()),
        (threads().composed(groups), "run.compose", "imu+ekf".into()),
        (threads().profiled(), "run.profile", true.into()),
    ];
    for (launcher, key, value) in cases {
        let by_option = settings_and_bytes(launcher, &short(), &path);
        let by_key = settings_and_bytes(threads(), &short().set(key, value).unwrap(), &path);
        assert_eq!(by_option.0, by_key.0, "{key}");
        assert_ne!(by_option.0, settings, "{key}");
        assert!(by_option.1 == by_key.1 && by_option.1 == bytes, "{key}");
    }
    // An option takes the place of the key.
    let stated = short().set("run.pace", 2.0).unwrap();
    let (freed, _) = settings_and_bytes(threads().paced(Pace::Free), &stated, &path);
    assert_eq!(freed, settings);
}

#[test]
fn a_shadow_of_the_launcher_is_that_of_the_manifest() {
    let folder = tempfile::tempdir().unwrap();
    let short = || hover().set("run.duration_s", 0.2).unwrap();
    let with = toml::toml! { parameters = { gains = { altitude = {
        proportional_1_s2 = 9.0, integral_1_s3 = 2.0, derivative_1_s = 6.0
    } } } };
    let launcher = threads().shadowing("controller", with.clone());
    let by_option = recorded(launcher, &short(), folder.path().join("option.mcap"));
    let mut shadow = toml::Table::new();
    shadow.insert("process".to_owned(), "controller".into());
    shadow.insert("with".to_owned(), with.clone().into());
    let mut stated = short().set("shadow", vec![shadow]).unwrap();
    // The recording holds the text of the manifest, which an option does not change.
    stated.recorded_text = short().recorded_text;
    let by_key = recorded(threads(), &stated, folder.path().join("key.mcap"));
    assert!(by_option == by_key, "{} and {} bytes", by_option.len(), by_key.len());

    let launcher = threads().shadowing("controller", with.clone());
    let flown = hummingbus::fly(launcher, &short(), folder.path().join("judged.mcap")).unwrap();
    assert!(flown.summary.to_string().contains("shadow of `controller`"), "{}", flown.summary);

    let twice = threads().shadowing("controller", with.clone()).shadowing("controller", with);
    let error = twice.fly(&short(), &folder.path().join("twice.mcap")).unwrap_err();
    assert!(error.is_input() && error.to_string().contains("`controller` has a swap"), "{error}");
}

#[test]
fn a_faulty_option_is_an_error_of_the_input_that_names_it() {
    let groups = Composition::Groups(vec![vec!["imu".to_owned(), "ekg".to_owned()]]);
    for (launcher, texts) in [
        (threads().paced(Pace::Factor(f64::NAN)), ["run.pace=NaN of the launcher", "is not a pace"]),
        (threads().paced(Pace::Factor(1e9)), ["run.pace=1000000000 of the launcher", "is not a pace"]),
        (threads().with_window(0), ["run.window_ticks=0 of the launcher", "`window_ticks` is 0"]),
        (threads().composed(groups), ["run.compose=imu+ekg of the launcher", "names `ekg`"]),
        (threads().shadowing("nix", toml::Table::new()), ["hover.toml", "there is no process `nix`"]),
    ] {
        let error = launcher.fly(&hover(), Path::new("/tmp/never.mcap")).unwrap_err();
        let text = error.to_string();
        assert!(error.is_input() && texts.iter().all(|part| text.contains(part)), "{text}");
    }
}

#[test]
fn one_thread_has_neither_a_profile_nor_a_shadow() {
    let here = || Launcher::new(Host::InProcess);
    for (launcher, asked) in [
        (here().profiled(), "a profile"),
        (here().shadowing("controller", toml::Table::new()), "another process for `controller`"),
    ] {
        let error = launcher.fly(&hover(), Path::new("/tmp/never.mcap")).unwrap_err();
        assert!(error.to_string().contains(asked), "{error}");
    }
}

/// This test is a program that embeds the library: executed once more, it would run its tests.
#[test]
fn flights_are_flown_again_in_this_thread_or_on_threads() {
    let folder = tempfile::tempdir().unwrap();
    let repository = Path::new(env!("CARGO_MANIFEST_DIR"));
    let manifest = hummingbus::load(repository.join("manifests/identify/hover-gentle.toml")).unwrap();
    let manifest = manifest.set("run.duration_s", 2.001).unwrap();
    recorded(Launcher::new(Host::InProcess), &manifest, folder.path().join("flown.mcap"));
    let vehicle = repository.join("vehicles/hummingbird.toml");
    let text = format!(
        "vehicle = {vehicle:?}\n[channels]\ncommand = {{ topic = \"/controller/command\" }}\n\
         position = {{ topic = \"/mocap/mocap\" }}\nattitude = {{ topic = \"/mocap/mocap\" }}\n\
         angular_velocity = {{ topic = \"/imu/imu\" }}\n\
         [[flight]]\nname = \"course\"\nfile = \"flown.mcap\"\nrole = \"test\"\n"
    );
    std::fs::write(folder.path().join("flights.toml"), text).unwrap();
    let flights = FlightSet::load(&folder.path().join("flights.toml")).unwrap();
    let stop = StopToken::new();
    let here = Validation::new(COMPONENTS, &stop);
    let threads = Validation { host: Host::Threads, ..here.clone() };
    let errors =
        |how: &Validation<'_>| how.errors(&[vehicle.as_path()], &flights, &mut |_| {}).unwrap().json();
    let (here, of_threads) = (errors(&here), errors(&threads));
    assert!(here["flights"]["course"]["horizons"]["0.5"]["windows"].as_u64().unwrap() > 0, "{here}");
    assert_eq!(here, of_threads);
}

#[test]
fn a_flight_has_its_warnings_its_profile_and_the_vehicles_that_were_not_compared() {
    let folder = tempfile::tempdir().unwrap();
    // The set points of the hover come after the end.
    let short = || hover().set("run.duration_s", 0.2).unwrap();
    let fly = |host: Host, manifest: &Manifest| {
        hummingbus::fly(Launcher::new(host), manifest, folder.path().join("short.mcap")).unwrap()
    };
    let launcher = Launcher::new(Host::Threads).profiled();
    let flown = hummingbus::fly(launcher, &short(), folder.path().join("profiled.mcap")).unwrap();
    assert!(flown.profile.is_some());
    let flown = fly(Host::Threads, &short().set("run.profile", true).unwrap());
    let warnings = &flown.summary.warnings;
    assert!(
        warnings.iter().any(|warning| warning.to_string().contains("`duration_s` is 0.2 s")),
        "{warnings:?}"
    );
    assert!(flown.profile.unwrap().to_string().contains("controller"));
    assert!(flown.summary.unevaluated.is_empty(), "a recording is compared");

    let limit = "{ value = 2.0, unit = \"m\", source = \"a test\", uncertainty = \"none\" }";
    let base = Path::new(env!("CARGO_MANIFEST_DIR")).join("vehicles/hummingbird.toml");
    let vehicle = folder.path().join("validated.toml");
    let text = format!("name = \"validated\"\nbase = {base:?}\n\n[envelope]\nheight_max = {limit}\n");
    std::fs::write(&vehicle, text).unwrap();
    let unrecorded = short().set("process.plant.vehicle", vehicle.to_str().unwrap()).unwrap();
    let flown = fly(Host::InProcess, &unrecorded.set("run.record", "none").unwrap());
    assert_eq!(flown.summary.unevaluated, ["validated"]);
    assert!(flown.recording.is_none() && flown.profile.is_none());
}
