//! The controllers that follow a trajectory, in closed loops.
#![allow(non_snake_case, reason = "_N names the newton")]

use crate::common;
use common::{Craft, Loop, PERIOD_S, believed, trajectory, vehicle};
use controllers::allocation::RotorWrench;
use controllers::cascade::CascadeLaw;
use controllers::cascade_gains::CascadeGains;
use controllers::geometric::GeometricLaw;
use controllers::geometric_gains::GeometricGains;
use controllers::law::Law;
use controllers::lqr::LqrLaw;
use controllers::lqr_gains::LqrGains;
use controllers::pid::PidLaw;
use controllers::pid_gains::PidGains;
use nalgebra::{UnitQuaternion, Vector3};
use vehicles::{MotorModel, Vehicle};

const FIGURE_EIGHT: &str = r#"{ kind = "hover", duration_s = 2.0 },
    { kind = "figure-eight", half_length_m = 2.0, speed_m_s = 3.0, laps = 3, ramp_s = 3.0 }"#;
const CIRCLE: &str = r#"{ kind = "hover", duration_s = 1.0 },
    { kind = "circle", radius_m = 2.0, speed_m_s = 2.0, laps = 2, ramp_s = 2.0, yaw_deg = 180.0 }"#;
const SLALOM: &str = r#"{ kind = "hover", duration_s = 1.0 },
    { kind = "minimum-snap", mean_speed_m_s = 1.5, yaw_deg = -90.0,
      waypoints_m = [[1.5, 1.0, 1.5], [3.0, -1.0, 2.0], [4.5, 1.0, 1.5], [6.0, 0.0, 1.0]] }"#;

fn geometric() -> GeometricLaw {
    GeometricLaw::for_craft(
        GeometricGains::load(&inputs::InputFiles::default(), None).unwrap(),
        &believed(),
        PERIOD_S,
    )
}

fn lqr() -> LqrLaw {
    LqrLaw::for_craft(LqrGains::load(&inputs::InputFiles::default(), None).unwrap(), &believed(), PERIOD_S)
        .unwrap()
}

/// Root mean square and greatest distance from the trajectory, in m, until 2 s behind its end.
fn distances<L: Law>(name: &str, law: &L, segments: &str, craft: Craft) -> (f64, f64) {
    let trajectory = trajectory(segments);
    let (rms_m, greatest_m) = Loop::new(craft).fly(law, &trajectory, 0.0, trajectory.duration_s() + 2.0);
    println!("{name}: {rms_m:.4} m RMS, {greatest_m:.4} m at most");
    (rms_m, greatest_m)
}

#[test]
fn geometric_flies_a_figure_eight_at_3_m_s_within_a_tenth_of_a_metre_against_drag_it_does_not_know() {
    for seed in 0..3 {
        let (rms_m, _) = distances("figure eight", &geometric(), FIGURE_EIGHT, Craft::dragged(seed));
        assert!(rms_m < 0.08, "seed {seed}: {rms_m}");
    }
}

#[test]
fn geometric_follows_without_drag_or_noise_as_its_feed_forward_says() {
    for (name, segments) in [("eight", FIGURE_EIGHT), ("circle", CIRCLE), ("slalom", SLALOM)] {
        let (rms_m, greatest_m) = distances(name, &geometric(), segments, Craft::ideal());
        assert!(rms_m < 0.02 && greatest_m < 0.05, "{name}: {rms_m}, {greatest_m}");
    }
}

#[test]
fn geometric_with_the_drag_fed_forward_follows_closer() {
    let gains = GeometricGains {
        drag_1_s: 0.28,
        ..GeometricGains::load(&inputs::InputFiles::default(), None).unwrap()
    };
    let knowing = GeometricLaw::for_craft(gains, &believed(), PERIOD_S);
    let (without_m, _) = distances("unknown drag", &geometric(), FIGURE_EIGHT, Craft::dragged(0));
    let (with_m, _) = distances("known drag", &knowing, FIGURE_EIGHT, Craft::dragged(0));
    assert!(with_m < 0.5 * without_m);
}

#[test]
fn geometric_flies_circles_and_minimum_snap_paths_against_drag_whatever_the_seed() {
    for seed in 0..3 {
        for (name, segments) in [("circle", CIRCLE), ("slalom", SLALOM)] {
            let (rms_m, _) = distances(name, &geometric(), segments, Craft::dragged(seed));
            assert!(rms_m < 0.08, "{name}, seed {seed}: {rms_m}");
        }
    }
}

