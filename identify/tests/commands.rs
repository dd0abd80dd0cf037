//! Commands that were not logged all the time, and flights whose commands or motion are missing.
use crate::simulated;
use crate::skipped::{is_left, quick_or};
use flights::{Channel, Flight, FlightSet};
use identify::report::{Estimate, Report};
use identify::run::identify;
use simulated::cases::Case;
use vehicles::ROTORS_MAX;

/// Flights of a vehicle that is 8 % heavier than declared.
fn heavy(duration_s: f64) -> Case {
    let mut case = Case::null(81, duration_s);
    case.plan.truth = vec![simulated::effect("mass-error", &[("error", 0.08)])];
    case
}

fn changed(case: &Case, change: impl Fn(&mut Flight)) -> FlightSet {
    let mut set = case.flights();
    set.flights.iter_mut().for_each(change);
    set
}

fn found(set: &FlightSet) -> Report {
    identify(set, &mut |_| ()).unwrap_or_else(|error| panic!("{error}")).report
}

fn refused(set: &FlightSet) -> String {
    identify(set, &mut |_| ()).expect_err("flights that cannot be used").to_string()
}

fn keep<const N: usize>(channel: &mut Channel<N>, is_kept: impl Fn(usize, f64) -> bool) {
    let kept: Vec<usize> = (0..channel.time_s.len()).filter(|at| is_kept(*at, channel.time_s[*at])).collect();
    channel.time_s = kept.iter().map(|at| channel.time_s[*at]).collect();
    channel.values = kept.iter().map(|at| channel.values[*at]).collect();
}

fn keep_all(flight: &mut Flight, is_kept: impl Fn(usize, f64) -> bool) {
    keep(&mut flight.command, &is_kept);
    keep(&mut flight.position, &is_kept);
    keep(&mut flight.attitude, &is_kept);
    keep(&mut flight.angular_velocity, &is_kept);
    keep(&mut flight.specific_force, &is_kept);
}

#[track_caller]
fn require_mass(report: &Report) {
    assert_eq!(report.verdict, ["mass-error"], "{report}");
    let error = &report.effects["mass-error"].parameters["error"];
    assert!((0.05..0.11).contains(&error.value) && error.low < 0.08 && error.high > 0.08, "{report}");
}

/// Forces alone do not tell a heavier body from less thrust.
#[track_caller]
fn require_mass_or_rival(report: &Report) {
    let [named] = report.verdict[..] else { panic!("{report}") };
    let is_mass = named == "mass-error" || report.effects[named].confused_with.contains(&"mass-error");
    assert!(is_mass, "{report}");
}

#[test]
fn a_gap_of_the_commands_is_not_compared() {
    let report =
        found(&changed(&heavy(20.0), |flight| keep(&mut flight.command, |_, t| !(7.0..11.0).contains(&t))));
    require_mass(&report);
    // The gap, the time in which the rotors settle behind it, and what is always left out.
    assert!(report.flights.iter().all(|flight| (13.5..15.5).contains(&flight.compared_s)), "{report}");
}

#[test]
fn drop_outs_of_all_channels_are_not_compared() {
    if is_left("`a_gap_of_the_commands_is_not_compared` has a gap") {
        return;
    }
    let is_logged = |_: usize, t: f64| (t + 0.3) % 2.0 < 1.6;
    require_mass(&found(&changed(&heavy(20.0), |flight| keep_all(flight, is_logged))));
}

/// The first message came before the clock did: commands long before the motion, then none.
#[test]
fn commands_at_other_times_than_the_motion_are_refused() {
    let early = changed(&heavy(8.0), |flight| {
        flight.command.time_s.iter_mut().skip(1).for_each(|t| *t += 1000.0);
    });
    let error = refused(&early);
    for part in [
        "role \"fit\"",
        "commands and its motion were never logged together",
        "known from 1000",
        "motion was measured from",
    ] {
        assert!(error.contains(part), "no {part:?} in: {error}");
    }
    let late = changed(&heavy(8.0), |flight| flight.command.time_s.iter_mut().for_each(|t| *t += 1000.0));
    let error = refused(&late);
    for part in ["its channels lie at different times", "command from 1000", "attitude from 0"] {
        assert!(error.contains(part), "no {part:?} in: {error}");
    }
}

