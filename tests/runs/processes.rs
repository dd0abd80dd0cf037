//! Processes on the host: sidecars, commands, cores, priorities and environments.

use crate::nodes;
use crate::refusals::{endless, good, refused, refused_setting, refused_text, refused_with};
use crate::support::{Launch, Place, poll, repository};
use std::fs;
use std::path::Path;

/// Flies a script as a command beside the good manifest's nodes; it writes what it finds to a file.
#[test]
fn a_sidecar_runs_beside_the_ticks_and_ends_with_the_run() {
    let place = Place::new();
    let script = "touch \"$HUMMINGBUS_SCRATCH/a file\"; \
        echo \"$COLOUR $PWD ${HUMMINGBUS_NODE-none} $(basename \"$HUMMINGBUS_RUN\") $HUMMINGBUS_SCRATCH\" > \"$OUT\"; sleep 600";
    let (out, folder) = (place.path("out"), repository("docs"));
    let sidecar = format!(
        "\n[process.viewer]\nlockstep = false\ncommand = [\"${{HUMMINGBUS_UNSET:-sh}}\", \"-c\", {script:?}]\n\
         environment = {{ COLOUR = \"${{HUMMINGBUS_UNSET:-blue}}\", OUT = {out:?} }}\nworking_directory = {folder:?}\n"
    );
    let text = endless(&good()) + &sidecar;
    let path = place.write("beside.toml", text);
    place.call(&["check", &path]).with_code(0).prints(&["viewer (", "takes no part in the ticks"]);
    let mut launch = place.start(&["run", &path]);
    let written =
        await_it(&mut launch, || fs::read_to_string(&out).ok().filter(|written| written.ends_with('\n')));
    assert!(written.starts_with(&format!("blue {folder} none hummingbus-")), "{written}");
    // It leaves nothing behind, although the script would sleep on.
    let scratch = written.trim_end().rsplit(' ').next().unwrap().to_owned();
    assert!(scratch.ends_with("/viewer.scratch") && Path::new(&scratch).join("a file").exists(), "{written}");
    launch.signal(rustix::process::Signal::INT);
    launch.end().with_code(1);
    assert!(!Path::new(&scratch).exists(), "it goes with the run");
}

/// The tests' own program reads the file at the path that it is given.
#[test]
fn files_and_variables_among_the_parameters_of_a_command_are_resolved() {
    let place = Place::new();
    fs::create_dir(place.path("notes")).unwrap();
    place.write("notes/first.txt", "hello");
    let with = |others: &str| {
        let node = nodes::sender("reader", 1, &format!("parameters = {{ others = [[{others}]] }}"));
        place.write("files.toml", nodes::manifest(5, &[node]))
    };
    let path = with(
        "{ file = \"${HUMMINGBUS_UNSET:-notes}/first.txt\" }, { text = \"${HUMMINGBUS_UNSET:-hello}\" }",
    );
    place.call(&["run", &path, "--record", &place.path("a.mcap")]).flown();
    for unset in
        ["{ file = \"${HUMMINGBUS_UNSET}/first.txt\" }, \"\"", "\"\", { text = \"${HUMMINGBUS_UNSET}\" }"]
    {
        place
            .call(&["check", &with(unset)])
            .with_code(2)
            .says(&["files.toml:", "HUMMINGBUS_UNSET is not set"]);
    }
    // Other texts and tables are the program's.
    let path = with("\"${HUMMINGBUS_UNSET}/first.txt\", \"hello\"");
    place.call(&["run", &path, "--record", &place.path("b.mcap")]).with_code(2).says(&["No such file"]);
}

/// Looks again and again, while an endless run goes on.
fn await_it<T>(launch: &mut Launch<'_>, look: impl Fn() -> Option<T>) -> T {
    poll("it does not come", || {
        assert!(!launch.has_ended(), "the run has ended: {}", launch.errors());
        look()
    })
}

