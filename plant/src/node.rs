//! The plant: steps the vehicle from tick to tick under the motor command of the tick before.
//!
//! At tick k it moves the state from k − 1 to k under the command stamped k − 1, then publishes it. With a
//! `measured` input it is set to the measured state at the start of each window, after publishing: the state that it
//! publishes at that tick is the end of the window before.

use crate::airworthy;
use crate::memory::PlantMemory;
use crate::origin::Origin;
use crate::others::OthersError;
use crate::output::{Outputs, actuators};
use crate::parameters::{Parameters, unequal};
use crate::state::RigidBody;
use component::context::{NodeContext, StepContext};
use component::messages::{
    self, Battery, FRAME_BYTES_MAX, FrameName, MeasuredState, MotorCommand, Traffic, body_frame,
};
use component::{Component, Info, InputPorts, StepError};
use diagnostics::ParameterError;
use nalgebra::{UnitQuaternion, Vector3};

/// Inputs of the plant.
#[derive(Debug, InputPorts)]
pub struct Inputs<'a> {
    /// The motors' command.
    pub command: &'a MotorCommand,
    /// A measured flight, to whose state the vehicle is set at the start of each window.
    pub measured: Option<&'a MeasuredState>,
    /// A measured battery, whose voltage the motors follow in place of that of the effect `battery-sag`.
    pub battery: Option<&'a Battery>,
    /// The vehicles that share the room, this one among them.
    pub traffic: Option<&'a Traffic>,
}

/// The plant: its vehicle, and the physics that moves it.
///
/// ```
/// use component::messages::MotorCommand;
/// use plant::node::{Inputs, Plant};
///
/// let vehicle = concat!(env!("CARGO_MANIFEST_DIR"), "/../vehicles/hummingbird.toml");
/// let parameters = serde_json::json!({ "vehicle": vehicle, "initial_position_m": [0.0, 0.0, 1.0] });
/// let mut plant = component::Harness::<Plant>::from_json(&parameters).unwrap();
/// let command = MotorCommand { command: [0.0; 4].into(), ..MotorCommand::default() };
/// let inputs = || Inputs { command: &command, measured: None, battery: None, traffic: None };
/// let state = (0..=100).map(|_| plant.step(inputs()).unwrap().state).last().unwrap();
/// assert!(state.position.z < 1.0 && state.velocity.z < 0.0, "with its rotors off it falls: {state:?}");
/// ```
pub struct Plant {
    origin: Origin,
    /// The frame of the vehicle's body.
    frame: FrameName,
    /// Ticks between two settings to the measured state.
    window_ticks: u32,
    dt_s: f64,
}

/// A plant that took over from the last sample alone would lose bodies, contacts, gusts and charge.
const NO_STATE: &str = "it cannot take over from a plant of another backend, another scene or other effects: the state of one does not \
                        fit the other; give both the same, other numbers of vehicle and effects may differ";

impl Component for Plant {
    const INFO: Info = Info::new("plant", "flies the vehicle of a vehicle file, freely or in a scene")
        .needing_state(NO_STATE);
    type Parameters = Parameters;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = PlantMemory;

    fn new(parameters: Parameters, context: &NodeContext<'_>) -> Result<Self, ParameterError> {
        let dt_s = context.tick_s();
        let names_and_ticks = ParameterError::both(frame_of(context.name), parameters.window_ticks(dt_s));
        let made = ParameterError::both(parameters.origin(context), names_and_ticks)?;
        let (origin, (frame, window_ticks)) = made;
        Ok(Self { origin, frame, window_ticks, dt_s })
    }

    fn rehearse(self, _: &NodeContext<'_>) -> Result<(), ParameterError> {
        airworthy::rehearse(&mut *self.origin.begin(), &self.origin.model, self.dt_s)
    }

    fn initial(&self) -> PlantMemory {
        PlantMemory::new(self.origin.begin())
    }

