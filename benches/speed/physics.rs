//! A step of either backend and a ray cast, in nanoseconds and in multiply-adds of this machine.

use crate::report::{Result, Spread};
use nalgebra::Vector3;
use plant::{Airframe, Backend, FreeFlight, NewtonEuler, Rapier, RigidBody};
use scenes::{RayCaster, Scene};
use std::hint::black_box;
use std::path::Path;
use std::time::Instant;
use vehicles::Vehicle;

const REPETITIONS: usize = 11;
const STEPS: u32 = 20_000;
const DT_S: f64 = 1e-3;

/// Additions, multiplications and square roots of a Newton-Euler step without effects, counted by hand in
/// `plant/src/newton_euler.rs` and its rooms: four stages of about 300 (rotors 100, rotation 40, Euler's equation 50,
/// quaternion 30, the state moved 80), and 120 to sum and normalise. Within a fifth.
const STEP_OPERATIONS: f64 = 1300.0;

/// Prints what a step and a cast take.
pub fn report() -> Result<()> {
    println!(
        "\nphysics: ns, median (min … max) of {REPETITIONS} rounds of {STEPS}; and against a multiply-add"
    );
    let room = Scene::load(&path("scenes/room.toml"))?;
    let ground = Scene::load(&path("scenes/ground.toml"))?;
    let caster = RayCaster::new(&room);
    let mut rounds: [Vec<f64>; 5] = Default::default();
    let (mut free, mut bare, mut walled) = (free_flight()?, rapier(&ground)?, rapier(&room)?);
    for _ in 0..REPETITIONS {
        rounds[0].push(multiply_add_ns());
        for (round, backend) in [(1, &mut free), (2, &mut bare), (3, &mut walled)] {
            rounds[round].push(step_ns(&mut **backend));
        }
        rounds[4].push(cast_ns(&caster));
    }
    let [unit, rest @ ..] = rounds;
    let names = ["newton-euler", "rapier, ground", "rapier, room", "ray cast in the room"];
    let unit_ns = Spread::of(unit.clone()).median;
    println!("  multiply-add, each on the last   {}", Spread::of(unit));
    for (name, ns) in names.iter().zip(rest) {
        let median = Spread::of(ns.clone()).median;
        println!("  {name:<32} {}  {:8.0} multiply-adds", Spread::of(ns), median / unit_ns);
    }
    println!("  a newton-euler step has about {STEP_OPERATIONS} operations");
    Ok(())
}

fn path(name: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

fn model() -> Result<NewtonEuler> {
    let vehicle = Vehicle::load(&path("vehicles/hummingbird.toml"))?;
    Ok(NewtonEuler::flying(Airframe::new(vehicle), 1))
}

fn free_flight() -> Result<Box<dyn Backend>> {
    let model = model()?;
    let memory = model.airframe().initial_state(0, "plant", DT_S);
    Ok(Box::new(FreeFlight::new(model, RigidBody::level_at(Vector3::z()), memory)))
}

fn rapier(scene: &Scene) -> Result<Box<dyn Backend>> {
    let model = model()?;
    let memory = model.airframe().initial_state(0, "plant", DT_S);
    Ok(Box::new(Rapier::new(model, memory, scene, &RigidBody::level_at(Vector3::z()), 1.0)))
}

/// A step of hover, set back to its start each second so that it stays where it is.
fn step_ns(backend: &mut dyn Backend) -> f64 {
    let start = Instant::now();
    for step in 0..STEPS {
        if step % 1000 == 0 {
            backend.set_body(&RigidBody::level_at(Vector3::z()));
        }
        backend.step(black_box(&[76.5; 4]), DT_S, &[]);
    }
    black_box(backend.state());
    per_step_ns(start)
}

fn cast_ns(caster: &RayCaster) -> f64 {
    let start = Instant::now();
    for step in 0..STEPS {
        let angle_rad = f64::from(step);
        let along = Vector3::new(libm::cos(angle_rad), libm::sin(angle_rad), 0.0);
        black_box(caster.distance_m(black_box(&Vector3::z()), &along, 7.65));
    }
    per_step_ns(start)
}

/// A chain of multiply-adds, each of which needs the one before: what arithmetic costs that cannot overlap.
fn multiply_add_ns() -> f64 {
    let (mut sum, factor) = (black_box(1.0_f64), black_box(0.999));
    let start = Instant::now();
    for _ in 0..STEPS {
        sum = sum * factor + 1.0;
    }
    let ns = per_step_ns(start);
    black_box(sum);
    ns
}

fn per_step_ns(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e9 / f64::from(STEPS)
}
