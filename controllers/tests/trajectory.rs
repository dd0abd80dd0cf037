//! Trajectories: derivatives that are derivatives, waypoints that are hit, starts and ends at rest.
#![allow(non_snake_case, reason = "a trailing _W names the frame a vector is written in")]

use crate::common;
use common::{trajectory, try_trajectory};
use controllers::trajectory::Trajectory;
use nalgebra::Vector3;

const EVERYTHING: &str = r#"
    { kind = "hover", duration_s = 1.0, yaw_deg = 45.0 },
    { kind = "circle", radius_m = -1.5, speed_m_s = 2.0, laps = 2, ramp_s = 2.0, direction_deg = 30.0 },
    { kind = "figure-eight", half_length_m = 2.0, speed_m_s = 3.0, laps = 2, ramp_s = 3.0, direction_deg = -60.0 },
    { kind = "minimum-snap", times_s = [1.0, 1.5, 0.8, 1.2], yaw_deg = -90.0,
      waypoints_m = [[1.0, 0.5, 1.5], [2.0, -0.5, 2.0], [2.5, 0.0, 1.5], [3.0, 1.0, 1.0]] },
    { kind = "minimum-snap", mean_speed_m_s = 1.5, waypoints_m = [[0.0, 0.0, 1.0]] }"#;

/// The greatest difference between a derivative and the central difference of the one below, for each order.
/// Times within `span_s` of a segment's end are left out, since the snap may jump there.
fn differences(trajectory: &Trajectory, span_s: f64, ends_s: &[f64]) -> [f64; 4] {
    let mut worst = [0.0; 4];
    let steps = (trajectory.duration_s() * 100.0) as usize;
    for step in 0..=steps {
        let time_s = step as f64 * 0.01 + 0.001;
        if ends_s.iter().any(|end_s| (end_s - time_s).abs() <= span_s) {
            continue;
        }
        let (before, now, after) =
            (trajectory.at(time_s - span_s), trajectory.at(time_s), trajectory.at(time_s + span_s));
        for (order, worst) in worst.iter_mut().enumerate() {
            let difference_W = (after.path_W[order] - before.path_W[order]) / (2.0 * span_s);
            let off: f64 = (difference_W - now.path_W[order + 1]).norm();
            *worst = off.max(*worst);
        }
    }
    worst
}

#[test]
fn every_derivative_is_the_rate_of_change_of_the_one_below() {
    let trajectory = trajectory(EVERYTHING);
    let ends_s: Vec<f64> = (0..=4)
        .map(|count| {
            let entries: Vec<&str> = EVERYTHING.split("},").take(count).collect();
            if count == 0 {
                0.0
            } else {
                common::trajectory(&format!("{}}}", entries.join("},"))).duration_s()
            }
        })
        .collect();
    let worst = differences(&trajectory, 1e-4, &ends_s);
    println!("{worst:?}");
    // Of second order in the span: the errors grow with the derivatives three orders higher.
    assert!(worst[0] < 1e-6 && worst[1] < 1e-5 && worst[2] < 1e-4 && worst[3] < 1e-3, "{worst:?}");
}

#[test]
fn the_yaw_rate_is_the_rate_of_change_of_the_yaw() {
    let trajectory = trajectory(EVERYTHING);
    for step in 1..(trajectory.duration_s() * 100.0) as usize {
        let time_s = step as f64 * 0.01;
        let rate = (trajectory.at(time_s + 1e-5).yaw_rad - trajectory.at(time_s - 1e-5).yaw_rad) / 2e-5;
        assert!((rate - trajectory.at(time_s).yaw_rate_rad_s).abs() < 1e-5, "at {time_s} s");
    }
}

