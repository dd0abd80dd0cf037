//! Backups in manifests: what swaps, shadows and standbys become, and those that are refused.

use crate::manifests::{graph, node};
use crate::nodes::{manifest, sender, table};
use crate::refusals::{good, refused, refused_text, refused_with};
use crate::support::Place;
use serde_json::Value;

/// The good manifest with a swap of the controller, its keys `keys`.
fn swap(keys: &str) -> String {
    format!("\n§[[swap]]\nprocess = \"controller\"\n{keys}\n")
}

#[test]
fn a_swap_joins_before_it_takes_over() {
    let place = Place::new();
    let swap = "\n[[swap]]\nprocess = \"controller\"\nat_s = 0.05\nshadow_ticks = 9\nrepeat = 3\nevery_ticks = 30\n\
                with = { parameters.gains.altitude_integral_max_m_s2 = 1.0 }\n";
    let path = place.write("swap.toml", good().replace("0.1\nwindow", "0.2\nwindow") + swap);
    let graph = graph(&path, &[]);
    let ticks = |backup: &Value| (backup["join_tick"].as_u64(), backup["take_over_tick"].as_u64());
    let backups = graph["backups"].as_array().unwrap();
    let found: Vec<_> = backups.iter().map(ticks).collect();
    assert_eq!(found, [(41, 50), (71, 80), (101, 110)].map(|(join, take)| (Some(join), Some(take))));
    for backup in backups {
        let plan = &backup["plan"];
        assert_eq!(plan["parameters"]["gains"]["altitude_integral_max_m_s2"], 1.0);
        assert_eq!(plan["parameters"]["vehicle"], node(&graph, "controller")["parameters"]["vehicle"]);
        for key in ["name", "inputs", "outputs", "period_ticks", "cpu", "wait"] {
            assert_eq!(plan[key], node(&graph, "controller")[key], "{key}");
        }
    }
}

#[test]
fn a_shadow_and_a_standby_are_there_from_the_first_tick() {
    let place = Place::new();
    let shadow = "\n[[shadow]]\nprocess = \"imu\"\nwith = { parameters.gyroscope_range_rad_s = 3.0 }\n";
    let standby = "kind = \"pid\"\non_exit = \"standby\"\nstandby = { wait = \"spin\" }";
    let path = place.write("s.toml", good().replace("kind = \"pid\"", standby) + shadow);
    let graph = graph(&path, &[]);
    let [standby, shadow] = [0, 1].map(|index| &graph["backups"][index]);
    for (backup, process, is_standby) in [(standby, "controller", true), (shadow, "imu", false)] {
        assert_eq!(backup["process"], process);
        assert_eq!((&backup["join_tick"], &backup["take_over_tick"]), (&0.into(), &Value::Null));
        assert_eq!(backup["is_standby"], is_standby);
    }
    assert_eq!(standby["plan"]["wait"], "spin");
    assert_eq!(shadow["plan"]["parameters"]["gyroscope_range_rad_s"], 3.0);
    let ended = place.call(&["check", &path]).with_code(0);
    ended.prints(&["if it ends, pid is promoted, which shadows it", "shadowed by imu"]);
}

#[test]
fn a_backup_of_another_kind_has_parameters_and_inputs_of_its_own() {
    let place = Place::new();
    let other = table("other", "").replace("[process.other]\ncommand = ", "");
    let with = format!("command = {}, inputs.set_point = \"/pilot/set_point\"", other.trim());
    let swap = format!(
        "\n[[swap]]\nprocess = \"controller\"\nat_tick = 50\nshadow_ticks = 9\nwith = {{ {with} }}\n"
    );
    let path = place.write("other.toml", good() + &swap);
    let graph = graph(&path, &[]);
    let plan = &graph["backups"][0]["plan"];
    assert_eq!(plan["parameters"], serde_json::json!({}));
    assert_eq!(plan["inputs"].as_array().unwrap().len(), 1);
    // What it publishes is what the process before it publishes.
    assert_eq!(plan["outputs"], node(&graph, "controller")["outputs"]);
}

