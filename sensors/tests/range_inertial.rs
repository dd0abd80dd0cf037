//! The range-inertial estimator against a known flight through a known room.
#![allow(
    non_snake_case,
    reason = "a trailing _W or _B names the frame a vector is written in, _WB a rotation between the two"
)]

mod support;

use component::messages::{Gps, Imu, Ranges, WallEstimate};
use component::random::{Stream, normal, stream};
use nalgebra::Vector3;
use sensors::complementary::{Complementary, ComplementaryParams, ComplementaryState};
use sensors::imu_model::{ImuModel, ImuParams};
use sensors::range_inertial::filter::{RangeInertial, RangeInertialInputs, RangeInertialState};
use sensors::range_inertial::params::RangeInertialParams;
use support::{Manoeuvre, PERIOD_NS, PERIOD_S, Truth, fly};

const REACH_M: f64 = 7.65;
const RANGE_PERIOD: usize = 100;
const LATENCY: usize = 50;
const SEEDS: std::ops::Range<u64> = 0..20;

/// Walls at right angles to the axes, where they are: ahead and behind along x, ahead and behind along y.
type Room = fn(time_s: f64) -> [Option<f64>; 4];

struct Run {
    truth: Truth,
    time_s: f64,
    state: RangeInertialState,
    walls: WallEstimate,
    yaw_rad: f64,
}

impl Run {
    fn velocity_error_m_s(&self) -> f64 {
        (self.state.velocity_W_m_s() - self.truth.velocity_W_m_s).xy().norm()
    }
}

/// Returns the reading of a range finder at the vehicle: the nearest of the walls and the floor, to a centimetre.
fn range_m(truth: &Truth, direction_B: Vector3<f64>, walls: [Option<f64>; 4], random: &mut Stream) -> f64 {
    let (from, along) = (truth.position_W_m, truth.attitude_WB * direction_B);
    let plane = |at: f64, axis: usize| (at - from[axis]) / along[axis];
    let walls = walls.into_iter().enumerate().filter_map(|(i, at)| Some(plane(at?, i / 2)));
    let met = walls.chain([plane(0.0, 2)]).filter(|distance| *distance > 0.0);
    let noise = normal(random);
    let nearest_m = met.fold(f64::INFINITY, f64::min);
    ((nearest_m + 0.01 * noise).min(REACH_M) * 100.0).round() / 100.0
}

fn ranges(truth: &Truth, measured_ns: u64, walls: [Option<f64>; 4], random: &mut Stream) -> Ranges {
    let x = Vector3::x();
    let y = Vector3::y();
    let distance = [x, -x, y, -y, -Vector3::z()].map(|beam| range_m(truth, beam, walls, random));
    let valid = distance.map(|distance_m| u32::from(distance_m < REACH_M));
    Ranges { measured_ns, distance, valid, ..Default::default() }
}

/// Flies the estimator, with the default IMU and the default complementary filter before it.
fn estimate(flight: &[Truth], room: Room, seed: u64, judge: impl FnMut(&Run)) {
    estimate_with(flight, room, None, seed, judge);
}

/// Returns the message of a receiver at sample `k` that is `late` samples late: a velocity every 100 ms, 0.074
/// m/s off along each axis (RMS, the thesis's receiver, ch. 4).
fn told(flight: &[Truth], k: usize, late: usize, random: &mut Stream) -> Gps {
    let Some(measured) = k.checked_sub(late) else { return Gps::default() };
    let noise = Vector3::from_fn(|_, _| 0.074 * normal(random));
    let velocity = <[f64; 3]>::from(flight[measured].velocity_W_m_s + noise).into();
    Gps { measured_ns: measured as u64 * PERIOD_NS, velocity, valid: 1, ..Default::default() }
}

/// The same, with a receiver that is so many samples late.
fn estimate_with(flight: &[Truth], room: Room, late: Option<usize>, seed: u64, mut judge: impl FnMut(&Run)) {
    let imu = ImuModel::new(ImuParams::default(), 1.0 / PERIOD_S).unwrap();
    let mut imu_state = imu.initial_state(seed, "imu");
    let complementary = Complementary::with_period(ComplementaryParams::default(), PERIOD_S).unwrap();
    let mut attitude_state = ComplementaryState::default();
    let initial_height_m = flight[0].position_W_m.z;
    let params = RangeInertialParams { initial_height_m, half_angle_deg: 0.0, ..Default::default() };
    let filter = RangeInertial::with_period(params, PERIOD_S).unwrap();
    let mut state = filter.initial_state();
    let mut random = stream(seed, "range");
    let (mut sent, mut pending) = (Ranges::default(), Ranges::default());
    let (mut gps, mut gps_random) = (Gps::default(), stream(seed, "gps"));
    for (k, truth) in flight.iter().enumerate() {
        let (now_ns, time_s) = (k as u64 * PERIOD_NS, k as f64 * PERIOD_S);
        if k % RANGE_PERIOD == 0 {
            pending = ranges(truth, now_ns, room(time_s), &mut random);
        }
        if k % RANGE_PERIOD == LATENCY {
            sent = pending;
        }
        if let Some(late) = late.filter(|late| k % 100 == late % 100) {
            gps = told(flight, k, late, &mut gps_random);
        }
        let read = imu.read(&mut imu_state, &truth.felt);
        let attitude = complementary.update(&mut attitude_state, &read);
        let specific_force = <[f64; 3]>::from(read.specific_force_B_m_s2).into();
        let imu = Imu { specific_force, ..Default::default() };
        let inputs =
            RangeInertialInputs { ranges: &sent, imu: &imu, attitude: &attitude, gps: late.map(|_| &gps) };
        filter.update(&mut state, now_ns, &inputs).unwrap();
        let yaw_rad = attitude.yaw;
        let walls = filter.walls(&state, yaw_rad, now_ns);
        judge(&Run { truth: *truth, time_s, state, walls, yaw_rad });
    }
}

