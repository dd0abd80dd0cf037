//! Heavy bodies on light ones: no stack makes energy, squeezes a body out, or sinks.
#![allow(non_snake_case, reason = "a trailing _W or _B names the frame a vector is written in")]

use crate::common;
use crate::skipped::{cases, first, quick_or};
use common::{G_M_S2, TICK_S, bodies_energy_J, hummingbird};
use component::random::{stream, uniform};
use nalgebra::Vector3;
use plant::{Backend, NewtonEuler, Rapier, RigidBody};
use scenes::Scene;

fn given(value: &str, unit: &str) -> String {
    format!("{{ value = {value}, unit = \"{unit}\", source = \"test\", uncertainty = \"exact\" }}")
}

/// A cube with an edge of 0.2 m.
fn cube(name: &str, mass_kg: f64, centre_m: [f64; 3]) -> String {
    cuboid(name, mass_kg, centre_m, [0.2; 3])
}

fn cuboid(name: &str, mass_kg: f64, centre_m: [f64; 3], size_m: [f64; 3]) -> String {
    let keys = [
        ("centre", format!("{centre_m:?}"), "m"),
        ("size", format!("{size_m:?}"), "m"),
        ("mass", mass_kg.to_string(), "kg"),
    ];
    let keys: String =
        keys.iter().map(|(key, value, unit)| format!("{key} = {}\n", given(value, unit))).collect();
    format!("[[boxes]]\nname = \"{name}\"\n{keys}")
}

/// Free bodies on the ground, and a vehicle far away.
struct Stack {
    scene: Scene,
    plant: Rapier,
    ticks: u32,
    /// Time at which impulses were not found first: a run ends there.
    ended_s: Option<f64>,
}

impl Stack {
    fn new(cubes: &[String], friction: f64, substeps: u32) -> Self {
        Self::of([friction, 0.0], cubes, substeps)
    }

    /// With these coefficients of friction and restitution.
    fn of([friction, restitution]: [f64; 2], cubes: &[String], substeps: u32) -> Self {
        let [friction, restitution] = [friction, restitution].map(|it| given(&it.to_string(), "1"));
        let surface = format!("friction = {friction}\nrestitution = {restitution}\n");
        let text = format!("name = \"test\"\n{surface}{}", cubes.concat());
        let scene = Scene::parse(&text, "test.toml").unwrap_or_else(|error| panic!("{error}\n{text}"));
        let model = NewtonEuler::new(hummingbird(), substeps);
        let start = RigidBody::level_at(Vector3::new(100.0, 0.0, 50.0));
        let plant = common::rapier(model, &scene, &start, 1e9);
        Self { scene, plant, ticks: 0, ended_s: None }
    }

    fn tick(&mut self) {
        self.plant.step(&[hummingbird().hover_command(); 4], TICK_S, &[]);
        self.ticks += 1;
        if self.ended_s.is_none() && self.plant.trouble().is_some() {
            self.ended_s = Some(f64::from(self.ticks) * TICK_S);
        }
    }

    /// Kinetic and potential energy of the bodies.
    fn energy_J(&self) -> f64 {
        bodies_energy_J(&self.scene, &self.plant)
    }

    /// The most energy that any tick adds to the least before it.
    fn most_gain_J(&mut self, ticks: usize) -> f64 {
        let mut least_J = self.energy_J();
        let mut most_J = f64::NEG_INFINITY;
        for _ in 0..ticks {
            self.tick();
            let energy_J = self.energy_J();
            most_J = most_J.max(energy_J - least_J);
            least_J = least_J.min(energy_J);
        }
        most_J
    }

    /// The fastest body in any tick, and the farthest that the body `number` is off its place aside, m.
    fn fastest_m_s(&mut self, ticks: usize, number: usize) -> (f64, f64) {
        let start_W_m = self.plant.bodies()[number].position_W_m;
        let (mut fastest_m_s, mut farthest_m) = (0.0_f64, 0.0_f64);
        for _ in 0..ticks {
            self.tick();
            let speeds_m_s = self.plant.bodies().iter().map(|body| body.velocity_W_m_s.norm());
            fastest_m_s = speeds_m_s.fold(fastest_m_s, f64::max);
            let off_W_m = self.plant.bodies()[number].position_W_m - start_W_m;
            farthest_m = farthest_m.max(off_W_m.xy().norm());
        }
        (fastest_m_s, farthest_m)
    }

    /// Energy that a tick may gain: contacts may overlap by a micrometre, and are lifted out of that.
    fn may_gain_J(&self, heaviest_kg: f64) -> f64 {
        1e-6 * (1.0 + self.energy_J().abs()) + 2e-6 * G_M_S2 * heaviest_kg
    }
}