/// Held for half a second at a time and written once: a gap, unless the log says how it was written.
#[test]
fn commands_that_are_written_on_change_hold_until_the_next() {
    let mut case = heavy(20.0);
    case.plan.is_calm = true;
    let written = |is_on_change: bool| {
        changed(&case, |flight| {
            // A message when the command changes by more than 1 %.
            let mut last: Option<[f64; ROTORS_MAX]> = None;
            let values = flight.command.values.clone();
            let is_new: Vec<bool> = values
                .iter()
                .map(|value| {
                    let far =
                        |old: [f64; ROTORS_MAX]| old.iter().zip(value).any(|(a, b)| (a - b).abs() > 1e-2 * a);
                    let is_new = last.is_none_or(far);
                    last = if is_new { Some(*value) } else { last };
                    is_new
                })
                .collect();
            keep(&mut flight.command, |at, _| is_new[at]);
            flight.commands_on_change = is_on_change;
        })
    };
    let holding = found(&written(true));
    let compared = |report: &Report| report.flights.iter().map(|flight| flight.compared_s).sum::<f64>();
    assert!(compared(&holding) > 35.0, "{holding}");
    if is_left("`commands_far_apart_are_refused` has no `on_change` either") {
        return;
    }
    let without_key = identify(&written(false), &mut |_| ()).map(|outcome| compared(&outcome.report));
    assert!(without_key.as_ref().map_or(true, |compared_s| *compared_s < 25.0), "{without_key:?}");
}

/// Commands at 20 Hz that a table at the rate of the sensors repeats are as slow as those that were written once.
#[test]
fn commands_that_a_finer_table_holds_are_slow() {
    let held = |duration_s: f64, is_on_change: bool| {
        changed(&heavy(duration_s), |flight| {
            let mut last = (f64::NEG_INFINITY, [0.0; ROTORS_MAX]);
            for (time_s, value) in flight.command.time_s.iter().zip(&mut flight.command.values) {
                if time_s - last.0 > 0.05 - 1e-6 {
                    last = (*time_s, *value);
                }
                *value = last.1;
            }
            flight.commands_on_change = is_on_change;
        })
    };
    let slow = |report: &Report| {
        let mut notes = report.flights.iter().flat_map(|flight| &flight.notes);
        notes.any(|note| note.contains("command: logged every 0.050 s"))
    };
    assert!(!slow(&found(&held(8.0, true))));
    if is_left("`commands_slower_than_the_motors_determine_no_lag_delay_or_inertia` has slow ones, too") {
        return;
    }
    let report = found(&held(20.0, false));
    assert!(slow(&report), "{report}");
    require_mass_or_rival(&report);
}

/// Long flights with fewer samples of the pose, which are fitted in half of the time. Quick tests take shorter ones.
fn coarse() -> Case {
    let mut case = heavy(quick_or(10.0, 20.0, "longer flights"));
    case.plan.sensors.pose_ticks = 10;
    case
}

/// The trim that a flight shows passes for no verdict where it is most of the weight.
#[test]
fn commands_of_another_range_are_not_described() {
    let scaled = changed(&coarse(), |flight| {
        flight.command.values.iter_mut().flatten().for_each(|command| *command *= 0.35);
    });
    let report = found(&scaled);
    assert!(report.losses.iter().any(|loss| loss.rival == "trim"), "{report}");
    let text = report.to_string();
    assert!(text.contains("verdict: this vehicle file does not describe these flights"), "{text}");
    assert!(text.contains("is missing, more than 1.962 m/s^2 is no trim"), "{text}");
    assert!(text.contains("likely reason: by the vehicle file, the thrust of the commands is 0."), "{text}");
    require_factor(&text, 1.0 / 0.35);
}

