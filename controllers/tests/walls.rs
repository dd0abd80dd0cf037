//! The thesis's wall scenarios (§5.5) in a closed loop, with noisy range finders and attitude: stopping before a
//! wall, following the walls of a room at varying speed and at constant distance, and sharing a room.
#![allow(non_snake_case, reason = "a trailing _W or _B names the frame a vector is written in")]

use crate::flight;
use crate::skipped::{first, is_left};
use controllers::law::Law;
use controllers::room::Room;
use controllers::velocity::VelocityLoop;
use controllers::wall_follow::{Mode, Shared, WallFollowGains, WallFollowLaw};
use controllers::wall_follow_thesis::{Ahead, WallFollowThesisGains, WallFollowThesisLaw};
use controllers::wall_stop::{HOLDING, WallStopGains, WallStopLaw};
use controllers::wall_stop_thesis::{STOPPING, WallStopThesisGains, WallStopThesisLaw};
use flight::{Loop, NOISY, PERIOD_S, ROOM, Senses, believed, vehicle};
use nalgebra::Vector3;
use vehicles::{MotorModel, Vehicle};

const SEEDS: [u64; 3] = [1, 2, 3];

fn wall_stop(cruise_speed_m_s: f64, distance_m: f64) -> WallStopLaw {
    let gains = WallStopGains::default();
    WallStopLaw {
        velocity: VelocityLoop::new(&gains.loops, believed().hover_model(), PERIOD_S),
        gains,
        cruise_speed_m_s,
        distance_m,
        altitude_m: 1.5,
        heading_rad: 0.0,
    }
}

fn wall_follow(mode: Mode, speed_m_s: f64) -> WallFollowLaw {
    let gains = WallFollowGains::default();
    WallFollowLaw {
        velocity: VelocityLoop::new(&gains.loops, believed().hover_model(), PERIOD_S),
        gains,
        mode,
        speed_m_s,
        distance_m: 3.0,
        altitude_m: 1.5,
        heading_rad: 0.0,
        start_state: 1,
        shared: None,
    }
}

/// Result of a flight to a wall.
#[derive(Default)]
struct Stop {
    nearest_m: f64,
    /// Of the last five seconds.
    worst_error_m: f64,
    fastest_m_s: f64,
    /// The greatest speed then, in any direction.
    last_speed_m_s: f64,
    /// Greatest speed towards the wall after the speed fell below [`STOPPED_M_S`] for the first time.
    again_m_s: f64,
    /// Greatest distance from its start, along the wall.
    aside_m: f64,
    state: u32,
    altitude_error_m: f64,
}

/// Speed towards the wall below which a vehicle counts as stopped.
const STOPPED_M_S: f64 = 0.1;

/// Flies towards a wall that is `away_m` away, to stop `distance_m` before it, for `seconds`.
fn stop<L: Law>(law: &L, distance_m: f64, seed: u64, away_m: f64, seconds: u64) -> Stop {
    stop_of(vehicle(), law, distance_m, seed, away_m, seconds)
}

/// In a hall of 10 m, whose side walls show the speed along the wall ahead.
fn stop_of<L: Law>(flown: Vehicle, law: &L, distance_m: f64, seed: u64, away_m: f64, seconds: u64) -> Stop {
    let walls = [away_m, f64::INFINITY, 5.0, 5.0];
    let mut flight = Loop::of(flown, Vector3::new(0.0, 0.0, 1.5), Senses::new(seed, walls, NOISY));
    let mut stop = Stop { nearest_m: f64::INFINITY, ..Stop::default() };
    let mut has_stopped = false;
    for tick in 0..1000 * seconds {
        flight.step(law);
        let (at, velocity) = (flight.position(), flight.state.body.velocity_W_m_s);
        stop.nearest_m = stop.nearest_m.min(away_m - at.x);
        stop.fastest_m_s = stop.fastest_m_s.max(velocity.x);
        stop.altitude_error_m = stop.altitude_error_m.max((at.z - 1.5).abs());
        stop.aside_m = stop.aside_m.max(at.y.abs());
        has_stopped |= velocity.x < STOPPED_M_S && stop.fastest_m_s > 2.0 * STOPPED_M_S;
        if has_stopped {
            stop.again_m_s = stop.again_m_s.max(velocity.x);
        }
        if tick >= 1000 * (seconds - 5) {
            stop.worst_error_m = stop.worst_error_m.max((away_m - at.x - distance_m).abs());
            stop.last_speed_m_s = stop.last_speed_m_s.max(velocity.norm());
        }
    }
    Stop { state: flight.output.phase, ..stop }
}