#[test]
fn the_reference_moves_without_a_jump_and_rests_at_the_start_and_behind_the_end() {
    let trajectory = trajectory(EVERYTHING);
    let end_s = trajectory.duration_s();
    let (start, end) = (trajectory.at(0.0).path_W, trajectory.at(end_s + 1.0).path_W);
    assert_eq!(start[0], Vector3::z());
    assert!((end[0] - Vector3::z()).norm() < 1e-9, "the last waypoint is where it all began");
    assert!(start[1..].iter().chain(&end[1..]).all(|derivative| derivative.norm() == 0.0));
    let steps = (end_s / 1e-3) as usize + 10;
    for step in 0..steps {
        let (now, next) = (trajectory.at(step as f64 * 1e-3), trajectory.at((step + 1) as f64 * 1e-3));
        let jump = |order: usize| (next.path_W[order] - now.path_W[order]).norm();
        assert!(jump(0) < 0.01 && jump(1) < 0.05 && jump(2) < 0.2, "at {step} ms");
    }
}

#[test]
fn a_figure_eight_is_as_long_as_wide_and_as_fast_as_stated() {
    let entry = r#"{ kind = "figure-eight", half_length_m = 2.0, speed_m_s = 3.0, laps = 3, ramp_s = 3.0 }"#;
    let trajectory = trajectory(entry);
    let points: Vec<_> =
        (0..(trajectory.duration_s() * 1e3) as usize).map(|ms| trajectory.at(ms as f64 * 1e-3)).collect();
    let greatest = |value: &dyn Fn(&[Vector3<f64>; 5]) -> f64| {
        points.iter().map(|point| value(&point.path_W)).fold(0.0, f64::max)
    };
    assert!((greatest(&|path| path[0].x) - 2.0).abs() < 1e-3);
    assert!((greatest(&|path| path[0].y) - 1.0).abs() < 1e-3);
    assert!((greatest(&|path| path[1].norm()) - 3.0).abs() < 1e-3);
}