#[test]
fn a_swap_that_comes_too_early_too_late_or_between_two_computations() {
    let at = |keys: &str, more: &str| {
        let text =
            swap(keys).replace('§', "").replace("at_tick = ", "at_tick = §").replace("at_s = ", "at_s = §");
        refused_text(&(good().replace("kind = \"pid\"", &format!("kind = \"pid\"\n{more}")) + &text))
    };
    at("at_tick = 50", "").says(&["would join 100 ticks before, ahead of tick 1", "lower `shadow_ticks`"]);
    at("at_tick = 9\nshadow_ticks = 9", "").says(&["ahead of tick 1"]);
    at("at_tick = 100\nshadow_ticks = 9", "").says(&["tick 100 lies beyond the run, which has 100 ticks"]);
    let ended = at("at_tick = 50\nshadow_ticks = 9\nrepeat = 6\nevery_ticks = 10", "");
    ended.says(&["the take-over at tick 100 lies beyond the run"]);
    let ended = at("at_tick = 50\nshadow_ticks = 9", "period_ticks = 4");
    ended.says(&["it takes over at tick 50, but `controller` computes every 4 ticks"]);
    let ended = at("at_tick = 52\nshadow_ticks = 9", "period_ticks = 4");
    ended.says(&["it joins at tick 43, but `controller` computes every 4 ticks"]);
    at("at_s = 0.05005", "").says(&["`at_s` is 0.05005 s, which is 50.05 ticks"]);
    at("at_s = nan", "").says(&["`swap.0.at_s` is nan, expected a finite number"]);
}

#[test]
fn a_swap_whose_times_say_too_little_or_too_much() {
    refused_with(&swap("")).says(&["the swap has no time", "add at_tick"]);
    refused_with(&swap("at_tick = 50\nshadow_ticks = 0")).says(&["`shadow_ticks` is 0"]);
    let marked = |keys: &str| refused_with(&(swap("").replace('§', "") + keys + "\n"));
    marked("at_tick = 50\nat_s = §0.05").says(&["both `at_tick` and `at_s`"]);
    marked("at_tick = 50\nshadow_ticks = 9\nrepeat = §2").says(&["`repeat` without `every_ticks`"]);
    marked("at_tick = 50\nshadow_ticks = 9\nevery_ticks = §2").says(&["`every_ticks` without `repeat`"]);
    marked("at_tick = 50\nshadow_ticks = 9\nevery_ticks = 2\nrepeat = §0").says(&["`repeat` is 0"]);
    marked("§at_tik = 50\nshadow_ticks = 9")
        .says(&["unknown key `swap.0.at_tik`", "did you mean `at_tick`?"]);
}

#[test]
fn backups_of_one_process_that_are_there_at_the_same_time() {
    let first = swap("at_tick = 30\nshadow_ticks = 9").replace('§', "");
    let ended = refused_with(&(first.clone() + &swap("at_tick = 40\nshadow_ticks = 9")));
    ended.says(&["would join at tick 31, too soon after the take-over at tick 30", "at tick 42 or later"]);
    let ended = refused_with(&swap("at_tick = 30\nshadow_ticks = 9\nrepeat = 2\nevery_ticks = 12"));
    ended.says(&["would join at tick 33, too soon after the take-over at tick 30"]);
    let shadow = "\n[[shadow]]\nprocess = \"controller\"\n";
    let ended = refused_with(&(shadow.to_owned() + &swap("at_tick = 30\nshadow_ticks = 9")));
    ended.says(&["`controller` has a shadow already", "one shadow at a time"]);
    let standby = good().replace("kind = \"pid\"", "kind = \"pid\"\non_exit = \"standby\"");
    let ended = refused_text(&(standby + &swap("at_tick = 30\nshadow_ticks = 9")));
    ended.says(&["`controller` has a standby already"]);
}

