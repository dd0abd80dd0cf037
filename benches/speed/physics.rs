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

/// Prints the times of a step and of a cast.
pub fn report() -> Result<()> {
    println!(
        "\nphysics: ns, median (min … max) of {REPETITIONS} rounds of {STEPS}; and against a multiply-add"
    );
    let load = |name| Scene::load(&path(name));
    let (room, ground) = (load("scenes/room.toml")?, load("scenes/ground.toml")?);
    let caster = RayCaster::new(&room);
    let (rig_a, rig_b) = (load("scenes/rig-sliding.toml")?, load("scenes/rig-fixed.toml")?);
    let (in_the_air, on_the_ground) = (Vector3::z(), Vector3::zeros());
    // At 1075 rpm it stays where it stands; at hover it flies.
    let mut steps = [
        ("newton-euler", free_flight()?, in_the_air, 76.5),
        ("rapier, ground", rapier(&ground)?, in_the_air, 76.5),
        ("rapier, room", rapier(&room)?, in_the_air, 76.5),
        ("rapier, standing on the ground", rapier(&ground)?, on_the_ground, 1.0),
        ("rapier, rig A", rapier(&rig_a)?, in_the_air, 90.0),
        ("rapier, rig B", rapier(&rig_b)?, in_the_air, 76.5),
    ];
    let mut rounds: [Vec<f64>; 8] = Default::default();
    for _ in 0..REPETITIONS {
        rounds[0].push(multiply_add_ns());
        for (round, (_, backend, start_m, command)) in (1..).zip(&mut steps) {
            rounds[round].push(step_ns(&mut **backend, start_m, *command));
        }
        rounds[7].push(cast_ns(&caster));
    }
    let [unit, rest @ ..] = rounds;
    let names = steps.each_ref().map(|step| step.0).into_iter().chain(["ray cast in the room"]);
    let unit_ns = Spread::of(unit.clone()).median;
    println!("  multiply-add, each on the last   {}", Spread::of(unit));
    for (name, ns) in names.zip(rest) {
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

/// A step under the same command on all rotors, set back to its start each second so that it stays where it is.
fn step_ns(backend: &mut dyn Backend, start_m: &Vector3<f64>, command: f64) -> f64 {
    let start = Instant::now();
    for step in 0..STEPS {
        if step % 1000 == 0 {
            backend.set_body(&RigidBody::level_at(*start_m));
        }
        backend.step(black_box(&[command; 4]), DT_S, &[]);
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

/// A chain of multiply-adds, each of which needs the one before: the cost of arithmetic that cannot overlap.
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
