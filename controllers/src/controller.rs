//! A law as a component: its demand allocated to the rotors of a vehicle.

use crate::airframe::ControlledVehicle;
use crate::allocation::{Allocated, RotorWrench};
use crate::bumpless::BumplessTransfer;
use crate::control::ControlOutput;
use crate::controller_state::ControllerState;
use crate::law::{Law, LawContext};
use crate::rehearsal;
use component::context::{NodeContext, StepContext};
use component::messages::{ControlStatus, MotorCommand};
use component::{Component, Info, OutputPorts, StepError};
use diagnostics::ParameterError;
use vehicles::Vehicle;
use vehicles::reference::HUMMINGBIRD;

/// Outputs of every controller.
#[derive(Debug, OutputPorts)]
pub struct Outputs {
    /// To the motors.
    pub command: MotorCommand,
    /// Demand of the law, and the rotors' answer to it.
    pub status: Option<ControlStatus>,
}

/// A law that flies a vehicle.
///
/// ```
/// use component::messages::{SetPoint, StateEstimate};
/// use controllers::controller::Controller;
/// use controllers::law_inputs::SetPointInputs;
/// use controllers::pid::PidLaw;
///
/// let vehicle = concat!(env!("CARGO_MANIFEST_DIR"), "/../vehicles/hummingbird.toml");
/// let parameters = serde_json::json!({ "vehicle": vehicle });
/// let mut pid = component::Harness::<Controller<PidLaw>>::from_json(&parameters).unwrap();
/// let set_point = SetPoint { altitude: 1.0, ..Default::default() };
/// let estimate = StateEstimate { position: [0.0, 0.0, 1.0].into(), ..Default::default() };
/// let inputs = SetPointInputs { set_point: &set_point, estimate: &estimate, attitude: None };
/// let thrust_N = pid.step(inputs).unwrap().status.unwrap().thrust;
/// assert!((thrust_N - 0.48 * 9.81).abs() < 1e-6, "at its set point it carries its weight: {thrust_N} N");
/// ```
#[derive(Debug)]
pub struct Controller<L> {
    law: L,
    craft: ControlledVehicle,
    transfer: BumplessTransfer,
}

impl<L: Law> Component for Controller<L> {
    const INFO: Info = L::INFO;
    type Parameters = L::Parameters;
    type Inputs<'a> = L::Inputs<'a>;
    type Outputs = Outputs;
    type State = ControllerState;

    fn new(parameters: L::Parameters, context: &NodeContext<'_>) -> Result<Self, ParameterError> {
        let craft = ControlledVehicle::load(&context.files, L::vehicle(&parameters))
            .map_err(|fault| fault.and(faults_of_files::<L>(&parameters, context)))?;
        let law = L::new(&parameters, &LawContext { craft: &craft, node: context })?;
        let transfer = BumplessTransfer::to::<L>(&craft.vehicle, context.period_s());
        Ok(Self { law, craft, transfer })
    }

    fn rehearse(self, context: &NodeContext<'_>) -> Result<(), ParameterError> {
        rehearsal::check(&self.law, &self.craft, context)
    }

    fn initial(&self) -> ControllerState {
        ControllerState::default()
    }

    fn step(
        &self,
        context: &StepContext<'_>,
        inputs: L::Inputs<'_>,
        state: &mut ControllerState,
    ) -> Result<Outputs, StepError> {
        let last_wrench = context.predecessor().map(|last| self.made_by(&last));
        let output = self.transfer.step(&self.law, state, &inputs, last_wrench);
        if let Some(what) = output.not_finite() {
            // The allocation and the command map would make a command of it all the same.
            return Err(format!("the law asks for {what}: its output `command` is not sent").into());
        }
        let allocated = self.craft.allocation.allocate(&output.wrench);
        let command = allocated.speeds_rad_s.map(|speed| self.craft.vehicle.command.command(speed));
        Ok(Outputs {
            command: MotorCommand { command, ..Default::default() },
            status: Some(report(&output, &allocated)),
        })
    }
}

/// Faults of the files that `parameters` name beside a vehicle file that is refused: the law is made for another vehicle.
fn faults_of_files<L: Law>(parameters: &L::Parameters, context: &NodeContext<'_>) -> Vec<ParameterError> {
    let vehicle = Vehicle::parse(HUMMINGBIRD, "hummingbird.toml").ok();
    let Some(craft) = vehicle.and_then(|vehicle| ControlledVehicle::new(vehicle).ok()) else {
        return Vec::new();
    };
    // Its warnings are about that vehicle.
    let node = context.clone();
    let made = L::new(parameters, &LawContext { craft: &craft, node: &node });
    let errors = made.err().map_or(Vec::new(), ParameterError::into_each);
    errors.into_iter().filter(|error| matches!(error, ParameterError::File { .. })).collect()
}

impl<L> Controller<L> {
    /// The wrench that rotors make of a command.
    fn made_by(&self, sent: &Outputs) -> RotorWrench {
        let speeds_rad_s = sent.command.command.map(|command| self.craft.vehicle.command.speed(command));
        self.craft.allocation.wrench(&speeds_rad_s)
    }
}

fn report(output: &ControlOutput, allocated: &Allocated) -> ControlStatus {
    let asked = &output.set_point;
    ControlStatus {
        altitude_set_point: asked.altitude_m,
        attitude_set_point: [asked.roll_rad, asked.pitch_rad, asked.yaw_rad],
        velocity_set_point: output.velocity_m_s,
        thrust: output.wrench.thrust_N,
        torque: <[f64; 3]>::from(output.wrench.torque_B_N_m).into(),
        thrust_error: allocated.thrust_error_N,
        roll_pitch_part: allocated.roll_pitch_part,
        yaw_part: allocated.yaw_part,
        saturated: u32::from(allocated.is_saturated()),
        state: output.phase,
        laps: output.laps,
        ..Default::default()
    }
}