#[test]
fn it_stops_at_three_metres_and_never_nearer_than_2_8_whatever_the_speed_and_seed() {
    for cruise_m_s in [0.5, 1.0, 2.0] {
        for seed in first(1, &format!("seeds at {cruise_m_s} m/s"), SEEDS) {
            let away_m = 12.0;
            let stop = stop(&wall_stop(cruise_m_s, 3.0), 3.0, seed, away_m, 20 + (9.0 / cruise_m_s) as u64);
            println!(
                "{cruise_m_s} m/s, seed {seed}: nearest {:.3} m, at the end within {:.3} m, fastest {:.2} m/s, \
                 height within {:.3} m, at the end {:.3} m/s, aside by {:.3} m, once stopped {:.3} m/s",
                stop.nearest_m,
                stop.worst_error_m,
                stop.fastest_m_s,
                stop.altitude_error_m,
                stop.last_speed_m_s,
                stop.aside_m,
                stop.again_m_s
            );
            assert!(stop.nearest_m > 2.85, "nearest {}", stop.nearest_m);
            assert!(stop.worst_error_m < 0.05, "at the end off by {}", stop.worst_error_m);
            assert!((stop.fastest_m_s - cruise_m_s).abs() < 0.1 * cruise_m_s + 0.2, "{}", stop.fastest_m_s);
            assert_eq!(stop.state, HOLDING);
            assert!(stop.altitude_error_m < 0.1, "{}", stop.altitude_error_m);
            assert!(stop.last_speed_m_s < 0.1, "at the end {} m/s", stop.last_speed_m_s);
            assert!(stop.again_m_s < STOPPED_M_S, "it stopped, and flew on at {} m/s", stop.again_m_s);
            assert!(stop.aside_m < 0.5, "aside by {} m", stop.aside_m);
        }
    }
}

/// Without an integrator: by a pitch that is nothing but a function of the distance, and the PD.
#[test]
fn the_thesis_s_law_flies_past_three_metres_and_returns_to_stand_there() {
    let gains = WallStopThesisGains::default();
    let law = WallStopThesisLaw {
        velocity: VelocityLoop::new(&gains.loops, believed().hover_model(), PERIOD_S),
        gains,
        pitch_rad: 0.02,
        distance_m: 3.0,
        altitude_m: 1.5,
        heading_rad: 0.0,
    };
    for seed in SEEDS {
        let stop = stop(&law, 3.0, seed, 8.0, 25);
        println!(
            "seed {seed}: fastest {:.2} m/s, nearest {:.2} m, at the end within {:.3} m and {:.3} m/s, aside by {:.3} m",
            stop.fastest_m_s, stop.nearest_m, stop.worst_error_m, stop.last_speed_m_s, stop.aside_m
        );
        assert!(stop.fastest_m_s > 0.8 && (2.0..2.8).contains(&stop.nearest_m), "{}", stop.nearest_m);
        assert!(stop.worst_error_m < 0.1 && stop.last_speed_m_s < 0.1 && stop.aside_m < 0.5);
        assert_eq!(stop.state, STOPPING);
    }
}

#[test]
fn it_stops_at_another_distance_and_from_within_the_room() {
    for (distance_m, away_m) in [(2.0, 5.0), (4.0, 5.0), (3.0, 5.0), (3.0, 2.5)] {
        let stop = stop(&wall_stop(1.0, distance_m), distance_m, 1, away_m, 20);
        println!("{distance_m} m from {away_m} m: nearest {:.3}, {:.3}", stop.nearest_m, stop.worst_error_m);
        assert!(stop.worst_error_m < 0.05, "{distance_m} m: off by {}", stop.worst_error_m);
        assert!(stop.nearest_m > distance_m.min(away_m) - 0.2);
    }
}

/// Result of a flight in the room.
#[derive(Default)]
struct Laps {
    nearest_m: f64,
    side_errors_m: Vec<f64>,
    corner_errors_m: Vec<f64>,
    speeds_m_s: Vec<f64>,
    laps: u32,
    seconds: f64,
    altitude_error_m: f64,
}

/// Returns the distance of the nearest wall from a place of the room.
fn clearance_m(at: &Vector3<f64>) -> f64 {
    5.0 - at.x.abs().max(at.y.abs())
}

/// Follows the walls until two laps are done.
fn two_laps(law: &WallFollowLaw, seed: u64) -> Laps {
    two_laps_of(vehicle(), law, seed)
}

fn two_laps_of(flown: Vehicle, law: &WallFollowLaw, seed: u64) -> Laps {
    let mut flight = Loop::of(flown, Vector3::new(0.0, 0.0, 1.5), Senses::new(seed, ROOM, NOISY));
    let mut laps = Laps { nearest_m: f64::INFINITY, ..Laps::default() };
    while flight.output.laps < 2 && flight.time_s() < 200.0 {
        flight.step(law);
        laps.log(&flight, law);
    }
    (laps.laps, laps.seconds) = (flight.output.laps, flight.time_s());
    laps
}