/// Edges of 0.2 m; the heavy one falls 0.4 m.
fn falling(ratio: f64, off_m: [f64; 2], drop_m: f64) -> [String; 2] {
    let heavy = cube("heavy", 10.0, [off_m[0], off_m[1], 0.3 + drop_m]);
    [cube("light", 10.0 / ratio, [0.0, 0.0, 0.1]), heavy]
}

/// The most energy that a tick adds, over drops from several heights at several steps and `offsets` places beside the middle.
fn most_gain_J(ratio: f64, friction: f64, offsets: u32) -> f64 {
    let mut most_J = f64::NEG_INFINITY;
    for (sin, cos) in (0..offsets).map(|seed| libm::sincos(f64::from(3 * seed + 1))) {
        for (substeps, drop_m) in [(1, 0.05), (1, 0.4), (2, 0.05), (2, 0.4), (5, 0.05), (5, 0.4)] {
            let mut stack =
                Stack::new(&falling(ratio, [0.06 * sin, 0.05 * cos * cos], drop_m), friction, substeps);
            let may_gain_J = stack.may_gain_J(10.0);
            let gain_J = stack.most_gain_J(500);
            let what = format!("1:{ratio}, friction {friction}, {substeps} steps a tick, from {drop_m} m");
            assert!(gain_J < may_gain_J, "{what}: {gain_J} J");
            assert_eq!(stack.plant.trouble(), None, "{what}");
            let aside_m = stack.plant.bodies()[0].position_W_m.xy().norm();
            assert!(aside_m < 0.02, "{what}: it is squeezed out by {aside_m} m");
            most_J = most_J.max(gain_J);
        }
    }
    most_J
}

/// `STACKS` is the number of places beside the middle: the table of docs/world.md has three.
#[test]
fn a_heavy_box_that_falls_on_a_light_one_makes_no_energy_and_does_not_squeeze_it_out() {
    let asked = std::env::var("STACKS").map(|text| text.parse::<u32>().expect("STACKS is a number"));
    let is_quick = |ratio: &f64| asked.is_ok() || [100.0, 10_000.0].contains(ratio);
    let ratios = cases("mass ratios", [1.0, 10.0, 50.0, 100.0, 1_000.0, 10_000.0], is_quick);
    let offsets = asked.unwrap_or(1);
    println!("| mass ratio | no friction | friction 0.5 | friction 1 |\n|---|---|---|---|");
    for ratio in ratios {
        let [none, half, one] = [0.0, 0.5, 1.0].map(|friction| most_gain_J(ratio, friction, offsets));
        println!("| 1:{ratio} | {none:.1e} J | {half:.1e} J | {one:.1e} J |");
    }
}

#[test]
fn many_substeps_and_far_falls_make_no_energy_either() {
    for substeps in [1, 20] {
        for drop_m in [0.01, 2.0] {
            let mut stack = Stack::new(&falling(100.0, [0.03, 0.02], drop_m), 0.5, substeps);
            let may_gain_J = stack.may_gain_J(10.0);
            let gain_J = stack.most_gain_J(900);
            assert!(gain_J < may_gain_J, "{substeps} steps from {drop_m} m: {gain_J} J");
        }
    }
}

#[test]
fn a_light_block_below_a_heavy_one_at_rest_stays_where_it_is() {
    for (ratio, friction) in [(100.0, 0.5), (2_000.0, 0.3), (10_000.0, 0.5)] {
        let mut stack = Stack::new(&falling(ratio, [0.03, -0.04], 0.0), friction, 2);
        let (fastest_m_s, farthest_m) = stack.fastest_m_s(2_000, 0);
        assert!(fastest_m_s < 1e-6 && farthest_m < 1e-6, "1:{ratio}: {fastest_m_s} m/s, {farthest_m} m");
    }
}

#[test]
fn a_tower_of_ten_with_the_heavy_ones_on_top_stands() {
    let cubes: Vec<_> = (0..10_u32)
        .map(|number| {
            // From 1 g to 10 kg.
            let mass_kg = 1e-3 * libm::pow(10.0, f64::from(number) * 4.0 / 9.0);
            let side_m = if number % 2 == 0 { 0.01 } else { -0.01 };
            cube(&format!("cube {number}"), mass_kg, [side_m, 0.0, 0.1 + 0.2 * f64::from(number)])
        })
        .collect();
    let mut stack = Stack::new(&cubes, 0.5, 2);
    let (fastest_m_s, farthest_m) = stack.fastest_m_s(quick_or(400, 1_000, "longer times"), 9);
    assert!(fastest_m_s < 1e-4 && farthest_m < 1e-6, "{fastest_m_s} m/s, {farthest_m} m");
    assert_eq!(stack.plant.trouble(), None);
}