/// A pulse of `height` from `from_s` on for `for_s` with soft edges of 0.15 s, as a vehicle can follow.
fn pulse(time_s: f64, from_s: f64, for_s: f64, height: f64) -> f64 {
    let edge = |since_s: f64| {
        let part = (since_s / 0.15).clamp(0.0, 1.0);
        part * part * (3.0 - 2.0 * part)
    };
    height * (edge(time_s - from_s) - edge(time_s - from_s - for_s))
}

/// A flight along x: 20° of pitch up to 2 m/s, a cruise of 2.7 s, and 20° against it to a stop.
fn to_the_wall(time_s: f64) -> [f64; 4] {
    let tilt = 20.0_f64.to_radians();
    let pitch = pulse(time_s, 1.0, 0.56, tilt) - pulse(time_s, 4.3, 0.56, tilt);
    [0.0, pitch, 0.0, 0.0]
}

/// Both axes, yaw and height at once.
fn weave(time_s: f64) -> [f64; 4] {
    let swing =
        |amplitude: f64, period_s: f64| amplitude * libm::cos(std::f64::consts::TAU * time_s / period_s);
    let soft = pulse(time_s, 0.0, 1e3, 1.0);
    [soft * swing(0.17, 3.1), soft * swing(0.2, 2.3), 0.2 - swing(0.2, 7.0), soft * swing(0.5, 2.0)]
}

fn rest(_: f64) -> [f64; 4] {
    [0.0; 4]
}

const ROOM: Room = |_| [Some(5.0), Some(-5.0), Some(5.0), Some(-5.0)];
const EMPTY: Room = |_| [None; 4];

/// The largest of `figure` over the seeds, from `from_s` on.
fn worst(
    manoeuvre: Manoeuvre,
    start: [f64; 3],
    seconds: usize,
    room: Room,
    from_s: f64,
    figure: impl Fn(&Run) -> f64,
) -> f64 {
    let flight = fly(manoeuvre, start, seconds * 1000);
    let mut largest = 0.0_f64;
    for seed in SEEDS {
        estimate(&flight, room, seed, |run| {
            if run.time_s >= from_s {
                largest = largest.max(figure(run));
            }
        });
    }
    largest
}

#[test]
fn without_a_wall_the_velocity_is_dead_reckoned_from_rest_for_8_s_within_0_15_m_s() {
    let worst_m_s = worst(to_the_wall, [0.0, 0.0, 1.5], 8, EMPTY, 0.0, Run::velocity_error_m_s);
    println!("worst velocity error {worst_m_s:.3} m/s");
    assert!(worst_m_s < 0.15, "{worst_m_s}");
}

#[test]
fn a_wall_is_met_within_two_centimetres_after_a_flight_at_two_metres_a_second() {
    let error = |run: &Run| (run.walls.distance[0] - (9.0 - run.truth.position_W_m.x)).abs();
    let wall: Room = |_| [Some(9.0), None, None, None];
    let worst_m = worst(to_the_wall, [0.0, 0.0, 1.5], 9, wall, 5.2, error);
    let speed_error = |run: &Run| (run.state.velocity_W_m_s() - run.truth.velocity_W_m_s).x.abs();
    let worst_m_s = worst(to_the_wall, [0.0, 0.0, 1.5], 9, wall, 5.2, speed_error);
    println!("worst distance error {worst_m:.3} m, velocity {worst_m_s:.3} m/s");
    assert!(worst_m < 0.02, "{worst_m}");
    assert!(worst_m_s < 0.03, "{worst_m_s}");
}