    fn step(
        &self,
        context: &StepContext<'_>,
        inputs: Inputs<'_>,
        memory: &mut PlantMemory,
    ) -> Result<Outputs, StepError> {
        let measured = inputs.measured.filter(|_| context.tick().is_multiple_of(self.window_ticks));
        if context.predecessor::<Outputs>().is_some() {
            return Err(NO_STATE.into());
        }
        self.require_count(&inputs.command.command)?;
        if context.tick() > 0 {
            self.fly(context, &inputs, memory)?;
        } else {
            // The input's initial value: the rotors turn steadily at it when the run starts.
            memory.backend.settle_rotors(&inputs.command.command);
            set_body(memory, measured);
        }
        if let Some(number) = memory.backend.bodies().iter().position(|body| !body.is_finite()) {
            return Err(format!(
                "the motion of the scene's free body {number}, counted from 0, is no number; look at the masses, speeds and \
                 joints of the scene, or raise `substeps`"
            )
            .into());
        }
        if let Some(trouble) = memory.backend.trouble() {
            return Err(trouble.into());
        }
        let map = self.origin.model.airframe().declared_command();
        let actuators = || actuators(map, &inputs.command.command);
        let outputs = Outputs::of(&*memory.backend, &self.frame, actuators, context);
        set_body(memory, measured);
        Ok(outputs)
    }

    fn remark(&self, memory: &PlantMemory) -> Option<String> {
        memory.backend.remark()
    }
}

impl Plant {
    /// Refuses a command that does not have one number for each rotor.
    fn require_count(&self, commands: &[f64]) -> Result<(), StepError> {
        let vehicle = self.origin.model.vehicle();
        match commands.len() {
            found if found == vehicle.rotors.len() => Ok(()),
            found => Err(unequal(vehicle, "its input", found).into()),
        }
    }

    /// Moves the vehicle by the tick that ends now.
    fn fly(
        &self,
        context: &StepContext<'_>,
        inputs: &Inputs<'_>,
        memory: &mut PlantMemory,
    ) -> Result<(), StepError> {
        let PlantMemory { backend, others } = memory;
        let number = u64::from(context.tick());
        let before_ns = context.time_ns() / number * (number - 1);
        let position_W_m = backend.state().body.position_W_m;
        let seen = inputs.traffic.map(|traffic| others.seen(traffic, &position_W_m, before_ns));
        let seen = match seen.transpose() {
            // A shadow that cannot load the state of its predecessor is elsewhere; it never takes over.
            Err(OthersError::Absent { .. }) if number > 1 => None,
            seen => seen?,
        };
        let measured = inputs.battery.filter(|battery| battery.valid == 1 && battery.voltage > 0.0);
        backend.set_measured_voltage(measured.map(|battery| battery.voltage));
        backend.step(&inputs.command.command, self.dt_s, seen.unwrap_or_default());
        Ok(())
    }
}

/// The frame of the vehicle that the node `name` flies. The vehicle has the node's name, without the process's own `plant`: no
/// two nodes of a run have the same frame.
fn frame_of(name: &str) -> Result<FrameName, ParameterError> {
    let vehicle = match name {
        "plant" => "",
        name => name.strip_suffix("/plant").unwrap_or(name),
    };
    let frame = body_frame(vehicle);
    FrameName::new(&frame).ok_or_else(|| {
        let most = FRAME_BYTES_MAX - 1;
        let length = frame.len();
        ParameterError::conflict(
            "",
            format!(
                "the frame of the vehicle's body would be `{frame}`, of {length} characters, expected at most {most}; give the \
                 vehicle a shorter name"
            ),
        )
    })
}

fn set_body(memory: &mut PlantMemory, measured: Option<&MeasuredState>) {
    if let Some(MeasuredState { position, velocity, attitude, angular_velocity, .. }) = measured {
        memory.backend.set_body(&body([*position, *velocity, *angular_velocity], *attitude));
    }
}

/// A body with this position, velocity and angular velocity.
fn body(vectors: [messages::Vector3; 3], q: messages::Quaternion) -> RigidBody {
    let [position_W_m, velocity_W_m_s, angular_velocity_B_rad_s] =
        vectors.map(|v| Vector3::from(<[f64; 3]>::from(v)));
    let attitude_WB = UnitQuaternion::new_normalize(nalgebra::Quaternion::new(q.w, q.x, q.y, q.z));
    RigidBody { position_W_m, velocity_W_m_s, attitude_WB, angular_velocity_B_rad_s }
}

