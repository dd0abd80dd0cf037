//! Faults of one flight among several: each is named with its flight and its channel, and flights without one have none.
use crate::simulated;
use crate::skipped;
use flights::{Channel, Flight, FlightSet, Role};
use identify::Fault;
use identify::run::{faults, identify};
use rayon::prelude::*;
use simulated::cases::{Case, EFFECTS, scaled};
use simulated::{Plan, fly};
use std::sync::OnceLock;

const DURATION_S: f64 = 8.0;
const COUNT: u64 = 6;
/// The flight that gets a fault; the last is the one that is tested on.
const FAULTY: usize = 2;

/// Greatest error of a time that is told, for a reason that is not known: 0.021 s over these flights and times, in most about 0.011 s.
const TOLD_S: f64 = 0.025;

/// Commands on another clock pass for no other order of the rotors, whether they are late or early.
#[test]
fn commands_on_another_clock_are_told_with_the_time() {
    for seed in skipped::first(1, "seeds", [60, 160, 260]) {
        let whole = several(&Case::of(&["mass-error", "rotor-drag"], 1.0, seed, DURATION_S));
        let shifts_s = [-0.8, -0.45, -0.3, 0.25, 0.3, 0.45, 0.8];
        let wrong: Vec<String> = shifts_s
            .par_iter()
            .filter_map(|late_s| {
                let mut set = whole.clone();
                set.flights[FAULTY].command.time_s.iter_mut().for_each(|time_s| *time_s += late_s);
                let found = found(&set);
                let is_told = |fault: &Fault| {
                    fault.flight == set.flights[FAULTY].name
                        && (&fault.channel[..], fault.kind) == ("command", "other-clock")
                        && told_s(fault).is_some_and(|told_s| (told_s - late_s).abs() < TOLD_S)
                };
                (found.len() != 1 || !is_told(&found[0])).then(|| format!("{late_s}: {found:?}"))
            })
            .collect();
        assert!(wrong.is_empty(), "seed {seed}: {wrong:#?}");
    }
}

/// Commands that are early by little more than the longest delay that is tried pass for no other order and for no other fault. None of these three
/// seeds is told: a delay of 0.2 s explains them nearly as well.
#[test]
fn commands_that_are_early_by_a_quarter_of_a_second_pass_for_no_other_fault() {
    const LATE_S: f64 = -0.25;
    for seed in [60, 160, 260] {
        let mut set = several(&Case::of(&["mass-error", "rotor-drag"], 1.0, seed, DURATION_S));
        set.flights[FAULTY].command.time_s.iter_mut().for_each(|time_s| *time_s += LATE_S);
        let found = found(&set);
        let is_right = |fault: &Fault| {
            (&fault.flight, &fault.channel[..]) == (&set.flights[FAULTY].name, "command")
                && told_s(fault).is_some_and(|told_s| (told_s - LATE_S).abs() < TOLD_S)
        };
        assert!(found.len() <= 1 && found.iter().all(is_right), "seed {seed}: {found:#?}");
    }
}

/// The `delay_s` that a fault of the clock advises.
fn told_s(fault: &Fault) -> Option<f64> {
    fault.found.split_once("`delay_s` of about ")?.1.parse().ok()
}

/// Flights of a heavier vehicle with undeclared drag.
fn flown(has_rotor_speeds: bool) -> FlightSet {
    static WITH: OnceLock<FlightSet> = OnceLock::new();
    static WITHOUT: OnceLock<FlightSet> = OnceLock::new();
    let of = || {
        let mut case = Case::of(&["mass-error", "rotor-drag"], 1.0, 60, DURATION_S);
        case.plan.sensors.has_rotor_speeds = has_rotor_speeds;
        several(&case)
    };
    if has_rotor_speeds { WITH.get_or_init(of).clone() } else { WITHOUT.get_or_init(of).clone() }
}

