//! The plant: steps the vehicle from tick to tick under the motor command of the tick before.
//!
//! At tick k it moves the state from k − 1 to k under the command stamped k − 1, then publishes it. With a
//! `measured` input it is set to the measured state at the start of each window, after publishing: what it
//! publishes at that tick is the end of the window before.

use crate::airworthy;
use crate::backend::Backend;
use crate::others::Others;
use crate::output::Outputs;
use crate::parameters::Parameters;
use crate::state::RigidBody;
use bus::InputPorts;
use bus::component::{Component, Info, Internal, StepError};
use bus::context::{NodeContext, StepContext};
use bus::messages::{MeasuredState, MotorCommand, Traffic};
use diagnostics::ParameterError;
use nalgebra::{UnitQuaternion, Vector3};
use vehicles::Vehicle;

/// What the plant reads.
#[derive(Debug, InputPorts)]
pub struct Inputs<'a> {
    /// The motors' command.
    pub command: &'a MotorCommand,
    /// A measured flight, to whose state the vehicle is set at the start of each window.
    pub measured: Option<&'a MeasuredState>,
    /// The vehicles that share the room, this one among them.
    pub traffic: Option<&'a Traffic>,
}

/// The plant: its vehicle, and what moves it.
///
/// ```
/// use bus::messages::MotorCommand;
/// use plant::node::{Inputs, Plant};
///
/// let vehicle = concat!(env!("CARGO_MANIFEST_DIR"), "/../vehicles/hummingbird.toml");
/// let parameters = serde_json::json!({ "vehicle": vehicle, "initial_position_m": [0.0, 0.0, 1.0] });
/// let mut plant = bus::Harness::<Plant>::from_json(&parameters).unwrap();
/// let command = MotorCommand::default();
/// let inputs = || Inputs { command: &command, measured: None, traffic: None };
/// let state = (0..=100).map(|_| plant.step(inputs()).unwrap().state).last().unwrap();
/// assert!(state.position.z < 1.0 && state.velocity.z < 0.0, "with its rotors off it falls: {state:?}");
/// ```
pub struct Plant {
    vehicle: Vehicle,
    substeps: u32,
    backend: Box<dyn Backend>,
    /// Ticks between two settings to what is measured.
    window_ticks: u32,
    dt_s: f64,
    others: Others,
}

impl Component for Plant {
    const INFO: Info = Info::new("plant", "flies the vehicle of a vehicle file, freely or in a scene");
    type Parameters = Parameters;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = Internal;

    fn new(parameters: Parameters, context: &NodeContext<'_>) -> Result<Self, ParameterError> {
        let (dt_s, substeps) = (context.tick_s(), parameters.substeps);
        let (vehicle, backend) = parameters.backend(context)?;
        let window_ticks = parameters.window_ticks(dt_s)?;
        Ok(Self { vehicle, substeps, backend, window_ticks, dt_s, others: Others::new() })
    }

    fn rehearse(mut self, _: &NodeContext<'_>) -> Result<(), ParameterError> {
        airworthy::rehearse(&mut *self.backend, &self.vehicle, self.substeps, self.dt_s)
    }

    fn initial(&self) -> Internal {
        Internal
    }

    fn step(
        &mut self,
        context: &StepContext<'_>,
        inputs: Inputs<'_>,
        _: &mut Internal,
    ) -> Result<Outputs, StepError> {
        let measured = inputs.measured.filter(|_| context.tick().is_multiple_of(self.window_ticks));
        if context.tick() > 0 {
            self.fly(context, &inputs)?;
        } else {
            // The input's initial value: the rotors turn steadily at it when the run starts.
            self.backend.settle_rotors(&inputs.command.command);
            self.set_body(measured);
        }
        if let Some(number) = self.backend.bodies().iter().position(|body| !body.is_finite()) {
            return Err(format!(
                "the motion of the scene's free body {number}, counted from 0, is no number; look at the masses, speeds and \
                 joints of the scene, or raise `substeps`"
            )
            .into());
        }
        if let Some(trouble) = self.backend.trouble() {
            return Err(trouble.into());
        }
        let outputs = Outputs::of(&*self.backend, context.time_ns());
        self.set_body(measured);
        Ok(outputs)
    }
}

impl Plant {
    /// Moves the vehicle by the tick that ends now.
    fn fly(&mut self, context: &StepContext<'_>, inputs: &Inputs<'_>) -> Result<(), StepError> {
        let number = u64::from(context.tick());
        let before_ns = context.time_ns() / number * (number - 1);
        let position_W_m = self.backend.state().body.position_W_m;
        let seen =
            inputs.traffic.map(|traffic| self.others.seen(traffic, &position_W_m, before_ns)).transpose()?;
        self.backend.step(&inputs.command.command, self.dt_s, seen.unwrap_or_default());
        Ok(())
    }

    fn set_body(&mut self, measured: Option<&MeasuredState>) {
        if let Some(measured) = measured {
            self.backend.set_body(&body(measured));
        }
    }
}

fn body(measured: &MeasuredState) -> RigidBody {
    let vector = |v| Vector3::from(<[f64; 3]>::from(v));
    let q = measured.attitude;
    RigidBody {
        position_W_m: vector(measured.position),
        velocity_W_m_s: vector(measured.velocity),
        attitude_WB: UnitQuaternion::new_normalize(nalgebra::Quaternion::new(q.w, q.x, q.y, q.z)),
        angular_velocity_B_rad_s: vector(measured.angular_velocity),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bus::Registration;
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
