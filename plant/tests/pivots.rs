//! Boxes that pivot over an edge, against the equation of motion of a physical pendulum.
//!
//! A box of mass m turns by θ about a fixed line. At the start its centre of mass is h above and x ahead of the line. At θ it
//! is h cos θ - x sin θ above. With the radius of gyration k about the line, that gives k² θ¨ = g (h sin θ + x cos θ).
//!
//! About an edge of its own base, x is below 0. With tan α = -x / h and the distance l from the line, k² θ¨ = -g l sin(α - θ).
//!
//! The tests integrate this equation by the classic Runge-Kutta scheme with steps of 10 µs. The plant integrates a body in contact
//! by steps of 0.5 ms, to first order.
#![allow(non_snake_case, reason = "a trailing _W or _B names the frame a vector is written in")]

use crate::common;
use common::parts::{body, given};
use common::{G_M_S2, TICK_S, hummingbird};
use nalgebra::Vector3;
use plant::{Backend, NewtonEuler, Rapier, RigidBody};
use scenes::Scene;

/// Steps of the equation in a tick.
const FINE_STEPS: u32 = 100;

/// Differences that are allowed. A scheme of first order with steps of 0.5 ms has up to 5e-4 rad and 7e-3 rad/s.
const ANGLE_RAD: f64 = 1e-3;
const RATE_RAD_S: f64 = 2e-2;

/// The equation of motion.
struct Pivot {
    /// From the line to the centre of mass at the start.
    ahead_m: f64,
    above_m: f64,
    /// Radius of gyration about the line, squared.
    gyration_m2: f64,
}

impl Pivot {
    /// A box of this length along the way that it tips, and of this height.
    fn of(length_m: f64, height_m: f64, ahead_m: f64) -> Self {
        let above_m = height_m / 2.0;
        let about_centre_m2 = (length_m * length_m + height_m * height_m) / 12.0;
        Self { ahead_m, above_m, gyration_m2: about_centre_m2 + ahead_m * ahead_m + above_m * above_m }
    }

    fn acceleration_rad_s2(&self, angle_rad: f64) -> f64 {
        let (sin, cos) = libm::sincos(angle_rad);
        G_M_S2 * (self.above_m * sin + self.ahead_m * cos) / self.gyration_m2
    }

    /// Angle and rate a tick later.
    fn after_tick(&self, start: [f64; 2]) -> [f64; 2] {
        let step_s = TICK_S / f64::from(FINE_STEPS);
        let rates = |[angle, rate]: [f64; 2]| [rate, self.acceleration_rad_s2(angle)];
        let on = |[angle, rate]: [f64; 2], [d_angle, d_rate]: [f64; 2], span_s: f64| {
            [angle + d_angle * span_s, rate + d_rate * span_s]
        };
        (0..FINE_STEPS).fold(start, |state, _| {
            let first = rates(state);
            let second = rates(on(state, first, step_s / 2.0));
            let third = rates(on(state, second, step_s / 2.0));
            let fourth = rates(on(state, third, step_s));
            let sum = |part: usize| first[part] + 2.0 * second[part] + 2.0 * third[part] + fourth[part];
            on(state, [sum(0), sum(1)], step_s / 6.0)
        })
    }
}

/// A scene with a friction that keeps edges from slipping, and a vehicle far away.
fn plant(parts: &[String]) -> Rapier {
    let surface = format!("friction = {}\nrestitution = {}\n", given("5", "1"), given("0", "1"));
    let text = format!("name = \"test\"\n{surface}{}", parts.concat());
    let scene = Scene::parse(&text, "test.toml").unwrap_or_else(|error| panic!("{error}\n{text}"));
    let start = RigidBody::level_at(Vector3::new(100.0, 0.0, 50.0));
    common::rapier(NewtonEuler::new(hummingbird(), 2), &scene, &start, 1e9)
}

/// A box of 2 kg.
fn boxed(size_m: [f64; 3], centre_W_m: &Vector3<f64>, more: &[(&str, &str, &str)]) -> String {
    let (size, centre) = (format!("{size_m:?}"), vector(centre_W_m));
    let keys = [("centre", &*centre, "m"), ("size", &*size, "m"), ("mass", "2", "kg")];
    body("boxes", "box", &[&keys[..], more].concat())
}

fn vector(of: &Vector3<f64>) -> String {
    format!("[{:?}, {:?}, {:?}]", of.x, of.y, of.z)
}

