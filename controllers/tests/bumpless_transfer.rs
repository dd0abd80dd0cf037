//! Every law takes over from every other in hover without a jump in the demanded wrench.
#![allow(
    non_snake_case,
    reason = "a trailing _W or _B names the frame a vector is written in, _N the newton"
)]

use crate::flight;
use crate::skipped::cases;
use component::messages::Vector3 as Point;
use controllers::allocation::RotorWrench;
use controllers::cascade::CascadeLaw;
use controllers::cascade_gains::CascadeGains;
use controllers::control::ControlOutput;
use controllers::controller_state::ControllerState;
use controllers::foresight::ForesightState;
use controllers::geometric::GeometricLaw;
use controllers::geometric_gains::GeometricGains;
use controllers::law::Law as ControlLaw;
use controllers::lqr::LqrLaw;
use controllers::lqr_gains::LqrGains;
use controllers::pid::PidLaw;
use controllers::pid_gains::PidGains;
use controllers::velocity::{LoopsGains, VelocityLaw, VelocityLoop, VelocitySetPoint};
use controllers::wall_follow::{Mode, WallFollowGains, WallFollowLaw};
use controllers::wall_follow_thesis::{Ahead, WallFollowThesisGains, WallFollowThesisLaw};
use controllers::wall_stop::{WallStopGains, WallStopLaw};
use controllers::wall_stop_thesis::{WallStopThesisGains, WallStopThesisLaw};
use flight::{Loop, NOISY, PERIOD_S, ROOM, Senses, believed};
use nalgebra::Vector3;

/// The most that the demand changes from the last tick of a law to the first of the law that takes over: about what the
/// noise of the gyroscope and the steps of the range finders change from tick to tick under one law.
const THRUST_STEP_MAX_N: f64 = 0.05;
const TORQUE_STEP_MAX_N_M: f64 = 5e-3;

enum Law {
    Pid(PidLaw),
    Cascade(CascadeLaw),
    Velocity(VelocityLaw),
    WallStop(WallStopLaw),
    WallFollow(WallFollowLaw),
    WallStopThesis(WallStopThesisLaw),
    WallFollowThesis(WallFollowThesisLaw),
}

impl Law {
    fn step(&self, flight: &mut Loop) -> ControlOutput {
        match self {
            Law::Pid(law) => flight.step(law),
            Law::Cascade(law) => flight.step(law),
            Law::Velocity(law) => flight.step(law),
            Law::WallStop(law) => flight.step(law),
            Law::WallFollow(law) => flight.step(law),
            Law::WallStopThesis(law) => flight.step(law),
            Law::WallFollowThesis(law) => flight.step(law),
        }
    }
}