/// Requires that a report names the likely reason, with the factor on the commands that fits but for the heavier weight.
#[track_caller]
fn require_factor(text: &str, factor: f64) {
    let (_, told) = text
        .split_once(": by the vehicle file, the thrust of the commands is 0.")
        .unwrap_or_else(|| panic!("no reason in {text}"));
    for part in [
        " times the weight: ",
        "`scale` of the channel `command`",
        "range in the file's `[command]`",
        "in place of 200",
    ] {
        assert!(told.contains(part), "no {part:?} in {told}");
    }
    let told = told
        .split_once("equals the weight with commands ")
        .and_then(|(_, rest)| rest.split_once(" times as large"));
    let told: f64 = told.expect("a factor").0.parse().expect("a number");
    // With the weight that is declared, 8 % less, the true commands would be smaller.
    assert!((0.85..1.0).contains(&(told / factor)), "{told} for {factor}");
}

/// A range that is declared twice as wide, and commands that are half as large.
#[test]
fn commands_of_half_a_range_are_told_with_the_factor() {
    assert!(!found(&heavy(8.0).flights()).to_string().contains("the thrust of the commands is"));
    if is_left("`commands_of_another_range_are_not_described` has a factor") {
        return;
    }
    let half = changed(&coarse(), |flight| {
        flight.command.values.iter_mut().flatten().for_each(|command| *command *= 0.5);
    });
    require_factor(&found(&half).to_string(), 2.0);
}

/// A change that makes a flight unusable.
type Change = fn(&mut Flight);

#[test]
fn a_flight_that_cannot_be_used_says_why() {
    let case = heavy(8.0);
    let cases: [(&str, Change); 6] = [
        ("it has no command channel; declare `command`", |flight| flight.command = Channel::default()),
        ("it has no motion; declare `attitude`", |flight| {
            flight.attitude = Channel::default();
            flight.angular_velocity = Channel::default();
            flight.specific_force = Channel::default();
        }),
        ("its `attitude` has 2 samples, expected at least 3", |flight| {
            keep(&mut flight.attitude, |at, _| at < 2)
        }),
        ("it stays on the ground", |flight| {
            flight.command.values.iter_mut().for_each(|command| *command = command.map(|c| 0.1 * c));
            flight.position.values.iter_mut().for_each(|position| *position = [0.0; 3]);
            flight.angular_velocity.values.iter_mut().for_each(|rate| *rate = rate.map(|w| 1e-3 * w));
        }),
        ("though it moves; correct that map, or unit and columns of the channel `command`", |flight| {
            flight.command.values.iter_mut().for_each(|command| *command = command.map(|c| 0.1 * c));
        }),
        ("can be compared, expected three windows", |flight| keep_all(flight, |_, t| t < 0.8)),
    ];
    for (reason, change) in cases {
        let mut set = changed(&case, change);
        set.flights[0].notes.push("command: 12 of 34 samples have no finite number; left out".to_owned());
        let error = refused(&set);
        let name = format!("flight `{}`: ", set.flights[0].name);
        for part in ["role \"fit\"", &name, reason, "12 of 34 samples have no finite number"] {
            assert!(error.contains(part), "no {part:?} in: {error}");
        }
    }
}

/// One flight that cannot be used leaves the others, and the report says why.
#[test]
fn a_reason_is_a_note_where_another_flight_can_be_used() {
    let mut set = heavy(8.0).flights();
    let mut other = set.flights[0].clone();
    (other.name, other.command) = ("silent".to_owned(), Channel::default());
    set.flights.push(other);
    let report = found(&set);
    let silent = report.flights.iter().find(|flight| flight.name == "silent").expect("its report");
    assert!(
        silent.notes.iter().any(|note| note.starts_with("not used: it has no command channel")),
        "{report}"
    );
}

/// A flight stack logs the commands of its controller at 10 Hz: slower than the motors follow.
#[test]
fn commands_slower_than_the_motors_determine_no_lag_delay_or_inertia() {
    let mut case = heavy(20.0);
    case.plan.sensors.pose_ticks = 10;
    let set = changed(&case, |flight| keep(&mut flight.command, |at, _| at.is_multiple_of(100)));
    let report = found(&set);
    for effect in ["motor-lag", "command-delay", "inertia-error", "gyroscopic-torque"] {
        assert!(!report.verdict.contains(&effect), "{report}");
        assert!(report.not_identifiable.iter().any(|missing| missing.effect == effect), "{report}");
        let open = |one: &Estimate| !one.determined && one.low < one.value.max(0.1) && one.high > one.value;
        assert!(report.effects[effect].parameters.values().all(open), "{effect}: {report}");
    }
    require_mass_or_rival(&report);
    let note = "logged every 0.100 s, expected at most 0.033 s, half of the motors' time constant of 0.066 s";
    assert!(report.to_string().contains(note), "{report}");
}