/// Stacks as `examples/drawn_bodies.rs` draws them. In the first two the faces share loads in more than one way: a solve that
/// stops at what rounding leaves, or whose directions of slip go round in a circle, does not find the impulses.
#[test]
fn drawn_stacks_of_boxes_of_many_sizes_are_solved_and_make_no_energy() {
    let mut random = stream(1, "drawn bodies");
    let mut draw = |least: f64, most: f64| least + (most - least) * uniform(&mut random);
    let taken = cases("stacks", [20, 30, 3, 7], |number| [20, 3].contains(number));
    for number in 0..=30 {
        let (friction, mut top_m, mut heaviest_kg) = (draw(0.2, 0.9), 0.0, 0.0_f64);
        let count = draw(2.0, 6.999) as u32;
        let boxes: Vec<String> = (0..count)
            .map(|number| {
                let size_m = [draw(0.12, 0.3), draw(0.12, 0.3), draw(0.08, 0.25)];
                let bottom_m = top_m + draw(0.0005, 0.05);
                top_m = bottom_m + size_m[2];
                let [x_m, y_m, _] = [draw(-0.05, 0.05), draw(-0.05, 0.05), draw(0.0, 0.0)];
                let mass_kg = libm::pow(10.0, draw(-1.0, 1.0));
                heaviest_kg = heaviest_kg.max(mass_kg);
                let centre_m = [x_m, y_m, bottom_m + size_m[2] / 2.0];
                cuboid(&format!("box {number}"), mass_kg, centre_m, size_m)
            })
            .collect();
        if !taken.contains(&number) {
            continue;
        }
        let mut stack = Stack::new(&boxes, friction, 2);
        let may_gain_J = stack.may_gain_J(heaviest_kg * f64::from(count));
        let gain_J = stack.most_gain_J(1_500);
        assert!(gain_J < may_gain_J, "stack {number}: {gain_J} J");
        assert_eq!(stack.plant.trouble(), None, "stack {number}");
    }
}

/// Stacks of flat boxes that are turned against each other, with masses from 0.02 to 10 kg, which fall up to 5 cm and bounce.
/// Contacts that only just stick or slip at an impact make the map of the shifts go to and fro. `DRAWN=40` flies 40 of them, and
/// prints which of them end, when, and which would have a remark in the summary of a run: the figures of docs/world.md.
#[test]
fn stacks_that_bounce_are_solved_and_make_no_energy() {
    let all = std::env::var("DRAWN").map(|text| text.parse::<u32>().expect("DRAWN is a number"));
    let mut random = stream(1, "bouncing stacks");
    let mut draw = |least: f64, most: f64| least + (most - least) * uniform(&mut random);
    let mut ended = Vec::new();
    let numbers: Vec<u32> = match &all {
        Ok(count) => (0..*count).collect(),
        Err(_) => first(3, "stacks", 0..8),
    };
    for number in numbers {
        let (surface, count) = ([draw(0.2, 0.9), draw(0.0, 0.4)], draw(3.0, 7.999) as u32);
        let (mut top_m, mut all_kg, mut range_kg) = (0.0, 0.0, [f64::INFINITY, 0.0_f64]);
        let boxes: Vec<String> = (0..count)
            .map(|number| {
                let (size_m, mass_kg) = ([0.2, 0.2, draw(0.08, 0.2)], libm::pow(10.0, draw(-1.7, 1.0)));
                let centre_m =
                    [draw(-0.03, 0.03), draw(-0.03, 0.03), top_m + draw(0.0, 0.05) + size_m[2] / 2.0];
                top_m = centre_m[2] + size_m[2] / 2.0;
                all_kg += mass_kg;
                range_kg = [range_kg[0].min(mass_kg), range_kg[1].max(mass_kg)];
                let yaw = given(&draw(-30.0, 30.0).to_string(), "deg");
                format!("{}yaw = {yaw}\n", cuboid(&format!("box {number}"), mass_kg, centre_m, size_m))
            })
            .collect();
        let mut stack = Stack::of(surface, &boxes, 2);
        let may_gain_J = stack.may_gain_J(all_kg);
        let gain_J = stack.most_gain_J(if all.is_ok() { 1_500 } else { 400 });
        assert!(gain_J < may_gain_J, "stack {number}: {gain_J} J");
        if let Some(remark) = stack.plant.remark() {
            println!("stack {number}: {remark}");
        }
        if let Some((trouble, ended_s)) = stack.plant.trouble().zip(stack.ended_s) {
            let ratio = range_kg[1] / range_kg[0];
            ended.push(format!("stack {number}, mass ratio {ratio:.0}, at {ended_s:.3} s: {trouble}"));
        }
    }
    println!("{} ended: {ended:#?}", ended.len());
    assert!(all.is_ok() || ended.is_empty(), "{ended:?}");
}