fn laws() -> [(&'static str, Law); 7] {
    let vehicle = believed().hover_model();
    let velocity = VelocityLoop::new(&LoopsGains::default(), vehicle, PERIOD_S);
    let held = VelocitySetPoint { altitude_m: 1.5, ..VelocitySetPoint::default() };
    let stop = WallStopLaw {
        gains: WallStopGains::default(),
        velocity,
        cruise_speed_m_s: 1.0,
        distance_m: 3.0,
        altitude_m: 1.5,
        heading_rad: 0.0,
    };
    let follow = WallFollowLaw {
        gains: WallFollowGains::default(),
        velocity,
        mode: Mode::Constant,
        speed_m_s: 0.7,
        distance_m: 3.0,
        altitude_m: 1.5,
        heading_rad: 0.0,
        start_state: 1,
        shared: None,
    };
    let stop_thesis = WallStopThesisLaw {
        gains: WallStopThesisGains::default(),
        velocity,
        pitch_rad: 0.02,
        distance_m: 3.0,
        altitude_m: 1.5,
        heading_rad: 0.0,
    };
    let follow_thesis = WallFollowThesisLaw {
        gains: WallFollowThesisGains::default(),
        velocity,
        ahead: Ahead::Tilt(0.03),
        distance_m: 3.0,
        altitude_m: 1.5,
        heading_rad: 0.0,
        start_state: 1,
    };
    [
        ("pid", Law::Pid(PidLaw { gains: PidGains::default(), vehicle, period_s: PERIOD_S })),
        (
            "cascade",
            Law::Cascade(CascadeLaw {
                gains: CascadeGains::default(),
                vehicle,
                period_s: PERIOD_S,
                attitude_every_steps: 1,
            }),
        ),
        ("velocity", Law::Velocity(VelocityLaw { velocity, constant: Some(held) })),
        ("wall-stop", Law::WallStop(stop)),
        ("wall-follow", Law::WallFollow(follow)),
        ("wall-stop-thesis", Law::WallStopThesis(stop_thesis)),
        ("wall-follow-thesis", Law::WallFollowThesis(follow_thesis)),
    ]
}

/// Before the wall at +x, 3 m away, so that all laws but those that follow walls hover.
fn hovering(law: &Law) -> (Loop, ControlOutput) {
    let mut flight = Loop::new(Vector3::new(2.0, 0.0, 1.5), Senses::new(1, ROOM, NOISY));
    let mut output = ControlOutput::default();
    for _ in 0..4000 {
        output = law.step(&mut flight);
    }
    (flight, output)
}

fn step_between(before: &RotorWrench, after: &RotorWrench) -> (f64, f64) {
    let torque_B_N_m = after.torque_B_N_m - before.torque_B_N_m;
    ((after.thrust_N - before.thrust_N).abs(), torque_B_N_m.amax())
}

#[test]
fn every_law_takes_over_from_every_other_without_a_jump_in_the_demanded_wrench() {
    let laws = laws();
    let pairs = (0..laws.len() * laws.len()).map(|pair| (pair / laws.len(), pair % laws.len()));
    // Quick tests take half of the pairs: each law takes over and is taken over from.
    for (from, to) in cases("pairs", pairs, |(from, to)| (from + to) % 2 == 1) {
        let ((from, first), (to, second)) = (&laws[from], &laws[to]);
        let (mut flight, mut before) = hovering(first);
        let (mut first_step, mut worst_step) = ((0.0, 0.0), (0.0_f64, 0.0_f64));
        let (mut height_error_m, mut tilt_rad) = (0.0_f64, 0.0_f64);
        for tick in 0..2000 {
            let output = second.step(&mut flight);
            let step = step_between(&before.wrench, &output.wrench);
            if tick == 0 {
                first_step = step;
            }
            worst_step = (worst_step.0.max(step.0), worst_step.1.max(step.1));
            height_error_m = height_error_m.max((flight.position().z - 1.5).abs());
            let (roll_rad, pitch_rad, _) = flight.state.body.attitude_WB.euler_angles();
            tilt_rad = tilt_rad.max(libm::hypot(roll_rad, pitch_rad));
            before = output;
        }
        println!(
            "{from} to {to}: {:.4} N, {:.2e} N m; within 2 s {:.4} N, {:.2e} N m, height {height_error_m:.3} m, \
             tilt {:.1} deg",
            first_step.0,
            first_step.1,
            worst_step.0,
            worst_step.1,
            tilt_rad.to_degrees()
        );
        assert!(first_step.0 < THRUST_STEP_MAX_N, "{from} to {to}: thrust steps by {} N", first_step.0);
        assert!(first_step.1 < TORQUE_STEP_MAX_N_M, "{from} to {to}: torque steps by {}", first_step.1);
        assert!(height_error_m < 0.15 && tilt_rad < 0.2, "{from} to {to}");
    }
}

/// The test above relies on this: amid a manoeuvre two laws ask for different torques at the same state.
#[test]
fn a_take_over_amid_a_doublet_does_not_jump_either_and_fades_out() {
    let [(_, pid), (_, cascade), ..] = laws();
    let (mut flight, _) = hovering(&pid);
    flight.set_point.roll_rad = 0.17;
    let mut before = ControlOutput::default();
    for _ in 0..100 {
        before = pid.step(&mut flight);
    }
    let after = cascade.step(&mut flight);
    let (thrust_N, torque_N_m) = step_between(&before.wrench, &after.wrench);
    assert!(thrust_N < THRUST_STEP_MAX_N && torque_N_m < TORQUE_STEP_MAX_N_M, "{thrust_N} {torque_N_m}");
    for _ in 0..2000 {
        cascade.step(&mut flight);
    }
    assert!(Vector3::from(flight.law_state.residual_torque).norm() < 1e-9);
    let (roll_rad, ..) = flight.state.body.attitude_WB.euler_angles();
    assert!((roll_rad - 0.17).abs() < 0.02, "the command is followed: {roll_rad}");
}

fn lqr() -> LqrLaw {
    LqrLaw::for_craft(LqrGains::load(&inputs::InputFiles::default(), None).unwrap(), &believed(), PERIOD_S)
        .unwrap()
}

fn geometric() -> GeometricLaw {
    GeometricLaw::for_craft(
        GeometricGains::load(&inputs::InputFiles::default(), None).unwrap(),
        &believed(),
        PERIOD_S,
    )
}

/// `after` stays near and comes to hover again, although `before` left a state in which `go_mad` was at work.
fn assert_outlives<A: ControlLaw, B: ControlLaw>(
    before: &A,
    after: &B,
    go_mad: impl Fn(&mut ControllerState),
) {
    let mut flight = Loop::new(Vector3::new(2.0, 0.0, 1.5), Senses::new(1, ROOM, NOISY));
    flight.reference.position = Point { x: 2.0, y: 0.0, z: 1.5 };
    for _ in 0..2000 {
        flight.step(before);
    }
    go_mad(&mut flight.law_state);
    let (mut height_error_m, mut tilt_rad) = (0.0_f64, 0.0_f64);
    for _ in 0..3000 {
        flight.step(after);
        let (roll_rad, pitch_rad, _) = flight.state.body.attitude_WB.euler_angles();
        tilt_rad = tilt_rad.max(libm::hypot(roll_rad, pitch_rad));
        height_error_m = height_error_m.max((flight.position().z - 1.5).abs());
    }
    let name = format!("{} after {}", B::INFO.name, A::INFO.name);
    println!("{name}: {height_error_m:.3} m and {tilt_rad:.3} rad at most");
    assert!(height_error_m < 0.3 && tilt_rad < 0.6, "{name}: {height_error_m} m, {tilt_rad} rad");
    let (roll_rad, pitch_rad, _) = flight.state.body.attitude_WB.euler_angles();
    let is_level = libm::hypot(roll_rad, pitch_rad) < 0.05 && (flight.position().z - 1.5).abs() < 0.05;
    assert!(is_level, "{name} does not hover again: {}", flight.position());
}

#[test]
fn a_predecessor_gone_mad_is_not_gone_on_from() {
    let [(_, pid), (_, cascade), ..] = laws();
    let (Law::Pid(pid), Law::Cascade(cascade)) = (pid, cascade) else { unreachable!("as `laws` says") };
    for mad in [f64::NAN, f64::INFINITY, 1e9, -1e9] {
        let go_mad = |state: &mut ControllerState| {
            (state.thrust, state.torque) = (mad, [mad; 3]);
        };
        assert_outlives(&pid, &cascade, go_mad);
        assert_outlives(&pid, &lqr(), go_mad);
        assert_outlives(&pid, &geometric(), go_mad);
    }
    assert_outlives(&pid, &lqr(), |state| state.integrals.lift = f64::NAN);
}

#[test]
fn what_a_tracking_law_gone_mad_foresaw_is_not_gone_on_from() {
    for mad in [f64::NAN, f64::INFINITY, 1e9, -1e9] {
        let go_mad = |state: &mut ControllerState| {
            let foresight: &mut ForesightState = state.law_state_mut().unwrap();
            (foresight.thrust_made, foresight.thrust_made_rate) = (mad, mad);
            (foresight.torque_made, foresight.torque_made_rate) = ([mad; 3], [mad; 3]);
            foresight.observer.velocity_foreseen = [mad; 3];
        };
        assert_outlives(&lqr(), &geometric(), go_mad);
        assert_outlives(&geometric(), &lqr(), go_mad);
        assert_outlives(&geometric(), &lqr(), |state| {
            state.law_state_mut::<ForesightState>().unwrap().observer.answer = [mad; 3];
        });
        assert_outlives(&lqr(), &geometric(), |state| (state.thrust, state.torque) = (mad, [mad; 3]));
    }
}

/// The observer's answer along x at the first step of `lqr` after `geometric`, which left 1 m/s²; `between` is what another program
/// writes into the state.
fn answer_after(between: impl Fn(&mut ControllerState)) -> f64 {
    let mut flight = Loop::new(Vector3::new(2.0, 0.0, 1.5), Senses::new(1, ROOM, NOISY));
    flight.reference.position = Point { x: 2.0, y: 0.0, z: 1.5 };
    flight.step(&geometric());
    flight.law_state.law_state_mut::<ForesightState>().unwrap().observer.answer[0] = 1.0;
    between(&mut flight.law_state);
    flight.step(&lqr());
    flight.law_state.law_state::<ForesightState>().unwrap().observer.answer[0]
}

#[test]
fn what_a_law_foresaw_before_another_program_flew_is_not_gone_on_from() {
    let kept = answer_after(|_| {});
    assert!(kept > 0.9, "directly after the other law it is: {kept} m/s²");
    let forgotten = answer_after(|state| {
        // As a program in Python or C++ does: its name, with which the state begins, and zeros behind.
        let name = &mut bytemuck::bytes_of_mut(state)[..24];
        name.fill(0);
        name[..6].copy_from_slice(b"python");
    });
    assert!(forgotten.abs() < 0.1, "{forgotten} m/s²");
}
