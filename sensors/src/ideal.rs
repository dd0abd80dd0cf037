//! The ideal estimator: hands the truth on as an estimate, without error, noise or delay.
//!
//! The thesis's main script reads the positions and velocities of its simulator and sends them to the controller (§4.4).
//! Only this node gives a controller the truth. It serves for flights as the thesis prints them
//! (`manifests/thesis`), and separates an estimator's share in an error from a controller's. A result that it
//! had a part in holds for no vehicle.

use crate::sensing::TruthInputs;
use component::context::{NodeContext, StepContext};
use component::messages::StateEstimate;
use component::{Component, Info, OutputPorts, StepError};
use diagnostics::ParameterError;

/// Parameters of the estimator: none.
#[derive(Debug, Clone, Copy, component::Parameters)]
pub struct Parameters {}

/// Outputs of the component.
#[derive(Debug, OutputPorts)]
pub struct Outputs {
    /// The truth; its standard deviations are 0.
    pub estimate: StateEstimate,
}

/// The component `ideal`.
///
/// ```
/// use component::messages::PlantState;
/// use sensors::ideal::Ideal;
/// use sensors::sensing::TruthInputs;
///
/// let mut ideal = component::Harness::<Ideal>::from_json(&serde_json::json!({})).unwrap();
/// let state = PlantState { velocity: [0.1, 0.0, -0.2].into(), ..Default::default() };
/// let estimate = ideal.step(TruthInputs { state: &state }).unwrap().estimate;
/// assert_eq!((estimate.velocity, estimate.velocity_sigma.z), (state.velocity, 0.0));
/// ```
#[derive(Debug)]
pub struct Ideal;

impl Component for Ideal {
    const INFO: Info =
        Info::new("ideal", "the truth as an estimate, for comparisons alone: no sensor is that good");
    type Parameters = Parameters;
    type Inputs<'a> = TruthInputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new(Parameters {}: Parameters, _: &NodeContext<'_>) -> Result<Self, ParameterError> {
        Ok(Self)
    }

    fn initial(&self) {}

    fn step(
        &self,
        _: &StepContext<'_>,
        TruthInputs { state }: TruthInputs<'_>,
        (): &mut (),
    ) -> Result<Outputs, StepError> {
        let estimate = StateEstimate {
            position: state.position,
            velocity: state.velocity,
            attitude: state.attitude,
            angular_velocity: state.angular_velocity,
            ..Default::default()
        };
        Ok(Outputs { estimate })
    }
}
