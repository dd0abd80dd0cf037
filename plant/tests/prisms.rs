//! Convex meshes whose faces have many corners, on the ground, on each other and on meshes of triangles.
#![allow(non_snake_case, reason = "a trailing _W or _B names the frame a vector is written in")]

use crate::common;
use common::parts::{Prism, body, given, keys};
use common::{TICK_S, bodies_energy_J, hummingbird};
use nalgebra::Vector3;
use plant::{Backend, NewtonEuler, Rapier, RigidBody};
use scenes::Scene;

/// Top of the table, two triangles without thickness.
const TABLE_M: f64 = 0.5;
const TABLE: &str = "v -1 -1 0.5\nv 1 -1 0.5\nv 1 1 0.5\nv -1 1 0.5\nf 1 2 3\nf 1 3 4\n";

/// Prisms of 1 kg, and a vehicle far away.
struct Flight {
    scene: Scene,
    plant: Rapier,
    corners_m: Vec<Vector3<f64>>,
}

/// A prism at the start.
struct Start {
    place_m: [f64; 3],
    spin_rad_s: [f64; 3],
}

impl Flight {
    /// Prisms of so many sides, above the ground alone or above a table, too.
    fn new(sides: u32, starts: &[Start], has_table: bool) -> Self {
        let prism = Prism { sides, radius_m: 0.12, half_m: 0.1 };
        let mesh = |name: &str, file: &str, solid: &str, more: &[(&str, &str, &str)]| {
            let more = keys(&[&[("scale", "1", "m")][..], more].concat());
            format!("[[meshes]]\nname = \"{name}\"\nfile = \"{file}\"\nsolid = \"{solid}\"\n{more}")
        };
        let prisms = starts.iter().enumerate().map(|(number, start)| {
            let (place, spin) = (format!("{:?}", start.place_m), format!("{:?}", start.spin_rad_s));
            let more =
                [("mass", "1", "kg"), ("position", &*place, "m"), ("angular_velocity", &*spin, "rad/s")];
            mesh(&format!("prism {number}"), "prism.obj", "convex", &more)
        });
        let table = mesh("table", "table.obj", "triangles", &[("position", "[0, 0, 0]", "m")]);
        let things: String = prisms.chain(has_table.then_some(table)).collect();
        let surface = format!("friction = {}\nrestitution = {}\n", given("0.6", "1"), given("0", "1"));
        let text = format!("name = \"test\"\n{surface}{things}");
        let obj = prism.obj();
        let read = |path: &std::path::Path| {
            let mesh = if path.ends_with("table.obj") { TABLE } else { &*obj };
            Ok(mesh.as_bytes().to_vec())
        };
        let scene = Scene::parse_with(&text, "test.toml", &read);
        let scene = scene.unwrap_or_else(|error| panic!("{error}\n{text}"));
        let start = RigidBody::level_at(Vector3::new(100.0, 0.0, 50.0));
        let plant = common::rapier(NewtonEuler::new(hummingbird(), 2), &scene, &start, 1e9);
        Self { scene, plant, corners_m: prism.corners_m() }
    }

    /// One prism that starts `height_m` above where it stands.
    fn of_one(sides: u32, height_m: f64, spin_rad_s: [f64; 3]) -> Self {
        Self::new(sides, &[Start { place_m: [0.0, 0.0, 0.1 + height_m], spin_rad_s }], false)
    }

    fn tick(&mut self) {
        self.plant.step(&[hummingbird().hover_command(); 4], TICK_S, &[]);
    }

    /// Kinetic and potential energy of the prisms.
    fn energy_J(&self) -> f64 {
        bodies_energy_J(&self.scene, &self.plant)
    }

    /// Height of the lowest corner of all prisms.
    fn lowest_m(&self) -> f64 {
        let heights_m = self.plant.bodies().iter().flat_map(|body| {
            self.corners_m.iter().map(move |corner| (body.position_W_m + body.attitude_WB * corner).z)
        });
        heights_m.fold(f64::INFINITY, f64::min)
    }

    /// The lowest corner in any of so many ticks, of which none adds more than `may_gain_J` to the least energy before it.
    fn lowest_in_m(&mut self, ticks: usize, may_gain_J: f64) -> f64 {
        let (mut least_J, mut lowest_m) = (self.energy_J(), f64::INFINITY);
        let sides = self.corners_m.len() / 2;
        for tick in 0..ticks {
            self.tick();
            let energy_J = self.energy_J();
            assert!(energy_J < least_J + may_gain_J, "{sides} sides, tick {tick}: {least_J} to {energy_J} J");
            least_J = least_J.min(energy_J);
            lowest_m = lowest_m.min(self.lowest_m());
        }
        assert_eq!(self.plant.trouble(), None, "{sides} sides");
        lowest_m
    }

    fn fastest_m_s(&self) -> f64 {
        let speeds = self
            .plant
            .bodies()
            .iter()
            .map(|body| body.velocity_W_m_s.norm().max(body.angular_velocity_B_rad_s.norm()));
        speeds.fold(0.0, f64::max)
    }
}

/// Parry finds contacts of four corners of a face. A prism with more sides stood on these alone, and sank by 11 cm.
#[test]
fn prisms_of_many_sides_that_rock_stay_above_the_ground() {
    for sides in [3, 6, 8, 16] {
        let lowest_m = Flight::of_one(sides, 0.0, [2.0, 1.0, 0.0]).lowest_in_m(1_000, 1e-4);
        assert!(lowest_m > -2e-6, "{sides} sides: {lowest_m} m");
    }
}

