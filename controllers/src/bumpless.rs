//! Bumpless transfer (K. J. Åström and T. Hägglund, "Advanced PID Control", section 3.5): a law goes on after another
//! without a jump of the demanded wrench.
//!
//! A law finds its own state as it left it. From another law's state it takes the integrators, which mean the
//! same to all laws, and sets the rest by the measurement. The part of the last wrench that the backup does not
//! ask for is added to its demand and fades out (`TIME_CONSTANT_S`).

use crate::allocation::RotorWrench;
use crate::control::{ControlOutput, within};
use crate::controller_state::{ControllerState, LawId};
use crate::law::{Law, Predecessor};
use nalgebra::Vector3;
use vehicles::Vehicle;

/// Time constant with which the part of a predecessor's wrench fades that its backup does not ask for, s.
/// Tuned, no source: about that of the Hummingbird's motors, which would smooth a jump likewise.
const TIME_CONSTANT_S: f64 = 0.1;

/// The most of a predecessor's acceleration that fades, m/s². Tuned, no source: a greater one is a fault that
/// is not to be prolonged.
const ACCELERATION_MAX_M_S2: f64 = 3.0;

/// The same of its angular acceleration, rad/s². Tuned, no source.
const ACCELERATION_MAX_RAD_S2: f64 = 10.0;

/// The transfer to one law on one vehicle.
///
/// ```
/// use component::messages::{SetPoint, StateEstimate};
/// use controllers::airframe::ControlledVehicle;
/// use controllers::{bumpless::BumplessTransfer, controller_state::ControllerState};
/// use controllers::{law_inputs::SetPointInputs, pid::PidLaw, pid_gains::PidGains};
///
/// let vehicle = vehicles::Vehicle::parse(vehicles::reference::HUMMINGBIRD, "hummingbird.toml").unwrap();
/// let craft = ControlledVehicle::new(vehicle).unwrap();
/// let law = PidLaw { gains: PidGains::default(), vehicle: craft.hover_model(), period_s: 1e-3 };
/// let mut state = ControllerState::default();
/// let transfer = BumplessTransfer::to::<PidLaw>(&craft.vehicle, 1e-3);
/// let (set_point, estimate) = (SetPoint::default(), StateEstimate::default());
/// let inputs = SetPointInputs { set_point: &set_point, estimate: &estimate, attitude: None };
/// let asked = transfer.step(&law, &mut state, &inputs, None).wrench;
/// assert_eq!(state.thrust, asked.thrust_N, "what was asked for is there for the next law");
/// ```
#[derive(Debug, Clone, Copy)]
pub struct BumplessTransfer {
    id: LawId,
    thrust_max_N: f64,
    torque_max_N_m: Vector3<f64>,
    /// Factor by which a residual shrinks in one period.
    fade: f64,
}

impl BumplessTransfer {
    /// The transfer to an `L` that is stepped every `period_s` on `vehicle`.
    #[must_use]
    pub fn to<L: Law>(vehicle: &Vehicle, period_s: f64) -> Self {
        Self {
            id: LawId::of::<L>(),
            thrust_max_N: vehicle.mass_kg * ACCELERATION_MAX_M_S2,
            torque_max_N_m: vehicle.inertia_kg_m2.diagonal() * ACCELERATION_MAX_RAD_S2,
            fade: libm::exp(-period_s / TIME_CONSTANT_S),
        }
    }

    /// One step of `law`, the one that this transfer was made for: takes over where another law flew before,
    /// asks for a wrench, and remembers it. `last_wrench` is that of the predecessor's last command, where no
    /// state was transferred.
    pub fn step<L: Law>(
        &self,
        law: &L,
        state: &mut ControllerState,
        inputs: &L::Inputs<'_>,
        last_wrench: Option<RotorWrench>,
    ) -> ControlOutput {
        self.take_over(law, state, inputs, last_wrench);
        let last = state.wrench();
        let mut output = law.step(state.words_mut(), &last, inputs);
        output.wrench = self.with_residual(state, &output.wrench);
        state.id = self.id;
        state.integrals = output.integrals;
        state.set_wrench(&output.wrench);
        output
    }

    /// Continues from the wrench of another law, if this is the first tick after that law flew.
    fn take_over<L: Law>(
        &self,
        law: &L,
        state: &mut ControllerState,
        inputs: &L::Inputs<'_>,
        last_wrench: Option<RotorWrench>,
    ) {
        let is_anothers = !state.is_new() && state.id != self.id;
        if let Some(wrench) = last_wrench.or_else(|| is_anothers.then(|| state.wrench())) {
            let from = Predecessor {
                wrench,
                integrals: (!state.is_new()).then_some(state.integrals),
                state: (state.id.layout() == self.id.layout()).then(|| state.words()),
            };
            let (mut begun, last) = (law.start(Some(&from), inputs), law.last_wrench(Some(&wrench)));
            *state = ControllerState::default();
            *state.words_mut() = begun;
            state.set_wrench(&last);
            let asked = law.step(&mut begun, &last, inputs).wrench;
            self.keep_residual(state, &wrench, &asked);
        } else if state.is_new() {
            *state.words_mut() = law.start(None, inputs);
            state.set_wrench(&law.last_wrench(None));
        }
    }

    /// Notes the part of `wrench` that the law does not ask for itself, within the limits of a sane law.
    fn keep_residual(&self, state: &mut ControllerState, wrench: &RotorWrench, asked: &RotorWrench) {
        let missing_B_N_m = wrench.torque_B_N_m - asked.torque_B_N_m;
        state.residual_thrust = within(wrench.thrust_N - asked.thrust_N, self.thrust_max_N);
        state.residual_torque =
            std::array::from_fn(|axis| within(missing_B_N_m[axis], self.torque_max_N_m[axis]));
    }

    /// `asked` with the residual of the predecessor's wrench, which fades by one period.
    fn with_residual(&self, state: &mut ControllerState, asked: &RotorWrench) -> RotorWrench {
        let wrench = RotorWrench {
            thrust_N: asked.thrust_N + state.residual_thrust,
            torque_B_N_m: asked.torque_B_N_m + Vector3::from(state.residual_torque),
        };
        state.residual_thrust *= self.fade;
        state.residual_torque = state.residual_torque.map(|torque_N_m| torque_N_m * self.fade);
        wrench
    }
}
