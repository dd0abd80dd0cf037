//! Flies the cases that docs/world.md compares with closed forms, MuJoCo and RotorPy, and prints them as one line of
//! JSON: the vehicle, and for each case its states at every tick. `scripts/world` reads it.
//!
//! A state is the time, position and velocity (world, m and m/s), attitude (quaternion, w first) and angular
//! velocity (body, rad/s). The rotors' speeds and accelerations follow (rad/s, rad/s^2).
#![allow(non_snake_case, reason = "a trailing _W or _B names the frame a vector is written in")]

use nalgebra::{UnitQuaternion, Vector3};
use plant::contact_dynamics::hull::Hull;
use plant::{Airframe, Backend, FreeFlight, NewtonEuler, Rapier, RigidBody, State};
use scenes::{Scene, Surface};
use serde_json::{Value, json};
use vehicles::{MotorModel, Rotor, Vehicle};

const TICK_S: f64 = 1e-3;
const HOVER_RAD_S: f64 = 411.6;
/// Amplitudes of the rotor speeds in chirps: up to 66 and 178 degrees of tilt.
const GENTLE_RAD_S: f64 = 15.0;
const HARD_RAD_S: f64 = 250.0;

/// Chirps from 0.8 to 4 Hz about two axes, and a slower one about the third: rotor speeds swing by `swing_rad_s`.
fn chirp(vehicle: &Vehicle, swing_rad_s: f64, time_s: f64) -> [f64; 4] {
    let phase = std::f64::consts::TAU * (0.8 * time_s + 0.16 * time_s * time_s);
    let [roll, pitch, yaw] = [1.0, 1.3, 2.1].map(|faster| swing_rad_s * libm::cos(faster * phase));
    let more_rad_s = [-pitch + yaw, -roll - yaw, pitch + yaw, roll - yaw];
    more_rad_s.map(|more| vehicle.command.command(HOVER_RAD_S + more))
}

fn numbers(time_s: f64, state: &State) -> Vec<f64> {
    let body = &state.body;
    let attitude = body.attitude_WB.quaternion();
    let mut numbers = vec![time_s];
    numbers.extend(body.position_W_m.iter().chain(body.velocity_W_m_s.iter()));
    numbers.extend([attitude.w, attitude.i, attitude.j, attitude.k]);
    numbers.extend(body.angular_velocity_B_rad_s.iter());
    numbers.extend(state.rotors.iter().map(|rotor| rotor.speed_rad_s));
    numbers.extend(state.rotors.iter().map(|rotor| rotor.acceleration_rad_s2));
    numbers
}

/// States at every `every`th tick of `duration_s`.
fn flown(
    backend: &mut dyn Backend,
    duration_s: f64,
    every: u32,
    commands: &dyn Fn(f64) -> [f64; 4],
) -> Vec<Vec<f64>> {
    let mut states = vec![numbers(0.0, backend.state())];
    for tick in 0..(duration_s / TICK_S).round() as u32 {
        backend.step(&commands(f64::from(tick) * TICK_S), TICK_S, &[]);
        if (tick + 1) % every == 0 {
            states.push(numbers(f64::from(tick + 1) * TICK_S, backend.state()));
        }
    }
    states
}

fn hummingbird() -> Vehicle {
    Vehicle::parse(vehicles::reference::HUMMINGBIRD, "hummingbird.toml").expect("the reference vehicle")
}

/// A rigid body and nothing else.
fn airless() -> Vehicle {
    Vehicle { thrust_coefficient: 0.0, torque_coefficient: 0.0, rotor_inertia_kg_m2: 0.0, ..hummingbird() }
}

fn model(vehicle: &Vehicle, substeps: u32) -> NewtonEuler {
    NewtonEuler::flying(Airframe::new(vehicle.clone()), substeps)
}

fn rapier(vehicle: &Vehicle, scene: &Scene, start: &RigidBody) -> Rapier {
    let model = model(vehicle, 2);
    let effects = model.airframe().initial_state(0, "plant", TICK_S);
    let mut plant = Rapier::new(model, effects, scene, start, 1e9);
    plant.set_body(start);
    plant
}

/// A flight of chirps, from hover at 100 m.
fn chirps(vehicle: &Vehicle, swing_rad_s: f64, substeps: u32) -> Vec<Vec<f64>> {
    let model = model(vehicle, substeps);
    let effects = model.airframe().initial_state(0, "plant", TICK_S);
    let start = RigidBody::level_at(Vector3::z() * 100.0);
    let mut plant = FreeFlight::new(model, start, effects);
    plant.settle_rotors(&[vehicle.command.command(HOVER_RAD_S); 4]);
    flown(&mut plant, 10.0, 1, &|time_s| chirp(vehicle, swing_rad_s, time_s))
}