fn several(case: &Case) -> FlightSet {
    let (vehicle, mut truth) = case.declared();
    truth.extend(&case.plan.truth);
    let one = |number: u64| {
        let plan = Plan { truth: truth.clone(), seed: case.plan.seed + number, ..case.plan.clone() };
        fly(&vehicle, &plan, if number + 1 == COUNT { Role::Test } else { Role::Fit })
    };
    let flights = (0..COUNT).into_par_iter().map(one).collect();
    FlightSet {
        vehicle: simulated::vehicle_file(case.vehicle),
        flights,
        next_flight: Default::default(),
        files: Default::default(),
    }
}

fn found(set: &FlightSet) -> Vec<Fault> {
    faults(set).unwrap_or_else(|error| panic!("{error}"))
}

/// Requires that a fault of one flight is found there, once, and as that fault.
#[track_caller]
fn require(set: &FlightSet, channel: &str, kind: &str) -> Fault {
    let found = found(set);
    let names: Vec<(&str, &str, &str)> =
        found.iter().map(|fault| (&fault.flight[..], &fault.channel[..], fault.kind)).collect();
    assert_eq!(names, [(&set.flights[FAULTY].name[..], channel, kind)], "{found:#?}");
    let fault = found[0].clone();
    assert!(!fault.expected.is_empty() && !fault.found.is_empty() && !fault.advice.is_empty(), "{fault:?}");
    println!(
        "{}: {}: {}; {}; {}",
        fault.flight,
        fault.channel,
        fault.finding(),
        fault.consequence,
        fault.advice
    );
    fault
}

/// The same of a flight that `breaks`, among others that are as they were.
#[track_caller]
fn require_broken(rotor_speeds: bool, channel: &str, kind: &str, breaks: impl Fn(&mut Flight)) -> Fault {
    let mut set = flown(rotor_speeds);
    breaks(&mut set.flights[FAULTY]);
    require(&set, channel, kind)
}

fn each<const N: usize>(channel: &mut Channel<N>, change: impl Fn(&mut [f64; N])) {
    channel.values.iter_mut().for_each(change);
}

/// Repeats the channel's value at `from_s` until `to_s`.
fn freeze<const N: usize>(channel: &mut Channel<N>, from_s: f64, to_s: f64, axes: &[usize]) {
    let first = channel.time_s.partition_point(|time_s| *time_s < from_s);
    let last = channel.time_s.partition_point(|time_s| *time_s < to_s);
    let held = channel.values[first];
    channel.values[first..last]
        .iter_mut()
        .for_each(|value| axes.iter().for_each(|axis| value[*axis] = held[*axis]));
}

#[test]
fn flights_without_a_fault_have_none() {
    for rotor_speeds in [false, true] {
        assert_eq!(found(&flown(rotor_speeds)), []);
    }
}