#[test]
fn a_sidecar_dies_with_a_launcher_that_is_killed() {
    let place = Place::new();
    let sidecar = "\n[process.viewer]\nlockstep = false\ncommand = [\"sleep\", \"600\"]\n";
    let text = endless(&good()) + sidecar;
    let mut launch = place.start(&["run", &place.write("beside.toml", text)]);
    // The launcher, the clock, seven nodes and the sidecar.
    await_it(&mut launch, || (place.processes().len() >= 10).then_some(()));
    launch.kill();
    place.await_no_process();
}

#[test]
fn a_sidecar_that_would_be_a_node() {
    let with = |more: &str| {
        refused_with(&format!("\n[process.viewer]\nlockstep = false\ncommand = [\"sleep\"]\n{more}\n"))
    };
    with("inputs.§state = \"/plant/state\"").says(&["`inputs` of `viewer`, which has lockstep = false"]);
    with("on_exit = §\"standby\"").says(&["`on_exit` of `viewer`", "nothing can stand by for it"]);
    refused("kind = \"imu\"", "kind = \"imu\"\non_exit = §\"ignore\"").says(&["`on_exit` of `imu`"]);
    refused("kind = \"imu\"", "kind = \"imu\"\nready = §\"notify\"").says(&["`ready` of `imu`"]);
    with("period_ticks = §2").says(&["`period_ticks` of `viewer`", "takes no part in the ticks"]);
    refused("kind = \"imu\"", "lockstep = false\nkind = §\"imu\"").says(&["`kind` of `imu`"]);
    refused("kind = \"imu\"", "kind = \"imu\"\nafter = [§\"viewer\"]")
        .says(&["`after` of `imu`", "leave it out"]);
}

#[test]
fn an_order_of_sidecars_that_cannot_be() {
    let with = |more: &str| {
        let sidecar =
            |name: &str| format!("\n[process.{name}]\nlockstep = false\ncommand = [\"sleep\", \"9\"]\n");
        let [viewer, server, store] = ["viewer", "server", "store"].map(sidecar);
        refused_with(&format!("{store}after = [\"viewer\"]\n{viewer}after = [\"server\"]\n{server}{more}\n"))
    };
    with("after = [§\"sorver\"]")
        .says(&["`after` of `server`: there is no process `sorver`", "did you mean `server`?"]);
    with("after = [§\"imu\"]")
        .says(&["`after` of `server`: `imu` takes part in the ticks", "lockstep = false"]);
    with("after = [§\"store\"]")
        .says(&["`after` of `server` is a circle: server after store after viewer after server"]);
    with("after = [§\"server\"]").says(&["`after` of `server` is a circle: server after server"]);
}

#[test]
fn a_command_that_is_not_there_or_not_executable() {
    let place = Place::new();
    let text = place.write("text", "no program");
    let with = |word: &str| refused("kind = \"imu\"", &format!("command = §[{word:?}]"));
    with("./none").says(&["process `imu`: cannot start ", "/none: there is no such file", "relative"]);
    with("./venv/bin/python").says(&["/venv/bin/python: there is no such file", "pip install", "README.md"]);
    with(&text).says(&["it is not executable", "chmod +x"]);
    with("no-such-program").says(&["cannot start `no-such-program`: no folder of PATH"]);
    with("").says(&["no folder of PATH"]);
    with("${HUMMINGBUS_UNSET}")
        .says(&["the program is `${HUMMINGBUS_UNSET}`", "HUMMINGBUS_UNSET is not set"]);
}

#[test]
fn a_core_that_the_machine_does_not_allow() {
    let cores = bus::process::allowed_cores().iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
    let list = format!("the allowed cores are {cores}");
    refused("kind = \"imu\"", "kind = \"imu\"\ncpu = §1000").says(&["`cpu` is 1000, a core", &list]);
    refused("window_ticks = 64", "clock_cpu = §1000").says(&["`clock_cpu` is 1000, a core", &list]);
    let manifest = repository("manifests/hover.toml");
    refused_setting(&manifest, &["process.plant.cpu=5000"]).says(&["`cpu` is 5000", &list]);
}

