//! A snapshot continues as if nothing had happened, bit for bit; two runs are the same bits.
#![allow(non_snake_case, reason = "a trailing _W or _B names the frame a vector is written in")]

use crate::common;
use common::{TICK_S, hummingbird};
use nalgebra::{UnitQuaternion, Vector3};
use plant::snapshot::first_difference;
use plant::{Airframe, Backend, FreeFlight, Neighbour, NewtonEuler, Rapier, RigidBody};
use scenes::Scene;

/// A situation that is caught in the middle.
struct FlightCondition {
    name: &'static str,
    scene: &'static str,
    start: RigidBody,
    commands: fn(u32) -> [f64; 4],
    traffic: fn(u32) -> Vec<Neighbour>,
}

fn nobody(_: u32) -> Vec<Neighbour> {
    Vec::new()
}

/// A vehicle that flies through the room, to and fro.
fn somebody(tick: u32) -> Vec<Neighbour> {
    let angle = f64::from(tick) * 2e-3;
    let position_W_m = Vector3::new(3.9 + 1.0 * libm::cos(angle), 0.2 * libm::sin(angle), 0.1);
    let velocity_W_m_s = Vector3::new(-2.0 * libm::sin(angle), 0.4 * libm::cos(angle), 0.0);
    vec![Neighbour { number: 1, position_W_m, velocity_W_m_s }]
}

fn uneven(tick: u32) -> [f64; 4] {
    let swing = 60.0 * libm::sin(f64::from(tick) * 0.01);
    [76.5 + swing, 80.0, 76.5 - swing, 70.0]
}

fn situations() -> [FlightCondition; 4] {
    let tumbling = RigidBody {
        position_W_m: Vector3::new(4.2, 0.0, 0.6),
        velocity_W_m_s: Vector3::new(1.0, 0.3, -1.0),
        attitude_WB: UnitQuaternion::from_euler_angles(0.8, -0.4, 1.0),
        angular_velocity_B_rad_s: Vector3::new(3.0, -4.0, 2.0),
    };
    let at_rest = RigidBody::level_at(Vector3::zeros());
    let room = scenes::reference::ROOM;
    let sliding = scenes::reference::RIG_SLIDING;
    let fixed = scenes::reference::RIG_FIXED;
    let falling = |_| [1.0; 4];
    [
        FlightCondition {
            name: "a crash into wall and floor",
            scene: room,
            start: tumbling,
            commands: falling,
            traffic: nobody,
        },
        FlightCondition {
            name: "among traffic",
            scene: room,
            start: tumbling,
            commands: falling,
            traffic: somebody,
        },
        FlightCondition { name: "rig A", scene: sliding, start: at_rest, commands: uneven, traffic: nobody },
        FlightCondition { name: "rig B", scene: fixed, start: at_rest, commands: uneven, traffic: nobody },
    ]
}

impl FlightCondition {
    fn plant(&self) -> Rapier {
        let scene = Scene::parse(self.scene, "scene.toml").unwrap();
        let mut plant = common::rapier(NewtonEuler::new(hummingbird(), 1), &scene, &self.start, 1.0);
        plant.settle_rotors(&(self.commands)(0));
        plant
    }

    fn fly(&self, plant: &mut dyn Backend, ticks: std::ops::Range<u32>) {
        for tick in ticks {
            plant.step(&(self.commands)(tick), TICK_S, &(self.traffic)(tick));
        }
    }
}

#[track_caller]
fn assert_same(name: &str, a: &dyn Backend, b: &dyn Backend) {
    let difference = first_difference(&a.snapshot().unwrap(), &b.snapshot().unwrap()).unwrap();
    assert_eq!(difference, None, "{name}: the first component that differs");
    assert_eq!(
        (a.state(), a.accelerations(), a.contact()),
        (b.state(), b.accelerations(), b.contact()),
        "{name}"
    );
}

#[test]
fn a_restored_plant_flies_on_bit_for_bit() {
    for situation in situations() {
        for taken_at in [1, 150, 700] {
            let mut flown_through = situation.plant();
            situation.fly(&mut flown_through, 0..taken_at);
            let snapshot = flown_through.snapshot().unwrap();
            situation.fly(&mut flown_through, taken_at..taken_at + 2_000);
            let mut restored = situation.plant();
            restored.restore(&snapshot).unwrap();
            situation.fly(&mut restored, taken_at..taken_at + 2_000);
            assert_same(situation.name, &flown_through, &restored);
        }
    }
}

#[test]
fn a_plant_that_went_elsewhere_comes_back_with_its_snapshot() {
    let situation = &situations()[0];
    let (mut straight, mut detour) = (situation.plant(), situation.plant());
    situation.fly(&mut straight, 0..300);
    situation.fly(&mut detour, 0..300);
    let snapshot = detour.snapshot().unwrap();
    situation.fly(&mut detour, 300..900);
    detour.restore(&snapshot).unwrap();
    situation.fly(&mut straight, 300..1_300);
    situation.fly(&mut detour, 300..1_300);
    assert_same(situation.name, &straight, &detour);
}