/// Pitching and braking by 20°: the receiver's velocity from before the manoeuvre is not taken for the present one.
#[test]
fn a_late_receiver_tells_the_velocity_along_a_wall_and_spoils_nothing_that_the_wall_tells() {
    let flight = fly(to_the_wall, [0.0, 0.0, 1.5], 20_000);
    let wall: Room = |_| [Some(9.0), None, None, None];
    for late in [0, 80, 300, 900] {
        let [mut distance_m, mut ahead_m_s, mut aside_m_s] = [0.0_f64; 3];
        for seed in SEEDS {
            estimate_with(&flight, wall, Some(late), seed, |run| {
                if run.time_s >= 5.2 {
                    distance_m =
                        distance_m.max((run.walls.distance[0] - (9.0 - run.truth.position_W_m.x)).abs());
                }
                let off_m_s = (run.state.velocity_W_m_s() - run.truth.velocity_W_m_s).abs();
                if run.time_s >= 1.0 {
                    (ahead_m_s, aside_m_s) = (ahead_m_s.max(off_m_s.x), aside_m_s.max(off_m_s.y));
                }
            });
        }
        println!(
            "{late} ms late: distance {distance_m:.3} m, velocity {ahead_m_s:.3} and {aside_m_s:.3} m/s off"
        );
        assert!(distance_m < 0.03 && ahead_m_s < 0.1 && aside_m_s < 0.1, "{late} ms late");
    }
}

#[test]
fn weaving_in_a_room_all_four_walls_and_the_height_are_known() {
    let wall = |run: &Run| {
        let p = run.truth.position_W_m;
        assert!(p.xy().amax() < 3.0, "the flight leaves the room: {p}");
        let turn = libm::cos(run.yaw_rad);
        let truth = [5.0 - p.x, 5.0 + p.x, 5.0 - p.y, 5.0 + p.y].map(|distance| distance / turn);
        let in_sight = (0..4).filter(|wall| run.walls.in_sight[*wall] == 1);
        in_sight.map(|wall| (run.walls.distance[wall] - truth[wall]).abs()).fold(0.0, f64::max)
    };
    let height = |run: &Run| (run.state.height_m() - run.truth.position_W_m.z).abs();
    let start = [0.3, -0.4, 1.5];
    let worst_m = worst(weave, start, 20, ROOM, 1.0, wall);
    let worst_m_s = worst(weave, start, 20, ROOM, 1.0, Run::velocity_error_m_s);
    let height_m = worst(weave, start, 20, ROOM, 1.0, height);
    println!("worst wall {worst_m:.3} m, velocity {worst_m_s:.3} m/s, height {height_m:.3} m");
    assert!(worst_m < 0.04 && worst_m_s < 0.04 && height_m < 0.03, "{worst_m} {worst_m_s} {height_m}");
}

#[test]
fn at_rest_nothing_moves() {
    let worst_m_s = worst(rest, [0.0, 0.0, 1.5], 10, ROOM, 0.0, Run::velocity_error_m_s);
    println!("worst velocity error at rest {worst_m_s:.3} m/s");
    assert!(worst_m_s < 0.05, "{worst_m_s}");
}

#[test]
fn what_flies_through_a_beam_changes_the_distance_and_not_the_velocity() {
    let crossed: Room = |time_s| {
        let ahead = if (4.0..5.0).contains(&time_s) { 2.0 } else { 5.0 };
        [Some(ahead), None, Some(5.0), None]
    };
    let mut seen = 0;
    let flight = fly(rest, [0.0, 0.0, 1.5], 8000);
    estimate(&flight, crossed, 1, |run| {
        let truth_m = if (4.2..5.0).contains(&run.time_s) { 2.0 } else { 5.0 };
        if !(3.9..5.2).contains(&run.time_s) && run.time_s > 0.3 || (4.2..5.0).contains(&run.time_s) {
            seen += 1;
            assert!((run.walls.distance[0] - truth_m).abs() < 0.03, "{:?}", run.walls);
        }
        assert!(run.velocity_error_m_s() < 0.05);
    });
    assert!(seen > 7000);
}

#[test]
fn a_wall_that_ends_is_lost_from_sight_and_found_again() {
    let gap: Room = |time_s| [(!(3.0..5.0).contains(&time_s)).then_some(5.0), None, None, None];
    let flight = fly(rest, [0.0, 0.0, 1.5], 7000);
    estimate(&flight, gap, 1, |run| {
        let is_settled = |from: f64, to: f64| (from..to).contains(&run.time_s);
        if is_settled(0.2, 3.0) || is_settled(5.2, 7.0) {
            assert!(run.walls.in_sight[0] == 1 && (run.walls.distance[0] - 5.0).abs() < 0.03);
        }
        if is_settled(3.7, 5.0) {
            assert_eq!((run.walls.distance[0], run.walls.in_sight[0]), (REACH_M, 0));
        }
    });
}

#[test]
fn the_floor_is_not_taken_for_a_wall() {
    let flight = fly(|t| [0.0, pulse(t, 1.0, 1.0, 0.35), 0.0, 0.0], [0.0, 0.0, 1.0], 3000);
    estimate(&flight, EMPTY, 1, |run| assert_eq!(run.walls.in_sight[0], 0, "at {} s", run.time_s));
}
