//! Graph questions about a run: cycles, depths, and which nodes share a core.

use bus::plan::{GroupPlan, NodePlan, Plan};

/// A cycle of edges without delay, as node indices in the direction of the data.
pub fn zero_delay_cycle(nodes: &[NodePlan], publisher: impl Fn(usize) -> usize) -> Option<Vec<usize>> {
    let mut is_visited = vec![false; nodes.len()];
    (0..nodes.len()).find_map(|node| visit(nodes, &publisher, node, &mut is_visited, &mut Vec::new()))
}

/// Walks from consumer to publisher; a node met twice on one path closes a cycle.
fn visit(
    nodes: &[NodePlan],
    publisher: &impl Fn(usize) -> usize,
    node: usize,
    is_visited: &mut [bool],
    path: &mut Vec<usize>,
) -> Option<Vec<usize>> {
    if let Some(start) = path.iter().position(|&other| other == node) {
        return Some(path[start..].iter().rev().copied().collect());
    }
    if std::mem::replace(&mut is_visited[node], true) {
        return None;
    }
    path.push(node);
    let sources = nodes[node].inputs.iter().filter(|input| input.delay_ticks == 0).map(|input| input.topic);
    let cycle = sources.map(publisher).find_map(|source| visit(nodes, publisher, source, is_visited, path));
    path.pop();
    cycle
}

/// The length of the longest chain of edges without delay that ends in each node.
pub fn depths(nodes: &[NodePlan], publisher: impl Fn(usize) -> usize) -> Vec<usize> {
    let mut depths = vec![0; nodes.len()];
    // As many rounds as a chain can have nodes; the graph has no cycle.
    for _ in 0..nodes.len() {
        for (index, node) in nodes.iter().enumerate() {
            let sources = node.inputs.iter().filter(|input| input.delay_ticks == 0);
            let deepest = sources.map(|input| depths[publisher(input.topic)] + 1).max();
            depths[index] = deepest.unwrap_or(0);
        }
    }
    depths
}

/// Gives a core to every node without one. Each feedback loop has a core of its own while they last. Nodes in no loop
/// (pilots, players, recorders, the clock) share the last core. If there are more loops, they take turns on all
/// cores, the last included.
///
/// A loop is a serial chain: on one core a hop costs a context switch, across cores it costs an
/// interrupt and a wake-up, ten times as much (docs/decisions/002-waiting-and-placement.md).
pub fn place(plan: &mut Plan, clock_cpu: Option<usize>) {
    let cores = bus::process::allowed_cores();
    let (Some(&last), true) = (cores.last(), cores.len() > 1) else {
        plan.clock_cpu = clock_cpu;
        return;
    };
    let loops = feedback_loops(plan);
    let count = loops.iter().flatten().max().map_or(0, |number| number + 1);
    let has_loop = count > 0;
    let loop_cores = if count < cores.len() { &cores[..cores.len() - 1] } else { &cores[..] };
    plan.clock_cpu = clock_cpu.or(Some(last));
    for (index, (node, in_loop)) in plan.nodes.iter_mut().zip(loops).enumerate() {
        // Without a loop there is no serial chain to keep together: nodes that compute are spread instead.
        let spread = (!has_loop && !node.outputs.is_empty()).then_some(index);
        let default = in_loop.or(spread).map_or(last, |number| loop_cores[number % loop_cores.len()]);
        node.cpu = node.cpu.or(Some(default));
    }
}

/// Gives each of `groups` without a core that of its first member in a feedback loop, or else of its first member. All
/// members get the core of their group.
pub fn place_groups(plan: &mut Plan, mut groups: Vec<GroupPlan>) -> Vec<GroupPlan> {
    let loops = feedback_loops(plan);
    for group in &mut groups {
        let nodes: Vec<usize> = group.members.iter().map(|member| member.node).collect();
        let leading = nodes.iter().copied().find(|&node| loops[node].is_some()).or(nodes.first().copied());
        group.cpu = group.cpu.or_else(|| plan.nodes[leading?].cpu);
        nodes.into_iter().for_each(|node| plan.nodes[node].cpu = group.cpu);
    }
    groups
}

/// Number of the feedback loop of each node, if it is in one: nodes that reach each other, delays included.
fn feedback_loops(plan: &Plan) -> Vec<Option<usize>> {
    let count = plan.nodes.len();
    let mut reaches = vec![vec![false; count]; count];
    for (index, node) in plan.nodes.iter().enumerate() {
        node.inputs.iter().for_each(|input| reaches[plan.publisher(input.topic)][index] = true);
    }
    for via in 0..count {
        for from in 0..count {
            if reaches[from][via] {
                let onward = reaches[via].clone();
                reaches[from].iter_mut().zip(onward).for_each(|(reach, next)| *reach |= next);
            }
        }
    }
    let mut loops: Vec<Option<usize>> = vec![None; count];
    let mut number = 0;
    for node in 0..count {
        if reaches[node][node] && loops[node].is_none() {
            let nodes = (0..count).filter(|&other| reaches[node][other] && reaches[other][node]);
            nodes.for_each(|node| loops[node] = Some(number));
            number += 1;
        }
    }
    loops
}