/// Requires that the first free body of `plant` turns about `axis_W` as the equation says, until the equation leaves `angles_rad`.
/// Returns the number of ticks.
fn require_turn(
    plant: &mut Rapier,
    pivot: &Pivot,
    rate_rad_s: f64,
    axis_W: &Vector3<f64>,
    angles_rad: [f64; 2],
    mut look: impl FnMut(&RigidBody),
) -> u32 {
    let start_WB = plant.bodies()[0].attitude_WB;
    let forward_W = axis_W.cross(&Vector3::z());
    let mut expected = [0.0, rate_rad_s];
    for number in 0..1_000 {
        plant.step(&[hummingbird().hover_command(); 4], TICK_S, &[]);
        expected = pivot.after_tick(expected);
        let is_back = expected[1] < 0.0 && expected[0] < angles_rad[0];
        if is_back || expected[0] > angles_rad[1] {
            return number;
        }
        let found = plant.bodies()[0];
        let turn = found.attitude_WB * start_WB.inverse();
        let up_W = turn * Vector3::z();
        let angle_rad = libm::atan2(up_W.dot(&forward_W), up_W.z);
        let spin_W_rad_s = found.attitude_WB * found.angular_velocity_B_rad_s;
        let rate_rad_s = spin_W_rad_s.dot(axis_W);
        let case = format!("{angle_rad} rad and {rate_rad_s} rad/s, not {expected:?}, at tick {number}");
        assert!((angle_rad - expected[0]).abs() < ANGLE_RAD, "{case}");
        assert!((rate_rad_s - expected[1]).abs() < RATE_RAD_S, "{case}");
        let aside = (turn * axis_W - axis_W).norm();
        assert!(aside < 1e-5, "it turns about another axis, too: {aside}");
        look(&found);
    }
    panic!("it stays between {angles_rad:?} for 1000 ticks")
}

/// A box that was pushed, in any direction.
#[test]
fn a_box_rises_over_an_edge_of_its_base_and_falls_back_as_the_equation_says() {
    let boxes =
        [([0.2, 0.3, 0.4], 2.0, 0.0), ([0.2, 0.3, 0.4], 1.5, 30.0), ([0.2, 0.1, 0.2], 3.0, -70.0_f64)];
    for ([length_m, width_m, height_m], rate_rad_s, yaw_deg) in boxes {
        let pivot = Pivot::of(length_m, height_m, -length_m / 2.0);
        let (sin, cos) = libm::sincos(yaw_deg.to_radians());
        let (forward_W, axis_W) = (Vector3::new(cos, sin, 0.0), Vector3::new(-sin, cos, 0.0));
        let velocity_W_m_s = (forward_W * pivot.above_m - Vector3::z() * pivot.ahead_m) * rate_rad_s;
        let (yaw, velocity) = (format!("{yaw_deg:?}"), vector(&velocity_W_m_s));
        let spin = vector(&(axis_W * rate_rad_s));
        let more =
            [("yaw", &*yaw, "deg"), ("velocity", &*velocity, "m/s"), ("angular_velocity", &*spin, "rad/s")];
        let size_m = [length_m, width_m, height_m];
        let mut plant = plant(&[boxed(size_m, &(Vector3::z() * pivot.above_m), &more)]);
        let start = plant.bodies()[0];
        let edge_W_m = -forward_W * pivot.ahead_m;
        let edge_B_m = start.attitude_WB.inverse_transform_vector(&(edge_W_m - start.position_W_m));
        let mut most_m = 0.0_f64;
        let ticks = require_turn(&mut plant, &pivot, rate_rad_s, &axis_W, [0.02, 0.3], |found| {
            let slips_m = (found.position_W_m + found.attitude_WB * edge_B_m - edge_W_m).norm();
            assert!(slips_m < 2e-4, "the edge slips by {slips_m} m");
            most_m = most_m.max(found.position_W_m.z - start.position_W_m.z);
        });
        // All of its motion becomes height at the top.
        let rises_m = pivot.gyration_m2 * rate_rad_s * rate_rad_s / (2.0 * G_M_S2);
        assert!((most_m - rises_m).abs() < 0.02 * rises_m, "it rises by {most_m} m, not {rises_m} m");
        assert!(ticks > 100, "it rises and falls for {ticks} ticks");
    }
}

/// A box whose centre of mass is beyond the edge of a table tips over that edge, from rest.
#[test]
fn a_box_tips_over_the_edge_of_a_table_as_the_equation_says() {
    for ([length_m, width_m, height_m], ahead_m) in [([0.3, 0.2, 0.1], 0.03), ([0.2, 0.4, 0.3], 0.02)] {
        let pivot = Pivot::of(length_m, height_m, ahead_m);
        let table = [("centre", "[-1, 0, 1.9]", "m"), ("size", "[2, 2, 0.2]", "m")];
        let centre_W_m = Vector3::new(ahead_m, 0.0, 2.0 + pivot.above_m);
        let moving = boxed([length_m, width_m, height_m], &centre_W_m, &[]);
        let mut plant = plant(&[body("boxes", "table", &table), moving]);
        let ticks = require_turn(&mut plant, &pivot, 0.0, &Vector3::y(), [-0.1, 0.35], |_| {});
        assert!(ticks > 100, "it tips within {ticks} ticks");
    }
}
