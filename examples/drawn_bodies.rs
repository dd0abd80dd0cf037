//! Flies stacks and throws of boxes drawn from a seed, and prints them as one line of JSON: what was drawn, and each body
//! at the end. `scripts/bodies` holds them against MuJoCo.
//!
//! ```sh
//! cargo run --example drawn_bodies -- 100       # 100 of each kind
//! ```
#![allow(non_snake_case, reason = "a trailing _W names the frame a vector is written in")]

use bus::random::{Stream, stream, uniform};
use nalgebra::Vector3;
use plant::{Airframe, Backend, NewtonEuler, Rapier, RigidBody};
use scenes::Scene;
use serde_json::{Value, json};
use vehicles::Vehicle;

const TICK_S: f64 = 1e-3;
/// Simulated time until what was drawn is judged.
const DURATION_S: f64 = 2.5;

/// Numbers drawn from a seed.
struct Draw(Stream);

impl Draw {
    fn between(&mut self, least: f64, most: f64) -> f64 {
        least + (most - least) * uniform(&mut self.0)
    }

    fn vector(&mut self, most: [f64; 3]) -> [f64; 3] {
        most.map(|most| self.between(-most, most))
    }
}

/// A box: edges (m), mass (kg), centre (m), velocity (m/s) and angular velocity (rad/s), all in the world's axes.
struct Cuboid {
    size_m: [f64; 3],
    mass_kg: f64,
    centre_W_m: [f64; 3],
    velocity_W_m_s: [f64; 3],
    spin_W_rad_s: [f64; 3],
}

/// Boxes of one case.
type Kind = fn(&mut Draw) -> Vec<Cuboid>;

/// Two to six boxes on each other, with gaps that they fall through, none above the middle of the one below.
fn stack(draw: &mut Draw) -> Vec<Cuboid> {
    let count = draw.between(2.0, 6.999) as usize;
    let mut top_m = 0.0;
    let boxes = (0..count).map(|_| {
        let size_m = [draw.between(0.12, 0.3), draw.between(0.12, 0.3), draw.between(0.08, 0.25)];
        let bottom_m = top_m + draw.between(0.0005, 0.05);
        top_m = bottom_m + size_m[2];
        let [x, y, _] = draw.vector([0.05, 0.05, 0.0]);
        let mass_kg = libm::pow(10.0, draw.between(-1.0, 1.0));
        let centre_W_m = [x, y, bottom_m + size_m[2] / 2.0];
        Cuboid { size_m, mass_kg, centre_W_m, velocity_W_m_s: [0.0; 3], spin_W_rad_s: [0.0; 3] }
    });
    boxes.collect()
}

/// A flat box that slides and turns on the ground until it rests.
fn slide(draw: &mut Draw) -> Vec<Cuboid> {
    let size_m = [draw.between(0.2, 0.4), draw.between(0.2, 0.4), draw.between(0.02, 0.06)];
    let [vx, vy, _] = draw.vector([2.0, 2.0, 0.0]);
    vec![Cuboid {
        size_m,
        mass_kg: libm::pow(10.0, draw.between(-1.0, 1.0)),
        centre_W_m: [0.0, 0.0, size_m[2] / 2.0],
        velocity_W_m_s: [vx, vy, 0.0],
        spin_W_rad_s: [0.0, 0.0, draw.between(-10.0, 10.0)],
    }]
}

/// A box that flies, turns and tumbles over the ground.
fn throw(draw: &mut Draw) -> Vec<Cuboid> {
    let size_m = [draw.between(0.1, 0.3), draw.between(0.1, 0.3), draw.between(0.1, 0.3)];
    vec![Cuboid {
        size_m,
        mass_kg: libm::pow(10.0, draw.between(-1.0, 1.0)),
        centre_W_m: [0.0, 0.0, draw.between(0.3, 0.8)],
        velocity_W_m_s: draw.vector([1.0, 1.0, 1.0]),
        spin_W_rad_s: draw.vector([4.0, 4.0, 4.0]),
    }]
}

fn given(value: &str, unit: &str) -> String {
    format!("{{ value = {value}, unit = \"{unit}\", source = \"drawn\", uncertainty = \"exact\" }}")
}

fn scene(boxes: &[Cuboid], friction: f64) -> Scene {
    let mut text = format!(
        "name = \"drawn\"\nfriction = {}\nrestitution = {}\n",
        given(&friction.to_string(), "1"),
        given("0", "1")
    );
    for (number, cuboid) in boxes.iter().enumerate() {
        text += &format!("[[boxes]]\nname = \"box {number}\"\n");
        text += &format!("mass = {}\n", given(&cuboid.mass_kg.to_string(), "kg"));
        for (key, vector, unit) in [
            ("centre", cuboid.centre_W_m, "m"),
            ("size", cuboid.size_m, "m"),
            ("velocity", cuboid.velocity_W_m_s, "m/s"),
            ("angular_velocity", cuboid.spin_W_rad_s, "rad/s"),
        ] {
            text += &format!("{key} = {}\n", given(&format!("{vector:?}"), unit));
        }
    }
    Scene::parse(&text, "drawn.toml").unwrap_or_else(|error| panic!("{error}\n{text}"))
}

/// Position (m) and attitude (quaternion, w first) of each box at the end, and the first contacts that were not solved.
fn flown(scene: &Scene) -> (Vec<[f64; 7]>, Option<String>) {
    let vehicle = Vehicle::parse(vehicles::reference::HUMMINGBIRD, "hummingbird.toml");
    let model = NewtonEuler::flying(Airframe::new(vehicle.expect("the reference vehicle")), 2);
    let effects = model.airframe().initial_state(0, "plant", TICK_S);
    let far_away = RigidBody::level_at(Vector3::new(0.0, 100.0, 200.0));
    let mut plant = Rapier::new(model, effects, scene, &far_away, 1e9);
    for _ in 0..(DURATION_S / TICK_S).round() as u32 {
        plant.step(&[0.0; 4], TICK_S, &[]);
    }
    let placed = plant.bodies().iter().map(|body| {
        let ([x, y, z], turn) = (body.position_W_m.into(), body.attitude_WB.quaternion());
        [x, y, z, turn.w, turn.i, turn.j, turn.k]
    });
    (placed.collect(), plant.trouble())
}

fn case(kind: &str, boxes: &[Cuboid], friction: f64) -> Value {
    let told = boxes.iter().map(|cuboid| {
        json!({
            "size": cuboid.size_m,
            "mass": cuboid.mass_kg,
            "centre": cuboid.centre_W_m,
            "velocity": cuboid.velocity_W_m_s,
            "spin": cuboid.spin_W_rad_s,
        })
    });
    let told: Vec<Value> = told.collect();
    let (end, trouble) = flown(&scene(boxes, friction));
    json!({ "kind": kind, "friction": friction, "duration": DURATION_S, "boxes": told, "end": end, "trouble": trouble })
}

fn main() {
    let count =
        std::env::args().nth(1).map_or(24, |text| text.parse().expect("the number of cases of each kind"));
    let mut draw = Draw(stream(1, "drawn bodies"));
    let kinds: [(&str, Kind); 3] = [("stack", stack), ("slide", slide), ("throw", throw)];
    let cases: Vec<Value> = kinds
        .iter()
        .flat_map(|(kind, boxes)| (0..count).map(move |_| (kind, boxes)))
        .map(|(kind, boxes)| {
            let friction = draw.between(0.2, 0.9);
            case(kind, &boxes(&mut draw), friction)
        })
        .collect();
    println!("{}", json!(cases));
}
