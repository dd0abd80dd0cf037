//! The traffic: gathers where the vehicles of a run are into one sample, for those that share a room.

use crate::backend::TRAFFIC_MAX;
use component::context::{NodeContext, StepContext};
use component::messages::{PlantState, Traffic as Gathered};
use component::ports::Many;
use component::{Component, Info, OutputPorts, StepError};
use diagnostics::parameter::{ParameterError, refuse};

/// Gathers the states of the plants of a run.
///
/// ```
/// use component::context::NodeContext;
/// use plant::traffic::Traffic;
///
/// let context = NodeContext::new("traffic", &["one", "two"]);
/// let parameters = serde_json::from_str("{}").unwrap();
/// assert!(component::Harness::<Traffic>::in_context(parameters, &context).is_ok(), "up to 32 vehicles");
/// ```
#[derive(Debug)]
pub struct Traffic;

/// Parameters of the traffic: none.
#[derive(Debug, component::Parameters)]
pub struct Parameters {}

/// Outputs of the traffic.
#[derive(Debug, OutputPorts)]
pub struct Outputs {
    /// The states, in the order of the inputs' names.
    pub traffic: Gathered,
}

impl Component for Traffic {
    const INFO: Info = Info::new("traffic", "gathers the states of up to 32 plants");
    type Parameters = Parameters;
    type Inputs<'a> = Many<'a, PlantState>;
    type Outputs = Outputs;
    type State = ();

    fn new(Parameters {}: Parameters, context: &NodeContext<'_>) -> Result<Self, ParameterError> {
        let count = context.inputs.len();
        refuse(count > TRAFFIC_MAX, "", || {
            format!("{count} inputs, expected at most {TRAFFIC_MAX} vehicles")
        })
        .map_err(|error| error.advised("leave inputs out: a second `traffic` takes the others"))?;
        Ok(Self)
    }

    fn initial(&self) {}

    fn step(
        &self,
        _: &StepContext<'_>,
        states: Many<'_, PlantState>,
        (): &mut (),
    ) -> Result<Outputs, StepError> {
        let mut traffic = Gathered::default();
        for (number, state) in states.iter().enumerate() {
            (traffic.position[number], traffic.velocity[number]) = (state.position, state.velocity);
            traffic.count += 1;
        }
        Ok(Outputs { traffic })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use component::Harness;

    #[test]
    fn as_many_as_a_message_holds_share_a_room_and_no_more() {
        assert_eq!(Gathered::default().position.len(), TRAFFIC_MAX);
        let names: Vec<String> = (0..=TRAFFIC_MAX).map(|number| format!("h{number:02}")).collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let made = |count: usize| {
            let context = NodeContext::new("traffic", &names[..count]);
            Harness::<Traffic>::in_context(serde_json::from_str("{}").unwrap(), &context).map(|_| ())
        };
        assert_eq!((made(20), made(TRAFFIC_MAX)), (Ok(()), Ok(())));
        assert!(made(TRAFFIC_MAX + 1).unwrap_err().to_string().contains("at most 32 vehicles"));
    }
}