#[test]
fn host_settings_that_no_system_has() {
    let with = |key: &str| refused("kind = \"imu\"", &format!("kind = \"imu\"\n{key}"));
    with("nice = §20").says(&["`nice` is 20", "from -20 to 19"]);
    with("realtime_priority = §0").says(&["`realtime_priority` is 0", "from 1 to 99"]);
    with("nice = §20\nrealtime_priority = 0").says(&["`nice` is 20", "`realtime_priority` is 0"]);
    with("watchdog_ms_host = §0").says(&["`watchdog_ms_host` is 0"]);
    with("working_directory = §\"none\"").says(&["`working_directory`: ", "/none is no folder"]);
    with("log = §\"none/imu.log\"").says(&["`log`: the folder of ", "/none/imu.log is not there"]);
    with("log = §\".\"").says(&["is a folder"]);
    let twice = "kind = \"ekf\"\nlog = \"a.log\"";
    let marked = good().replace("kind = \"ekf\"", twice);
    let ended = refused_text(&marked.replace("kind = \"imu\"", "kind = \"imu\"\nlog = §\"./a.log\""));
    ended.says(&["`log`: `imu` writes to the file of `ekf`"]);
    with("environment.§HUMMINGBUS_SCRATCH = \"x\"").says(&["HUMMINGBUS_SCRATCH is set by the launcher"]);
    with("environment.§A = \"${HUMMINGBUS_UNSET}\"")
        .says(&["`environment.A` is", "HUMMINGBUS_UNSET is not set"]);
    with("environment.§HUMMINGBUS_RUN = \"x\"").says(&["HUMMINGBUS_RUN is set by the launcher"]);
    with("environment.§\"A=B\" = \"x\"").says(&["cannot be an environment variable"]);
    with("environment.A = §3").says(&["environment.A` must be a text, found 3"]);
    with("lockstep = §3").says(&["lockstep` must be true or false, found 3"]);
    with("command = §[\"sleep\"]").says(&["process `imu` has both `kind` and `command`"]);
}

#[test]
fn a_priority_is_given_or_refused_with_the_right_that_it_takes() {
    // Numbers of fields in proc_pid_stat(5): niceness, and priority under SCHED_FIFO.
    let keys = [("nice = -20", "ulimit -e", 19, "-20"), ("realtime_priority = 2", "ulimit -r", 40, "2")];
    for (key, limit, field, value) in keys {
        let place = Place::new();
        let text = good().replace("kind = \"imu\"", &format!("kind = \"imu\"\n{key}"));
        let ended = place.call(&["run", &place.write("priority.toml", &text)]);
        if ended.code == Some(0) {
            assert_eq!(running(&place, &text, |process| stat(process, field)), value, "{key}");
        } else {
            let ended = ended.with_code(2);
            ended.says(&[&format!("process `imu`: `{key}` is refused: "), "CAP_SYS_NICE", limit]);
        }
    }
}

#[test]
fn niceness_and_generation_reach_the_process() {
    let text = good().replace("kind = \"imu\"", "kind = \"imu\"\nnice = 7");
    let look = |process: &str| (stat(process, 19), fs::read_to_string(format!("{process}/environ")).unwrap());
    let (nice, environment) = running(&Place::new(), &text, look);
    assert_eq!(nice, "7");
    assert!(environment.split('\0').any(|variable| variable == "HUMMINGBUS_GENERATION=0"), "{environment}");
}

/// Returns the result of `look` for the folder of /proc of the IMU, amid a long run of `text`.
fn running<T>(place: &Place, text: &str, look: impl Fn(&str) -> T) -> T {
    let mut launch = place.start(&["run", &place.write("running.toml", endless(text))]);
    launch.await_ticks(50);
    let found = look(&format!("/proc/{}", place.process_of("imu").as_raw_nonzero()));
    launch.kill();
    place.await_no_process();
    found
}

/// Field `number` of a process's proc_pid_stat(5); the third, behind the name in brackets, is its state.
fn stat(process: &str, number: usize) -> String {
    let text = fs::read_to_string(format!("{process}/stat")).unwrap();
    let fields = text.rsplit(')').next().unwrap();
    fields.split_whitespace().nth(number - 3).unwrap().to_owned()
}
