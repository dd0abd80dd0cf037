//! The variometer: the rate of climb, behind a lag, with white noise.

use component::context::{NodeContext, StepContext};
use component::messages::{Climb, PlantState};
use component::random::{self, Stream, normal, stream};
use component::{Component, Info, InputPorts, Message, OutputPorts, StepError};
use diagnostics::ParameterError;
use diagnostics::parameter::{not_negative, positive};

/// Parameters of the variometer. Tuned, no source.
#[derive(Debug, component::Parameters)]
pub struct Parameters {
    /// Time constant of the lag.
    #[parameter(check = positive)]
    lag_s: f64,
    /// Standard deviation of the noise.
    #[parameter(default = 0.0, check = not_negative)]
    noise_m_s: f64,
}

/// Inputs.
#[derive(Debug, InputPorts)]
pub struct Inputs<'a> {
    /// The truth.
    pub state: &'a PlantState,
}

/// Outputs.
#[derive(Debug, OutputPorts)]
pub struct Outputs {
    /// The reading.
    pub climb: Climb,
}

/// State.
#[derive(Debug, Clone, Copy, Default, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/VariometerState")]
pub struct State {
    /// The reading behind the lag.
    #[field(unit = "m/s", frame = "world")]
    rate: f64,
}

/// A variometer.
#[derive(Debug)]
pub struct Variometer {
    /// The part of a change that a reading follows in one period.
    followed: f64,
    noise_m_s: f64,
    random: Stream,
}

impl Component for Variometer {
    const INFO: Info = Info::new("variometer", "rate of climb with lag and noise");
    type Parameters = Parameters;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new(parameters: Parameters, context: &NodeContext<'_>) -> Result<Self, ParameterError> {
        let followed = 1.0 - libm::exp(-context.period_s() / parameters.lag_s);
        let random = stream(context.seed, context.name);
        Ok(Self { followed, noise_m_s: parameters.noise_m_s, random })
    }

    fn initial(&self) -> State {
        State::default()
    }

    fn step(
        &self,
        context: &StepContext<'_>,
        inputs: Inputs<'_>,
        state: &mut State,
    ) -> Result<Outputs, StepError> {
        state.rate += self.followed * (inputs.state.velocity.z - state.rate);
        // The position in the stream follows from the tick, so that it is no part of the state.
        let mut random = random::at(&self.random, u128::from(context.tick()) << 8);
        let rate = state.rate + self.noise_m_s * normal(&mut random);
        Ok(Outputs { climb: Climb { rate, ..Default::default() } })
    }
}
