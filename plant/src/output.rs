//! Outputs of a plant.

use crate::backend::Backend;
use crate::state::RigidBody;
use component::OutputPorts;
use component::context::StepContext;
use component::messages::{
    Actuators, Battery, BodyStates, BodyTransform, Contact, FrameName, Odometry, Orientation, PlantState,
    Point, Pose, PoseStamped, Quaternion,
};
use component::ports::OutputNumber;
use nalgebra::{UnitQuaternion, Vector3};
use vehicles::CommandMap;

/// The outputs of a plant.
#[derive(Debug, OutputPorts)]
pub struct Outputs {
    /// The truth.
    pub state: PlantState,
    /// The pose, for 3-D views.
    pub pose: Option<PoseStamped>,
    /// The transform of the body, for 3-D views.
    pub tf: Option<BodyTransform>,
    /// Pose in the world and velocity in the frame of the body, as `nav_msgs/Odometry`.
    pub odometry: Option<Odometry>,
    /// The motors' command from 0 to 1, as `actuator_msgs/Actuators`.
    pub actuators: Option<Actuators>,
    /// Contacts of the vehicle; with the backend `rapier`.
    pub contact: Option<Contact>,
    /// The scene's free bodies; with the backend `rapier`.
    pub bodies: Option<BodyStates>,
    /// The battery, where an effect models it.
    pub battery: Option<Battery>,
}

const ODOMETRY: OutputNumber = OutputNumber::of::<Outputs>("odometry");
const ACTUATORS: OutputNumber = OutputNumber::of::<Outputs>("actuators");
const BODIES: OutputNumber = OutputNumber::of::<Outputs>("bodies");

impl Outputs {
    /// The motion of `backend`, at the tick of `context`, of a body with this frame; `actuators` returns the commands that it
    /// has. Large messages are made only if they are sent.
    pub(crate) fn of(
        backend: &dyn Backend,
        frame: &FrameName,
        actuators: impl FnOnce() -> Actuators,
        context: &StepContext<'_>,
    ) -> Self {
        let body = &backend.state().body;
        let (position, orientation) = (point(&body.position_W_m), orientation(&body.attitude_WB));
        Self {
            state: state(backend),
            pose: Some(PoseStamped { pose: Pose { position, orientation }, ..Default::default() }),
            tf: Some(BodyTransform::new(frame, position, orientation)),
            odometry: context.is_due(ODOMETRY).then(|| odometry(body, frame)),
            actuators: context.is_due(ACTUATORS).then(actuators),
            contact: Some(contact(backend)),
            // Without free bodies the port cannot be wired, and is never due.
            bodies: context.is_due(BODIES).then(|| bodies(backend)),
            battery: Some(battery_message(backend, context.time_ns())),
        }
    }
}

/// Raw commands as shares of the range of the motors.
pub(crate) fn actuators(map: &CommandMap, commands: &[f64]) -> Actuators {
    Actuators::new(commands.iter().map(|command| map.share(*command)).collect())
}

/// The twist of `nav_msgs/Odometry` is in the axes of the child frame.
fn odometry(body: &RigidBody, frame: &FrameName) -> Odometry {
    let velocity_B_m_s = body.attitude_WB.inverse_transform_vector(&body.velocity_W_m_s);
    Odometry::new(
        frame,
        point(&body.position_W_m),
        orientation(&body.attitude_WB),
        vector(&velocity_B_m_s),
        vector(&body.angular_velocity_B_rad_s),
    )
}

fn state(backend: &dyn Backend) -> PlantState {
    let state = backend.state();
    let [x, y, z, w] = state.body.attitude_WB.coords.into();
    PlantState {
        position: vector(&state.body.position_W_m),
        velocity: vector(&state.body.velocity_W_m_s),
        attitude: Quaternion { x, y, z, w },
        angular_velocity: vector(&state.body.angular_velocity_B_rad_s),
        specific_force: vector(&backend.accelerations().specific_force_B_m_s2),
        rotor_speed: state.rotors.map(|rotor| rotor.speed_rad_s),
        ..Default::default()
    }
}

/// Without an effect that models the battery nothing is known of it: zeros that are not valid.
fn battery_message(backend: &dyn Backend, measured_ns: u64) -> Battery {
    let truth = backend.battery().map(|battery| Battery {
        voltage: battery.voltage_V,
        current: battery.current_A,
        charge: battery.charge,
        valid: 1,
        ..Default::default()
    });
    Battery { measured_ns, ..truth.unwrap_or_default() }
}