fn dropped(vehicle: &Vehicle, scene: &Scene, start: &RigidBody, duration_s: f64) -> Vec<Vec<f64>> {
    flown(&mut rapier(vehicle, scene, start), duration_s, 1, &|_| [0.0; 4])
}

fn scene(text: &str) -> Scene {
    Scene::parse(text, "case.toml").expect("a scene")
}

fn surface(friction: f64, restitution: f64) -> Scene {
    Scene { surface: Surface { friction, restitution }, ..Scene::default() }
}

fn table() -> Scene {
    let number = |value: &str| {
        format!("{{ value = {value}, unit = \"m\", source = \"case\", uncertainty = \"exact\" }}")
    };
    let (centre, size) = (number("[-1.03, 0, 1.9]"), number("[2, 2, 0.2]"));
    let scene =
        scene(&format!("name = \"table\"\n[[boxes]]\nname = \"table\"\ncentre = {centre}\nsize = {size}\n"));
    let surface = Surface { friction: 5.0, restitution: 0.0 };
    let boxes = scene.boxes.into_iter().map(|cuboid| scenes::Cuboid { surface, ..cuboid }).collect();
    Scene { boxes, surface, ..Scene::default() }
}

fn rig(text: &str) -> Scene {
    let mut scene = scene(text);
    if let Some(rig) = &mut scene.rig {
        (rig.bearing_friction_N_m, rig.bearing_damping_N_m_s) = (0.0, 0.0);
        (rig.slide_friction_N, rig.slide_damping_N_s_m) = (0.0, 0.0);
    }
    scene
}

/// A box of a chain: name, centre, size, mass, and the joint that it hangs by with its anchor.
type Link = (&'static str, [f64; 3], [f64; 3], f64, &'static str, [f64; 3]);

/// Bodies that hang in a chain from the vehicle.
const CHAIN: [Link; 4] = [
    ("a", [0.05, 0.02, -0.25], [0.1, 0.2, 0.3], 0.3, "ball", [0.0, 0.0, -0.08]),
    ("b", [0.05, 0.1, -0.55], [0.2, 0.1, 0.2], 0.2, "revolute", [0.05, 0.05, -0.42]),
    ("c", [0.1, 0.1, -0.8], [0.1, 0.1, 0.1], 0.15, "prismatic", [0.1, 0.1, -0.7]),
    ("d", [0.2, 0.15, -0.85], [0.15, 0.05, 0.1], 0.1, "fixed", [0.15, 0.1, -0.8]),
];
/// The axis of its second and third joint.
const CHAIN_AXIS: [f64; 3] = [0.6, 0.8, 0.0];

/// Drives of the second and third joint, where they are driven: to a position, rad, and to a speed, m/s, that is never reached. A force that
/// comes to its limit within a step would err by the square of the step.
const CHAIN_DRIVES: [(&str, Drive); 2] = [
    ("b", Drive { target: 0.6, stiffness: 0.4, damping: 0.02, limit: f64::INFINITY }),
    ("c", Drive { target: 10.0, stiffness: 0.0, damping: 1.5, limit: 0.02 }),
];

/// A drive of a joint of the chain, in SI units: without stiffness, of a speed.
struct Drive {
    target: f64,
    stiffness: f64,
    damping: f64,
    limit: f64,
}

/// The chain with its drives.
fn driven_chain() -> Scene {
    let mut scene = chain();
    for joint in &mut scene.joints {
        let drive = CHAIN_DRIVES.iter().find(|(name, _)| *name == joint.name);
        joint.drive = drive.map(|(_, drive)| scenes::Drive {
            mode: if drive.stiffness > 0.0 { scenes::Mode::Position } else { scenes::Mode::Speed },
            stiffness: drive.stiffness,
            damping: drive.damping,
            limit: drive.limit,
            schedule: vec![[0.0, drive.target]],
        });
    }
    scene
}

fn chain() -> Scene {
    let given = |value: &str, unit: &str| {
        format!("{{ value = {value}, unit = \"{unit}\", source = \"case\", uncertainty = \"exact\" }}")
    };
    let mut text = "name = \"chain\"\n".to_owned();
    let mut parent = "vehicle";
    let mut joints = String::new();
    for (name, centre, size, mass_kg, kind, anchor) in &CHAIN {
        let numbers = [centre, size, anchor].map(|numbers| given(&format!("{numbers:?}"), "m"));
        let [centre, size, anchor] = &numbers;
        let mass = given(&mass_kg.to_string(), "kg");
        text += &format!("[[boxes]]\nname = \"{name}\"\ncentre = {centre}\nsize = {size}\nmass = {mass}\n");
        joints += &format!(
            "[[joints]]\nname = \"{name}\"\nkind = \"{kind}\"\nparent = \"{parent}\"\nchild = \"{name}\"\nanchor = {anchor}\n"
        );
        if ["revolute", "prismatic"].contains(kind) {
            joints += &format!("axis = {}\n", given(&format!("{CHAIN_AXIS:?}"), "1"));
        }
        parent = name;
    }
    scene(&(text + &joints))
}