#[test]
fn the_situations_do_touch_something() {
    for situation in situations() {
        let mut plant = situation.plant();
        situation.fly(&mut plant, 0..2_700);
        let began = plant.contact().began;
        assert_eq!(began > 0, situation.scene.contains("room"), "{}: {began} contacts", situation.name);
    }
}

#[test]
fn two_runs_are_the_same_bits() {
    for situation in situations() {
        let (mut first, mut second) = (situation.plant(), situation.plant());
        situation.fly(&mut first, 0..2_000);
        situation.fly(&mut second, 0..2_000);
        assert_same(situation.name, &first, &second);
    }
}

#[test]
fn a_difference_is_named() {
    let situation = &situations()[2];
    let (mut a, mut b) = (situation.plant(), situation.plant());
    situation.fly(&mut a, 0..10);
    situation.fly(&mut b, 0..9);
    let (a, b) = (a.snapshot().unwrap(), b.snapshot().unwrap());
    assert_eq!(first_difference(&a, &b).unwrap().as_deref(), Some("state"));
}

#[test]
fn free_flight_is_restored_too() {
    let plant = || common::free_flight(hummingbird(), RigidBody::level_at(Vector3::z()));
    let (mut a, mut b) = (plant(), plant());
    (0..100).for_each(|tick| a.step(&uneven(tick), TICK_S, &[]));
    b.restore(&a.snapshot().unwrap()).unwrap();
    (100..200).for_each(|tick| a.step(&uneven(tick), TICK_S, &[]));
    (100..200).for_each(|tick| b.step(&uneven(tick), TICK_S, &[]));
    assert_same("free flight", &a, &b);
}

#[test]
fn what_is_no_snapshot_of_the_backend_is_refused_and_changes_nothing() {
    let situation = &situations()[0];
    let (mut plant, before) = (situation.plant(), situation.plant());
    let free = common::free_flight(hummingbird(), RigidBody::level_at(Vector3::z()));
    let error = plant.restore(&free.snapshot().unwrap()).unwrap_err().to_string();
    assert!(error.contains("\"newton-euler\"") && error.contains("\"rapier\""), "{error}");
    let whole = before.snapshot().unwrap();
    for cut in [0, 1, 10, whole.len() / 2, whole.len() - 1] {
        assert!(plant.restore(&whole[..cut]).is_err(), "cut off at {cut}");
    }
    assert_same("refused", &plant, &before);
}

#[test]
fn a_snapshot_of_another_scene_is_refused_and_changes_nothing() {
    let [crash, _, sliding, fixed] = situations().map(|situation| situation.plant());
    let ground = common::rapier(
        NewtonEuler::new(hummingbird(), 1),
        &Scene::default(),
        &RigidBody::level_at(Vector3::zeros()),
        1.0,
    );
    let moved = scenes::reference::ROOM.replacen("5.05", "5.06", 1);
    let moved = common::rapier(
        NewtonEuler::new(hummingbird(), 1),
        &Scene::parse(&moved, "moved.toml").unwrap(),
        &RigidBody::level_at(Vector3::zeros()),
        1.0,
    );
    let mut plants = [crash, sliding, fixed, ground, moved];
    let snapshots = plants.each_ref().map(|plant| plant.snapshot().unwrap());
    for (index, plant) in plants.iter_mut().enumerate() {
        for (other, snapshot) in snapshots.iter().enumerate() {
            let restored = plant.restore(snapshot);
            assert_eq!(restored.is_ok(), index == other, "{index} from {other}: {restored:?}");
            assert_eq!(first_difference(&plant.snapshot().unwrap(), &snapshots[index]).unwrap(), None);
        }
        plant.step(&uneven(0), TICK_S, &[]);
    }
}

#[test]
fn a_snapshot_of_other_effects_or_another_delay_is_refused_by_both_backends() {
    let effects = ["battery-sag", "command-delay", "wind"];
    let with = |names: &[&str]| {
        let effects = names.iter().map(|name| plant::effects::find(name).unwrap().nominal()).collect();
        Airframe::with_effects(hummingbird(), effects)
    };
    let start = RigidBody::level_at(Vector3::z());
    let plants = |names: &[&str]| -> [Box<dyn Backend>; 2] {
        let model = || NewtonEuler::flying(with(names), 1);
        let effects = || with(names).initial_state(0, "plant", TICK_S);
        let rapier = Rapier::new(model(), effects(), &Scene::default(), &start, 1.0);
        [Box::new(FreeFlight::new(model(), start, effects())), Box::new(rapier)]
    };
    for (mut plant, all) in plants(&effects).into_iter().zip(plants(&effects)) {
        plant.restore(&all.snapshot().unwrap()).unwrap();
    }
    for fewer in [&effects[..0], &effects[..1], &effects[1..], &["battery-sag", "turbulence", "wind"]] {
        for (mut plant, other) in plants(&effects).into_iter().zip(plants(fewer)) {
            let error = plant.restore(&other.snapshot().unwrap()).unwrap_err().to_string();
            assert!(error.contains("effects"), "{error}");
            plant.step(&uneven(0), TICK_S, &[]);
            assert!(plant.battery().is_some());
        }
    }
}
