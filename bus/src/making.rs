//! Components, made for the nodes of a plan.

use crate::context::NodeContext;
use crate::plan::{NodePlan, Plan};
use crate::registration::{Instance, Registration};
use crate::state_transfer::StateLayout;
use diagnostics::ParameterError;
use inputs::InputFiles;
use std::path::Path;

/// True if `component`, as `node` of `plan`, goes on in flight from the state of `before` as `node_before`; the run has read
/// `files`.
///
/// # Errors
/// If one of the two cannot be made.
pub fn goes_on_from(
    (component, node): (&Registration, &NodePlan),
    (before, node_before): (&Registration, &NodePlan),
    plan: &Plan,
    files: &InputFiles,
) -> Result<bool, ParameterError> {
    let layout = |component: &Registration, node| -> Result<Option<StateLayout>, ParameterError> {
        let made = make_for(component, plan, node, files, None)?;
        Ok(StateLayout::of(component.transfer, made.state_size(), made.configuration()))
    };
    let (after, before) = (layout(component, node)?, layout(before, node_before)?);
    Ok(after.is_some() && after == before)
}

/// `component`, made for `node` of `plan` from the run's `files`; `run_dir` is the directory of the run, if it has one.
pub(crate) fn make_for(
    component: &Registration,
    plan: &Plan,
    node: &NodePlan,
    files: &InputFiles,
    run_dir: Option<&Path>,
) -> Result<Box<dyn Instance>, ParameterError> {
    let inputs: Vec<&str> = node.inputs.iter().map(|input| input.port.as_str()).collect();
    let outputs: Vec<&str> = node.outputs.iter().map(|output| output.port.as_str()).collect();
    let context = NodeContext::new(&node.name, &inputs)
        .naming(&outputs)
        .timed(plan.tick_ns, node.period_ticks, plan.duration_ticks)
        .seeded(plan.seed)
        .given(files)
        .in_run(run_dir);
    component.make(&node.parameters, &context)
}