/// Vehicles that differ from the file that the law believes in.
fn variants() -> [(&'static str, Vehicle); 5] {
    let motor = MotorModel::SecondOrder { natural_frequency_rad_s: 0.9 * 15.08, damping_ratio: 0.603 };
    [
        ("heavier", Vehicle { mass_kg: 1.05 * vehicle().mass_kg, ..vehicle() }),
        ("larger", Vehicle { inertia_kg_m2: 1.15 * vehicle().inertia_kg_m2, ..vehicle() }),
        ("smaller", Vehicle { inertia_kg_m2: 0.85 * vehicle().inertia_kg_m2, ..vehicle() }),
        ("slower", Vehicle { motor, ..vehicle() }),
        ("weaker", Vehicle { thrust_coefficient: 0.95 * vehicle().thrust_coefficient, ..vehicle() }),
    ]
}

#[test]
fn geometric_flies_vehicles_that_differ_from_their_file() {
    for (name, craft) in variants() {
        let craft = Craft { vehicle: craft, ..Craft::dragged(0) };
        let (rms_m, _) = distances(name, &geometric(), FIGURE_EIGHT, craft);
        assert!(rms_m < 0.1, "{name}: {rms_m}");
    }
}

/// The greatest distance from 1 m above the origin in 10 s, in m.
fn hover<L: Law>(name: &str, law: &L, seed: u64) -> f64 {
    distances(name, law, r#"{ kind = "hover", duration_s = 8.0 }"#, Craft::dragged(seed)).1
}

#[test]
fn geometric_hovers_within_a_few_centimetres_in_noise() {
    for seed in 0..3 {
        assert!(hover("geometric hover", &geometric(), seed) < 0.03);
    }
}

/// The distance from where it was thrown, after 4 s, and the greatest until then.
fn recovery<L: Law>(law: &L, axis: Vector3<f64>, angle_deg: f64) -> (f64, f64) {
    let trajectory = trajectory("");
    let mut flight = Loop::new(Craft::dragged(1));
    flight.state.body.attitude_WB =
        UnitQuaternion::from_scaled_axis(axis.normalize() * angle_deg.to_radians());
    let (_, greatest_m) = flight.fly(law, &trajectory, 0.0, 4.0);
    let (_, left_m) = flight.fly(law, &trajectory, 4.0, 6.0);
    println!("thrown at {angle_deg} deg about {:?}: {greatest_m:.3} m, then {left_m:.4} m", axis.as_slice());
    (left_m, greatest_m)
}

#[test]
fn geometric_recovers_from_a_tilt_of_sixty_degrees_about_any_axis() {
    for axis in [Vector3::x(), -Vector3::x(), Vector3::y(), -Vector3::y(), Vector3::new(1.0, 1.0, 0.5)] {
        let (left_m, greatest_m) = recovery(&geometric(), axis, 60.0);
        assert!(left_m < 0.1 && greatest_m < 2.0, "{axis}: {greatest_m}, {left_m}");
    }
}

#[test]
fn a_flight_is_a_function_of_its_seed() {
    let flight = |seed| distances("again", &geometric(), CIRCLE, Craft::dragged(seed));
    assert_eq!(flight(1), flight(1));
    assert_ne!(flight(1), flight(2));
}

#[test]
fn lqr_hovers_within_a_few_centimetres_in_noise() {
    for seed in 0..3 {
        assert!(hover("lqr hover", &lqr(), seed) < 0.03);
    }
}

#[test]
fn lqr_follows_without_drag_or_noise_and_with_both() {
    for (name, segments) in [("eight", FIGURE_EIGHT), ("circle", CIRCLE), ("slalom", SLALOM)] {
        let (rms_m, _) = distances(&format!("lqr {name}"), &lqr(), segments, Craft::ideal());
        assert!(rms_m < 0.05, "{name}: {rms_m}");
        for seed in 0..3 {
            let (rms_m, _) = distances(&format!("lqr {name}, drag"), &lqr(), segments, Craft::dragged(seed));
            assert!(rms_m < 0.15, "{name}, seed {seed}: {rms_m}");
        }
    }
}

#[test]
fn lqr_flies_vehicles_that_differ_from_their_file() {
    for (name, craft) in variants() {
        let craft = Craft { vehicle: craft, ..Craft::dragged(0) };
        let (rms_m, _) = distances(&format!("lqr {name}"), &lqr(), CIRCLE, craft);
        assert!(rms_m < 0.15, "{name}: {rms_m}");
    }
}

/// A step of the reference: the heading must not matter, since the feedback turns with it.
#[test]
fn lqr_answers_alike_whatever_the_yaw() {
    let law = lqr();
    let answers = [0.0, 90.0, -135.0].map(|yaw_deg: f64| {
        let turned = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw_deg.to_radians());
        let mut flight = Loop::new(Craft::ideal());
        flight.state.body.attitude_WB = turned;
        flight.state.body.position_W_m += turned * Vector3::new(0.3, 0.1, 0.0);
        let trajectory = common::trajectory_from(yaw_deg.to_radians());
        flight.fly(&law, &trajectory, 0.0, 0.5);
        turned.inverse() * flight.state.body.position_W_m
    });
    assert!(answers.iter().all(|answer| (answer - answers[0]).norm() < 1e-6), "{answers:?}");
}

/// The Hummingbird at 1 kHz, Q and R of the built-in weights, by SciPy 1.17:
///
/// A, B as in `controllers/src/lqr_model.rs`; E = scipy.linalg.expm(numpy.block([[A, B], [0, 0]]) * 1e-3);
/// X = scipy.linalg.solve_discrete_are(Ad, Bd, Q, R); K = solve(R + Bd.T @ X @ Bd, Bd.T @ X @ Ad)
const GAIN_BY_SCIPY: [(usize, usize, f64); 20] = [
    (0, 2, 1.326646454389e+01),
    (0, 5, 6.450601925097e+00),
    (0, 12, 1.023456382594e+00),
    (0, 16, 4.413335016864e-02),
    (1, 1, -1.312660855696e+00),
    (1, 4, -9.842647841235e-01),
    (1, 6, 3.040540871419e+00),
    (1, 9, 4.546620744518e-01),
    (1, 13, 4.601923174241e+00),
    (1, 17, 1.364393201418e-01),
    (2, 0, 1.312660855698e+00),
    (2, 3, 9.842647841245e-01),
    (2, 7, 3.040540871420e+00),
    (2, 10, 4.546620744519e-01),
    (2, 14, 4.601923174241e+00),
    (2, 18, 1.364393201418e-01),
    (3, 8, 8.573230728642e-02),
    (3, 11, 4.725617469028e-02),
    (3, 15, 4.466875619547e-01),
    (3, 19, 2.164190915542e-02),
];

#[test]
fn the_gain_of_the_lqr_is_the_one_that_scipy_finds() {
    let mut rest = *lqr().gain();
    for (row, column, expected) in GAIN_BY_SCIPY {
        let found = rest[(row, column)];
        assert!((found - expected).abs() < 1e-9 * expected.abs().max(1.0), "({row}, {column}): {found}");
        rest[(row, column)] = 0.0;
    }
    assert!(rest.amax() < 1e-9, "the axes do not depend on each other");
}

#[test]
fn an_lqr_without_a_solution_is_refused_with_a_reason() {
    let weightless =
        controllers::airframe::ControlledVehicle::new(Vehicle { gravity_m_s2: 0.0, ..vehicle() }).unwrap();
    let error = LqrLaw::for_craft(
        LqrGains::load(&inputs::InputFiles::default(), None).unwrap(),
        &weightless,
        PERIOD_S,
    )
    .unwrap_err()
    .to_string();
    assert!(error.contains("Riccati") && error.contains("`vehicle`"), "{error}");
}

/// The wrenches demanded at the last tick of `before`, which flew for 0.3 s without noise, and over the half second of `after` behind it;
/// and how far it was from the trajectory from 2.7 s after the swap on.
fn swap<A: Law, B: Law>(before: &A, after: &B) -> (Vec<RotorWrench>, f64) {
    let trajectory = common::trajectory_from(0.0);
    let mut flight = Loop::new(Craft { seed: None, ..Craft::dragged(0) });
    // Off the reference, so that the laws do not all ask for the same, and by less than what a backup may not go on
    // from: `geometric` answers 2 cm with 10 rad/s².
    flight.state.body.position_W_m += Vector3::new(0.015, -0.01, 0.02);
    flight.fly(before, &trajectory, 0.0, 0.3);
    let mut wrenches = vec![flight.demand];
    for _ in 0..500 {
        flight.step(after, &trajectory);
        wrenches.push(flight.demand);
    }
    let (_, greatest_m) = flight.fly(after, &trajectory, 3.0, 5.0);
    (wrenches, greatest_m)
}

/// The first demand of the backup against its predecessor's last, and the distance that is left.
#[track_caller]
fn assert_smooth<A: Law, B: Law>(name: &str, before: &A, after: &B, off_max_m: f64) {
    let (wrenches, greatest_m) = swap(before, after);
    let jump_N = (wrenches[1].thrust_N - wrenches[0].thrust_N).abs();
    let jump_N_m = (wrenches[1].torque_B_N_m - wrenches[0].torque_B_N_m).norm();
    println!("{name}: {jump_N:.1e} N, {jump_N_m:.1e} N m, then {greatest_m:.3} m off at most");
    assert!(jump_N < 1e-9 && jump_N_m < 1e-9, "{name}: {jump_N} N, {jump_N_m} N m");
    assert!(greatest_m < off_max_m, "{name}: {greatest_m}");
}

#[test]
fn a_swap_to_or_from_the_tracking_laws_goes_on_from_the_wrench_that_was_asked_for() {
    let (lqr, geometric) = (lqr(), geometric());
    let pid = PidLaw { gains: PidGains::default(), vehicle: believed().hover_model(), period_s: PERIOD_S };
    let cascade = CascadeLaw {
        gains: CascadeGains::default(),
        vehicle: believed().hover_model(),
        period_s: PERIOD_S,
        attitude_every_steps: 1,
    };
    assert_smooth("lqr to geometric", &lqr, &geometric, 0.01);
    assert_smooth("geometric to lqr", &geometric, &lqr, 0.01);
    assert_smooth("pid to lqr", &pid, &lqr, 0.01);
    assert_smooth("pid to geometric", &pid, &geometric, 0.01);
    assert_smooth("cascade to lqr", &cascade, &lqr, 0.01);
    assert_smooth("cascade to geometric", &cascade, &geometric, 0.01);
    // Neither of these holds a position, so a drift is left.
    assert_smooth("lqr to pid", &lqr, &pid, 0.5);
    assert_smooth("geometric to pid", &geometric, &pid, 0.5);
    assert_smooth("lqr to cascade", &lqr, &cascade, 0.5);
    assert_smooth("geometric to cascade", &geometric, &cascade, 0.5);
}

/// The greatest error of height under `law` in 3 s.
fn height_error_m<L: Law>(flight: &mut Loop, law: &L) -> f64 {
    let trajectory = common::trajectory_from(0.0);
    let off_m = (0..3000).map(|_| {
        flight.step(law, &trajectory);
        (flight.state.body.position_W_m.z - 1.0).abs()
    });
    off_m.fold(0.0, f64::max)
}

/// Counted twice, the lift of a vehicle 5 % heavier than its file would raise it by 4 cm.
#[test]
fn the_lift_that_a_heavier_vehicle_needs_is_handed_to_a_tracking_law_and_back_once() {
    let pid = PidLaw { gains: PidGains::default(), vehicle: believed().hover_model(), period_s: PERIOD_S };
    let heavier = Vehicle { mass_kg: 1.05 * vehicle().mass_kg, ..vehicle() };
    let mut flight = Loop::new(Craft { vehicle: heavier, ..Craft::ideal() });
    flight.fly(&pid, &common::trajectory_from(0.0), 0.0, 20.0);
    for _ in 0..2 {
        let there_m = height_error_m(&mut flight, &geometric());
        let back_m = height_error_m(&mut flight, &pid);
        let lift_m_s2 = flight.law_state.integrals.lift;
        println!("to geometric {there_m:.4} m, back to pid {back_m:.4} m, lift {lift_m_s2:.3} m/s^2");
        assert!(there_m < 0.005 && back_m < 0.005, "{there_m} m, {back_m} m");
        assert!((lift_m_s2 - 0.05 * 9.81).abs() < 0.05, "{lift_m_s2} m/s^2");
    }
}

#[test]
fn between_the_tracking_laws_a_swap_in_the_middle_of_a_figure_eight_is_no_more_than_a_ripple() {
    let trajectory = trajectory(FIGURE_EIGHT);
    let mut flight = Loop::new(Craft::dragged(0));
    flight.fly(&geometric(), &trajectory, 0.0, 9.0);
    let (rms_m, greatest_m) = flight.fly(&lqr(), &trajectory, 9.0, 13.0);
    println!("geometric to lqr in the eight: {rms_m:.3} m RMS, {greatest_m:.3} m at most");
    let (back_rms_m, back_greatest_m) = flight.fly(&geometric(), &trajectory, 13.0, 17.0);
    println!("and back: {back_rms_m:.3} m RMS, {back_greatest_m:.3} m at most");
    assert!(greatest_m < 0.2 && back_greatest_m < 0.2);
}