/// Rotor speeds that change more with the command than declared: neither a lighter body nor more thrust.
#[test]
fn another_slope_of_the_command_map_is_named() {
    if is_left("`each_effect_is_named_and_no_other_second_third` names effects of motors") {
        return;
    }
    let mut case = Case::null(83, 20.0);
    case.plan.truth = vec![simulated::effect("command-slope", &[("error", 0.3)])];
    let report = found(&case.flights());
    assert_eq!(report.verdict, ["command-slope"], "{report}");
    let error = &report.effects["command-slope"].parameters["error"];
    assert!((error.value - 0.3).abs() < 0.002, "{report}");
}

/// A controller at 1 kHz whose commands are logged at 50 Hz: most of its torques are in no log.
fn logged_at_50_hz() -> FlightSet {
    changed(&heavy(20.0), |flight| {
        keep(&mut flight.command, |at, _| at.is_multiple_of(20));
        flight.without_torques = true;
    })
}

#[test]
fn forces_alone_are_judged_where_torques_are_not_compared() {
    let report = found(&logged_at_50_hz());
    require_mass(&report);
    assert!(report.losses.is_empty(), "{report}");
    let channels: Vec<_> = report.held_out.values().flat_map(|horizons| horizons["0.5"].keys()).collect();
    assert!(channels.contains(&&"velocity") && !channels.contains(&&"attitude"), "{channels:?}");
    let velocity = &report.held_out.values().next().unwrap()["0.5"]["velocity"];
    assert!(velocity.after < 0.3 * velocity.before, "{velocity:?}");
    for effect in ["inertia-error", "com-offset", "rate-damping"] {
        let missing = report.not_identifiable.iter().find(|missing| missing.effect == effect);
        assert!(
            missing.is_some_and(|missing| missing.needs.contains("torques = false")),
            "{effect}: {report}"
        );
    }
    assert!(report.to_string().contains("predictions take the measured attitude"), "{report}");
}

/// At 5 Hz the motors have settled three times between two commands, at unknown speeds.
#[test]
fn commands_far_apart_are_refused() {
    let slow = changed(&heavy(20.0), |flight| keep(&mut flight.command, |at, _| at.is_multiple_of(200)));
    let error = refused(&slow);
    for part in [
        "logged every 0.200 s, expected at most 0.133 s",
        "commands between them that nobody knows",
        "on_change = true",
    ] {
        assert!(error.contains(part), "no {part:?} in: {error}");
    }
}

/// Some of the commands of a controller at 500 Hz: they act late by half of the period, which is not an effect.
#[test]
fn what_the_logging_of_commands_makes_is_not_named() {
    if is_left("`commands_slower_than_the_motors_determine_no_lag_delay_or_inertia` has slow commands") {
        return;
    }
    for every in [5, 20] {
        let set = changed(&heavy(20.0), |flight| keep(&mut flight.command, |at, _| at.is_multiple_of(every)));
        let report = found(&set);
        require_mass(&report);
        let note = format!("which their logging every {:.4} s explains", 1e-3 * every as f64);
        assert!(every == 5 || report.to_string().contains(&note), "{report}");
    }
}

/// The interval of a delay holds the truth even if every fifth command was logged.
#[test]
fn the_interval_of_a_delay_holds_half_of_the_logging_period() {
    if is_left("`the_riddle_of_the_late_rig_is_solved` has a delay, `coverage` has intervals") {
        return;
    }
    let mut case = heavy(20.0);
    case.plan.truth = vec![simulated::effect("command-delay", &[("delay", 0.02)])];
    let set = changed(&case, |flight| keep(&mut flight.command, |at, _| at.is_multiple_of(5)));
    let report = found(&set);
    let delay = &report.effects["command-delay"].parameters["delay"];
    assert!(delay.value < 0.02 && delay.low < 0.02 && delay.high > 0.02, "{report}");
}