fn contact(backend: &dyn Backend) -> Contact {
    let report = backend.contact();
    Contact {
        force: vector(&report.force_W_N),
        impact_speed: report.impact_speed_m_s,
        count: report.count,
        object: report.object,
        began: report.began,
        crashed: report.crashed.into(),
        ..Default::default()
    }
}

fn bodies(backend: &dyn Backend) -> BodyStates {
    let mut states = BodyStates { count: backend.bodies().len() as u32, ..Default::default() };
    // A scene that was built in code may have more than a sample holds.
    let places = 0..states.object.len();
    for (place, (body, object)) in places.zip(backend.bodies().iter().zip(backend.body_objects())) {
        let [x, y, z, w] = body.attitude_WB.coords.into();
        states.object[place] = *object;
        states.position[place] = vector(&body.position_W_m);
        states.attitude[place] = Quaternion { x, y, z, w };
        states.velocity[place] = vector(&body.velocity_W_m_s);
        states.angular_velocity[place] = vector(&body.angular_velocity_W_rad_s());
    }
    states
}

fn vector(v: &Vector3<f64>) -> component::messages::Vector3 {
    <[f64; 3]>::from(*v).into()
}

fn point(v: &Vector3<f64>) -> Point {
    Point { x: v.x, y: v.y, z: v.z }
}

fn orientation(attitude: &UnitQuaternion<f64>) -> Orientation {
    let [x, y, z, w] = attitude.coords.into();
    Orientation { x, y, z, w }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Airframe, FreeFlight, NewtonEuler};

    fn published(effects: &[&str]) -> Battery {
        let text = vehicles::reference::HUMMINGBIRD;
        let vehicle = vehicles::Vehicle::parse(text, "hummingbird.toml").unwrap();
        let effects = effects.iter().map(|name| crate::effects::find(name).unwrap().nominal()).collect();
        let airframe = Airframe::with_effects(vehicle, effects);
        let effects = airframe.initial_state(0, "plant", 1e-3);
        let body = RigidBody::level_at(Vector3::z());
        let mut plant = FreeFlight::new(NewtonEuler::flying(airframe, 1), body, effects);
        plant.settle_rotors(&[76.5; 4]);
        battery_message(&plant, 7)
    }

    #[test]
    fn odometry_has_the_velocity_in_the_frame_of_the_body() {
        // Heading along the world's y, it flies along the world's x: to its right.
        let body = RigidBody {
            position_W_m: Vector3::new(1.0, 2.0, 3.0),
            velocity_W_m_s: Vector3::new(4.0, 0.0, 0.5),
            attitude_WB: UnitQuaternion::from_euler_angles(0.0, 0.0, std::f64::consts::FRAC_PI_2),
            angular_velocity_B_rad_s: Vector3::new(0.1, 0.2, 0.3),
        };
        let numbers = odometry(&body, &FrameName::new("h1/body").unwrap()).numbers();
        assert_eq!(numbers[..3], [1.0, 2.0, 3.0]);
        let half = std::f64::consts::FRAC_1_SQRT_2;
        for (found, expected) in numbers[3..7].iter().zip([0.0, 0.0, half, half]) {
            assert!((found - expected).abs() < 1e-12, "{numbers:?}");
        }
        for (found, expected) in numbers[43..49].iter().zip([0.0, -4.0, 0.5, 0.1, 0.2, 0.3]) {
            assert!((found - expected).abs() < 1e-12, "{numbers:?}");
        }
        let mut covariances = numbers[7..43].iter().chain(&numbers[49..]);
        assert!(covariances.all(|number| *number == 0.0), "unknown: {numbers:?}");
    }

    #[test]
    fn actuators_are_shares_of_the_commands_range() {
        let vehicle = vehicles::Vehicle::parse(vehicles::reference::HUMMINGBIRD, "hummingbird.toml").unwrap();
        let found = actuators(&vehicle.command, &[0.0, 1.0, 100.5, 765.0]);
        assert_eq!(found.normalized, [0.0, 0.0, 0.5, 1.0]);
    }

    #[test]
    fn a_battery_that_nothing_models_is_not_valid_and_holds_no_numbers() {
        let battery = published(&["wind"]);
        assert_eq!((battery.valid, battery.measured_ns), (0, 7));
        assert_eq!((battery.voltage, battery.current, battery.charge), (0.0, 0.0, 0.0));
        let battery = published(&["battery-sag"]);
        assert_eq!((battery.valid, battery.charge), (1, 0.8));
        assert!(battery.voltage > 10.0 && battery.current > 1.0, "{battery:?}");
    }
}
