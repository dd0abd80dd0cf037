//! Depths in the graph of a run: in their order its nodes can step one after the other.

use crate::membership::Membership;
use crate::plan::Plan;

/// Length of the longest chain of inputs without delay that ends in the first instance of each node. A backup counts
/// as a publisher beside the instance that it shadows.
pub(crate) fn depths(plan: &Plan, membership: &Membership) -> Vec<usize> {
    let publishers: Vec<usize> = (0..plan.topics.len()).map(|topic| plan.publisher(topic)).collect();
    // Depths of the primary and of the backup.
    let mut depths = vec![[0_usize; 2]; plan.nodes.len()];
    // A chain has at most all instances; the graph has no cycle.
    for _ in 0..=2 * plan.nodes.len() {
        let before = depths.clone();
        for (node, instances) in membership.nodes.iter().enumerate() {
            let both = [Some(&instances.primary), instances.backup.as_ref()];
            for (role, instance) in both.into_iter().enumerate() {
                let inputs = instance.into_iter().flat_map(|instance| &instance.plan.inputs);
                let sources =
                    inputs.filter(|input| input.delay_ticks == 0).map(|input| publishers[input.topic]);
                depths[node][role] = sources
                    .map(|source| 1 + depths[source].into_iter().max().unwrap_or(0))
                    .max()
                    .unwrap_or(0);
            }
        }
        if depths == before {
            break;
        }
    }
    depths.into_iter().map(|[primary, _]| primary).collect()
}

#[cfg(test)]
mod tests {
    use super::depths;
    use crate::membership::{Instance, Membership};
    use crate::plan::{InputPlan, NodePlan, OutputPlan, Plan, TopicPlan};
    use crate::sample_ticks::SampleTicks;

    fn topic(name: &str) -> TopicPlan {
        TopicPlan { name: name.to_owned(), type_name: "a/msg/B".to_owned(), ticks: SampleTicks::every(1) }
    }

    fn node(name: &str, reads: &[(usize, u32)], topic: usize) -> NodePlan {
        let input = |&(topic, delay_ticks)| InputPlan {
            port: format!("i{topic}"),
            topic,
            delay_ticks,
            initial: None,
        };
        let output = OutputPlan { port: "out".to_owned(), topic };
        NodePlan::for_test(name, reads.iter().map(input).collect(), vec![output])
    }

    /// `a` closes a loop with a delay; a backup of `b` that reads `c` has `d`, which reads `b`, step behind `c`.
    #[test]
    fn a_backup_that_reads_more_moves_its_readers_back() {
        let nodes = vec![
            node("a", &[(3, 1)], 0),
            node("b", &[(0, 0)], 1),
            node("c", &[(0, 0)], 2),
            node("d", &[(1, 0)], 3),
        ];
        let plan = Plan::for_test(10, ["/a", "/b", "/c", "/d"].map(topic).into(), nodes);
        let mut membership = Membership::first(&plan);
        assert_eq!(depths(&plan, &membership), [0, 1, 1, 2]);
        let backup = node("b", &[(2, 0)], 1);
        membership.nodes[1].backup =
            Some(Instance { generation: 1, join_tick: 0, shadows: true, plan: backup });
        assert_eq!(depths(&plan, &membership), [0, 1, 1, 3]);
    }
}