impl Laps {
    fn log(&mut self, flight: &Loop, law: &WallFollowLaw) {
        let (at, velocity) = (flight.position(), flight.state.body.velocity_W_m_s);
        self.nearest_m = self.nearest_m.min(clearance_m(&at));
        self.altitude_error_m = self.altitude_error_m.max((at.z - 1.5).abs());
        if flight.output.phase == 1 {
            return;
        }
        self.speeds_m_s.push(velocity.xy().norm());
        // A side is the middle three quarters of the square's 4 m; the rest belongs to the corners.
        let (along_m, error_m) = match flight.output.phase {
            2 => (at.y, 5.0 - at.x - law.distance_m),
            3 => (at.x, 5.0 + at.y - law.distance_m),
            4 => (at.y, 5.0 + at.x - law.distance_m),
            _ => (at.x, 5.0 - at.y - law.distance_m),
        };
        let is_side = along_m.abs() < 0.75 * (5.0 - law.distance_m);
        if is_side { self.side_errors_m.push(error_m) } else { self.corner_errors_m.push(error_m) }
    }
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64).sqrt()
}

fn report(name: &str, laps: &Laps) {
    let mean_m_s = laps.speeds_m_s.iter().sum::<f64>() / laps.speeds_m_s.len() as f64;
    let off_m_s: Vec<f64> = laps.speeds_m_s.iter().map(|speed| speed - mean_m_s).collect();
    println!(
        "{name}: {} laps in {:.1} s, nearest {:.3} m, sides RMS {:.3} m, corners RMS {:.3} m, speed {:.2} ± {:.2} \
         m/s, height within {:.3} m",
        laps.laps,
        laps.seconds,
        laps.nearest_m,
        rms(&laps.side_errors_m),
        rms(&laps.corner_errors_m),
        mean_m_s,
        rms(&off_m_s),
        laps.altitude_error_m
    );
}

#[test]
fn two_laps_at_varying_speed_come_no_nearer_than_1_5_m() {
    for seed in SEEDS {
        let laps = two_laps(&wall_follow(Mode::Varying, 1.5), seed);
        report(&format!("varying, seed {seed}"), &laps);
        assert_eq!(laps.laps, 2);
        assert!(laps.nearest_m > 1.8, "nearest {}", laps.nearest_m);
        assert!(laps.altitude_error_m < 0.1);
    }
}

#[test]
fn two_laps_at_constant_speed_keep_three_metres_along_the_sides() {
    for speed_m_s in [0.5, 0.7, 1.0] {
        for seed in first(1, &format!("seeds at {speed_m_s} m/s"), SEEDS) {
            let laps = two_laps(&wall_follow(Mode::Constant, speed_m_s), seed);
            report(&format!("constant {speed_m_s} m/s, seed {seed}"), &laps);
            assert_eq!(laps.laps, 2);
            assert!(rms(&laps.side_errors_m) < 0.12, "sides {}", rms(&laps.side_errors_m));
            assert!(laps.nearest_m > 2.5, "nearest {}", laps.nearest_m);
            let mean_m_s = laps.speeds_m_s.iter().sum::<f64>() / laps.speeds_m_s.len() as f64;
            assert!((mean_m_s / speed_m_s - 1.0).abs() < 0.15, "mean speed {mean_m_s}");
        }
    }
}

/// One lap by each of the thesis's modes: how far from the walls along the sides, least and most.
#[test]
fn the_thesis_s_varying_mode_keeps_no_distance_and_its_constant_mode_nearly_three_metres() {
    let gains = WallFollowThesisGains::default();
    let sides_m = |ahead: Ahead| {
        let law = WallFollowThesisLaw {
            velocity: VelocityLoop::new(&gains.loops, believed().hover_model(), PERIOD_S),
            gains,
            ahead,
            distance_m: 3.0,
            altitude_m: 1.5,
            heading_rad: 0.0,
            start_state: 1,
        };
        let mut flight = Loop::new(Vector3::new(0.0, 0.0, 1.5), Senses::new(1, ROOM, NOISY));
        let (mut least_m, mut most_m, mut steps) = (f64::INFINITY, 0.0_f64, 0);
        while flight.output.laps < 1 && flight.time_s() < 100.0 {
            let before = flight.output.velocity_m_s;
            flight.step(&law);
            steps += u32::from(flight.output.velocity_m_s != before);
            let at = flight.position();
            if flight.output.phase > 1 && at.x.abs().min(at.y.abs()) < 1.0 {
                (least_m, most_m) = (least_m.min(clearance_m(&at)), most_m.max(clearance_m(&at)));
            }
        }
        println!("{ahead:?}: {least_m:.2} … {most_m:.2} m, {steps} steps, {:.0} s", flight.time_s());
        assert_eq!(flight.output.laps, 1);
        (least_m, most_m, steps)
    };
    let (varying_m, _, no_steps) = sides_m(Ahead::Tilt(0.035));
    let (constant_m, most_m, steps) = sides_m(Ahead::Velocity(0.5));
    assert!(varying_m < 2.4, "it flies past 3 m by what it takes to stop: {varying_m}");
    assert!(constant_m > 2.4 && most_m < 3.1, "{constant_m} … {most_m}");
    assert_eq!(
        (no_steps, steps),
        (0, 6),
        "its velocity commands change with the states 1 to 5 and 2, and not between"
    );
}