#[cfg(test)]
mod tests {
    use super::*;
    use component::Registration;
    use component::context::InputMessage;
    use serde_json::{Value, json};

    fn repository(file: &str) -> String {
        format!("{}/../{file}", env!("CARGO_MANIFEST_DIR"))
    }

    fn checked(scene: &str, more: Value, ports: &[&str]) -> Result<(), ParameterError> {
        let mut parameters = json!({
            "vehicle": repository("vehicles/hummingbird.toml"),
            "scene": repository(scene),
            "backend": "rapier",
        });
        parameters.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        Registration::of::<Plant>().check(&parameters, &NodeContext::new("plant", ports))
    }

    #[test]
    fn a_start_inside_of_a_box_is_refused_and_names_both() {
        let start = |x: f64| checked("scenes/room.toml", json!({ "initial_position_m": [x, 0.0, 1.0] }), &[]);
        // The hull reaches 0.2716 m; the wall stands at 5 m.
        assert_eq!(start(4.7), Ok(()));
        for x in [4.8, 5.05, 5.3] {
            let error = start(x).unwrap_err().to_string();
            assert!(error.contains("`initial_position_m`") && error.contains("\"wall +x\""), "{error}");
        }
        let measured = json!({ "initial_position_m": [5.05, 0.0, 1.0], "window_s": 0.1 });
        assert_eq!(checked("scenes/room.toml", measured, &["measured"]), Ok(()));
    }

    #[test]
    fn a_start_below_the_ground_is_refused_where_there_is_one() {
        let below = json!({ "initial_position_m": [0.0, 0.0, -1.0] });
        let error = checked("scenes/room.toml", below.clone(), &[]).unwrap_err();
        assert_eq!(error.key(), "initial_position_m");
        assert!(error.to_string().contains("-1.0], which is below the ground"), "{error}");
        let measured = json!({ "initial_position_m": [0.0, 0.0, -1.0], "window_s": 0.1 });
        assert_eq!(checked("scenes/room.toml", measured, &["measured"]), Ok(()));
        let mut free = json!({ "vehicle": repository("vehicles/hummingbird.toml") });
        free.as_object_mut().unwrap().extend(below.as_object().unwrap().clone());
        let check = |parameters: &Value| {
            Registration::of::<Plant>().check(parameters, &NodeContext::new("plant", &[]))
        };
        assert_eq!(check(&free), Ok(()), "there is no ground");
        free["scene"] = repository("scenes/room.toml").into();
        assert!(check(&free).unwrap_err().to_string().contains("below the ground"));
    }

    #[test]
    fn an_initial_command_beyond_the_range_of_the_motors_is_told() {
        let warned = |vehicle: &str, command: f64| {
            let initial = json!({ "command": [command, command, command, command] });
            let message =
                InputMessage { port: "command", bytes: 112, period_ticks: 1.0, initial: Some(&initial) };
            let messages = [message];
            let context = NodeContext::new("plant", &["command"]).reading(&messages);
            let parameters = json!({ "vehicle": repository(vehicle) });
            Registration::of::<Plant>().check(&parameters, &context).unwrap();
            let warnings = context.into_warnings();
            warnings
                .into_iter()
                .filter(|warning| warning.key == "inputs.command")
                .map(|warning| warning.message)
                .collect::<Vec<_>>()
        };
        for (command, end) in [(765.0, 200.0), (-5.0, 1.0), (0.0, 1.0)] {
            let told = warned("vehicles/hummingbird.toml", command).concat();
            assert!(told.contains(&format!("has {command} for rotor 0")), "{told}");
            assert!(
                told.contains("expected 1 to 200") && told.contains(&format!("takes it as {end}")),
                "{told}"
            );
        }
        assert!(warned("vehicles/hummingbird.toml", 1.0).is_empty());
        assert!(warned("vehicles/hummingbird.toml", 200.0).is_empty());
    }

