//! Definition of a control law: its making, inputs and state, its start, also after another law, and its step.

use crate::airframe::ControlledVehicle;
use crate::allocation::RotorWrench;
use crate::control::{ControlOutput, Integrals};
use component::context::NodeContext;
use component::ports::InputPorts;
use component::{Info, Message};
use diagnostics::ParameterError;
use std::path::{Path, PathBuf};

/// A control law at one period, with everything that does not change during a run.
///
/// [`crate::controller::Controller`] makes a component of it.
pub trait Law: Sized + Send {
    /// Its name in manifests, and its description.
    const INFO: Info;
    /// Parameters, as the manifest's `parameters` table holds them.
    type Parameters: component::Parameters;
    /// Inputs: ports of the law alone, `Option` for those that need not be wired. [`crate::law_inputs`] has some.
    type Inputs<'a>: InputPorts<'a>;
    /// State between ticks.
    type State: Message;

    /// The vehicle file that `parameters` name.
    fn vehicle(parameters: &Self::Parameters) -> &Path;

    /// Makes the law.
    ///
    /// # Errors
    /// An invalid parameter or file.
    fn new(parameters: &Self::Parameters, context: &LawContext<'_>) -> Result<Self, ParameterError>;

    /// The greatest angular acceleration that it asks for against a body rate, 1/s: with the period it shows whether
    /// the loop can be closed at all. 0 where the law is made for its period.
    fn rate_gain_1_s(&self) -> f64 {
        0.0
    }

    /// Returns its first state: before the first tick of a run, or after another law, `from`. It need not ask for the
    /// other's last wrench, since [`crate::bumpless::BumplessTransfer`] makes up for the rest. An integrator
    /// should not take that up: it would keep amid a manoeuvre a wrench that is gone a moment later.
    fn start(&self, from: Option<&Predecessor<'_, Self::State>>, inputs: &Self::Inputs<'_>) -> Self::State;

    /// The wrench that the rotors are taken to have been asked for one period before it begins, where another law asked
    /// for `before`.
    fn last_wrench(&self, before: Option<&RotorWrench>) -> RotorWrench {
        before.copied().unwrap_or_default()
    }

    /// The demand now; advances the state by one period. `last` was asked for one period ago.
    fn step(&self, state: &mut Self::State, last: &RotorWrench, inputs: &Self::Inputs<'_>) -> ControlOutput;
}

/// The law that flew before, as far as it is known.
#[derive(Debug, Clone, Copy)]
pub struct Predecessor<'a, S> {
    /// The wrench that it asked for last. It may be a broken law, and the wrench may be NaN.
    pub wrench: RotorWrench,
    /// Outputs of its integrators; `None` where only its last command is known.
    pub integrals: Option<Integrals>,
    /// Its state, where that is of the same type as that of the law that takes over.
    pub state: Option<&'a S>,
}

/// Vehicle and node that a law is made for.
#[derive(Debug, Clone, Copy)]
pub struct LawContext<'a> {
    /// The vehicle that it flies.
    pub craft: &'a ControlledVehicle,
    /// Its node in the run.
    pub node: &'a NodeContext<'a>,
}

/// Parameters of a law that has no others.
#[derive(Debug, component::Parameters)]
pub struct FileParameters {
    /// Vehicle file, relative to the manifest.
    #[parameter(file = vehicles::FILE)]
    pub vehicle: PathBuf,
    /// Gains file, relative to the manifest.
    #[parameter(shown = "the built-in gains", file = crate::gains_file::FILE)]
    pub gains: Option<PathBuf>,
}