/// Vehicles that differ from the file that the law believes in.
fn others() -> [(&'static str, Vehicle); 3] {
    let heavier = Vehicle { mass_kg: 1.05 * vehicle().mass_kg, ..vehicle() };
    let larger = Vehicle { inertia_kg_m2: 1.15 * vehicle().inertia_kg_m2, ..vehicle() };
    let motor = MotorModel::SecondOrder { natural_frequency_rad_s: 0.9 * 15.08, damping_ratio: 0.603 };
    [("heavier", heavier), ("larger", larger), ("slower motors", Vehicle { motor, ..vehicle() })]
}

#[test]
fn vehicles_that_differ_from_their_file_stop_and_follow_as_well() {
    for (name, flown) in others() {
        let stop = stop_of(flown.clone(), &wall_stop(2.0, 3.0), 3.0, 1, 12.0, 25);
        println!("{name}: nearest {:.3} m, at the end within {:.3} m", stop.nearest_m, stop.worst_error_m);
        assert!(stop.nearest_m > 2.8 && stop.worst_error_m < 0.05, "{name}");
        let laps = two_laps_of(flown, &wall_follow(Mode::Constant, 0.7), 1);
        report(name, &laps);
        assert!(laps.laps == 2 && rms(&laps.side_errors_m) < 0.12, "{name}");
    }
}

/// Places along the loop at 3 m from the walls, in the order of the flight: the distance `along_m` behind the
/// corner at (2, 2) and the state there.
fn on_the_loop(along_m: f64) -> (Vector3<f64>, u32) {
    let (side, rest_m) = ((along_m / 4.0) as u32 % 4, along_m % 4.0);
    let (x, y) = match side {
        0 => (2.0, 2.0 - rest_m),
        1 => (2.0 - rest_m, -2.0),
        2 => (-2.0, -2.0 + rest_m),
        _ => (-2.0 + rest_m, 2.0),
    };
    (Vector3::new(x, y, 1.5), side + 2)
}

/// Ten vehicles on one loop of 16 m, each in the beams of its neighbours all the time.
#[test]
fn ten_vehicles_on_one_loop_keep_apart_and_do_their_laps() {
    if is_left("`ten_vehicles_share_a_room` of the runs flies them for half a lap") {
        return;
    }
    let count = 10;
    let starts: Vec<_> =
        (0..count).map(|number| on_the_loop(16.0 / f64::from(count) * f64::from(number))).collect();
    let law = |(start, state): &(Vector3<f64>, u32)| WallFollowLaw {
        start_state: *state,
        shared: Some(Shared {
            room: Room { size_m: [10.0, 10.0] },
            start_m: Some([start.x + 5.0, start.y + 5.0]),
            ahead_min_m: 0.6,
        }),
        ..wall_follow(Mode::Constant, 0.5)
    };
    let laws: Vec<_> = starts.iter().map(law).collect();
    let senses = |number: usize| Senses::new(number as u64, ROOM, NOISY);
    let mut flights: Vec<_> =
        starts.iter().enumerate().map(|(number, (at, _))| Loop::new(*at, senses(number))).collect();
    let (mut nearest_m, mut clearance) = (f64::INFINITY, f64::INFINITY);
    for _ in 0..90_000 {
        let places: Vec<_> = flights.iter().map(Loop::position).collect();
        for (number, flight) in flights.iter_mut().enumerate() {
            flight.senses.others_W_m.clear();
            let others = places.iter().enumerate().filter(|(other, _)| *other != number);
            flight.senses.others_W_m.extend(others.map(|(_, place)| *place));
            flight.step(&laws[number]);
            clearance = f64::min(clearance, clearance_m(&places[number]));
        }
        for (number, place) in places.iter().enumerate() {
            let apart = places[..number].iter().map(|other| (place - other).norm());
            nearest_m = apart.fold(nearest_m, f64::min);
        }
    }
    let laps: Vec<_> = flights.iter().map(|flight| flight.output.laps).collect();
    println!("ten vehicles: nearest {nearest_m:.3} m apart, {clearance:.3} m from the walls, laps {laps:?}");
    assert!(nearest_m > 0.7, "centres {nearest_m} m apart");
    assert!(clearance > 2.5, "{clearance} m from the walls");
    assert!(laps.iter().all(|laps| *laps >= 2), "{laps:?}");
}