    #[test]
    fn each_vehicle_has_a_frame_of_its_own() {
        let frame = |name: &str| frame_of(name).map(|frame| frame.as_str().to_owned());
        for (name, expected) in [
            ("plant", "hb_body"),
            ("h1/plant", "h1/body"),
            ("h10/plant", "h10/body"),
            ("left", "left/body"),
            ("h1/second", "h1/second/body"),
        ] {
            assert_eq!(frame(name).as_deref(), Ok(expected));
        }
        let longest = "h".repeat(58);
        assert_eq!(frame(&format!("{longest}/plant")), Ok(format!("{longest}/body")));
        let error = frame(&format!("{longest}h/plant")).unwrap_err().to_string();
        assert!(error.contains("of 64 characters, expected at most 63"), "{error}");
    }

    #[test]
    fn a_command_without_a_number_for_each_rotor_is_refused() {
        let parameters = json!({ "vehicle": repository("vehicles/hummingbird.toml") });
        let step = |command: &[f64]| {
            let command = MotorCommand { command: command.iter().copied().collect(), ..Default::default() };
            let inputs = Inputs { command: &command, measured: None, battery: None, traffic: None };
            let mut plant = component::Harness::<Plant>::from_json(&parameters).unwrap();
            plant.step(inputs).map(|outputs| outputs.state.rotor_speed.len())
        };
        assert_eq!(step(&[76.5; 4]).unwrap(), 4);
        for count in [0, 3, 6, 12] {
            let error = step(&[76.5; 12][..count]).unwrap_err().to_string();
            assert!(error.contains(&format!("`command` has {count} motor commands, expected 4")), "{error}");
        }
        let initial = |value: &Value| {
            let message =
                InputMessage { port: "command", bytes: 112, period_ticks: 1.0, initial: Some(value) };
            let messages = [message];
            let context = NodeContext::new("plant", &["command"]).reading(&messages);
            Registration::of::<Plant>().check(&parameters, &context)
        };
        assert_eq!(initial(&json!({ "command": [76.5, 76.5, 76.5, 76.5] })), Ok(()));
        for (value, count) in [(json!({}), 0), (json!({ "command": [76.5] }), 1)] {
            let error = initial(&value).unwrap_err().to_string();
            assert!(error.contains(&format!("initial value of its input `command` has {count}")), "{error}");
        }
    }

    #[test]
    fn free_bodies_need_rapier_and_a_vehicle_of_their_own() {
        let scene = "scenes/slung-load.toml";
        let at = |x_m: f64| json!({ "initial_position_m": [x_m, 0.0, 0.06] });
        assert_eq!(checked(scene, at(0.0), &["bodies"]), Ok(()));
        for (more, ports, told) in [
            (json!({ "backend": "newton-euler" }), &["command"][..], "free bodies"),
            (json!({}), &["command", "traffic"], "`traffic`"),
        ] {
            let error = checked(scene, more, ports).unwrap_err().to_string();
            assert!(error.contains("`scene`") && error.contains(told), "{error}");
        }
        let error = checked("scenes/ground.toml", json!({}), &["bodies"]).unwrap_err().to_string();
        assert!(error.contains("`bodies`"), "{error}");
        // In front of the drawer, which the vehicle's disc is in.
        let error = checked("scenes/workshop.toml", at(0.25), &[]);
        assert_eq!(error, Ok(()));
        let inside = json!({ "initial_position_m": [0.25, 1.7, 0.1] });
        let error = checked("scenes/workshop.toml", inside, &[]).unwrap_err().to_string();
        assert!(error.contains("the vehicle") && error.contains("\"drawer\""), "{error}");
    }

    #[test]
    fn substeps_have_a_least_and_a_most() {
        let with = |substeps: u32| checked("scenes/ground.toml", json!({ "substeps": substeps }), &[]);
        assert_eq!((with(1), with(1000)), (Ok(()), Ok(())));
        for substeps in [0, 1001, u32::MAX] {
            assert!(with(substeps).unwrap_err().to_string().contains("`substeps`"));
        }
    }

    #[test]
    fn contact_needs_a_backend_that_touches() {
        let free = json!({ "backend": "newton-euler" });
        let error =
            checked("scenes/ground.toml", free.clone(), &["command", "contact"]).unwrap_err().to_string();
        assert!(error.contains("`contact`") && error.contains("`backend`"), "{error}");
        assert_eq!(checked("scenes/ground.toml", free, &["command"]), Ok(()));
        assert_eq!(checked("scenes/ground.toml", json!({}), &["command", "contact"]), Ok(()));
    }
}