/// A chain and the vehicle, which spin in free fall until two of them meet: the time, and position and attitude (w first) of each.
fn falling_chain(vehicle: &Vehicle, scene: &Scene, ticks: u32) -> Vec<Vec<f64>> {
    let start = RigidBody {
        angular_velocity_B_rad_s: Vector3::new(2.0, 1.0, 3.0),
        ..RigidBody::level_at(Vector3::z() * 100.0)
    };
    let mut plant = rapier(vehicle, scene, &start);
    let told = |tick: u32, plant: &Rapier| {
        let mut numbers = vec![f64::from(tick) * TICK_S];
        for body in [&plant.state().body].into_iter().chain(plant.bodies()) {
            let attitude = body.attitude_WB.quaternion();
            numbers.extend(body.position_W_m.iter());
            numbers.extend([attitude.w, attitude.i, attitude.j, attitude.k]);
        }
        numbers
    };
    let mut states = vec![told(0, &plant)];
    for tick in 1..=ticks {
        plant.step(&[0.0; 4], TICK_S, &[]);
        if tick % 10 == 0 {
            states.push(told(tick, &plant));
        }
    }
    states
}

/// A box of 10 kg that falls 0.4 m onto one of 0.1 kg on the ground, both with edges of 0.2 m: the time, positions and velocities.
fn heavy_on_light() -> Vec<Vec<f64>> {
    let given = |value: &str, unit: &str| {
        format!("{{ value = {value}, unit = \"{unit}\", source = \"case\", uncertainty = \"exact\" }}")
    };
    let cube = |name: &str, centre: &str, mass: &str| {
        let (centre, size, mass) = (given(centre, "m"), given("[0.2, 0.2, 0.2]", "m"), given(mass, "kg"));
        format!("[[boxes]]\nname = \"{name}\"\ncentre = {centre}\nsize = {size}\nmass = {mass}\n")
    };
    let surface = format!("friction = {}\nrestitution = {}\n", given("0.5", "1"), given("0", "1"));
    let cubes = cube("light", "[0, 0, 0.1]", "0.1") + &cube("heavy", "[0.03, 0.02, 0.7]", "10");
    let scene = scene(&format!("name = \"heavy on light\"\n{surface}{cubes}"));
    let mut plant = rapier(&airless(), &scene, &RigidBody::level_at(Vector3::new(0.0, 50.0, 100.0)));
    let mut told = |tick: u32| {
        plant.step(&[0.0; 4], TICK_S, &[]);
        let [light, heavy] = plant.bodies() else { panic!("two boxes") };
        let vectors = [light.position_W_m, light.velocity_W_m_s, heavy.position_W_m, heavy.velocity_W_m_s]
            .map(<[f64; 3]>::from);
        [vec![f64::from(tick) * TICK_S], vectors.concat()].concat()
    };
    (1..=1_000).map(&mut told).collect()
}