#[test]
fn a_process_that_cannot_be_succeeded() {
    let of = |process: &str| {
        let text = swap("at_tick = 30\nshadow_ticks = 9").replace('§', "");
        refused_with(&text.replace("\"controller\"", &format!("§\"{process}\"")))
    };
    of("contorller").says(&["there is no process `contorller`", "did you mean `controller`?"]);
    of("recorder").says(&["`recorder` cannot be replaced: it is the recorder, and its file would be torn"]);
    let kept = |text: &str| refused_with(&format!("\n{text}"));
    let sink = table("sink", "inputs.input = \"/imu/imu\"\non_exit = §\"restart\"");
    kept(&sink).says(&["`on_exit` of `sink`: it has no outputs"]);
    let recorder = "kind = \"recorder\"\n";
    refused(recorder, &format!("{recorder}on_exit = §\"restart\"\n"))
        .says(&["`on_exit` of `recorder`", "torn"]);
    refused("kind = \"pid\"", "kind = \"pid\"\nstandby = §{}").says(&["nothing stands by", "on_exit ="]);
    refused("kind = \"pid\"", "kind = \"pid\"\non_exit = §\"revive\"").says(&["`revive`", "`restart`"]);
}

#[test]
fn a_backup_that_would_not_fit_the_graph() {
    let swap = |with: &str| {
        let head = "\n[[swap]]\nprocess = \"controller\"\nat_tick = 50\nshadow_ticks = 9\n";
        refused_with(&format!("{head}[swap.with]\n{with}\n"))
    };
    swap("§period_ticks = 2").says(&["a backup cannot have another `period_ticks`"]);
    swap("§outputs.command.topic = \"/x\"").says(&["a backup cannot have another `outputs`"]);
    swap("§knid = \"pid\"").says(&["unknown key `swap.0.with.knid`"]);
    swap("kind = §\"pdi\"").says(&["there is no kind `pdi`"]);
    let inputs = "inputs.set_point = \"/pilot/set_point\"\n";
    let ended = swap(&format!("{inputs}inputs.§estimate = \"/plant/stat\""));
    ended.says(&["input `estimate` of `controller`: nobody publishes /plant/stat"]);
    let ended = swap("parameters.§gain = 3");
    ended.says(&["process `controller`", "unknown key `gain`"]);
    swap("parameters = §3").says(&["with.parameters` must be a table, found 3"]);
    let at_swap = |with: &str| {
        let head = "\n§[[swap]]\nprocess = \"controller\"\nat_tick = 50\nshadow_ticks = 9\n";
        refused_with(&format!("{head}[swap.with]\n{with}\n"))
    };
    at_swap("inputs = {}").says(&["process `controller` has no publisher for its input"]);
    let pilot =
        "\n§[[swap]]\nprocess = \"pilot\"\nat_tick = 50\nshadow_ticks = 9\nwith = { kind = \"operator\" }\n";
    refused_with(pilot).says(&[
        "add parameters.initial_altitude_m = … to the keys of the backup",
        "a backup of another kind keeps `inputs`, and `vehicle` and `scene` if that kind reads them, but neither `parameters` nor `gains`",
    ]);
    let ended = at_swap("kind = \"imu\"\ninputs = { state = \"/plant/state\" }");
    ended.says(&["the kind `imu` publishes `imu` [hummingbus_msgs/msg/Imu]"]);
    ended.says(&[
        "`controller`, which it would replace, publishes `command` [hummingbus_msgs/msg/MotorCommand]",
    ]);
}

#[test]
fn a_backup_that_would_close_a_cycle_or_has_too_many_inputs() {
    let [a, b] = [sender("a", 1, ""), sender("b", 1, "inputs.input = \"/a/note\"")];
    let base = manifest(100, &[a, b]);
    let swap = |inputs: &str| {
        let head = "\n§[[swap]]\nprocess = \"a\"\nat_tick = 50\nshadow_ticks = 9\n";
        refused_text(&format!("{base}{head}with = {{ inputs = {{ {inputs} }} }}\n"))
    };
    swap("input = \"/b/note\"").says(&["a cycle without delay: ", "a → b"]);
    let many: Vec<String> = (0..9)
        .map(|port| format!("i{port} = {{ topic = \"/b/note\", delay_ticks = 1, initial = {{}} }}"))
        .collect();
    swap(&many.join(", ")).says(&["the backup of `a` has 9 inputs", "it may have 8"]);
}