/// Contacts are kept of a part of the corners. One that is none sinks in the step before it is the lowest.
#[test]
fn prisms_of_hundreds_of_sides_that_rock_stay_above_the_ground() {
    for sides in [40, 300] {
        let lowest_m = Flight::of_one(sides, 0.0, [2.0, 1.0, 0.0]).lowest_in_m(1_000, 1e-3);
        assert!(lowest_m > -1e-4, "{sides} sides: {lowest_m} m");
    }
}

#[test]
fn a_face_of_hundreds_of_corners_falls_and_stands_as_one_of_four() {
    for sides in [4, 20, 32, 300] {
        let mut flight = Flight::of_one(sides, 0.02, [0.0; 3]);
        let lowest_m = flight.lowest_in_m(500, 1e-4);
        assert!(lowest_m > -2e-6, "{sides} sides: {lowest_m} m");
        let (height_m, fastest) = (flight.lowest_m(), flight.fastest_m_s());
        assert!(height_m.abs() < 2e-6 && fastest < 1e-4, "{sides} sides: {height_m} m, {fastest} m/s");
    }
}

/// The corner of one is the corner of the other.
#[test]
fn equal_prisms_stand_on_each_other() {
    for sides in [4, 8, 32] {
        let starts = [0.1, 0.3].map(|z| Start { place_m: [0.0, 0.0, z], spin_rad_s: [0.0; 3] });
        let mut flight = Flight::new(sides, &starts, false);
        flight.lowest_in_m(500, 1e-4);
        let [lower, upper] = flight.plant.bodies() else { panic!("two prisms") };
        let places_W_m = [lower, upper].map(|body| body.position_W_m);
        let off_m = [0.1, 0.3].map(|z| Vector3::z() * z);
        let off_m = [0, 1].map(|at| (places_W_m[at] - off_m[at]).norm());
        assert!(off_m[0].max(off_m[1]) < 1e-5, "{sides} sides: {off_m:?} m");
        assert!(flight.fastest_m_s() < 1e-4, "{sides} sides: {} m/s", flight.fastest_m_s());
    }
}

#[test]
fn prisms_rock_on_a_mesh_of_triangles_as_on_the_ground() {
    for sides in [4, 8, 16] {
        let start = Start { place_m: [0.03, 0.05, TABLE_M + 0.1], spin_rad_s: [2.0, 1.0, 0.0] };
        let mut flight = Flight::new(sides, &[start], true);
        let lowest_m = flight.lowest_in_m(1_000, 1e-4) - TABLE_M;
        assert!(lowest_m > -2e-6, "{sides} sides: {lowest_m} m");
        let height_m = flight.lowest_m() - TABLE_M;
        assert!(height_m.abs() < 2e-6, "{sides} sides: {height_m} m");
    }
}

/// The corner of the table is within the prism's face.
#[test]
fn a_prism_that_overhangs_the_corner_of_a_mesh_stays_where_it_is() {
    let place_m = [0.95, -0.97, TABLE_M + 0.1];
    let mut flight = Flight::new(4, &[Start { place_m, spin_rad_s: [0.0; 3] }], true);
    let lowest_m = flight.lowest_in_m(500, 1e-4) - TABLE_M;
    assert!(lowest_m > -2e-6, "{lowest_m} m");
    let off_W_m = flight.plant.bodies()[0].position_W_m - Vector3::from(place_m);
    assert!(off_W_m.norm() < 1e-5, "{off_W_m:?}");
}

/// The first four corners of the plate are not below the box, which stood on one point alone.
#[test]
fn a_box_rocks_on_a_plate_of_many_sides_as_on_one_of_four() {
    for sides in [4, 8, 32] {
        let obj = Prism { sides, radius_m: 0.5, half_m: 0.1 }.obj();
        let place = keys(&[("position", "[0, 0, 0.1]", "m"), ("scale", "1", "m")]);
        let plate =
            format!("[[meshes]]\nname = \"plate\"\nfile = \"plate.obj\"\nsolid = \"convex\"\n{place}");
        let cube = [
            ("centre", "[0.1, 0.05, 0.25]", "m"),
            ("size", "[0.1, 0.1, 0.1]", "m"),
            ("mass", "1", "kg"),
            ("angular_velocity", "[0.5, 0.3, 0]", "rad/s"),
        ];
        let text = format!("name = \"test\"\n{}{plate}", body("boxes", "cube", &cube));
        let scene = Scene::parse_with(&text, "test.toml", &|_| Ok(obj.clone().into_bytes())).unwrap();
        let start = RigidBody::level_at(Vector3::new(100.0, 0.0, 50.0));
        let mut plant = common::rapier(NewtonEuler::new(hummingbird(), 2), &scene, &start, 1e9);
        (0..500).for_each(|_| plant.step(&[hummingbird().hover_command(); 4], TICK_S, &[]));
        let found = plant.bodies()[0];
        let off_m = (found.position_W_m.z - 0.25).abs();
        let tilt_rad = (found.attitude_WB * Vector3::z()).xy().norm();
        let spin_rad_s = found.angular_velocity_B_rad_s.norm();
        assert!(off_m < 1e-6 && tilt_rad < 1e-6 && spin_rad_s < 1e-5, "{sides} sides: {found:?}");
    }
}