/// A true but undeclared effect is never taken for a fault of a flight, also at thrice the noise.
#[test]
fn undeclared_effects_are_no_faults() {
    let cases: Vec<Case> = EFFECTS
        .iter()
        .zip(0..)
        .flat_map(|(name, number)| {
            [1.0, 3.0].map(|noise| Case::of(&[*name], 1.0, 700 + 10 * number, DURATION_S).with_noise(noise))
        })
        .collect();
    // Each noise with every fifth effect.
    let cases = skipped::cases("effects", cases.into_iter().enumerate(), |(number, _)| number % 5 == 0);
    let wrong: Vec<String> = cases
        .par_iter()
        .filter_map(|(_, case)| {
            let found = found(&several(case));
            (!found.is_empty()).then(|| format!("{:?}: {found:#?}", case.effects()))
        })
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Calm or agile, at 50 Hz or 1 kHz, with a pose that is late: no faults either.
#[test]
fn ways_to_log_and_to_fly_are_no_faults() {
    let changes: [fn(&mut Plan); 7] = [
        |plan| plan.is_calm = true,
        |plan| (plan.sensors.pose_ticks, plan.control_ticks) = (20, 20),
        |plan| (plan.sensors.pose_ticks, plan.sensors.imu_ticks) = (1, 1),
        |plan| plan.sensors.pose_delay_s = 0.08,
        |plan| plan.sensors.noise = 0.0,
        |plan| (plan.stiffness, plan.sensors.has_rotor_speeds) = (3.0, true),
        |plan| {
            plan.truth =
                vec![scaled("rotor-drag", 1.0), scaled("command-delay", 1.0), scaled("motor-lag", 1.0)]
        },
    ];
    // Slow control and poses, late poses, and stiff control with rotor speeds.
    let is_quick = |number: usize| [1, 3, 5].contains(&number);
    let ways = skipped::cases("ways", changes.iter().enumerate(), |(number, _)| is_quick(*number));
    for (number, change) in ways {
        let mut case = Case::null(900 + 10 * number as u64, DURATION_S);
        change(&mut case.plan);
        let mut set = several(&case);
        assert_eq!(found(&set), [], "{number}");
        set.flights.iter_mut().for_each(|flight| flight.specific_force = Channel::default());
        assert_eq!(found(&set), [], "{number} without an accelerometer");
        set.flights.iter_mut().for_each(|flight| flight.angular_velocity = Channel::default());
        assert_eq!(found(&set), [], "{number} with a pose alone");
    }
}

/// A hover that is logged in whole millimetres, commands in whole counts and rates in milliradians: they stand still at times.
#[test]
fn coarse_units_are_no_faults() {
    let mut case = Case::null(990, DURATION_S);
    (case.plan.is_calm, case.plan.sensors.noise) = (true, 0.0);
    let mut set = several(&case);
    for flight in &mut set.flights {
        flight.specific_force = Channel::default();
        each(&mut flight.position, |position| *position = position.map(|x| (1e3 * x).round() * 1e-3));
        each(&mut flight.angular_velocity, |rate| *rate = rate.map(|x| (1e3 * x).round() * 1e-3));
        each(&mut flight.command, |commands| *commands = commands.map(f64::round));
    }
    assert_eq!(found(&set), []);
}

/// In the mean of six it reads 0.917.
#[test]
fn a_rotor_speed_that_is_half_or_double_in_one_flight() {
    for (factor, rotor) in skipped::first(1, "factors", [(0.5, 1), (2.0, 3)]) {
        let channel = format!("rotor_speed.{}", rotor + 1);
        let breaks = |flight: &mut Flight| each(&mut flight.rotor_speed, |speeds| speeds[rotor] *= factor);
        let fault = require_broken(true, &channel, "scaled-sensor", breaks);
        assert!(fault.finding().contains(&format!("found {:.1}", factor)), "{fault:?}");
    }
}

#[test]
fn rotor_speeds_that_are_all_half_in_one_flight() {
    let mut set = flown(true);
    each(&mut set.flights[FAULTY].rotor_speed, |speeds| *speeds = speeds.map(|speed| 0.5 * speed));
    let found = found(&set);
    let channels: Vec<&str> = found.iter().map(|fault| &fault.channel[..]).collect();
    assert_eq!(channels, ["rotor_speed.1", "rotor_speed.2", "rotor_speed.3", "rotor_speed.4"], "{found:#?}");
    assert!(
        found.iter().all(|fault| fault.flight == set.flights[FAULTY].name && fault.kind == "scaled-sensor")
    );
}

/// Without commands nothing stands in for it.
#[test]
fn a_rotor_speed_that_is_half_where_there_are_no_commands() {
    let mut set = flown(true);
    set.flights.iter_mut().for_each(|flight| flight.command = Channel::default());
    assert_eq!(found(&set), []);
    each(&mut set.flights[FAULTY].rotor_speed, |speeds| speeds[0] *= 0.5);
    require(&set, "rotor_speed.1", "scaled-sensor");
}

/// A change that breaks a flight.
type Break = fn(&mut Flight);

/// With two flights there is no majority: the one further from the vehicle file has the fault.
#[test]
fn a_fault_of_one_of_two_flights() {
    let breaks: [(&str, &str, Break); 4] = [
        ("rotor_speed.2", "scaled-sensor", |flight| each(&mut flight.rotor_speed, |speeds| speeds[1] *= 0.5)),
        ("specific_force.y", "mirrored", |flight| {
            each(&mut flight.specific_force, |force| force[1] = -force[1])
        }),
        ("position.z", "mirrored", |flight| {
            each(&mut flight.position, |position| position[2] = -position[2])
        }),
        ("command", "scaled", |flight| {
            each(&mut flight.command, |commands| *commands = commands.map(|x| 0.6 * x))
        }),
    ];
    for (channel, kind, breaks) in breaks {
        let mut set = flown(true);
        set.flights = [FAULTY, COUNT as usize - 1].map(|at| set.flights[at].clone()).to_vec();
        breaks(&mut set.flights[0]);
        let found = found(&set);
        let names: Vec<(&str, &str, &str)> =
            found.iter().map(|fault| (&fault.flight[..], &fault.channel[..], fault.kind)).collect();
        assert_eq!(names, [(&set.flights[0].name[..], channel, kind)], "{found:#?}");
    }
}

/// Half of a rotor's speed is a trim of 27 rad/s^2 that no flight had: with the sensor left out nothing of it is left, and the
/// truth is found.
#[test]
fn a_half_reading_sensor_leaves_no_trim() {
    if skipped::is_left("`modes::a_rotor_speed_sensor_that_reads_half_is_a_fault` has such a sensor") {
        return;
    }
    let mut set = flown(true);
    each(&mut set.flights[FAULTY].rotor_speed, |speeds| speeds[1] *= 0.5);
    let report = identify(&set, &mut |_| ()).expect("flights to identify on").report;
    let mut named = report.verdict.clone();
    named.sort_unstable();
    assert_eq!(named, ["mass-error", "rotor-drag"], "{report}");
    let trims = report.trims.iter().flat_map(|trim| trim.angular_acceleration_rad_s2);
    assert!(trims.into_iter().all(|trim| trim.abs() < 1.0), "{report}");
    let line = format!("fault: {}: rotor_speed.2 (scaled-sensor): expected", set.flights[FAULTY].name);
    assert!(report.to_string().contains(&line), "{report}");
}

#[test]
fn a_gyroscope_that_is_frozen_mirrored_or_scaled() {
    require_broken(false, "angular_velocity.x", "frozen", |flight| {
        freeze(&mut flight.angular_velocity, 4.0, 5.5, &[0, 1, 2]);
    });
    require_broken(false, "angular_velocity.y", "frozen", |flight| {
        freeze(&mut flight.angular_velocity, 0.0, 9.0, &[1]);
    });
    for (axis, name) in skipped::first(1, "axes", ["x", "y", "z"].iter().enumerate()) {
        let channel = format!("angular_velocity.{name}");
        require_broken(false, &channel, "mirrored", |flight| {
            each(&mut flight.angular_velocity, |rate| rate[axis] = -rate[axis]);
        });
        require_broken(false, &channel, "scaled", |flight| {
            each(&mut flight.angular_velocity, |rate| rate[axis] *= 2.0);
        });
    }
}

/// A gyroscope whose numbers do not follow the attitude is a fault.
#[test]
fn a_gyroscope_without_any_relation_to_the_attitude() {
    let fault = require_broken(false, "angular_velocity", "unrelated", |flight| {
        let Channel { time_s, values } = &mut flight.angular_velocity;
        for (t, value) in time_s.iter().zip(values) {
            *value = [libm::sin(9.1 * t), libm::cos(7.7 * t), libm::sin(5.9 * t)];
        }
    });
    assert!(fault.found.contains("correlation of at most 0."), "{fault:?}");
}

#[test]
fn an_accelerometer_that_is_frozen_mirrored_or_scaled() {
    require_broken(false, "specific_force.x", "frozen", |flight| {
        freeze(&mut flight.specific_force, 3.0, 4.0, &[0, 1, 2]);
    });
    require_broken(false, "specific_force.z", "frozen", |flight| {
        freeze(&mut flight.specific_force, 0.0, 9.0, &[2]);
    });
    for (axis, name) in skipped::first(1, "axes", ["x", "y", "z"].iter().enumerate()) {
        require_broken(false, &format!("specific_force.{name}"), "mirrored", |flight| {
            each(&mut flight.specific_force, |force| force[axis] = -force[axis]);
        });
    }
    for factor in skipped::first(1, "factors", [0.5, 2.0]) {
        require_broken(false, "specific_force.z", "scaled", |flight| {
            each(&mut flight.specific_force, |force| *force = force.map(|force| factor * force));
        });
    }
}

#[test]
fn a_position_that_jumps_is_frozen_or_mirrored() {
    require_broken(false, "position", "jumping", |flight| {
        let late = flight.position.time_s.partition_point(|time_s| *time_s < 5.0);
        flight.position.values[late..].iter_mut().for_each(|position| position[0] += 0.5);
    });
    require_broken(false, "position.x", "frozen", |flight| {
        freeze(&mut flight.position, 4.0, 5.0, &[0, 1, 2])
    });
    for (axis, name) in skipped::first(1, "axes", ["x", "y", "z"].iter().enumerate()) {
        require_broken(false, &format!("position.{name}"), "mirrored", |flight| {
            each(&mut flight.position, |position| position[axis] = -position[axis]);
        });
    }
}

#[test]
fn commands_that_are_frozen_swapped_or_scaled() {
    for rotor_speeds in skipped::first(1, "flights with rotor speeds", [false, true]) {
        require_broken(rotor_speeds, "command.2", "frozen", |flight| {
            freeze(&mut flight.command, 3.0, 5.0, &[1]);
        });
        require_broken(rotor_speeds, "command", "frozen", |flight| {
            freeze(&mut flight.command, 3.0, 5.0, &[0, 1, 2, 3]);
        });
        let speeds = if rotor_speeds { "with rotor speeds" } else { "without rotor speeds" };
        let what = format!("exchanges {speeds}");
        for (a, b) in skipped::first(1, &what, [(0, 2), (0, 1), (1, 3), (2, 3)]) {
            let channel = format!("command.{}+{}", a + 1, b + 1);
            require_broken(rotor_speeds, &channel, "swapped", |flight| {
                each(&mut flight.command, |commands| commands.swap(a, b));
            });
        }
        for factor in skipped::first(1, &format!("factors {speeds}"), [0.6, 2.0]) {
            require_broken(rotor_speeds, "command", "scaled", |flight| {
                each(&mut flight.command, |commands| *commands = commands.map(|command| factor * command));
            });
        }
    }
}

/// Each order of the logged motors is found as the one that puts the columns right.
#[test]
fn every_order_of_the_motors_is_found() {
    let orders = (0..256_usize).map(|code| [code / 64, code / 16 % 4, code / 4 % 4, code % 4]);
    let others = orders.filter(|order| (0..4).all(|rotor| order.contains(&rotor))).skip(1);
    let wrong: Vec<String> = skipped::cases("orders", others.enumerate(), |(number, _)| number % 4 == 0)
        .par_iter()
        .filter_map(|(_, order)| {
            let mut set = flown(false);
            each(&mut set.flights[FAULTY].command, |commands| {
                let logged = *commands;
                order.iter().enumerate().for_each(|(rotor, at)| commands[rotor] = logged[*at]);
            });
            // Number `at` of the log belongs to the rotor that `order` took it from.
            let put_right: [usize; 4] =
                std::array::from_fn(|rotor| order.iter().position(|at| *at == rotor).unwrap());
            let wanted = format!("the order {} of", put_right.map(|at| (at + 1).to_string()).join(", "));
            let found = found(&set);
            let is_right = found.len() == 1 && found[0].kind == "swapped" && found[0].found.contains(&wanted);
            (!is_right).then(|| format!("{order:?}: {found:#?}"))
        })
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// The order belongs to the channels of all flights: together they show it where noise hides it in each.
#[test]
fn exchanged_motors_of_all_flights_are_found_in_noise() {
    let noisy =
        |noise: f64| several(&Case::of(&["mass-error", "rotor-drag"], 1.0, 61, DURATION_S).with_noise(noise));
    // The last set has one flight that shows it alone: the others are not fitted in the wrong order.
    let mut one_clear = noisy(30.0);
    one_clear.flights[FAULTY] = noisy(1.0).flights.swap_remove(FAULTY);
    let noises = skipped::cases("noises", [1.0, 10.0, 30.0], |noise| *noise > 20.0);
    let sets = noises.into_iter().map(|noise| (noise, noisy(noise)));
    for (noise, mut set) in sets.chain([(0.0, one_clear)]) {
        assert_eq!(found(&set), [], "{noise}");
        set.flights.iter_mut().for_each(|flight| each(&mut flight.command, |commands| commands.swap(0, 1)));
        let told = faults(&set).expect_err("no flight is left").to_string();
        let swapped = told.matches("the order 2, 1, 3, 4 of the logged ones explains").count();
        assert_eq!(swapped, set.flights.len() - 1, "{noise}: each flight of role fit\n{told}");
    }
}

/// Speeds that were measured in another order than commanded, and logged without commands.
#[test]
fn rotor_speeds_in_another_order() {
    let breaks = |flight: &mut Flight| each(&mut flight.rotor_speed, |speeds| speeds[..4].rotate_left(1));
    require_broken(true, "rotor_speed.1+2+3+4", "swapped", breaks);
    let mut set = flown(true);
    set.flights.iter_mut().for_each(|flight| flight.command = Channel::default());
    breaks(&mut set.flights[FAULTY]);
    require(&set, "rotor_speed.1+2+3+4", "swapped");
}

/// Opposite spins in the vehicle file turn every yaw the other way: nothing is identified with them.
#[test]
fn a_vehicle_file_with_reversed_spins_is_refused() {
    let set = flown(false);
    let text = std::fs::read_to_string(&set.vehicle).expect("the vehicle file");
    let text =
        text.replace("\"counter-clockwise\"", "\"ccw\"").replace("\"clockwise\"", "\"counter-clockwise\"");
    let folder = tempfile::tempdir().expect("a folder");
    let vehicle = folder.path().join("reversed.toml");
    std::fs::write(&vehicle, text.replace("\"ccw\"", "\"clockwise\"")).expect("a vehicle file");
    let error = identify(&FlightSet { vehicle, ..set }, &mut |_| ()).expect_err("a refusal").to_string();
    assert!(error.contains("role \"fit\"") && error.contains("with all spins reversed explains"), "{error}");
}

/// Each choice of wrong spins in the vehicle file is refused, and the right spins are named.
#[test]
fn a_vehicle_file_with_some_wrong_spins_is_refused() {
    let set = flown(false);
    let text = std::fs::read_to_string(&set.vehicle).expect("the vehicle file");
    let declared: Vec<&str> = text.match_indices("spin = {").map(|(at, _)| &text[at..]).collect();
    let declared: Vec<bool> =
        declared.iter().map(|spin| spin.starts_with("spin = { value = \"counter-clockwise\"")).collect();
    assert_eq!(declared.len(), 4);
    // Quick tests take one, two and three wrong spins.
    let wrong: Vec<String> = skipped::cases("choices", 1..15_usize, |code| [2, 5, 9, 14].contains(code))
        .into_par_iter()
        .filter_map(|code| {
            let is_wrong = |rotor: usize| code >> rotor & 1 == 1;
            let folder = tempfile::tempdir().expect("a folder");
            let vehicle = folder.path().join("spins.toml");
            std::fs::write(&vehicle, with_spins(&text, is_wrong)).expect("a vehicle file");
            let error = identify(&FlightSet { vehicle, ..set.clone() }, &mut |_| ()).expect_err("a refusal");
            let numbers: Vec<String> =
                (0..4).filter(|rotor| is_wrong(*rotor)).map(|rotor| (rotor + 1).to_string()).collect();
            let right: Vec<&str> = declared
                .iter()
                .map(|is_counter| if *is_counter { "counter-clockwise" } else { "clockwise" })
                .collect();
            let wanted = format!(
                "the order 1, 2, 3, 4 of the logged ones with the {} {} reversed (in the order of the file: {})",
                if numbers.len() == 1 { "spin of rotor" } else { "spins of rotors" },
                numbers.join(", "),
                right.join(", ")
            );
            let error = error.to_string();
            (!error.contains(&wanted)).then(|| format!("{numbers:?}: {error}"))
        })
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Vehicle file `text`, with the spins of the rotors that are wrong the other way.
fn with_spins(text: &str, is_wrong: impl Fn(usize) -> bool) -> String {
    let mut parts = text.split("spin = { value = \"");
    let mut changed = parts.next().unwrap_or_default().to_owned();
    for (rotor, part) in parts.enumerate() {
        let (spin, rest) = part.split_once('"').expect("a spin in quotes");
        let other = if spin == "clockwise" { "counter-clockwise" } else { "clockwise" };
        changed += &format!("spin = {{ value = \"{}\"{rest}", if is_wrong(rotor) { other } else { spin });
    }
    changed
}

/// A vehicle that is held aside by more than its rotors can make, or commands of another vehicle.
#[test]
fn a_trim_that_no_rotors_hold() {
    let fault = require_broken(false, "trim.z", "impossible-trim", |flight| {
        each(&mut flight.command, |commands| {
            (commands[0], commands[2]) = (commands[0] + 75.0, commands[2] + 75.0);
            (commands[1], commands[3]) = (commands[1] - 60.0, commands[3] - 60.0);
        });
    });
    assert!(fault.expected.contains("at most 18.9 rad/s^2"), "{fault:?}");
}

/// If the only flight of a role has a fault that leaves nothing of it, identification says so.
#[test]
fn a_role_without_a_sound_flight_is_refused_with_the_fault() {
    let mut set = flown(false);
    let last = set.flights.len() - 1;
    each(&mut set.flights[last].command, |commands| commands.swap(0, 2));
    let error = faults(&set).unwrap_err().to_string();
    for part in [
        "role \"test\"",
        &set.flights[last].name,
        "command.1+3",
        "expected",
        "the order 3, 2, 1, 4 of the logged ones",
    ] {
        assert!(error.contains(part), "no {part:?} in: {error}");
    }
}

/// Real flights, where they are: none has a fault but three legs in which the estimate of position and
/// velocity steps. That is real: from one sample to the next, 10 ms later, the velocity changes by 0.2 to
/// 0.26 m/s and the position by 5 to 9 cm. The vehicle hovers meanwhile.
#[test]
fn real_flights_have_no_faults_but_those_that_are_real() {
    if skipped::variable_or_skip("HUMMINGBUS_DATA", "the folder of measured flights").is_none() {
        return;
    }
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../flights");
    let all = [
        "nanobench",
        "nanobench-ramp",
        "arpl-crazyflie",
        "crazypad-normal-e8",
        "crazypad-normal-e9",
        "crazypad-w1-m3-e9",
        "crazypad-w1-m3-m4-e8",
        "crazypad-w1-m4-e8",
        "crazypad-w3-m3-e9",
    ];
    let quick = ["nanobench", "arpl-crazyflie", "crazypad-normal-e8", "crazypad-w1-m4-e8"];
    for name in skipped::cases("sets of flights", all, |name| quick.contains(name)) {
        let set = FlightSet::load(&folder.join(format!("{name}.toml")))
            .expect("the flights that HUMMINGBUS_DATA promises");
        let found = found(&set);
        let faults: Vec<(&str, &str, &str)> =
            found.iter().map(|fault| (&fault.flight[..], &fault.channel[..], fault.kind)).collect();
        let real: &[(&str, &str, &str)] = match name {
            "crazypad-w1-m3-m4-e8" => &[("E8 log01 back", "position", "jumping")],
            "crazypad-w1-m4-e8" => {
                &[("E8 log00 out", "position", "jumping"), ("E8 log00 back", "position", "jumping")]
            }
            _ => &[],
        };
        assert_eq!(faults, real, "{name}: {found:#?}");
    }
}