#[test]
fn the_vehicle_that_falls_on_a_light_box_is_not_thrown_away() {
    for mass_kg in [5e-3, 5e-4] {
        let text = format!("name = \"test\"\n{}", cube("box", mass_kg, [0.05, 0.03, 0.1]));
        let scene = Scene::parse(&text, "test.toml").unwrap();
        let start = RigidBody::level_at(Vector3::new(0.0, 0.0, 0.6));
        let mut plant = common::rapier(NewtonEuler::new(hummingbird(), 2), &scene, &start, 1e9);
        let fall_m_s = (2.0 * G_M_S2 * 0.6_f64).sqrt();
        for tick in 0..1_500 {
            plant.step(&[0.0; 4], TICK_S, &[]);
            let speed_m_s = plant.state().body.velocity_W_m_s.norm();
            assert!(speed_m_s < fall_m_s, "{mass_kg} kg, tick {tick}: {speed_m_s} m/s");
        }
        assert_eq!(plant.trouble(), None);
    }
}

#[test]
fn impulses_that_are_not_found_are_told_with_the_names_of_both() {
    // 100 t on 1 mg: with numbers of 64 bits the impulse of one says nothing about the motion of the other.
    let cubes = [cube("light", 1e-6, [0.0, 0.0, 0.1]), cube("heavy", 1e5, [0.03, 0.02, 0.35])];
    let mut stack = Stack::new(&cubes, 0.5, 2);
    assert_eq!(stack.plant.trouble(), None);
    (0..300).for_each(|_| stack.tick());
    let trouble = stack.plant.trouble().expect("no impulses are found");
    assert!(
        trouble.contains("\"light\"") && trouble.contains("m/s") && trouble.contains("substeps"),
        "{trouble}"
    );
}

#[test]
fn energy_that_steps_add_to_free_bodies_is_told() {
    // 5 mm inside the ground, which lifts it out by half a millimetre a step, and takes no speed along.
    let mut inside = Stack::new(&[cube("box", 10.0, [0.0, 0.0, 0.095])], 0.5, 2);
    let start_J = inside.energy_J();
    (0..100).for_each(|_| inside.tick());
    let lifted_J = inside.energy_J() - start_J;
    assert!((lifted_J - 10.0 * G_M_S2 * 5e-3).abs() < 1e-3, "{lifted_J} J");
    let remark = inside.plant.remark().expect("ten steps add energy");
    for part in ["free bodies gained energy in 10 of 200 steps", "4.9e-1 J in all", "4.9e-2 J in one"] {
        assert!(remark.contains(part), "{remark}");
    }
    let mut fallen = Stack::new(&falling(1.0, [0.0, 0.0], 0.05), 0.5, 2);
    (0..500).for_each(|_| fallen.tick());
    assert_eq!(fallen.plant.remark(), None, "a fall, an impact and a rest");
}

mod drawn {
    use super::*;
    use crate::skipped::drawn;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig { cases: drawn(4, 10), failure_persistence: None, ..ProptestConfig::default() })]

        /// Towers of two to ten cubes with gaps between them, none upright, thrown at each other's sides.
        #[test]
        fn towers_make_no_energy(
            parts in prop::collection::vec((-2.0..2.0_f64, -0.05..0.05_f64, -0.05..0.05_f64, 0.0..0.1_f64), 2..=10),
            friction in prop_oneof![Just(0.0), 0.1..1.0_f64],
            substeps in 1..=4_u32,
        ) {
            let mut height_m = 0.1;
            let mut heaviest_kg = 0.0_f64;
            let cubes: Vec<_> = parts.iter().enumerate().map(|(number, (exponent, x_m, y_m, gap_m))| {
                height_m += gap_m;
                let mass_kg = 0.1 * libm::pow(10.0, *exponent);
                heaviest_kg = heaviest_kg.max(mass_kg);
                let text = cube(&format!("cube {number}"), mass_kg, [*x_m, *y_m, height_m]);
                height_m += 0.2 + 1e-6;
                text
            }).collect();
            let mut stack = Stack::new(&cubes, friction, substeps);
            let may_gain_J = stack.may_gain_J(heaviest_kg * parts.len() as f64);
            let gain_J = stack.most_gain_J(600);
            prop_assert!(gain_J < may_gain_J, "{gain_J} J, {may_gain_J} J may be");
            prop_assert_eq!(stack.plant.trouble(), None);
        }
    }
}