fn cases() -> Value {
    let (declared, body) = (hummingbird(), airless());
    let stand_m = Hull::of(&Airframe::new(body.clone())).stand_m();
    // As RotorPy has it: motors of first order, rotors without inertia.
    let plain = Vehicle {
        motor: MotorModel::FirstOrder { time_constant_s: 0.05 },
        rotor_inertia_kg_m2: 0.0,
        ..declared.clone()
    };
    let at_rest = RigidBody::level_at(Vector3::z() * stand_m);
    let raised = |height_m: f64| RigidBody::level_at(Vector3::z() * (stand_m + height_m));
    let sliding = RigidBody { velocity_W_m_s: Vector3::new(2.4, 1.8, 0.0), ..at_rest };
    let tumbling = RigidBody {
        angular_velocity_B_rad_s: Vector3::new(6.0, 0.01, 4.0),
        ..RigidBody::level_at(Vector3::z() * 60_000.0)
    };
    let uneven = Vehicle {
        inertia_kg_m2: nalgebra::Matrix3::from_diagonal(&Vector3::new(5.6e-3, 7.0e-3, 8.1e-3)),
        ..body.clone()
    };
    let (sliding_rig, fixed_rig) = (rig(scenes::reference::RIG_SLIDING), rig(scenes::reference::RIG_FIXED));
    let hung = |scene: &Scene, height_m: f64| {
        let rig = scene.rig.expect("a rig");
        RigidBody::level_at(rig.bearing_W_m - rig.mount_B_m + Vector3::z() * height_m)
    };
    let leaning = |angle_rad: f64| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), angle_rad);
    let swinging = RigidBody { attitude_WB: leaning(0.5), ..hung(&fixed_rig, 0.0) };
    let hits_cone =
        RigidBody { angular_velocity_B_rad_s: Vector3::new(6.4, 4.8, 0.0), ..hung(&fixed_rig, 0.0) };
    let bounces = [0.05, 0.2, 0.499, 0.5, 0.501, 1.0].map(|height_m| {
        let states = dropped(&body, &surface(0.5, 0.2), &raised(height_m), 1.2);
        json!({ "height_m": height_m, "states": states })
    });
    json!({
        "chirps": chirps(&declared, GENTLE_RAD_S, 2),
        "hard chirps": chirps(&declared, HARD_RAD_S, 2),
        "hard chirps, one step a tick": chirps(&declared, HARD_RAD_S, 1),
        "plain chirps": chirps(&plain, GENTLE_RAD_S, 2),
        "tumble": flown(&mut rapier(&uneven, &Scene::default(), &tumbling), 100.0, 100, &|_| [0.0; 4]),
        "bounces": bounces,
        "slide": dropped(&body, &surface(0.5, 0.2), &sliding, 1.0),
        "rest": dropped(&body, &surface(0.5, 0.2), &at_rest, 1.0),
        "tip": dropped(&body, &table(), &RigidBody::level_at(Vector3::z() * (2.0 + stand_m)), 0.3),
        "rig A, lower end": dropped(&body, &sliding_rig, &hung(&sliding_rig, 0.2), 0.5),
        "rig B, swing": dropped(&body, &fixed_rig, &swinging, 10.0),
        "chain": falling_chain(&body, &chain(), 2_400),
        "driven chain": falling_chain(&body, &driven_chain(), 1_500),
        "heavy on light": heavy_on_light(),
        "rig B, cone": dropped(&body, &fixed_rig, &hits_cone, 0.3),
    })
}

fn main() {
    println!("{}", told());
}

/// The vehicle's numbers and all cases.
pub fn told() -> Value {
    let (vehicle, body) = (hummingbird(), airless());
    let hull = Hull::of(&Airframe::new(body));
    let rig = rig(scenes::reference::RIG_SLIDING).rig.expect("a rig");
    let rotor = |rotor: &Rotor| json!({ "position": rotor.position_m.as_slice(), "spin": rotor.spin });
    let rotors: Vec<_> = vehicle.rotors.iter().map(rotor).collect();
    let MotorModel::SecondOrder { natural_frequency_rad_s, damping_ratio } = vehicle.motor else {
        panic!("the Hummingbird's motors are of second order")
    };
    let commands: Vec<Vec<[f64; 4]>> = [GENTLE_RAD_S, HARD_RAD_S]
        .map(|swing| (0..10_000).map(|tick| chirp(&vehicle, swing, f64::from(tick) * TICK_S)).collect())
        .into();
    let speeds = |commands: &Vec<[f64; 4]>| -> Vec<[f64; 4]> {
        commands.iter().map(|tick| tick.map(|command| vehicle.command.speed(command))).collect()
    };
    json!({
        "mass": vehicle.mass_kg,
        "gravity": vehicle.gravity_m_s2,
        "inertia": [5.6e-3, 5.6e-3, 8.1e-3],
        "uneven inertia": [5.6e-3, 7.0e-3, 8.1e-3],
        "thrust coefficient": vehicle.thrust_coefficient,
        "torque coefficient": vehicle.torque_coefficient,
        "rotor inertia": vehicle.rotor_inertia_kg_m2,
        "natural frequency": natural_frequency_rad_s,
        "damping ratio": damping_ratio,
        "plain time constant": 0.05,
        "rotors": rotors,
        "feet": hull.feet_B_m.map(|foot| foot.as_slice().to_vec()),
        "foot radius": hull.foot_radius_m,
        "disc": { "radius": hull.disc_radius_m, "half": hull.disc_half_m },
        "stand": hull.stand_m(),
        "rig": { "mount": rig.mount_B_m.z, "mass": rig.moving_mass_kg, "heave": rig.heave_m, "tilt": rig.tilt_max_rad, "bearing": rig.bearing_W_m.z },
        "chain": CHAIN.map(|(name, centre, size, mass_kg, kind, anchor)| {
            json!({ "name": name, "centre": centre, "size": size, "mass": mass_kg, "kind": kind, "anchor": anchor })
        }),
        "chain axis": CHAIN_AXIS,
        "chain drives": CHAIN_DRIVES.map(|(name, drive)| {
            let limit = drive.limit.is_finite().then_some(drive.limit);
            json!({ "name": name, "target": drive.target, "stiffness": drive.stiffness, "damping": drive.damping, "limit": limit })
        }),
        "targets": speeds(&commands[0]),
        "hard targets": speeds(&commands[1]),
        "cases": cases(),
    })
}
