//! Flights below the ground, z = 0, with a backend that has no contacts.

use anyhow::Result;
use bus::plan::{NodePlan, Plan};
use recorder::node::SHADOW_PREFIX;
use recorder::reader::Recording;
use recorder::series::Series;
use serde::Serialize;
use std::fmt;

use crate::beyond::STATE;

/// Depth below the ground that is reported, m: free flights about z = 0 pass it by centimetres. Tuned, no source.
const DEPTH_MIN_M: f64 = 0.05;

/// A vehicle that flew below the ground. Its text is a line of the summary.
///
/// ```
/// use report::ground::BelowGround;
/// let below = BelowGround { topic: "/plant/state".to_owned(), from_s: 2.6, depth_m: 13.0 };
/// assert_eq!(
///     below.to_string(),
///     "  below the ground on /plant/state: first at 2.600 s, 13.000 m at the deepest; set `backend = \"rapier\"` for a ground that carries"
/// );
/// ```
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BelowGround {
    /// Topic of the states.
    pub topic: String,
    /// Simulated time at which the centre of mass was first below the ground, s.
    pub from_s: f64,
    /// Greatest depth of the centre of mass below the ground, m.
    pub depth_m: f64,
}

impl fmt::Display for BelowGround {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { topic, from_s, depth_m } = self;
        write!(
            f,
            "  below the ground on {topic}: first at {from_s:.3} s, {depth_m:.3} m at the deepest; set `backend = \"rapier\"` for a \
             ground that carries"
        )
    }
}

/// The flights in the `recording` of a run of `plan` that went below the ground.
///
/// # Errors
/// If the recording is damaged.
pub(crate) fn of(recording: &Recording, plan: &Plan) -> Result<Vec<BelowGround>> {
    let mut topics = free_topics(plan);
    topics.retain(|topic| recording.topics().contains_key(*topic));
    if topics.is_empty() {
        return Ok(Vec::new());
    }
    let heights: Vec<(&str, &str)> = topics.iter().map(|topic| (*topic, "position.z")).collect();
    let heights = recording.series(&heights)?;
    Ok(topics.iter().zip(&heights).filter_map(|(topic, heights)| below(topic, heights)).collect())
}

/// The topics with states of plants that touch nothing. A plant that is set to measured states has the ground of the measured flight.
fn free_topics(plan: &Plan) -> Vec<&str> {
    let is_free = |node: &&NodePlan| {
        node.is_built_in
            && !node.name.starts_with(SHADOW_PREFIX)
            && node.parameters.get("vehicle").is_some()
            && node.parameters.get("backend").is_none_or(|backend| backend == "newton-euler")
            && !node.inputs.iter().any(|input| input.port == "measured")
    };
    let outputs = plan.nodes.iter().filter(is_free).flat_map(|node| &node.outputs);
    let topics = outputs.map(|output| &plan.topics[output.topic]);
    topics.filter(|topic| topic.type_name == STATE).map(|topic| topic.name.as_str()).collect()
}

/// The flight with these heights on `topic`, if it went below the ground.
fn below(topic: &str, heights: &Series) -> Option<BelowGround> {
    let place = heights.value.iter().position(|height_m| *height_m < -DEPTH_MIN_M)?;
    let lowest_m = heights.value.iter().copied().fold(f64::INFINITY, f64::min);
    let from_s = heights.time_ns[place] as f64 * 1e-9;
    Some(BelowGround { topic: topic.to_owned(), from_s, depth_m: -lowest_m })
}

#[cfg(test)]
mod tests {
    use super::{BelowGround, below};
    use recorder::series::Series;

    #[test]
    fn the_first_time_below_the_ground_and_the_deepest_place_are_told() {
        let heights = |value: &[f64]| Series {
            time_ns: (0..value.len() as u64).map(|number| number * 500_000_000).collect(),
            value: value.to_vec(),
            unit: "m".to_owned(),
        };
        assert_eq!(below("/a", &heights(&[1.0, -0.04, 0.5])), None, "centimetres");
        let found = below("/a", &heights(&[1.0, -0.04, -0.5, -2.0, 0.0]));
        assert_eq!(found, Some(BelowGround { topic: "/a".to_owned(), from_s: 1.0, depth_m: 2.0 }));
    }
}
