//! Heavy bodies on light ones: no stack makes energy, squeezes a body out, or sinks.
#![allow(non_snake_case, reason = "a trailing _W or _B names the frame a vector is written in")]

mod common;

use common::{TICK_S, hummingbird};
use nalgebra::Vector3;
use plant::{Backend, NewtonEuler, Rapier, RigidBody};
use scenes::Scene;

const G_M_S2: f64 = 9.81;

fn given(value: &str, unit: &str) -> String {
    format!("{{ value = {value}, unit = \"{unit}\", source = \"test\", uncertainty = \"exact\" }}")
}

/// A cube with an edge of 0.2 m.
fn cube(name: &str, mass_kg: f64, centre_m: [f64; 3]) -> String {
    let keys = [
        ("centre", format!("{centre_m:?}"), "m"),
        ("size", "[0.2, 0.2, 0.2]".to_owned(), "m"),
        ("mass", mass_kg.to_string(), "kg"),
    ];
    let keys: String = keys.iter().map(|(key, value, unit)| format!("{key} = {}\n", given(value, unit))).collect();
    format!("[[boxes]]\nname = \"{name}\"\n{keys}")
}

/// Free bodies on the ground, and a vehicle far away.
struct Stack {
    scene: Scene,
    plant: Rapier,
}

impl Stack {
    fn new(cubes: &[String], friction: f64, substeps: u32) -> Self {
        let surface = format!(
            "friction = {}\nrestitution = {}\n",
            given(&friction.to_string(), "1"),
            given("0", "1")
        );
        let text = format!("name = \"test\"\n{surface}{}", cubes.concat());
        let scene = Scene::parse(&text, "test.toml").unwrap_or_else(|error| panic!("{error}\n{text}"));
        let model = NewtonEuler::new(hummingbird(), substeps);
        let start = RigidBody::level_at(Vector3::new(100.0, 0.0, 50.0));
        let plant = common::rapier(model, &scene, &start, 1e9);
        Self { scene, plant }
    }

    fn tick(&mut self) {
        self.plant.step(&[hummingbird().hover_command(); 4], TICK_S, &[]);
    }

    /// Kinetic and potential energy of the bodies.
    fn energy_J(&self) -> f64 {
        let bodies = self.scene.bodies().zip(self.plant.bodies()).map(|((_, built), body)| {
            let w = body.angular_velocity_B_rad_s;
            0.5 * built.mass_kg * body.velocity_W_m_s.norm_squared()
                + 0.5 * w.dot(&(built.inertia_kg_m2 * w))
                + built.mass_kg * G_M_S2 * body.position_W_m.z
        });
        bodies.sum()
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
}

#[test]
fn a_heavy_box_that_falls_on_a_light_one_makes_no_energy() {
    for ratio in [1.0, 30.0, 100.0, 1_000.0, 10_000.0] {
        for friction in [0.0, 0.5, 1.0] {
        let cubes = [cube("light", 10.0 / ratio, [0.0, 0.0, 0.1]), cube("heavy", 10.0, [0.03, 0.02, 0.7])];
        let mut stack = Stack::new(&cubes, friction, 2);
        let start = std::time::Instant::now();
        let gain_J = stack.most_gain_J(1_000);
        println!("{ratio} friction {friction}: gain {gain_J:e} J, took {:?} {:?}", start.elapsed(), stack.plant.bodies()[0].position_W_m);
        }
    }
}