#[test]
fn a_circle_keeps_its_radius_and_its_speed_between_the_ramps() {
    let trajectory =
        trajectory(r#"{ kind = "circle", radius_m = 2.0, speed_m_s = 1.5, laps = 2, ramp_s = 2.0 }"#);
    let centre_W_m = Vector3::new(0.0, 2.0, 1.0);
    for step in 0..(trajectory.duration_s() * 10.0) as usize {
        let time_s = step as f64 * 0.1;
        let [position, velocity, ..] = trajectory.at(time_s).path_W;
        assert!(((position - centre_W_m).norm() - 2.0).abs() < 1e-9);
        if time_s > 2.0 && time_s < trajectory.duration_s() - 2.0 {
            assert!((velocity.norm() - 1.5).abs() < 1e-9);
        }
    }
}

#[test]
fn waypoints_are_hit_at_their_times_with_six_continuous_derivatives() {
    let points = [[1.0, 0.5, 1.5], [2.0, -0.5, 2.0], [2.5, 0.0, 1.5]];
    let trajectory = trajectory(&format!(
        "{{ kind = \"minimum-snap\", times_s = [1.0, 1.5, 0.8], waypoints_m = {points:?} }}"
    ));
    for (point, time_s) in points.iter().zip([1.0, 2.5, 3.3]) {
        assert!((trajectory.at(time_s).path_W[0] - Vector3::from(*point)).norm() < 1e-9);
    }
    // Snap, and its first two derivatives by differences, on both sides of a waypoint.
    let snap = |time_s: f64| trajectory.at(time_s).path_W[4];
    for time_s in [1.0, 2.5] {
        let h = 1e-3;
        let slope = |from_s: f64| (snap(from_s + h) - snap(from_s)) / h;
        let bend = |from_s: f64| (slope(from_s + h) - slope(from_s)) / h;
        assert!((snap(time_s + 1e-9) - snap(time_s - 1e-9)).norm() < 1e-4);
        assert!((slope(time_s) - slope(time_s - h)).norm() < 0.05 * slope(time_s).norm());
        assert!((bend(time_s) - bend(time_s - 2.0 * h)).norm() < 0.1 * bend(time_s).norm().max(10.0));
    }
}

/// The integral of squared snap, by the rectangle rule.
fn cost(trajectory: &Trajectory) -> f64 {
    let steps = (trajectory.duration_s() * 1e3) as usize;
    (0..steps).map(|ms| trajectory.at((ms as f64 + 0.5) * 1e-3).path_W[4].norm_squared() * 1e-3).sum()
}

/// A path that visits the same points at the same times, but also another on the way, has to cost more. One that
/// visits a point which it meets anyway has to cost the same.
#[test]
fn no_path_through_the_waypoints_has_less_snap() {
    let entry = |times: &str, points: &str| {
        trajectory(&format!("{{ kind = \"minimum-snap\", times_s = {times}, waypoints_m = {points} }}"))
    };
    let free = entry("[1.0, 1.0]", "[[1.0, 1.0, 1.0], [2.0, 0.0, 1.0]]");
    for shift_m in [-0.1, -0.01, 0.01, 0.1] {
        let met = free.at(0.5).path_W[0];
        let points =
            format!("[[{:?}, {:?}, {:?}], [1.0, 1.0, 1.0], [2.0, 0.0, 1.0]]", met.x + shift_m, met.y, met.z);
        assert!(cost(&entry("[0.5, 0.5, 1.0]", &points)) > cost(&free), "shifted by {shift_m} m");
    }
}

#[test]
fn what_is_wrong_with_a_segment_is_named_with_its_place() {
    let cases = [
        (r#"{ kind = "spiral" }"#, "found `spiral`"),
        (r#"{ kind = "hover" }"#, "missing key `segments.1.duration_s`"),
        (
            r#"{ kind = "hover", duration_s = 0.0 }"#,
            "`segments.1.duration_s` must be a finite number above 0, found 0",
        ),
        (r#"{ kind = "hover", duration_s = 1.0, radius_m = 1.0 }"#, "unknown key `segments.1.radius_m`"),
        (
            r#"{ kind = "circle", radius_m = 0.0, speed_m_s = 1.0, laps = 1, ramp_s = 1.0 }"#,
            "`segments.1.radius_m` must be",
        ),
        (
            r#"{ kind = "circle", radius_m = 1.0, speed_m_s = 9.0, laps = 1, ramp_s = 2.0 }"#,
            "`segments.1.laps` must be at least 3",
        ),
        (
            r#"{ kind = "minimum-snap", waypoints_m = [], mean_speed_m_s = 1.0 }"#,
            "`segments.1.waypoints_m` must be a list",
        ),
        (r#"{ kind = "minimum-snap", waypoints_m = [[1, 0, 1]] }"#, "either `times_s` or `mean_speed_m_s`"),
        (
            r#"{ kind = "minimum-snap", waypoints_m = [[1, 0, 1]], times_s = [1.0, 2.0] }"#,
            "one time for each of the 1",
        ),
        (
            r#"{ kind = "minimum-snap", waypoints_m = [[0, 0, 1]], mean_speed_m_s = 1.0 }"#,
            "point 0 where it was",
        ),
        (
            r#"{ kind = "minimum-snap", waypoints_m = [[1, 0, 1], [2, 0, 1]], times_s = [1e-6, 1e6] }"#,
            "of like size",
        ),
    ];
    for (entry, expected) in cases {
        let error = try_trajectory(&format!(r#"{{ kind = "hover", duration_s = 1.0 }}, {entry}"#))
            .unwrap_err()
            .to_string();
        assert!(error.contains("`segments.1"), "{error}");
        assert!(error.contains(expected), "{entry}: {error}");
    }
}

#[test]
fn the_example_of_the_documentation_can_be_flown() {
    let text =
        std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/set-points.md")).unwrap();
    let examples = text.split("```toml\n").skip(1).map(|rest| rest.split("```").next().unwrap());
    let of_segments: Vec<_> = examples.filter(|example| example.contains("segments = [")).collect();
    assert_eq!(of_segments.len(), 1);
    let segments = of_segments[0].split_once("segments = [").unwrap().1.rsplit_once(']').unwrap().0;
    assert!(trajectory(segments).duration_s() > 10.0);
}
