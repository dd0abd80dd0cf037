//! Both backends fly the same flight to the last bit, if nothing is touched.
#![allow(non_snake_case, reason = "a trailing _B names the frame a vector is written in")]

use crate::skipped::cases;
use component::messages::PerRotor;
use controllers::airframe::ControlledVehicle;
use controllers::control::{HoverMotion, Integrals};
use controllers::pid::PidLaw;
use controllers::pid_gains::PidGains;
use controllers::set_points::{Schedule, SetPoint, SetPointEntry};
use nalgebra::Vector3;
use plant::{Backend, FreeFlight, NewtonEuler, Rapier, RigidBody, State};
use scenes::Scene;
use vehicles::Vehicle;

const TICK_S: f64 = 1e-3;
const TICKS: u64 = 10_000;

const SCENARIO: &str = r#"
    [[set_points]]
    kind = "step"
    channel = "altitude"
    at_s = 2.0
    to = 1.5
    unit = "m"
    [[set_points]]
    kind = "doublet"
    channel = "roll"
    at_s = 6.0
    amplitude = 10.0
    duration_s = 1.0
    unit = "deg"
"#;

#[derive(serde::Deserialize)]
struct Scenario {
    set_points: Vec<SetPointEntry>,
}

/// The scenario's pilot and controller, which sees the true attitude.
struct Loop {
    schedule: Schedule,
    craft: ControlledVehicle,
    law: PidLaw,
    integrals: Integrals,
}

fn vehicle() -> Vehicle {
    Vehicle::parse(vehicles::reference::HUMMINGBIRD, "hummingbird.toml").unwrap()
}

impl Loop {
    fn new() -> Self {
        let scenario = toml::from_str::<Scenario>(SCENARIO).unwrap();
        let initial = SetPoint { altitude_m: 1.0, ..SetPoint::default() };
        let craft = ControlledVehicle::new(vehicle()).unwrap();
        Self {
            schedule: Schedule::new(&scenario.set_points, &initial, 1000).unwrap(),
            law: PidLaw { gains: PidGains::default(), vehicle: craft.hover_model(), period_s: TICK_S },
            integrals: Integrals::default(),
            craft,
        }
    }

    fn commands(&mut self, tick: u64, body: &RigidBody) -> PerRotor {
        let (roll_rad, pitch_rad, yaw_rad) = body.attitude_WB.euler_angles();
        let measured = HoverMotion {
            altitude_m: body.position_W_m.z,
            climb_rate_m_s: body.velocity_W_m_s.z,
            roll_rad,
            pitch_rad,
            yaw_rad,
            angular_velocity_B_rad_s: body.angular_velocity_B_rad_s,
        };
        let wrench = self.law.wrench(&mut self.integrals, &self.schedule.at(tick), &measured);
        let speeds_rad_s = self.craft.allocation.allocate(&wrench).speeds_rad_s;
        speeds_rad_s.map(|speed| self.craft.vehicle.command.command(speed))
    }
}

fn start(plant: &mut dyn Backend) {
    plant.settle_rotors(&[vehicle().hover_command(); 4]);
}

fn free_flight() -> Box<dyn Backend> {
    let model = NewtonEuler::new(vehicle(), 2);
    let memory = model.airframe().initial_state(0, "plant", TICK_S);
    Box::new(FreeFlight::new(model, RigidBody::level_at(Vector3::z()), memory))
}

fn rapier(scene: &Scene) -> Box<dyn Backend> {
    let model = NewtonEuler::new(vehicle(), 2);
    let memory = model.airframe().initial_state(0, "plant", TICK_S);
    Box::new(Rapier::new(model, memory, scene, &RigidBody::level_at(Vector3::z()), 1.0))
}

/// The states of a flight in closed loop, and the commands.
fn flown(mut plant: Box<dyn Backend>) -> Vec<(State, PerRotor)> {
    let mut pilot = Loop::new();
    start(&mut *plant);
    let mut flight = Vec::new();
    for tick in 0..TICKS {
        let commands = pilot.commands(tick, &plant.state().body);
        flight.push((*plant.state(), commands));
        plant.step(&commands, TICK_S, &[]);
    }
    flight.push((*plant.state(), [0.0; 4].into()));
    flight
}

/// The open ground, a room, and a labyrinth, in which the vehicle is among the walls of one mesh; and for how many
/// ticks of the hover and doublet it meets nothing there.
fn scenes() -> [(Scene, usize); 3] {
    let load = |name: &str| {
        let path = format!("{}/../scenes/{name}", env!("CARGO_MANIFEST_DIR"));
        Scene::load(path.as_ref()).unwrap()
    };
    let all = TICKS as usize + 1;
    [(Scene::default(), all), (load("room.toml"), all), (load("labyrinth.toml"), 6_000)]
}

#[test]
fn the_hover_and_doublet_is_the_same_in_both() {
    let free = flown(free_flight());
    // Quick tests fly in the room, which has the ground as well.
    for (_, (scene, ticks)) in cases("scenes", scenes().into_iter().enumerate(), |(number, _)| *number == 1) {
        let walled = flown(rapier(&scene));
        let first = free.iter().zip(&walled).take(ticks).position(|(a, b)| a != b);
        assert_eq!(first, None, "{}: the first tick in which they differ", scene.name);
    }
}

#[test]
fn so_is_a_tumble() {
    let tumbling = RigidBody {
        velocity_W_m_s: Vector3::new(0.2, -0.1, 9.0),
        angular_velocity_B_rad_s: Vector3::new(6.0, -4.0, 3.0),
        ..RigidBody::level_at(Vector3::z() * 5.0)
    };
    for (scene, _) in scenes() {
        let (mut free, mut walled) = (free_flight(), rapier(&scene));
        for backend in [&mut free, &mut walled] {
            backend.settle_rotors(&[90.0, 60.0, 70.0, 95.0]);
            backend.set_body(&tumbling);
            (0..1_500).for_each(|_| backend.step(&[60.0, 90.0, 95.0, 70.0], TICK_S, &[]));
        }
        assert_eq!(free.state(), walled.state(), "{}", scene.name);
    }
}
